"""Workers, callbacks and provenance that a run gives to its stages."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, ClassVar, Protocol

from paramreduce_cli.records.representation import record


class Stored(Protocol):
    """A record that has a file of its own."""

    FILE: ClassVar[str]
    """Name of the file below the results folder."""


@record
class Report:
    """The files of the report by their path below ``report/``."""

    summary: Mapping[str, Any]
    files: Mapping[str, bytes]


@record
class Progress:
    """One step of a long piece of work, for whoever shows it."""

    task: str
    done: float
    total: float
    detail: str = ""


ProgressCallback = Callable[[Progress], None]
"""An audience of long work."""


@record
class Provenance:
    """The provenance of an artifact: config, versions, times and warnings."""

    robot: str
    config_sha256: str
    versions: Mapping[str, str]
    seconds: Mapping[str, float]
    warnings: Mapping[str, Sequence[str]]
    """Warnings of the config and of the stages, by name."""
    arguments: str
    """The config and options that name the run at the shell; empty where it was not started there."""
    settings: Mapping[str, Any]
    """Settings of the config that differ from their defaults."""


@record
class Run:
    """The worker processes and callbacks that the caller of a stage provides."""

    jobs: int = 1
    """Worker processes; 0 for doing all in this one."""
    progress: ProgressCallback = lambda _: None
    interrupted: Callable[[], None] = lambda: None
    """Called by a stage that has met a KeyboardInterrupt and ends early, with a complete result."""
    unchanged: frozenset[str] = frozenset()
    """Names of the sections and files that are what they were when the stage made what it is given as
    made before; none of them where everything is to be done again."""
