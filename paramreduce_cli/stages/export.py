"""export: a reduced model as code, checked against the straightforward one."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from paramreduce_cli import __version__
from paramreduce_cli.errors import ConfigError, FormulationError, ParamreduceWarning
from paramreduce_cli.export.exported import ExportedModel, Parameter
from paramreduce_cli.expressions.functions import Function
from paramreduce_cli.lean.functions import LeanFunctions
from paramreduce_cli.multibody.coordinates import Coordinates
from paramreduce_cli.multibody.dynamics import Dynamics
from paramreduce_cli.multibody.random_states import random_states
from paramreduce_cli.multibody.relations import approximate_expressions
from paramreduce_cli.records import FloatArray, Model, Reduction, Validation
from paramreduce_cli.registry import exporter
from paramreduce_cli.stages.counting import kept_and_owner

WHAT = {
    "idm": ("inverse",),
    "ddm": ("direct",),
    "both": ("inverse", "direct"),
    "regressor": ("regressor",),
}
"""Functions of each kind of export."""

_CASES = 16
"""States in the self-test."""
_CHECKED = 200
"""States on which the functions are checked before they are written."""
_TOLERANCE = 1e-10
_EXACT = 1e-10
"""Torque error below which nothing but round-off is left of it."""
_SINGULAR = 1e-10
_GUESS = 0.01
"""How far off the guesses of the position problem are in the self-test, rad or m."""
_LOOPS = {"z", "dz", "ddz", "guess", "q", "dq", "ddq", "R", "b"}
"""What the position, velocity and acceleration problems take and give."""
_UNITS = {"m": "kg", "mx": "kg m", "my": "kg m", "mz": "kg m"}


@dataclass(frozen=True)
class Chosen:
    """A model to be exported.

    Attributes:
        title: What it is called.
        names: Of its parameters.
        values: Of these, in SI units.
        expressions: What each of them is made of.
        expansion: Standard parameters from the values, (n_standard, n).
    """

    title: str
    names: tuple[str, ...]
    values: FloatArray
    expressions: tuple[str, ...]
    expansion: FloatArray


def chosen_model(
    text: str | None, model: Model, reduction: Reduction | None, validation: Validation | None
) -> Chosen:
    """The model that is asked for.

    Args:
        text: ``full``, ``base`` or ``HEURISTIC:N``; None for the selected one.
        model: Of the robot.
        reduction: Where reduced models are; not needed for ``full`` and ``base``.
        validation: Says which one is selected.

    Raises:
        ConfigError: There is none of that name.
    """
    names = model.mechanism.parameter_names
    unit = np.eye(len(names))
    if text == "full":
        kept = np.flatnonzero(model.affecting)
        own = tuple(names[k] for k in kept)
        return Chosen("full model", own, model.values[kept], own, unit[:, kept])
    if text == "base":
        columns = model.base.columns
        others = np.setdiff1d(np.arange(len(names)), columns)
        values = model.values[columns] + model.base.beta @ model.values[others]
        own = tuple(names[k] for k in columns)
        return Chosen("base parameters", own, values, model.base.expressions, unit[:, columns])
    assert reduction is not None
    if text is None:
        assert validation is not None
        heuristic, size = validation.selected.heuristic, validation.selected.n
    else:
        heuristic, _, number = text.partition(":")
        size = int(number) if number.isdigit() else -1
    found = reduction.heuristics.get(heuristic)
    row = None if found is None else found.row(size)
    if found is None or row is None:
        known = ", ".join(f"{name}:1...{s.n[-1]}" for name, s in reduction.heuristics.items())
        raise ConfigError(f"--model {text}: there is full, base, {known}.")
    subset = found.subsets[row]
    expressions = approximate_expressions(
        reduction.names,
        subset,
        found.beta[row],
        np.linalg.pinv(reduction.expansion) @ model.values,
    )
    return Chosen(
        f"{heuristic} with {size} parameters, {_error_text(float(found.torque_error[row]))} on the "
        "estimation set",
        tuple(reduction.names[k] for k in subset),
        found.parameters[row],
        tuple(expressions),
        reduction.expansion[:, subset],
    )


def _error_text(error: float) -> str:
    return "exact" if error < _EXACT else f"torque error {100 * error:.3g} %"


def export(
    model: Model,
    chosen: Chosen,
    *,
    kind: str,
    what: str,
    constant: bool,
    single: bool,
    origin: str = "",
) -> dict[str, bytes]:
    """Files of a model in some language.

    Args:
        model: Of the robot.
        chosen: The model that is exported.
        kind: Name of the exporter.
        what: Of :data:`WHAT`.
        constant: Whether the values of the parameters are part of the code.
        single: Whether numbers have single precision.
        origin: Of the model, for the comment that opens every file.

    Raises:
        FormulationError: The functions do not compute what the straightforward model does.
    """
    mechanism = model.mechanism
    functions = exported_functions(model, chosen, what, constant=constant)
    closures: tuple[Function, ...] = ()
    if mechanism.loops is not None:
        closures = tuple(_functions_of(model, chosen, constant=constant).closures())
    rng = np.random.default_rng(0)
    checked = cases(model, chosen, _CHECKED, rng)
    check(functions, checked)
    if closures:
        _check_closures(closures, checked)
    unsafe = _unsafe(checked["M"]) if "direct" in WHAT[what] else ""
    if unsafe:
        warnings.warn(f"{chosen.title}: {unsafe}", ParamreduceWarning, stacklevel=2)
    used = {a.name for f in functions for a in (*f.arguments, *f.results)}
    if mechanism.loops is not None:
        used |= _LOOPS
    stored = cases(model, chosen, _CASES, rng)
    exported = ExportedModel(
        robot=mechanism.robot,
        heading=(
            f"{mechanism.robot}: {chosen.title}.",
            *([f"NOT SAFE FOR DIRECT DYNAMICS: {unsafe}."] if unsafe else []),
            "Gravity in the base frame, m/s^2: " + " ".join(f"{g:.6g}" for g in mechanism.gravity),
            f"Made by paramreduce {__version__} ({origin}).",
        ),
        coordinates=mechanism.generalised_names,
        units=tuple("rad" if b.joint == "revolute" else "m" for b in mechanism.bodies),
        independent=np.array(mechanism.independent, dtype=np.int64),
        parameters=tuple(
            Parameter(name, float(value), _UNITS.get(name.split("_", 1)[0], "kg m^2"), expression)
            for name, value, expression in zip(
                chosen.names, chosen.values, chosen.expressions, strict=True
            )
        ),
        constant=constant,
        functions=functions,
        closures=closures,
        single=single,
        cases={name: values for name, values in stored.items() if name in used},
    )
    files: dict[str, bytes] = exporter[kind](exported)
    return files


def _unsafe(M: FloatArray) -> str:
    """What is wrong with the mass matrices of random states; empty if nothing is."""
    values = np.linalg.eigvalsh(M)
    bad = int(np.sum(values[:, 0] <= _SINGULAR * np.abs(values).max()))
    if not bad:
        return ""
    return f"M is singular or not positive definite on {bad} of {len(M)} random states"


def exported_functions(
    model: Model, chosen: Chosen, what: str, *, constant: bool
) -> tuple[Function, ...]:
    """Functions of a model.

    Args:
        model: Of the robot.
        chosen: The model.
        what: Of :data:`WHAT`.
        constant: Whether the values of the parameters are part of them.
    """
    lean = _functions_of(model, chosen, constant=constant)
    return tuple(getattr(lean, name)() for name in WHAT[what])


def _functions_of(model: Model, chosen: Chosen, *, constant: bool) -> LeanFunctions:
    kept, owner = kept_and_owner(model, chosen.expansion)
    values = tuple(float(v) for v in chosen.values)
    return LeanFunctions(
        model.mechanism, model.formulations, kept, owner, values, constant=constant
    )


def cases(
    model: Model, chosen: Chosen, count: int, rng: np.random.Generator
) -> dict[str, FloatArray]:
    """Random states with the results of plain recursion, by the names of the functions' arrays.

    Args:
        model: Of the robot.
        chosen: The model.
        count: Number of states.
        rng: Where they come from.
    """
    mechanism = model.mechanism
    q, dq, ddq = random_states(mechanism, count, rng)
    plain = Dynamics(mechanism, once=True)
    phi = chosen.expansion @ chosen.values
    A, B = plain.direct_regressor(q, dq)
    K = plain.regressor(q, dq, ddq)
    result = {
        "phi": np.tile(chosen.values, (count, 1)),
        "q": q,
        "dq": dq,
        "ddq": ddq,
        "tau": K @ phi,
        "M": A @ phi,
        "delta": B @ phi,
        "K": K @ chosen.expansion,
    }
    if mechanism.loops is None:
        return result
    dependent, independent = list(mechanism.dependent), list(mechanism.independent)
    R = Coordinates(mechanism, once=True).tangent(q)[:, dependent]
    b = ddq[:, dependent] - np.einsum("kij,kj->ki", R, ddq[:, independent])
    guess = q.copy()
    guess[:, dependent] += rng.uniform(-_GUESS, _GUESS, size=(count, len(dependent)))
    z = {name: result[name][:, independent] for name in ("q", "dq", "ddq")}
    loops = {"z": z["q"], "dz": z["dq"], "ddz": z["ddq"], "guess": guess, "R": R, "b": b}
    return result | loops


def check(
    functions: tuple[Function, ...],
    stored: Mapping[str, FloatArray],
    tolerance: float = _TOLERANCE,
) -> None:
    """Compare functions with stored results.

    Args:
        functions: To be checked.
        stored: Their arguments and expected results, (n_states, ...) by name.
        tolerance: Of the largest value of each result.

    Raises:
        FormulationError: They are not the same.
    """
    for function in functions:
        for name, got in _evaluated(function, stored).items():
            wanted = stored[name].reshape(got.shape)
            _refuse_if_off(f"{function.name}: {name}", got - wanted, wanted, tolerance)


def _check_closures(closures: tuple[Function, ...], stored: Mapping[str, FloatArray]) -> None:
    """The loops are closed, and their derivatives are those of R and b."""
    values: dict[str, FloatArray] = {}
    for function in closures:
        values |= _evaluated(function, stored)
    _refuse_if_off("closure", values["Phi"], stored["q"], _TOLERANCE)
    along = values["Phi_d"] @ stored["R"]
    _refuse_if_off("closure_jacobian", along + values["Phi_z"], along, _TOLERANCE)
    drift = np.einsum("kij,kj->ki", values["Phi_d"], stored["b"])
    _refuse_if_off("closure_bias", drift - values["gamma"], drift, _TOLERANCE)


def _evaluated(function: Function, stored: Mapping[str, FloatArray]) -> dict[str, FloatArray]:
    """Results of a function for stored arguments, (n_states, ...) by name."""
    inputs = [
        column
        for argument in function.arguments
        for column in stored[argument.name].reshape(-1, argument.size).T
    ]
    values = function.program.evaluated(inputs)
    count = len(stored["q"])
    result = {}
    for array in function.results:
        own, values = values[: array.size], values[array.size :]
        columns = [np.broadcast_to(value, count) for value in own]
        result[array.name] = np.column_stack(columns).reshape(count, *array.shape)
    return result


def _refuse_if_off(what: str, off: FloatArray, against: FloatArray, tolerance: float) -> None:
    error = float(np.max(np.abs(off))) / max(float(np.max(np.abs(against))), 1e-300)
    if not error <= tolerance:
        raise FormulationError(
            f"{what} is off by {error:.1e} of its largest value against plain recursion. This is a defect "
            "of paramreduce: please report it with the config."
        )
