"""Simulated manoeuvres of the sets: the inputs that a config describes, and the motions that they make."""

import zlib
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from paramreduce_cli.config.schema import SimulationSection
from paramreduce_cli.errors import ConfigError, DataError
from paramreduce_cli.excitation.simulated_inputs import make_inputs
from paramreduce_cli.excitation.simulation import (
    Inputs,
    MassAndBias,
    SimulatedMotion,
    find_equilibrium,
    simulate,
)
from paramreduce_cli.multibody.dynamics import Dynamics
from paramreduce_cli.multibody.observation import (
    ObservedSet,
    Span,
    StateBlock,
    StatesAt,
    make_spans,
)
from paramreduce_cli.records import (
    SETS,
    FloatArray,
    Mechanism,
    Model,
    Progress,
    ProgressCallback,
    SignalTables,
)


@dataclass(frozen=True)
class Manoeuvre:
    """The inputs of a simulated motion, and the state at its start."""

    inputs: Inputs
    start: FloatArray
    """Independent coordinates at the start, or near the equilibrium at the start, (n_dof,), rad or m."""
    speed: FloatArray
    """Velocities at the start, (n_dof,)."""
    from_equilibrium: bool
    """Whether the motion begins in static equilibrium."""
    time: FloatArray
    """Time of the samples, (n_samples,), s."""

    def simulate(self, dynamics: MassAndBias) -> SimulatedMotion:
        """Return the motion of a model; it begins in the equilibrium of that model.

        Args:
            dynamics: Mass matrix and bias of the model.

        Raises:
            DataError: There is no equilibrium, or the motion cannot be followed.
        """
        start = self.start
        if self.from_equilibrium:
            start = find_equilibrium(dynamics, self.inputs, start)
        return simulate(dynamics, self.inputs, start, self.speed, self.time)


def draw_manoeuvres(
    section: SimulationSection, mechanism: Mechanism, tables: SignalTables, set_name: str
) -> Iterator[Manoeuvre]:
    """Yield the manoeuvres of a set, which are the same in every run.

    Raises:
        DataError: The signal of a file ends before the motion.
    """
    rng = np.random.default_rng([0, zlib.crc32(set_name.encode())])
    time = np.arange(0.0, section.duration, section.step)
    names = mechanism.coordinate_names
    z, speed = np.zeros(mechanism.n_dof), np.zeros(mechanism.n_dof)
    for coordinate, value in section.speed.items():
        speed[names.index(coordinate)] = value
    if mechanism.loops is not None:
        z = mechanism.loops.assembly[list(mechanism.independent)]
    for _ in range(count_manoeuvres(section, set_name)):
        start = z.copy()
        for coordinate, (lower, upper) in section.start.items():
            start[names.index(coordinate)] = rng.uniform(lower, upper)
        inputs = make_inputs(section, names, tables, rng)
        yield Manoeuvre(inputs, start, speed, section.equilibrium, time)


def count_manoeuvres(section: SimulationSection, set_name: str) -> int:
    """Return the number of manoeuvres of a set."""
    counts = (section.runs, section.validation_runs, section.test_runs)
    return dict(zip(SETS, counts, strict=True))[set_name]


def sample_manoeuvres(
    section: SimulationSection,
    model: Model,
    dynamics: Dynamics,
    direct: MassAndBias,
    signals: SignalTables | None,
    set_name: str,
    report_progress: ProgressCallback,
) -> ObservedSet:
    """Return the samples of the simulated manoeuvres of a set.

    Args:
        section: The simulation's section of the config.
        model: Model of the robot.
        dynamics: Its regressor.
        direct: Mass matrix and bias of the full model.
        signals: Signals of files; None if the config names none.
        set_name: Name of the set.
        report_progress: Progress callback.

    Raises:
        ConfigError: The simulation fails; the message says at what time.
    """
    motions: list[SimulatedMotion] = []
    total = count_manoeuvres(section, set_name)
    try:
        for manoeuvre in draw_manoeuvres(
            section, model.mechanism, signals or SignalTables({}), set_name
        ):
            motions.append(manoeuvre.simulate(direct))
            progress = Progress(f"simulate motions of the {set_name} set", len(motions), total)
            report_progress(progress)
    except DataError as error:
        raise ConfigError(f"{set_name} set: {error}", ("sampling", "simulation")) from error
    return ObservedSet(
        make_spans([motion.time.size for motion in motions]),
        _read_motion_states(motions),
        dynamics,
        model.values,
        f"{set_name} set",
    )


def _read_motion_states(motions: list[SimulatedMotion]) -> StatesAt:
    """Return a function that gives the states of simulated motions."""

    def read_span(span: Span) -> StateBlock:
        """Return the states of a span of the motions."""
        motion, part = motions[span.trajectory], slice(span.start, span.stop)
        states = motion.time[part], motion.z[part], motion.dz[part], motion.ddz[part]
        return StateBlock(span.trajectory, *states, motion.tau[part])

    return read_span
