"""summary.json: the numbers that a regression job compares."""

from __future__ import annotations

from typing import Any

import numpy as np

from paramreduce_cli.records import (
    HeuristicValidation,
    IntArray,
    Model,
    Provenance,
    Reduction,
    Subsets,
    Trajectories,
    Trajectory,
    Validation,
)


def summary_of(
    model: Model,
    trajectories: Trajectories | None,
    reduction: Reduction,
    validation: Validation,
    provenance: Provenance,
) -> dict[str, Any]:
    """Gather the numbers of all artifacts as plain data; infinite ones become None."""
    selected = validation.selected
    chosen = validation.heuristics[selected.heuristic]
    data = {
        "robot": provenance.robot,
        "config_sha256": provenance.config_sha256,
        "versions": dict(provenance.versions),
        "seconds": dict(provenance.seconds),
        "model": {
            "n_dof": model.mechanism.n_dof,
            "n_parameters": model.values.size,
            "n_affecting": int(model.affecting.sum()),
            "n_base": model.base.columns.size,
            "rank_gap": model.base.rank_gap,
            "names": list(model.mechanism.parameter_names),
        },
        "trajectories": _trajectories(trajectories),
        "reduction": {
            **{name: _subsets(reduction, found) for name, found in reduction.heuristics.items()},
            "proofs": _proofs(reduction),
            "pareto": [_pareto(reduction, validation, *model) for model in validation.pareto],
        },
        "validation": {name: _rows(result) for name, result in validation.heuristics.items()},
        "full": dict(validation.full),
        "selected": {
            "heuristic": selected.heuristic,
            "n": selected.n,
            "reason": selected.reason,
            "parameters": dict(zip(selected.parameters, selected.values, strict=True)),
            "accepted": validation.accepted,
            "verdict": validation.verdict,
            **next(row for row in _rows(chosen) if row["n"] == selected.n),
        },
        "stability": _stability(reduction, validation),
        "remarks": list(validation.remarks),
    }
    plain: dict[str, Any] = _plain(data)
    return plain


def _subsets(reduction: Reduction, found: Subsets) -> dict[str, Any]:
    def named(columns: IntArray) -> list[str]:
        return [reduction.names[k] for k in columns]

    nested = found.order is not None
    return {
        "order": named(found.order) if found.order is not None else None,
        "subsets": None if nested else [named(subset) for subset in found.subsets],
        "n": found.n,
        "torque_error_1": found.torque_error_1,
        "torque_error_inf": found.torque_error_inf,
        "minimum_norm_from": _first(found.minimum_norm),
        "seconds": found.seconds,
    }


def _proofs(reduction: Reduction) -> list[dict[str, Any]]:
    proofs = reduction.proofs
    if proofs is None:
        return []
    return [
        {
            "n": n,
            "torque_error": proofs.torque_error[k],
            "lower_bound": proofs.lower_bound[k],
            "status": proofs.status[k],
            "seconds": proofs.seconds[k],
        }
        for k, n in enumerate(proofs.n)
    ]


def _pareto(reduction: Reduction, validation: Validation, heuristic: str, n: int) -> dict[str, Any]:
    result = validation.heuristics[heuristic]
    row = result.row(n)
    subset = reduction.heuristics[heuristic].subset(n)
    return {
        "heuristic": heuristic,
        "parameters": [reduction.names[k] for k in subset],
        "n": n,
        "torque_error": result.torque_error_estimation[row],
        "acceleration_error": result.acceleration_error_estimation[row],
        "operations": {
            "inverse": result.operations_inverse[row],
            "direct": result.operations_direct[row],
        },
    }


def _stability(reduction: Reduction, validation: Validation) -> dict[str, Any] | None:
    found = validation.stability
    if found is None:
        return None
    often = found.chosen.mean(axis=0)
    return {
        "variants": list(found.variants),
        "torque_error": found.torque_error,
        "share_chosen": {reduction.names[k]: often[k] for k in np.flatnonzero(often)},
    }


def _trajectories(trajectories: Trajectories | None) -> dict[str, Any] | None:
    if trajectories is None:
        return None
    return {
        "criterion": trajectories.criterion,
        "scaling": trajectories.scaling,
        "constraints": [c.name for c in trajectories.constraints],
        "period": trajectories.period,
        "estimation": [_trajectory(t) for t in trajectories.estimation],
        "validation": [_trajectory(t) for t in trajectories.validation],
    }


def _trajectory(t: Trajectory) -> dict[str, Any]:
    return {
        "kappa_start": t.kappa_start,
        "kappa": t.kappa,
        "kappa_variants": dict(t.kappa_variants),
        "peak_position": t.peak_position,
        "peak_velocity": t.peak_velocity,
        "reach": t.reach,
        "extremes": t.extremes,
        "cpu_seconds": t.cpu_seconds,
        "iterations": t.iterations,
        "status": t.status,
        "coefficients": t.coefficients,
    }


def _first(flags: np.ndarray) -> int | None:
    """The first n at which a flag is set."""
    return int(np.argmax(flags)) + 1 if flags.any() else None


def _rows(r: HeuristicValidation) -> list[dict[str, Any]]:
    return [
        {
            "n": int(r.n[k]),
            "torque_error": {
                "estimation": r.torque_error_estimation[k],
                "validation": r.torque_error_validation[k],
                "joints_estimation": r.torque_error_joint_estimation[k],
                "joints_validation": r.torque_error_joint_validation[k],
            },
            "acceleration_error": {
                "estimation": r.acceleration_error_estimation[k],
                "validation": r.acceleration_error_validation[k],
                "joints_estimation": r.acceleration_error_joint_estimation[k],
                "joints_validation": r.acceleration_error_joint_validation[k],
            },
            "operations": {
                "inverse": int(r.operations_inverse[k]),
                "direct": int(r.operations_direct[k]),
                "inverse_plain": int(r.operations_inverse_plain[k]),
                "direct_plain": int(r.operations_direct_plain[k]),
                "inverse_paper_rule": int(r.operations_inverse_paper_rule[k]),
                "direct_paper_rule": int(r.operations_direct_paper_rule[k]),
            },
            "mass_matrix": {
                "condition": r.mass_matrix_condition[k],
                "smallest_eigenvalue": r.mass_matrix_smallest_eigenvalue[k],
            },
        }
        for k in range(r.n.size)
    ]


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
