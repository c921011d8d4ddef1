"""Exported functions, run here: what a controller would call, and how long it takes."""

from __future__ import annotations

import ctypes
import time
import warnings
from collections.abc import Mapping

import numpy as np

from paramreduce_cli.errors import DataError, ParamreduceWarning
from paramreduce_cli.export.code_generation import Exported, make_exported_model
from paramreduce_cli.export.exported_model import ExportedModel
from paramreduce_cli.export.languages import languages
from paramreduce_cli.expressions.compiled import get_address, load
from paramreduce_cli.expressions.functions import Argument
from paramreduce_cli.records import FloatArray, LoopEvaluation, Model, ReducedModel, Speed

_ROUNDS, _TURNS = 20, 9
"""Evaluations of every state in one go, and how often each model is timed."""

_LOOP = """
void repeated(long rounds, long n, const double *phi, const double *const *in, double *const *out) {{
  for (long r = 0; r < rounds; ++r)
    for (long k = 0; k < n; ++k)
      {name}(phi, {arrays});
}}
"""


_LOOPS = """
void repeated(long rounds, long n, const double *q, const double *z, const double *dz, const double *ddz) {{
  double guess[{n_q}], R[{n_R}], b[{n_d}], dq[{n_q}], ddq[{n_q}];
  for (long r = 0; r < rounds; ++r)
    for (long k = 0; k < n; ++k) {{
      for (int i = 0; i < {n_q}; ++i) guess[i] = q[k * {n_q} + i];
      for (int i = 0; i < {n_R}; ++i) R[i] = 0;
      {name}(z + k * {n_z}, dz + k * {n_z}, ddz + k * {n_z}, 0, guess, R, b, dq, ddq);
    }}
}}
"""


def evaluate_loops(
    model: Model,
    running: Mapping[str, RunningModel],
    q: FloatArray,
    dz: FloatArray,
    ddz: FloatArray,
) -> LoopEvaluation:
    """Count and time what a controller evaluates for closed loops.

    Args:
        model: Model of the robot.
        running: Inverse dynamics of some models by name, the full one first.
        q: Coordinates that close the loops, (n_states, n_q).
        dz: Velocities of the independent coordinates, (n_states, n_dof).
        ddz: Accelerations, same shape.
    """
    exported = next(iter(running.values())).exported
    newton, velocities, accelerations, rates = (
        function.program.n_operations for function in exported.loop_problems
    )
    stem, text = _write_source(exported)
    n_q, n_z = model.mechanism.n_q, model.mechanism.n_dof
    sizes = {"n_q": n_q, "n_z": n_z, "n_d": n_q - n_z, "n_R": (n_q - n_z) * n_z}
    library = load(text + _LOOPS.format(name=f"{stem}_states", **sizes))
    seconds = None
    if library is not None:
        z = q[:, list(model.mechanism.independent)]
        arrays = [np.ascontiguousarray(x) for x in (q, z, dz, ddz)]
        pointers = [ctypes.c_void_p(x.ctypes.data) for x in arrays]
        timings = []
        for _ in range(_TURNS):
            started = time.perf_counter()
            library.repeated(ctypes.c_long(_ROUNDS), ctypes.c_long(len(q)), *pointers)
            timings.append((time.perf_counter() - started) / _ROUNDS / len(q))
        seconds = min(timings)
    inverse = {name: one.n_operations for name, one in running.items()}
    return LoopEvaluation(newton, velocities, accelerations, rates, inverse, seconds)


def _write_source(exported: ExportedModel) -> tuple[str, str]:
    """Return the prefix of the functions' names, and the C source with its header."""
    files: dict[str, bytes] = languages["c"](exported)
    stem = next(file[:-2] for file in files if file.endswith(".h"))
    header, source = (files[f"{stem}.{end}"].decode() for end in ("h", "c"))
    return stem, header + source.replace(f'#include "{stem}.h"', "")


_EVALUATION = """
int evaluate(const double *phi, const double *z, const double *dz, double *q, double *R, double *M, double *delta) {{
  double b[{n_d}], dq[{n_q}], ddq[{n_q}], ddz[{n_z}];
  for (int i = 0; i < {n_z}; ++i) ddz[i] = 0;
  if ({stem}_states(z, dz, ddz, 0, q, R, b, dq, ddq) < 0) return -1;
  {stem}_direct_dynamics({arguments}, M, delta);
  return 0;
}}
"""


class CompiledForwardDynamics:
    """The mass matrix and bias of a model at single states, from its exported C code.

    Loops are followed from the last state.

    Args:
        model: Model of the robot.
        chosen: The model, with expressions.
    """

    def __init__(self, model: Model, chosen: ReducedModel) -> None:
        mechanism = model.mechanism
        self._mechanism, self._phi = mechanism, np.ascontiguousarray(chosen.values)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ParamreduceWarning)
            exported = make_exported_model(model, chosen, title="", what=Exported.DDM)
        stem, text = _write_source(exported)
        (direct,) = exported.functions
        n_q, n_z = mechanism.n_q, mechanism.n_dof
        if mechanism.loops is not None:
            names = ", ".join(argument.name for argument in direct.arguments)
            sizes = {"n_q": n_q, "n_z": n_z, "n_d": n_q - n_z}
            text += _EVALUATION.format(stem=stem, arguments=names, **sizes)
        self._library = load(text)
        self._direct = f"{stem}_direct_dynamics"
        self._arguments = [argument.name for argument in direct.arguments]
        self._q, self._R = np.empty(n_q), np.empty((n_q - n_z, n_z))
        self._M, self._delta = np.empty((n_z, n_z)), np.empty(n_z)
        self.restart()

    @property
    def is_compiled(self) -> bool:
        """Whether there is compiled code; without a compiler it cannot be called."""
        return self._library is not None

    def restart(self) -> None:
        """Follow the loops from the assembly again, instead of from the last state."""
        if self._mechanism.loops is not None:
            self._q[:] = self._mechanism.loops.assembly
            self._R[:] = 0.0

    def __call__(self, z: FloatArray, dz: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return M, (n_dof, n_dof), and delta, (n_dof,), at positions z and velocities dz, (n_dof,) each.

        Raises:
            DataError: The loops cannot be closed.
        """
        assert self._library is not None
        arrays = {
            "phi": self._phi,
            "q": z,
            "dq": dz,
            "z": z,
            "dz": dz,
            "M": self._M,
            "delta": self._delta,
        }
        names = [*self._arguments, "M", "delta"]
        function = getattr(self._library, self._direct)
        if self._mechanism.loops is not None:
            arrays |= {"q": self._q, "R": self._R}
            names = ["phi", "z", "dz", "q", "R", "M", "delta"]
            function = self._library.evaluate
        failed = function(*(ctypes.c_void_p(get_address(arrays[name])) for name in names))
        if self._mechanism.loops is not None and failed:
            raise DataError("the loops cannot be closed")
        return self._M, self._delta


class RunningModel:
    """The inverse or the direct dynamics of a model, from its exported C code; with loops, R and b are handed in.

    Without a compiler the model's expressions are evaluated in Python.

    Args:
        model: Model of the robot.
        chosen: The model.
        what: Function to run.
    """

    def __init__(self, model: Model, chosen: ReducedModel, what: Exported = Exported.IDM) -> None:
        self._phi = np.ascontiguousarray(chosen.values)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ParamreduceWarning)  # nothing is simulated with it
            self.exported = make_exported_model(model, chosen, title="", what=what)
        (self._function,) = self.exported.functions
        stem, text = _write_source(self.exported)
        sides = {"in": self._states, "out": self._function.results}
        arrays = (
            f"{s}[{i}] + k * {a.size}" for s, side in sides.items() for i, a in enumerate(side)
        )
        name = f"{stem}_{self._function.name}"
        self._library = load(text + _LOOP.format(name=name, arrays=", ".join(arrays)))

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
        return "C" if self._library is not None else "Python"

    def __call__(self, *states: FloatArray, repetitions: int = 1) -> FloatArray:
        """Results for some states, (n_states, n): torques, or mass matrices row by row and then delta.

        Args:
            states: States in the order of `takes`: q, dq and ddq, (n_states, n_q) each, and with loops R, (n_states, n_q - n_dof, n_dof), and b, (n_states, n_q - n_dof).
            repetitions: Number of repetitions, for timing.
        """
        count = len(states[0])
        arrays = [np.ascontiguousarray(x).reshape(count, -1) for x in states]
        if self._library is None:
            inputs = [np.broadcast_to(value, count) for value in self._phi]
            inputs += [column for array in arrays for column in array.T]
            return np.column_stack(self._function.program.evaluate(inputs))
        results = [np.empty((count, result.size)) for result in self._function.results]
        self._library.repeated(
            ctypes.c_long(repetitions),
            ctypes.c_long(count),
            ctypes.c_void_p(self._phi.ctypes.data),
            *(
                (ctypes.c_void_p * len(some))(*(x.ctypes.data for x in some))
                for some in (arrays, results)
            ),
        )
        return np.concatenate(results, axis=1)

    def measure_time(self, *states: FloatArray) -> float:
        """Return the mean time of one evaluation over some states, s."""
        self(*states)
        repetitions = _ROUNDS if self._library is not None else 1
        started = time.perf_counter()
        self(*states, repetitions=repetitions)
        return (time.perf_counter() - started) / repetitions / len(states[0])


def measure_speeds(models: Mapping[str, RunningModel], states: Mapping[str, FloatArray]) -> Speed:
    """Return the time per evaluation of several models on the same states."""
    # In turns, and the shortest: whatever else the machine does meets all of them alike.
    handed = {name: [states[key] for key in model.takes] for name, model in models.items()}
    turns = [
        {name: m.measure_time(*handed[name]) for name, m in models.items()} for _ in range(_TURNS)
    ]
    least = {name: min(timings[name] for timings in turns) for name in models}
    return Speed(least, next(m.language for m in models.values()))
