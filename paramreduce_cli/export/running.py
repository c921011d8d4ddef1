"""Exported functions, run here: what a controller would call, and how long it takes."""

from __future__ import annotations

import ctypes
import time
import warnings
from collections.abc import Callable, Mapping

import numpy as np

from paramreduce_cli.errors import DataError, ParamreduceWarning
from paramreduce_cli.excitation.simulation import MassAndBias, TextbookMassAndBias
from paramreduce_cli.export.code_generation import Exported, make_exported_model
from paramreduce_cli.export.exported_model import ExportedModel
from paramreduce_cli.expressions.compiled import get_address, load
from paramreduce_cli.expressions.functions import Argument, Function
from paramreduce_cli.multibody.dynamics import Dynamics
from paramreduce_cli.records import (
    FloatArray,
    LoopEvaluation,
    Mechanism,
    Model,
    ReducedModel,
    Speed,
)

_ROUNDS, _TURNS = 20, 9
"""Evaluations of every state in one go, and how often each model is timed."""

_REPEATED = """
void repeat_{function}(long rounds, long n, const double *phi, const double *const *in, double *const *out) {{
  (void)phi;
  for (long r = 0; r < rounds; ++r)
    for (long k = 0; k < n; ++k)
      {stem}_{function}({arguments});
}}
"""
_LOOPS = """
void repeat_states(long rounds, long n, const double *q, const double *z, const double *dz, const double *ddz) {{
  double guess[{n_q}], R[{n_R}], b[{n_d}], dq[{n_q}], ddq[{n_q}];
  for (long r = 0; r < rounds; ++r)
    for (long k = 0; k < n; ++k) {{
      for (int i = 0; i < {n_q}; ++i) guess[i] = q[k * {n_q} + i];
      for (int i = 0; i < {n_R}; ++i) R[i] = 0;
      {stem}_states(z + k * {n_z}, dz + k * {n_z}, ddz + k * {n_z}, 0, guess, R, b, dq, ddq);
    }}
}}
"""
_EVALUATION = """
int evaluate(const double *phi, const double *z, const double *dz, double *q, double *R, double *M, double *delta) {{
  double b[{n_d}], dq[{n_q}], ddq[{n_q}], ddz[{n_z}];
  (void)phi;
  for (int i = 0; i < {n_z}; ++i) ddz[i] = 0;
  if ({stem}_states(z, dz, ddz, 0, q, R, b, dq, ddq) < 0) return -1;
  {stem}_direct_dynamics({arguments}, M, delta);
  return 0;
}}
"""


class CompiledModel:
    """The inverse and direct dynamics of a model, from its exported C code.

    Args:
        mechanism: Mechanism of the robot.
        exported: The model.
    """

    def __init__(self, mechanism: Mechanism, exported: ExportedModel) -> None:
        self.mechanism, self.exported = mechanism, exported
        self.phi = np.array([parameter.value for parameter in exported.parameters])
        self.library = load(self._write_source())
        """The compiled code; None without a compiler."""

    def _write_source(self) -> str:
        """Return the C source with its header, and the loops that are called from here."""
        from paramreduce_cli.export.languages.c import write_scalar_source  # late: loads templates

        exported = self.exported
        stem, source = write_scalar_source(exported)
        parts = [source]
        for function in exported.functions:
            states = iter(a for a in function.arguments if a.name != "phi")
            texts = {a.name: f"in[{i}] + k * {a.size}" for i, a in enumerate(states)}
            given = [texts.get(a.name, "phi") for a in function.arguments]
            given += [f"out[{i}] + k * {a.size}" for i, a in enumerate(function.results)]
            fields = {"stem": stem, "function": function.name, "arguments": ", ".join(given)}
            parts.append(_REPEATED.format(**fields))
        if self.mechanism.loops is not None:
            n_q, n_z = self.mechanism.n_q, self.mechanism.n_dof
            sizes = {"n_q": n_q, "n_z": n_z, "n_d": n_q - n_z, "n_R": (n_q - n_z) * n_z}
            parts.append(_LOOPS.format(stem=stem, **sizes))
            for function in exported.functions:
                if function.name == "direct_dynamics":
                    names = ", ".join(argument.name for argument in function.arguments)
                    parts.append(_EVALUATION.format(stem=stem, arguments=names, **sizes))
        return "".join(parts)

    def get_function(self, name: str) -> Function:
        """Return one of the model's functions by name."""
        return next(function for function in self.exported.functions if function.name == name)


def compile_model(
    model: Model, chosen: ReducedModel, what: Exported = Exported.BOTH
) -> CompiledModel:
    """Return a model's functions, compiled.

    Args:
        model: Model of the robot.
        chosen: The model.
        what: Functions to compile.

    Raises:
        FormulationError: The functions do not compute what the straightforward model does.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ParamreduceWarning)  # what is unsafe is said elsewhere
        exported = make_exported_model(model, chosen, title="", what=what)
    return CompiledModel(model.mechanism, exported)


class RunningModel:
    """The inverse or the direct dynamics of a model, from its exported C code; with loops, R and b are handed in.

    Without a compiler the model's expressions are evaluated in Python.

    Args:
        compiled: The model.
        name: Function to run: ``inverse_dynamics`` or ``direct_dynamics``.
    """

    def __init__(self, compiled: CompiledModel, name: str) -> None:
        self._compiled, self._function = compiled, compiled.get_function(name)

    @property
    def _states(self) -> list[Argument]:
        return [argument for argument in self._function.arguments if argument.name != "phi"]

    @property
    def takes(self) -> list[str]:
        """Names of what it is handed, in their order: of q, dq, ddq, R and b."""
        return [argument.name for argument in self._states]

    @property
    def n_operations(self) -> int:
        """Operations of the function."""
        return self._function.program.n_operations

    @property
    def language(self) -> str:
        """Language that the functions run in."""
        return "C" if self._compiled.library is not None else "Python"

    def __call__(self, *states: FloatArray, repetitions: int = 1) -> FloatArray:
        """Results for some states, (n_states, n): torques, or mass matrices row by row and then delta.

        Args:
            states: States in the order of `takes`: q, dq and ddq, (n_states, n_q) each, and with loops R, (n_states, n_q - n_dof, n_dof), and b, (n_states, n_q - n_dof).
            repetitions: Number of repetitions, for timing.
        """
        count = len(states[0])
        arrays = [np.ascontiguousarray(x).reshape(count, -1) for x in states]
        phi, library = self._compiled.phi, self._compiled.library
        if library is None:
            inputs = [np.broadcast_to(value, count) for value in phi]
            inputs += [column for array in arrays for column in array.T]
            return np.column_stack(self._function.program.evaluate(inputs))
        results = [np.empty((count, result.size)) for result in self._function.results]
        getattr(library, f"repeat_{self._function.name}")(
            ctypes.c_long(repetitions),
            ctypes.c_long(count),
            ctypes.c_void_p(phi.ctypes.data),
            *(
                (ctypes.c_void_p * len(some))(*(x.ctypes.data for x in some))
                for some in (arrays, results)
            ),
        )
        return np.concatenate(results, axis=1)

    def measure_time(self, *states: FloatArray) -> float:
        """Return the mean time of one evaluation over some states, s."""
        self(*states)
        repetitions = _ROUNDS if self._compiled.library is not None else 1
        started = time.perf_counter()
        self(*states, repetitions=repetitions)
        return (time.perf_counter() - started) / repetitions / len(states[0])


class CompiledForwardDynamics:
    """The mass matrix and bias of a compiled model at single states; loops are followed from the last state.

    Args:
        compiled: The model, with its direct dynamics.
    """

    def __init__(self, compiled: CompiledModel) -> None:
        mechanism = self._mechanism = compiled.mechanism
        n_q, n_z = mechanism.n_q, mechanism.n_dof
        self._phi = compiled.phi
        self._q, self._R = np.empty(n_q), np.empty((n_q - n_z, n_z))
        self._M, self._delta = np.empty((1, n_z, n_z)), np.empty((1, n_z))
        self._direct = RunningModel(compiled, "direct_dynamics")
        self._evaluate: Callable[..., int] | None = None
        if compiled.library is not None and mechanism.loops is not None:
            self._evaluate = compiled.library.evaluate
        self.restart()

    def restart(self) -> None:
        """Follow the loops from the assembly again, instead of from the last state."""
        if self._mechanism.loops is not None:
            self._q[:] = self._mechanism.loops.assembly
            self._R[:] = 0.0

    def __call__(self, z: FloatArray, dz: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return M, (n_dof, n_dof), and delta, (n_dof,), at positions z and velocities dz, (n_dof,) each.

        With loops, the next call overwrites both arrays.

        Raises:
            DataError: The loops cannot be closed.
        """
        n = z.size
        if self._evaluate is None:
            given = {"q": z[None], "dq": dz[None]}
            (row,) = self._direct(*(given[name] for name in self._direct.takes))
            return row[: n * n].reshape(n, n), row[n * n :]
        arrays = (self._phi, z, dz, self._q, self._R, self._M, self._delta)
        if self._evaluate(*(ctypes.c_void_p(get_address(array)) for array in arrays)):
            raise DataError(
                "the loops cannot be closed: the mechanism comes to a singular configuration or to the "
                "end of its reach"
            )
        return self._M[0], self._delta[0]


def make_forward_dynamics(compiled: CompiledModel, standard: FloatArray) -> MassAndBias:
    """Return the mass matrix and bias of a model: its compiled code, or the regressor without a compiler.

    Args:
        compiled: The model, with its direct dynamics.
        standard: All standard parameters of the model, (n_parameters,).
    """
    if compiled.library is None:
        return TextbookMassAndBias(Dynamics(compiled.mechanism), standard)
    return CompiledForwardDynamics(compiled)


def evaluate_loops(
    compiled: Mapping[str, CompiledModel], q: FloatArray, dz: FloatArray, ddz: FloatArray
) -> LoopEvaluation:
    """Count and time what a controller evaluates for closed loops.

    Args:
        compiled: Some models by name, the full one first.
        q: Coordinates that close the loops, (n_states, n_q).
        dz: Velocities of the independent coordinates, (n_states, n_dof).
        ddz: Accelerations, same shape.
    """
    first = next(iter(compiled.values()))
    newton, velocities, accelerations, rates = (
        function.program.n_operations for function in first.exported.loop_problems
    )
    seconds = None
    if first.library is not None:
        z = q[:, list(first.mechanism.independent)]
        arrays = [np.ascontiguousarray(x) for x in (q, z, dz, ddz)]
        pointers = [ctypes.c_void_p(x.ctypes.data) for x in arrays]
        timings = []
        for _ in range(_TURNS):
            started = time.perf_counter()
            first.library.repeat_states(ctypes.c_long(_ROUNDS), ctypes.c_long(len(q)), *pointers)
            timings.append((time.perf_counter() - started) / _ROUNDS / len(q))
        seconds = min(timings)
    inverse = {
        name: one.get_function("inverse_dynamics").program.n_operations
        for name, one in compiled.items()
    }
    return LoopEvaluation(newton, velocities, accelerations, rates, inverse, seconds)


def measure_speeds(models: Mapping[str, RunningModel], states: Mapping[str, FloatArray]) -> Speed:
    """Return the time per evaluation of several models on the same states."""
    # In turns, and the shortest: whatever else the machine does meets all of them alike.
    handed = {name: [states[key] for key in model.takes] for name, model in models.items()}
    turns = [
        {name: m.measure_time(*handed[name]) for name, m in models.items()} for _ in range(_TURNS)
    ]
    least = {name: min(timings[name] for timings in turns) for name in models}
    return Speed(least, next(m.language for m in models.values()))
