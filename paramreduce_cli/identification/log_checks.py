"""Checks of recorded motions, before any model is used."""

from collections.abc import Collection, Iterable, Iterator, Sequence

import numpy as np

from paramreduce_cli.fields.numbers import RATHER_DEGREES
from paramreduce_cli.identification import filters
from paramreduce_cli.identification.signals import Signals
from paramreduce_cli.records import FloatArray

_SLOW = 5.0
"""Samples per second below which nobody records motions."""
_STEPS = {"nanoseconds": 3e5, "microseconds": 300.0, "milliseconds": 0.0}
"""Time steps, in the unit at hand taken for seconds, beyond which time is rather in another unit."""
_SURE = 0.9
"""Correlation from which on two signals are the same but for a factor."""
_UNLIKE = 0.5
_PER_DEGREE = 180 / np.pi
_NEAR = 0.1
"""Relative distance from a factor that counts as it."""
_SATURATED = 20
"""Samples in a row at the largest torque that tell a limit."""
_FASTEST = 2.0
"""Hz: motion compared when a recorded speed is held against the positions."""
_PER_PERIOD = 20
"""Samples of that."""
_SAME_LAG = 0.3
"""Relative difference of the joints' lags from their median, up to which they have one cause."""
_LEAST_LAG = 0.2
"""Lag of speeds, in sampling steps, from which there is a warning; a delay of the torques by as much moves parameters out of their intervals."""
_LAG_ALONE = 0.7
"""Correlation of accelerations with the difference of speeds and slopes, from which a lag explains that difference."""
_RESTS = 1e-3
"""Power of a joint's acceleration, relative to the largest, up to which the joint rests."""


def find_log_warnings(
    piece: Signals, rate: float, names: Sequence[str], unmeasured: Collection[str] = ()
) -> Iterator[str]:
    """Yield warnings about joints that stand still, and about implausible units, signs, orders of columns, and limits.

    Args:
        piece: Uninterrupted motion as recorded.
        rate: Samples per second.
        names: Names of the coordinates.
        unmeasured: Names of coordinates without torques.
    """
    if rate < _SLOW:
        unit = next(name for name, step in _STEPS.items() if 1 / rate > step)
        yield f"there are {rate:.3g} samples a second: is time in {unit}? Then set units.time under sampling.log."
        return  # speeds and slopes cannot be compared
    far, largest, constant, frozen, limited = [], 0.0, [], [], []
    for j, name in enumerate(names):
        z, tau = piece.z[:, j], piece.tau[:, j]
        if np.ptp(z) == 0:
            yield f"{name} never moves, so its inertia is not seen."
        elif np.abs(z).max() > RATHER_DEGREES:
            far.append(name)
            largest = max(largest, float(np.abs(z).max()))
        elif piece.dz is not None and np.ptp(piece.dz[:, j]) == 0:
            constant.append(name)
        if name in unmeasured:
            continue
        if np.ptp(tau) == 0:
            frozen.append(name)
        elif _find_longest_run(np.abs(tau) >= np.abs(tau).max() * (1 - 1e-9)) >= _SATURATED:
            limited.append(name)
    if far:
        yield (
            f"positions of {_join_names(far)} go up to {largest:.3g} rad: are they degrees, or of a motor before its "
            "gears? Then say so under units, or transmission."
        )
    if constant:
        yield f"{_join_names(constant)}: positions change, but recorded speeds are constant: are speeds recorded?"
    if frozen:
        yield f"torques of {_join_names(frozen)} are constant: are they recorded?"
    if limited:
        yield f"torques of {_join_names(limited)} stay at their largest value: are they at a limit there?"
    if piece.dz is not None:
        yield from _compare_speeds(piece.z, piece.dz, rate, names)


def _join_names(names: Sequence[str]) -> str:
    return f"{', '.join(names[:-1])} and {names[-1]}" if len(names) > 1 else names[0]


def _find_longest_run(flags: np.ndarray) -> int:
    """Return the length of the longest run of true flags."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], flags.astype(int), [0]])))
    return int((edges[1::2] - edges[::2]).max(initial=0))


def _low_pass(columns: Iterable[FloatArray], rate: float, every: int) -> FloatArray:
    """Return one of ``every`` samples of low-passed signals, (n_samples, n_columns)."""
    taps = filters.design_low_pass(_FASTEST, rate)
    slow = (filters.apply_filter(column[:, None], taps)[::every, 0].copy() for column in columns)
    return np.column_stack(list(slow))


def _compare_speeds(
    z: FloatArray, dz: FloatArray, rate: float, names: Sequence[str]
) -> Iterator[str]:
    """Yield warnings about recorded speeds that are not the derivatives of the positions."""
    every = max(1, min(int(rate / (_PER_PERIOD * _FASTEST)), len(z) // _PER_PERIOD))
    slopes = _low_pass((np.gradient(column, 1 / rate) for column in z.T), rate, every)
    speeds = _low_pass(dz.T, rate, every)
    messages: dict[str, list[str]] = {}
    for j, name in enumerate(names):
        lengths = np.linalg.norm(speeds[:, j]) * np.linalg.norm(slopes, axis=0)
        if not lengths[j] > 0:
            continue
        alike = speeds[:, j] @ slopes / np.where(lengths > 0, lengths, np.inf)
        gain = float(speeds[:, j] @ slopes[:, j] / (slopes[:, j] @ slopes[:, j]))
        other = int(np.argmax(np.abs(alike)))
        if abs(alike[j]) < _UNLIKE and abs(alike[other]) > _SURE:
            messages.setdefault(f"is that of {names[other]}: are columns swapped?", []).append(name)
        elif alike[j] < -_SURE:
            messages.setdefault("has the other sign than the slope of the position.", []).append(
                name
            )
        elif alike[j] > _SURE and abs(gain / _PER_DEGREE - 1) < _NEAR:
            messages.setdefault(
                "is 57.3 times the slope of the position: is the speed in degrees?", []
            ).append(name)
        elif alike[j] > _SURE and abs(gain * _PER_DEGREE - 1) < _NEAR:
            messages.setdefault(
                "is the slope of the position over 57.3: is the position in degrees?", []
            ).append(name)
        elif alike[j] > _SURE and abs(gain - 1) > 2 * _NEAR:
            messages.setdefault(
                f"is {gain:.3g} times the slope of the position: units?", []
            ).append(name)
    for what, joints in messages.items():
        yield f"the speed of {_join_names(joints)} {what}"
    if not messages:
        yield from _find_lag(slopes, speeds, rate, every)


def _find_lag(slopes: FloatArray, speeds: FloatArray, rate: float, every: int) -> Iterator[str]:
    """Yield a warning if recorded speeds lag the slopes of the positions, as those of a filter do.

    Args:
        slopes: Slopes of the positions, (n_samples, n_dof).
        speeds: Recorded speeds, (n_samples, n_dof).
        rate: Samples per second as recorded.
        every: Recorded samples from one of these to the next.
    """
    changes, left = np.gradient(slopes, every / rate, axis=0), slopes - speeds
    powers, products = np.sum(changes**2, axis=0), np.sum(left * changes, axis=0)
    moving = powers > _RESTS * powers.max(initial=0.0)
    if not moving.any():
        return
    lags = products[moving] / powers[moving]
    alike = products[moving].sum() / max(
        1e-300, float(np.linalg.norm(left[:, moving]) * np.linalg.norm(changes[:, moving]))
    )
    lag = float(np.median(lags))
    if (
        lag * rate > _LEAST_LAG
        and alike > _LAG_ALONE
        and np.all(np.abs(lags - lag) < _SAME_LAG * lag)
    ):
        yield (
            f"recorded speeds lag the positions by about {1e3 * lag:.1g} ms, probably because of a filter or of backward differences in "
            "the controller. If torques do not lag as much, remove sampling.log.columns.velocity; speeds are then differentiated from positions."
        )
