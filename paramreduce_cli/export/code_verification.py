"""Whether exported functions compute what textbook recursion does."""

from collections.abc import Collection, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from paramreduce_cli.export.term_sizes import find_entry_sizes
from paramreduce_cli.expressions.functions import Function
from paramreduce_cli.expressions.programs import Program
from paramreduce_cli.lean.dynamics_parts import find_inertial_parameters
from paramreduce_cli.lean.lean_verification import TOLERANCE, reject_if_wrong
from paramreduce_cli.multibody.dynamics import SINGULAR_MASS, Dynamics
from paramreduce_cli.multibody.loops.coordinates import Coordinates
from paramreduce_cli.multibody.random_states import draw_states
from paramreduce_cli.multibody.torque_derivatives import compute_derivatives
from paramreduce_cli.records import FloatArray, IntArray, Mechanism, Model, ReducedModel, TermModel

_FEW = 3
"""States that tell which coordinates move a mass."""
_GUESS = 0.01
"""How far off the guesses of the position problem are in the self-test, rad or m."""


def make_random_cases(
    mechanism: Mechanism,
    model: ReducedModel,
    count: int,
    rng: np.random.Generator,
    simplified: TermModel | None = None,
    result_names: Collection[str] = (),
) -> dict[str, FloatArray]:
    """Return random states and the results of textbook recursion, by the names of the functions' arrays.

    For a function with pruned terms, results are those of the pruned program, and states of open trees are inside the
    ranges in which it holds.

    Args:
        mechanism: Mechanism of the robot.
        model: The reduced model.
        count: Number of states.
        rng: Random generator.
        simplified: A function with pruned terms.
        result_names: Names of the results that are needed; derivatives are computed if they are among these.
    """
    q, dq, ddq = draw_states(mechanism, count, rng)
    if simplified is not None and mechanism.loops is None:
        lower, upper = simplified.lower[:, None], simplified.upper[:, None]
        q, dq, ddq = rng.uniform(lower, upper, (3, count, mechanism.n_dof))
    plain = Dynamics(mechanism, once=True)
    phi = model.standard
    expansion = (model.position[:, None] == np.arange(model.n)).astype(float)
    M, delta = plain.compute_mass_matrix_and_bias(q, dq, phi)
    K = plain.compute_regressor(q, dq, ddq)
    weightless = Dynamics(replace(mechanism, gravity=np.zeros(3)), once=True)
    inertial = np.where(find_inertial_parameters(mechanism), phi, 0.0)
    still = np.zeros_like(q)
    result = {
        "phi": np.tile(model.values, (count, 1)),
        "q": q,
        "dq": dq,
        "ddq": ddq,
        "tau": K @ phi,
        "M": M,
        "delta": delta,
        "g": plain.compute_torques(q, still, still, phi),
        "c": weightless.compute_mass_matrix_and_bias(q, dq, inertial)[1],
        "K": K @ expansion,
    }
    if {"C", "beta", "tau_by_q", "tau_by_dq"} & set(result_names):
        result |= compute_derivatives(mechanism, phi, q, dq, ddq)
    if "beta" in result_names:
        result["p"] = np.einsum("kij,kj->ki", M, dq)
        across = np.einsum("kji,kj->ki", result["C"], dq)
        result["beta"] = across - delta + result["c"]
    if mechanism.loops is None:
        return result | _evaluate_pruned(simplified, result, np.eye(mechanism.n_q)[None])
    dependent, independent = list(mechanism.dependent), list(mechanism.independent)
    R = Coordinates(mechanism, once=True).compute_tangent(q)[:, dependent]
    b = ddq[:, dependent] - np.einsum("kij,kj->ki", R, ddq[:, independent])
    guess = q.copy()
    guess[:, dependent] += rng.uniform(-_GUESS, _GUESS, size=(count, len(dependent)))
    z = {name: result[name][:, independent] for name in ("q", "dq", "ddq")}
    loops = {"z": z["q"], "dz": z["dq"], "ddz": z["ddq"], "guess": guess, "R": R, "b": b}
    tangent = np.zeros((count, mechanism.n_q, mechanism.n_dof))
    tangent[:, dependent] = R
    tangent[:, independent] = np.eye(mechanism.n_dof)
    return result | loops | _evaluate_pruned(simplified, result | loops, tangent)


def _evaluate_pruned(
    simplified: TermModel | None, stored: Mapping[str, FloatArray], tangent: FloatArray
) -> dict[str, FloatArray]:
    """Return the results of a function with pruned terms, projected on the independent coordinates."""
    if simplified is None:
        return {}
    count = len(stored["q"])
    inputs = [np.broadcast_to(value, count) for value in simplified.values]
    for name in ("q", "dq", "ddq", *(("R", "b") if simplified.projected else ())):
        inputs += list(stored[name].reshape(count, -1).T)
    given = Program.from_stored(simplified.program).evaluate(inputs)
    outputs = np.column_stack([np.broadcast_to(value, count) for value in given])
    n = tangent.shape[2] if simplified.projected else tangent.shape[1]
    across = np.broadcast_to(
        np.eye(n) if simplified.projected else tangent, (count, n, tangent.shape[2])
    )
    if outputs.shape[1] == n:
        return {"tau": np.einsum("kij,ki->kj", across, outputs)}
    rows, columns = np.tril_indices(n)
    M = np.zeros((count, n, n))
    M[:, rows, columns] = M[:, columns, rows] = outputs[:, :-n]
    delta = outputs[:, -n:]
    if "b" in stored and not simplified.projected:
        drift = stored["ddq"] - np.einsum("kij,kj->ki", across, stored["ddz"])
        delta = delta + np.einsum("kij,kj->ki", M, drift)
    M = np.einsum("kia,kij,kjb->kab", across, M, across)
    delta = np.einsum("kij,ki->kj", across, delta)
    # Under these torques the pruned function has the stored accelerations.
    tau = np.einsum("kij,kj->ki", M, stored.get("ddz", stored["ddq"])) + delta
    return {"M": M, "delta": delta, "tau": tau}


def check(
    functions: tuple[Function, ...],
    stored: Mapping[str, FloatArray],
    least: Mapping[str, float],
    tolerance: float = TOLERANCE,
) -> None:
    """Compare functions with stored results, joint by joint.

    Args:
        functions: Functions to be checked.
        stored: Arguments of the functions and expected results, (n_states, ...) by name.
        least: Smallest sizes that results are judged by, by name.
        tolerance: Share of the size of each result that is allowed.

    Raises:
        FormulationError: A result differs from the expected one.
    """
    for function in functions:
        for name, got in _evaluate_function(function, stored).items():
            expected = stored[name].reshape(got.shape)
            sizes = find_entry_sizes(name, expected, least[name])
            reject_if_wrong(
                f"{function.name}: {name}", (got - expected) / sizes, np.ones(1), tolerance
            )


def check_against_mechanism(
    model: Model, stored: Mapping[str, FloatArray], least: Mapping[str, float]
) -> None:
    """Compare the torques of the full model's code with those of all parameters of the robot.

    Args:
        model: The robot.
        stored: States and the torques of the exported model, (n_states, ...) by name.
        least: Lower bounds, by name of the result, of the magnitudes that differences are divided by.

    Raises:
        FormulationError: A parameter that was taken for one without effect has one.
    """
    plain = Dynamics(model.mechanism, once=True)
    expected = plain.compute_torques(stored["q"], stored["dq"], stored["ddq"], model.values)
    off = (stored["tau"] - expected) / find_entry_sizes("tau", expected, least["tau"])
    reject_if_wrong("the full model", off, np.ones(1))


def measure_single_precision(
    functions: tuple[Function, ...], stored: Mapping[str, FloatArray], least: Mapping[str, float]
) -> dict[str, float]:
    """Return the largest rounding error of each result in single precision, relative to the largest value of the
    result.

    NumPy's sines are used, and no fused operations; compiled code was found to have errors 1.5 times as large.

    Args:
        functions: Functions with their arguments and results.
        stored: Arguments and exact results, (n_states, ...) by name.
        least: Smallest sizes that results are judged by, by name.
    """
    rounded: dict[str, Any] = {name: values.astype(np.float32) for name, values in stored.items()}
    return {
        name: float(
            np.abs(got - stored[name].reshape(got.shape)).max()
            / max(np.abs(stored[name]).max(), least[name])
        )
        for function in functions
        for name, got in _evaluate_function(function, rounded).items()
    }


def check_closures(
    closures: tuple[Function, ...], stored: Mapping[str, FloatArray], least: Mapping[str, float]
) -> None:
    """Check that the loops are closed, and that their derivatives are those of R and b.

    Args:
        closures: Functions of the closures.
        stored: States of closed loops with R and b, (n_states, ...) by name.
        least: Smallest sizes that results are judged by, by name.

    Raises:
        FormulationError: The functions of the loops give wrong results.
    """
    values: dict[str, FloatArray] = {}
    for function in closures:
        values |= _evaluate_function(function, stored)
    along = values["Phi_d"] @ stored["R"]
    drift = np.einsum("kij,kj->ki", values["Phi_d"], stored["b"])
    for what, off, name, against in (
        ("closure", values["Phi"], "Phi", stored["q"]),
        ("closure_jacobian", along + values["Phi_z"], "Phi_z", along),
        ("closure_bias", drift - values["gamma"], "gamma", drift),
    ):
        reject_if_wrong(what, off / find_entry_sizes(name, against, least[name]), np.ones(1))


def check_loop_problems(
    problems: tuple[Function, ...],
    least_pivots: FloatArray,
    stored: Mapping[str, FloatArray],
    least: Mapping[str, float],
) -> None:
    """Check the solved problems of loops on states whose pivots are trusted.

    Args:
        problems: Functions that solve the position, velocity and acceleration problems.
        least_pivots: Magnitudes below which pivots are not trusted, (n_d,).
        stored: States of closed loops with R and b, (n_states, ...) by name.
        least: Smallest sizes that results are judged by, by name.

    Raises:
        FormulationError: A solution is wrong.
    """
    for function in problems:
        values = _evaluate_function(function, stored)
        trusted = (np.abs(values.pop("pivots")) >= least_pivots).all(axis=1)
        for name, got in values.items():
            expected = np.zeros_like(got) if name == "step" else stored[name]
            sizes = np.ones(1) if name == "step" else find_entry_sizes(name, expected, least[name])
            off = ((got - expected) / sizes)[trusted]
            reject_if_wrong(f"{function.name}: {name}", off, np.ones(1))


def _evaluate_function(
    function: Function, stored: Mapping[str, FloatArray]
) -> dict[str, FloatArray]:
    """Return the results of a function for stored arguments, (n_states, ...) by name."""
    inputs = [
        column
        for argument in function.arguments
        for column in stored[argument.name].reshape(-1, argument.size).T
    ]
    values = function.program.evaluate(inputs)
    count = len(stored["q"])
    result = {}
    for array in function.results:
        own, values = values[: array.size], values[array.size :]
        columns = [np.broadcast_to(value, count) for value in own]
        result[array.name] = np.column_stack(columns).reshape(count, *array.shape)
    return result


def find_massive_coordinates(model: Model, stored: Mapping[str, FloatArray]) -> IntArray:
    """Return the indices of the independent coordinates that move a mass in the full model; those of a road do not.

    Args:
        model: The robot.
        stored: States, (n_states, ...) by name.
    """
    q, dq = stored["q"][:_FEW], stored["dq"][:_FEW]
    M, _ = Dynamics(model.mechanism, once=True).compute_mass_matrix_and_bias(q, dq, model.values)
    return np.flatnonzero(np.diagonal(M, axis1=1, axis2=2).any(axis=0))


def find_unsafe_mass_matrices(M: FloatArray) -> str:
    """Describe how many mass matrices are not finite, singular or not positive definite, (n_states, n, n); empty if none."""
    finite = np.isfinite(M).all(axis=(1, 2))
    values = np.linalg.eigvalsh(M[finite])
    singular = values[:, 0] <= SINGULAR_MASS * np.abs(values).max(initial=0.0)
    bad = int(np.sum(~finite) + np.sum(singular))
    if not bad:
        return ""
    return f"M is singular or not positive definite on {bad} of {len(M)} random states"
