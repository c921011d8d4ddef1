"""Torques of drives: inertia of rotors, friction, constant forces and springs.

A drive acts along one motion, whose position, speed and acceleration are those of the coordinates
summed with its weights; a force f along it is weight times f on each coordinate, by virtual work.
The formulas serve CasADi's scalars and those of expression graphs alike.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from paramreduce_cli.records import SIGN_FRICTION, Drive, FloatArray, Kind, Mechanism


class OddFunctions(NamedTuple):
    """The functions sign and tanh of the scalars in use."""

    sign: Callable[[Any], Any]
    tanh: Callable[[Any], Any]


_ROUNDED = 0.02
"""Share of the largest speed up to which a sign is rounded off. Trajectories of a six-joint arm with
friction take a fifth of the time then and have a fifth less kappa, by the true sign, than without."""

CASADI = OddFunctions(ca.sign, ca.tanh)


def express_unit_force(
    kind: Kind, drive: Drive, states: Sequence[Sequence[Any]], odd: OddFunctions
) -> Any:
    """Return the force along a drive's motion for a unit value of one of its parameters.

    Args:
        kind: Kind of the parameter, one of :data:`paramreduce_cli.records.DRIVE`.
        drive: The drive.
        states: Generalised coordinates q, velocities dq, accelerations ddq and nominal torques of gravity, (n_q,) each.
        odd: Functions of these scalars.

    Raises:
        ValueError: The parameter is none of a drive.
    """
    if kind not in _FORCES:
        raise ValueError(f"{kind} is no parameter of a drive")
    return _FORCES[kind](drive, states, odd)


def _express_friction_sign(drive: Drive, states: Sequence[Sequence[Any]], odd: OddFunctions) -> Any:
    """Return the sign of a drive's speed, smoothed by a hyperbolic tangent if the drive asks for it."""
    speed = sum_along(drive, states[1])
    return odd.tanh(speed * (1 / drive.smoothing)) if drive.smoothing else odd.sign(speed)


def _express_stribeck(drive: Drive, states: Sequence[Sequence[Any]], odd: OddFunctions) -> Any:
    """Return the factor of friction that is large at low speed and fades, a difference of two signs [Makkar2005]."""
    speed = sum_along(drive, states[1])
    return _express_friction_sign(drive, states, odd) - odd.tanh(
        speed * (1 / drive.stribeck_velocity)
    )


def _express_magnitude(drive: Drive, states: Sequence[Sequence[Any]], odd: OddFunctions) -> Any:
    """Return the magnitude of a drive's speed."""
    speed = sum_along(drive, states[1])
    return speed * odd.sign(speed)


def _express_load_friction(drive: Drive, states: Sequence[Sequence[Any]], odd: OddFunctions) -> Any:
    """Return the factor of friction that grows with the load, the nominal force of gravity along the motion [Hamon2010].

    Of the forces along a motion of several coordinates that explain their torques, the least-squares one is taken.
    """
    load = sum_along(drive, states[3]) * (1 / float(drive.weights @ drive.weights))
    return load * odd.sign(load) * _express_friction_sign(drive, states, odd)


def smooth_friction(mechanism: Mechanism, speeds: FloatArray) -> Mechanism:
    """Return the mechanism with a smooth sign in Coulomb friction, so that gradients exist; a mechanism without such
    friction is returned as it is.

    Args:
        mechanism: The mechanism.
        speeds: Largest speeds of the independent coordinates, (n_dof,), rad/s or m/s.
    """
    if all(parameter.kind not in SIGN_FRICTION for parameter in mechanism.parameters):
        return mechanism
    fastest = np.full(mechanism.n_q, speeds.max())
    fastest[list(mechanism.independent)] = speeds
    drives = tuple(
        replace(
            drive, smoothing=max(drive.smoothing, _ROUNDED * float(abs(drive.weights) @ fastest))
        )
        for drive in mechanism.drives
    )
    return replace(mechanism, drives=drives)


def sum_along(drive: Drive, values: Sequence[Any]) -> Any:
    """Return the sum of coordinates, or of their derivatives, with the drive's weights."""
    return sum(weight * values[i] for i, weight in enumerate(drive.weights.tolist()) if weight)


_FORCES: dict[Kind, Callable[[Drive, Sequence[Sequence[Any]], OddFunctions], Any]] = {
    Kind.ROTOR: lambda drive, states, odd: sum_along(drive, states[2]),
    Kind.VISCOUS: lambda drive, states, odd: sum_along(drive, states[1]),
    Kind.COULOMB: _express_friction_sign,
    Kind.OFFSET: lambda drive, states, odd: 1.0,
    Kind.STIFFNESS: lambda drive, states, odd: sum_along(drive, states[0]) - drive.rest,
    Kind.STRIBECK: _express_stribeck,
    Kind.ASYMMETRY: lambda drive, states, odd: _express_magnitude(drive, states, odd),
    Kind.QUADRATIC: lambda drive, states, odd: (
        sum_along(drive, states[1]) * _express_magnitude(drive, states, odd)
    ),
    Kind.LOAD: _express_load_friction,
}
"""Force along a drive's motion for a unit value of each parameter; states are q, dq, ddq and torques of gravity."""
