"""A simplified robot as the text of a config that is valid as it is."""

from __future__ import annotations

import json
import math
import re
import textwrap
from collections.abc import Callable, Sequence

import numpy as np

from paramreduce_cli.config.log_template import LOG_DRIVES, LOG_JUDGEMENT
from paramreduce_cli.config.schema import SourceSection
from paramreduce_cli.config.template import JUDGEMENT
from paramreduce_cli.importing.angles import angle_text, number_text
from paramreduce_cli.importing.imported import ImportedJoint, Inertial, Steps
from paramreduce_cli.importing.simplified import Closure, Coupling, ImportedBody, SimplifiedRobot

_NOT_PLAIN = {"y", "n", "yes", "no", "on", "off", "true", "false", "null"}
_DIRECTIONS = {(1.0, 0.0, 0.0): "x", (0.0, 1.0, 0.0): "y", (0.0, 0.0, 1.0): "z"}
_CHOSEN = ": chosen where the file gives none"
_SPEED = {"revolute": 1.5, "prismatic": 0.5, "free": 0.5, "spherical": 1.5}
"""Where a file has no limit of the velocity, rad/s or m/s."""
_RANGE = {
    "revolute": "[-pi, pi]",
    "prismatic": "[-0.5, 0.5]",
    "free": "[-0.5, 0.5]",
    "spherical": "[-1, 1]",
}
"""Where it has none of the position, rad or m."""


def config_text(robot: SimplifiedRobot, source: SourceSection, log: str = "") -> str:
    """The config of a robot.

    Args:
        robot: With names that configs allow.
        source: Where it comes from, the file relative to the folder that the config is for.
        log: Its section for logs of the machine, which tell friction and rotors.
    """
    parts = [_head(robot), _source(source), _description(robot), _parameters(robot)]
    if log:
        parts += [LOG_DRIVES, _limits(robot), log, LOG_JUDGEMENT]
    else:
        parts += [_drives(robot), _limits(robot), JUDGEMENT]
    return "\n".join(parts)


def _head(robot: SimplifiedRobot) -> str:
    lines = [
        f"{robot.name}: from {robot.source} by `paramreduce init`; this file is the robot from now on.",
        "Units are SI; numbers may be written as 1e-3 or pi/2. `paramreduce schema` lists every key.",
    ]
    if robot.warnings:
        lines += ["", "What was done, or is left to do:"]
        lines += [f"- {warning}." for warning in robot.warnings]
    text = "".join(_comment(line) for line in lines)
    return f"{text}robot: {_name(robot.name)}\n"


def _source(source: SourceSection) -> str:
    """What is needed to write the robot back; strings as JSON has them are YAML too."""
    given = source.model_dump(mode="json", exclude_defaults=True)
    lines = [f"  {key}: {json.dumps(value)}" for key, value in given.items()]
    return "\n".join(
        [
            "source:  # so that `paramreduce export --format urdf` (or mjcf) can write it back",
            *lines,
            "",
        ]
    )


def _comment(line: str) -> str:
    printable = "".join(c if c.isprintable() else " " for c in line)
    indent = "  " if line.startswith("- ") else ""
    return "".join(
        f"# {part}".rstrip() + "\n"
        for part in textwrap.wrap(printable, 96, subsequent_indent=indent) or [""]
    )


def _description(robot: SimplifiedRobot) -> str:
    lines = [
        "description:",
        f"  gravity: {_listed(robot.gravity)}        # acceleration of gravity in the base frame, m/s^2",
        "  tree:",
        "    # A body's frame is its joint's; `at` is where that is in the parent's frame, step by step.",
        "    bodies:",
    ]
    lines += [f"      - {_body(body)}" for body in robot.bodies]
    if robot.couplings or robot.closures:
        lines += ["    closures:", *(f"      - {_coupling(one)}" for one in robot.couplings)]
        lines += [f"      - {_closure(one)}" for one in robot.closures]
        lines.append(f"    independent: [{', '.join(map(_name, robot.independent))}]")
        if robot.guess:
            values = (f"{_name(name)}: {value:.6g}" for name, value in robot.guess.items())
            lines.append(f"    guess: {{{', '.join(values)}}}")
    return "\n".join(lines) + "\n"


def _body(body: ImportedBody) -> str:
    items = [f"name: {_name(body.name)}"]
    if body.parent != "base":
        items.append(f"parent: {_name(body.parent)}")
    items.append(f"joint: {body.joint}")
    if body.axis is not None:
        items.append(f"axes: {_axis(body.axis)}")
    if body.at:
        items.append(f"at: {_steps(body.at)}")
    if body.coordinate is not None:
        items.append(f"coordinates: {_name(body.coordinate)}")
    if body.massless:
        items.append("massless: true")
    return f"{{{', '.join(items)}}}"


def _coupling(coupling: Coupling) -> str:
    """Of the joints of two bodies."""
    bodies = f"[{_name(coupling.leader.name)}, {_name(coupling.follower.name)}]"
    offset = f", offset: {number_text(coupling.offset)}" if coupling.offset else ""
    return f"{{type: coupling, bodies: {bodies}, ratio: {number_text(coupling.ratio)}{offset}}}"


def _closure(closure: Closure) -> str:
    bodies = f"[{', '.join(map(_name, closure.bodies))}]"
    at = ", ".join(map(_steps, closure.at))
    return f"{{name: {_name(closure.name)}, type: {closure.kind}, bodies: {bodies}, at: [{at}]}}"


def _axis(axis: Sequence[float]) -> str:
    for direction, letter in _DIRECTIONS.items():
        if tuple(axis) == direction:
            return letter
        if tuple(-x for x in axis) == direction:
            return f"-{letter}"
    return _listed(axis)


def _steps(steps: Steps) -> str:
    shown = [
        f"{{xyz: {_listed(value)}}}"
        if isinstance(value, tuple)
        else f"{{{key}: {angle_text(value)}}}"
        for key, value in steps
    ]
    return f"[{', '.join(shown)}]"


def _listed(values: Sequence[float] | np.ndarray) -> str:
    return f"[{', '.join(number_text(float(value)) for value in values)}]"


def _name(name: str) -> str:
    plain = re.fullmatch(r"[A-Za-z][A-Za-z0-9_-]*", name) and name.lower() not in _NOT_PLAIN
    return name if plain else f'"{name}"'


def _parameters(robot: SimplifiedRobot) -> str:
    lines = [
        "parameter_sets:",
        "  # Mass (kg), centre of mass in the body's frame (m), and inertia about the centre of mass",
        "  # [Ixx, Ixy, Ixz, Iyy, Iyz, Izz] (kg m^2).",
        "  file:",
    ]
    lines += [
        f"    {_name(b.name)}: {_inertial(b.inertial)}" for b in robot.bodies if not b.massless
    ]
    return "\n".join(lines) + "\n"


def _inertial(inertial: Inertial) -> str:
    tensor = inertial.tensor[np.triu_indices(3)]
    if not inertial.mass and not tensor.any():
        return "{m: 0}        # TODO"
    return (
        f"{{m: {number_text(inertial.mass)}, com: {_listed(inertial.com)}, "
        f"inertia_com: {_listed(tensor)}}}"
    )


def _drives(robot: SimplifiedRobot) -> str:
    """Friction, rotors and springs as the file gives them; how to add them otherwise."""
    given = {
        body.coordinate: body.limits.drive
        for body in robot.bodies
        if body.limits is not None and body.coordinate is not None and body.limits.drive
    }
    if not given:
        return _NO_DRIVES
    lines = [
        f"  {_name(name)}: {{{', '.join(f'{k}: {number_text(v)}' for k, v in values.items())}}}"
        for name, values in given.items()
    ]
    return "\n".join([_DRIVES, *lines]) + "\n"


def _limits(robot: SimplifiedRobot) -> str:
    """Nominal torques and the limits of trajectories, coordinate by coordinate."""
    coordinates: list[tuple[str, str, ImportedJoint | None]] = [
        (name, body.joint, body.limits)
        for body in robot.bodies
        for name in body.coordinates()
        if name in robot.independent
    ]
    efforts = [limits.effort if limits else None for _, _, limits in coordinates]
    known = all(effort is not None and effort > 0 for effort in efforts)
    nominal = (
        f"nominal_torque: {_listed([e for e in efforts if e is not None])}        # the file's, N m (N)\n"
        if known
        else "nominal_torque: standard-deviation   # the file does not give all; or one per joint, N m (N)\n"
    )

    def rows(
        shown: Callable[[str, ImportedJoint | None], str], given: Callable[[ImportedJoint], object]
    ) -> str:
        width = max(len(shown(kind, limits)) for _, kind, limits in coordinates)
        return "".join(
            f"    - {shown(kind, limits):{width}}   # {name}"
            f"{'' if limits is not None and given(limits) else _CHOSEN}\n"
            for name, kind, limits in coordinates
        )

    return (
        f"{nominal}\n{_TRAJECTORIES}  position_limits:              # rad or m\n{rows(_position, _is_limited)}"
        f"  velocity_limits:              # rad/s or m/s\n{rows(_velocity, _fast)}"
        f"{_dependent_limits(robot)}"
    )


def _dependent_limits(robot: SimplifiedRobot) -> str:
    """Write the position limits of joints that depend on others as constraints; empty where there are none."""
    rows = [
        f"    - {{name: {name}, quantity: coordinate, coordinate: {name}, "
        f"min: {limits.lower:.6g}, max: {limits.upper:.6g}}}\n"
        for name, limits in robot.dependent_limits().items()
        if limits.allows(robot.guess.get(name, 0.0))
    ]
    return f"{_CONSTRAINTS}{''.join(rows)}" if rows else ""


def _is_limited(limits: ImportedJoint) -> bool:
    return limits.is_limited


def _fast(limits: ImportedJoint) -> bool:
    return bool(limits.velocity) and math.isfinite(limits.velocity or 0.0)


def _position(kind: str, limits: ImportedJoint | None) -> str:
    if limits is None or not limits.is_limited:
        return _RANGE[kind]
    return f"[{limits.lower:.6g}, {limits.upper:.6g}]"


def _velocity(kind: str, limits: ImportedJoint | None) -> str:
    if limits is None or not limits.velocity or not math.isfinite(limits.velocity):
        return f"{_SPEED[kind]:g}"
    return f"{abs(limits.velocity):.6g}"


_CONSTRAINTS = """\
  constraints:                  # limits of joints that depend on the others, rad or m
"""
_NO_DRIVES = """\
# Friction and rotors of the joints, of which the file says nothing: inertia (kg m^2, kg), viscous
# (N m s/rad, N s/m), coulomb and offset (N m, N), stiffness; a number, or unknown if yet to be found.
# drives:
#   all: {inertia: unknown, viscous: unknown, coulomb: unknown, offset: unknown}
"""
_DRIVES = """\
drives:
  # Friction of the joints as in the file: viscous (N m s/rad, N s/m), coulomb (N m, N). Besides there
  # are inertia, offset and stiffness; each a number, or unknown if yet to be found."""
_TRAJECTORIES = """\
trajectories:
  count: 10                     # of the estimation set
  validation_count: 1
  harmonics: 4
  period: 2*pi                  # s
  points: 100                   # samples over a period
  rest_to_rest: true            # begin and end at rest, as a controller needs it
"""
