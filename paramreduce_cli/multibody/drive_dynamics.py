"""Torques of drives: inertia of rotors, friction, constant forces and springs.

A drive or force element acts along one motion; a force f along it is f times the derivative of its speed by each
coordinate's speed, by virtual work. The formulas serve CasADi's scalars and those of expression graphs alike.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from paramreduce_cli.multibody.drive_motions import DriveMotion, sum_weighted
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
    kind: Kind, drive: Drive, motion: DriveMotion, gravity: Sequence[Any], odd: OddFunctions
) -> Any:
    """Return the force along a drive's motion for a unit value of one of its parameters.

    Args:
        kind: Kind of the parameter, one of :data:`paramreduce_cli.records.DRIVE`.
        drive: The drive.
        motion: State of the motion that it acts along.
        gravity: Nominal torques of gravity, (n_q,); used for friction that depends on the load alone.
        odd: Functions of these scalars.

    Raises:
        ValueError: The parameter is none of a drive.
    """
    if kind not in (*_FORCES, Kind.LOAD):
        raise ValueError(f"{kind} is no parameter of a drive")
    if kind is Kind.LOAD:
        return _express_load_friction(drive, motion, gravity, odd)
    return _FORCES[kind](drive, motion, odd)


def _express_friction_sign(drive: Drive, motion: DriveMotion, odd: OddFunctions) -> Any:
    """Return the sign of a drive's speed, smoothed by a hyperbolic tangent if the drive asks for it."""
    speed = motion.speed
    return odd.tanh(speed * (1 / drive.smoothing)) if drive.smoothing else odd.sign(speed)


def _express_stribeck(drive: Drive, motion: DriveMotion, odd: OddFunctions) -> Any:
    """Return the factor of friction that is large at low speed and fades, a difference of two signs [Makkar2005]."""
    return _express_friction_sign(drive, motion, odd) - odd.tanh(
        motion.speed * (1 / drive.stribeck_velocity)
    )


def _express_magnitude(value: Any, odd: OddFunctions) -> Any:
    """Return the magnitude of a value."""
    return value * odd.sign(value)


def _interpolate_table(table: FloatArray | None, value: Any, odd: OddFunctions) -> Any:
    """Return the force of a piecewise linear table, which goes on straight beyond its ends.

    Every change of slope is half of it times the distance from the point, so that magnitudes are all that is needed.

    Args:
        table: Arguments, ascending, and forces, (n_points, 2).
        value: Argument.
        odd: Functions of these scalars.
    """
    assert table is not None
    x, y = table.T
    slopes = np.diff(y) / np.diff(x)
    kinks = np.diff(slopes) / 2
    middle = (slopes[0] + slopes[-1]) / 2
    constant = y[0] - middle * x[0] - float(kinks @ np.abs(x[0] - x[1:-1]))
    force = float(middle) * value + float(constant)
    for at, kink in zip(x[1:-1].tolist(), kinks.tolist(), strict=True):
        if kink:
            force = force + kink * _express_magnitude(value + -at, odd)
    return force


def _express_load_friction(
    drive: Drive, motion: DriveMotion, gravity: Sequence[Any], odd: OddFunctions
) -> Any:
    """Return the factor of friction that grows with the load, the nominal force of gravity along the motion [Hamon2010].

    Of the forces along a motion of several coordinates that explain their torques, the least-squares one is taken.
    """
    along = sum_weighted(drive.weights.tolist(), gravity)
    load = along * (1 / float(drive.weights @ drive.weights))
    return _express_magnitude(load, odd) * _express_friction_sign(drive, motion, odd)


def smooth_friction(mechanism: Mechanism, speeds: FloatArray) -> Mechanism:
    """Return the mechanism with a smooth sign in Coulomb friction, so that gradients exist; a mechanism without such
    friction is returned as it is.

    Args:
        mechanism: The mechanism.
        speeds: Largest speeds of the independent coordinates, (n_dof,), rad/s or m/s; motions between frames are taken to be as
            fast as the fastest of them.
    """
    if all(parameter.kind not in SIGN_FRICTION for parameter in mechanism.parameters):
        return mechanism
    fastest = np.full(mechanism.n_q, speeds.max())
    fastest[list(mechanism.independent)] = speeds
    drives = tuple(
        replace(
            drive,
            smoothing=max(
                drive.smoothing,
                _ROUNDED * (float(abs(drive.weights) @ fastest) or float(speeds.max())),
            ),
        )
        for drive in mechanism.drives
    )
    return replace(mechanism, drives=drives)


_FORCES: dict[Kind, Callable[[Drive, DriveMotion, OddFunctions], Any]] = {
    Kind.ROTOR: lambda drive, motion, odd: motion.acceleration,
    Kind.VISCOUS: lambda drive, motion, odd: motion.speed,
    Kind.COULOMB: _express_friction_sign,
    Kind.OFFSET: lambda drive, motion, odd: 1.0,
    Kind.STIFFNESS: lambda drive, motion, odd: motion.position - drive.rest,
    Kind.STRIBECK: _express_stribeck,
    Kind.ASYMMETRY: lambda drive, motion, odd: _express_magnitude(motion.speed, odd),
    Kind.QUADRATIC: lambda drive, motion, odd: motion.speed * _express_magnitude(motion.speed, odd),
    Kind.SPRING_TABLE: lambda drive, motion, odd: _interpolate_table(
        drive.spring_table, motion.position - drive.rest, odd
    ),
    Kind.DAMPER_TABLE: lambda drive, motion, odd: _interpolate_table(
        drive.damper_table, motion.speed, odd
    ),
    Kind.CREEP: lambda drive, motion, odd: motion.creepage,
}
"""Force along a drive's motion for a unit value of each parameter, but for friction that depends on the load."""
