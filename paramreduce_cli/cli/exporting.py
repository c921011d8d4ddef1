"""What commands that export have in common."""

from typing import Any

from paramreduce_cli.artifacts.store import Store, load_file
from paramreduce_cli.config import Config
from paramreduce_cli.errors import ArtifactError
from paramreduce_cli.running.pipeline import find_maker
from paramreduce_cli.running.runner import Runner


def up_to_date(config: Config | None, store: Store, record: type) -> Any:
    """A record that fits the config, if there is one: what goes onto a controller had better be up to date.

    Raises:
        ArtifactError: It is missing, or was made from something else.
    """
    robot = config.robot if config is not None else None
    found = load_file(store.get_path(record), record, robot, find_maker(record).name)[0]
    if mismatch := Runner(config, store, jobs=1).describe_mismatch(record):
        again, command = ("Make it again.", "") if config is None else ("", "run")
        raise ArtifactError(
            f"{mismatch}.", rejected=str(store.get_path(record)), remedy=again, command=command
        )
    return found
