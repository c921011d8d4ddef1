"""Forces and moments that inertias need to keep to a motion."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import StrEnum

from paramreduce_cli.expressions.vectors import Vector, add, cross, scale
from paramreduce_cli.lean.algebra import Scalar, cache_expressions
from paramreduce_cli.lean.frame_motion import FrameMotion, RotationEffect
from paramreduce_cli.lean.inertia_expressions import Inertia


class Gauge(StrEnum):
    """A part of a body's inertia, s (1 - z z'), that is handed to the parent body.

    A hinge about z does not distinguish it from inertia of the parent body, so s is chosen to make the rest simple.
    """

    NONE = "none"
    YY = "yy"
    """Iyy of the rest is zero."""
    XX = "xx"
    FLAT = "flat"
    """Izz = Ixx + Iyy: all mass of the rest is in the plane of x and y."""
    XX_ZZ = "xx=zz"
    """Ixx = Izz"""
    YY_ZZ = "yy=zz"


@cache_expressions
def split_off(body: Inertia, gauge: Gauge) -> tuple[Scalar, Inertia]:
    """Split a body's inertia into the part s that is handed to the parent body and the rest."""
    zero = body.m - body.m
    if gauge is Gauge.NONE:
        return zero, body
    if gauge in (Gauge.YY, Gauge.YY_ZZ):
        yy = zero if gauge is Gauge.YY else body.zz
        s = body.yy - yy
        return s, replace(body, xx=body.xx - s, yy=yy)
    xx = zero if gauge is Gauge.XX else body.zz
    if gauge is Gauge.FLAT:
        xx = 0.5 * (body.zz + (body.xx - body.yy))
    s = body.xx - xx
    return s, replace(body, xx=xx, yy=body.yy - s)


@dataclass(frozen=True)
class Wrench:
    """A force and a moment about one point, in one frame."""

    force: Vector
    moment: Vector

    @cache_expressions
    def __add__(self, other: Wrench) -> Wrench:
        return Wrench(add(self.force, other.force), add(self.moment, other.moment))

    @cache_expressions
    def move_point(self, r: Vector) -> Wrench:
        """Return the wrench about another point, from which r leads to the present one."""
        return Wrench(self.force, add(self.moment, cross(r, self.force)))


@cache_expressions
def compute_inertial_wrench(body: Inertia, frame: FrameMotion, a: Vector, gauge: Gauge) -> Wrench:
    """Return the force and the moment, about the frame's origin, that move a body with a frame.

    Args:
        body: Inertia in the frame, about its origin.
        frame: Motion of the frame.
        a: Acceleration of its origin, less gravity.
        gauge: Gauge that the inertia already has, as after :func:`split_off`; the moment then takes the fewest
            operations.
    """
    force = add(frame.multiply(body.d), scale(body.m, a))
    return Wrench(force, add(_compute_spin_moment(body, frame, gauge), cross(body.d, a)))


def _compute_spin_moment(body: Inertia, frame: FrameMotion, gauge: Gauge) -> Vector:
    """Return the moment I w' + w x (I w), with products of angular speeds taken from U = [w'] + [w][w] of the frame's
    motion.
    """
    U, step = frame.U, frame.steps
    x, y, z = _compute_diagonal_spin_moment(body, frame, gauge)
    return (
        x + body.xz * U[1][0] - body.xy * U[2][0] + body.yz * step[0],
        y + body.xy * U[2][1] - body.yz * U[0][1] + body.xz * step[1],
        z + body.yz * U[0][2] - body.xz * U[1][2] + body.xy * step[2],
    )


def _compute_diagonal_spin_moment(body: Inertia, frame: FrameMotion, gauge: Gauge) -> Vector:
    """Return the part of the spin moment that comes from the diagonal of the inertia tensor."""
    U, (rx, ry, rz), (yz, xz, xy) = frame.U, frame.rate, frame.products
    xx, yy, zz = body.xx, body.yy, body.zz
    if gauge is Gauge.FLAT:
        return (xx * U[2][1], -(yy * U[2][0]), yy * U[1][0] - xx * U[0][1])
    if gauge is Gauge.XX_ZZ:
        return (zz * U[2][1] - yy * yz, yy * ry, yy * xy - zz * U[0][1])
    if gauge is Gauge.YY_ZZ:
        return (xx * rx, xx * xz - zz * U[2][0], zz * U[1][0] - xx * xy)
    return (xx * rx + (zz - yy) * yz, yy * ry + (xx - zz) * xz, zz * rz + (yy - xx) * xy)


@cache_expressions
def compute_moment_about_z(body: Inertia, frame: FrameMotion, a: Vector) -> Scalar:
    """Return the moment about z that moves a body with a frame."""
    U, d = frame.U, body.d
    return (
        body.zz * frame.rate[2]
        + (body.yy - body.xx) * frame.products[2]
        + body.yz * U[0][2]
        - body.xz * U[1][2]
        + body.xy * frame.steps[2]
        + (d[0] * a[1] - d[1] * a[0])
    )


def compute_force_along_z(body: Inertia, frame: FrameMotion, a: Vector) -> Scalar:
    """Return the force along z that a body needs to move with a frame."""
    return frame.multiply(body.d)[2] + body.m * a[2]


@cache_expressions
def compute_rotation_wrench(body: Inertia, turning: RotationEffect) -> Wrench:
    """Return the additional wrench that a body needs because its frame rotates about z.

    With C = U_after - U_before and S the second moments, the force is C d and the moment the skew part of C S. Only few
    entries of C differ from zero: twice S_xx is Izz - (Ixx - Iyy), twice S_yy is Izz + (Ixx - Iyy), and the moment
    about z depends on the angular acceleration alone.
    """
    (h, k), acceleration, loss = turning.half, turning.acceleration, turning.loss
    difference, twice = body.xx - body.yy, 2 * body.xy
    moment = (
        acceleration * body.xz - loss * body.yz + (k * (body.zz + difference) - h * twice),
        acceleration * body.yz + loss * body.xz + (k * twice - h * (body.zz - difference)),
        acceleration * body.zz,
    )
    return Wrench(turning.multiply(body.d), moment)


def compute_translation_wrench(body: Inertia, a: Vector) -> Wrench:
    """Return the wrench that a body needs for an equal acceleration of all its points."""
    return Wrench(scale(body.m, a), cross(body.d, a))
