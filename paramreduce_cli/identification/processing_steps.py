"""Sentences on the steps of the processing of logs."""

from collections.abc import Iterator, Sequence

import numpy as np

from paramreduce_cli.config.log_settings import LogSection
from paramreduce_cli.identification.data_split import UNUSED
from paramreduce_cli.identification.log_signals import Outliers
from paramreduce_cli.identification.signals import Signals
from paramreduce_cli.records import CutoffSearch, FrictionSearch, MeasuredMotions
from paramreduce_cli.texts import format_percent


def describe_search(
    search: CutoffSearch, given: tuple[float | None, float | None]
) -> Iterator[str]:
    """Yield sentences on the chosen cut-off frequencies and their neighbours."""
    yield (
        f"Up to {search.scored:.3g} Hz the model explains most of the torques' power. Positions and speeds: "
        f"{describe_low_pass(search.state)}; torques and observation matrix: {describe_low_pass(search.torque)}."
    )
    for value, name, cutoffs, errors, chosen in (
        (given[0], "state", search.states, search.state_errors, search.state),
        (given[1], "torque", search.bands, search.torque_errors, search.torque),
    ):
        if value is None:
            k = int(np.flatnonzero(cutoffs == chosen)[0])
            shown = sorted({0, max(0, k - 1), k, min(k + 1, cutoffs.size - 1), cutoffs.size - 1})
            listed = ", ".join(
                f"{format_percent(float(errors[i]))} {describe_cutoff(float(cutoffs[i]))}"
                for i in shown
            )
            yield (
                f"Cross-validation within the training part compares {cutoffs.size} {name} cut-offs; torques up to "
                f"{search.scored:.3g} Hz are missed by {listed}."
            )


def describe_friction(search: FrictionSearch | None) -> Iterator[str]:
    """Yield sentences on the friction that was chosen."""
    if search is None:
        return
    listed = ", ".join(
        f"{name} {speed:.3g}" for name, speed in zip(search.drives, search.smoothing, strict=True)
    )
    yield (
        f"Friction: Coulomb friction is smoothed below the speeds {listed} (0: not smoothed), which leaves the smallest residual. "
        f"Left-out torques are missed by {format_percent(search.error)}, with the smoothing to begin with by "
        f"{format_percent(search.usual_error)}."
    )
    terms = [
        ("Stribeck", np.isfinite(search.stribeck_velocity)),
        ("asymmetric viscous", search.asymmetry),
        ("quadratic", search.quadratic),
        ("load-dependent", search.load),
    ]
    for term, chosen in terms:
        names = [name for name, flag in zip(search.drives, chosen, strict=True) if flag]
        if names:
            yield f"Friction: {', '.join(names)} with {term} terms."


def describe_cutoff(cutoff: float) -> str:
    return "without a low-pass" if np.isinf(cutoff) else f"at {cutoff:.3g} Hz"


def describe_low_pass(cutoff: float) -> str:
    """Describe a low-pass filter; an infinite cut-off means no filter."""
    if np.isinf(cutoff):
        return "as recorded"
    return f"zero-phase low-pass at {cutoff:.3g} Hz"


def describe_outliers(outliers: Outliers, names: Sequence[str]) -> Iterator[str]:
    """Yield a sentence on replaced outliers, if there are any."""
    if not outliers:
        return
    listed = ", ".join(
        f"{len(times)} in the {signal} of {names[j]} (the first at {times[0]:.6g} s)"
        for (signal, j), times in outliers.items()
    )
    count = sum(map(len, outliers.values()))
    yield f"{count} outliers are replaced by what lies between their neighbours: {listed}."


def describe_states(piece: Signals, thin: int, rate: float) -> str:
    """Return a sentence on differentiation and decimation."""
    made = [
        *([] if piece.dz is not None else ["speeds"]),
        *([] if piece.ddz is not None else ["accelerations"]),
    ]
    text = f"Differentiated: {' and '.join(made)}. " if made else ""
    kept = "All samples are kept" if thin == 1 else f"One of {thin} samples is kept"
    return f"{text}{kept}, {rate:.5g} Hz."


def describe_split(
    learned: MeasuredMotions, tested: MeasuredMotions, section: LogSection, rate: float
) -> str:
    """Return a sentence on the durations of training and held-out motions."""
    one, two = (np.count_nonzero(m.fold != UNUSED) / rate for m in (learned, tested))
    cut = (learned.time.size + tested.time.size) / rate - one - two
    how = (
        "by file"
        if section.held_out_files
        else f"the last {100 * section.held_out_fraction:.3g} % of each file"
    )
    text = f"{one:.4g} s are learned from, in {section.folds} folds, {two:.4g} s held out ({how})"
    return f"{text}; {cut:.3g} s at the ends are cut off." if cut * rate >= 1 else f"{text}."
