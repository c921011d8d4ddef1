"""A mechanism in one pose, for drawing."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from paramreduce_cli.multibody.kinematics import compute_body_poses
from paramreduce_cli.records import BASE, Body, FloatArray, Kind, Mechanism, Model

_AXIS = 0.05
"""Half of a joint's axis as it is drawn, over the size of the motion."""


_TRAVEL = 0.1
"""Travel of a floating body, relative to the size of the mechanism, that is not drawn."""


@dataclass(frozen=True)
class Skeleton:
    """A mechanism in one pose, for drawing."""

    z: FloatArray
    poses: FloatArray
    """Frames of the bodies, (n_bodies, 4, 4)."""
    joints: FloatArray
    """Frames of the joints, before their motion, (n_bodies, 4, 4)."""
    masses: FloatArray
    """Centres of mass, NaN for bodies without mass, (n_bodies, 3), m."""
    parents: tuple[int, ...]
    kinds: tuple[str, ...]
    closures: tuple[FloatArray, ...]
    """Lines from one body's origin through the closure to the other's, for each loop, (n_points, 3), m."""
    closure_bodies: tuple[tuple[int, ...], ...]
    """Body of each line along a closure; :data:`BASE` for lines between two bodies."""


def make_skeleton(model: Model, q: FloatArray) -> Skeleton:
    """Return the mechanism's pose at generalised coordinates q, (n_q,)."""
    mechanism = model.mechanism
    poses = compute_body_poses(mechanism, q)
    joints = [
        body.parent_to_joint if body.parent == BASE else poses[body.parent] @ body.parent_to_joint
        for body in mechanism.bodies
    ]
    paths = list(_iterate_closure_paths(mechanism, poses))
    return Skeleton(
        z=q[list(mechanism.independent)],
        poses=poses,
        masses=np.array([_centre(model, k, pose) for k, pose in enumerate(poses)]),
        joints=np.array(joints),
        parents=tuple(body.parent for body in mechanism.bodies),
        kinds=tuple(_choose_symbol(body) for body in mechanism.bodies),
        closures=tuple(points for points, _ in paths),
        closure_bodies=tuple(bodies for _, bodies in paths),
    )


def hold_travel(mechanism: Mechanism, q: FloatArray) -> FloatArray:
    """Return positions along motions without the travel of bodies that float freely, where it is long beside the mechanism.

    Args:
        mechanism: The mechanism.
        q: Generalised coordinates, (n_positions, n_q).
    """
    held = q.copy()
    for k, body in enumerate(mechanism.bodies):
        if (
            body.intermediate
            and body.joint == "prismatic"
            and np.ptp(q[:, k]) > _TRAVEL * mechanism.size
        ):
            held[:, k] = q[0, k]
    return held


@dataclass(frozen=True)
class Animation:
    """A mechanism along its motions, for drawing: points that move, and lines between them."""

    points: FloatArray
    """Points in the base frame, NaN where a body has no mass, of all motions in sequence, (n_frames, n_points, 3), m."""
    motions: tuple[tuple[str, int], ...]
    """Name and number of frames of each motion."""
    lines: tuple[tuple[int, int, int, str], ...]
    """Lines: two points, the body (:data:`BASE` for none), and the kind: link, rail, mass, loop or axis."""
    owners: tuple[str, ...]
    """Names of the bodies."""


def make_animation(model: Model, motions: Mapping[str, FloatArray]) -> Animation:
    """Return the mechanism along motions, each of generalised coordinates (n_frames, n_q)."""
    held = hold_travel(model.mechanism, np.vstack(list(motions.values())))
    frames = [make_skeleton(model, row) for row in held]
    positions = np.array([one.poses[:, :3, 3] for one in frames])
    half = _AXIS * float(np.ptp(positions.reshape(-1, 3), axis=0).max()) or _AXIS
    points = [
        np.vstack([np.zeros((1, 3)), one.joints[:, :3, 3], one.poses[:, :3, 3], one.masses, *one.closures,
                   *(one.joints[:, :3, 3] + side * half * one.joints[:, :3, 2] for side in (-1, 1))])
        for one in frames
    ]  # fmt: skip
    names = tuple(body.name for body in model.mechanism.bodies)
    lengths = tuple((name, len(q)) for name, q in motions.items())
    return Animation(np.array(points), lengths, tuple(_iterate_lines(frames[0])), names)


def _iterate_lines(shown: Skeleton) -> Iterator[tuple[int, int, int, str]]:
    """Yield the lines of a pose: points by number, base first, and the body that each line belongs to.

    The line from a body's frame to the next joint belongs to that body.
    """
    count = len(shown.parents)
    for body, parent in enumerate(shown.parents):
        before, joint, end = (0 if parent < 0 else 1 + count + parent), 1 + body, 1 + count + body
        sliding = bool(shown.closures) and shown.kinds[body] != "revolute"
        if not sliding and (parent >= 0 or not shown.closures):
            yield before, joint, parent, "link"
        if shown.kinds[body] != "hidden":
            yield joint, end, body, "rail" if sliding else "link"
        if body not in shown.parents and np.isfinite(shown.masses[body]).all():
            yield end, 1 + 2 * count + body, body, "mass"
    first = 1 + 3 * count
    for bodies in shown.closure_bodies:
        for k, body in enumerate(bodies, first):
            yield k, k + 1, body, "loop"
        first += len(bodies) + 1
    for body, kind in enumerate(shown.kinds):
        if kind != "hidden":
            yield first + body, first + count + body, body, "axis"


def _centre(model: Model, body: int, pose: FloatArray) -> FloatArray:
    """Centre of mass in the base frame, not a number for a body without mass, (3,), m."""
    whole = np.zeros(4)
    for rigid in model.mechanism.list_rigid_parts(body):
        kinds = (Kind.MX, Kind.MY, Kind.MZ, Kind.M)
        whole += rigid.frame @ model.values[[rigid.columns[kind] for kind in kinds]]
    if not whole[3] > 0:
        return np.full(3, np.nan)
    return pose[:3, 3] + pose[:3, :3] @ (whole[:3] / whole[3])


def _choose_symbol(body: Body) -> str:
    """Return the symbol of a joint; slides inside a free joint are hidden."""
    return "hidden" if body.intermediate and body.joint == "prismatic" else body.joint


def _iterate_closure_paths(
    mechanism: Mechanism, poses: FloatArray
) -> Iterator[tuple[FloatArray, tuple[int, ...]]]:
    """Yield the points from body to body through each closure, and the body that each line belongs to."""
    for closure in mechanism.loops.closures if mechanism.loops is not None else ():
        if closure.kind == "coupling":
            continue
        points: list[FloatArray] = []
        bodies: list[int] = []
        for body, frame in zip(closure.bodies, closure.frames, strict=True):
            pose = np.eye(4) if body == BASE else poses[body]
            path = [pose[:3, 3], (pose @ frame)[:3, 3]]
            ends = path[1:] if body == BASE else path
            own = [] if body == BASE else [body]
            bodies += own if not points else [BASE, *own]
            points += ends if not points else ends[::-1]
        yield np.array(points), tuple(bodies)
