"""The acceleration error as a criterion: exact, with first-order proposals."""

from dataclasses import dataclass

import numpy as np

from paramreduce_cli.errors import DataError
from paramreduce_cli.multibody.orthogonal import normalise_columns
from paramreduce_cli.records import FloatArray, IntArray
from paramreduce_cli.reduction.criteria.torque import TorqueObjective
from paramreduce_cli.reduction.fitting import Fit, compute_relative_error, fit
from paramreduce_cli.reduction.inputs import AccelerationData, CriterionInputs
from paramreduce_cli.reduction.objective import Objective, Subset, remove_group
from paramreduce_cli.reduction.problem import SelectionProblem

SEARCH_SAMPLES = 200
"""Samples on which subsets are compared."""
FIT_SAMPLES = 1500
"""Samples on which the parameters of the subsets found are fitted."""
_PROPOSALS = 6
"""How many of the most promising subsets are evaluated exactly."""
_STEPS = 8
_SMALLEST_STEP = 0.1
_SETTLED = 1e-3
_HOPELESS = 1.0
"""Errors from which on models have a mass matrix too far from the real one for a fit to settle;
only the first order tells them apart, and their parameters are those of the torques."""


@dataclass(frozen=True)
class _Point:
    """A fitted model of some columns."""

    parameters: FloatArray
    error: float
    residual: FloatArray
    """(z̈_R - z̈) / nom, (n_samples, n_dof)."""
    ddz: FloatArray
    M: FloatArray
    """Mass matrices M_R, (n_samples, n_dof, n_dof)."""


class _Accelerations:
    """A least-squares problem of the exact acceleration error on one set of samples.

    With e = z̈_R - z̈ and M_R z̈_R + δ_R = τ the derivative of z̈_R by the parameters is
    -M_R^-1 K(z, ż, z̈_R), K being the regressor at the predicted accelerations.
    """

    def __init__(self, data: AccelerationData, reference: FloatArray) -> None:
        self.data = data
        # Columns first: subsets of them are then copied in one piece each.
        self._A = np.ascontiguousarray(np.moveaxis(data.A, -1, 0))
        self._B = np.ascontiguousarray(np.moveaxis(data.B, -1, 0))
        self._total = float(np.linalg.norm(data.ddz / data.nominal))
        M = data.A @ reference
        try:
            weights = np.linalg.inv(M) / data.nominal[:, None]
        except np.linalg.LinAlgError as error:
            raise DataError(
                "the mass matrix of the model fitted to the estimation set is singular, so that "
                "nothing can be selected by accelerations; use more exciting samples."
            ) from error
        K = np.einsum("sijp,sj->sip", data.A, data.ddz) + data.B
        n = K.shape[2]
        self._first = (weights @ K).reshape(-1, n)
        self._first_right = np.einsum("sij,sj->si", weights, data.tau).ravel()

    def estimate_start(self, columns: IntArray) -> FloatArray:
        """Return the parameters to first order, with the mass matrix of the reference."""
        return _solve_least_squares(self._first[:, columns], self._first_right)

    def evaluate(self, columns: IntArray, parameters: FloatArray) -> _Point | None:
        """Return the accelerations of a model, or None if its mass matrix is singular."""
        d = self.data
        M: FloatArray = np.tensordot(parameters, self._A[columns], 1)
        left = d.tau - np.tensordot(parameters, self._B[columns], 1)
        try:
            ddz = np.asarray(np.linalg.solve(M, left[..., None])[..., 0], dtype=float)
        except np.linalg.LinAlgError:
            return None
        residual = (ddz - d.ddz) / d.nominal
        error = float(np.linalg.norm(residual)) / self._total
        if not np.isfinite(error):
            return None
        return _Point(parameters, error, residual, ddz, M)

    def compute_slope(self, point: _Point, columns: IntArray) -> FloatArray:
        """Return minus the derivative of the residual with respect to the parameters, (n_samples n_dof, n)."""
        K = (self._A[columns] @ point.ddz[..., None])[..., 0] + self._B[columns]
        slope = np.linalg.inv(point.M) @ np.moveaxis(K, 0, -1) / self.data.nominal[:, None]
        return slope.reshape(-1, columns.size)

    def fit(self, columns: IntArray, start: FloatArray) -> _Point | None:
        """Minimise the exact error by Gauss-Newton steps that are halved until they help; return None if the start
        cannot be evaluated.
        """
        best = self.evaluate(columns, start)
        for _ in range(_STEPS if best is not None else 0):
            assert best is not None
            step = _solve_least_squares(self.compute_slope(best, columns), best.residual.ravel())
            step_size, found = 1.0, None
            while step_size > _SMALLEST_STEP:
                found = self.evaluate(columns, best.parameters + step_size * step)
                if found is not None and found.error < best.error:
                    break
                step_size, found = step_size / 2, None
            if found is None:
                break
            settled = found.error > best.error * (1 - _SETTLED)
            best = found
            if settled:
                break
        return best

    def estimate_error(self, columns: IntArray) -> float:
        """Return the acceleration error to first order."""
        left = self._first_right - self._first[:, columns] @ self.estimate_start(columns)
        return float(np.linalg.norm(left)) / self._total


def _solve_least_squares(X: FloatArray, y: FloatArray) -> FloatArray:
    """Return the least-squares solution of X b = y by scaled normal equations."""
    scaled, lengths = normalise_columns(X)
    solution = np.linalg.lstsq(scaled.T @ scaled, scaled.T @ y, rcond=1e-13)[0]
    result: FloatArray = solution / lengths
    return result


class AccelerationObjective(Objective):
    """The exact acceleration error; its linearisation selects which additions, removals and swaps are evaluated."""

    negligible = 1e-7

    def __init__(
        self, problem: SelectionProblem, search: AccelerationData, final: AccelerationData
    ) -> None:
        super().__init__(problem)
        reference = np.zeros(problem.W.shape[1])
        reference[problem.candidates] = fit(problem, problem.candidates).parameters
        self._search = _Accelerations(search, reference)
        self._final = _Accelerations(final, reference)
        self._torque = TorqueObjective(problem)
        self._known: dict[frozenset[int], tuple[float, _Point | None]] = {}

    @property
    def cheap(self) -> Objective:
        """Torque error of the same subsets, which is cheap to compute."""
        return self._torque

    def score(self, kept: Subset) -> float:
        """Return the acceleration error of the fit to the accelerations."""
        return self._fit_once(kept)[0]

    def _fit_once(self, kept: Subset) -> tuple[float, _Point | None]:
        """Return error and fitted point of a subset, from the cache if known.

        If the fit fails or its error is far too large, the error is a larger estimate and the point is None.
        """
        key = frozenset(kept)
        if key not in self._known:
            columns = self._sort_columns(kept)
            point = self._search.fit(columns, self._search.estimate_start(columns))
            if point is not None and point.error < _HOPELESS:
                self._known[key] = (point.error, point)
            else:
                hopeless = _HOPELESS + self._search.estimate_error(columns)
                self._known[key] = (hopeless, None)
        return self._known[key]

    def _sort_columns(self, kept: Subset) -> IntArray:
        return self.list_columns(tuple(sorted(kept)))

    def _linearise(self, kept: Subset) -> TorqueObjective:
        """Return the least-squares problem of the accelerations around a fitted subset."""
        point = self._fit_once(kept)[1]
        everything = np.arange(self.problem.W.shape[1])
        if point is None:
            X, y = self._search._first, self._search._first_right
        else:
            columns = self._sort_columns(kept)
            X = self._search.compute_slope(point, everything)
            y = point.residual.ravel() + X[:, columns] @ point.parameters
        factor: FloatArray = np.linalg.qr(np.column_stack([X, y]), mode="r")  # type: ignore[assignment]
        return TorqueObjective(self.problem.replace_data(factor))

    def estimate_gains(self, kept: Subset) -> FloatArray:
        """Return the fall of the error per column for the groups whose estimated fall is largest; -inf for groups that
        are not evaluated, (n_groups,).
        """
        promised = self._linearise(kept).estimate_gains(kept)
        result = np.full(promised.size, -np.inf)
        now = self.score(kept)
        for group in np.argsort(-promised, kind="stable")[:_PROPOSALS].tolist():
            if promised[group] > -np.inf:
                result[group] = (now - self.score((*kept, group))) / self.widths[group]
        return result

    def estimate_losses(self, kept: Subset) -> FloatArray:
        """Return the rise of the error per column for the groups whose estimated rise is smallest; inf for groups that
        are not evaluated, (n_groups,).
        """
        promised = self._linearise(kept).estimate_losses(kept)
        result = np.full(promised.size, np.inf)
        now = self.score(kept)
        for group in np.argsort(promised, kind="stable")[:_PROPOSALS].tolist():
            if promised[group] < np.inf:
                rise = self.score(remove_group(kept, group)) - now if len(kept) > 1 else 0.0
                result[group] = rise / self.widths[group]
        return result

    def swap_best(self, kept: Subset) -> Subset:
        """Return the best subset among the most promising swaps and the subset itself."""
        proposals = self._linearise(kept).list_promising_swaps(kept, _PROPOSALS)
        return min([kept, *proposals], key=self.score)

    def fit(self, subset: IntArray) -> Fit:
        """Fit the parameters that minimise the exact acceleration error."""
        torque = fit(self.problem, subset)
        point = self._final.fit(subset, self._final.estimate_start(subset))
        if point is None or point.error >= _HOPELESS:
            return torque
        error = compute_relative_error(self.problem, subset, point.parameters)
        return Fit(point.parameters, error, torque.minimum_norm)


def acceleration(problem: SelectionProblem, inputs: CriterionInputs) -> Objective:
    """Return the criterion of the exact acceleration error, with parameters fitted to the accelerations."""
    return AccelerationObjective(
        problem, inputs.accelerations(SEARCH_SAMPLES), inputs.accelerations(FIT_SAMPLES)
    )
