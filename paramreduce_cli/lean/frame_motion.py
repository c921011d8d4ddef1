"""How a frame moves: its rates, and the matrix U that acts on everything fixed in it.

U = skew(w') + skew(w)^2 gives the acceleration of a point at r as a + U r [Khalil1987]. Turning
about an axis does not change U's column along it, so that column is turned instead of w'.
"""

from dataclasses import dataclass
from enum import StrEnum

from paramreduce_cli.expressions.vectors import Vector, dot
from paramreduce_cli.lean.algebra import Scalar, cache_expressions
from paramreduce_cli.lean.rotations import ConstantRotation, JointRotation


class AngularAcceleration(StrEnum):
    """A way to compute the angular acceleration of a frame, and with it U, from that of its parent."""

    COLUMN = "column"
    """U's column along the axis is turned."""
    DOUBLED = "doubled"
    """The same, and U_zx and U_zy are made from 2 w_z, not from the angular acceleration."""
    DIRECT = "direct"
    """The angular acceleration itself is turned."""


class Diagonal(StrEnum):
    """A way to compute the diagonal of U."""

    SQUARES = "squares"
    """Sum of the squares of all rates."""
    FIRST = "first"
    """zz is turned with its column; the square of the rate about y is not needed."""
    SECOND = "second"
    """The same without the square of the rate about x."""


@dataclass(frozen=True)
class FrameMotion:
    """The rotational motion of a frame, in its own components: angular velocity, angular acceleration and U.

    Attributes:
        omega: Angular velocity.
        rate: Angular acceleration.
        products: w_y w_z, w_x w_z, w_x w_y.
        U: Rows.
        steps: U_yy - U_zz, U_zz - U_xx, U_xx - U_yy.
    """

    omega: Vector
    rate: Vector
    products: Vector
    U: tuple[Vector, Vector, Vector]
    steps: Vector

    def multiply_z(self) -> Vector:
        """Return U z."""
        return (self.U[0][2], self.U[1][2], self.U[2][2])

    @cache_expressions
    def multiply(self, r: Vector) -> Vector:
        """Return U r."""
        return (dot(self.U[0], r), dot(self.U[1], r), dot(self.U[2], r))


@cache_expressions
def make_frame_motion(omega: Vector, rate: Vector) -> FrameMotion:
    """Return the motion of a frame from its angular velocity and acceleration, including U."""
    products = (omega[1] * omega[2], omega[0] * omega[2], omega[0] * omega[1])
    xx, yy, zz = (component * component for component in omega)
    (yz, xz, xy), (x, y, z) = products, rate
    U = ((-(yy + zz), xy - z, xz + y), (xy + z, -(xx + zz), yz - x), (xz - y, yz + x, -(xx + yy)))
    return FrameMotion(omega, rate, products, U, (yy - zz, zz - xx, xx - yy))


@cache_expressions
def add_rotation(
    frame: FrameMotion,
    turn: JointRotation,
    speed: Scalar,
    acceleration: Scalar,
    diagonal: Diagonal,
    rates: AngularAcceleration,
) -> FrameMotion:
    """Return the motion of a frame that rotates about the z axis of another frame.

    Args:
        frame: Motion of the other frame, in its own components.
        turn: Rotation between the two frames at this instant.
        speed: Speed of the joint, rad/s.
        acceleration: Acceleration of the joint, rad/s^2.
        diagonal: Way to compute the diagonal of U.
        rates: Way to compute the angular acceleration.
    """
    x, y, _ = turn.to_child(frame.omega)
    z = frame.omega[2] + speed
    rate_z = frame.rate[2] + acceleration
    yz, xz, xy = y * z, x * z, x * y
    u_zz = frame.U[2][2]
    if rates is AngularAcceleration.DIRECT:
        before_x, before_y, _ = turn.to_child(frame.rate)
        rate_x, rate_y = before_x + y * speed, before_y - x * speed
        u_xz, u_yz = xz + rate_y, yz - rate_x
    else:
        u_xz, u_yz, _ = turn.to_child(frame.multiply_z())
        rate_x, rate_y = yz - u_yz, u_xz - xz
    u_zx, u_zy = xz - rate_y, yz + rate_x
    if rates is AngularAcceleration.DOUBLED:
        twice = 2 * z
        u_zx, u_zy = twice * x - u_xz, twice * y - u_yz
    if diagonal is Diagonal.SQUARES:
        xx, yy, zz = x * x, y * y, z * z
        u_xx, u_yy, u_zz = -(yy + zz), -(xx + zz), -(xx + yy)
        steps = (yy - zz, zz - xx, xx - yy)
    elif diagonal is Diagonal.FIRST:
        xx, zz = x * x, z * z
        step = zz - xx
        u_xx, u_yy = u_zz - step, -(xx + zz)
        steps = (u_yy - u_zz, step, u_xx - u_yy)
    else:
        yy, zz = y * y, z * z
        step = yy - zz
        u_xx, u_yy = -(yy + zz), u_zz + step
        steps = (step, u_zz - u_xx, u_xx - u_yy)
    U = ((u_xx, xy - rate_z, u_xz), (xy + rate_z, u_yy, u_yz), (u_zx, u_zy, u_zz))
    return FrameMotion((x, y, z), (rate_x, rate_y, rate_z), (yz, xz, xy), U, steps)


@cache_expressions
def change_components(turn: ConstantRotation, frame: FrameMotion) -> FrameMotion:
    """Return the same rotational motion in the components of a frame that is fixed in the first."""
    if not turn.is_permutation:
        return make_frame_motion(turn.to_child(frame.omega), turn.to_child(frame.rate))
    axes = turn.find_permutation()

    def component(i: int, j: int) -> Scalar:
        """Return an entry of U in the new components."""
        (k, a), (m, b) = axes[i], axes[j]
        return a * b * frame.U[k][m]

    def product(i: int, j: int) -> Scalar:
        """Return a product of angular speeds in the new components."""
        (k, a), (m, b) = axes[i], axes[j]
        return a * b * frame.products[3 - k - m]

    def step(i: int, j: int) -> Scalar:
        """Return a difference of squares of angular speeds in the new components."""
        k, m = axes[i][0], axes[j][0]
        value = frame.steps[3 - k - m]
        return value if (k + 1) % 3 == m else -value

    rows = [(component(i, 0), component(i, 1), component(i, 2)) for i in range(3)]
    return FrameMotion(
        turn.to_child(frame.omega),
        turn.to_child(frame.rate),
        (product(1, 2), product(0, 2), product(0, 1)),
        (rows[0], rows[1], rows[2]),
        (step(1, 2), step(2, 0), step(0, 1)),
    )


@dataclass(frozen=True)
class RotationEffect:
    """The change C = U_after - U_before that a rotation about z adds to U.

    Only three of its entries differ: ``-loss`` in xx and yy, the acceleration off the diagonal,
    and twice ``half`` in the row of z.

    Attributes:
        acceleration: rad/s^2.
        loss: Decrease of the diagonal entries.
        half: speed * w_x and speed * w_y.
    """

    acceleration: Scalar
    loss: Scalar
    half: tuple[Scalar, Scalar]

    def multiply(self, r: Vector) -> Vector:
        """Return C r."""
        x, y, _ = r
        return (
            -(self.loss * x) - self.acceleration * y,
            self.acceleration * x - self.loss * y,
            2 * (self.half[0] * x + self.half[1] * y),
        )


def make_rotation_effect(frame: FrameMotion, speed: Scalar, acceleration: Scalar) -> RotationEffect:
    """Return the change of U by a rotation about the z axis of a frame whose motion is given."""
    x, y, z = frame.omega
    return RotationEffect(acceleration, speed * (z + (z + speed)), (speed * x, speed * y))


def accelerate_along_z(frame: FrameMotion, speed: Scalar, acceleration: Scalar) -> Vector:
    """Return the acceleration that sliding along the z axis of a moving frame adds."""
    twice = 2 * speed
    return (twice * frame.omega[1], -(twice * frame.omega[0]), acceleration)
