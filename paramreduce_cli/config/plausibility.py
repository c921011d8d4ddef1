"""Sizes, masses and speeds that hardly any robot has, but that units other than SI would explain."""

from collections.abc import Iterator

import numpy as np

from paramreduce_cli.config.schema import Config
from paramreduce_cli.records import Kind
from paramreduce_cli.robots.inertia import BodyParameters

_DENSEST = 23_000.0
"""kg/m^3, of osmium."""
_SPHERE = 4 / 3 * np.pi * 2.5**1.5
"""Volume of a solid sphere over the cube of its radius of gyration; all other bodies of that radius are lighter."""
_SMALLEST = 0.3
"""Length below which a robot's own size is no measure, m."""
_BEYOND = 10.0
"""Times the size of the robot that a centre of mass or a radius of gyration is unlikely to reach."""
_FASTEST = 100.0
"""Speed of a joint that few have, rad/s or m/s."""
_STRONGEST_GRAVITY = 30.0
"""m/s^2; on Jupiter it is 25."""
_MOST = 6
"""Bodies that are named in a sentence."""


def find_implausible_bodies(config: Config) -> Iterator[str]:
    """Yield a sentence for each kind of implausible body: its mass does not fit its size, or its size the robot's."""
    extent = _estimate_size(config)
    # Of a single joint nothing else tells a size.
    size = max(_SMALLEST, extent) if extent > 0 else np.inf
    found: dict[str, list[tuple[float, str]]] = {}
    for name, body in config.get_body_parameters().items():
        for what, number in _check_body(body, size):
            found.setdefault(what, []).append((number, name))
    for what, bodies in found.items():
        names = [name for _, name in bodies]
        more = f" and {len(names) - _MOST} more" if len(names) > _MOST else ""
        yield f"{', '.join(names[:_MOST])}{more}: " + what.format(max(bodies)[0], size)


_FAR_CENTRE = (
    "a centre of mass up to {:.3g} m from the joint, on a robot of about {:.2g} m; are lengths in mm, or first "
    "moments and masses in different units?"
)
_LARGE_INERTIA = (
    "an inertia as of a body of up to {:.3g} m around, on a robot of about {:.2g} m; are masses in g, or inertias in "
    "kg mm^2?"
)
_DENSE = (
    "an inertia so small for its mass that the body is denser than any metal; are masses in g, or is "
    "it a placeholder?"
)


def _check_body(body: BodyParameters, size: float) -> Iterator[tuple[str, float]]:
    """Yield a sentence for each unlikely property of a body, and the number that goes into the sentence.

    Args:
        body: Standard parameters of the body.
        size: Approximate length of the robot, m.
    """
    values = body.get_values()
    mass = values[Kind.M]
    if mass <= 0:
        return
    centre = np.array([values[kind] for kind in (Kind.MX, Kind.MY, Kind.MZ)]) / mass
    about_origin = sum(values[kind] for kind in (Kind.IXX, Kind.IYY, Kind.IZZ)) / 2 / mass
    gyration = float(np.sqrt(max(about_origin - float(centre @ centre), 0.0)))
    distance = float(np.linalg.norm(centre))
    if distance > _BEYOND * size:
        yield _FAR_CENTRE, distance
    if gyration > _BEYOND * size:
        yield _LARGE_INERTIA, gyration
    elif 0 < _SPHERE * gyration**3 * _DENSEST < mass:
        yield _DENSE, mass / (_SPHERE * gyration**3 * _DENSEST)


def _estimate_size(config: Config) -> float:
    """Estimate the length of the robot, m: the largest sum of distances between joints from the base to a body."""
    bodies = config.description.bodies
    rigid = bodies.build_bodies()
    reach: list[float] = []
    for body in rigid:
        before = reach[body.parent] if body.parent >= 0 else 0.0
        shifts = (frame[:3, 3] for frame in (body.parent_to_joint, body.joint_to_body))
        reach.append(before + sum(float(np.linalg.norm(shift)) for shift in shifts))
    joints = {body.coordinate: body.joint for body in rigid}
    given = config.trajectories.position_limits or []
    names = bodies.list_independent_coordinates()
    ranges = given * len(names) if len(given) == 1 else given
    slides = [
        max(abs(lower), abs(upper))
        for (lower, upper), name in zip(ranges, names, strict=False)
        if joints.get(name) == "prismatic"
    ]
    return max([*reach, *slides], default=0.0)


def find_implausible_gravity(config: Config) -> Iterator[str]:
    """Yield a sentence if gravity is stronger than on any planet."""
    size = float(np.linalg.norm(config.description.gravity))
    if size > _STRONGEST_GRAVITY:
        yield f"description.gravity of {size:.4g} is in m/s^2, not mm/s^2; on Earth it is 9.81"


def find_implausible_speeds(config: Config) -> Iterator[str]:
    """Yield a sentence if a velocity limit is above the speed of most joints."""
    given = config.trajectories.velocity_limits or []
    fast = [limit for limit in given if _FASTEST < limit < np.inf]
    if fast:
        yield (
            f"trajectories.velocity_limits of {max(fast):g} are in rad/s (m/s), not degrees or revolutions per minute"
        )
