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
    Model,
    ModelChoice,
    Provenance,
    Reduction,
    SetErrors,
    Subsets,
    TermFront,
    TermModel,
    TermReduction,
    Trajectories,
    Trajectory,
    Validation,
)


def summary_of(
    artifacts: Artifacts, leanest: Mapping[str, Leanest], provenance: Provenance
) -> dict[str, Any]:
    """Gather the numbers of all artifacts as plain data; infinite ones become None, and so do those
    that only a mechanism tells where there is none.
    """
    model, reduction, validation = artifacts.model, artifacts.reduction, artifacts.validation
    selected = validation.selected
    chosen = validation.heuristics[selected.heuristic]
    data = {
        "robot": provenance.robot,
        "config_sha256": provenance.config_sha256,
        "versions": dict(provenance.versions),
        "seconds": dict(provenance.seconds),
        "model": _brought(reduction) if model is None else _model(model),
        "trajectories": _trajectories(artifacts.trajectories),
        "reduction": {
            **{name: _subsets(reduction, found) for name, found in reduction.heuristics.items()},
            "proofs": _proofs(reduction),
            "pareto": [_pareto(reduction, validation, choice) for choice in validation.pareto],
        },
        "validation": {name: _rows(result) for name, result in validation.heuristics.items()},
        "full": dict(validation.full),
        "identification": _identification(artifacts.identification),
        "terms": _terms(model, artifacts.terms),
        "selected": {
            "heuristic": selected.heuristic,
            "n": selected.n,
            "reason": selected.reason,
            "parameters": dict(zip(selected.model.names, selected.model.values, strict=True)),
            "accepted": validation.accepted,
            "verdict": validation.verdict,
            "remarks": [r.text for r in validation.warnings if r.about is About.SELECTED],
            "leanest": _leanest(leanest),
            **next(row for row in _rows(chosen) if row["n"] == selected.n),
        },
        "stability": _stability(reduction, validation),
        "remarks": [warning.text for warning in validation.warnings],
    }
    plain: dict[str, Any] = _plain(data)
    return plain


def _leanest(found: Mapping[str, Leanest]) -> dict[str, Any]:
    return {
        name: {
            "model": one.model,
            "operations": one.operations,
            "torque_error": {
                **vars(one.torque_error),
                "test": _range(ErrorRange.summarise(one.torque_error.test)),
            },
        }
        for name, one in found.items()
    }


def _model(model: Model) -> dict[str, Any]:
    return {
        "n_dof": model.mechanism.n_dof,
        "n_parameters": model.values.size,
        "unmeasured": list(model.unmeasured),
        "n_affecting": int(model.affecting.sum()),
        "n_base": model.base.columns.size,
        "rank_gap": model.base.rank_gap,
        "names": list(model.mechanism.parameter_names),
    }


def _brought(reduction: Reduction) -> dict[str, Any]:
    """What an observation matrix tells of itself."""
    return {
        "n_dof": reduction.nominal_torque.size,
        "n_parameters": len(reduction.columns.names),
        "unmeasured": [],
        "n_affecting": reduction.n_affecting,
        "n_base": reduction.rank,
        "rank_gap": None,
        "names": list(reduction.columns.names),
    }


def _subsets(reduction: Reduction, found: Subsets) -> dict[str, Any]:
    def named(columns: IntArray) -> list[str]:
        return [reduction.columns.names[k] for k in columns]

    nested = found.order is not None
    return {
        "order": named(found.order) if found.order is not None else None,
        "subsets": None if nested else [named(subset) for subset in found.subsets],
        "n": found.n,
        "torque_error_1": found.torque_error_1,
        "torque_error_inf": found.torque_error_inf,
        "minimum_norm_from": _first(found),
        "seconds": found.seconds,
    }


def _proofs(reduction: Reduction) -> list[dict[str, Any]]:
    proofs = reduction.proofs
    if proofs is None:
        return []
    keys = ("n", "torque_error", "lower_bound", "status", "seconds")
    return [{key: getattr(proofs, key)[k] for key in keys} for k in range(proofs.n.size)]


def _pareto(reduction: Reduction, validation: Validation, choice: ModelChoice) -> dict[str, Any]:
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
            function: _whole(result.operations[function][row]) for function in ("inverse", "direct")
        },
    }


def _stability(reduction: Reduction, validation: Validation) -> dict[str, Any] | None:
    found = validation.stability
    if found is None:
        return None
    often = found.chosen.mean(axis=0)
    return {
        "variants": [str(variant) for variant in found.variants],
        "torque_error": found.torque_error,
        "share_chosen": {reduction.columns.names[k]: often[k] for k in np.flatnonzero(often)},
    }


def _identification(found: Identification | None) -> dict[str, Any] | None:
    if found is None:
        return None
    consistency = found.consistency
    full, reduced = (
        {
            "n": len(estimate.names),
            "train": estimate.train,
            "held_out": estimate.held_out,
            "joint_held_out": estimate.joint_held_out,
            "folds": estimate.folds,
            "values": dict(zip(estimate.names, estimate.values, strict=True)),
            "deviations": dict(zip(estimate.names, estimate.deviations, strict=True)),
        }
        for estimate in (found.full, found.reduced)
    )
    physical = consistency and {
        "train": consistency.train,
        "held_out": consistency.held_out,
        "bodies_positive": consistency.positive,
    }
    return {
        "estimator": found.estimator,
        "full": full,
        "reduced": reduced,
        "consistent": physical,
        "comparison": found.comparison,
        "hints": list(found.hints),
    }


def _terms(model: Model | None, found: TermReduction | None) -> list[dict[str, Any]]:
    """Functions with terms left out; empty where that was not asked for."""
    if model is None or found is None:
        return []
    return [
        {
            "function": name,
            "heuristic": one.heuristic,
            "n_start": one.n_start,
            "budget": {"torque": found.torque_budget, "acceleration": found.acceleration_budget},
            "held_out": found.held_out,
            "operations": one.operations,
            "operations_start": one.operations_start,
            **_errors(one),
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
                {"operations": count, **_errors(one.front, k)}
                for k, count in enumerate(one.front.operations)
            ],
        }
        for name, one in found.functions.items()
    ]


def _errors(of: TermModel | TermFront, row: int | None = None) -> dict[str, Any]:
    def errors_on(part: str, what: str) -> Any:
        value = getattr(of, f"{what}_error")[part]
        own = value if row is None else value[row]
        return _range(ErrorRange.summarise(own)) if part == "test" else own

    return {
        f"{what}_error": {part: errors_on(part, what) for part in SETS}
        for what in ("torque", "acceleration")
    }


def _range(errors: ErrorRange) -> dict[str, float] | None:
    """Return errors over the motions of the test set; None where it holds none, or where they are not known."""
    return None if np.isnan(errors.median) else errors._asdict()


def _trajectories(trajectories: Trajectories | None) -> dict[str, Any] | None:
    if trajectories is None:
        return None
    return {
        "criterion": trajectories.criterion,
        "scaling": trajectories.scaling,
        "constraints": [c.name for c in trajectories.constraints],
        "period": trajectories.period,
        **{name: [_trajectory(t) for t in getattr(trajectories, name)] for name in SETS},
        "test_point_to_point": [vars(motion) for motion in trajectories.test_point_to_point],
    }


def _trajectory(t: Trajectory) -> dict[str, Any]:
    return {**vars(t), "kappa_variants": dict(t.kappa_variants)}


def _first(found: Subsets) -> int | None:
    """The smallest size that is fitted with minimum norm."""
    beyond = found.n[found.minimum_norm]
    return int(beyond[0]) if beyond.size else None


def _rows(found: HeuristicValidation) -> list[dict[str, Any]]:
    parts = {
        "torque_error": _with_joints(found.torque_error, found.joint_torque_error),
        "acceleration_error": _with_joints(
            found.acceleration_error, found.joint_acceleration_error
        ),
        "operations": vars(found.operations),
        "mass_matrix": vars(found.mass_matrix),
    }

    def entry(part: str, key: str, own: Any) -> Any:
        if part == "operations":
            return _whole(own)
        return _range(ErrorRange.summarise(own)) if key == "test" else own

    return [
        {"n": n}
        | {
            part: {key: entry(part, key, column[k]) for key, column in columns.items()}
            for part, columns in parts.items()
        }
        for k, n in enumerate(found.n)
    ]


def _with_joints(errors: SetErrors, joints: JointErrors) -> dict[str, FloatArray]:
    return vars(errors) | {f"joints_{name}": values for name, values in vars(joints).items()}


def _whole(operations: float) -> int | None:
    """Return a number of operations; None where it is not known."""
    return int(operations) if np.isfinite(operations) else None


def _plain(value: Any) -> Any:
    """Data that JSON can hold."""
    if isinstance(value, dict):
        return {key: _plain(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(entry) for entry in value]
    if isinstance(value, np.ndarray):
        return _plain(value.tolist())
    if isinstance(value, np.bool_ | bool):
        return bool(value)
    if isinstance(value, np.integer):
        return int(value)
    if isinstance(value, float | np.floating):
        return float(value) if np.isfinite(value) else None
    return value
