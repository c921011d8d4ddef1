"""Exported inverse dynamics, run here: what a controller would call, and how long it takes."""

import ctypes
import time
from collections.abc import Mapping

import numpy as np

from paramreduce_cli.export.writing import Exported, export, exported_functions
from paramreduce_cli.expressions.compiled import load
from paramreduce_cli.expressions.functions import Function
from paramreduce_cli.records import FloatArray, Model, ReducedModel, Speed

_ROUNDS, _TURNS = 20, 9
"""Evaluations of every state in one go, and how often each model is timed."""

_LOOP = """
void repeated(long rounds, long n, const double *phi, const double *q, const double *dq,
              const double *ddq, double *tau) {{
  for (long r = 0; r < rounds; ++r)
    for (long k = 0; k < n; ++k)
      {name}_inverse_dynamics(phi, q + k * {n}, dq + k * {n}, ddq + k * {n}, tau + k * {n});
}}
"""


class RunningModel:
    """The inverse dynamics of a model of an open tree, from its exported C code.

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
        self._library = load(text + _LOOP.format(name=stem, n=model.mechanism.n_q))
        self._function: Function | None = None
        if self._library is None:
            (self._function,) = exported_functions(model, chosen, Exported.IDM)

    @property
    def language(self) -> str:
        """In which it runs."""
        return "C" if self._library is not None else "Python"

    def __call__(
        self, q: FloatArray, dq: FloatArray, ddq: FloatArray, rounds: int = 1
    ) -> FloatArray:
        """Torques of some states, (n_states, n_q); the same is done several times if asked for."""
        arrays = [np.ascontiguousarray(x) for x in (q, dq, ddq)]
        if self._function is not None:
            inputs = [np.broadcast_to(value, len(q)) for value in self._phi]
            inputs += [column for array in arrays for column in array.T]
            return np.column_stack(self._function.program.evaluated(inputs))
        assert self._library is not None
        tau = np.empty_like(arrays[0])
        pointers = (ctypes.c_void_p(x.ctypes.data) for x in (self._phi, *arrays, tau))
        self._library.repeated(ctypes.c_long(rounds), ctypes.c_long(len(q)), *pointers)
        return tau

    def seconds(self, q: FloatArray, dq: FloatArray, ddq: FloatArray) -> float:
        """Of one evaluation, mean over some states, s."""
        self(q, dq, ddq)
        rounds = _ROUNDS if self._library is not None else 1
        started = time.perf_counter()
        self(q, dq, ddq, rounds)
        return (time.perf_counter() - started) / rounds / len(q)


def speed(
    models: Mapping[str, RunningModel], q: FloatArray, dq: FloatArray, ddq: FloatArray
) -> Speed:
    """How long models take on the same states, (n_states, n_q) each."""
    # In turns, and the shortest: whatever else the machine does meets all of them alike.
    turns = [{name: m.seconds(q, dq, ddq) for name, m in models.items()} for _ in range(_TURNS)]
    least = {name: min(turn[name] for turn in turns) for name in models}
    return Speed(least, next(m.language for m in models.values()))
