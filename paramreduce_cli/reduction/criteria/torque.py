"""The Euclidean torque error as a criterion, in closed form."""

from collections.abc import Iterator

import numpy as np

from paramreduce_cli.multibody.orthogonal import DEPENDENT, Orthogonaliser
from paramreduce_cli.records import FloatArray, IntArray
from paramreduce_cli.reduction.inputs import CriterionInputs
from paramreduce_cli.reduction.objective import Objective, Units, without
from paramreduce_cli.reduction.problem import FULL_PRECISION, SelectionProblem, first_of_the_best


def torque(problem: SelectionProblem, inputs: CriterionInputs) -> Objective:
    """The Euclidean error of the torques."""
    return TorqueObjective(problem)


class TorqueObjective(Objective):
    """Least squares of the torques: scores are errors as shares of them."""

    def __init__(self, problem: SelectionProblem) -> None:
        super().__init__(problem)
        self._X = problem.X
        self._own = np.ascontiguousarray(problem.X[:, problem.columns])
        self._taken: tuple[Units, Orthogonaliser] = ((), self._nothing_taken())

    def _nothing_taken(self) -> Orthogonaliser:
        return Orthogonaliser(self._own, self.problem.y)

    def score(self, kept: Units) -> float:
        """Torque error of the least-squares fit."""
        X = self._X[:, self.columns(kept)]
        solution = np.linalg.lstsq(X, self.problem.y, rcond=DEPENDENT)[0]
        return float(np.linalg.norm(self.problem.y - X @ solution))

    def gains(self, kept: Units) -> FloatArray:
        """By how much the squared error falls; once nothing but round-off is left of the torques,
        the share of a unit that is independent of the subset.
        """
        rest = self._rest(kept)
        squared = rest.squared_lengths()
        if rest.y @ rest.y <= FULL_PRECISION**2:
            shares = self.per_unit(squared)
            return np.where(shares > 0, shares, -np.inf)
        dependent = squared == 0
        squared[dependent] = 1.0
        gains = (rest.y @ rest.X) ** 2 / squared
        gains[dependent] = -np.inf
        return gains if self.single else self._group_gains(rest, gains)

    def _group_gains(self, rest: Orthogonaliser, gains: FloatArray) -> FloatArray:
        """Of units of several columns: what these explain together, per column."""
        result = np.full(self.widths.size, -np.inf)
        for unit, width in enumerate(self.widths.tolist()):
            own = np.flatnonzero((self.owner == unit) & (gains > -np.inf))
            if own.size and width == 1:
                result[unit] = gains[own[0]]
            elif own.size:
                X = rest.X[:, own]
                explained = X @ np.linalg.lstsq(X, rest.y, rcond=DEPENDENT)[0]
                result[unit] = explained @ explained / width
        return result

    def losses(self, kept: Units) -> FloatArray:
        """By how much the squared error rises. Where removals are free, the squared torques of the
        free units in the fit of least norm, whose unknowns are the torques that the parameters
        cause; costs that are round-off are ties.
        """
        ordered = sorted(kept)
        result = np.full(len(self.units), np.inf)
        costs = _removal_costs(self._X, self.problem.y, [self.units[u] for u in ordered])
        costs[costs < FULL_PRECISION**2] = 0.0
        result[ordered] = costs
        return result

    def exchanged(self, kept: Units) -> Units:
        """By the closed form of the error after an exchange; groups one by one."""
        if not self.single:
            out, into, error = min(
                self._one_by_one(kept), key=lambda exchange: exchange[2], default=(-1, -1, np.inf)
            )
            return (*without(kept, out), into) if error < self.score(kept) else kept
        improvement = self._improvements(kept)
        if improvement is None or not np.any(improvement > 0):
            return kept
        best = first_of_the_best(improvement.ravel())
        place, unit = divmod(best, len(self.units))
        return (*without(kept, kept[place]), unit)

    def promising_exchanges(self, kept: Units, most: int) -> list[Units]:
        """The subsets after the exchanges that improve most, or worsen least."""
        improvement = self._improvements(kept) if self.single else None
        if improvement is None:
            found = sorted(self._one_by_one(kept), key=lambda exchange: exchange[2])[:most]
            return [(*without(kept, out), into) for out, into, _ in found]
        order = np.argsort(-improvement, axis=None, kind="stable")[:most]
        pairs = [divmod(int(k), len(self.units)) for k in order]
        return [
            (*without(kept, kept[place]), unit)
            for place, unit in pairs
            if improvement[place, unit] > -np.inf
        ]

    def exchanges_within(self, kept: Units, limit: float) -> list[tuple[int, int, float]]:
        """Exchanges that leave at most this error: the unit out, the one in, the error."""
        improvement = self._improvements(kept) if self.single else None
        if improvement is None:
            return [exchange for exchange in self._one_by_one(kept) if exchange[2] <= limit]
        errors = np.sqrt(np.maximum(self.score(kept) ** 2 - improvement, 0.0))
        places, units = np.nonzero(errors <= limit)
        return [
            (kept[place], int(unit), float(errors[place, unit]))
            for place, unit in zip(places, units, strict=True)
        ]

    def _improvements(self, kept: Units) -> FloatArray | None:
        """Fall of the squared error for every exchange, (n_kept, n_units); None if dependent.

        With r and e what the subset leaves of another column and of chi, b the subset's
        coefficients in either and P = (X'X)^-1: without column i these become r + b_i u and
        e + b_i u with |u|^2 = 1 / P_ii, orthogonal to r and e.
        """
        columns = self.columns(kept)
        if columns.size > self._X.shape[0]:
            return None
        Q, R = np.linalg.qr(self._X[:, columns])
        diagonal = np.abs(np.diag(R))
        if diagonal.min() <= DEPENDENT:
            return None
        both = np.column_stack([self._own, self.problem.y])
        projected = Q.T @ both
        left = both - Q @ projected
        inverse = np.linalg.inv(R)
        b = inverse @ projected
        P = np.einsum("ij,ij->i", inverse, inverse)[:, None]
        squares = np.einsum("ij,ij->j", left[:, :-1], left[:, :-1])[None, :] + b[:, :-1] ** 2 / P
        products = (left[:, -1] @ left[:, :-1])[None, :] + b[:, :-1] * b[:, -1:] / P
        possible = squares > DEPENDENT**2
        possible[:, list(kept)] = False
        gains = products**2 / np.where(possible, squares, 1.0)
        result: FloatArray = np.where(possible, gains - b[:, -1:] ** 2 / P, -np.inf)
        return result

    def _one_by_one(self, kept: Units) -> Iterator[tuple[int, int, float]]:
        """For every unit the best of its width in its place, and the error."""
        for unit in kept:
            rest = without(kept, unit)
            gains = self.gains(rest)
            gains[self.widths != self.widths[unit]] = -np.inf
            gains[unit] = -np.inf
            if np.any(gains > -np.inf):
                into = first_of_the_best(gains)
                yield unit, into, self.score((*rest, into))

    def _rest(self, kept: Units) -> Orthogonaliser:
        """What is left by a subset; quick where it extends the one asked for before."""
        taken, rest = self._taken
        if kept[: len(taken)] != taken:
            taken, rest = (), self._nothing_taken()
        for unit in kept[len(taken) :]:
            for column in [unit] if self.single else np.flatnonzero(self.owner == unit).tolist():
                rest.take(column)
        self._taken = (kept, rest)
        return rest


def _removal_costs(X: FloatArray, y: FloatArray, units: list[IntArray]) -> FloatArray:
    """What each unit's removal costs per column, (n_units,); infinite where others are free."""
    columns = np.concatenate(units)
    sizes = np.array([unit.size for unit in units])
    parts = np.split(np.arange(columns.size), np.cumsum(sizes)[:-1])
    U, s, Vt = np.linalg.svd(X[:, columns], full_matrices=True)
    rank = int(np.sum(s > DEPENDENT * s[0]))
    phi = Vt[:rank].T @ ((U[:, :rank].T @ y) / s[:rank])
    null = Vt[rank:].T
    if rank < columns.size:
        free = [np.linalg.matrix_rank(null[part], tol=1e-6) == part.size for part in parts]
        if any(free):
            own = [
                float(phi[p] @ phi[p]) if f else np.inf for p, f in zip(parts, free, strict=True)
            ]
            return np.array(own) / sizes
        return np.array([_rise(X[:, columns], y, part) for part in parts]) / sizes
    inverse = (Vt.T / s**2) @ Vt
    if (sizes == 1).all():
        alone: FloatArray = phi**2 / np.diag(inverse)
        return alone
    rises = [phi[p] @ np.linalg.solve(inverse[np.ix_(p, p)], phi[p]) for p in parts]
    return np.array(rises) / sizes


def _rise(X: FloatArray, y: FloatArray, part: IntArray) -> float:
    """Rise of the squared error without some columns, by fitting twice."""

    def squared_error(kept: FloatArray) -> float:
        left = y - kept @ np.linalg.lstsq(kept, y, rcond=DEPENDENT)[0] if kept.size else y
        return float(left @ left)

    return squared_error(np.delete(X, part, axis=1)) - squared_error(X)
