"""Types of paths on the command line: a config stands for its results, and results for their config."""

from pathlib import Path
from typing import Any

import click

from paramreduce_cli.cli.project_state import find_config, get_results_path, is_config
from paramreduce_cli.errors import MissingConfigError

FOLDER = "paramreduce.results"
"""Key of click's context for the results folder that was given in place of a config."""


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


class ConfigPath(FilePath):
    """A path of a config, or of a results folder that was made with one."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Return the config; note the results folder if the path is one.

        Raises:
            MissingConfigError: The path is a results folder whose config is not found.
        """
        folder = Path(value)
        if ctx is None or not any(folder.glob("*.h5")):
            return super().convert(value, param, ctx)
        ctx.meta[FOLDER] = folder
        config = find_config(folder)
        if config is None:
            raise MissingConfigError(
                f"{folder}: the config of these results was not found. Give the config, and --results {folder}.",
                rejected=str(folder),
            )
        return config


class ResultsPath(click.Path):
    """A path of a results folder or of a file in it, or of the config that the results were made with."""

    def __init__(self) -> None:
        super().__init__(path_type=Path)

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Return the path, or the results folder of a config."""
        path = Path(value)
        return get_results_path(path) if is_config(path) else super().convert(value, param, ctx)
