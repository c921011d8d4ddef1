"""Random states inside limits and constraints, on which models are tested."""

from collections.abc import Sequence
from functools import cached_property

import numpy as np

from paramreduce_cli.multibody.loops.coordinates import Coordinates
from paramreduce_cli.multibody.quantities import Quantities
from paramreduce_cli.records import BoolArray, Constraint, FloatArray, Mechanism

_DRAWS = 20
"""Times that states are drawn, as constraints may forbid most of them."""
_MOVES = 12
"""Random moves from a known position of loops, one after the other."""
_SHORTEST, _LONGEST = 0.01, 0.3
"""Of a move, as a share of the limits: most positions far away cannot be assembled."""
_DRIFT = 0.5
"""Drift of the accelerations of dependent coordinates, what velocities may cause."""

States = tuple[FloatArray, FloatArray, FloatArray]


class StatesInside:
    """A sampler of random states inside limits and constraints.

    Positions of loops are reached from known ones by random moves that come no nearer to a singular configuration than
    the known ones. Velocities and accelerations are reduced until those of the dependent coordinates are inside their
    limits too.

    Args:
        mechanism: The mechanism.
        lower: Least coordinates, velocities and accelerations, (3, n_q).
        upper: The largest.
        constraints: Constraints that positions keep in addition.
        known_positions: Generalised coordinates of some states, (n_known, n_q).
    """

    def __init__(
        self,
        mechanism: Mechanism,
        lower: FloatArray,
        upper: FloatArray,
        constraints: Sequence[Constraint],
        known_positions: FloatArray,
    ) -> None:
        self._mechanism, self._known = mechanism, known_positions
        self._lower, self._upper = lower, upper
        self._independent = list(mechanism.independent)
        self._quantities = Quantities(mechanism, constraints)

    @cached_property
    def _coordinates(self) -> Coordinates:
        return Coordinates(self._mechanism)

    @cached_property
    def _nearest(self) -> float:
        """Distance to singularity of the known position that is nearest to one."""
        return float(self._coordinates.compute_distance(self._known).min())

    def draw(self, count: int, rng: np.random.Generator, *, corners: bool = False) -> States:
        """Return ``count`` random q, dq and ddq, (count, n_q) each; fewer if not enough are found.

        Args:
            count: Number of states.
            rng: Random generator.
            corners: Whether every coordinate is at one of its limits; positions of loops never are.
        """
        if self._mechanism.loops is not None:
            q = self._walk(count, rng)
            return self._shorten(q, self._draw_independent(len(q), rng, corners))
        kept = np.empty((0, *self._lower.shape))
        for _ in range(_DRAWS):
            some = self._draw_independent(count, rng, corners)
            kept = np.concatenate([kept, some[self._are_inside(some[:, 0])]])[:count]
            if len(kept) == count:
                break
        return kept[:, 0], kept[:, 1], kept[:, 2]

    def _draw_independent(self, count: int, rng: np.random.Generator, corners: bool) -> FloatArray:
        """Return independent coordinates and their derivatives between the limits, or at them, (count, 3, n_dof)."""
        lower, upper = self._lower[:, self._independent], self._upper[:, self._independent]
        shape = (count, *lower.shape)
        if corners:
            return np.where(rng.random(shape) < 0.5, lower, upper)
        return rng.uniform(lower, upper, size=shape)

    def _are_inside(self, q: FloatArray) -> BoolArray:
        """Return whether positions keep limits and constraints and, with loops, are no nearer to a singular
        configuration than the known positions, (n_samples,).
        """
        inside = ((q >= self._lower[0]) & (q <= self._upper[0])).all(axis=1)
        if self._mechanism.loops is not None:
            inside &= self._coordinates.compute_distance(q) >= self._nearest
        return np.asarray(inside & (self._quantities.compute_rows(q) <= 0).all(axis=1))

    def _walk(self, count: int, rng: np.random.Generator) -> FloatArray:
        """Return random positions of loops, reached by moves from known positions, (n_found, n_q).

        Positions outside limits or constraints are left out, so that there may be fewer than ``count``.
        """
        lower, upper = self._lower[0, self._independent], self._upper[0, self._independent]
        q = self._known[rng.integers(len(self._known), size=count)]
        for _ in range(_MOVES):
            length = np.exp(rng.uniform(np.log(_SHORTEST), np.log(_LONGEST), size=(count, 1)))
            moves = length * rng.uniform(-1, 1, size=(count, lower.size)) * (upper - lower)
            z = q[:, self._independent] + moves
            tried = np.flatnonzero(((z >= lower) & (z <= upper)).all(axis=1))
            found, progress = self._coordinates.follow(z[tried], q[tried])
            accepted = (progress == 1) & self._are_inside(found)
            q[tried[accepted]] = found[accepted]
        return q[self._are_inside(q)]

    def _shorten(self, q: FloatArray, drawn: FloatArray) -> States:
        """Return q, dq and ddq of loops at positions q, each (n_samples, n_q).

        Drawn velocities and accelerations are reduced where a velocity or an acceleration of any coordinate would
        exceed a limit, or where velocities alone would cause more than half of the largest accelerations.

        Args:
            q: Positions, (n_samples, n_q).
            drawn: Independent positions, which are not used, then velocities and accelerations, (n_samples, 3, n_dof).
        """
        rates, (_, dz, ddz) = self._coordinates.compute_rates, np.moveaxis(drawn, 1, 0)
        still = np.zeros_like(dz)
        dq, _ = rates(q, dz, still)
        dz = dz * _compute_ratios(dq, self._lower[1], self._upper[1])
        _, drift = rates(q, dz, still)  # grows with the square of the velocities
        dz = dz * np.sqrt(_compute_ratios(drift, _DRIFT * self._lower[2], _DRIFT * self._upper[2]))
        _, drift = rates(q, dz, still)
        _, ddq = rates(q, dz, ddz)
        ddz = ddz * _compute_ratios(ddq - drift, self._lower[2] - drift, self._upper[2] - drift)
        return (q, *rates(q, dz, ddz))


def _compute_ratios(rates: FloatArray, lower: FloatArray, upper: FloatArray) -> FloatArray:
    """Return the largest factor, at most one, by which all rates of a sample can be multiplied to lie inside limits
    around zero, (n_samples, 1).
    """
    bound = np.where(rates > 0, upper, lower)
    shares = np.divide(bound, rates, out=np.ones_like(rates), where=rates != 0)
    return np.asarray(np.clip(shares, 0.0, 1.0).min(axis=1, keepdims=True))
