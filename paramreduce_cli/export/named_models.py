"""Which model is exported, and what it is called."""

from dataclasses import replace

from paramreduce_cli.errors import ConfigError
from paramreduce_cli.records import (
    TERMS,
    ErrorRange,
    Identification,
    Model,
    ModelChoice,
    ReducedModel,
    Reduction,
    TermModel,
    TermReduction,
    Validation,
)
from paramreduce_cli.reduction.models import (
    list_choices,
    make_base_model,
    make_full_model,
    make_reduced_model,
)
from paramreduce_cli.texts import EXACT, format_percent, format_percent_range

FULL, BASE = "full", "base"
IDENTIFIED, CONSISTENT = "identified", "consistent"
"""From measured torques: all base parameters, and standard parameters that a machine can have."""


def find_chosen_model(
    text: str | None,
    model: Model | None,
    reduction: Reduction | None,
    validation: Validation | None,
    identification: Identification | None = None,
) -> tuple[ReducedModel, str]:
    """Return the model that the user names, and its title.

    Args:
        text: ``full``, ``base``, ``identified``, ``consistent`` or ``HEURISTIC:N``; None for the selected one.
        model: Model of the robot; None for user-supplied samples without one.
        reduction: Reduced models; not needed for ``full`` and ``base``.
        validation: Validation, which says which model is selected.
        identification: Identified models; needed for these alone.

    Raises:
        ConfigError: There is no model of this name.
    """
    if text == FULL and model is not None:
        return make_full_model(model), "full model"
    if text == BASE and model is not None:
        return make_base_model(model), "base parameters"
    if text in (IDENTIFIED, CONSISTENT) and model is not None:
        assert identification is not None
        return _make_identified_model(text, model, identification)
    assert reduction is not None
    if text is None:
        assert validation is not None
        choice = ModelChoice(validation.selected.heuristic, validation.selected.n)
    else:
        choice = ModelChoice.parse(text)
    row = choice.find_row(reduction)
    if row is None:
        others = [FULL, BASE] if model is not None else []
        choices = [*others, *list_choices(reduction)]
        default = [f"{validation.selected.heuristic}:{validation.selected.n}"] if validation else []
        selected = f"; {default[0]} is selected" if default else ""
        raise ConfigError(
            f"--model {text}: there is {', '.join(choices)}{selected}; with a config and a "
            f"log also {IDENTIFIED} and {CONSISTENT}, with pruned terms {TERMS}.",
            rejected=text or "",
            choices=[*default, *choices],
        )
    error = float(reduction.heuristics[choice.heuristic].torque_error[row])
    worth = "exact" if error < EXACT else f"torque error {format_percent(error)}"
    title = f"{choice.heuristic} with {choice.n} parameters, {worth} on the estimation set"
    judged = validation and validation.heuristics.get(choice.heuristic)
    if judged and (known_row := judged.find_row(choice.n)) is not None:
        other = float(judged.torque_error.validation[known_row])
        title += f", {format_percent(other)} on the validation set"
        test = judged.torque_error.test[known_row]
        if test.size:
            title += (
                f", {format_percent_range(*ErrorRange.summarise(test))} on {test.size} test motions"
            )
    known = model.values if model is not None else None
    return make_reduced_model(reduction, choice.heuristic, row, known), title


def _make_identified_model(
    text: str, model: Model, identification: Identification
) -> tuple[ReducedModel, str]:
    """Return the identified or the physically consistent model, and its title.

    Raises:
        ConfigError: The physically consistent model is asked for and was not identified.
    """
    if text == IDENTIFIED:
        found = identification.full
        chosen = make_base_model(model)
        worth = f"identified base parameters, {format_percent(found.held_out)} held out"
        return replace(chosen, values=found.values), worth
    consistency = identification.consistency
    if consistency is None:
        raise ConfigError(
            f"--model {CONSISTENT}: identification.h5 holds none; set identification.consistency, or install "
            "cvxpy with `pip install 'paramreduce[identify]'`.",
            command="identify",
        )
    worth = f"physically consistent parameters, {format_percent(consistency.held_out)} held out"
    return make_full_model(replace(model, values=consistency.standard)), worth


def find_pruned_model(terms: TermReduction, name: str) -> tuple[ReducedModel, TermModel, str]:
    """Return the parameters of a function with pruned terms, the function and its title.

    Args:
        terms: Result of the search of terms.
        name: ``inverse`` or ``direct``.

    Raises:
        ConfigError: The function has not been pruned.
    """
    term = terms.functions.get(name)
    if term is None:
        raise ConfigError(
            f"--model {TERMS}: terms.h5 has no {name} dynamics; it has to stand under terms.functions, and "
            "something must be found within the budget.",
            command="reduce-terms",
        )
    errors = [term.torque_error.estimation, term.torque_error.validation]
    known = " / ".join(format_percent(error) for error in errors if error == error)
    allowed = format_percent(terms.torque_budget)
    if name == "direct" and terms.acceleration_budget < float("inf"):
        allowed += f", of accelerations {format_percent(terms.acceleration_budget)}"
    title = (
        f"{name} dynamics with pruned terms, {term.values.size} parameters, {term.operations} operations, "
        f"torque error {known} (estimation / validation), allowed {allowed}"
    )
    if term.torque_error.test.size:
        test = format_percent_range(*ErrorRange.summarise(term.torque_error.test))
        title += f", {test} on {term.torque_error.test.size} test motions"
    fitted_again = ("",) * len(term.names)  # so that they stand for no combination of known ones
    model = ReducedModel(term.names, term.values, term.position, fitted_again, term.units)
    return model, term, title
