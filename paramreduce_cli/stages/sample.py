"""The stage sample: states, torques and observation matrices of all sets."""

import itertools
import warnings
from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import cache, lru_cache, partial
from typing import Any

import numpy as np

from paramreduce_cli.config.schema import SamplingSection
from paramreduce_cli.errors import ConfigError, DataError, ParamreduceWarning
from paramreduce_cli.excitation.fourier import (
    FINER,
    FourierBasis,
    evaluate_basis,
    sample_times,
    shift_start,
)
from paramreduce_cli.excitation.manoeuvres import sample_manoeuvres
from paramreduce_cli.excitation.point_to_point import evaluate_along
from paramreduce_cli.excitation.simulation import MassAndBias
from paramreduce_cli.excitation.symmetry import complete_series, generate_group
from paramreduce_cli.fields.section import expand_per_joint
from paramreduce_cli.identification.measured_samples import LoggedSet
from paramreduce_cli.multibody.dynamics import Dynamics
from paramreduce_cli.multibody.joined_samples import JoinedSet
from paramreduce_cli.multibody.loops.coordinates import Coordinates
from paramreduce_cli.multibody.observation import (
    ObservedSet,
    Span,
    StateBlock,
    StatesAt,
    compute_standard_deviation,
    make_spans,
)
from paramreduce_cli.multibody.progress_samples import ProgressSet
from paramreduce_cli.multibody.quantities import Quantities
from paramreduce_cli.records import (
    SETS,
    Block,
    FloatArray,
    Formulations,
    IntArray,
    Items,
    MeasuredLog,
    Model,
    ProgressCallback,
    Recording,
    Recordings,
    Run,
    Samples,
    SampleSet,
    SignalTables,
    Trajectories,
)
from paramreduce_cli.reduction.models import make_full_model
from paramreduce_cli.resources.item_completion import complete_items

ComputedSet = ObservedSet | LoggedSet

_IMAGE_ROUNDING = 1e-6
"""By which the image of a motion may miss its limits: round-off of the optimiser's."""


def sample(
    sampling: SamplingSection,
    model: Model,
    trajectories: Trajectories | None,
    recordings: Recordings,
    log: MeasuredLog | None = None,
    signals: SignalTables | None = None,
    report_progress: ProgressCallback = lambda _: None,
    items: Items | None = None,
) -> Samples:
    """Sample the estimation, the validation and the test set: states, torques and observation matrices.

    The states come from the optimised trajectories, or from a log, recorded states or a simulation if the config has
    these. The items are trajectories, or pieces of a recording.

    Raises:
        DataError: A set has neither a recording nor a trajectory.
        ConfigError: ``--part`` is given for a log, which is sampled as a whole.
    """
    items = items or Items()
    if sampling.log is not None and not items.part.is_whole:
        raise ConfigError(
            "is sampled as a whole, as its low-pass runs on across parts. Remove --part.",
            ("sampling", "log"),
        )
    dynamics = Dynamics(model.mechanism)
    direct = cache(partial(_compile_forward_dynamics, model))

    def make_set(name: str, points: int | None) -> ComputedSet:
        """Return a set from the log, the simulation, a recording or the trajectories; None if there is none."""
        recording: Recording | None = getattr(recordings, name)
        if sampling.log is not None:
            return _sample_log(model, dynamics, log, name)
        if sampling.simulation is not None:
            return sample_manoeuvres(
                sampling.simulation, model, dynamics, direct(), signals, name, report_progress
            )
        if recording is not None:
            return _sample_recording(sampling, model, dynamics, recording)
        if trajectories is None:
            raise DataError(f"there is neither a recording nor a trajectory for the {name} set.")
        series = [trajectory.coefficients for trajectory in getattr(trajectories, name)]
        if name == "estimation" and sampling.symmetries:
            series = _complete_series(sampling, model, trajectories, series)
        return _sample_series(model, dynamics, trajectories, name, series, points)

    points = {"estimation": sampling.points, "validation": sampling.validation_points}
    tested = _is_tested(sampling, trajectories, recordings)
    names = SETS if tested else SETS[:2]
    computed = {name: make_set(name, points.get(name)) for name in names}
    stored = _combine_items(computed, items, report_progress)
    if stored is not None:
        return _make_samples(sampling, model, stored["estimation"], stored)
    progress = {
        name: ProgressSet(one, f"{name} set", report_progress) for name, one in computed.items()
    }
    return _make_samples(sampling, model, computed["estimation"], progress)


def _combine_items(
    computed: Mapping[str, ComputedSet], items: Items, report_progress: ProgressCallback
) -> dict[str, JoinedSet] | None:
    """Return the sets joined from their items; None if there are none.

    Raises:
        PartFinished: This job does only a part of the items, and that is done.
    """
    pieces: dict[str, ObservedSet] = {}
    for name, one in computed.items():
        if isinstance(one, ObservedSet):
            pieces |= {f"{name}-{k:06d}": piece for k, piece in enumerate(one.iterate_pieces())}
    if items.part.is_whole and not any(key in items.kept for key in pieces):
        return None

    run = Run(progress=report_progress)
    found: dict[str, Any] = complete_items(
        run, items, list(pieces), lambda: pieces, _get_piece, task="samples"
    )
    return {
        name: JoinedSet([one for key, one in found.items() if key.startswith(f"{name}-")])
        for name in computed
    }


def _get_piece(pieces: Mapping[str, ObservedSet], key: str) -> SampleSet:
    return pieces[key]


def _is_tested(
    sampling: SamplingSection, trajectories: Trajectories | None, recordings: Recordings
) -> bool:
    """Whether there are motions for a test set."""
    if sampling.log is not None:
        return False
    if sampling.simulation is not None:
        return sampling.simulation.test_runs > 0
    if recordings.test is not None:
        return True
    return trajectories is not None and bool(trajectories.test or trajectories.test_point_to_point)


def _make_samples(
    sampling: SamplingSection,
    model: Model,
    estimation: ComputedSet | JoinedSet,
    sets: Mapping[str, SampleSet],
) -> Samples:
    """Return the sets with the scales of the estimation set."""
    parameters = model.mechanism.parameters
    return Samples(
        names=model.mechanism.parameter_names,
        preference=np.array([parameter.preference for parameter in parameters]),
        values=model.values,
        nominal_torque=_compute_nominal_torque(model, estimation),
        nominal_acceleration=_compute_nominal_acceleration(sampling, model, estimation),
        estimation=sets["estimation"],
        validation=sets.get("validation"),
        test=sets.get("test"),
    )


def _complete_series(
    sampling: SamplingSection, model: Model, trajectories: Trajectories, series: list[FloatArray]
) -> list[FloatArray]:
    """Return the images of all series under the symmetries of the mechanism, or raise an error if one leaves the
    limits.

    If an image leaves the limits, ConfigError is raised: the symmetry is then none of the mechanism with its limits.
    """
    series = complete_series(
        series, generate_group(sampling.symmetries, model.mechanism.coordinate_names)
    )
    limits = trajectories.limits
    quantities = Quantities(model.mechanism, trajectories.constraints)
    coordinates = Coordinates(model.mechanism)
    period = trajectories.period
    times = sample_times(period, trajectories.points)
    for coefficients in series:
        basis = evaluate_basis(period, (coefficients.shape[1] - 1) // 2, times)
        z, dz, ddz = basis.evaluate(coefficients)
        violation = np.max([limits.lower - z, z - limits.upper, np.abs(dz) - limits.velocity])
        if violation <= _IMAGE_ROUNDING:
            q, _, _ = coordinates.compute_states(z, dz, ddz)
            violation = quantities.compute_rows(q).max(initial=-np.inf)
        if violation > _IMAGE_ROUNDING:
            raise ConfigError(
                "the image of a trajectory leaves the limits or constraints under trajectories, so "
                "that this is no symmetry of the mechanism and its limits.",
                ("sampling", "symmetries"),
            )
    return series


def _sample_series(
    model: Model,
    dynamics: Dynamics,
    trajectories: Trajectories,
    name: str,
    series: list[FloatArray],
    points: int | None,
) -> ObservedSet:
    """Return the samples of Fourier series."""
    points = points or trajectories.points
    motions = trajectories.test_point_to_point if name == "test" else ()
    finer = 1 if model.mechanism.loops is None else -(-FINER * trajectories.points // points)
    return ObservedSet(
        make_spans([points] * (len(series) + len(motions))),
        _chain_states(
            len(series),
            _iterate_states(series, trajectories.period, points, finer),
            evaluate_along(motions, points, finer),
        ),
        dynamics,
        model.values,
        f"{name} set",
    )


def _sample_recording(
    sampling: SamplingSection, model: Model, dynamics: Dynamics, recording: Recording
) -> ObservedSet:
    """Return the samples of a recording of states, with measured torques or torques of the model.

    Raises:
        ConfigError: Measured torques are asked for, and the recording has none.
    """
    _warn_of_still_joints(model, recording)
    if sampling.torques == "model":
        recording = replace(recording, tau=None)
    elif recording.tau is None:
        raise ConfigError(
            f"is measured, but {recording.source} holds no tau. Add the columns, or write `model` to "
            "have torques of the model.",
            ("sampling", "torques"),
        )
    if recording.tau is not None:
        recording = replace(
            recording, tau=_compute_measured_torques(model, recording.source, recording.tau)
        )
    restarts = np.flatnonzero(np.diff(recording.time) < 0) + 1
    starts = np.concatenate([[0], restarts, [recording.time.size]])
    return ObservedSet(
        make_spans(np.diff(starts)),
        _read_recorded_states(recording, starts),
        dynamics,
        model.values,
        recording.source,
        divisible=model.mechanism.loops is None,  # loops are followed along a trajectory
    )


def _sample_log(model: Model, dynamics: Dynamics, log: MeasuredLog | None, name: str) -> LoggedSet:
    """Return the samples of a processed log.

    Raises:
        ConfigError: The low-pass is longer than the motion.
        DataError: There is no processed log.
    """
    if log is None:
        raise DataError("there is no log.h5.", command="process-log")
    motions = log.training if name == "estimation" else log.held_out
    measured = np.isfinite(model.nominal_torque)
    found = LoggedSet(motions, log, dynamics, f"{name} set", measured)
    if found.n_samples == 0:
        raise ConfigError(
            f"leaves no sample for the {name} set: at {log.torque_cutoff:.3g} Hz the low-pass is longer than "
            "the motion. Raise it, or use a longer log.",
            ("sampling", "log", "torque_cutoff"),
        )
    return found


def _compile_forward_dynamics(model: Model) -> MassAndBias:
    """Return the mass matrix and bias of the full model."""
    # Late, as few configs simulate: exports load templates, and more.
    from paramreduce_cli.export.code_generation import Exported
    from paramreduce_cli.export.running import compile_model, make_forward_dynamics

    known = model.formulations
    first = replace(model, formulations=Formulations(known.inverse[:1], known.direct[:1]))
    compiled = compile_model(first, make_full_model(model), Exported.DDM)
    return make_forward_dynamics(compiled, model.values)


def _compute_measured_torques(model: Model, source: str, tau: FloatArray) -> FloatArray:
    """Return recorded torques, zero where none are measured.

    Raises:
        DataError: Torques of a joint are missing or not finite.
    """
    measured = np.isfinite(model.nominal_torque)
    for j in np.flatnonzero(measured & np.isnan(tau).any(axis=0)).tolist():
        lost = np.flatnonzero(np.isnan(tau[:, j]))
        name = model.mechanism.coordinate_names[j]
        if lost.size == tau.shape[0]:
            raise DataError(
                f"{source}: there is no tau{j + 1}. Add the torques of {name}, or name it under "
                "unmeasured in the config."
            )
        raise DataError(
            f"{source}: tau{j + 1} is not a finite number in data row {lost[0] + 1}. Remove such rows, "
            f"or name {name} under unmeasured in the config."
        )
    return np.where(measured, tau, 0.0)


def _iterate_states(series: list[FloatArray], period: float, points: int, finer: int) -> StatesAt:
    """Return the states of every series, with positions on a finer grid on which loops are followed."""
    times, finer_times = sample_times(period, points), sample_times(period, finer * points)

    @lru_cache
    def basis(harmonics: int, count: int) -> tuple[FourierBasis, FourierBasis | None]:
        """Return the series at the first samples, and on the finer grid, None if there is none.

        Later samples differ in their coefficients alone.
        """
        return (
            evaluate_basis(period, harmonics, times[:count]),
            evaluate_basis(period, harmonics, finer_times[: finer * count]) if finer > 1 else None,
        )

    def evaluate_span(span: Span) -> StateBlock:
        """Return the states of a span of the series."""
        coefficients = shift_start(series[span.trajectory], period, times[span.start])
        own, between = basis((coefficients.shape[1] - 1) // 2, span.stop - span.start)
        positions = None if between is None else between.evaluate(coefficients)[0]
        states = own.evaluate(coefficients)
        return StateBlock(
            span.trajectory, times[span.start : span.stop], *states, fine_positions=positions
        )

    return evaluate_span


def _chain_states(count: int, first: StatesAt, second: StatesAt) -> StatesAt:
    """Return a function that gives the states of motions of one kind, then of another."""

    def evaluate_span(span: Span) -> StateBlock:
        """Return the states of a span of the first or the second sequence."""
        if span.trajectory < count:
            return first(span)
        own = second(replace(span, trajectory=span.trajectory - count))
        return replace(own, trajectory=span.trajectory)

    return evaluate_span


def _read_recorded_states(r: Recording, starts: IntArray) -> StatesAt:
    """Return a function that gives the states of a recording whose motions begin at some rows; the last entry is the
    end.
    """

    def read_span(span: Span) -> StateBlock:
        """Return the recorded states of a span."""
        first = starts[span.trajectory]
        part = slice(first + span.start, first + span.stop)
        tau = None if r.tau is None else r.tau[part]
        return StateBlock(span.trajectory, r.time[part], r.z[part], r.dz[part], r.ddz[part], tau)

    return read_span


def _warn_of_still_joints(model: Model, recording: Recording) -> None:
    """Warn of joints that never move in a recording."""
    still = np.ptp(recording.z, axis=0) == 0
    names = [n for n, s in zip(model.mechanism.coordinate_names, still, strict=True) if s]
    if names:
        warnings.warn(
            f"{recording.source}: {', '.join(names)} never moves, so its parameters cannot be determined",
            ParamreduceWarning,
            stacklevel=2,
        )


def _iterate_torques(samples: ComputedSet | JoinedSet) -> Iterator[FloatArray]:
    """Yield the torques, without observation matrices if torques were measured."""
    states: Iterator[StateBlock | Block] = iter(samples.iterate_states())
    first = next(states, None)
    if first is None or first.tau is None:
        return (block.tau for block in samples.iterate_blocks())
    return (block.tau for block in itertools.chain([first], states) if block.tau is not None)


def _compute_nominal_torque(model: Model, estimation: ComputedSet | JoinedSet) -> FloatArray:
    """Return the nominal torques of the config, or the standard deviations over the estimation set."""
    if model.nominal_torque_given:
        return model.nominal_torque
    deviation = compute_standard_deviation(_iterate_torques(estimation))
    deviation[np.isinf(model.nominal_torque)] = np.inf
    return _check_scale(deviation, model, "nominal_torque", "torque")


def _compute_nominal_acceleration(
    sampling: SamplingSection, model: Model, estimation: ComputedSet | JoinedSet
) -> FloatArray:
    """Return the nominal accelerations of the config, or the standard deviations over the estimation set."""
    given = sampling.nominal_acceleration
    names = model.mechanism.coordinate_names
    simulation = sampling.simulation
    prescribed = [] if simulation is None else [names.index(n) for n in simulation.prescribed]
    if given != "standard-deviation":
        sizes = expand_per_joint(given, model.mechanism.n_dof)
        sizes[prescribed] = np.inf
        return sizes
    deviation = compute_standard_deviation(block.ddz for block in estimation.iterate_states())
    deviation[prescribed] = np.inf
    if deviation.any():
        # Of a joint that never moves in a recording there is no scale, and no error to divide by it.
        deviation[deviation == 0] = 1.0
    return _check_scale(deviation, model, "sampling.nominal_acceleration", "acceleration")


def _check_scale(deviation: FloatArray, model: Model, key: str, what: str) -> FloatArray:
    """Return a standard deviation that errors are divided by, or raise an error if it is zero."""
    if not np.all(deviation > 0):
        joint = model.mechanism.coordinate_names[int(np.argmin(deviation))]
        raise DataError(
            f"{joint} has no {what} over the estimation set, so its standard deviation is no scale. "
            f"Give {key} in the config."
        )
    return deviation
