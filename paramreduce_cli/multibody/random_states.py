"""Random states of a mechanism, on which ranks are decided."""

import numpy as np

from paramreduce_cli.multibody.kinematics import compute_body_poses
from paramreduce_cli.multibody.loops.coordinates import Coordinates
from paramreduce_cli.records import FloatArray, Mechanism

_SHARES = (0.25, 0.5, 1.0)
"""Shares of a random move, at which a mechanism with loops is looked at: it may not get further."""
_NEAREST = 0.1
"""Share of the assembly's distance to singularity that a state must keep: nearer, single rows
outweigh all others."""


def draw_states(
    mechanism: Mechanism, count: int, rng: np.random.Generator
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return random states: angles anywhere, slides as long as the mechanism, normally distributed speeds and
    accelerations.

    States of loops are reached from the assembly by random moves, as far as the loops can be followed without coming
    near a singular configuration; a state may stay at the assembly.

    Args:
        mechanism: Mechanism with assembled loops, if any.
        count: Number of states.
        rng: Random generator.

    Returns:
        q, dq, ddq, each (count, n_q).
    """
    bodies = [mechanism.bodies[k] for k in mechanism.independent]
    longest = _estimate_length(mechanism)
    reach = np.array([np.pi if body.joint == "revolute" else longest for body in bodies])
    shape = (count, mechanism.n_dof)
    z = rng.uniform(-1, 1, size=shape) * reach
    dz, ddz = rng.normal(size=shape), rng.normal(size=shape)
    if mechanism.loops is None:
        return z, dz, ddz
    coordinates, independent = Coordinates(mechanism), list(mechanism.independent)
    assembly = mechanism.loops.assembly
    least = _NEAREST * float(coordinates.compute_distance(assembly[None])[0])
    moves = rng.uniform(0, 1, size=(count, 1)) * z
    q = np.tile(assembly, (count, 1))
    for fraction in _SHARES:
        reached, _ = coordinates.follow(assembly[independent] + fraction * moves, q)
        safe = coordinates.compute_distance(reached) >= least
        q[safe] = reached[safe]
    return coordinates.compute_states(q[:, independent], dz, ddz, start=q)


def _estimate_length(mechanism: Mechanism) -> float:
    """Return a typical length, m: the largest named length, else the extent of the body frames in one position; 1 if
    all are in one place.
    """
    if mechanism.lengths:
        return max(abs(length.value) for length in mechanism.lengths)
    q = np.zeros(mechanism.n_q) if mechanism.loops is None else mechanism.loops.assembly
    return float(np.ptp(compute_body_poses(mechanism, q)[:, :3, 3], axis=0).max()) or 1.0
