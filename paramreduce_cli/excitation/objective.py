"""Value and gradient of an excitation criterion by the coefficients of a trajectory.

For the eigenvalues l_i and vectors v_i of G = W'W, a function f(l) has dG = V diag(f') V'
and so dW = 2 W dG; one reverse sweep through the regressor takes that to the states and the
series' transposed basis to the coefficients.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy.linalg

from paramreduce_cli.excitation.criteria import condition_from_matrix
from paramreduce_cli.excitation.fourier import FourierBasis
from paramreduce_cli.excitation.limits import LimitMap
from paramreduce_cli.excitation.scaling import Scaling
from paramreduce_cli.records import FloatArray
from paramreduce_cli.registry import scaling as scalings

Forward = Callable[[FloatArray, FloatArray, FloatArray], FloatArray]
Adjoint = Callable[
    [FloatArray, FloatArray, FloatArray, FloatArray], tuple[FloatArray, FloatArray, FloatArray]
]
Criterion = Callable[[FloatArray, float], tuple[float, FloatArray]]


@dataclass(frozen=True)
class Excitation:
    """What is measured along a trajectory: base columns of W, weighted and scaled."""

    forward: Forward
    """States (n_points, n_dof) to W of the base columns, (n_points * n_dof, r)."""
    adjoint: Adjoint
    beta: FloatArray
    """The other columns in the base columns, (r, n - r)."""
    nominal_torque: FloatArray
    """(n_dof,), N m or N."""
    criterion: Criterion
    scaling: Scaling

    def weighted(self, states: tuple[FloatArray, FloatArray, FloatArray]) -> FloatArray:
        """W with every row divided by its joint's nominal torque."""
        return self.forward(*states) * self._row_weights(states[0].shape[0])

    def _row_weights(self, points: int) -> FloatArray:
        return np.tile(1 / self.nominal_torque, points)[:, None]

    def condition_numbers(
        self, states: tuple[FloatArray, FloatArray, FloatArray]
    ) -> dict[str, float]:
        """The condition number in every scaling, by singular values."""
        W = self.weighted(states)
        return {
            name: condition_from_matrix(scaling(W, self.beta)[0])
            for name, scaling in scalings.items()
        }

    def value_and_gradient(
        self, basis: FourierBasis, coefficients: FloatArray, sharpness: float
    ) -> tuple[float, FloatArray]:
        """The criterion and its derivative by the coefficients, (n_dof, 1 + 2 harmonics)."""
        states = basis.states(coefficients)
        weights = self._row_weights(states[0].shape[0])
        scaled, pull = self.scaling(self.forward(*states) * weights, self.beta)
        eigenvalues, vectors = scipy.linalg.eigh(
            scaled.T @ scaled, driver="evd", check_finite=False, overwrite_a=True
        )
        value, slope = self.criterion(eigenvalues, sharpness)
        bar = 2 * scaled @ ((vectors * slope) @ vectors.T)
        z_bar, dz_bar, ddz_bar = self.adjoint(*states, pull(bar) * weights)
        gradient = (
            z_bar.T @ basis.position + dz_bar.T @ basis.velocity + ddz_bar.T @ basis.acceleration
        )
        return value, gradient


class FreeObjective:
    """The criterion over free series, for a solver without constraints.

    Args:
        excitation: What is measured.
        basis: Grid on which it is measured.
        limits: Map from free to admissible series.
        sharpness: Of the criterion.
        norm: Exponent of the smooth maximum of the limits.
    """

    def __init__(
        self,
        excitation: Excitation,
        basis: FourierBasis,
        limits: LimitMap,
        sharpness: float,
        norm: float,
    ) -> None:
        self._excitation = excitation
        self._basis = basis
        self._limits = limits
        self._sharpness = sharpness
        self._norm = norm
        self._shape = (limits.n_dof, limits.n_columns)

    def __call__(self, x: FloatArray) -> tuple[float, FloatArray]:
        """Value and gradient at ``x``, the free series stacked joint by joint."""
        coefficients, pull = self._limits.admissible(x.reshape(self._shape), self._norm)
        value, bar = self._excitation.value_and_gradient(self._basis, coefficients, self._sharpness)
        return value, pull(bar).ravel()
