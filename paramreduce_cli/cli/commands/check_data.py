"""The command that says what a log is good for."""

from pathlib import Path

import click
import rich.box
import rich.table

from paramreduce_cli.cli.example_command import ExampleCommand
from paramreduce_cli.cli.options import SET
from paramreduce_cli.cli.path_types import ConfigPath
from paramreduce_cli.cli.terminal import LOG, say, say_table, warn_user
from paramreduce_cli.config import load_config, locate_errors
from paramreduce_cli.config.column_matching import guess_columns, list_named_joints
from paramreduce_cli.config.log_settings import ColumnsSection, LogSection
from paramreduce_cli.errors import ConfigError
from paramreduce_cli.texts import format_percent

_MOST_JOINTS = 60
_MOST_SHOWN = 12
_TABLE_WIDTH = 100


@click.command(
    "check-data",
    cls=ExampleCommand,
    example="check-data recording.csv {config}",
    config="configs/ur10.yaml",
)
@click.argument("file", type=click.Path(path_type=Path))
@click.argument("config", type=ConfigPath(), required=False)
@SET
@LOG
def check_data(file: Path, config: Path | None, overrides: tuple[str, ...]) -> None:
    """Check whether a log is good enough: rate, gaps, noise, and with a CONFIG how well it excites the robot.

    Columns are those of the config's log; without a log in a config they are found by their usual names.
    """
    # Late: these load all numerics.
    from paramreduce_cli.artifacts.log_files import load_log, load_recorded
    from paramreduce_cli.identification.processing import process_logs
    from paramreduce_cli.identification.quality import find_base, measure_quality
    from paramreduce_cli.multibody.dynamics import Dynamics
    from paramreduce_cli.records import RawLogs
    from paramreduce_cli.stages.process_log import process_logs_of_robot

    if file.suffix in (".yaml", ".yml"):
        raise ConfigError(
            f"{file}: is a config, not a recording.",
            remedy=f"Write `paramreduce check-data RECORDING.csv {file}`.",
        )
    loaded = load_config(config, overrides) if config is not None else None
    raw = load_log(file)
    logs = RawLogs((raw,), ())
    names = list(raw.columns)
    mechanism = None if loaded is None else loaded.build_mechanism()
    joints = _format_joints(names) if mechanism is None else list(mechanism.coordinate_names)
    section = None if loaded is None else loaded.sampling.log
    if section is None:
        columns = ColumnsSection(**guess_columns(names, joints))  # type: ignore[arg-type]
        section = LogSection(files=[file], columns=columns)
    if file.resolve() in (part.resolve() for parts in section.training_files for part in parts):
        # The log of the config is processed as `run` processes it.
        logs = RawLogs(
            *(
                [load_recorded(parts, section.columns.time) for parts in recordings]
                for recordings in (section.training_files, section.held_out_files)
            )
        )
    elif section.held_out_files:
        usual = LogSection.model_fields["held_out"].default
        section = section.model_copy(update={"held_out": usual})
    with locate_errors(config, overrides):
        if mechanism is None or loaded is None:
            log, found = process_logs(logs, section, joints), None
        else:
            dynamics = Dynamics(mechanism, once=True)
            log = process_logs_of_robot(dynamics, loaded, section, logs)
            if log.friction is not None:
                dynamics = Dynamics(
                    loaded.apply_friction(log.friction).build_mechanism(), once=True
                )
            base = find_base(dynamics, loaded.find_measured())
            found = measure_quality(dynamics, base, log)
    for text in log.steps:
        say(text)
    table = rich.table.Table(box=rich.box.SIMPLE, pad_edge=False, collapse_padding=True)
    for heading in ("joint", "range", "fastest", "torque, rms", "noise", "/ torque"):
        table.add_column(
            heading, justify="left" if heading == "joint" else "right",
            overflow="fold", no_wrap=heading != "joint",
        )  # fmt: skip
    m = log.training
    for j, name in enumerate(joints):
        rms = float((m.tau[:, j] ** 2).mean() ** 0.5)
        z = m.z[:, j]
        table.add_row(
            name, f"{z.min():.3g} to {z.max():.3g}", f"{abs(m.dz[:, j]).max():.3g}", f"{rms:.3g}",
            f"{log.noise[j]:.2g}", format_percent(float(log.noise[j]) / rms if rms else None),
        )  # fmt: skip
    table.add_row("all", "", "", "", "", format_percent(log.noise_share))
    say_table(table, _TABLE_WIDTH)
    if found is not None:
        say(
            f"Excitation: rank {found.rank} of {found.n_base} base parameters, kappa {found.condition:.4g} with "
            "columns of unit length."
        )
        if found.weak:
            more = ", ..." if len(found.weak) > _MOST_SHOWN else ""
            warn_user(
                f"{len(found.weak)} can hardly be told from the others: "
                f"{', '.join(found.weak[:_MOST_SHOWN])}{more}"
            )
    for text in log.warnings:
        warn_user(text.rstrip("."))


def _format_joints(names: list[str]) -> list[str]:
    """Return the joints by number, as many as the columns speak of."""
    for n in range(_MOST_JOINTS, 0, -1):
        joints = [f"q{k + 1}" for k in range(n)]
        try:
            guess_columns(names, joints)
        except ConfigError:
            continue
        return joints
    joints = list_named_joints(names) or ["q1"]
    guess_columns(names, joints)  # says what is missing
    return joints
