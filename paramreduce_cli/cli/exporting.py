"""Functions that several export commands share."""

from typing import Any

from paramreduce_cli.artifacts.store import Store, load_file
from paramreduce_cli.config import Config
from paramreduce_cli.errors import ArtifactError
from paramreduce_cli.running.pipeline import find_maker
from paramreduce_cli.running.runner import Runner


def load_current(config: Config | None, store: Store, record: type) -> Any:
    """Return a record if its file is of the current config, as code for a controller must be.

    Raises:
        ArtifactError: The file is missing or damaged, or was made with another config or from other artifacts.
    """
    robot = config.robot if config is not None else None
    found = load_file(store.get_path(record), record, robot, find_maker(record).name)[0]
    if mismatch := Runner(config, store, jobs=1).describe_mismatch(record):
        remedy, command = ("Make it again.", "") if config is None else ("", "run")
        raise ArtifactError(
            f"{mismatch}.", rejected=str(store.get_path(record)), remedy=remedy, command=command
        )
    return found
