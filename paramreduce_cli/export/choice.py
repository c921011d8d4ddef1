"""Which model is exported, and what it is called."""

from paramreduce_cli.errors import ConfigError
from paramreduce_cli.records import Model, ModelChoice, ReducedModel, Reduction, Validation
from paramreduce_cli.reduction.models import base_model, full_model, known_choices, reduced_model
from paramreduce_cli.texts import EXACT, share

FULL, BASE = "full", "base"


def chosen_model(
    text: str | None, model: Model, reduction: Reduction | None, validation: Validation | None
) -> tuple[ReducedModel, str]:
    """The model that is asked for, and its title.

    Args:
        text: ``full``, ``base`` or ``HEURISTIC:N``; None for the selected one.
        model: Of the robot.
        reduction: Where reduced models are; not needed for ``full`` and ``base``.
        validation: Says which one is selected.

    Raises:
        ConfigError: There is none of that name.
    """
    if text == FULL:
        return full_model(model), "full model"
    if text == BASE:
        return base_model(model), "base parameters"
    assert reduction is not None
    if text is None:
        assert validation is not None
        choice = ModelChoice(validation.selected.heuristic, validation.selected.n)
    else:
        choice = ModelChoice.parse(text)
    row = choice.row(reduction)
    if row is None:
        raise ConfigError(f"--model {text}: there is {FULL}, {BASE}, {known_choices(reduction)}.")
    error = float(reduction.heuristics[choice.heuristic].torque_error[row])
    worth = "exact" if error < EXACT else f"torque error {share(error)}"
    title = f"{choice.heuristic} with {choice.n} parameters, {worth} on the estimation set"
    return reduced_model(reduction, choice.heuristic, row, model.values), title
