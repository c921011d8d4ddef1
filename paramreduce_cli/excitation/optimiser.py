"""One exciting trajectory: random starts, a smooth objective that sharpens, the best kept.

All starts go through the blunt levels; the most promising ones through the sharp levels,
with IPOPT's stopping rules tightened. The numbers were chosen by measurement on serial arms.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from paramreduce_cli.excitation.fourier import FourierBasis, fourier_basis, sample_times
from paramreduce_cli.excitation.ipopt import LOOSE, TIGHT, Minimum, minimise
from paramreduce_cli.excitation.limits import JointLimits, LimitMap, Mapping
from paramreduce_cli.excitation.objective import Excitation, FreeObjective
from paramreduce_cli.records import FloatArray, Trajectory


@dataclass(frozen=True)
class Level:
    """One step of the continuation from a blunt to a sharp objective."""

    sharpness: float
    """Exponent of the smooth condition number."""
    norm: float
    """Exponent of the smooth maximum of the limits."""


SCREENING = (Level(4, 30), Level(16, 80))
POLISHING = (Level(16, 80), Level(32, 150), Level(64, 300), Level(256, 1000))


@dataclass(frozen=True)
class Settings:
    """What is asked of every trajectory."""

    period: float
    """s"""
    harmonics: int
    points: int
    """Of the grid on which the criterion and the limits are evaluated."""
    limits: JointLimits
    mapping: Mapping
    starts: int
    polished: int
    """How many of the starts go on to the sharp levels."""
    max_iterations: int
    """Of IPOPT, per level."""
    scaling: str
    """Name of the scaling whose condition number is reported first."""


@dataclass
class _Candidate:
    free: FloatArray
    kappa_start: float
    value: float
    curvature: FloatArray | None
    iterations: int = 0
    status: str = ""


def optimise_trajectory(
    excitation: Excitation,
    settings: Settings,
    seed: list[int],
    progress: Callable[[float], None] = lambda share: None,
) -> Trajectory:
    """Find one exciting trajectory.

    Args:
        excitation: What is measured.
        settings: What is asked.
        seed: Of the random starts; the result depends on nothing else.
        progress: Told the share of the work done, 0 to 1.
    """
    started = time.process_time()
    basis = settings_basis(settings)
    limits = LimitMap(settings.limits, basis, settings.mapping)
    steps = settings.starts * len(SCREENING) + settings.polished * len(POLISHING)
    done = 0

    def descend(candidate: _Candidate, levels: tuple[Level, ...], rule: dict) -> None:
        nonlocal done
        for level in levels:
            objective = FreeObjective(excitation, basis, limits, level.sharpness, level.norm)
            end = minimise(
                objective,
                candidate.free.ravel(),
                settings.max_iterations,
                candidate.curvature,
                rule,
            )
            _advance(candidate, end)
            done += 1
            progress(done / steps)

    candidates = []
    for start in range(settings.starts):
        candidate = _start(excitation, settings, basis, limits, [*seed, start])
        descend(candidate, SCREENING, LOOSE)
        candidates.append(candidate)
    candidates.sort(key=lambda candidate: candidate.value)
    chosen = candidates[: settings.polished]
    for candidate in chosen:
        descend(candidate, POLISHING, TIGHT)
    best = min(chosen, key=lambda candidate: _exact_value(excitation, basis, limits, candidate))
    iterations = sum(candidate.iterations for candidate in candidates)
    return describe(
        excitation,
        settings,
        limits.scaled(best.free),
        kappa_start=best.kappa_start,
        cpu_seconds=time.process_time() - started,
        iterations=iterations,
        status=best.status,
    )


def settings_basis(settings: Settings) -> FourierBasis:
    """The series on the grid that the settings ask for."""
    times = sample_times(settings.period, settings.points)
    return fourier_basis(settings.period, settings.harmonics, times)


def describe(
    excitation: Excitation,
    settings: Settings,
    coefficients: FloatArray,
    *,
    kappa_start: float,
    cpu_seconds: float,
    iterations: int,
    status: str,
) -> Trajectory:
    """Measure a trajectory on the settings' grid: condition numbers, peaks, share of limits."""
    basis = settings_basis(settings)
    states = basis.states(coefficients)
    variants = excitation.condition_numbers(states)
    limits = settings.limits
    z, dz, ddz = states
    shares = [
        np.abs(z - (z.max(axis=0) + z.min(axis=0)) / 2) / limits.reach,
        np.abs(dz) / limits.velocity,
        np.abs(ddz) / limits.acceleration,
    ]
    return Trajectory(
        coefficients=coefficients,
        kappa=variants[settings.scaling],
        kappa_start=kappa_start,
        kappa_variants=variants,
        peak_position=np.abs(z - limits.middle).max(axis=0),
        peak_velocity=np.abs(dz).max(axis=0),
        reach=np.max([share.max(axis=0) for share in shares], axis=0),
        cpu_seconds=cpu_seconds,
        iterations=iterations,
        status=status,
    )


def _start(
    excitation: Excitation,
    settings: Settings,
    basis: FourierBasis,
    limits: LimitMap,
    seed: list[int],
) -> _Candidate:
    """A normal random series, scaled to its limits: on a scale of its own for every joint."""
    rng = np.random.default_rng(seed)
    free = rng.normal(size=(limits.n_dof, limits.n_columns))
    free[:, 1:] /= limits.shares(free)[:, None]
    kappa = excitation.condition_numbers(basis.states(limits.scaled(free)))[settings.scaling]
    return _Candidate(free, kappa, np.inf, None)


def _advance(candidate: _Candidate, end: Minimum) -> None:
    candidate.free = end.x.reshape(candidate.free.shape)
    candidate.value = end.value
    candidate.curvature = end.curvature
    candidate.iterations += end.iterations
    candidate.status = end.status


def _exact_value(
    excitation: Excitation, basis: FourierBasis, limits: LimitMap, candidate: _Candidate
) -> float:
    return excitation.value_and_gradient(basis, limits.scaled(candidate.free), np.inf)[0]
