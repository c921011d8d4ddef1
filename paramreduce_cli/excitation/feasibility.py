"""Feasible starts of motions: loops closed, bounds kept.

Bounds are checked on a grid finer than the one optimised on; what they miss by between its
points is mended by drawing the motion together towards a resting position inside.
"""

import numpy as np
import scipy  # whose optimize is loaded when it is used

from paramreduce_cli.errors import Cause, DataError, NumericalError
from paramreduce_cli.excitation.excitation_objective import Bound, Excitation, FreeObjective
from paramreduce_cli.excitation.fourier import FourierBasis
from paramreduce_cli.multibody.loops.follower import Follower
from paramreduce_cli.records import FloatArray, JointLimits

_SMALLEST_SHARE = 1e-3
_SHRINKS = 0.8
_HALVINGS = 12
_FAR = 1e6
"""Stands for an infinite excess in the search."""
_WELL_INSIDE = 0.05
_INSET = 0.98
"""Share of the position range in which a resting position is looked for."""


def find_resting_position(
    excitation: Excitation,
    limits: JointLimits,
    margin: float = 1.0,
    preferred: FloatArray | None = None,
) -> FloatArray:
    """Return independent coordinates inside all limits and bounds, (n_dof,).

    Try the preferred position or else the middle of the limits, a search from there, then the assembly of loops and a
    search from there.

    Args:
        excitation: Excitation with the bounds.
        limits: Limits of the independent coordinates.
        margin: Fraction of the limits that may be used.
        preferred: Coordinates from which to search first, (n_dof,).

    Raises:
        NumericalError: No such position is found; the message names the bound that is exceeded.
    """
    mechanism = excitation.coordinates.mechanism
    middle, reach = limits.middle, _INSET * margin * limits.reach
    tried = [middle] if preferred is None else [np.clip(preferred, middle - reach, middle + reach)]
    if mechanism.loops is not None:
        home = mechanism.loops.assembly[list(mechanism.independent)]
        tried.append(np.clip(home, middle - reach, middle + reach))

    def worst(z: FloatArray) -> Bound:
        return excitation.find_worst_bound(z[None], Follower(excitation.coordinates))

    for z in list(tried):
        if worst(z).excess < 0:
            return z
        found = scipy.optimize.minimize(
            lambda z: float(np.clip(worst(z).excess, -1.0, _FAR)),
            z,
            method="Nelder-Mead",
            callback=_stop_inside,
            bounds=np.column_stack([middle - reach, middle + reach]),
            options={"maxfev": 200 * z.size, "xatol": 1e-6, "fatol": 1e-9},
        )
        if worst(found.x).excess < 0:
            return np.asarray(found.x)
        tried.append(found.x)
    nearest = min((worst(z) for z in tried), key=lambda bound: bound.excess)
    if np.isinf(nearest.excess):
        raise NumericalError(nearest.name, Cause.REACH)
    raise NumericalError(
        "no position of the mechanism was found that keeps all of them within the position limits: "
        f"{nearest.name} stands in the way. Loosen it or the position limits.",
        Cause.BOUNDS,
    )


def _stop_inside(intermediate_result: "scipy.optimize.OptimizeResult") -> None:
    """End the search well inside the bounds by raising StopIteration, which SciPy takes as the end."""
    if intermediate_result.fun < -_WELL_INSIDE:
        raise StopIteration


def shrink_to_feasible(free: FloatArray, still: FloatArray, objective: FreeObjective) -> FloatArray:
    """Shrink Fourier coefficients towards a resting position until the motion keeps the bounds.

    Args:
        free: Fourier coefficients before limits are applied, (n_dof, 1 + 2 harmonics).
        still: Coefficients of a motion that rests inside all bounds.
        objective: Objective, which is NaN outside the bounds.

    Raises:
        NumericalError: Even the smallest motion does not keep them.
    """
    fraction = 1.0
    while fraction > _SMALLEST_SHARE:
        drawn = still + fraction * (free - still)
        if np.isfinite(objective(drawn.ravel())[0]):
            return drawn
        fraction *= _SHRINKS
    nearest = objective.find_worst_bound(drawn.ravel())
    if nearest.excess < 0:
        raise NumericalError(
            "leave no motion: even the smallest about a position that keeps all bounds needs more. Raise "
            "them and the power limits, or move the position limits to where gravity is weaker.",
            Cause.LOADS,
        )
    if np.isinf(nearest.excess):
        raise NumericalError(
            f"no motion was found that keeps the loops closed; {nearest.name}", Cause.FULL_RANGE
        )
    raise NumericalError(
        "no motion was found that keeps them; even the smallest about a position that does is stopped "
        f"by {nearest.name}.",
        Cause.BOUNDED_MOTION,
    )


def shrink_inside_bounds(
    excitation: Excitation, coefficients: FloatArray, rest: FloatArray, basis: FourierBasis
) -> FloatArray:
    """Shrink a series towards a resting position until it keeps the bounds on a fine grid.

    Args:
        excitation: Excitation with the bounds.
        coefficients: Coefficients of a series, (n_dof, 1 + 2 harmonics).
        rest: Independent coordinates inside all bounds, (n_dof,).
        basis: Basis of the series on the fine grid.

    Raises:
        NumericalError: Hardly any motion keeps them there.
    """
    still = np.zeros_like(coefficients)
    still[:, 0] = rest

    def shrink(fraction: float) -> FloatArray:
        return still + fraction * (coefficients - still)

    def is_inside(fraction: float) -> bool:
        """Return whether the series, shrunk to a fraction, keeps all bounds."""
        z, dz, ddz = basis.evaluate(shrink(fraction))
        positions = Follower(excitation.coordinates)
        if excitation.find_worst_bound(z, positions).excess > 0:
            return False
        try:
            q = positions(z)
            excitation.coordinates.check_motion(basis.time, q)
        except DataError:
            return False
        return excitation.compute_load_ratio(q, dz, ddz) <= 1

    if is_inside(1.0):
        return coefficients
    low, high = 0.0, 1.0
    for _ in range(_HALVINGS):
        middle = (low + high) / 2
        low, high = (middle, high) if is_inside(middle) else (low, middle)
    if low == 0.0:
        raise NumericalError(
            "the grid is too coarse to keep the constraints between its points. Use more.",
            Cause.GRID,
        )
    return shrink(low)
