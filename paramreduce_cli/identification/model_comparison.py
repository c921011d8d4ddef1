"""Comparison of a reduced model with all base parameters, on held-out data."""

import numpy as np

from paramreduce_cli.records import Estimate
from paramreduce_cli.texts import format_percent

_ALIKE = 0.02
"""Relative difference of held-out errors, of which there is but one each, that says nothing."""
_SURE = 2.0
"""Standard errors of the mean difference over folds that tell two models apart."""


def compare_held_out(full: Estimate, reduced: Estimate) -> str:
    """Return a sentence on errors on held-out data, and one on cross-validation."""
    if len(full.names) == len(reduced.names):
        return (
            f"The reduced model has as many parameters as the full one, {len(full.names)}: "
            f"{format_percent(full.held_out)} held out."
        )
    beside = reduced.held_out / full.held_out - 1 if full.held_out > 0 else np.inf
    verdict = "beats the full one" if beside < 0 else "is worse"
    if abs(beside) < _ALIKE:
        verdict = "is as good as the full one"
    n, m = len(reduced.names), len(full.names)
    text = (
        f"Held out, the error of {n} parameters is {format_percent(reduced.held_out)}, that of all {m} is "
        f"{format_percent(full.held_out)}: the reduced model {verdict}."
    )
    if full.folds.size < 2 or full.folds.size != reduced.folds.size:
        return text
    # The subset was chosen on all parts, so that this flatters it a little; values are fitted without each.
    difference = reduced.folds - full.folds
    mean = float(difference.mean())
    error = float(difference.std(ddof=1) / np.sqrt(difference.size))
    apart = f"{100 * mean:+.2g} ± {100 * error:.2g} % over {difference.size} parts left out in turn"
    if abs(mean) <= _SURE * error:
        return f"{text} The training data cannot tell them apart ({apart})."
    return f"{text} On the training data, values fitted without each part, it is {'better' if mean < 0 else 'worse'} ({apart})."
