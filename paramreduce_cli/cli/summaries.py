"""Summaries of runs, as commands are given them."""

from pathlib import Path
from typing import Any

from paramreduce_cli.artifacts.report_files import SUMMARY, load_json
from paramreduce_cli.errors import ConfigError


def load_summary(path: Path) -> dict[str, Any]:
    """Read a summary.json, or that of a results folder.

    Raises:
        ConfigError, ArtifactError: It is none.
    """
    if path.is_dir():
        path /= SUMMARY
    loaded = load_json(path)
    if not isinstance(loaded, dict):
        raise ConfigError(f"{path}: is no summary.json.")
    return loaded
