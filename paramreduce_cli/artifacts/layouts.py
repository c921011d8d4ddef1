"""What stands where in each artifact: how every record is written and read.

docs/artifacts.md describes the same for people, with shapes and units.
"""

from __future__ import annotations

import dataclasses
import json
from typing import Any

import numpy as np

from paramreduce_cli.artifacts.hdf5 import Reader, Writer
from paramreduce_cli.records import (
    BaseParameters,
    Body,
    Closure,
    Constraint,
    Formulations,
    HeuristicValidation,
    Loops,
    Mechanism,
    Model,
    Proofs,
    Reduction,
    Selected,
    Stability,
    Subsets,
    Trajectories,
    Trajectory,
    Validation,
)


def mechanism_to_json(mechanism: Mechanism) -> str:
    """A mechanism as text."""

    def plain(value: Any) -> Any:
        return value.tolist() if isinstance(value, np.ndarray) else dict(value)

    return json.dumps(dataclasses.asdict(mechanism), default=plain)


def mechanism_from_json(text: str) -> Mechanism:
    """The inverse of :func:`mechanism_to_json`."""
    data = json.loads(text)
    bodies = tuple(
        Body(**{**b, "before": np.array(b["before"]), "after": np.array(b["after"])})
        for b in data.pop("bodies")
    )
    data["gravity"] = np.array(data["gravity"])
    data["table"] = tuple(tuple(row) for row in data["table"])
    loops = data.pop("loops")
    return Mechanism(bodies=bodies, loops=loops and _loops_from_json(loops), **data)


def _loops_from_json(data: dict[str, Any]) -> Loops:
    closures = tuple(
        Closure(
            **{
                **entry,
                "bodies": tuple(entry["bodies"]),
                "frames": tuple(np.array(frame) for frame in entry["frames"]),
            }
        )
        for entry in data["closures"]
    )
    return Loops(closures, tuple(data["independent"]), np.array(data["assembly"]))


def _constraints_to_json(constraints: tuple[Constraint, ...]) -> str:
    def plain(constraint: Constraint) -> dict[str, Any]:
        bounds = {
            key: value if np.isfinite(value) else None
            for key, value in (("lower", constraint.lower), ("upper", constraint.upper))
        }
        vectors = [vector.tolist() for vector in constraint.vectors]
        return {**dataclasses.asdict(constraint), "vectors": vectors, **bounds}

    return json.dumps([plain(constraint) for constraint in constraints], allow_nan=False)


def _constraints_from_json(text: str) -> tuple[Constraint, ...]:
    return tuple(
        Constraint(
            **{
                **entry,
                "bodies": tuple(entry["bodies"]),
                "vectors": tuple(np.array(vector) for vector in entry["vectors"]),
                "lower": -np.inf if entry["lower"] is None else entry["lower"],
                "upper": np.inf if entry["upper"] is None else entry["upper"],
            }
        )
        for entry in json.loads(text)
    )


def save_model(writer: Writer, model: Model) -> None:
    """model.h5"""
    mechanism, base = model.mechanism, model.base
    names = mechanism.parameter_names
    writer.dataset("parameters/names", names)
    writer.dataset("parameters/values", model.values)
    writer.dataset("parameters/affecting", model.affecting)
    writer.dataset("base/columns", base.columns)
    writer.dataset("base/beta", base.beta)
    writer.dataset("base/singular_values", base.singular_values)
    writer.dataset("base/rank_gap", base.rank_gap)
    writer.dataset("base/expressions", list(base.expressions))
    writer.dataset("coordinates/names", mechanism.coordinate_names)
    writer.dataset("coordinates/generalised", mechanism.generalised_names)
    writer.dataset("nominal_torque", model.nominal_torque)
    writer.dataset("nominal_torque_given", model.nominal_torque_given)
    writer.dataset("mechanism", mechanism_to_json(mechanism))
    writer.dataset("formulations", json.dumps(dataclasses.asdict(model.formulations)))


def load_model(reader: Reader) -> Model:
    """model.h5"""
    return Model(
        mechanism=mechanism_from_json(reader.text("mechanism")),
        values=reader.array("parameters/values", 1),
        affecting=reader.array("parameters/affecting", 1).astype(bool),
        base=BaseParameters(
            columns=reader.array("base/columns", 1),
            beta=reader.array("base/beta", 2),
            singular_values=reader.array("base/singular_values", 1),
            rank_gap=float(reader.array("base/rank_gap")),
            expressions=reader.texts("base/expressions"),
        ),
        nominal_torque=reader.array("nominal_torque", 1),
        nominal_torque_given=bool(reader.array("nominal_torque_given")),
        formulations=Formulations(
            **{
                name: tuple(tuple(choices) for choices in some)
                for name, some in json.loads(reader.text("formulations")).items()
            }
        ),
    )


_ARRAYS = ("peak_position", "peak_velocity", "reach", "extremes")
_SCALARS = ("kappa_start", "cpu_seconds", "iterations")


def save_trajectories(writer: Writer, trajectories: Trajectories) -> None:
    """trajectories.h5"""
    writer.attribute("period", trajectories.period)
    writer.attribute("criterion", trajectories.criterion)
    writer.attribute("scaling", trajectories.scaling)
    writer.dataset("constraints", _constraints_to_json(trajectories.constraints))
    save_trajectory_set(writer, "estimation", trajectories.estimation)
    save_trajectory_set(writer, "validation", trajectories.validation)


def save_trajectory_set(writer: Writer, name: str, items: tuple[Trajectory, ...]) -> None:
    """One group of trajectories."""
    writer.dataset(f"{name}/coefficients", np.array([t.coefficients for t in items]))
    writer.dataset(f"{name}/condition_number", [t.kappa for t in items])
    writer.dataset(f"{name}/scalings", list(items[0].kappa_variants))
    for variant in items[0].kappa_variants:
        values = [t.kappa_variants[variant] for t in items]
        writer.dataset(f"{name}/condition_number_variants/{variant}", values)
    for key in (*_ARRAYS, "kappa_start", "iterations"):
        writer.dataset(f"{name}/{key}", np.array([getattr(t, key) for t in items]))
    writer.timing(f"{name}/cpu_seconds", [t.cpu_seconds for t in items])
    writer.dataset(f"{name}/status", [t.status for t in items])


def load_trajectories(reader: Reader) -> Trajectories:
    """trajectories.h5"""
    return Trajectories(
        period=float(reader.attribute("period")),
        criterion=str(reader.attribute("criterion")),
        scaling=str(reader.attribute("scaling")),
        constraints=_constraints_from_json(reader.text("constraints")),
        estimation=load_trajectory_set(reader, "estimation"),
        validation=load_trajectory_set(reader, "validation"),
    )


def load_trajectory_set(reader: Reader, name: str) -> tuple[Trajectory, ...]:
    """One group of trajectories."""
    coefficients = reader.array(f"{name}/coefficients", 3)
    kappa = reader.array(f"{name}/condition_number", 1)
    variants = {
        key: reader.array(f"{name}/condition_number_variants/{key}", 1)
        for key in reader.texts(f"{name}/scalings")
    }
    columns = {key: reader.array(f"{name}/{key}") for key in _ARRAYS + _SCALARS}
    status = reader.texts(f"{name}/status")
    return tuple(
        Trajectory(
            coefficients=coefficients[k],
            kappa=float(kappa[k]),
            kappa_variants={key: float(values[k]) for key, values in variants.items()},
            **{key: columns[key][k] for key in _ARRAYS},
            kappa_start=float(columns["kappa_start"][k]),
            cpu_seconds=float(columns["cpu_seconds"][k]),
            iterations=int(columns["iterations"][k]),
            status=status[k],
        )
        for k in range(coefficients.shape[0])
    )


_ERRORS = ("torque_error", "torque_error_1", "torque_error_inf", "minimum_norm")


def save_reduction(writer: Writer, reduction: Reduction) -> None:
    """reduction.h5"""
    writer.dataset("parameters/names", reduction.names)
    writer.dataset("parameters/expansion", reduction.expansion)
    writer.dataset("nominal_torque", reduction.nominal_torque)
    writer.dataset("rank", reduction.rank)
    writer.dataset("factor", reduction.factor)
    writer.dataset("heuristics", list(reduction.heuristics))
    for name, found in reduction.heuristics.items():
        if found.order is not None:
            writer.dataset(f"{name}/order", found.order)
        writer.dataset(f"{name}/n", found.n)
        for key in _ERRORS:
            writer.dataset(f"{name}/{key}", getattr(found, key))
        for k, n in enumerate(found.n):
            if found.order is None:
                writer.dataset(f"{name}/subsets/{n}", found.subsets[k])
            writer.dataset(f"{name}/parameters/{n}", found.parameters[k])
            writer.dataset(f"{name}/beta/{n}", found.beta[k])
        writer.timing(f"{name}/seconds", found.seconds)
    if reduction.proofs is not None:
        _save_proofs(writer, reduction.proofs)


def _save_proofs(writer: Writer, proofs: Proofs) -> None:
    for key in ("n", "torque_error", "lower_bound", "nodes"):
        writer.dataset(f"proofs/{key}", getattr(proofs, key))
    writer.dataset("proofs/status", list(proofs.status))
    writer.dataset("proofs/units/columns", np.concatenate(proofs.units))
    writer.dataset("proofs/units/sizes", np.array([unit.size for unit in proofs.units]))
    for n, subset, log in zip(proofs.n, proofs.subsets, proofs.logs, strict=True):
        writer.dataset(f"proofs/subsets/{n}", subset)
        writer.dataset(f"proofs/logs/{n}", log)
    writer.timing("proofs/seconds", proofs.seconds)


def load_reduction(reader: Reader) -> Reduction:
    """reduction.h5"""
    return Reduction(
        names=reader.texts("parameters/names"),
        expansion=reader.array("parameters/expansion", 2),
        nominal_torque=reader.array("nominal_torque", 1),
        rank=int(reader.array("rank")),
        factor=reader.array("factor", 2),
        heuristics={name: _load_subsets(reader, name) for name in reader.texts("heuristics")},
        proofs=_load_proofs(reader) if "proofs/n" in reader else None,
    )


def _load_subsets(reader: Reader, name: str) -> Subsets:
    sizes = reader.array(f"{name}/n", 1)
    if f"{name}/order" in reader:
        order = reader.array(f"{name}/order", 1)
        subsets = tuple(order[:n] for n in sizes)
    else:
        subsets = tuple(reader.array(f"{name}/subsets/{n}", 1) for n in sizes)
    return Subsets(
        heuristic=name,
        subsets=subsets,
        n=sizes,
        torque_error=reader.array(f"{name}/torque_error", 1),
        torque_error_1=reader.array(f"{name}/torque_error_1", 1),
        torque_error_inf=reader.array(f"{name}/torque_error_inf", 1),
        parameters=tuple(reader.array(f"{name}/parameters/{n}", 1) for n in sizes),
        beta=tuple(reader.array(f"{name}/beta/{n}", 2) for n in sizes),
        minimum_norm=reader.array(f"{name}/minimum_norm", 1).astype(bool),
        seconds=float(reader.array(f"{name}/seconds")),
    )


def _load_proofs(reader: Reader) -> Proofs:
    sizes = reader.array("proofs/n", 1)
    ends = np.cumsum(reader.array("proofs/units/sizes", 1))[:-1]
    return Proofs(
        units=tuple(np.split(reader.array("proofs/units/columns", 1), ends)),
        n=sizes,
        subsets=tuple(reader.array(f"proofs/subsets/{n}", 1) for n in sizes),
        torque_error=reader.array("proofs/torque_error", 1),
        lower_bound=reader.array("proofs/lower_bound", 1),
        status=reader.texts("proofs/status"),
        seconds=reader.array("proofs/seconds", 1),
        nodes=reader.array("proofs/nodes", 1),
        logs=tuple(reader.array(f"proofs/logs/{n}", 1) for n in sizes),
    )


_STABILITY = ("chosen", "values", "torque_error")


def save_validation(writer: Writer, validation: Validation) -> None:
    """validation.h5"""
    writer.dataset("heuristics", list(validation.heuristics))
    for name, result in validation.heuristics.items():
        for field in dataclasses.fields(result):
            writer.dataset(f"{name}/{field.name}", getattr(result, field.name))
    writer.dataset("full/names", list(validation.full))
    writer.dataset("full/values", np.array(list(validation.full.values()), dtype=float))
    writer.dataset("nominal_acceleration", validation.nominal_acceleration)
    selected = validation.selected
    writer.dataset("selected/heuristic", selected.heuristic)
    writer.dataset("selected/n", selected.n)
    writer.dataset("selected/parameters", selected.parameters)
    writer.dataset("selected/values", selected.values)
    writer.dataset("selected/expressions", selected.expressions)
    writer.dataset("selected/reason", selected.reason)
    writer.dataset("selected/missed", selected.missed)
    writer.dataset("pareto/heuristic", np.array([name for name, _ in validation.pareto], dtype=str))
    writer.dataset("pareto/n", np.array([n for _, n in validation.pareto], dtype=np.int64))
    if validation.stability is not None:
        writer.dataset("stability/variants", list(validation.stability.variants))
        for key in _STABILITY:
            writer.dataset(f"stability/{key}", getattr(validation.stability, key))
    writer.dataset("accepted", validation.accepted)
    writer.dataset("verdict", validation.verdict)
    writer.dataset("remarks", np.array(validation.remarks, dtype=str))


def _load_stability(reader: Reader) -> Stability:
    arrays = {key: reader.array(f"stability/{key}") for key in _STABILITY}
    arrays["chosen"] = arrays["chosen"].astype(bool)
    return Stability(variants=reader.texts("stability/variants"), **arrays)


def load_validation(reader: Reader) -> Validation:
    """validation.h5"""
    heuristics = {
        name: HeuristicValidation(
            **{
                field.name: reader.array(f"{name}/{field.name}")
                for field in dataclasses.fields(HeuristicValidation)
            }
        )
        for name in reader.texts("heuristics")
    }
    values = reader.array("full/values", 1)
    names = reader.texts("full/names")
    return Validation(
        heuristics=heuristics,
        full={name: float(value) for name, value in zip(names, values, strict=True)},
        nominal_acceleration=reader.array("nominal_acceleration", 1),
        selected=Selected(
            heuristic=reader.text("selected/heuristic"),
            n=int(reader.array("selected/n")),
            parameters=reader.texts("selected/parameters"),
            values=reader.array("selected/values", 1),
            expressions=reader.texts("selected/expressions"),
            reason=reader.text("selected/reason"),
            missed=reader.text("selected/missed"),
        ),
        pareto=tuple(
            (name, int(n))
            for name, n in zip(
                reader.texts("pareto/heuristic"), reader.array("pareto/n", 1), strict=True
            )
        ),
        stability=_load_stability(reader) if "stability/variants" in reader else None,
        accepted=bool(reader.array("accepted")),
        verdict=reader.text("verdict"),
        remarks=reader.texts("remarks"),
    )
