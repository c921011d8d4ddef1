"""The demonstration of the report: control with the exported models."""

from __future__ import annotations

import ctypes
import time
from collections.abc import Callable

import numpy as np

from paramreduce_cli.config.schema import TrackingSection
from paramreduce_cli.expressions.compiled import load
from paramreduce_cli.expressions.functions import Function
from paramreduce_cli.multibody.dynamics import Dynamics
from paramreduce_cli.records import FloatArray, Model, Reduction, Validation
from paramreduce_cli.report.data import Motion
from paramreduce_cli.report.tracking import Path, Torque, Tracking, point_to_point, simulate
from paramreduce_cli.stages.export import chosen_model, export, exported_functions

_SEED = 7
_SHARE = 0.8
"""Of the validation set's range that the path keeps to."""
_ROUNDS = 20

_TIMER = """
void repeated(long rounds, long n, const double *phi, const double *q, const double *dq,
              const double *ddq, double *tau) {{
  for (long r = 0; r < rounds; ++r)
    for (long k = 0; k < n; ++k)
      {name}_inverse_dynamics(phi, q + k * {n}, dq + k * {n}, ddq + k * {n}, tau + k * {n});
}}
"""


def tracked(
    section: TrackingSection,
    model: Model,
    reduction: Reduction,
    validation: Validation,
    motion: Motion,
) -> Tracking:
    """Simulate control with the full and with the selected model on a path of its own.

    Args:
        section: What is asked for.
        model: Of the robot.
        reduction: Where the selected model is.
        validation: Says which one it is.
        motion: Of the validation set; the path keeps to its range and its speeds.
    """
    low, high = motion.z.min(axis=0), motion.z.max(axis=0)
    inset = (1 - _SHARE) / 2 * (high - low)
    speed = _SHARE * np.abs(motion.dz).max(axis=0)
    path = point_to_point(
        low + inset, high - inset, speed, section.moves, section.control_period, _SEED
    )
    arm = _arm(model)
    errors, seconds, language = {}, {}, ""
    for name in ("full", None):
        torque, spent, language = _controller(model, reduction, validation, name, path)
        title = "full model" if name else f"{validation.selected.n} parameters"
        errors[title] = simulate(path, torque, arm, section.bandwidth)
        seconds[title] = spent
    return Tracking(path, errors, seconds, language)


def _arm(model: Model) -> Callable[[FloatArray, FloatArray, FloatArray], FloatArray]:
    """Accelerations of the full model by plain recursion."""
    dynamics = Dynamics(model.mechanism)

    def accelerations(z: FloatArray, dz: FloatArray, tau: FloatArray) -> FloatArray:
        A, B = dynamics.direct_regressor(z[None], dz[None])
        result: FloatArray = np.linalg.solve(A[0] @ model.values, tau - B[0] @ model.values)
        return result

    return accelerations


def _controller(
    model: Model, reduction: Reduction, validation: Validation, name: str | None, path: Path
) -> tuple[Torque, float, str]:
    """The exported inverse dynamics, the time of one evaluation, and its language."""
    chosen = chosen_model(name, model, reduction, validation)
    phi = np.ascontiguousarray(chosen.values)
    files = export(model, chosen, kind="c", what="idm", constant=False, single=False)
    stem = next(file[:-2] for file in files if file.endswith(".h"))
    header, source = (files[f"{stem}.{end}"].decode() for end in ("h", "c"))
    text = header + source.replace(f'#include "{stem}.h"', "")
    library = load(text + _TIMER.format(name=stem, n=model.mechanism.n_q))
    if library is None:
        (function,) = exported_functions(model, chosen, "idm", constant=False)
        return _interpreted(function, phi, path)

    def pointer(array: FloatArray) -> ctypes.c_void_p:
        return ctypes.c_void_p(array.ctypes.data)

    def evaluated(q: FloatArray, dq: FloatArray, ddq: FloatArray, rounds: int) -> FloatArray:
        arrays = [np.ascontiguousarray(x) for x in (phi, q, dq, ddq)]
        tau = np.empty_like(arrays[1])
        library.repeated(
            ctypes.c_long(rounds), ctypes.c_long(len(q)), *map(pointer, arrays), pointer(tau)
        )
        return tau

    evaluated(path.z, path.dz, path.ddz, 1)
    started = time.perf_counter()
    evaluated(path.z, path.dz, path.ddz, _ROUNDS)
    spent = (time.perf_counter() - started) / _ROUNDS / path.time.size
    return lambda z, dz, ddz: evaluated(z[None], dz[None], ddz[None], 1)[0], spent, "C"


def _interpreted(function: Function, phi: FloatArray, path: Path) -> tuple[Torque, float, str]:
    def torque(z: FloatArray, dz: FloatArray, ddz: FloatArray) -> FloatArray:
        inputs = [np.asarray(x) for x in (*phi, *z, *dz, *ddz)]
        return np.array(function.program.evaluated(inputs))

    started = time.perf_counter()
    for k in range(_ROUNDS):
        torque(path.z[k], path.dz[k], path.ddz[k])
    return torque, (time.perf_counter() - started) / _ROUNDS, "Python"
