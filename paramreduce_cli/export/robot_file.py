"""A model in the robot file that it came from, URDF or MJCF, with standard parameters close to the file's."""

import warnings

import numpy as np

from paramreduce_cli.config.schema import Config, SourceSection
from paramreduce_cli.errors import ConfigError, ParamreduceWarning
from paramreduce_cli.importing.formats import formats
from paramreduce_cli.importing.imported_robot import Inertial, to_transform
from paramreduce_cli.importing.robot_format import RobotFormat
from paramreduce_cli.importing.simplification import SimplifiedRobot
from paramreduce_cli.importing.source_reading import detect_format, read_robot
from paramreduce_cli.records import DRIVE, INERTIAL, FloatArray, Kind, Mechanism, Model
from paramreduce_cli.robots.inertia import compute_pseudo_inertia, is_positive_semidefinite
from paramreduce_cli.robots.placement import compose_steps

_SAME = 1e-9
"""By which frames may differ, m or without unit."""


def write_robot_file(
    config: Config, model: Model, standard: FloatArray, kind: str
) -> dict[str, bytes]:
    """Return the robot's own file with other parameters.

    Args:
        config: Config that names the robot's file.
        model: Model of the robot.
        standard: Standard parameters that are written, (n_parameters,).
        kind: Format, one of :data:`paramreduce_cli.importing.formats.formats`; the robot's file must have it.

    Raises:
        ConfigError: The file is unknown, or no longer the robot of the config, or has no form for
            the parameters.
    """
    if config.source is None:
        raise ConfigError(
            "the config names no robot file to write into: it has no source section.",
            remedy="`paramreduce init ROBOT.urdf` writes a config that has one.",
        )
    file = config.source.file
    if detect_format(file) != kind:
        raise ConfigError(
            f"{file}: is not a {kind.upper()} file. A model can only be written into the format that its robot came from."
        )
    robot = read_robot(config.source)
    form = formats[kind]()
    _check_same(config, config.source, robot, gravity=form.holds_gravity)
    bodies = _make_pseudo_inertias(model.mechanism, standard)
    _warn_of_losses(model.mechanism, standard, bodies, form)
    inertials = {name: _make_inertial(name, body) for name, body in bodies.items()}
    drives = _sum_drives(model.mechanism, standard)
    return {file.name: form.write(file, robot, inertials, drives)}


def _check_same(
    config: Config, source: SourceSection, robot: SimplifiedRobot, *, gravity: bool
) -> None:
    """Raise ConfigError if bodies, joints or gravity of the file differ from those of the config."""
    if gravity and not np.allclose(config.description.gravity, robot.gravity, rtol=0, atol=_SAME):
        raise ConfigError(
            f"{source.file}: has another gravity than the config; change one of them."
        )
    tree = config.description.tree
    own = [] if tree is None else list(tree.bodies)
    same = len(own) == len(robot.bodies) and all(
        (a.name, a.parent, a.joint) == (b.name, b.parent, b.joint)
        and np.allclose(compose_steps(a.at), to_transform(b.at), rtol=0, atol=_SAME)
        and (b.axis is None or np.allclose(a.list_motions()[-1][1], b.axis, rtol=0, atol=_SAME))
        for a, b in zip(own, robot.bodies, strict=True)
    )
    if not same:
        raise ConfigError(
            f"{source.file}: its bodies are not those of the config, one of them was changed.",
            remedy="`paramreduce init` imports it again.",
        )


def _make_pseudo_inertias(mechanism: Mechanism, standard: FloatArray) -> dict[str, FloatArray]:
    """Return the pseudo-inertia matrices of the bodies with their payloads, (4, 4) each."""
    result = {}
    for k, body in enumerate(mechanism.bodies):
        whole = np.zeros((4, 4))
        for rigid in mechanism.list_rigid_parts(k):
            own = compute_pseudo_inertia({kind: standard[rigid.columns[kind]] for kind in INERTIAL})
            whole += rigid.frame @ own @ rigid.frame.T
        result[body.name] = whole
    return result


def _make_inertial(name: str, body: FloatArray) -> Inertial | None:
    """Return mass, centre of mass and inertia of a body; None if all are zero.

    Raises:
        ConfigError: The body has moments but no mass, for which a URDF has no form.
    """
    mass = float(body[3, 3])
    if not body.any():
        return None
    if mass == 0:
        raise ConfigError(
            f"{name} has moments but no mass in this model, for which a URDF has no form."
        )
    com = body[:3, 3] / mass
    second = body[:3, :3] - mass * np.outer(com, com)
    return Inertial(mass, com, np.trace(second) * np.eye(3) - second)


def _sum_drives(mechanism: Mechanism, standard: FloatArray) -> dict[str, dict[str, float]]:
    """Return the sums of the drives' parameters that act on the joint of each body, by the keys of a drive in a config.

    A drive with weight w adds w^2 times its inertia, friction and stiffness to the coordinate, and w times its Coulomb
    friction.
    """
    result: dict[str, dict[str, float]] = {}
    for drive in mechanism.drives:
        (moved,) = np.nonzero(drive.weights)
        if moved.size != 1:
            continue
        weight = float(drive.weights[moved[0]])
        found = result.setdefault(mechanism.bodies[moved[0]].name, {})
        for kind, column in mechanism.find_drive_columns(drive).items():
            scale = abs(weight) if kind.order is None else weight**2
            found[kind.key] = found.get(kind.key, 0.0) + scale * float(standard[column])
            if kind is Kind.STIFFNESS:
                found["rest"] = drive.rest / weight
    return result


def _warn_of_losses(
    mechanism: Mechanism, standard: FloatArray, bodies: dict[str, FloatArray], form: RobotFormat
) -> None:
    """Warn about physically impossible bodies, and about parameters that the file cannot hold.

    Raises:
        ConfigError: Bodies are physically impossible, and the format rejects such bodies.
    """
    unphysical = [name for name, body in bodies.items() if not is_positive_semidefinite(body)]
    if unphysical and form.physical:
        raise ConfigError(
            f"MuJoCo takes physical bodies alone, and no distribution of mass has the inertia of "
            f"{', '.join(unphysical)} in this model; a URDF can hold them."
        )
    single = {drive.name for drive in mechanism.drives if np.count_nonzero(drive.weights) == 1}
    left = [
        f"{parameter.name} = {value:.12g}"
        for parameter, value in zip(mechanism.parameters, standard, strict=True)
        if parameter.kind in DRIVE
        and not (parameter.owner in single and parameter.kind in form.held)
    ]
    for names, text in (
        (unphysical, "not physical, as no distribution of mass has their inertia"),
        (left, "left out, as the format has no place for it"),
    ):
        if names:
            warnings.warn(f"{text}: {', '.join(names)}", ParamreduceWarning, stacklevel=2)
