"""Moves from rest to rest between random poses."""

from itertools import pairwise

import numpy as np

from paramreduce_cli.records import FloatArray, Paths

_PEAK_SPEED = 1.875
"""Peak speed of a quintic of unit length in unit time."""


def plan_paths(
    low: FloatArray, high: FloatArray, speed: FloatArray, moves: int, period: float, seeds: range
) -> Paths:
    """Return paths of several moves, quintic in time.

    Args:
        low: Smallest coordinates, (n_dof,), rad or m.
        high: Largest coordinates.
        speed: Largest speeds, (n_dof,).
        moves: Number of moves in each path.
        period: Control period, s.
        seeds: Seeds of the poses, one for each path.
    """
    paths = [_plan_path(low, high, speed, moves, period, seed) for seed in seeds]
    samples = np.array([z.shape[0] for z, _, _ in paths])
    padded = [
        [np.pad(x, ((0, samples.max() - x.shape[0]), (0, 0)), mode="edge") for x in path]
        for path in paths
    ]
    z, dz, ddz = (np.stack(column, axis=1) for column in zip(*padded, strict=True))
    for k, n in enumerate(samples):
        dz[n:, k], ddz[n:, k] = 0.0, 0.0
    return Paths(np.arange(samples.max()) * period, samples, z, dz, ddz)


def _plan_path(
    low: FloatArray, high: FloatArray, speed: FloatArray, moves: int, period: float, seed: int
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return positions, velocities and accelerations of one path."""
    rng = np.random.default_rng(seed)
    poses = rng.uniform(low, high, size=(moves + 1, low.size))
    parts = []
    for start, end in pairwise(poses):
        step = end - start
        duration = max(float(np.max(_PEAK_SPEED * np.abs(step) / speed)), period)
        s = (np.arange(int(np.ceil(duration / period))) * period / duration)[:, None]
        parts.append(
            (
                start + step * s**3 * (10 - 15 * s + 6 * s**2),
                step / duration * 30 * s**2 * (1 - s) ** 2,
                step / duration**2 * 60 * s * (1 - s) * (1 - 2 * s),
            )
        )
    z, dz, ddz = (np.concatenate(column) for column in zip(*parts, strict=True))
    return z, dz, ddz
