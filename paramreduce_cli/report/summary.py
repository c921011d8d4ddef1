"""summary.json: the numbers that a regression job compares."""

from __future__ import annotations

from typing import Any

import numpy as np

from paramreduce_cli.records import (
    HeuristicValidation,
    Model,
    Provenance,
    Reduction,
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
            name: {
                "order": [reduction.names[k] for k in ordering.order],
                "n": ordering.n,
                "torque_error_1": ordering.torque_error_1,
                "torque_error_inf": ordering.torque_error_inf,
                "minimum_norm_from": _first(ordering.minimum_norm),
                "seconds": ordering.seconds,
            }
            for name, ordering in reduction.orderings.items()
        },
        "validation": {name: _rows(result) for name, result in validation.heuristics.items()},
        "full": dict(validation.full),
        "selected": {
            "heuristic": selected.heuristic,
            "n": selected.n,
            "parameters": dict(zip(selected.parameters, selected.values, strict=True)),
            "accepted": validation.accepted,
            "verdict": validation.verdict,
            **next(row for row in _rows(chosen) if row["n"] == selected.n),
        },
        "remarks": list(validation.remarks),
    }
    plain: dict[str, Any] = _plain(data)
    return plain


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
