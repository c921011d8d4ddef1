"""Physically consistent standard parameters from torques that determine only base parameters.

A rigid body exists where its pseudo-inertia matrix is positive definite [Wensing2018], a linear matrix
inequality; friction, rotor inertia and stiffness are positive. Among what the torques leave open
those nearest to the known parameters are taken.
"""

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from paramreduce_cli.errors import DataError
from paramreduce_cli.records import DRIVE, INERTIAL, FloatArray, IntArray, Mechanism
from paramreduce_cli.robots.inertia import compute_pseudo_inertia

_MARGIN = 1e-3
"""Smallest eigenvalue of a pseudo-inertia matrix in units of the body's size."""
_NOT_FOUND = (
    "no physically consistent parameters were found; set identification.consistency to none, or to the other "
    "distance, if they are not needed"
)
_UNKNOWN_MASS = 1.0
"""kg, where nothing is known."""
_UNKNOWN_RADIUS = 0.1
"""m, likewise."""


@dataclass(frozen=True)
class Physical:
    """The parameters that belong to bodies, and those that must not be negative.

    Attributes:
        names: Names of bodies and payloads.
        columns: Columns of each, its parameters in the order of ``INERTIAL``, (n_bodies, 10).
        positive: Parameters that must not be negative.
        sizes: Scale of each parameter, (n_parameters,): its size for a body of that mass and extent; for drives the known value.
        known: Known values of the parameters, (n_parameters,).
    """

    names: tuple[str, ...]
    columns: IntArray
    positive: IntArray
    sizes: FloatArray
    known: FloatArray


def list_constraints(
    mechanism: Mechanism, known_values: FloatArray, factor: FloatArray
) -> Physical:
    """Return which parameters of a mechanism must be physical, and their known values.

    Args:
        mechanism: The robot.
        known_values: Values that are known beforehand, zero where nothing is, (n_parameters,).
        factor: Triangular factor of [W | tau] with rows divided by the noise, (k, n + 1).
    """
    columns = np.array([[r.columns[kind] for kind in INERTIAL] for r in mechanism.rigid])
    names = tuple(mechanism.parameters[row[0]].owner for row in columns)
    drives = {k: p.kind for k, p in enumerate(mechanism.parameters) if p.kind in DRIVE}
    positive = [k for k, kind in drives.items() if not kind.is_signed]
    # What drives have is left to the data, in units in which it explains all there is.
    lengths = np.linalg.norm(factor[:, :-1], axis=0)
    lengths[lengths == 0] = 1.0
    sizes = np.linalg.norm(factor[:, -1]) / lengths
    for row in columns:
        sizes[row] = _compute_body_scales(known_values[row])
    return Physical(names, columns, np.array(positive, dtype=np.int64), sizes, known_values)


def _compute_body_scales(values: FloatArray) -> FloatArray:
    """Return the magnitude of a large change of a body's ten parameters, from its mass and radius of gyration."""
    mass = abs(float(values[0])) or _UNKNOWN_MASS
    squared = abs(float(values[[4, 7, 9]].sum())) / (2 * mass)
    radius = np.sqrt(squared) if squared > 0 else _UNKNOWN_RADIUS
    return mass * np.array([1.0, *[radius] * 3, *[radius**2] * 6])


def compute_pseudo_inertias(physical: Physical, values: FloatArray) -> FloatArray:
    """Return the pseudo-inertia matrix of every body, (n_bodies, 4, 4)."""
    return np.array([_build_pseudo_inertia(values[row]) for row in physical.columns])


def _build_pseudo_inertia(values: FloatArray) -> FloatArray:
    return compute_pseudo_inertia(dict(zip(INERTIAL, values.tolist(), strict=True)))


def compute_smallest_eigenvalues(physical: Physical, values: FloatArray) -> FloatArray:
    """Return the smallest eigenvalue of every body's pseudo-inertia matrix, (n_bodies,)."""
    found = np.linalg.eigvalsh(compute_pseudo_inertias(physical, values))[:, 0]
    return np.asarray(found, dtype=float)


def fit_unconstrained(factor: FloatArray, physical: Physical) -> FloatArray:
    """Return the parameters that fit the data and are nearest to the known ones, (n_parameters,); they need not be
    physical.

    Args:
        factor: Triangular factor of [W | tau] with rows divided by the noise, (k, n + 1).
        physical: Known parameters and their scales.
    """
    A, b = _stack_rows(factor, physical)
    solution = np.linalg.lstsq(A, b, rcond=None)[0]
    found: FloatArray = physical.known + physical.sizes * solution
    return found


def _stack_rows(factor: FloatArray, physical: Physical) -> tuple[FloatArray, FloatArray]:
    """Return the rows of the data and of the known values; parameters are divided by their scales."""
    W, tau = factor[:, :-1], factor[:, -1]
    n = physical.known.size
    A = np.vstack([W * physical.sizes, np.eye(n)])
    return A, np.concatenate([tau - W @ physical.known, np.zeros(n)])


def fit_consistent(factor: FloatArray, physical: Physical, distance: str) -> FloatArray:
    """Return the physical parameters that fit the data best and are nearest to the known ones, (n_parameters,).

    Args:
        factor: Triangular factor of [W | tau] with rows divided by the noise, (k, n + 1).
        physical: Known parameters, their scales and the constraints.
        distance: Distance to the known bodies: `euclidean` in units of their size, or `entropic`, the divergence of their mass distributions [Lee2020].

    Raises:
        DataError: The solver finds no solution, or entropic distances are asked to bodies that are not
            physical.
        ImportError: cvxpy is not installed.
    """
    import cvxpy as cp  # late: an extra, and slow to load

    x = cp.Variable(physical.known.size)
    data, rest = _scale_rows(factor, physical)
    bodies, constraints = _express_bodies(cp, physical, x)
    if physical.positive.size:
        k = physical.positive
        constraints.append(physical.known[k] / physical.sizes[k] + x[k] >= 0)
    cost = cp.sum_squares(data @ x - rest)
    if distance == "entropic":
        cost += _express_divergence(cp, physical, bodies)
    else:
        cost += cp.sum_squares(x)
    problem = cp.Problem(cp.Minimize(cost), constraints)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # accuracy is seen from eigenvalues
            problem.solve(solver=cp.CLARABEL)
    except cp.SolverError as error:
        raise DataError(_NOT_FOUND) from error
    if x.value is None:
        raise DataError(_NOT_FOUND)
    found = physical.known + physical.sizes * x.value
    found[physical.positive] = np.maximum(found[physical.positive], 0.0)
    result: FloatArray = found
    return result


def _scale_rows(factor: FloatArray, physical: Physical) -> tuple[FloatArray, FloatArray]:
    """Return rows and right side for the scaled deviations from the known values."""
    W, tau = factor[:, :-1], factor[:, -1]
    return W * physical.sizes, tau - W @ physical.known


def _compute_units(physical: Physical, body: int) -> FloatArray:
    """Return the scales of a body's pseudo-inertia matrix, with which the matrix of the known body is near the identity."""
    mass, second = physical.sizes[physical.columns[body]][[0, 4]]
    return np.diag([1 / np.sqrt(second)] * 3 + [1 / np.sqrt(mass)])


def _express_bodies(cp: Any, physical: Physical, x: Any) -> tuple[list[Any], list[Any]]:
    """Return scaled pseudo-inertia matrices as expressions, and the constraints that they are positive definite."""
    found, constraints = [], []
    basis = [_build_pseudo_inertia(unit) for unit in np.eye(len(INERTIAL))]
    for body, row in enumerate(physical.columns):
        S = _compute_units(physical, body)
        whole = S @ _build_pseudo_inertia(physical.known[row]) @ S
        terms = [
            (S @ E @ S * physical.sizes[column]) * x[int(column)]
            for E, column in zip(basis, row, strict=True)
        ]
        matrix = sum(terms, start=cp.Constant(whole))
        found.append(matrix)
        constraints.append(matrix - _MARGIN * np.eye(4) >> 0)
    return found, constraints


def _express_divergence(cp: Any, physical: Physical, bodies: Sequence[Any]) -> Any:
    """Return the divergence of the bodies from the known ones as an expression.

    Raises:
        DataError: A known body is not physical.
    """
    cost = 0
    for body, (name, row) in enumerate(zip(physical.names, physical.columns, strict=True)):
        S = _compute_units(physical, body)
        known = S @ _build_pseudo_inertia(physical.known[row]) @ S
        if np.linalg.eigvalsh(known)[0] <= _MARGIN:
            raise DataError(
                f"the known inertia of {name} is not that of any body, so the entropic distance is undefined. Give physical parameters, or use the euclidean distance."
            )
        cost += cp.trace(np.linalg.inv(known) @ bodies[body]) - cp.log_det(bodies[body])
    return cost
