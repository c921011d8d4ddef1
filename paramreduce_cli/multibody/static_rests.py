"""Rest positions of springs that balance gravity in the design position."""

from dataclasses import replace

import numpy as np

from paramreduce_cli.errors import Cause, NumericalError
from paramreduce_cli.multibody.dynamics import Dynamics
from paramreduce_cli.records import FloatArray, Kind, Mechanism

_BALANCED = 1e-6
"""Largest force that may be left, relative to the largest force without the springs."""


def set_static_rests(mechanism: Mechanism, phi: FloatArray) -> Mechanism:
    """Return the mechanism with rest positions for those springs whose rest is NaN, so that it is in static equilibrium.

    The design position is that of the closed loops, or zero for all coordinates. Balanced are the coordinates that these
    springs act on and that move a mass. Where several preloads do, the one with the least sum of squares is taken.

    Args:
        mechanism: Mechanism with assembled loops.
        phi: Standard parameters, (n_parameters,).

    Raises:
        NumericalError: The springs cannot balance the other forces.
    """
    static = [k for k, drive in enumerate(mechanism.drives) if np.isnan(drive.rest)]
    if not static:
        return mechanism
    owners = [mechanism.drives[k].name for k in static]
    columns = [
        k
        for owner in owners
        for k, parameter in enumerate(mechanism.parameters)
        if (parameter.kind, parameter.owner) == (Kind.STIFFNESS, owner)
    ]
    loops = mechanism.loops
    q = np.zeros(mechanism.n_q) if loops is None else loops.assembly
    still = np.zeros((1, mechanism.n_q))
    slack = Dynamics(_set_rests(mechanism, static, np.zeros(len(static))), once=True)
    taut = Dynamics(_set_rests(mechanism, static, np.ones(len(static))), once=True)
    K = slack.compute_regressor(q[None], still, still)[0]
    # The force of a spring goes as its position less its rest, so that the difference is its lever.
    levers = K[:, columns] - taut.compute_regressor(q[None], still, still)[0][:, columns]
    squares = np.sum(levers**2, axis=0)
    for owner, square in zip(owners, squares, strict=True):
        if square == 0:
            raise NumericalError(
                f"rest of {owner}: it acts on no coordinate in the design position, so that nothing can be balanced. "
                "Give a number.",
                Cause.STATIC,
            )
    positions = np.sum(levers * K[:, columns], axis=0) / squares
    M, _ = slack.compute_mass_matrix_and_bias(q[None], still, phi)
    stiffness = phi[columns]
    rows = (np.diag(M[0]) > 0) & levers.any(axis=1)
    others = phi.copy()
    others[columns] = 0.0
    force = (K @ others)[rows]
    preloads = np.linalg.lstsq(levers[rows], -force, rcond=None)[0]
    left = np.abs(levers[rows] @ preloads + force)
    if left.max(initial=0.0) > _BALANCED * np.abs(force).max(initial=0.0):
        names = np.array(mechanism.coordinate_names)[rows]
        raise NumericalError(
            f"rest of {', '.join(owners)}: no preloads balance the other forces in the design position; "
            f"{left.max():.3g} N (N m) are left at {names[left.argmax()]}. Give numbers, or more springs.",
            Cause.STATIC,
        )
    return _set_rests(mechanism, static, positions - preloads / stiffness)


def _set_rests(mechanism: Mechanism, static: list[int], rests: FloatArray) -> Mechanism:
    """Return the mechanism with other rest positions of some drives."""
    drives = list(mechanism.drives)
    for k, rest in zip(static, rests.tolist(), strict=True):
        drives[k] = replace(drives[k], rest=rest)
    return replace(mechanism, drives=tuple(drives))
