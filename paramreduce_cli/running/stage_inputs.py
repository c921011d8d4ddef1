"""Inputs of stages that no stage makes: the user's files, noted by their digests."""

import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from paramreduce_cli.artifacts.log_files import load_recorded
from paramreduce_cli.artifacts.store import digest_file
from paramreduce_cli.artifacts.user_files import load_coefficients, load_recording, load_signals
from paramreduce_cli.config import Config
from paramreduce_cli.config.error_keys import locate_error
from paramreduce_cli.errors import NumericalError, ParamreduceWarning
from paramreduce_cli.records import (
    SETS,
    Coefficients,
    Progress,
    ProgressCallback,
    RawLog,
    RawLogs,
    Recording,
    Recordings,
    SignalTables,
)
from paramreduce_cli.running.pipeline import Stage, list_user_files

_MOST_WARNINGS = 50
"""Most warnings of a stage that are kept; an attribute of a file has not room for any number."""


class Inputs:
    """The user's files that one stage has read so far, by their digests.

    Args:
        config: Config that names the files; None if there is none.
        report_progress: Progress callback for long reading.
    """

    def __init__(
        self, config: Config | None, report_progress: ProgressCallback = lambda _: None
    ) -> None:
        self.config, self.tell = config, report_progress
        self.digests: dict[str, str] = {}

    def note_files(self, kind: type) -> dict[str, Path]:
        """Return the files of a kind that the config names, by name, and note their digests."""
        found = list_user_files(self.config, kind)
        for path in found.values():
            self.digests[str(path)] = digest_file(path)
        return found


def call_stage(stage: Stage, arguments: dict[str, Any]) -> Any:
    """Call a stage; numerical errors are raised as errors of the config's keys.

    Raises:
        ParamreduceError: The stage fails.
    """
    try:
        return stage.call(arguments)
    except NumericalError as error:
        raise locate_error(error) from error


@contextmanager
def note_warnings() -> Iterator[list[str]]:
    """Collect this project's warnings within the block; they are shown as usual."""
    noted: list[str] = []
    with warnings.catch_warnings():
        show = warnings.showwarning

        def note(message: Warning | str, category: type[Warning], *where: Any) -> None:
            """Collect a warning of this project, and show it as usual."""
            if issubclass(category, ParamreduceWarning) and len(noted) < _MOST_WARNINGS:
                noted.append(str(message))
            show(message, category, *where)

        warnings.showwarning = note  # type: ignore[assignment]
        yield noted


class _LogFiles:
    """The logs of one kind, read one at a time when they are iterated over, as each may take gigabytes."""

    def __init__(
        self,
        kind: str,
        recordings: Sequence[Sequence[Path]],
        time: str,
        report_progress: ProgressCallback,
    ) -> None:
        self._task, self._recordings, self._time = f"read {kind} logs", recordings, time
        self._tell = report_progress

    def __iter__(self) -> Iterator[RawLog]:
        for k, paths in enumerate(self._recordings):
            self._tell(Progress(self._task, k, len(self._recordings), paths[0].name))
            yield load_recorded(paths, self._time)
        if self._recordings:
            self._tell(Progress(self._task, len(self._recordings), len(self._recordings)))


def _load_logs(inputs: Inputs) -> RawLogs:
    """Return the training and held-out logs that the config names; each file is read when it is iterated over."""
    inputs.note_files(RawLogs)
    log = None if inputs.config is None else inputs.config.sampling.log
    if log is None:
        return RawLogs((), ())
    training, held_out = (
        _LogFiles(kind, recordings, log.columns.time, inputs.tell)
        for kind, recordings in (("training", log.training_files), ("held out", log.held_out_files))
    )
    return RawLogs(training, held_out)


def _load_coefficients(inputs: Inputs) -> Coefficients | None:
    """Return the Fourier coefficients that the config names, or None."""
    paths = inputs.note_files(Coefficients)
    return load_coefficients(paths["coefficients"]) if paths else None


def _load_recordings(inputs: Inputs) -> Recordings:
    """Return the recordings of states that the config names, by set."""
    assert inputs.config is not None
    found: dict[str, Recording | None] = dict.fromkeys(SETS)
    for name, path in inputs.note_files(Recordings).items():
        found[name] = load_recording(path, inputs.config.n_dof)
    return Recordings(**found)


def _load_signals(inputs: Inputs) -> SignalTables:
    """Return the signals of files that the config names, by coordinate."""
    files = inputs.note_files(SignalTables)
    return SignalTables({name: load_signals(path) for name, path in files.items()})


OUTSIDE: dict[type, Callable[[Inputs], Any]] = {
    Coefficients: _load_coefficients,
    Recordings: _load_recordings,
    RawLogs: _load_logs,
    SignalTables: _load_signals,
}
"""What stages read from files of the user's own."""
