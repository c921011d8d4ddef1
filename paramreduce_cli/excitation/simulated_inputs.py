"""Inputs of simulated motions as a config describes them: forces, prescribed motions and roads."""

from collections.abc import Mapping, Sequence

import numpy as np

from paramreduce_cli.config.schema import ROAD_PROFILE, InputSection, RoadSection, SimulationSection
from paramreduce_cli.errors import DataError
from paramreduce_cli.excitation.input_signals import Harmonics, Interpolated, Joined, Signals
from paramreduce_cli.excitation.road import ROUGHNESS, draw_road
from paramreduce_cli.excitation.simulation import Inputs
from paramreduce_cli.records import FloatArray, SignalTable, SignalTables


def make_inputs(
    section: SimulationSection, names: Sequence[str], tables: SignalTables, rng: np.random.Generator
) -> Inputs:
    """Return the inputs of one motion, with random phases and a random road.

    Args:
        section: The simulation's section of the config.
        names: Names of the independent coordinates.
        tables: Signals of files.
        rng: Random generator.

    Raises:
        DataError: The signal of a file ends before the motion.
    """
    given = [section.inputs.get(name, InputSection()) for name in names]
    frequencies = [one.frequencies for one in given]
    amplitudes = [one.amplitude for one in given]
    prescribed = [*section.motions]
    groups: list[Signals] = []
    if prescribed:
        groups = [_make_motion(section, name, tables.tables, rng) for name in prescribed]
    if section.road is not None:
        wheels = [name for track in section.road.tracks for name in track]
        prescribed += wheels
        groups.append(_make_road(section.road, tables.tables, section.duration, rng))
    return Inputs(
        forces=_draw_sines(frequencies, amplitudes, rng),
        stiffness=np.array([one.stiffness for one in given]),
        damping=np.array([one.damping for one in given]),
        reference=np.array([one.reference for one in given]),
        prescribed=np.array([list(names).index(name) for name in prescribed], dtype=np.int64),
        motions=Joined(groups),
    )


def _draw_sines(
    frequencies: Sequence[Sequence[float]], amplitudes: Sequence[float], rng: np.random.Generator
) -> Harmonics:
    """Return signals that are sines of one amplitude each, with random phases.

    Args:
        frequencies: Frequencies of each signal, Hz.
        amplitudes: Amplitude of the sines of each signal.
        rng: Random generator.
    """
    counts = [len(some) for some in frequencies]
    waves = np.zeros((len(counts), sum(counts)), dtype=complex)
    start = 0
    for k, (count, amplitude) in enumerate(zip(counts, amplitudes, strict=True)):
        phases = rng.uniform(0, 2 * np.pi, count)
        waves[k, start : start + count] = amplitude * np.exp(1j * phases)
        start += count
    flat = np.array([f for some in frequencies for f in some], dtype=float)
    return Harmonics(2 * np.pi * flat, waves)


def _make_motion(
    section: SimulationSection,
    name: str,
    tables: Mapping[str, SignalTable],
    rng: np.random.Generator,
) -> Signals:
    """Return the prescribed motion of one coordinate."""
    motion = section.motions[name]
    if motion.file is None:
        return _draw_sines([motion.frequencies], [motion.amplitude], rng)
    table = tables[name]
    _check_end(table, section.duration, "s")
    return Interpolated(table.arguments, table.values[:, :1])


def _make_road(
    road: RoadSection, tables: Mapping[str, SignalTable], duration: float, rng: np.random.Generator
) -> Signals:
    """Return the heights of a road under all wheels.

    Raises:
        DataError: The profile of a file ends before the motion, or has no column for a track.
    """
    if road.file is None:
        roughness = ROUGHNESS[road.roughness] if isinstance(road.roughness, str) else road.roughness
        width = road.width if len(road.tracks) > 1 else None
        return draw_road(roughness, road.speed, road.distances, width, rng)
    table, longest = tables[ROAD_PROFILE], max(road.distances)
    if table.values.shape[1] < len(road.tracks):
        raise DataError(
            f"{table.source}: has {table.values.shape[1]} heights at each distance, but there are "
            f"{len(road.tracks)} tracks. Give a column for each."
        )
    _check_end(table, road.speed * duration + longest, "m")
    # The first wheels begin at the largest distance, so that the last ones are on the profile too.
    signals = [
        _Shifted(
            Interpolated(table.arguments, table.values[:, [k]]), longest - distance, road.speed
        )
        for k in range(len(road.tracks))
        for distance in road.distances
    ]
    return Joined(signals)


def _check_end(table: SignalTable, end: float, unit: str) -> None:
    """Raise DataError if a table does not hold its signal from zero to an end."""
    first, last = float(table.arguments[0]), float(table.arguments[-1])
    if first > 0 or last < end:
        raise DataError(
            f"{table.source}: holds {first:g} to {last:g} {unit}, but the motion needs 0 to {end:g} {unit}. Give a longer "
            "file, or a shorter duration."
        )


class _Shifted:
    """Signals of the distance along a road, at a place that moves with constant speed.

    Args:
        profile: Signals of the distance.
        start: Distance at time zero, m.
        speed: Speed, m/s.
    """

    def __init__(self, profile: Interpolated, start: float, speed: float) -> None:
        self._profile, self._start, self._speed = profile, start, speed

    def __call__(self, time: float) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return the signals and their derivatives at a time, s."""
        value, slope, curvature = self._profile(self._start + self._speed * time)
        return value, slope * self._speed, curvature * self._speed**2
