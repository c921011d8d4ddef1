"""validate: what every reduced model is worth, and whether the selected one is accepted."""

from __future__ import annotations

import numpy as np

from paramreduce_cli.config import Config
from paramreduce_cli.config.schema import SelectedSection
from paramreduce_cli.errors import ConfigError, DataError
from paramreduce_cli.multibody.dynamics import Dynamics
from paramreduce_cli.multibody.relations import approximate_expressions
from paramreduce_cli.records import (
    BoolArray,
    FloatArray,
    HeuristicValidation,
    IntArray,
    Model,
    Ordering,
    Reduction,
    Samples,
    SampleSet,
    Selected,
    Validation,
)
from paramreduce_cli.reduction.acceleration import AccelerationErrors, acceleration_errors
from paramreduce_cli.reduction.fitting import NormErrors, torque_errors
from paramreduce_cli.registry import stage

_DEFAULT_TORQUE_ERROR = 0.01


@stage
def validate(config: Config, model: Model, samples: Samples, reduction: Reduction) -> Validation:
    """Judge the reduced models on both sets.

    Exit code 0: the selected model is accepted; 1: it is not, with the sentence that says why.
    """
    if samples.validation is None:
        raise DataError("samples.h5 holds no validation set; make one with `paramreduce sample`.")
    dynamics = Dynamics(model.mechanism)
    nominal = samples.nominal_acceleration
    if nominal is None:
        raise DataError("samples.h5 holds no /nominal_acceleration; it is needed to validate.")
    columns = _columns(reduction, model)
    _check_coordinates(model, samples)
    weights = reduction.nominal_torque

    def errors_on(sample_set: SampleSet) -> tuple[NormErrors, AccelerationErrors]:
        torque = torque_errors(sample_set.blocks(), columns, weights)
        acceleration = acceleration_errors(
            sample_set.blocks(), dynamics.direct_regressor, columns, nominal
        )
        return torque, acceleration

    estimation, validation = errors_on(samples.estimation), errors_on(samples.validation)
    heuristics = {}
    start = 0
    for name, ordering in reduction.orderings.items():
        part = slice(start, start + ordering.n.size)
        subsets = [reduction.expansion[:, ordering.subset(n)] for n in ordering.n]
        counts = _operations(config, dynamics, model.affecting, subsets)
        heuristics[name] = _judged(ordering, counts, estimation, validation, part)
        start += ordering.n.size
    full = _full_model(config, model, dynamics, estimation[1], validation[1])
    selected = _select(config, model, reduction)
    accepted, verdict = _verdict(config, selected, heuristics[selected.heuristic])
    return Validation(
        heuristics=heuristics,
        full=full,
        nominal_acceleration=nominal,
        selected=selected,
        accepted=accepted,
        verdict=verdict,
        remarks=tuple(_remarks(config, heuristics, full, selected)),
    )


def _check_coordinates(model: Model, samples: Samples) -> None:
    n_q = model.mechanism.n_q
    for part in (samples.estimation, samples.validation):
        if part is not None and next(iter(part.blocks())).q.shape[1] != n_q:
            raise DataError(
                f"samples.h5 holds no q, dq, ddq of all {n_q} coordinates, which the loops need; make "
                "it with `paramreduce sample`."
            )


def _columns(reduction: Reduction, model: Model) -> FloatArray:
    """Every subset of every heuristic as a column, and the full model as the last one."""
    if reduction.expansion.shape[0] != len(model.mechanism.parameter_names):
        raise DataError("reduction.h5 has other parameters than model.h5; run `paramreduce run`.")
    columns = [
        reduction.standard(ordering.subset(n), values)
        for ordering in reduction.orderings.values()
        for n, values in zip(ordering.n, ordering.parameters, strict=True)
    ]
    return np.column_stack([*columns, model.values])


def _judged(
    ordering: Ordering,
    counts: IntArray,
    estimation: tuple[NormErrors, AccelerationErrors],
    validation: tuple[NormErrors, AccelerationErrors],
    part: slice,
) -> HeuristicValidation:
    return HeuristicValidation(
        n=ordering.n,
        torque_error_estimation=estimation[0].two[part],
        torque_error_validation=validation[0].two[part],
        torque_error_joint_estimation=estimation[0].joints[part],
        torque_error_joint_validation=validation[0].joints[part],
        acceleration_error_estimation=estimation[1].error[part],
        acceleration_error_validation=validation[1].error[part],
        acceleration_error_joint_estimation=estimation[1].joints[part],
        acceleration_error_joint_validation=validation[1].joints[part],
        mass_matrix_condition=np.maximum(
            estimation[1].condition[part], validation[1].condition[part]
        ),
        mass_matrix_smallest_eigenvalue=np.minimum(
            estimation[1].smallest_eigenvalue[part], validation[1].smallest_eigenvalue[part]
        ),
        operations_inverse=counts[:, 0],
        operations_direct=counts[:, 1],
        operations_inverse_paper_rule=counts[:, 2],
        operations_direct_paper_rule=counts[:, 3],
    )


def _operations(
    config: Config, dynamics: Dynamics, affecting: BoolArray, expansions: list[FloatArray]
) -> IntArray:
    """IDM and DDM by our count, then by the paper's rule, (n_subsets, 4).

    Args:
        config: Says which functions are counted.
        dynamics: Of the mechanism.
        affecting: Parameters that change the torques at all, (n_standard,).
        expansions: For each subset, standard parameters from its values, (n_standard, n).
    """
    independent = config.validation.operations == "independent"
    counts = []
    for expansion in expansions:
        kept = np.flatnonzero(expansion.any(axis=1) & affecting)
        first = np.argmax(expansion != 0, axis=0)
        owner = first[np.argmax(expansion[kept] != 0, axis=1)]
        same = {int(k): int(other) for k, other in zip(kept, owner, strict=True) if k != other}
        counts.append(
            [
                value
                for signs_free in (True, False)
                for value in dynamics.count_operations(
                    kept, same=same, signs_free=signs_free, independent=independent
                )
            ]
        )
    return np.array(counts)


def _full_model(
    config: Config,
    model: Model,
    dynamics: Dynamics,
    estimation: AccelerationErrors,
    validation: AccelerationErrors,
) -> dict[str, int | float]:
    unit = np.eye(model.values.size)
    full, base = _operations(
        config, dynamics, model.affecting, [unit[:, model.affecting], unit[:, model.base.columns]]
    )
    names = (
        "operations_inverse",
        "operations_direct",
        "operations_inverse_paper_rule",
        "operations_direct_paper_rule",
    )
    result: dict[str, int | float] = dict(zip(names, full.tolist(), strict=True))
    result |= {f"base_{name}": value for name, value in zip(names, base.tolist(), strict=True)}
    result["mass_matrix_condition"] = float(max(estimation.condition[-1], validation.condition[-1]))
    result["mass_matrix_smallest_eigenvalue"] = float(
        min(estimation.smallest_eigenvalue[-1], validation.smallest_eigenvalue[-1])
    )
    return result


def _select(config: Config, model: Model, reduction: Reduction) -> Selected:
    wanted = config.selected
    if wanted.heuristic not in reduction.orderings:
        raise DataError(
            f"reduction.h5 has no {wanted.heuristic}; run `paramreduce reduce` with this config."
        )
    ordering = reduction.orderings[wanted.heuristic]
    row = _selected_row(wanted, ordering)
    n = int(ordering.n[row])
    kept = ordering.subset(n)
    known = np.linalg.pinv(reduction.expansion) @ model.values
    return Selected(
        heuristic=wanted.heuristic,
        n=n,
        parameters=tuple(reduction.names[k] for k in kept),
        values=ordering.parameters[row],
        expressions=tuple(
            approximate_expressions(reduction.names, kept, ordering.beta[row], known)
        ),
    )


def _selected_row(wanted: SelectedSection, ordering: Ordering) -> int:
    """Where the subset that the config asks for stands in the ordering."""
    if wanted.n is not None:
        row = ordering.row(wanted.n)
        if row is None:
            most = int(ordering.n[-1])
            raise ConfigError(
                f"selected.n is {wanted.n}, but {wanted.heuristic} orders {most} parameters. Ask for "
                "fewer, or let reduction.stop go further."
                if wanted.n > most
                else f"selected.n is {wanted.n}, but with groups {wanted.heuristic} has subsets of "
                f"{', '.join(map(str, ordering.n))} parameters only. Choose one of these."
            )
        return row
    limit = wanted.torque_error or _DEFAULT_TORQUE_ERROR
    good = np.flatnonzero(ordering.torque_error <= limit)
    if good.size == 0:
        raise ConfigError(
            f"selected.torque_error: no subset of {wanted.heuristic} has an error of at most "
            f"{limit:g}; the smallest is {ordering.torque_error.min():.3g}. Raise it, or let "
            "reduction.stop go further."
        )
    return int(good[0])


def _verdict(config: Config, selected: Selected, result: HeuristicValidation) -> tuple[bool, str]:
    """Whether the selected model keeps to the limits of the config, and the sentence for it."""
    limits = config.validation.accept
    met: list[str] = []
    missed: list[str] = []
    for key in type(limits).model_fields:
        limit = getattr(limits, key)
        if limit is None:
            continue
        value = float(getattr(result, key)[result.row(selected.n)])
        share = "error" in key
        text = f"{key.replace('_', ' ')} {_shown(value, share)} (limit {_shown(limit, share)})"
        (met if value <= limit else missed).append(text)
    who = f"{selected.heuristic} with {selected.n} parameters"
    if missed:
        return False, f"{who} is not accepted: {', '.join(missed)}."
    if met:
        return True, f"{who} is accepted: {', '.join(met)}."
    return True, f"{who} is not judged: validation.accept sets no limits."


def _shown(value: float, share: bool) -> str:
    return f"{100 * value:.3g} %" if share else f"{value:g}"


def _remarks(
    config: Config,
    heuristics: dict[str, HeuristicValidation],
    full: dict[str, int | float],
    selected: Selected,
) -> list[str]:
    """Where the direct dynamics of reduced models should not be used."""
    remarks = []
    limit = config.validation.condition_factor * full["mass_matrix_condition"]
    for name, result in heuristics.items():
        indefinite = result.mass_matrix_smallest_eigenvalue <= 0
        unsafe = indefinite | (result.mass_matrix_condition > limit)
        if unsafe.any():
            last = int(result.n[np.flatnonzero(unsafe)[-1]])
            remarks.append(
                f"{name}: direct dynamics is not safe to use everywhere up to n = {last}; there the "
                "mass matrix loses positive definiteness on the samples or is more than "
                f"{config.validation.condition_factor:g} times worse conditioned than the full "
                "model's."
            )
        if name == selected.heuristic and unsafe[result.row(selected.n)]:
            remarks.append(
                f"The selected model ({name}, n = {selected.n}) is not safe for direct dynamics: use "
                "its inverse dynamics only."
            )
    return remarks
