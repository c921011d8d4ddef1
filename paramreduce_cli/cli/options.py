"""Options that several commands share."""

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import click

from paramreduce_cli.artifacts.store import Store
from paramreduce_cli.cli.path_types import FOLDER, ConfigPath
from paramreduce_cli.cli.terminal import interruption, warn_user
from paramreduce_cli.config import Config
from paramreduce_cli.errors import MissingConfigError
from paramreduce_cli.records import Part, Progress
from paramreduce_cli.running.runner import Callbacks

CONFIG = click.argument("config", type=ConfigPath(), is_eager=True)
OPTIONAL_CONFIG = click.argument("config", type=ConfigPath(), required=False, is_eager=True)
RESULTS = click.option(
    "--results",
    type=click.Path(path_type=Path, file_okay=False),
    callback=lambda ctx, _, folder: folder or ctx.meta.get(FOLDER),
    help="Folder of the artifacts.  [default: results/ROBOT]",
)
SET = click.option(
    "--set", "overrides", multiple=True, metavar="KEY=VALUE",
    help="Override a key of the config, for example trajectories.count=3. May be repeated.",
)  # fmt: skip
FORCE = click.option("--force", is_flag=True, help="Run again, even if the result is up to date.")
QUIET = click.option("-q", "--quiet", is_flag=True, help="Print only errors and warnings.")
JOBS = click.option(
    "-j", "--jobs", type=click.IntRange(min=1), default=None, metavar="N",
    help="Number of worker processes.  [default: all cores]",
)  # fmt: skip


class PartType(click.ParamType):
    """A part of a stage's items, such as 3/8."""

    name = "i/N"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Part:
        """Return the part that a text such as 3/8 names."""
        try:
            return Part.parse(str(value))
        except ValueError as error:
            self.fail(str(error), param, ctx)


PART = click.option(
    "--part", "part", type=PartType(), metavar="i/N",
    help="Do every N-th item, beginning with the i-th. The same command without --part does the missing items and combines all.",
)  # fmt: skip

WAIT = click.option(
    "--wait", is_flag=True,
    help="Wait while another run works in this results folder, instead of ending with an error.",
)  # fmt: skip


def count_cores() -> int:
    """Return the number of cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def make_store(config: Config | None, results: Path | None) -> Store:
    """Return the results folder of a config, or the folder that the command line names.

    Raises:
        MissingConfigError: There is neither a config nor a folder.
    """
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
