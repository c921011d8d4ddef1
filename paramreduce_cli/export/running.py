"""Exported inverse dynamics, run here: what a controller would call, and how long it takes."""

import ctypes
import time
from collections.abc import Mapping, Sequence

import numpy as np

from paramreduce_cli.export.writing import Exported, export, exported_functions
from paramreduce_cli.expressions.compiled import load
from paramreduce_cli.expressions.functions import Function
from paramreduce_cli.records import FloatArray, Model, ReducedModel, Speed

_ROUNDS, _TURNS = 20, 9
"""Evaluations of every state in one go, and how often each model is timed."""

_LOOP = """
void repeated(long rounds, long n, const double *phi, const double *const *in, double *tau) {{
  for (long r = 0; r < rounds; ++r)
    for (long k = 0; k < n; ++k)
      {name}_inverse_dynamics(phi, {states}, tau + k * {n_dof});
}}
"""


class RunningModel:
    """The inverse dynamics of a model, from its exported C code; with loops, R is handed in.

    Without a compiler its expressions are evaluated in Python.

    Args:
        model: Of the robot.
        chosen: The model.
    """

    def __init__(self, model: Model, chosen: ReducedModel) -> None:
        self._phi = np.ascontiguousarray(chosen.values)
        files = export(model, chosen, title="", language="c", what=Exported.IDM)
        stem = next(file[:-2] for file in files if file.endswith(".h"))
        header, source = (files[f"{stem}.{end}"].decode() for end in ("h", "c"))
        text = header + source.replace(f'#include "{stem}.h"', "")
        n_q, self._n_dof = model.mechanism.n_q, model.mechanism.n_dof
        sizes = [n_q] * 3
        if model.mechanism.loops is not None:
            sizes.append((n_q - self._n_dof) * self._n_dof)
        states = ", ".join(f"in[{i}] + k * {size}" for i, size in enumerate(sizes))
        loop = _LOOP.format(name=stem, states=states, n_dof=self._n_dof)
        self._library = load(text + loop)
        self._function: Function | None = None
        if self._library is None:
            (self._function,) = exported_functions(model, chosen, Exported.IDM)

    @property
    def language(self) -> str:
        """In which it runs."""
        return "C" if self._library is not None else "Python"

    def __call__(self, *states: FloatArray, rounds: int = 1) -> FloatArray:
        """Torques of some states, (n_states, n_dof); the same is done several times if asked for.

        Args:
            states: q, dq and ddq, (n_states, n_q) each, and with loops R, (n_states, n_q - n_dof, n_dof).
            rounds: How often.
        """
        count = len(states[0])
        arrays = [np.ascontiguousarray(x).reshape(count, -1) for x in states]
        if self._function is not None:
            inputs = [np.broadcast_to(value, count) for value in self._phi]
            inputs += [column for array in arrays for column in array.T]
            return np.column_stack(self._function.program.evaluated(inputs))
        assert self._library is not None
        tau = np.empty((count, self._n_dof))
        pointers = (ctypes.c_void_p * len(arrays))(*(x.ctypes.data for x in arrays))
        phi, result = (ctypes.c_void_p(x.ctypes.data) for x in (self._phi, tau))
        self._library.repeated(ctypes.c_long(rounds), ctypes.c_long(count), phi, pointers, result)
        return tau

    def seconds(self, *states: FloatArray) -> float:
        """Of one evaluation, mean over some states, s."""
        self(*states)
        rounds = _ROUNDS if self._library is not None else 1
        started = time.perf_counter()
        self(*states, rounds=rounds)
        return (time.perf_counter() - started) / rounds / len(states[0])


def speed(models: Mapping[str, RunningModel], states: Sequence[FloatArray]) -> Speed:
    """How long models take on the same states, which are as those of :class:`RunningModel`."""
    # In turns, and the shortest: whatever else the machine does meets all of them alike.
    turns = [{name: m.seconds(*states) for name, m in models.items()} for _ in range(_TURNS)]
    least = {name: min(turn[name] for turn in turns) for name in models}
    return Speed(least, next(m.language for m in models.values()))
