"""Parts of one recording in several files or topics, such as positions and torques, joined by their times."""

from collections.abc import Sequence

import numpy as np
import scipy  # its interpolate takes a quarter of a second to load, so only when it is used

from paramreduce_cli.errors import DataError
from paramreduce_cli.records import BoolArray, FloatArray, RawLog

_LEAST_COMMON = 0.5
"""Share of the shortest part's duration in which all parts have to be recorded."""
_FASTER = 1.5
"""Times as many samples a second from which on a column is averaged."""
GAP = 5.5
"""Usual time steps that make a gap."""


def join_logs(parts: Sequence[RawLog], time: str) -> RawLog:
    """Return the columns of all parts at the times of the part with the most rows a second.

    Columns of the other parts are interpolated by cubic splines; times at which a part is not recorded, or has a gap, are left out.

    Args:
        parts: Parts of one recording, at least one.
        time: Name of the column of times that each part has.

    Raises:
        DataError: A part has no times, times do not increase, two parts have a column of the same name, or they were
            recorded at other times.
    """
    if len(parts) == 1:
        return parts[0]
    times = [_get_times(part, time) for part in parts]
    first, last = max(t[0] for t in times), min(t[-1] for t in times)
    if last - first < _LEAST_COMMON * min(t[-1] - t[0] for t in times):
        spans = ", ".join(
            f"{part.source} from {t[0]:.6g} to {t[-1]:.6g}"
            for part, t in zip(parts, times, strict=True)
        )
        raise DataError(f"parts of one recording have hardly any time in common: {spans}.")
    fastest = max(range(len(parts)), key=lambda k: times[k].size / (times[k][-1] - times[k][0]))
    kept = ~np.any([_find_missing(own, times[fastest]) for own in times], axis=0)
    at = times[fastest][kept]
    columns: dict[str, FloatArray] = {time: at}
    for k, (part, own) in enumerate(zip(parts, times, strict=True)):
        for name, values in part.columns.items():
            if name == time:
                continue
            if name in columns:
                raise DataError(
                    f"{part.source}: has a column {name} like another part of the recording. Rename one of them."
                )
            columns[name] = values[kept] if k == fastest else _interpolate(own, values, at)
    others = {name: kind for part in parts for name, kind in part.others.items()}
    sources = " + ".join(part.source for part in parts)
    return RawLog(sources, columns, first_line=None, others=others)


def align_column(log: RawLog, name: str, time: str) -> FloatArray:
    """Return a column at the times of a recording: interpolated if it belongs to a topic with times of its own.

    A column that is recorded more often is averaged over the time steps of the recording, so that what is too fast for these is not
    folded down. Outside its own times and in their gaps the column is not a number.

    Args:
        log: Log with several topics or groups.
        name: Name of the column.
        time: Name of the column of times.
    """
    values, own = log.columns[name], find_times(log, name, time)
    if own is None or own == time or np.array_equal(log.columns[own], log.columns[time]):
        return values
    recorded_at, at = log.columns[own], log.columns[time]
    steps, wanted = np.diff(recorded_at), np.diff(at)
    if not np.all(steps > 0) or not np.all(wanted > 0):
        return values
    step = float(np.median(wanted))
    if step > _FASTER * np.median(steps):
        aligned = _average(recorded_at, values, at, step)
    else:
        aligned = _interpolate(recorded_at, values, at)
    aligned[_find_missing(recorded_at, at)] = np.nan
    return aligned


def find_times(log: RawLog, name: str, time: str) -> str | None:
    """Return the name of the column with the times of a column; None if there is none of the same length.

    The times of ``/motors/current/1`` are ``/motors/time_of/current/1`` or ``/motors/time``, where ``time`` is the last part of
    the name of the times of the recording.
    """
    parts, last = name.split("/"), time.rsplit("/", maxsplit=1)[-1]
    for k in range(len(parts) - 1, 0, -1):
        topic = "/".join(parts[:k])
        for candidate in (f"{topic}/{last}_of/{'/'.join(parts[k:])}", f"{topic}/{last}"):
            if candidate in log.columns and log.columns[candidate].size == log.columns[name].size:
                return candidate
    return None


def _get_times(part: RawLog, time: str) -> FloatArray:
    """Return the times of a part; raise DataError if it has none, or if they do not increase."""
    times = part.columns.get(time)
    if times is None or times.size < 2:
        raise DataError(
            f"{part.source}: there is no column {time}, which joins the parts of a recording. Columns: "
            f"{', '.join(part.columns)}."
        )
    wrong = np.flatnonzero(~(np.diff(times) > 0))
    if wrong.size:
        where = part.describe_row(int(wrong[0]) + 1)
        raise DataError(
            f"{where}, column {time}: time does not increase, so parts cannot be joined."
        )
    return times


def _find_missing(recorded_at: FloatArray, at: FloatArray) -> BoolArray:
    """Return whether times are outside those of a part, or in a gap of it."""
    steps = np.diff(recorded_at)
    following = np.clip(np.searchsorted(recorded_at, at), 1, steps.size)
    missing: BoolArray = (at < recorded_at[0]) | (at > recorded_at[-1])
    return missing | (steps[following - 1] > GAP * np.median(steps))


def _average(
    recorded_at: FloatArray, values: FloatArray, at: FloatArray, step: float
) -> FloatArray:
    """Return a column at other times, averaged over a time step around each; beside values that are not finite the result is not a
    number.
    """
    finite = np.isfinite(values)
    if np.count_nonzero(finite) < 2:
        return np.full(at.size, np.nan)
    spline = scipy.interpolate.CubicSpline(recorded_at[finite], values[finite])
    sums = spline.antiderivative()
    # Windows are as long on both sides, also near the ends.
    half = np.clip(np.minimum(at - recorded_at[0], recorded_at[-1] - at), 0.0, step / 2)
    with np.errstate(invalid="ignore", divide="ignore"):
        means = (sums(at + half) - sums(at - half)) / (2 * half)
    result = np.where(half > 1e-3 * step, means, spline(at))
    return _hide_missing(result, recorded_at, finite, at)


def _interpolate(recorded_at: FloatArray, values: FloatArray, at: FloatArray) -> FloatArray:
    """Return a column at other times; beside values that are not finite the result is not a number."""
    finite = np.isfinite(values)
    if np.count_nonzero(finite) < 2:
        return np.full(at.size, np.nan)
    result: FloatArray = scipy.interpolate.CubicSpline(recorded_at[finite], values[finite])(at)
    return _hide_missing(result, recorded_at, finite, at)


def _hide_missing(
    result: FloatArray, recorded_at: FloatArray, finite: BoolArray, at: FloatArray
) -> FloatArray:
    """Return a column that is not a number beside recorded values that are not finite."""
    near = np.interp(at, recorded_at, np.where(finite, 0.0, 1.0))
    return np.where(near > 0, np.nan, result)
