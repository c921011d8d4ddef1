"""Text of a valid config for a simplified robot."""

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
from paramreduce_cli.importing.angles import format_angle, format_number
from paramreduce_cli.importing.imported_robot import ImportedJoint, Inertial, Steps
from paramreduce_cli.importing.simplification import (
    Closure,
    Coupling,
    ImportedBody,
    SimplifiedRobot,
)

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


def format_config(robot: SimplifiedRobot, source: SourceSection, log: str = "") -> str:
    """Return the text of a robot's config.

    Args:
        robot: Robot, with names that configs allow.
        source: Source of the robot; the path of its file is relative to the folder of the config.
        log: Section for logs of the machine, from which friction and rotors can be identified.
    """
    parts = [
        _format_head(robot),
        _format_source(source),
        _format_description(robot),
        _format_parameters(robot),
    ]
    if log:
        parts += [LOG_DRIVES, _format_limits(robot), log, LOG_JUDGEMENT]
    else:
        parts += [_format_drives(robot), _format_limits(robot), JUDGEMENT]
    return "\n".join(parts)


def _format_head(robot: SimplifiedRobot) -> str:
    """Return the comment at the top, with the import's warnings, and the robot's name."""
    lines = [
        f"{robot.name}: from {robot.source} by `paramreduce init`; this file is the robot from now on.",
        "Units are SI; numbers may be written as 1e-3 or pi/2. `paramreduce schema` lists every key.",
    ]
    if robot.warnings:
        lines += ["", "What was done, or is left to do:"]
        lines += [f"- {warning}." for warning in robot.warnings]
    text = "".join(_format_comment(line) for line in lines)
    return f"{text}robot: {_quote_name(robot.name)}\n"


def _format_source(source: SourceSection) -> str:
    """Return the section ``source``, which is needed to write the robot back; JSON strings are valid YAML."""
    given = source.model_dump(mode="json", exclude_defaults=True)
    lines = [f"  {key}: {json.dumps(value)}" for key, value in given.items()]
    return "\n".join(
        [
            "source:  # so that `paramreduce export --format urdf` (or mjcf) can write it back",
            *lines,
            "",
        ]
    )


def _format_comment(line: str) -> str:
    """Return a line as a wrapped comment."""
    printable = "".join(c if c.isprintable() else " " for c in line)
    indent = "  " if line.startswith("- ") else ""
    return "".join(
        f"# {part}".rstrip() + "\n"
        for part in textwrap.wrap(printable, 96, subsequent_indent=indent) or [""]
    )


def _format_description(robot: SimplifiedRobot) -> str:
    """Return the section ``description``."""
    lines = [
        "description:",
        f"  gravity: {_format_list(robot.gravity)}        # acceleration of gravity in the base frame, m/s^2",
        "  tree:",
        "    # A body's frame is its joint's; `at` is where that is in the parent's frame, step by step.",
        "    bodies:",
    ]
    lines += [f"      - {_format_body(body)}" for body in robot.bodies]
    if robot.couplings or robot.closures:
        lines += ["    closures:", *(f"      - {_format_coupling(one)}" for one in robot.couplings)]
        lines += [f"      - {_format_closure(one)}" for one in robot.closures]
        lines.append(f"    independent: [{', '.join(map(_quote_name, robot.independent))}]")
        if robot.guess:
            values = (f"{_quote_name(name)}: {value:.6g}" for name, value in robot.guess.items())
            lines.append(f"    guess: {{{', '.join(values)}}}")
    return "\n".join(lines) + "\n"


def _format_body(body: ImportedBody) -> str:
    """Return a body as flow-style YAML."""
    items = [f"name: {_quote_name(body.name)}"]
    if body.parent != "base":
        items.append(f"parent: {_quote_name(body.parent)}")
    items.append(f"joint: {body.joint}")
    if body.axis is not None:
        items.append(f"axes: {_format_axis(body.axis)}")
    if body.at:
        items.append(f"at: {_format_steps(body.at)}")
    if body.coordinate is not None:
        items.append(f"coordinates: {_quote_name(body.coordinate)}")
    if body.massless:
        items.append("massless: true")
    return f"{{{', '.join(items)}}}"


def _format_coupling(coupling: Coupling) -> str:
    """Return a coupling of the joints of two bodies as flow-style YAML."""
    bodies = f"[{_quote_name(coupling.leader.name)}, {_quote_name(coupling.follower.name)}]"
    offset = f", offset: {format_number(coupling.offset)}" if coupling.offset else ""
    return f"{{type: coupling, bodies: {bodies}, ratio: {format_number(coupling.ratio)}{offset}}}"


def _format_closure(closure: Closure) -> str:
    """Return a closure as flow-style YAML."""
    bodies = f"[{', '.join(map(_quote_name, closure.bodies))}]"
    at = ", ".join(map(_format_steps, closure.at))
    return (
        f"{{name: {_quote_name(closure.name)}, type: {closure.kind}, bodies: {bodies}, at: [{at}]}}"
    )


def _format_axis(axis: Sequence[float]) -> str:
    """Return an axis as a letter with a sign, or as a list of numbers."""
    for direction, letter in _DIRECTIONS.items():
        if tuple(axis) == direction:
            return letter
        if tuple(-x for x in axis) == direction:
            return f"-{letter}"
    return _format_list(axis)


def _format_steps(steps: Steps) -> str:
    """Return steps as flow-style YAML."""
    shown = [
        f"{{xyz: {_format_list(value)}}}"
        if isinstance(value, tuple)
        else f"{{{key}: {format_angle(value)}}}"
        for key, value in steps
    ]
    return f"[{', '.join(shown)}]"


def _format_list(values: Sequence[float] | np.ndarray) -> str:
    return f"[{', '.join(format_number(float(value)) for value in values)}]"


def _quote_name(name: str) -> str:
    """Return a name, quoted if YAML would read it as something else."""
    plain = re.fullmatch(r"[A-Za-z][A-Za-z0-9_-]*", name) and name.lower() not in _NOT_PLAIN
    return name if plain else f'"{name}"'


def _format_parameters(robot: SimplifiedRobot) -> str:
    """Return the section ``parameter_sets``."""
    lines = [
        "parameter_sets:",
        "  # Mass (kg), centre of mass in the body's frame (m), and inertia about the centre of mass",
        "  # [Ixx, Ixy, Ixz, Iyy, Iyz, Izz] (kg m^2).",
        "  file:",
    ]
    lines += [
        f"    {_quote_name(b.name)}: {_format_inertia(b.inertial)}"
        for b in robot.bodies
        if not b.massless
    ]
    return "\n".join(lines) + "\n"


def _format_inertia(inertial: Inertial) -> str:
    """Return an inertia as flow-style YAML."""
    tensor = inertial.tensor[np.triu_indices(3)]
    if not inertial.mass and not tensor.any():
        return "{m: 0}        # TODO"
    return (
        f"{{m: {format_number(inertial.mass)}, com: {_format_list(inertial.com)}, "
        f"inertia_com: {_format_list(tensor)}}}"
    )


def _format_drives(robot: SimplifiedRobot) -> str:
    """Return the section ``drives`` with the friction, rotors and springs of the file, or a comment on how to add them."""
    given = {
        body.coordinate: body.limits.drive
        for body in robot.bodies
        if body.limits is not None and body.coordinate is not None and body.limits.drive
    }
    if not given:
        return _NO_DRIVES
    lines = [
        f"  {_quote_name(name)}: {{{', '.join(f'{k}: {format_number(v)}' for k, v in values.items())}}}"
        for name, values in given.items()
    ]
    return "\n".join([_DRIVES, *lines]) + "\n"


def _format_limits(robot: SimplifiedRobot) -> str:
    """Return nominal torques and the limits of trajectories, coordinate by coordinate."""
    coordinates: list[tuple[str, str, ImportedJoint | None]] = [
        (name, body.joint, body.limits)
        for body in robot.bodies
        for name in body.list_coordinates()
        if name in robot.independent
    ]
    efforts = [limits.effort if limits else None for _, _, limits in coordinates]
    known = all(effort is not None and effort > 0 for effort in efforts)
    nominal = (
        f"nominal_torque: {_format_list([e for e in efforts if e is not None])}        # the file's, N m (N)\n"
        if known
        else "nominal_torque: standard-deviation   # the file does not give all; or one per joint, N m (N)\n"
    )

    def format_rows(
        shown: Callable[[str, ImportedJoint | None], str], given: Callable[[ImportedJoint], object]
    ) -> str:
        """Return a line for each coordinate, with a comment if the file lacks the limit."""
        width = max(len(shown(kind, limits)) for _, kind, limits in coordinates)
        return "".join(
            f"    - {shown(kind, limits):{width}}   # {name}"
            f"{'' if limits is not None and given(limits) else _CHOSEN}\n"
            for name, kind, limits in coordinates
        )

    return (
        f"{nominal}\n{_TRAJECTORIES}  position_limits:              # rad or m\n{format_rows(_format_position_limits, _is_limited)}"
        f"  velocity_limits:              # rad/s or m/s\n{format_rows(_format_velocity_limit, _has_speed_limit)}"
        f"{_format_dependent_limits(robot)}"
    )


def _format_dependent_limits(robot: SimplifiedRobot) -> str:
    """Write the position limits of joints that depend on others as constraints; empty where there are none."""
    rows = [
        f"    - {{name: {name}, quantity: coordinate, coordinate: {name}, "
        f"min: {limits.lower:.6g}, max: {limits.upper:.6g}}}\n"
        for name, limits in robot.find_dependent_limits().items()
        if limits.is_within_limits(robot.guess.get(name, 0.0))
    ]
    return f"{_CONSTRAINTS}{''.join(rows)}" if rows else ""


def _is_limited(limits: ImportedJoint) -> bool:
    return limits.is_limited


def _has_speed_limit(limits: ImportedJoint) -> bool:
    return bool(limits.velocity) and math.isfinite(limits.velocity or 0.0)


def _format_position_limits(kind: str, limits: ImportedJoint | None) -> str:
    """Return position limits as YAML; usual ones where the file has none."""
    if limits is None or not limits.is_limited:
        return _RANGE[kind]
    return f"[{limits.lower:.6g}, {limits.upper:.6g}]"


def _format_velocity_limit(kind: str, limits: ImportedJoint | None) -> str:
    """Return a velocity limit as YAML; a usual one where the file has none."""
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
