"""Rest positions of springs that balance gravity in the design position."""

from collections.abc import Sequence
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
    names = [(parameter.kind, parameter.owner) for parameter in mechanism.parameters]
    columns = [names.index((Kind.STIFFNESS, owner)) for owner in owners]
    q = np.zeros(mechanism.n_q) if mechanism.loops is None else mechanism.loops.assembly
    q, still = q[None], np.zeros((1, mechanism.n_q))
    slack, taut = (
        Dynamics(_set_rests(mechanism, static, np.full(len(static), rest)), once=True)
        for rest in (0.0, 1.0)
    )
    K = slack.compute_regressor(q, still, still)[0]
    # The force of a spring goes as its position less its rest, so that the difference is its lever.
    levers = K[:, columns] - taut.compute_regressor(q, still, still)[0][:, columns]
    _reject_idle(owners, levers)
    positions = np.sum(levers * K[:, columns], axis=0) / np.sum(levers**2, axis=0)
    M, _ = slack.compute_mass_matrix_and_bias(q, still, phi)
    balanced = (np.diag(M[0]) > 0) & levers.any(axis=1)
    others = phi.copy()
    others[columns] = 0.0
    coordinates = np.array(mechanism.coordinate_names)[balanced].tolist()
    preloads = _find_preloads(owners, coordinates, levers[balanced], (K @ others)[balanced])
    return _set_rests(mechanism, static, positions - preloads / phi[columns])


def _reject_idle(owners: Sequence[str], levers: FloatArray) -> None:
    """Raise NumericalError if a spring acts on no coordinate.

    Args:
        owners: Names of the springs.
        levers: Forces on the coordinates per force of each spring, (n_dof, n_springs).
    """
    for owner, lever in zip(owners, levers.T, strict=True):
        if not lever.any():
            raise NumericalError(
                f"rest of {owner}: it acts on no coordinate in the design position, so that nothing can be balanced. "
                "Give a number.",
                Cause.STATIC,
            )


def _find_preloads(
    owners: Sequence[str], coordinates: Sequence[str], levers: FloatArray, force: FloatArray
) -> FloatArray:
    """Return the preloads of least norm that balance forces, (n_springs,), N or N m.

    Args:
        owners: Names of the springs.
        coordinates: Names of the coordinates that are balanced.
        levers: Forces on these coordinates per force of each spring, (n_balanced, n_springs).
        force: Torques that the other forces need, (n_balanced,).

    Raises:
        NumericalError: The springs cannot balance the forces.
    """
    preloads = np.asarray(np.linalg.lstsq(levers, -force, rcond=None)[0], dtype=float)
    left = np.abs(levers @ preloads + force)
    if left.max(initial=0.0) > _BALANCED * np.abs(force).max(initial=0.0):
        raise NumericalError(
            f"rest of {', '.join(owners)}: no preloads balance the other forces in the design position; "
            f"{left.max():.3g} N (N m) are left at {coordinates[int(left.argmax())]}. Give numbers, or more springs.",
            Cause.STATIC,
        )
    return preloads


def _set_rests(mechanism: Mechanism, static: list[int], rests: FloatArray) -> Mechanism:
    """Return the mechanism with other rest positions of some drives."""
    drives = list(mechanism.drives)
    for k, rest in zip(static, rests.tolist(), strict=True):
        drives[k] = replace(drives[k], rest=rest)
    return replace(mechanism, drives=tuple(drives))
