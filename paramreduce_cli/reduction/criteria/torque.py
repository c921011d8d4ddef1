"""Criterion of the Euclidean torque error, in closed form."""

from collections.abc import Iterator, Sequence

import numpy as np

from paramreduce_cli.multibody.orthogonal import DEPENDENT, Orthogonaliser, orthogonalise
from paramreduce_cli.records import FloatArray, IntArray
from paramreduce_cli.reduction.inputs import CriterionInputs
from paramreduce_cli.reduction.objective import Objective, Subset, remove_group
from paramreduce_cli.reduction.problem import FULL_PRECISION, SelectionProblem, find_first_best


def torque(problem: SelectionProblem, inputs: CriterionInputs) -> Objective:
    """Return the criterion of the Euclidean torque error."""
    return TorqueObjective(problem)


class TorqueObjective(Objective):
    """The torque error of least-squares fits, as a fraction of the torques."""

    def __init__(self, problem: SelectionProblem) -> None:
        super().__init__(problem)
        self._X = problem.X
        self._own = np.ascontiguousarray(problem.X[:, problem.columns])
        self._taken: tuple[Subset, Orthogonaliser] = ((), self._start_orthogonaliser())

    def _start_orthogonaliser(self) -> Orthogonaliser:
        return Orthogonaliser(self._own, self.problem.y)

    def score(self, kept: Subset) -> float:
        """Return the torque error of the least-squares fit."""
        Q, _, _ = orthogonalise(self._X[:, self.list_columns(kept)])
        return float(np.linalg.norm(self.problem.y - Q @ (Q.T @ self.problem.y)))

    def estimate_gains(self, kept: Subset) -> FloatArray:
        """Return the fall of the squared error per column, (n_groups,).

        If only round-off is left of the torques, return the share of each group that is independent of the subset.
        """
        rest = self._project_out(kept)
        squared = rest.compute_squared_lengths()
        if rest.y @ rest.y <= FULL_PRECISION**2:
            shares = self.average_by_group(squared)
            return np.where(shares > 0, shares, -np.inf)
        dependent = squared == 0
        squared[dependent] = 1.0
        gains = (rest.y @ rest.X) ** 2 / squared
        gains[dependent] = -np.inf
        return gains if self.single else self._add_group_gains(rest, gains)

    def _add_group_gains(self, rest: Orthogonaliser, gains: FloatArray) -> FloatArray:
        """Return the gain of each group per column, (n_groups,): the fall of the squared error if all columns of the
        group are added. The gain of dependent groups is -inf.
        """
        result = np.full(self.widths.size, -np.inf)
        for group, width in enumerate(self.widths.tolist()):
            members = self._find_own_columns(np.array([group]))
            own = members[gains[members] > -np.inf]
            if own.size and width == 1:
                result[group] = gains[own[0]]
            elif own.size:
                X = rest.X[:, own]
                explained = X @ np.linalg.lstsq(X, rest.y, rcond=DEPENDENT)[0]
                result[group] = explained @ explained / width
        return result

    def estimate_losses(self, kept: Subset) -> FloatArray:
        """Return the rise of the squared error per column, (n_groups,).

        If removals are free, return the squared torques of the free groups in the fit of least norm, whose unknowns are
        the torques that the parameters cause. Costs that are round-off are ties.
        """
        ordered = sorted(kept)
        result = np.full(len(self.groups), np.inf)
        costs = _compute_removal_costs(self._X, self.problem.y, [self.groups[u] for u in ordered])
        costs[costs < FULL_PRECISION**2] = 0.0
        result[ordered] = costs
        return result

    def swap_best(self, kept: Subset) -> Subset:
        """Return the subset after the best swap, by a closed formula."""
        improvement = self._compute_improvements(kept)
        if improvement is None or not np.any(improvement > 0):
            return kept
        best = find_first_best(improvement.ravel())
        place, group = divmod(best, len(self.groups))
        return (*remove_group(kept, kept[place]), group)

    def list_promising_swaps(self, kept: Subset, most: int) -> list[Subset]:
        """Return the subsets after the swaps that lower the error most, or raise it least."""
        improvement = self._compute_improvements(kept)
        if improvement is None:
            found = sorted(self._try_one_by_one(kept), key=lambda exchange: exchange[2])[:most]
            return [(*remove_group(kept, out), into) for out, into, _ in found]
        order = np.argsort(-improvement, axis=None, kind="stable")[:most]
        pairs = [divmod(int(k), len(self.groups)) for k in order]
        return [
            (*remove_group(kept, kept[place]), group)
            for place, group in pairs
            if improvement[place, group] > -np.inf
        ]

    def list_swaps_within(self, kept: Subset, limit: float) -> list[tuple[int, int, float]]:
        """Return the swaps that leave an error of at most ``limit``: (removed, added, error) each.

        These are all such swaps if the subset is independent; otherwise at most one for each removed group, with the best
        group of its width.
        """
        improvement = self._compute_improvements(kept)
        if improvement is None:
            return [exchange for exchange in self._try_one_by_one(kept) if exchange[2] <= limit]
        errors = np.sqrt(np.maximum(self.score(kept) ** 2 - improvement, 0.0))
        indices, groups = np.nonzero(errors <= limit)
        return [
            (kept[place], int(group), float(errors[place, group]))
            for place, group in zip(indices, groups, strict=True)
        ]

    def _compute_improvements(self, kept: Subset) -> FloatArray | None:
        """Return the fall of the squared error for every swap, (n_kept, n_groups), or None if the subset is dependent.

        With groups of several columns a subset may be dependent; the fall is then at least the one returned.

        Let r and e be the residuals of another column and of chi after projection on the subset, b the coefficients of
        either on the subset, and P = (X'X)^-1. Without column i these residuals become r + b_i u and e + b_i u with
        |u|^2 = 1 / P_ii, where u is orthogonal to r and e.
        """
        columns = self.list_columns(kept)
        Q, R, independent = orthogonalise(self._X[:, columns])
        if self.single and independent.size < columns.size:
            return None
        both = np.column_stack([self._own, self.problem.y])
        projected = Q.T @ both
        left = both - Q @ projected
        inverse = np.asarray(np.linalg.inv(R), dtype=float)
        b = np.asarray(inverse @ projected, dtype=float)
        if not self.single:
            place = np.repeat(np.arange(len(kept)), self.widths[list(kept)])[independent]
            rows = [np.flatnonzero(place == k) for k in range(len(kept))]
            return self._compute_group_improvements(kept, rows, left, b, inverse)
        P = np.einsum("ij,ij->i", inverse, inverse)[:, None]
        squares = np.einsum("ij,ij->j", left[:, :-1], left[:, :-1])[None, :] + b[:, :-1] ** 2 / P
        products = (left[:, -1] @ left[:, :-1])[None, :] + b[:, :-1] * b[:, -1:] / P
        possible = squares > DEPENDENT**2
        possible[:, list(kept)] = False
        gains = products**2 / np.where(possible, squares, 1.0)
        result: FloatArray = np.where(possible, gains - b[:, -1:] ** 2 / P, -np.inf)
        return result

    def _compute_group_improvements(
        self,
        kept: Subset,
        rows: Sequence[IntArray],
        left: FloatArray,
        b: FloatArray,
        inverse: FloatArray,
    ) -> FloatArray:
        """Return the fall of the squared error for every swap of groups of the same width, (n_kept, n_groups).

        Without the columns of a group, the residuals of other columns and of chi gain parts along as many directions: C,
        with C'C = b'P^-1 b for the rows of b of the group, and P the group's block of (X'X)^-1.

        Args:
            kept: Groups of the subset.
            rows: Rows of b of each of these groups; none for columns that depend on others.
            left: Residuals of all columns and of chi, (k, n + 1).
            b: Their coefficients on the independent columns of the subset, (rank, n + 1).
            inverse: Inverse of the triangular factor of the subset's columns.
        """
        result = np.full((len(kept), len(self.groups)), -np.inf)
        for width in np.unique(self.widths[list(kept)]).tolist():
            others = np.setdiff1d(np.flatnonzero(self.widths == width), kept)
            if not others.size:
                continue
            columns = self._find_own_columns(others).reshape(-1, width)
            own = left[:, columns]
            gram = np.einsum("kgi,kgj->gij", own, own)
            products = np.einsum("kgi,k->gi", own, left[:, -1])
            for place, part in enumerate(rows):
                if self.widths[kept[place]] != width:
                    continue
                C = np.linalg.solve(np.linalg.cholesky(inverse[part] @ inverse[part].T), b[part])
                added, ends = C[:, columns], C[:, -1]
                values, vectors = np.linalg.eigh(gram + np.einsum("kgi,kgj->gij", added, added))
                along = np.einsum(
                    "gij,gi->gj", vectors, products + np.einsum("kgi,k->gi", added, ends)
                )
                independent = values > DEPENDENT**2
                gains = np.sum(along**2 / np.where(independent, values, np.inf), axis=1)
                possible = independent.any(axis=1)
                result[place, others] = np.where(possible, gains - ends @ ends, -np.inf)
        return result

    def _try_one_by_one(self, kept: Subset) -> Iterator[tuple[int, int, float]]:
        """Yield for every group the best group of its width in its place, and the error."""
        for group in kept:
            rest = remove_group(kept, group)
            gains = self.estimate_gains(rest)
            gains[self.widths != self.widths[group]] = -np.inf
            gains[group] = -np.inf
            if np.any(gains > -np.inf):
                into = find_first_best(gains)
                yield group, into, self.score((*rest, into))

    def _project_out(self, kept: Subset) -> Orthogonaliser:
        """Return the residuals of all columns after projection on a subset; quick if the subset extends the previous
        one.
        """
        projected, rest = self._taken
        if kept[: len(projected)] != projected:
            projected, rest = (), self._start_orthogonaliser()
        added = np.array(kept[len(projected) :], dtype=np.int64)
        if added.size:
            rest.take_all(added if self.single else self._find_own_columns(added))
        self._taken = (kept, rest)
        return rest

    def _find_own_columns(self, groups: IntArray) -> IntArray:
        """Return the positions of the columns of some groups among all columns, group by group."""
        ends = np.cumsum(self.widths)
        return np.concatenate([np.arange(ends[g] - self.widths[g], ends[g]) for g in groups])


def _compute_removal_costs(X: FloatArray, y: FloatArray, groups: list[IntArray]) -> FloatArray:
    """Return the cost of removing each group, per column, (n_groups,): the rise of the squared error, or infinity if
    other removals are free; free ones are compared by the squares of their minimum-norm parameters.
    """
    columns = np.concatenate(groups)
    sizes = np.array([group.size for group in groups])
    parts = np.split(np.arange(columns.size), np.cumsum(sizes)[:-1])
    U, s, Vt = np.linalg.svd(X[:, columns], full_matrices=True)
    rank = int(np.sum(s > DEPENDENT * s[0]))
    phi = Vt[:rank].T @ ((U[:, :rank].T @ y) / s[:rank])
    null = Vt[rank:].T
    if rank < columns.size:
        free = [np.linalg.matrix_rank(null[part], tol=1e-6) == part.size for part in parts]
        if any(free):
            torques = [
                float(phi[p] @ phi[p]) if f else np.inf for p, f in zip(parts, free, strict=True)
            ]
            return np.array(torques) / sizes
        own = X[:, columns]
        whole = _compute_squared_error(own, y)
        rises = [_compute_squared_error(np.delete(own, part, axis=1), y) - whole for part in parts]
        return np.array(rises) / sizes
    inverse = (Vt.T / s**2) @ Vt
    if (sizes == 1).all():
        alone: FloatArray = phi**2 / np.diag(inverse)
        return alone
    rises = [phi[p] @ np.linalg.solve(inverse[np.ix_(p, p)], phi[p]) for p in parts]
    return np.array(rises) / sizes


def _compute_squared_error(X: FloatArray, y: FloatArray) -> float:
    """Return the squared error of the least-squares fit of y by columns of unit length."""
    Q, _, _ = orthogonalise(X)
    left = y - Q @ (Q.T @ y)
    return float(left @ left)
