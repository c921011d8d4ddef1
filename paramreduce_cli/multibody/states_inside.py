"""Random states inside limits and constraints, on which models are looked at that hold within."""

from collections.abc import Sequence
from functools import cached_property

import numpy as np

from paramreduce_cli.multibody.loops.coordinates import Coordinates
from paramreduce_cli.multibody.quantities import Quantities
from paramreduce_cli.multibody.random_states import clear_of_singular
from paramreduce_cli.records import BoolArray, Constraint, FloatArray, Mechanism

_DRAWS = 20
"""Times that positions are drawn, as constraints may forbid most of them."""
_MOVES = 12
"""Random moves from a known position of loops, one after the other."""
_SHORTEST, _LONGEST = 0.01, 0.3
"""Of a move, as a share of the limits: most positions far away cannot be assembled."""

States = tuple[FloatArray, FloatArray, FloatArray]


class StatesInside:
    """Random states whose coordinates are drawn each by itself inside its limits.

    Positions of loops are reached from known ones by random moves, each taken where the loops can be
    followed, clear of singular configurations: after many, all that can be reached are as likely.

    Args:
        mechanism: The mechanism.
        lower: Least independent coordinates, velocities and accelerations, (3, n_dof).
        upper: The largest.
        constraints: That positions keep to besides.
        known: Generalised coordinates of some states, (n_known, n_q).
    """

    def __init__(
        self,
        mechanism: Mechanism,
        lower: FloatArray,
        upper: FloatArray,
        constraints: Sequence[Constraint],
        known: FloatArray,
    ) -> None:
        self.lower, self.upper = lower, upper
        self._mechanism, self._known = mechanism, known
        self._quantities = Quantities(mechanism, constraints)

    @cached_property
    def _coordinates(self) -> Coordinates:
        return Coordinates(self._mechanism)

    def drawn(self, count: int, rng: np.random.Generator, *, corners: bool = False) -> States:
        """q, dq and ddq, each (count, n_q); fewer where so many are not found.

        Args:
            count: Number of states.
            rng: Where they come from.
            corners: Whether every coordinate is at one of its limits; positions of loops never are.
        """
        if self._mechanism.loops is not None:
            q = self._moved(count, rng)
            dz, ddz = self._anywhere(len(q), rng, corners)[:, 1:].swapaxes(0, 1)
            return (q, *self._coordinates.rates(q, dz, ddz))
        kept = np.empty((0, *self.lower.shape))
        for _ in range(_DRAWS):
            some = self._anywhere(count, rng, corners)
            kept = np.concatenate([kept, some[self._allowed(some[:, 0])]])[:count]
            if len(kept) == count:
                break
        return kept[:, 0], kept[:, 1], kept[:, 2]

    def _anywhere(self, count: int, rng: np.random.Generator, corners: bool) -> FloatArray:
        """Between the limits, or at them, (count, 3, n_dof)."""
        shape = (count, *self.lower.shape)
        if corners:
            return np.where(rng.random(shape) < 0.5, self.lower, self.upper)
        return rng.uniform(self.lower, self.upper, size=shape)

    def _allowed(self, q: FloatArray) -> BoolArray:
        """Whether positions keep to limits and constraints, (n_samples,)."""
        z = q[:, list(self._mechanism.independent)]
        inside = ((z >= self.lower[0]) & (z <= self.upper[0])).all(axis=1)
        return np.asarray(inside & (self._quantities.rows(q) <= 0).all(axis=1))

    def _moved(self, count: int, rng: np.random.Generator) -> FloatArray:
        """Positions of loops that were reached, (count, n_q)."""
        independent = list(self._mechanism.independent)
        q = self._known[rng.integers(len(self._known), size=count)]
        reach = self.upper[0] - self.lower[0]
        for _ in range(_MOVES):
            length = np.exp(rng.uniform(np.log(_SHORTEST), np.log(_LONGEST), size=(count, 1)))
            moves = length * rng.uniform(-1, 1, size=(count, reach.size)) * reach
            z = q[:, independent] + moves
            tried = np.flatnonzero(((z >= self.lower[0]) & (z <= self.upper[0])).all(axis=1))
            found, way = self._coordinates.follow(z[tried], q[tried])
            taken = (way == 1) & self._allowed(found) & clear_of_singular(self._coordinates, found)
            q[tried[taken]] = found[taken]
        return q[self._allowed(q) & clear_of_singular(self._coordinates, q)]
