"""What a stage takes that no other stage makes: files of the user's own, noted by their digests."""

import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from paramreduce_cli.artifacts.brought import load_coefficients, load_recording
from paramreduce_cli.artifacts.log_files import load_log
from paramreduce_cli.artifacts.store import file_digest
from paramreduce_cli.config import Config
from paramreduce_cli.config.error_keys import locate_error
from paramreduce_cli.errors import NumericalError, ParamreduceWarning
from paramreduce_cli.records import (
    SETS,
    Coefficients,
    Progress,
    RawLog,
    RawLogs,
    Recording,
    Recordings,
    Tell,
)
from paramreduce_cli.running.pipeline import Stage, brought_files

_MOST_WARNINGS = 50
"""Of a stage that are kept; an attribute of a file has not room for any number."""


class Inputs:
    """What one stage has read so far: files by their digests.

    Args:
        config: Names the files.
        tell: Told of long reading.
    """

    def __init__(self, config: Config | None, tell: Tell = lambda _: None) -> None:
        self.config, self.tell = config, tell
        self.digests: dict[str, str] = {}

    def files(self, kind: type) -> dict[str, Path]:
        """Files of a kind that the config names, by name; noted as read."""
        found = brought_files(self.config, kind)
        for path in found.values():
            self.digests[str(path)] = file_digest(path)
        return found


def called(stage: Stage, arguments: dict[str, Any]) -> Any:
    """What a stage makes of its arguments; concerns are told by the config's keys.

    Raises:
        ParamreduceError: It fails.
    """
    try:
        return stage.call(arguments)
    except NumericalError as error:
        raise locate_error(error) from error


@contextmanager
def noted_warnings() -> Iterator[list[str]]:
    """The warnings of this project that are given meanwhile; they are shown as ever."""
    noted: list[str] = []
    with warnings.catch_warnings():
        show = warnings.showwarning

        def note(message: Warning | str, category: type[Warning], *where: Any) -> None:
            if issubclass(category, ParamreduceWarning) and len(noted) < _MOST_WARNINGS:
                noted.append(str(message))
            show(message, category, *where)

        warnings.showwarning = note  # type: ignore[assignment]
        yield noted


class _LogFiles:
    """Logs that are read when they are gone through, and not kept: each may take gigabytes."""

    def __init__(self, kind: str, paths: Sequence[Path], tell: Tell) -> None:
        self._task, self._paths, self._tell = f"read {kind} logs", paths, tell

    def __iter__(self) -> Iterator[RawLog]:
        for k, path in enumerate(self._paths):
            self._tell(Progress(self._task, k, len(self._paths), path.name))
            yield load_log(path)
        if self._paths:
            self._tell(Progress(self._task, len(self._paths), len(self._paths)))


def _logs(inputs: Inputs) -> RawLogs:
    files = inputs.files(RawLogs)
    training, held_out = (
        _LogFiles(
            kind, [path for name, path in files.items() if name.startswith(kind)], inputs.tell
        )
        for kind in ("training", "held out")
    )
    return RawLogs(training, held_out)


def _coefficients(inputs: Inputs) -> Coefficients | None:
    paths = inputs.files(Coefficients)
    return load_coefficients(paths["coefficients"]) if paths else None


def _recordings(inputs: Inputs) -> Recordings:
    assert inputs.config is not None
    found: dict[str, Recording | None] = dict.fromkeys(SETS)
    for name, path in inputs.files(Recordings).items():
        found[name] = load_recording(path, inputs.config.n_dof)
    return Recordings(**found)


OUTSIDE: dict[type, Callable[[Inputs], Any]] = {
    Coefficients: _coefficients,
    Recordings: _recordings,
    RawLogs: _logs,
}
"""What stages read from files of the user's own."""
