"""What stands where in each artifact: how every record is written and read.

docs/artifacts.md describes the same for people, with shapes and units.
"""

from __future__ import annotations

import dataclasses
import itertools
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from paramreduce_cli.artifacts.hdf5 import Reader, Writer, reading
from paramreduce_cli.errors import ArtifactError
from paramreduce_cli.multibody.observation import BLOCK_SAMPLES, FactorAccumulator, joint_factors
from paramreduce_cli.records import (
    BaseParameters,
    Block,
    Body,
    FloatArray,
    HeuristicValidation,
    Mechanism,
    Model,
    Ordering,
    Reduction,
    Samples,
    SampleSet,
    Selected,
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
    return Mechanism(bodies=bodies, **data)


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
    writer.dataset("nominal_torque", model.nominal_torque)
    writer.dataset("nominal_torque_given", model.nominal_torque_given)
    writer.dataset("mechanism", mechanism_to_json(mechanism))


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
    )


_PER_JOINT = ("peak_position", "peak_velocity", "reach")
_SCALARS = ("kappa_start", "cpu_seconds", "iterations")


def save_trajectories(writer: Writer, trajectories: Trajectories) -> None:
    """trajectories.h5"""
    writer.attribute("period", trajectories.period)
    writer.attribute("criterion", trajectories.criterion)
    writer.attribute("scaling", trajectories.scaling)
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
    for key in _PER_JOINT + _SCALARS:
        writer.dataset(f"{name}/{key}", np.array([getattr(t, key) for t in items]))
    writer.dataset(f"{name}/status", [t.status for t in items])


def load_trajectories(reader: Reader) -> Trajectories:
    """trajectories.h5"""
    return Trajectories(
        period=float(reader.attribute("period")),
        criterion=str(reader.attribute("criterion")),
        scaling=str(reader.attribute("scaling")),
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
    columns = {key: reader.array(f"{name}/{key}") for key in _PER_JOINT + _SCALARS}
    status = reader.texts(f"{name}/status")
    return tuple(
        Trajectory(
            coefficients=coefficients[k],
            kappa=float(kappa[k]),
            kappa_variants={key: float(values[k]) for key, values in variants.items()},
            **{key: columns[key][k] for key in _PER_JOINT},
            kappa_start=float(columns["kappa_start"][k]),
            cpu_seconds=float(columns["cpu_seconds"][k]),
            iterations=int(columns["iterations"][k]),
            status=status[k],
        )
        for k in range(coefficients.shape[0])
    )


def save_samples(writer: Writer, samples: Samples) -> None:
    """samples.h5, block by block."""
    writer.dataset("parameters/names", samples.names)
    for name in ("values", "nominal_torque", "nominal_acceleration"):
        value = getattr(samples, name)
        if value is not None:
            writer.dataset("parameters/values" if name == "values" else name, value)
    save_sample_set(writer, "estimation", samples.estimation)
    if samples.validation is not None:
        save_sample_set(writer, "validation", samples.validation)


_STATES = ("z", "dz", "ddz", "tau")


def save_sample_set(writer: Writer, name: str, sample_set: SampleSet) -> None:
    """One set; its triangular factors are collected on the way."""
    accumulator = FactorAccumulator()
    appenders: dict[str, Any] = {}
    for block in sample_set.blocks():
        if not appenders:
            n_dof = block.tau.shape[1]
            appenders = {key: writer.rows(f"{name}/{key}", n_dof) for key in _STATES}
            appenders["time"] = writer.rows(f"{name}/time", None)
            appenders["trajectory"] = writer.rows(f"{name}/trajectory", None)
            appenders["W"] = writer.rows(f"{name}/W", block.W.shape[1])
        for key in (*_STATES, "time", "W"):
            appenders[key](getattr(block, key))
        appenders["trajectory"](np.full(block.time.size, float(block.trajectory)))
        accumulator.add(block)
    writer.dataset(f"{name}/factors", accumulator.result())


class StoredSet:
    """A sample set in a file, read in slices.

    Raises:
        ArtifactError: W and tau do not fit each other, or hold numbers that are not finite.
    """

    def __init__(self, path: Path, name: str, n_parameters: int) -> None:
        self._path, self._name = path, name
        with reading(path) as reader:
            W, tau = reader.rows(f"{name}/W"), reader.rows(f"{name}/tau")
            if W.ndim != 2 or tau.ndim != 2 or W.shape[0] != tau.shape[0] * tau.shape[1]:
                raise ArtifactError(
                    f"{path}: /{name}/W has shape {W.shape} and /{name}/tau {tau.shape}; W needs "
                    "one row per sample and joint, (n_samples * n_dof, n_parameters)."
                )
            if W.shape[1] != n_parameters:
                raise ArtifactError(
                    f"{path}: /{name}/W has {W.shape[1]} columns for {n_parameters} parameters."
                )
            self.n_samples, self.n_dof = tau.shape
            self._has_states = all(f"{name}/{key}" in reader for key in ("z", "dz", "ddz"))

    def blocks(self) -> Iterator[Block]:
        """Yield the samples in order; every call starts anew."""
        with reading(self._path) as reader:
            base = self._name
            W, tau = reader.rows(f"{base}/W"), reader.rows(f"{base}/tau")
            owner = self._column(reader, "trajectory")
            time = self._column(reader, "time")
            for start, stop in _slices(owner, BLOCK_SAMPLES):
                tau_block = tau[start:stop]
                W_block = W[start * self.n_dof : stop * self.n_dof]
                if not (np.isfinite(tau_block).all() and np.isfinite(W_block).all()):
                    raise ArtifactError(
                        f"{self._path}: /{base} holds numbers that are not finite between samples "
                        f"{start} and {stop}. Remove those samples."
                    )
                z, dz, ddz = self._states(reader, start, stop)
                yield Block(int(owner[start]), time[start:stop], z, dz, ddz, tau_block, W_block)

    def _states(self, reader: Reader, start: int, stop: int) -> list[FloatArray]:
        if not self._has_states:
            return [np.full((stop - start, self.n_dof), np.nan)] * 3
        return [reader.rows(f"{self._name}/{key}")[start:stop] for key in ("z", "dz", "ddz")]

    def _column(self, reader: Reader, key: str) -> FloatArray:
        name = f"{self._name}/{key}"
        return reader.array(name, 1) if name in reader else np.zeros(self.n_samples)

    def factors(self) -> FloatArray:
        """Triangular factors per trajectory and joint, stored or computed."""
        with reading(self._path) as reader:
            if f"{self._name}/factors" in reader:
                return reader.array(f"{self._name}/factors", 4)
        return joint_factors(self.blocks())


def _slices(owner: FloatArray, most: int) -> Iterator[tuple[int, int]]:
    """Consecutive ranges of samples, none longer than ``most`` or over two trajectories."""
    edges = [0, *(np.flatnonzero(np.diff(owner)) + 1).tolist(), owner.size]
    for first, last in itertools.pairwise(edges):
        for start in range(first, last, most):
            yield start, min(start + most, last)


def load_samples(reader: Reader) -> Samples:
    """samples.h5, the project's own or one that a user brings."""
    W = reader.rows("estimation/W")
    if W.ndim != 2:
        raise ArtifactError(f"{reader.path}: /estimation/W must be a matrix.")
    n = W.shape[1]
    if "parameters/names" in reader:
        names = reader.texts("parameters/names")
        if len(names) != n or len(set(names)) != n:
            raise ArtifactError(
                f"{reader.path}: /parameters/names must hold {n} different names, one per column "
                "of W."
            )
    else:
        names = tuple(f"p{k + 1}" for k in range(n))
    estimation = StoredSet(reader.path, "estimation", n)
    has_validation = "validation/W" in reader
    validation = StoredSet(reader.path, "validation", n) if has_validation else None
    return Samples(
        names=names,
        values=_optional(reader, "parameters/values", n),
        nominal_torque=_optional(reader, "nominal_torque", estimation.n_dof),
        nominal_acceleration=_optional(reader, "nominal_acceleration", estimation.n_dof),
        estimation=estimation,
        validation=validation,
    )


def _optional(reader: Reader, name: str, size: int) -> FloatArray | None:
    if name not in reader:
        return None
    value = reader.array(name, 1)
    if value.size != size or not np.isfinite(value).all():
        raise ArtifactError(f"{reader.path}: /{name} must hold {size} finite numbers.")
    return value


_ERRORS = ("torque_error", "torque_error_1", "torque_error_inf", "minimum_norm")


def save_reduction(writer: Writer, reduction: Reduction) -> None:
    """reduction.h5"""
    writer.dataset("parameters/names", reduction.names)
    writer.dataset("nominal_torque", reduction.nominal_torque)
    writer.dataset("rank", reduction.rank)
    writer.dataset("factor", reduction.factor)
    writer.dataset("heuristics", list(reduction.orderings))
    for name, ordering in reduction.orderings.items():
        writer.dataset(f"{name}/order", ordering.order)
        for key in _ERRORS:
            writer.dataset(f"{name}/{key}", getattr(ordering, key))
        for n, values in enumerate(ordering.parameters, start=1):
            writer.dataset(f"{name}/parameters/{n}", values)
            writer.dataset(f"{name}/beta/{n}", ordering.beta[n - 1])
        writer.dataset(f"{name}/seconds", ordering.seconds)


def load_reduction(reader: Reader) -> Reduction:
    """reduction.h5"""
    orderings = {}
    for name in reader.texts("heuristics"):
        order = reader.array(f"{name}/order", 1)
        orderings[name] = Ordering(
            heuristic=name,
            order=order,
            torque_error=reader.array(f"{name}/torque_error", 1),
            torque_error_1=reader.array(f"{name}/torque_error_1", 1),
            torque_error_inf=reader.array(f"{name}/torque_error_inf", 1),
            parameters=tuple(
                reader.array(f"{name}/parameters/{n}", 1) for n in range(1, order.size + 1)
            ),
            beta=tuple(reader.array(f"{name}/beta/{n}", 2) for n in range(1, order.size + 1)),
            minimum_norm=reader.array(f"{name}/minimum_norm", 1).astype(bool),
            seconds=float(reader.array(f"{name}/seconds")),
        )
    return Reduction(
        names=reader.texts("parameters/names"),
        nominal_torque=reader.array("nominal_torque", 1),
        rank=int(reader.array("rank")),
        factor=reader.array("factor", 2),
        orderings=orderings,
    )


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
    writer.dataset("accepted", validation.accepted)
    writer.dataset("verdict", validation.verdict)
    writer.dataset("remarks", np.array(validation.remarks, dtype=str))


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
        ),
        accepted=bool(reader.array("accepted")),
        verdict=reader.text("verdict"),
        remarks=reader.texts("remarks"),
    )
