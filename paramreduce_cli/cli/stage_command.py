"""Commands of the stages, derived from the signatures of the stages."""

import inspect
from collections.abc import Callable
from pathlib import Path
from typing import Any

import click

from paramreduce_cli.artifacts.store import get_file, load_file
from paramreduce_cli.cli.example_command import ExampleCommand
from paramreduce_cli.cli.options import (
    CONFIG,
    FORCE,
    JOBS,
    OPTIONAL_CONFIG,
    PART,
    QUIET,
    RESULTS,
    SET,
    WAIT,
    count_cores,
    make_callbacks,
    make_store,
)
from paramreduce_cli.cli.stage_messages import say_outcome, say_verdict
from paramreduce_cli.cli.terminal import LOG, VERBOSE, show_progress, warn_user
from paramreduce_cli.config import load_config, locate_errors
from paramreduce_cli.config.loading import has_robot, load_settings
from paramreduce_cli.errors import MissingConfigError
from paramreduce_cli.records import WHOLE, Identification, MeasuredLog, Part, Validation
from paramreduce_cli.running.pipeline import Stage, check_is_part, describe_stage
from paramreduce_cli.running.runner import Outcome, Runner, format_arguments
from paramreduce_cli.stages import stages

_OF_LOGS = (MeasuredLog, Identification)
"""What is made where torques are measured."""


def make_stage_command(name: str) -> click.Command:
    """Return the command that runs a stage."""
    stage = describe_stage(name, stages[name])
    config_optional = not stage.needs_config

    def command(
        config: Path | None,
        results: Path | None,
        overrides: tuple[str, ...],
        force: bool,
        quiet: bool,
        wait: bool,
        jobs: int | None = None,
        samples: Path | None = None,
        part: Part | None = None,
    ) -> int:
        """Run the stage, and return the exit code."""
        if config is None and samples is None:
            raise MissingConfigError("Give a CONFIG, or --samples FILE and --results DIR.")
        robot = config is not None and (samples is None or has_robot(config))
        loaded = load_config(config, overrides) if config is not None and robot else None
        settings = None if loaded is not None else load_settings(config, overrides)
        store = make_store(loaded, results)
        placed = locate_errors(config, overrides)
        lock = "" if part is None else f"-{stage.name}-{part.number}-{part.count}"
        with placed, store.lock(lock, wait=wait), show_progress(stage.name, quiet) as progress:
            if loaded is not None:
                check_is_part(stage, loaded)
            runner = Runner(
                loaded,
                store,
                jobs or count_cores(),
                make_callbacks(progress),
                samples,
                settings,
                format_arguments(config if robot else None, results, overrides),
            )
            outcome = runner.run(stage, force=force, go_on=True, part=part or WHOLE)
        if not quiet:
            say_outcome(outcome)
        return _find_exit_code(stage, outcome, quiet)

    params: list[Any] = [RESULTS, SET, FORCE, QUIET, VERBOSE, LOG, WAIT]
    if stage.lends_run is not None:
        params.append(JOBS)
    if stage.has_items:
        params.append(PART)
    if config_optional:
        params.append(
            click.option(
                "--samples", type=click.Path(path_type=Path, dir_okay=False), metavar="FILE",
                help="Use your own samples.h5. CONFIG is then optional, and may hold settings without a robot.",
            )
        )  # fmt: skip
    params.append(OPTIONAL_CONFIG if config_optional else CONFIG)
    decorated: Callable[..., Any] = command
    for parameter in params:
        decorated = parameter(decorated)
    config = "configs/ur10.yaml" if stage.output in _OF_LOGS else "configs/puma560.yaml"
    example = f"{stage.name} {{config}}"
    decorator = click.command(
        stage.name, cls=ExampleCommand, help=_format_help(stage), example=example, config=config
    )
    return decorator(decorated)


def _format_help(stage: Stage) -> str:
    """Return the help of a stage: its docstring without the section on errors, and the files that the stage reads and
    writes.
    """
    reads = [get_file(entry.type) for entry in stage.artifacts]
    source = " and ".join([", ".join(reads[:-1]), reads[-1]] if len(reads) > 1 else reads)
    flow = f"Reads {source or 'the config'}; writes {get_file(stage.output)}."
    paragraphs = inspect.cleandoc(stage.function.__doc__ or "").split("\n\n")
    return "\n\n".join([*(p for p in paragraphs if not p.startswith("Raises:")), flow])


def _find_exit_code(stage: Stage, outcome: Outcome, quiet: bool) -> int:
    """Return the exit code of a stage, after telling the verdict of a validation."""
    if stage.output is not Validation:
        return 0
    record = outcome.record or load_file(outcome.path, Validation, None, stage.name)[0]
    if not quiet:
        for entry in record.warnings:
            warn_user(entry.text.rstrip("."))
    return say_verdict(record.accepted, record.verdict, quiet)
