"""The command that writes a config to begin with."""

import os
import re
import tempfile
import warnings
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from shlex import quote

import click

from paramreduce_cli.cli.example_command import ExampleCommand
from paramreduce_cli.cli.terminal import say
from paramreduce_cli.config.column_headings import read_units, split_unit
from paramreduce_cli.config.column_matching import match_columns, suggest_locking
from paramreduce_cli.config.examples import copy_example, make_exists_error
from paramreduce_cli.config.loading import load_config
from paramreduce_cli.config.log_settings import TODO
from paramreduce_cli.config.log_template import format_log_section
from paramreduce_cli.config.schema import CLOSED, Config, SourceSection
from paramreduce_cli.config.template import (
    format_dh_template,
    format_loop_template,
    format_recorded_template,
    format_tree_template,
)
from paramreduce_cli.errors import ConfigError, ParamreduceWarning
from paramreduce_cli.fields.numbers import parse_number
from paramreduce_cli.fields.section import NAME
from paramreduce_cli.importing.config_writing import format_config
from paramreduce_cli.importing.simplification import SimplifiedRobot
from paramreduce_cli.importing.source_reading import find_described_robot, read_robot
from paramreduce_cli.records import RawLog

_BASE = 6
"""Coordinates of a base that floats, which come first."""
_FARTHEST = 1e6
"""Where a joint may be locked, rad or m."""
_MOST_SHOWN = 30
"""Names of columns in a message."""


@click.command(
    cls=ExampleCommand, example="init robot.urdf --log recording.csv --output configs/robot.yaml"
)
@click.argument("source", metavar="FILE|NAME", required=False)
@click.option(
    "--dh", "kind", flag_value="dh", help="Template of an arm in Denavit-Hartenberg parameters."
)
@click.option("--tree", "kind", flag_value="tree", help="Template of a tree of bodies.")
@click.option(
    "--loop", "kind", flag_value="loop", help="Template of a mechanism with a closed loop."
)
@click.option(
    "--recorded", "kind", flag_value="recorded", help="Template of an arm with recorded motions."
)
@click.option("--example", "kind", flag_value="example",
              help="Copy one of the example configs.")  # fmt: skip
@click.option(
    "--joints",
    type=click.IntRange(1, 30),
    default=6,
    show_default=True,
    help="Number of joints, with --dh and --recorded.",
)
@click.option(
    "--root", metavar="LINK", help="Link that is fixed to the ground.  [default: the file's root]"
)
@click.option(
    "--tip",
    metavar="LINK",
    help="Link at the end of a chain; joints beside the chain are locked at 0.",
)
@click.option("--lock", "locked", multiple=True, metavar="JOINT=VALUE",
              help="Lock a joint at a value, rad or m. May be repeated.")  # fmt: skip
@click.option("--ignore", "ignored", multiple=True, metavar="LINK",
              help="Remove a link with everything it carries. May be repeated.")  # fmt: skip
@click.option("--close", "closed", multiple=True, metavar="A=B[:KIND]",
              help="Close a loop by holding the frames of two links together: fixed, revolute (free about the z axis of the frames) or spherical. A pin about another axis is spherical. May be repeated.  [default KIND: fixed]")  # fmt: skip
@click.option("--independent", multiple=True, metavar="JOINT",
              help="Driven joint, with --close. May be repeated.  [default: chosen]")  # fmt: skip
@click.option("--floating", is_flag=True, help="Let the root link move freely.")
@click.option("--uncouple", is_flag=True, help="Let mimic joints move independently.")
@click.option("--log", "logs", multiple=True, type=click.Path(path_type=Path), metavar="FILE",
              help="Recording of the robot to identify parameters from. May be repeated.")  # fmt: skip
@click.option(
    "-o", "--output", type=click.Path(path_type=Path), help="[default: configs/ROBOT.yaml]"
)
def init(
    source: str | None, kind: str | None, joints: int, root: str | None, tip: str | None,
    locked: tuple[str, ...], ignored: tuple[str, ...], closed: tuple[str, ...],
    independent: tuple[str, ...], floating: bool, uncouple: bool,
    logs: tuple[Path, ...], output: Path | None,
) -> None:  # fmt: skip
    """Write a commented config: from a URDF or MJCF, or with --dh, --tree, --loop or --recorded one to be filled in.

    Links of a file that cannot move relative to each other become one body. Angles such as 1.5708 become pi/2. Limits
    and inertias are taken from the file. From then on the config describes the robot.
    """
    if source is None:
        raise ConfigError(
            "name the robot.",
            remedy="`paramreduce init robot.urdf` reads a robot's file; to describe a robot in a config there is "
            "`paramreduce init --dh NAME` (an arm), `--tree NAME` (a tree of bodies), `--loop NAME` "
            "(closed loops) and `--recorded NAME` (an arm with recorded motions); `paramreduce init --example puma560` "
            "copies a config that works.",
        )
    if kind == "example":
        copied, absent = copy_example(source, output or Path("configs") / f"{source}.yaml")
        for name in absent:
            say(f"- {name} is not part of the package. Copy it here, or use your own log.")
        say(f"Wrote {', '.join(map(str, copied))}. paramreduce run {quote(str(copied[0]))}")
        return
    choice = SourceSection(
        file=(find_described_robot(source) if kind is None else None) or Path(source), root=root, tip=tip, locked=dict(map(_parse_lock, locked)),
        ignored=list(ignored), floating=floating, uncoupled=uncouple, closed=list(map(_check_closure, closed)),
        independent=list(independent),
    )  # fmt: skip
    if kind is not None:
        if logs or choice != SourceSection(file=choice.file):
            raise ConfigError(f"--{kind} takes no options of a robot's file.")
        path = output or Path("configs") / f"{source}.yaml"
        text = _make_template(source, kind, joints)
    else:
        robot = read_robot(choice)
        path = output or Path("configs") / f"{robot.name}.yaml"
        if re.fullmatch(NAME, path.stem, re.ASCII):  # results go to a folder of the robot's name
            robot = replace(robot, name=path.stem)
        if independent and not robot.closures:
            raise ConfigError(
                "--independent: needs closed loops, for example from --close. Without loops all joints are independent."
            )
        if robot.closures:
            robot = _close_loops(robot, choice)
        base = robot.independent[:_BASE] if floating else ()
        log = _make_log_section(path, logs, robot.independent, base) if logs else ""
        text = format_config(
            robot, choice.model_copy(update={"file": _make_path(path, choice.file)}), log
        )
        for warning in robot.warnings:
            say(f"- {warning}.")
    if path.exists():
        raise make_exists_error(path)
    # Columns that are still to be named are taken for some name, numbers for 1.
    filled = text.replace(f'"{TODO}"', '"x"')
    _check_config(re.sub(rf"(recorded_rate|torque_constants): {TODO}", r"\1: 1", filled))
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise ConfigError(f"{path}: cannot be written: {error.strerror}.") from error
    todo = "Fill in what is marked TODO, then: " if "TODO" in text else ""
    say(f"Wrote {path}. {todo}paramreduce run {quote(str(path))}")


def _make_log_section(
    config: Path, logs: Sequence[Path], joints: Sequence[str], base: Sequence[str]
) -> str:
    """Return the section for logs, with columns by their usual names; columns that are not recognised are marked TODO.

    Raises:
        ConfigError: A file has no rows, several columns fit one joint, or a base that floats has no columns.
    """
    # Late: HDF5 and NumPy.
    from paramreduce_cli.artifacts.log_files import load_log

    parts = [load_log(path) for path in logs]
    for path, part in zip(logs, parts, strict=True):
        if not any(column.size for column in part.columns.values()):
            raise ConfigError(f"{path}: has headings, but no rows of numbers below.")
    names = _list_columns(parts[0])
    empty = [name for name in parts[0].columns if name not in names]
    if empty:
        say(f"- {', '.join(empty)}: no numbers, left out.")
    columns = _match_columns(parts[0], names, joints)
    every = list(dict.fromkeys(name for part in parts for name in _list_columns(part)))
    # Positions may be in one file, torques in another one.
    together = match_columns(every, joints) if len(parts) > 1 else columns
    joined = set(together) > set(columns)
    if joined:
        names, columns = every, together
    if (
        base
        and "position" not in columns
        and "position" in match_columns(names, joints[len(base) :])
    ):
        raise ConfigError(
            f"{logs[0]}: has columns for the joints, but none for the coordinates of the base ({', '.join(base)}). If it stood "
            "still, leave --floating out. If its motion was recorded under other names, leave --log out, and write sampling.log into the config."
        )
    units = read_units(columns)
    for key, value in columns.items():
        shown = value if isinstance(value, str) else ", ".join(value)
        say(f"- {key}: {shown}{f', in {units[key]}' if key in units else ''}.")
        headings = [value] if isinstance(value, str) else value
        if key not in units and any(split_unit(heading)[1] for heading in headings):
            say(
                f"- {key}: the units in the headings are unknown or differ; check `units` under sampling.log."
            )
    missing = [key for key in ("time", "position", "torque") if key not in columns]
    if missing:
        say(
            f"- {', '.join(missing)}: not recognised among the columns {', '.join(names[:_MOST_SHOWN])}"
            f"{', ...' if len(names) > _MOST_SHOWN else ''}, so marked TODO."
        )
    if missing and missing != ["time"]:
        say(f"- {suggest_locking(names, joints)}")
    for name, kind in parts[0].others.items() if missing else ():
        say(f"- {name}: holds {kind}.")
    paths = [_make_path(config, path) for path in logs]
    return format_log_section([paths] if joined else paths, columns, units, names)


def _list_columns(log: RawLog) -> list[str]:
    """Return the names of the columns with numbers."""
    import numpy as np

    return [name for name, column in log.columns.items() if np.isfinite(column).any()]


def _match_columns(
    log: RawLog, names: Sequence[str], joints: Sequence[str]
) -> dict[str, str | list[str]]:
    """Return the columns by quantity as far as they are recognised: by their names, or without headings by their
    numbers.
    """
    from paramreduce_cli.identification.column_order import guess_order

    if len({name.rstrip("0123456789") for name in names}) != 1:
        return match_columns(names, joints)
    columns = guess_order({name: log.columns[name] for name in names}, len(joints))
    if columns:
        say(
            f"- {log.source}: columns have no names, so they are taken by their order; check these."
        )
    return columns


def _make_path(config: Path, file: Path) -> Path:
    """Return the path of a robot's file for a config: relative to the config if both are in the working folder."""
    own, folder = file.resolve(), config.resolve().parent
    near = own.is_relative_to(Path.cwd()) and folder.is_relative_to(Path.cwd())
    return Path(os.path.relpath(own, folder)) if near else own


def _make_template(name: str, kind: str, joints: int) -> str:
    """Return a config to fill in, of the kind that is asked for.

    Raises:
        ConfigError: The name has characters that file names or YAML do not allow.
    """
    if not re.fullmatch(NAME, name, re.ASCII):
        raise ConfigError(
            f"NAME: {name!r} is not a valid name. Begin with a letter or digit; letters, digits, _, - and dots may follow."
        )
    if kind == "dh":
        return format_dh_template(name, joints)
    if kind == "recorded":
        return format_recorded_template(name, joints)
    return format_tree_template(name) if kind == "tree" else format_loop_template(name)


def _parse_lock(text: str) -> tuple[str, float]:
    """Return joint and value from JOINT=VALUE.

    Raises:
        ConfigError: The text has another form, or the value is too large for a joint.
    """
    joint, _, value = text.rpartition("=")
    try:
        if not joint:
            raise ValueError
        number = parse_number(value)
    except ValueError as error:
        raise ConfigError(f"--lock {text}: write JOINT=VALUE with a number, rad or m.") from error
    if abs(number) > _FARTHEST:
        raise ConfigError(f"--lock {text}: the value is too large for a joint; write rad or m.")
    return joint, number


def _check_closure(text: str) -> str:
    """Return A=B:KIND without spaces; raise ConfigError if the text is something else."""
    text = re.sub(r"\s*([=:])\s*", r"\1", text.strip())
    if not re.fullmatch(CLOSED, text):
        raise ConfigError(
            f"--close {text}: write two links as A=B, or A=B:KIND with fixed, revolute or spherical."
        )
    return text


def _close_loops(robot: SimplifiedRobot, choice: SourceSection) -> SimplifiedRobot:
    """Return the robot with a guess from which its loops close, and with independent coordinates."""
    # Late: CasADi.
    from paramreduce_cli.multibody.loops.imported_loops import close_loops

    every = tuple(name for body in robot.bodies for name in body.list_coordinates())
    text = format_config(replace(robot, independent=robot.independent or every), choice)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ParamreduceWarning)  # they come with the final text
        mechanism = _check_config(text).build_mechanism()
    return close_loops(robot, mechanism, required=bool(choice.independent))


def _check_config(text: str) -> Config:
    """Load a config before anything is written, and return it."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "config.yaml"
        path.write_text(text, encoding="utf-8")
        return load_config(path)
