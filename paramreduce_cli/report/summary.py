"""summary.json: the numbers that a regression job compares."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from paramreduce_cli.records import (
    SETS,
    About,
    Artifacts,
    ErrorRange,
    FloatArray,
    HeuristicValidation,
    Identification,
    IntArray,
    JointErrors,
    Leanest,
    LoopEvaluation,
    Model,
    ModelChoice,
    Provenance,
    Reduction,
    SetErrors,
    SimulatedManoeuvre,
    Subsets,
    TermFront,
    TermModel,
    TermReduction,
    Trajectories,
    Trajectory,
    Validation,
)


def gather_summary(
    artifacts: Artifacts,
    leanest: Mapping[str, Leanest],
    loops: LoopEvaluation | None,
    manoeuvre: SimulatedManoeuvre | None,
    provenance: Provenance,
) -> dict[str, Any]:
    """Gather the numbers of all artifacts as plain data; infinite numbers become None, and so do those of a mechanism
    if there is none.

    Args:
        artifacts: Artifacts of all stages.
        leanest: The leanest models within the limits, by function.
        loops: Operations of the kinematics of closed loops; None without loops.
        manoeuvre: Simulated manoeuvre; None if there is none.
        provenance: Origin of the artifacts.
    """
    model, reduction, validation = artifacts.model, artifacts.reduction, artifacts.validation
    selected = validation.selected
    chosen = validation.heuristics[selected.heuristic]
    data = {
        "robot": provenance.robot,
        "config_sha256": provenance.config_sha256,
        "versions": dict(provenance.versions),
        "seconds": dict(provenance.seconds),
        "model": _summarise_columns(reduction) if model is None else _summarise_model(model),
        "trajectories": _summarise_trajectories(artifacts.trajectories),
        "reduction": {
            **{
                name: _summarise_subsets(reduction, found)
                for name, found in reduction.heuristics.items()
            },
            "proofs": _summarise_proofs(reduction),
            "pareto": [
                _summarise_model_choice(reduction, validation, choice)
                for choice in validation.pareto
            ],
        },
        "validation": {
            name: _summarise_rows(result) for name, result in validation.heuristics.items()
        },
        "full": dict(validation.full),
        "loops": _summarise_loops(loops),
        "manoeuvre": _summarise_manoeuvre(manoeuvre),
        "identification": _summarise_identification(artifacts.identification),
        "terms": _summarise_terms(model, artifacts.terms),
        "selected": {
            "heuristic": selected.heuristic,
            "n": selected.n,
            "reason": selected.reason,
            "parameters": dict(zip(selected.model.names, selected.model.values, strict=True)),
            "accepted": validation.accepted,
            "verdict": validation.verdict,
            "remarks": [r.text for r in validation.warnings if r.about is About.SELECTED],
            "leanest": _summarise_leanest(leanest),
            **next(row for row in _summarise_rows(chosen) if row["n"] == selected.n),
        },
        "stability": _summarise_stability(reduction, validation),
        "remarks": [warning.text for warning in validation.warnings],
    }
    plain: dict[str, Any] = _convert(data)
    return plain


def _summarise_loops(loops: LoopEvaluation | None) -> dict[str, Any] | None:
    """Return the operations of the kinematics of closed loops, and of the whole evaluation of the full and of the
    selected model; None without loops.
    """
    if loops is None:
        return None
    full, selected = loops.whole.values()
    return {
        "newton": loops.newton,
        "velocities": loops.velocities,
        "accelerations": loops.accelerations,
        "rates": loops.rates,
        "whole_full": full,
        "whole_selected": selected,
    }


def _summarise_manoeuvre(manoeuvre: SimulatedManoeuvre | None) -> dict[str, Any] | None:
    """Return the deviations of the selected model in a simulated manoeuvre; None if there is none."""
    if manoeuvre is None:
        return None
    quantities = ("position", "acceleration")
    each = {quantity: manoeuvre.compute_deviations(quantity) for quantity in quantities}
    return {
        "set": manoeuvre.set_name,
        **{f"{quantity}_error": manoeuvre.compute_error(quantity) for quantity in quantities},
        "coordinates": {
            name: {f"{quantity}_error": each[quantity][k] for quantity in quantities}
            for k, name in enumerate(manoeuvre.names)
        },
    }


def _summarise_leanest(leanest: Mapping[str, Leanest]) -> dict[str, Any]:
    """Return the leanest models within the limits, by function."""
    return {
        name: {
            "model": one.model,
            "operations": one.operations,
            "torque_error": {
                **vars(one.torque_error),
                "test": _summarise_range(ErrorRange.summarise(one.torque_error.test)),
            },
        }
        for name, one in leanest.items()
    }


def _summarise_model(model: Model) -> dict[str, Any]:
    """Return the numbers of joints, parameters and base parameters of a model, its rank gap and the names of its
    parameters.
    """
    return {
        "n_dof": model.mechanism.n_dof,
        "n_parameters": model.values.size,
        "unmeasured": list(model.unmeasured),
        "n_affecting": int(model.affecting.sum()),
        "n_base": model.base.columns.size,
        "rank_gap": model.base.rank_gap,
        "names": list(model.mechanism.parameter_names),
    }


def _summarise_columns(reduction: Reduction) -> dict[str, Any]:
    """Return the summary of a user-supplied observation matrix, which takes the place of a model's."""
    return {
        "n_dof": reduction.nominal_torque.size,
        "n_parameters": len(reduction.columns.names),
        "unmeasured": [],
        "n_affecting": reduction.n_affecting,
        "n_base": reduction.rank,
        "rank_gap": None,
        "names": list(reduction.columns.names),
    }


def _summarise_subsets(reduction: Reduction, subsets: Subsets) -> dict[str, Any]:
    """Return the subsets of a heuristic."""

    def list_names(columns: IntArray) -> list[str]:
        return [reduction.columns.names[k] for k in columns]

    nested = subsets.order is not None
    return {
        "order": list_names(subsets.order) if subsets.order is not None else None,
        "subsets": None if nested else [list_names(subset) for subset in subsets.subsets],
        "n": subsets.n,
        "torque_error_1": subsets.torque_error_1,
        "torque_error_inf": subsets.torque_error_inf,
        "minimum_norm_from": _find_first_beyond_rank(subsets),
        "seconds": subsets.seconds,
    }


def _summarise_proofs(reduction: Reduction) -> list[dict[str, Any]]:
    """Return the proofs, a row for every size."""
    proofs = reduction.proofs
    if proofs is None:
        return []
    keys = ("n", "torque_error", "lower_bound", "status", "seconds")
    return [{key: getattr(proofs, key)[k] for key in keys} for k in range(proofs.n.size)]


def _summarise_model_choice(
    reduction: Reduction, validation: Validation, choice: ModelChoice
) -> dict[str, Any]:
    """Return the entry of a model of the Pareto front: its parameters, errors on the estimation set and operations."""
    heuristic, n = choice.heuristic, choice.n
    result = validation.heuristics[heuristic]
    row = result.find_row(n)
    subset = reduction.heuristics[heuristic].get_subset(n)
    return {
        "heuristic": heuristic,
        "parameters": [reduction.columns.names[k] for k in subset],
        "n": n,
        "torque_error": result.torque_error.estimation[row],
        "acceleration_error": result.acceleration_error.estimation[row],
        "operations": {
            function: _convert_count(result.operations[function][row])
            for function in ("inverse", "direct")
        },
    }


def _summarise_stability(reduction: Reduction, validation: Validation) -> dict[str, Any] | None:
    """Return the stability of the selection; None where it was not checked."""
    found = validation.stability
    if found is None:
        return None
    often = found.chosen.mean(axis=0)
    return {
        "variants": [str(variant) for variant in found.variants],
        "torque_error": found.torque_error,
        "share_chosen": {reduction.columns.names[k]: often[k] for k in np.flatnonzero(often)},
    }


def _summarise_identification(identification: Identification | None) -> dict[str, Any] | None:
    """Return the identified values; None where there are none."""
    if identification is None:
        return None
    consistency = identification.consistency
    full, reduced, payload = (
        {
            "n": len(estimate.names),
            "train": estimate.train,
            "held_out": estimate.held_out,
            "joint_held_out": estimate.joint_held_out,
            "folds": estimate.folds,
            "values": dict(zip(estimate.names, estimate.values, strict=True)),
            "deviations": dict(zip(estimate.names, estimate.deviations, strict=True)),
            "half_widths": dict(zip(estimate.names, estimate.half_widths, strict=True)),
        }
        if estimate is not None
        else None
        for estimate in (identification.full, identification.reduced, identification.payload)
    )
    physical = consistency and {
        "train": consistency.train,
        "held_out": consistency.held_out,
        "bodies_positive": consistency.positive,
    }
    return {
        "estimator": identification.estimator,
        "full": full,
        "reduced": reduced,
        "payload": payload,
        "consistent": physical,
        "comparison": identification.comparison,
        "hints": list(identification.hints),
    }


def _summarise_terms(model: Model | None, terms: TermReduction | None) -> list[dict[str, Any]]:
    """Return the pruned functions; empty where there are none."""
    if model is None or terms is None:
        return []
    return [
        {
            "function": name,
            "heuristic": one.heuristic,
            "n_start": one.n_start,
            "budget": {"torque": terms.torque_budget, "acceleration": terms.acceleration_budget},
            "held_out": terms.held_out,
            "operations": one.operations,
            "operations_start": one.operations_start,
            **_summarise_errors(one),
            "random_torque_error": one.random_torque_error,
            "random_acceleration_error": one.random_acceleration_error,
            "random_states": one.random_states,
            "largest_difference": one.largest_difference,
            "worst_joint": model.mechanism.coordinate_names[one.worst_joint],
            "worst_state": one.worst_state,
            "smallest_eigenvalue": one.smallest_eigenvalue,
            "mass_states": one.mass_states,
            "ranges": [one.lower, one.upper],
            "drawn": one.drawn,
            "parameters": dict(zip(one.names, one.values, strict=True)),
            "units": dict(zip(one.names, one.units, strict=True)),
            "pareto": [
                {"operations": count, **_summarise_errors(one.front, k)}
                for k, count in enumerate(one.front.operations)
            ],
        }
        for name, one in terms.functions.items()
    ]


def _summarise_errors(of: TermModel | TermFront, row: int | None = None) -> dict[str, Any]:
    """Return torque and acceleration errors on all sets."""

    def errors_on(part: str, what: str) -> Any:
        """Return the errors on a set; for the test set their range."""
        value = getattr(of, f"{what}_error")[part]
        own = value if row is None else value[row]
        return _summarise_range(ErrorRange.summarise(own)) if part == "test" else own

    return {
        f"{what}_error": {part: errors_on(part, what) for part in SETS}
        for what in ("torque", "acceleration")
    }


def _summarise_range(errors: ErrorRange) -> dict[str, float] | None:
    """Return errors over the motions of the test set; None where it holds none, or where they are not known."""
    return None if np.isnan(errors.median) else errors._asdict()


def _summarise_trajectories(trajectories: Trajectories | None) -> dict[str, Any] | None:
    """Return the trajectories of all sets; None where there are none."""
    if trajectories is None:
        return None
    return {
        "criterion": trajectories.criterion,
        "scaling": trajectories.scaling,
        "constraints": [c.name for c in trajectories.constraints],
        "period": trajectories.period,
        **{name: [_summarise_trajectory(t) for t in getattr(trajectories, name)] for name in SETS},
        "test_point_to_point": [vars(motion) for motion in trajectories.test_point_to_point],
    }


def _summarise_trajectory(t: Trajectory) -> dict[str, Any]:
    return {**vars(t), "kappa_variants": dict(t.kappa_variants)}


def _find_first_beyond_rank(subsets: Subsets) -> int | None:
    """Return the smallest size that is fitted with minimum norm, or None."""
    beyond = subsets.n[subsets.minimum_norm]
    return int(beyond[0]) if beyond.size else None


def _summarise_rows(validation: HeuristicValidation) -> list[dict[str, Any]]:
    """Return errors and costs of all models of a heuristic, a row for every size."""
    parts = {
        "torque_error": _add_joints(validation.torque_error, validation.joint_torque_error),
        "acceleration_error": _add_joints(
            validation.acceleration_error, validation.joint_acceleration_error
        ),
        "operations": vars(validation.operations),
        "mass_matrix": vars(validation.mass_matrix),
    }

    def entry(part: str, key: str, values: Any) -> Any:
        """Return one quantity of one model as data for JSON."""
        if part == "operations":
            return _convert_count(values)
        return _summarise_range(ErrorRange.summarise(values)) if key == "test" else values

    return [
        {"n": n}
        | {
            part: {key: entry(part, key, column[k]) for key, column in columns.items()}
            for part, columns in parts.items()
        }
        for k, n in enumerate(validation.n)
    ]


def _add_joints(errors: SetErrors, joints: JointErrors) -> dict[str, FloatArray]:
    return vars(errors) | {f"joints_{name}": values for name, values in vars(joints).items()}


def _convert_count(operations: float) -> int | None:
    """Return a number of operations; None where it is not known."""
    return int(operations) if np.isfinite(operations) else None


def _convert(value: Any) -> Any:
    """Return data that JSON can hold."""
    if isinstance(value, dict):
        return {key: _convert(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [_convert(entry) for entry in value]
    if isinstance(value, np.ndarray):
        return _convert(value.tolist())
    if isinstance(value, np.bool_ | bool):
        return bool(value)
    if isinstance(value, np.integer):
        return int(value)
    if isinstance(value, float | np.floating):
        return float(value) if np.isfinite(value) else None
    return value
