"""Options that several commands share."""

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import click

from paramreduce_cli.artifacts.store import Store
from paramreduce_cli.cli.terminal import interruption, warn_user
from paramreduce_cli.config import Config
from paramreduce_cli.errors import MissingConfigError
from paramreduce_cli.records import Part, Progress
from paramreduce_cli.running.runner import Callbacks


class FilePath(click.Path):
    """A path of a file; click's error knows the path that it rejects."""

    def __init__(self) -> None:
        super().__init__(path_type=Path, dir_okay=False)

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Check the path."""
        try:
            return super().convert(value, param, ctx)
        except click.BadParameter as error:
            error.rejected = str(value)  # type: ignore[attr-defined]
            raise


CONFIG = click.argument("config", type=FilePath())
OPTIONAL_CONFIG = click.argument("config", type=FilePath(), required=False)
RESULTS = click.option(
    "--results",
    type=click.Path(path_type=Path, file_okay=False),
    help="Folder of the artifacts.  [default: results/ROBOT]",
)
SET = click.option(
    "--set", "overrides", multiple=True, metavar="KEY=VALUE",
    help="Override a key of the config, such as trajectories.count=3; may be repeated.",
)  # fmt: skip
FORCE = click.option("--force", is_flag=True, help="Do it again even if it is up to date.")
QUIET = click.option("--quiet", is_flag=True, help="Say nothing but errors and warnings.")
JOBS = click.option(
    "--jobs", type=click.IntRange(min=1), default=None, metavar="N",
    help="Worker processes.  [default: all cores]",
)  # fmt: skip


class PartType(click.ParamType):
    """A part of a stage's items, such as 3/8."""

    name = "i/N"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Part:
        """Read it."""
        try:
            return Part.parse(str(value))
        except ValueError as error:
            self.fail(str(error), param, ctx)


PART = click.option(
    "--part", "part", type=PartType(), metavar="i/N",
    help="Do every N-th item of the work, from the i-th on; the same command without --part does what is missing and combines all.",
)  # fmt: skip

WAIT = click.option(
    "--wait", is_flag=True,
    help="Wait for another run that is at work on the same, rather than end; for schedulers, whose jobs may outlive them.",
)  # fmt: skip


def count_cores() -> int:
    """Return the number of cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def make_store(config: Config | None, results: Path | None) -> Store:
    """Return the results folder of a config, or the folder that the call names."""
    if results is not None:
        return Store(results)
    if config is None:
        raise MissingConfigError(
            "--results: without a config, say where the results go or are, such as --results results/my_samples.",
            options=("--results", "results/my_samples"),
        )
    return Store(Path("results") / config.robot)


def make_callbacks(progress: Callable[[Progress], None]) -> Callbacks:
    """Return the functions that a run calls at the terminal."""
    return Callbacks(progress, warn_user, interruption.clear, interruption.check)
