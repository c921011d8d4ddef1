"""Selection of the reduced model that the config asks for."""

from collections.abc import Mapping

from paramreduce_cli.config.schema import SelectedSection
from paramreduce_cli.errors import ConfigError, DataError
from paramreduce_cli.judgement.cross_validation import (
    LARGEST_LOSS,
    choose_by_bounded_loss,
    choose_by_one_standard_error,
    find_best,
)
from paramreduce_cli.judgement.model_selection import (
    Pick,
    compute_worst_ratios,
    find_best_of_size,
    find_nearest_to,
    find_smallest_within,
    is_proven_smallest,
)
from paramreduce_cli.records import (
    BoolArray,
    CrossValidation,
    FloatArray,
    HeuristicValidation,
    ModelChoice,
    Reduction,
    Selected,
)
from paramreduce_cli.reduction.models import make_reduced_model
from paramreduce_cli.texts import format_percent

_SAFE = ", and with a mass matrix that is positive definite on all samples"
"""Requirement for models that are to be simulated, as part of a sentence."""


def select_model(
    section: SelectedSection,
    known_values: FloatArray | None,
    reduction: Reduction,
    results: Mapping[str, HeuristicValidation],
    cross_validation: Mapping[str, CrossValidation] | None,
    unsafe: Mapping[str, BoolArray],
) -> Selected:
    """Return the model of the size that the config asks for, or the smallest model within the tolerances on both sets.

    If no model keeps the tolerances, the nearest one is returned, with a note. With cross-validation, the
    model is the smallest one that is hardly worse than the best one and than all parameters.

    Args:
        section: Limits of the config.
        known_values: Standard parameters, (n_standard,), where they are known.
        reduction: The subsets.
        results: Errors and costs of the reduced models.
        cross_validation: Errors on folds, if the size is chosen by cross-validation.
        unsafe: Masks of the models that must not be simulated, by heuristic.

    Raises:
        ConfigError: There is no model of that size.
        DataError: The heuristic asked for was not run.
    """
    if section.heuristic is not None:
        if section.heuristic not in results:
            raise DataError(f"reduction.h5 has no {section.heuristic}.", command="reduce")
        results = {section.heuristic: results[section.heuristic]}
    missed = ""
    if cross_validation is not None:
        parsimonious = section.cross_validation == "parsimonious"
        heuristic, row, reason = _choose_by_cross_validation(
            results, cross_validation, parsimonious=parsimonious
        )
    elif section.n is not None:
        heuristic, row = _find_of_size(section.n, results)
        reason = f"{heuristic} with the {section.n} parameters that selected.n asks for."
    else:
        tolerances = section.list_tolerances()
        simulated = section.use == "simulation"
        choice = find_smallest_within(results, tolerances, unsafe if simulated else {})
        heuristic, row = choice if choice is not None else find_nearest_to(results, tolerances)
        n = int(results[heuristic].n[row])
        if choice is None:
            worst = float(compute_worst_ratios(results[heuristic], tolerances)[row])
            missed = f"no model has {_format_tolerances(tolerances)}{_SAFE if simulated else ''}, the nearest is {worst:.3g} times beyond"
            reason = f"{heuristic} with n = {n}: {missed}."
        else:
            reason = _explain_choice(section, tolerances, reduction, heuristic, n)
    chosen = make_reduced_model(reduction, heuristic, row, known_values)
    return Selected(heuristic=heuristic, model=chosen, reason=reason, missed=missed)


def _choose_by_cross_validation(
    results: Mapping[str, HeuristicValidation],
    folds: Mapping[str, CrossValidation],
    *,
    parsimonious: bool,
) -> tuple[str, int, str]:
    """Return the model that a rule selects in cross-validation: its heuristic, its row and sentences that say why."""
    bounded, small = choose_by_bounded_loss(folds), choose_by_one_standard_error(folds)
    choice, other = (small, bounded) if parsimonious else (bounded, small)
    row = results[choice.heuristic].find_row(choice.n)
    assert row is not None  # only sizes of the heuristic itself are judged
    best = find_best(folds)
    full = format_percent(float(folds[choice.heuristic].full_error.mean()))
    n_folds = folds[choice.heuristic].torque_error.shape[0]
    if choice == best:
        beside = "This error is the smallest"
    else:
        beside = f"The smallest error is {_format_mean(folds, best)} (n = {best.n})"
    rule = (
        "It is the smallest model within one standard error of the best"
        if parsimonious
        else f"No smaller model is certain to be at most {100 * LARGEST_LOSS:g} % worse than both"
    )
    reason = (
        f"{choice.heuristic} with n = {choice.n}: with each of {n_folds} parts left out in turn its torque error "
        f"there is {_format_mean(folds, choice)}. {beside}; that of all parameters is {full}. {rule}."
    )
    if other.n != choice.n:
        key = "true" if parsimonious else "parsimonious"
        reason += f" selected.cross_validation: {key} would select n = {other.n} ({_format_mean(folds, other)})."
    return choice.heuristic, row, reason


def _format_mean(folds: Mapping[str, CrossValidation], choice: ModelChoice) -> str:
    """Return the mean error of a model over the folds as text."""
    result = folds[choice.heuristic]
    return format_percent(float(result.mean[result.n == choice.n][0]))


def _find_of_size(n: int, results: Mapping[str, HeuristicValidation]) -> Pick:
    """Return the best model of n parameters, or raise ConfigError if there is none."""
    choice = find_best_of_size(results, n)
    if choice is not None:
        return choice
    sizes = sorted({int(k) for result in results.values() for k in result.n})
    who = " and ".join(results)
    raise ConfigError(
        f"is {n}, but {who} orders {sizes[-1]} parameters. Ask for fewer, or let reduction.stop go "
        "further."
        if n > sizes[-1]
        else f"is {n}, but with groups {who} has subsets of {', '.join(map(str, sizes))} parameters "
        "only. Choose one of these.",
        ("selected", "n"),
    )


def _explain_choice(
    section: SelectedSection,
    tolerances: Mapping[str, float],
    reduction: Reduction,
    heuristic: str,
    n: int,
) -> str:
    """Return a sentence that says why a model was chosen by tolerances: whether it is proven to be the smallest within
    them, or has the smallest error if only operations are limited.
    """
    who = f"{heuristic} with n = {n}"
    if set(tolerances) == {"operations"}:
        return f"{who} has the smallest torque error with {_format_tolerances(tolerances)}."
    whose = f" of {section.heuristic}" if section.heuristic is not None else ""
    safe = _SAFE if section.use == "simulation" else ""
    text = f"{who} is the smallest model found{whose} with {_format_tolerances(tolerances)}{safe}"
    limit = tolerances.get("torque_error")
    if reduction.proofs is None or limit is None or n == 1:
        return f"{text}."
    if is_proven_smallest(reduction.proofs, n, limit):
        return f"{text}; proven: no smaller subset reaches that error on the estimation set."
    return f"{text}; smaller ones are not excluded by proof."


def _format_tolerances(tolerances: Mapping[str, float]) -> str:
    """Return the tolerances as text."""
    errors = [
        f"{key.replace('_', ' ')} at most {format_percent(tolerances[key])}"
        for key in ("torque_error", "acceleration_error")
        if key in tolerances
    ]
    shown = [f"{' and '.join(errors)} on the estimation and the validation set"] if errors else []
    if "operations" in tolerances:
        shown.append(f"at most {tolerances['operations']:g} operations of d")
    return " and ".join(shown)
