"""Processing of logs: low-pass, differentiation, split into training and held-out motions."""

import itertools
from collections.abc import Collection, Sequence

import numpy as np

from paramreduce_cli.config.log_settings import Frequency, LogSection
from paramreduce_cli.errors import ConfigError, DataError
from paramreduce_cli.identification import filters
from paramreduce_cli.identification.band_scoring import ComputeColumns
from paramreduce_cli.identification.cutoff_selection import select_cutoffs
from paramreduce_cli.identification.data_split import UNUSED, Piece, split_pieces, trim_files
from paramreduce_cli.identification.friction_selection import FrictionModel, select_friction
from paramreduce_cli.identification.log_checks import find_log_warnings
from paramreduce_cli.identification.log_cleaning import clean_logs
from paramreduce_cli.identification.log_signals import (
    collect_signals,
    decimate_recorded,
    find_longest,
    iterate_speeds,
)
from paramreduce_cli.identification.processing_steps import (
    describe_friction,
    describe_low_pass,
    describe_search,
    describe_split,
    describe_states,
)
from paramreduce_cli.identification.signals import Signals
from paramreduce_cli.identification.state_estimation import (
    Cutoffs,
    choose_decimation,
    estimate_states,
)
from paramreduce_cli.identification.state_noise import estimate_position_noise
from paramreduce_cli.records import (
    CutoffSearch,
    FloatArray,
    IntArray,
    MeasuredLog,
    MeasuredMotions,
    Progress,
    ProgressCallback,
    RawLogs,
    Spectra,
)
from paramreduce_cli.resources.scratch import stack_rows

_USED_PER_CUTOFF = 10
"""Samples per period of the torque cut-off that are used."""
_FEWEST_USED = 20
_WORK = ("clean", "spectra", "low-pass and differentiate", "look at them")
"""What is told of."""


_TOO_SHORT = (
    "the log leaves hardly any samples {}. Use a longer log, raise sampling.log.torque_cutoff and state_cutoff, as the "
    "low-pass is longer than the motion, or trim less."
)


def process_logs(
    logs: RawLogs,
    section: LogSection,
    names: Sequence[str],
    report_progress: ProgressCallback = lambda _: None,
    unmeasured: Collection[str] = (),
    compute_columns: ComputeColumns | None = None,
    friction: FrictionModel | None = None,
) -> MeasuredLog:
    """Process logs for identification.

    Automatic cut-off frequencies are chosen by cross-validation if there is a model, otherwise by the spectrum of the
    speeds.

    Args:
        logs: Logs as recorded.
        section: Settings of the section for logs.
        names: Names of the independent coordinates.
        report_progress: Progress callback.
        unmeasured: Coordinates without torques.
        compute_columns: Function that returns the base parameters' columns of the observation matrix; None without a
            model.
        friction: Drives whose friction the log decides; None if there are none.

    Raises:
        ConfigError: A setting does not fit the robot or the log.
        DataError: A log cannot be used; the message names file, row and column.
    """

    def begin(k: int) -> None:
        report_progress(
            Progress("make logs ready", k, len(_WORK), _WORK[k] if k < len(_WORK) else "")
        )

    steps: list[str] = []
    begin(0)
    files = clean_logs(logs.training, section, names, unmeasured, steps)
    others = clean_logs(logs.held_out, section, names, unmeasured, steps, files.rate)
    training, held_out, rate = files.motions, others.motions, files.rate
    recorded = [piece for pieces in (*training, *held_out) for piece in pieces]
    warnings = dict.fromkeys(
        [
            *files.warnings,
            *others.warnings,
            *(
                text
                for piece in recorded
                for text in find_log_warnings(piece, rate, names, unmeasured)
            ),
        ]
    )
    learned_from, tested_on = _split_files(training, held_out, section)
    _check_left(learned_from, files.sources, section)
    raw = [piece for part in learned_from for piece in part]
    tested_raw = [piece for part in tested_on for piece in part]
    place = find_longest(learned_from, [] if held_out else tested_on, rate)
    longest = raw[place.learned].signals
    before = decimate_recorded(place.get_pieces(raw, tested_raw), rate)
    begin(1)
    spectra = _estimate_spectra(longest, rate)
    given = _read_cutoffs(section, rate)
    search, shape = None, None
    measured = np.array([name not in unmeasured for name in names])
    if compute_columns is not None and (None in given or friction is not None):
        search = select_cutoffs(raw, rate, spectra, compute_columns, measured, given, section.folds)
    cutoffs = _choose_cutoffs(given, spectra, search, steps)
    if search is not None and friction is not None:
        shape = select_friction(raw, rate, search, friction, measured, section.folds)
        steps += describe_friction(shape)
    thin = choose_decimation(cutoffs, rate, section.rate or rate)

    def ready(pieces: list[Piece]) -> list[Piece]:
        """Nothing of one piece is in another: they are low-passed apart."""
        return [estimate_states(piece, rate, cutoffs, thin) for piece in pieces]

    steps.append(describe_states(longest, thin, rate / thin))
    begin(2)
    made = ready(raw)
    made_tested = ready(tested_raw)
    learned, tested = _join_pieces(made, section.folds), _join_pieces(made_tested, 1)
    _check_enough(learned, tested)
    steps.append(describe_split(learned, tested, section, rate / thin))
    begin(3)
    noise = _estimate_noise(learned, cutoffs, rate / thin)
    used = learned.fold != UNUSED
    power = sum(float(np.mean(tau[used] ** 2)) for tau in learned.tau.T)
    found = MeasuredLog(
        training=learned,
        held_out=tested,
        rate=rate / thin,
        recorded_rate=rate,
        state_cutoff=cutoffs.state,
        torque_cutoff=cutoffs.torque,
        output_rate=_choose_output_rate(section, cutoffs, rate / thin),
        delay=section.delay,
        noise=noise,
        noise_share=float(np.sqrt(np.sum(noise**2) / power)),
        position_noise=estimate_position_noise(longest, rate, spectra),
        shown=collect_signals(
            before,
            place.get_pieces(made, made_tested),
            cutoffs.torque,
            rate / thin,
            files.outliers[place.file],
        ),
        spectra=spectra,
        search=search,
        friction=shape,
        steps=tuple(steps),
        warnings=tuple(warnings),
    )
    begin(4)
    return found


def _split_files(
    training: list[list[Signals]], held_out: list[list[Signals]], section: LogSection
) -> tuple[list[list[Piece]], list[list[Piece]]]:
    """Return the training and the held-out pieces, by file."""
    moved = [trim_files(pieces, section) for pieces in training]
    if held_out:
        return moved, [trim_files(pieces, section) for pieces in held_out]
    halves = [split_pieces(pieces, 1 - section.held_out_fraction) for pieces in moved]
    return [one for one, _ in halves], [two for _, two in halves]


def _estimate_spectra(piece: Signals, rate: float) -> Spectra:
    """Return the spectra of speeds and torques."""
    frequency, velocity = filters.estimate_spectrum(iterate_speeds(piece, rate), rate)
    _, torque = filters.estimate_spectrum(piece.tau.T, rate)
    return Spectra(frequency[1:], velocity[1:], torque[1:])


def _read_cutoffs(section: LogSection, rate: float) -> tuple[float | None, float | None]:
    """Return the cut-off frequencies of states and torques that the config gives, Hz; None for automatic ones.

    Raises:
        ConfigError: A given cut-off is not below half of the rate.
    """

    def read(given: Frequency, key: str) -> float | None:
        """Return a cut-off frequency: infinite for none, None for an automatic one."""
        if given == "none":
            return np.inf
        if given == "auto":
            return None
        if float(given) >= rate / 2:
            raise ConfigError(
                f"is {float(given):g} Hz, but the log is recorded at {rate:g} Hz; a cut-off is below half of "
                "that. Write none for no low-pass.",
                ("sampling", "log", key),
            )
        return float(given)

    return read(section.state_cutoff, "state_cutoff"), read(section.torque_cutoff, "torque_cutoff")


def _choose_cutoffs(
    given: tuple[float | None, float | None],
    spectra: Spectra,
    search: CutoffSearch | None,
    steps: list[str],
) -> Cutoffs:
    """Return the cut-off frequencies that the config gives, that a search has found, or that the spectrum suggests."""
    if search is not None:
        steps += describe_search(search, given)
        return Cutoffs(search.state, search.torque)
    band = filters.find_motion_band(spectra.frequency, spectra.velocity)
    state, torque = (band if value is None else value for value in given)
    steps.append(
        f"Speeds stand out of their noise up to {band:.3g} Hz. Positions and speeds: {describe_low_pass(state)}; "
        f"torques and observation matrix: {describe_low_pass(torque)}."
    )
    return Cutoffs(state, torque)


def _choose_output_rate(section: LogSection, cutoffs: Cutoffs, rate: float) -> float:
    """Return the rate of the samples that are used, Hz."""
    usual = rate if np.isinf(cutoffs.torque) else _USED_PER_CUTOFF * cutoffs.torque
    return rate / max(1, int(rate / (section.rate or usual) + 1e-9))


def _check_left(parts: list[list[Piece]], sources: list[str], section: LogSection) -> None:
    for part, source in zip(parts, sources, strict=True):
        if sum(p.used.stop - p.used.start for p in part) < _FEWEST_USED:
            raise DataError(
                f"{source}: too few samples are left for training after sampling.log.trim "
                f"{section.trim} and standstill. Use a longer log, or trim less."
            )


def _join_pieces(pieces: list[Piece], folds: int) -> MeasuredMotions:
    """Return the pieces as one record, with folds of equal duration.

    Raises:
        DataError: No sample is left to hold out.
    """
    pieces = [piece for piece in pieces if piece.used.stop > piece.used.start]
    if not pieces:
        raise DataError(_TOO_SHORT.format("held out"))
    total = sum(p.used.stop - p.used.start for p in pieces)
    fold_of: list[IntArray] = []
    before = 0
    for piece in pieces:
        fold = np.full(piece.signals.time.size, UNUSED)
        size = piece.used.stop - piece.used.start
        fold[piece.used] = (before + np.arange(size)) * folds // max(1, total)
        before += size
        fold_of.append(fold)
    joined = {
        key: stack_rows([getattr(p.signals, key) for p in pieces])
        for key in ("z", "dz", "ddz", "tau")
    }
    time = np.concatenate([p.signals.time for p in pieces])
    number = np.repeat(np.arange(len(pieces)), [p.signals.time.size for p in pieces])
    return MeasuredMotions(time=time, **joined, piece=number, fold=np.concatenate(fold_of))


def _check_enough(learned: MeasuredMotions, tested: MeasuredMotions) -> None:
    for what, motions in (("to learn from", learned), ("held out", tested)):
        if np.count_nonzero(motions.fold != UNUSED) < _FEWEST_USED:
            raise DataError(_TOO_SHORT.format(what))


def _estimate_noise(learned: MeasuredMotions, cutoffs: Cutoffs, rate: float) -> FloatArray:
    """Return the standard deviation of the torques above the band of the model, (n_dof,)."""
    cutoff = cutoffs.torque if np.isfinite(cutoffs.torque) else cutoffs.state
    taps = filters.design_low_pass(cutoff, rate)
    borders = np.searchsorted(learned.piece, np.arange(learned.piece[-1] + 2)).tolist()
    used = learned.fold != UNUSED
    noise = []
    for tau in learned.tau.T:
        above = np.concatenate(
            [
                tau[a:b] - filters.apply_filter(tau[a:b, None], taps)[:, 0]
                for a, b in itertools.pairwise(borders)
            ]
        )
        noise.append(np.std(above[used]))
    return np.array(noise)
