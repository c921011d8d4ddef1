"""Fits of a program's parameters to torques and accelerations."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from paramreduce_cli.records import FloatArray, IntArray
from paramreduce_cli.terms.fit_samples import TermSamples
from paramreduce_cli.terms.matrices import (
    compute_roots,
    compute_whitening,
    is_positive_definite,
    multiply_triangles,
)
from paramreduce_cli.terms.pruning import WHOLE, Pruning
from paramreduce_cli.terms.substitutions import Substitutions, find_substitutions
from paramreduce_cli.terms.tape import Outputs, Tape

_LARGEST = 1e100
"""Share of an allowed error from which on it does not matter how large it is."""
_NOTHING = 1e-12
"""Share of a column that is left, squared, from which on it is no more than rounding."""
_RIDGE = 1e-13
"""Added to the unit diagonal of normal equations: parameters that nothing tells stay small."""


@dataclass(frozen=True)
class Budget:
    """A budget: the errors of torques and accelerations that are allowed."""

    torque: float
    acceleration: float
    """Infinite where accelerations do not matter; mass matrices must be positive definite even so."""

    def scale(self, factor: float) -> Budget:
        """Return a fraction of the budget."""
        return Budget(factor * self.torque, factor * self.acceleration)


@dataclass(frozen=True)
class Costs:
    """The costs of changes of rows: increases of the sum of squares, to first order."""

    refitted: FloatArray
    """Costs if the parameters are fitted again, (k,). They are exact if the rows change by multiples of one combination
    of parameters; otherwise the columns are taken as unchanged."""
    unfitted: FloatArray
    """Costs if the parameters keep their values, (k,)."""
    sure: FloatArray
    """Costs after fitting again where that is exact, otherwise with the parameters as they are, (k,)."""


@dataclass(frozen=True)
class Linear:
    """A linear least-squares problem, with the residual of its solution, from which effects of changes are estimated."""

    rows: FloatArray
    """Transposed, (n_parameters, n_rows)."""
    factor: FloatArray
    """Times the rows it makes them orthonormal, (n_parameters, n_parameters)."""
    residual: FloatArray
    """(n_rows,)"""
    metric: FloatArray | None
    """Weights of accelerations, (n_dof, n_dof, n_samples); None if only torques count."""

    def compute_explained_squares(self, changes: FloatArray) -> FloatArray:
        """Return the squares of what the parameters can compensate, (k,), of changes of rows, (k, n_rows)."""
        return np.sum(self._project(changes) ** 2, axis=1)

    def estimate_costs(
        self, changes: FloatArray, beta: FloatArray, combinations: FloatArray
    ) -> Costs:
        """Return the costs of changes of rows, before and after fitting the parameters again.

        Args:
            changes: What the rows lose by each removal or substitution, present minus new values, (k, n_rows).
            beta: Fitted parameters, (n_parameters,).
            combinations: Combinations of parameters that the removed terms are multiples of, (k, n_parameters); zero
                for other terms.
        """
        size = np.einsum("cr,cr->c", changes, changes)
        along = changes @ self.residual
        C = self._project(changes)
        explained = np.einsum("cn,cn->c", C, C)
        plain = size + 2 * along
        exact, sure = plain - explained, plain.copy()
        (one,) = np.nonzero(combinations.any(axis=1))
        # With a the combination, columns become W - d a': the residual is least, over the multiple s of
        # what a' beta was, at r + s d's part out of reach, and e (1 - s) + s C along the direction of a.
        directions = combinations[one] @ self.factor.T
        lengths = np.linalg.norm(directions, axis=1)
        e = combinations[one] @ beta / lengths
        t = e - np.einsum("cn,cn->c", C[one], directions) / lengths
        left = t**2 + np.maximum(size[one] - explained[one], 0.0)
        explained_fully = left <= _NOTHING * (e**2 + size[one])
        regained = (e * t - along[one]) ** 2 / np.where(explained_fully, 1.0, left)
        exact[one] = sure[one] = e**2 - np.where(explained_fully, 0.0, regained)
        return Costs(exact, plain, sure)

    def _project(self, changes: FloatArray) -> FloatArray:
        """Return changes in the orthonormal basis of the columns, (k, n_parameters)."""
        return np.asarray(changes @ self.rows.T @ self.factor.T)


@dataclass(frozen=True)
class TermFit:
    """A fit of a pruned program."""

    pruning: Pruning
    beta: FloatArray
    """(n_parameters,)"""
    torque_error: float
    acceleration_error: float
    """Acceleration error: infinite if a mass matrix is not positive definite, NaN if it was not requested."""
    cost: float
    """Sum of the squared ratios of both errors to their limits."""
    total_cost: float
    """Cost including errors on watched samples, which count if the other errors are within the budget."""
    worst_ratio: float
    """Largest ratio of an error to its limit."""
    linear: Linear

    @property
    def within(self) -> bool:
        """Whether all errors are allowed."""
        return self.worst_ratio <= 1.0


class Fitting:
    """A fitter of a pruned program, whose terms are removed and whose nodes are replaced.

    Args:
        tape: The program.
        n_parameters: Number of first inputs that are parameters.
        samples: Samples that the parameters are fitted to.
        budget: Limits of the errors.
        watched: Samples on which they must do as well.
        poses: States at which mass matrices must be positive definite; what else they hold does not matter.
    """

    def __init__(
        self,
        tape: Tape,
        n_parameters: int,
        samples: TermSamples,
        budget: Budget,
        watched: TermSamples | None = None,
        poses: TermSamples | None = None,
    ) -> None:
        self.tape, self.samples, self.budget = tape, samples, budget
        self.n = n_parameters
        self._watched, self._poses = watched, poses
        self._parameters = tape.find_parameters(n_parameters)
        self._made, self._in_parameters = tape.mark_computed(), tape.mark_dependent(n_parameters)
        chi = samples.tau / samples.nominal_torque[:, None]
        self._torque_scale = 1 / (samples.nominal_torque * np.linalg.norm(chi))
        nominal = samples.nominal_acceleration
        size = float(np.linalg.norm(samples.ddz / nominal[:, None]))
        self._acceleration_scale = 1 / (nominal * size)

    def _stack_inputs(self, beta: FloatArray, samples: TermSamples) -> FloatArray:
        """Return the inputs of the program: parameters, then states, (n + n_states, n_samples)."""
        n_states, m = samples.states.shape
        inputs = np.empty((self.n + n_states, m))
        inputs[: self.n], inputs[self.n :] = beta[:, None], samples.states
        return inputs

    def fit(self, pruning: Pruning, beta: FloatArray, checks: int = 1) -> TermFit:
        """Fit the parameters of a pruned program.

        Args:
            pruning: Pruning of the program.
            beta: Start values, from which mass matrices are computed that weigh accelerations.
            checks: Number of fits. The weights come from the start values for the first fit, and from the fit before
                for each further one.
        """
        samples = self.samples
        needed = self.tape.mark_live(pruning)
        values = self.tape.evaluate(pruning, self._stack_inputs(beta, samples), needed)
        present = self._parameters >= 0
        present[present] = pruning.kept[self._parameters[present], WHOLE]
        W = np.zeros((self.n, *samples.tau.shape))
        W[present] = self.tape.compute_adjoints_of(
            pruning, values, samples.seeds, self._in_parameters, self._parameters[present]
        )
        inverse = samples.invert_mass_matrices(self.tape.get_outputs(values))
        for _ in range(checks):
            metric = self._compute_metric(inverse)
            rows = self._weigh(W, metric)
            target = self._weigh(samples.tau[None], metric)[0]
            beta, factor = _solve_normal_equations(rows, target)
            off = samples.tau - np.tensordot(beta, W, 1)
            if not samples.direct:
                break
            # Accelerations go with the mass matrices of the fitted values.
            values = self.tape.evaluate(pruning, self._stack_inputs(beta, samples), needed)
            inverse = samples.invert_mass_matrices(self.tape.get_outputs(values))
        residual = self._weigh(off[None], metric)[0]
        errors = self._compute_errors(off, inverse)
        return self._evaluate(pruning, beta, errors, Linear(rows, factor, residual, metric))

    def _evaluate(
        self, pruning: Pruning, beta: FloatArray, errors: tuple[float, float], linear: Linear
    ) -> TermFit:
        """Return the fit with its cost, its worst ratio to the budget, and whether it is within the budget."""
        shares = self._compute_ratios(errors)
        cost = float(np.sum(np.minimum(shares, _LARGEST) ** 2))
        total = cost
        if self._watched is not None and max(shares) <= 1.0:
            watched = self._compute_ratios(self.compute_errors(pruning, beta, self._watched))
            total += float(np.sum(np.minimum(watched, _LARGEST) ** 2))
            shares += watched
        if self._poses is not None and max(shares) <= 1.0:
            masses = self._poses.build_mass_matrices(
                self._compute_outputs(pruning, beta, self._poses)
            )
            if not is_positive_definite(masses):
                shares.append(np.inf)
        return TermFit(pruning, beta, *errors, cost, total, float(np.max(shares)), linear)

    def _compute_ratios(self, errors: tuple[float, float]) -> list[float]:
        """Return the ratios of the errors to those that the budget allows."""
        torque, acceleration = errors
        if not self.samples.direct:
            return [torque / self.budget.torque]
        # Of an infinite one no budget is large enough: M is not positive definite.
        fraction = np.inf if np.isinf(acceleration) else acceleration / self.budget.acceleration
        return [torque / self.budget.torque, fraction]

    def _compute_errors(self, off: FloatArray, inverse: FloatArray | None) -> tuple[float, float]:
        """Return the errors of torques and of accelerations, given differences of torques."""
        torque = float(np.linalg.norm(off * self._torque_scale[:, None]))
        if not self.samples.direct:
            return torque, np.nan
        if inverse is None:
            return torque, np.inf
        caused = np.einsum("mij,jm->im", inverse, off) * self._acceleration_scale[:, None]
        return torque, float(np.linalg.norm(caused))

    def compute_errors(
        self, pruning: Pruning, beta: FloatArray, samples: TermSamples
    ) -> tuple[float, float]:
        """Return the errors of torques and of accelerations on other samples."""
        return samples.compute_errors(self._compute_outputs(pruning, beta, samples))

    def _compute_outputs(self, pruning: Pruning, beta: FloatArray, samples: TermSamples) -> Outputs:
        """Return the outputs of the program."""
        values = self.tape.evaluate(
            pruning, self._stack_inputs(beta, samples), self.tape.mark_live(pruning)
        )
        return self.tape.get_outputs(values)

    def compute_effects(self, fit: TermFit, candidates: IntArray) -> FloatArray:
        """Return the change of the rows of a fit when each term is removed, (n_candidates, n_rows)."""
        values, own, adjoints = self._differentiate(fit)
        found = self.tape.estimate_effects(fit.pruning, candidates, values, own, adjoints)
        return self._weigh(found.reshape(-1, *self.samples.tau.shape), fit.linear.metric)

    def list_substitutions(self, fit: TermFit) -> tuple[Substitutions, FloatArray, FloatArray]:
        """Return possible substitutions of nodes by others, the values of all nodes, and the weighted derivatives of
        the torques with respect to the nodes.
        """
        values, _, adjoints = self._differentiate(fit)
        pulls = self._weigh(adjoints, fit.linear.metric).reshape(adjoints.shape)
        itself = fit.pruning.kept[:, WHOLE] & (fit.pruning.source == np.arange(self.tape.size))
        residual = fit.linear.residual.reshape(pulls.shape[1:])
        substitutions = find_substitutions(
            values, pulls, residual, self._made & itself, self._in_parameters
        )
        constants = self.tape.find_constants()
        return substitutions.add_ones(constants[itself[constants]]), values, pulls

    def _differentiate(self, fit: TermFit) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return the values of nodes in the pruned program, the values that nodes would have if they were neither
        removed nor replaced, and the derivatives of the torques with respect to the nodes.
        """
        inputs, everywhere = (
            self._stack_inputs(fit.beta, self.samples),
            np.ones(self.tape.size, np.bool_),
        )
        values = self.tape.evaluate(fit.pruning, inputs, everywhere)
        adjoints = self.tape.compute_adjoints(fit.pruning, values, self.samples.seeds, everywhere)
        return values, self.tape.evaluate_unreplaced(fit.pruning, inputs, values), adjoints

    def _compute_metric(self, inverse: FloatArray | None) -> FloatArray | None:
        """Return upper triangular matrices R, (n_dof, n_dof, n_samples), such that the cost of a torque difference x is
        x' R' R x. Return None if only torques are weighed, each by itself: if a mass matrix has no inverse, or
        accelerations have no budget.
        """
        if inverse is None or np.isinf(self.budget.acceleration):
            return None
        caused = inverse * (self._acceleration_scale / self.budget.acceleration)[:, None]
        return compute_roots(caused, self._torque_scale / self.budget.torque)

    def _weigh(self, torques: FloatArray, metric: FloatArray | None) -> FloatArray:
        """Return torque differences multiplied by the metric, or, without a metric, divided by the budget and the
        nominal torques, (k, n_rows).
        """
        if metric is None:
            scaled = torques * (self._torque_scale / self.budget.torque)[:, None]
        else:
            scaled = multiply_triangles(metric, np.ascontiguousarray(torques))
        return scaled.reshape(torques.shape[0], -1)


def _solve_normal_equations(rows: FloatArray, target: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return least-squares parameters by normal equations of columns of unit length, which is fast.

    Args:
        rows: Transposed matrix, (n_parameters, n_rows).
        target: Vector to be met, (n_rows,).

    Returns:
        The parameters, and the inverse of the triangular factor of their Gram matrix.
    """
    factor = compute_whitening(rows @ rows.T, _RIDGE)
    return factor.T @ (factor @ (rows @ target)), factor
