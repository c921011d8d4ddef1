"""Acceptance of the selected model, and warnings on all models."""

from collections.abc import Iterator, Mapping

import numpy as np

from paramreduce_cli.config.schema import Acceptance
from paramreduce_cli.records import (
    About,
    BoolArray,
    ErrorRange,
    HeuristicValidation,
    ModelWarning,
    Selected,
)
from paramreduce_cli.texts import format_percent

_NEGLIGIBLE = 1e-6
"""Errors below this are not compared: there a model is exact but for round-off."""

_CONDITION_FACTOR = 10.0
"""A mass matrix is unsafe if it is so many times worse conditioned than with all given parameters."""
_WORST = "_worst"
"""Ending of keys that limit the largest error over the motions of the test set, not the median."""
_ERROR_FACTOR = 2.0
"""Errors on two sets part if one is so many times larger."""


def judge_model(
    limits: Acceptance, selected: Selected, result: HeuristicValidation
) -> tuple[bool | None, str]:
    """Return whether the selected model keeps the limits of the config, None without limits, and the sentence for it."""
    met: list[str] = []
    missed: list[str] = [selected.missed] if selected.missed else []
    for key in type(limits).model_fields:
        limit = getattr(limits, key)
        if limit is None:
            continue
        value = _get_limited_value(result, selected.n, key)
        relative = "error" in key
        text = f"{key.replace('_', ' ')} {_format_value(value, relative)} (limit {_format_value(limit, relative)})"
        (met if value <= limit else missed).append(text)
    who = f"{selected.heuristic} with {selected.n} parameters"
    if missed:
        return False, f"{who} is not accepted: {', '.join(missed)}."
    if met:
        return True, f"{who} is accepted: {', '.join(met)}."
    return None, f"{who} is not judged: validation.accept sets no limits."


def _get_limited_value(result: HeuristicValidation, n: int, key: str) -> float:
    """Return the quantity that a limit of the config is on, of the model of n parameters."""
    quantity, part = key.removesuffix(_WORST).rsplit("_", 1)
    own = getattr(result, quantity)[part][result.find_row(n)]
    if part != "test":
        return float(own)
    errors = ErrorRange.summarise(own)
    return errors.worst if key.endswith(_WORST) else errors.median


def _format_value(value: float, relative: bool) -> str:
    return format_percent(value) if relative else f"{value:g}"


def find_model_warnings(
    heuristics: Mapping[str, HeuristicValidation],
    full: Mapping[str, int | float],
    selected: Selected,
) -> Iterator[ModelWarning]:
    """Yield warnings on reduced models; the same warning on several heuristics is one."""
    common: dict[str, list[str]] = {}
    who = f"The selected model ({selected.heuristic}, n = {selected.n})"
    for name, result in heuristics.items():
        chosen = result.find_row(selected.n) if name == selected.heuristic else None
        for flags, text, consequence in _check_subsets(full, result):
            if flags.any():
                common.setdefault(text, []).append(name)
            if chosen is not None and flags[chosen]:
                yield ModelWarning(About.SELECTED, f"{who} {consequence}")
    for text, names in common.items():
        yield ModelWarning(About.HEURISTICS, f"{', '.join(names)}: {text}")


def _check_subsets(
    full: Mapping[str, int | float], result: HeuristicValidation
) -> Iterator[tuple[BoolArray, str, str]]:
    """Yield which subsets are not safe to use, why, and what that means for the selected model."""
    unsafe = find_unsafe_models(full, result)
    yield (
        unsafe,
        f"n = {', '.join(_format_ranges(result.n[unsafe].tolist()))}: do not simulate; the mass matrix is indefinite on some samples, or more than "
        f"{_CONDITION_FACTOR:g} times nearer to singular than with all parameters.",
        "is good for inverse dynamics only; do not simulate with it.",
    )
    for what in ("torque", "acceleration"):
        apart = _find_overfitted(result, what)
        yield (
            apart,
            f"{what} errors on the estimation and the validation set differ by more than a factor of {_ERROR_FACTOR:g} at n = "
            f"{', '.join(_format_ranges(result.n[apart].tolist()))}.",
            f"has {what} errors that differ between the two sets by more than a factor of {_ERROR_FACTOR:g}; use more trajectories, or more parameters.",
        )


def find_unsafe_models(full: Mapping[str, int | float], result: HeuristicValidation) -> BoolArray:
    """Return which models have an indefinite or nearly singular mass matrix, (m,)."""
    if not full:  # nothing is known but torques
        return np.zeros(result.n.size, dtype=bool)
    smallest = result.mass_matrix.smallest_eigenvalue
    factor = _CONDITION_FACTOR
    near = smallest <= max(0.0, full["mass_matrix_smallest_eigenvalue"] / factor)
    unsafe: BoolArray = near | (
        result.mass_matrix.condition > factor * full["mass_matrix_condition"]
    )
    return unsafe


def _find_overfitted(result: HeuristicValidation, what: str) -> BoolArray:
    """Return which models have much larger errors on one set than on the other, (m,)."""
    one, two = result.get_errors(what).estimation, result.get_errors(what).validation
    smaller, larger = np.minimum(one, two), np.maximum(one, two)
    apart: BoolArray = (larger > _ERROR_FACTOR * smaller) & ((smaller > _NEGLIGIBLE) & (larger < 1))
    return apart


def _format_ranges(numbers: list[int]) -> Iterator[str]:
    """Yield runs of consecutive numbers as text."""
    start = 0
    for k, number in enumerate(numbers):
        if k + 1 < len(numbers) and numbers[k + 1] == number + 1:
            continue
        yield f"{number}" if start == k else f"{numbers[start]}...{number}"
        start = k + 1
