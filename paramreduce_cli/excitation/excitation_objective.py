"""Objective of an excitation: value and gradient of a criterion by the coefficients of a trajectory.

For the eigenvalues l_i and vectors v_i of G = W'W, a function f(l) has dG = V diag(f') V'
and so dW = 2 W dG; one reverse sweep through the regressor takes that to the states and the
series' transposed basis to the coefficients.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy.linalg

from paramreduce_cli.errors import DataError
from paramreduce_cli.excitation.criteria import Criterion
from paramreduce_cli.excitation.fourier import FourierBasis
from paramreduce_cli.excitation.limits import LimitMap
from paramreduce_cli.excitation.scalings import Scaling, scalings
from paramreduce_cli.excitation.torque_constraints import TorqueConstraints
from paramreduce_cli.multibody.dynamics import ObservationFunction
from paramreduce_cli.multibody.loops.coordinates import Coordinates
from paramreduce_cli.multibody.loops.follower import Follower
from paramreduce_cli.multibody.quantities import Quantities
from paramreduce_cli.records import FloatArray


@dataclass(frozen=True)
class Level:
    """A step of the continuation from a smooth to a sharp objective."""

    sharpness: float
    """Exponent of the smooth condition number."""
    limits: float
    """Exponent of the smooth maximum of the limits of independent coordinates."""
    maxima: float
    """Exponent of the smooth maxima of scalings; e to it times a bound's rows is summed over time."""
    barrier: float = 0.0
    """Weight of the logarithmic barrier that keeps bounds."""


@dataclass(frozen=True)
class Bound:
    """The bound that a motion is nearest to, or exceeds by most."""

    excess: float
    """Distance of the worst value beyond the bound, without unit; negative inside. The scale depends on the kind of
    bound."""
    name: str


@dataclass(frozen=True)
class Excitation:
    """An excitation criterion on the base columns of W, weighted and scaled, with bounds."""

    observation: ObservationFunction
    """Base columns of W along a motion, (n_points * n_dof, r), and its adjoint; smooth."""
    measured: Callable[[FloatArray, FloatArray, FloatArray], FloatArray]
    """The same columns by q, dz and ddz without smoothing, where friction has a sign that jumps."""
    coordinates: Coordinates
    """Map from the independent coordinates to all of them."""
    quantities: Quantities
    """Quantities of the mechanism that are bounded."""
    beta: FloatArray
    """The other columns in the base columns, (r, n - r)."""
    torque_scale: FloatArray
    """Divisor of the rows of each joint, (n_dof,), N m or N."""
    criterion: Criterion
    scaling: Scaling
    loads: TorqueConstraints
    """Limits of torque and power."""

    def weigh_rows(self, q: FloatArray, dz: FloatArray, ddz: FloatArray) -> FloatArray:
        """Return W with each row divided by its joint's torque scale, and with smoothed Coulomb friction."""
        W = self.observation.evaluate(q, dz, ddz)
        W *= self._row_weights(q.shape[0])
        return W

    def _row_weights(self, points: int) -> FloatArray:
        return np.tile(1 / self.torque_scale, points)[:, None]

    def compute_condition_numbers(
        self, q: FloatArray, dz: FloatArray, ddz: FloatArray
    ) -> dict[str, float]:
        """Return the condition number in every scaling, by singular values.

        Args:
            q: Generalised coordinates along a motion, (n_points, n_q).
            dz: Velocities of the independent coordinates, (n_points, n_dof).
            ddz: Accelerations, same shape.
        """
        W = self.measured(q, dz, ddz) * self._row_weights(q.shape[0])
        return {
            name: float(np.linalg.cond(scaling(W, self.beta, np.inf)[0]))
            for name, scaling in scalings.items()
        }

    def evaluate(
        self, basis: FourierBasis, coefficients: FloatArray, level: Level, positions: Follower
    ) -> tuple[float, FloatArray]:
        """Return the criterion and its derivative with respect to the coefficients, (n_dof, 1 + 2 harmonics).

        A barrier is added if torque or power are limited; the value is infinite beyond these limits.
        """
        states = basis.evaluate(coefficients)
        weights = self._row_weights(states[0].shape[0])
        q, rates = positions(states[0]), states[1:]
        W = self.weigh_rows(q, *rates)
        scaled, pull = self.scaling(W, self.beta, level.maxima)
        gram = scaled.T @ scaled
        eigenvalues, vectors = scipy.linalg.eigh(gram, driver="evd", check_finite=False)
        value, slope = self.criterion(eigenvalues, level.sharpness)
        W_bar = pull(gram, (2 * vectors * slope) @ vectors.T)
        load_dz_bar: FloatArray | float = 0.0
        if self.loads.limited:
            torques = self.loads.compute_torques(W)
            load, bar = _evaluate_log_barrier(self.loads.compute_rows(torques, rates[0]), level)
            if np.isinf(load):
                return np.inf, np.full_like(coefficients, np.nan)
            value += load
            torque_bar, load_dz_bar = self.loads.compute_vector_jacobian_product(
                torques, rates[0], bar
            )
            W_bar += np.outer(torque_bar, self.loads.values)
        W_bar *= weights
        z_bar, dz_bar, ddz_bar = self.observation.compute_vector_jacobian_product(q, *rates, W_bar)
        dz_bar = dz_bar + load_dz_bar
        gradient = (
            z_bar.T @ basis.position + dz_bar.T @ basis.velocity + ddz_bar.T @ basis.acceleration
        )
        return value, gradient

    def evaluate_barrier(
        self, basis: FourierBasis, coefficients: FloatArray, level: Level, positions: Follower
    ) -> tuple[float, FloatArray]:
        """Return the logarithmic barrier of the bounds, infinite outside them, and its derivative with respect to the
        coefficients.

        Each row of bounds is replaced by its smooth maximum over time, which is never below the true one.
        """
        if not self.quantities.constraints:
            return 0.0, np.zeros_like(coefficients)
        q = positions(basis.evaluate(coefficients)[0])
        value, slopes = _evaluate_log_barrier(self.quantities.compute_rows(q), level)
        if np.isinf(value):
            return np.inf, np.full_like(coefficients, np.nan)
        z_bar = np.einsum("kc,kcj->kj", slopes, self.quantities.compute_jacobian(q))
        return value, z_bar.T @ basis.position

    def compute_load_ratio(self, q: FloatArray, dz: FloatArray, ddz: FloatArray) -> float:
        """Return the largest fraction of a torque or power limit that a motion uses, zero without limits."""
        if not self.loads.limited:
            return 0.0
        W = self.measured(q, dz, ddz) * self._row_weights(q.shape[0])
        rows = self.loads.compute_rows(self.loads.compute_torques(W), dz)
        return float(np.sqrt(max(0.0, rows.max() + 1)))

    def compute_peak_torques(self, q: FloatArray, dz: FloatArray, ddz: FloatArray) -> FloatArray:
        """Return the largest torques of the model with the config's values, (n_dof,)."""
        W = self.measured(q, dz, ddz)
        peaks: FloatArray = np.abs(self.loads.compute_torques(W)).max(axis=0)
        return peaks

    def find_worst_bound(self, z: FloatArray, positions: Follower) -> Bound:
        """Return the bound that positions z, (n_samples, n_dof), exceed by most; its excess is infinite if loops cannot
        be closed.
        """
        try:
            rows = self.quantities.compute_rows(positions(z))
        except DataError as error:
            return Bound(np.inf, str(error))
        if not rows.size:
            return Bound(-np.inf, "none")
        worst = int(np.argmax(rows.max(axis=0)))
        constraint = self.quantities.constraints[self.quantities.owners[worst]]
        bounds = []
        if constraint.lower > -np.inf:
            bounds.append(f"at least {constraint.lower:.4g}")
        if constraint.upper < np.inf:
            bounds.append(f"at most {constraint.upper:.4g}")
        name = f"{constraint.name} ({constraint.kind}, {' and '.join(bounds)})"
        return Bound(float(rows[:, worst].max()), name)


def _evaluate_log_barrier(rows: FloatArray, level: Level) -> tuple[float, FloatArray]:
    """Return the logarithmic barrier of the smooth maximum over time of each row, and its derivative with respect to
    the rows. It is infinite if an entry of the rows, (n_points, n_rows), is above zero.

    It is infinite if an entry of the rows, (n_points, n_rows), is above zero.
    """
    largest = rows.max(axis=0)
    terms = np.exp(level.maxima * (rows - largest))
    total = terms.sum(axis=0)
    room = -largest - np.log(total) / level.maxima
    if (room <= 0).any():
        return np.inf, np.full_like(rows, np.nan)
    return -level.barrier * float(np.log(room).sum()), level.barrier * terms / total / room


@dataclass(frozen=True)
class FreeObjective:
    """The criterion as a function of free series, with a barrier at the bounds, for IPOPT."""

    excitation: Excitation
    basis: FourierBasis
    """Grid on which it is measured."""
    limits: LimitMap
    """Map from free to admissible series."""
    level: Level
    """Sharpness of criterion and limits."""
    positions: Follower
    """Positions of the mechanism along the motion."""
    mixing: FloatArray
    """Map from the solver's series to those of the joints, (n_dof, n_dof)."""

    def __call__(self, x: FloatArray) -> tuple[float, FloatArray]:
        """Value and gradient at ``x``, the unmixed free series stacked joint by joint.

        The value is NaN outside the bounds, and where the loops cannot be closed.
        """
        coefficients, pull = self._map_to_admissible(x)
        along = (self.basis, coefficients, self.level, self.positions)
        try:
            barrier, barrier_bar = self.excitation.evaluate_barrier(*along)
            if np.isfinite(barrier):
                value, bar = self.excitation.evaluate(*along)
                if np.isfinite(value):
                    self.positions.keep()
                    return value + barrier, pull(bar + barrier_bar)
        except DataError:
            pass
        return np.nan, np.full(x.size, np.nan)

    def find_worst_bound(self, x: FloatArray) -> Bound:
        """Return the bound that the series at ``x`` exceeds by most, or is nearest to."""
        coefficients, _ = self._map_to_admissible(x)
        return self.excitation.find_worst_bound(
            self.basis.evaluate(coefficients)[0], self.positions
        )

    def _map_to_admissible(
        self, x: FloatArray
    ) -> tuple[FloatArray, Callable[[FloatArray], FloatArray]]:
        """Return admissible coefficients for free variables, and the function that maps derivatives back."""
        free = self.mixing @ x.reshape(self.limits.n_dof, self.limits.n_columns)
        coefficients, pull = self.limits.map_to_admissible(free, self.level.limits)
        return coefficients, lambda bar: (self.mixing.T @ pull(bar)).ravel()
