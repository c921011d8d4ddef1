"""Cleaning of logs: rows that tell nothing are cut out, outliers replaced, time steps made even."""

from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np

from paramreduce_cli.config.log_settings import LogSection
from paramreduce_cli.errors import ConfigError, DataError
from paramreduce_cli.identification.log_signals import Outliers
from paramreduce_cli.identification.outliers import replace_outliers
from paramreduce_cli.identification.position_jumps import find_position_jumps, name_rows
from paramreduce_cli.identification.processing_steps import describe_outliers
from paramreduce_cli.identification.signals import (
    Signals,
    change_rate,
    read_signals,
    resample_evenly,
)
from paramreduce_cli.records import BoolArray, RawLog

_SAME_RATE = 0.01
"""Relative difference of rates that are the same."""
_FEWEST_ROWS = 20


@dataclass
class CleanedLogs:
    """The signals of files, file by file."""

    motions: list[list[Signals]] = field(default_factory=list)
    sources: list[str] = field(default_factory=list)
    outliers: list[Outliers] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)
    """Sentences on positions that jump."""
    rate: float = 0.0
    """Samples per second of them all."""


def clean_logs(
    logs: Iterable[RawLog],
    section: LogSection,
    names: Sequence[str],
    unmeasured: Collection[str],
    steps: list[str],
    rate: float = 0.0,
) -> CleanedLogs:
    """Return the signals of log files, with jumps cut out, outliers replaced and even time steps.

    Args:
        logs: Logs as recorded.
        section: Settings of the section for logs.
        names: Names of the coordinates.
        unmeasured: Coordinates without torques.
        steps: List to which a sentence on each step is added.
        rate: Samples per second that all files are resampled to; zero for the rate of the first one.

    Raises:
        DataError: A file is unusable, as the message says with its name.
    """
    files = CleanedLogs(rate=rate)
    for log in logs:
        source = log.source
        recorded = read_signals(log, section, names, unmeasured)
        rows, first_line = recorded.time.size, log.first_line
        del log  # the next one is read while this name would hold it
        try:
            recorded, missing = _cut_out_missing_torques(recorded, first_line)
            files.warnings += [f"{source}: {text}" for text in missing]
            recorded, parted, jumps = _cut_out_jumps(recorded, section, names, first_line)
            files.warnings += [f"{source}: {text}" for text in jumps]
            if section.delay:
                _compensate_delay(recorded, section.delay, source)
            pieces, rate, messages = resample_evenly(recorded, parted)
        except DataError as error:
            raise DataError(f"{source}: {error}") from error
        duration = recorded.time[-1] - recorded.time[0]
        steps.append(f"{source}: {rows} rows, {duration:.4g} s at {rate:.5g} Hz.")
        steps += messages
        outliers = replace_outliers(pieces) if section.outliers == "replace" else {}
        steps += describe_outliers(outliers, names)
        files.rate = files.rate or rate
        if abs(rate - files.rate) > _SAME_RATE * files.rate:
            pieces = [change_rate(piece, rate, files.rate) for piece in pieces]
            steps.append(f"Resampled to {files.rate:.5g} Hz, the rate of the first file.")
        files.sources.append(source)
        files.outliers.append(outliers)
        files.motions.append(pieces)
    return files


def _cut_out_missing_torques(
    recorded: Signals, first_line: int | None
) -> tuple[Signals, list[str]]:
    """Return a recording without the rows in which a torque is no number, and a sentence if there were such rows.

    Raises:
        DataError: Hardly any row has all torques.
    """
    missing = np.array(np.isnan(recorded.tau).any(axis=1), dtype=bool)
    count = int(np.count_nonzero(missing))
    if not count:
        return recorded, []
    if missing.size - count < _FEWEST_ROWS:
        raise DataError(
            f"torques are missing in {count} of {missing.size} rows. Joints without torques belong under unmeasured."
        )
    where = name_rows(np.flatnonzero(missing), first_line)
    text = (
        f"torques are missing in {count} of {missing.size} rows ({where}); these rows are not used."
    )
    kept: BoolArray = ~missing
    return recorded.slice_rows(kept), [text]


def _cut_out_jumps(
    recorded: Signals, section: LogSection, names: Sequence[str], first_line: int | None
) -> tuple[Signals, list[int], list[str]]:
    """Cut out the rows of a recording in which positions jump; with ``outliers: keep`` nothing is cut out or split.

    Args:
        recorded: The recording with all of its rows.
        section: The section of the config, which may ask for outliers to be kept.
        names: Names of the coordinates.
        first_line: Line of the first row in its file, None where the file has no lines.

    Returns:
        The recording without bad rows; rows with which a new motion begins because positions stay changed from there
        on; sentences on what was done.
    """
    messages = []
    if any(recorded.turns):
        counts = zip(names, recorded.turns, strict=True)
        counted = ", ".join(f"{name} {count} times" for name, count in counts if count)
        messages.append(f"positions jump by whole turns ({counted}); the turns are added.")
    if section.outliers == "keep":
        return recorded, [], messages
    jumps = find_position_jumps(recorded)
    if jumps.bad.any():
        bad = np.flatnonzero(jumps.bad)
        messages.append(
            f"positions jump to and fro, so {bad.size} of {jumps.bad.size} rows are cut out "
            f"({name_rows(bad, first_line)}): dropouts, or a second publisher?"
        )
        recorded = recorded.slice_rows(~jumps.bad)
    if jumps.steps.size:
        messages.append(
            f"positions jump and do not come back ({name_rows(jumps.steps, first_line)}), so the log is parted there: "
            "was the zero of a joint set anew, or are these several recordings?"
        )
    parted = jumps.steps - np.cumsum(jumps.bad)[jumps.steps]
    return recorded, parted.tolist(), messages


def _compensate_delay(recorded: Signals, delay: float, source: str) -> None:
    """Shift torques to the times at which they acted, in place.

    Raises:
        ConfigError: No torque was recorded at the shifted times.
    """
    time = recorded.time
    if abs(delay) >= np.ptp(time):
        raise ConfigError(
            f"a delay of {delay:g} s is longer than {source}, which takes {np.ptp(time):.4g} s.",
            ("sampling", "log", "delay"),
        )
    for tau in recorded.tau.T:
        tau[:] = np.interp(time + delay, time, tau)
