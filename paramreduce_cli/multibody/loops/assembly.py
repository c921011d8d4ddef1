"""Assembly of loops: they are closed once, and the description is checked.

Ranks are decided on several configurations reached from the assembly by small random moves,
so that one singular configuration is not taken for a property of the mechanism.
"""

import dataclasses
import warnings
from collections.abc import Iterable, Sequence

import casadi as ca
import numpy as np
import scipy.linalg
import scipy.optimize

from paramreduce_cli.errors import Cause, NumericalError, ParamreduceWarning
from paramreduce_cli.multibody.kinematics import compute_body_poses
from paramreduce_cli.multibody.loops.closures import CLOSURES, express_equations, list_owners
from paramreduce_cli.multibody.orthogonal import select_independent
from paramreduce_cli.records import BASE, FloatArray, IntArray, Loops, Mechanism

_ASSEMBLED = 1e-9
"""Largest gap of an assembled loop, m."""
_RANK = 1e-7
"""Share of its length that must be left of a row or column that counts as independent."""
_ROUNDING = 1e-9
"""Share of the longest row of the Jacobian below which a row is zero to rounding."""
_MOVES = 8
_MOVE = 0.05
"""Length of a random move, rad or m."""
_SEED = 0
_RESTARTS = np.repeat([0.1, 0.3, 1.0], 5)
"""Sizes of the random moves from a guess of zeros, rad or m."""
_MODE_STARTS, _MODE_MOVES = 24, (0.5, 1.0, 2.0)
"""Random starts for other assembly modes, and their sizes, rad or m."""
_ANOTHER_MODE = 1e-3
"""Difference of a coordinate from which on an assembly mode is another one, rad or m."""


def assemble(mechanism: Mechanism) -> Mechanism:
    """Return the mechanism with its loops closed, and with the independent coordinates at the values of the guess.

    If these values are all zero and the loops do not close there, use the configuration found with all coordinates
    free, with a warning.

    Raises:
        NumericalError: The loops cannot be closed from the guess, equations are redundant, or the
            independent coordinates are too many, too few or not independent.
    """
    loops = mechanism.loops
    if loops is None:
        return mechanism
    equations = _Equations(mechanism)
    if not mechanism.dependent:
        raise NumericalError(
            "all coordinates are named, so that the closures have "
            "none left to determine. Leave out those that the loops determine.",
            Cause.INDEPENDENT,
        )
    nearest = _close_nearby(equations, mechanism, loops)
    jacobians = [
        equations.compute_jacobian(c) for c in [nearest, *_list_nearby(equations, nearest)]
    ]
    kept = _choose_equations(mechanism, loops, jacobians)
    rows = [jacobian[kept] for jacobian in jacobians]
    _check_choice(mechanism, rows)
    q = _close_as_given(equations, mechanism, loops, nearest)
    _check_regular(mechanism, equations.compute_jacobian(q)[kept])
    _check_hinges(mechanism, loops, q)
    whole = len(kept) == len(jacobians[0])
    found = dataclasses.replace(loops, assembly=q, kept=None if whole else tuple(kept))
    return dataclasses.replace(mechanism, loops=found)


def find_assembly(mechanism: Mechanism, driven: Sequence[int]) -> tuple[FloatArray, list[int]]:
    """Close the loops with all coordinates free to move, and choose coordinates that determine all others.

    Args:
        mechanism: Mechanism with loops, with any choice of independent coordinates; the guess is the start.
        driven: Positions of the coordinates that should be independent if possible, the most preferred first.

    Returns:
        Generalised coordinates with closed loops, (n_q,), and positions of independent ones.

    Raises:
        NumericalError: The loops cannot be closed from the guess.
    """
    assert mechanism.loops is not None
    equations = _Equations(mechanism)
    q = _close_nearby(equations, mechanism, mechanism.loops)
    jacobian, rows = _choose_generic(
        [equations.compute_jacobian(c) for c in [q, *_list_nearby(equations, q)]]
    )
    in_loops = _find_loop_coordinates(mechanism)
    others = np.array([k for k in in_loops if k not in driven], dtype=np.int64)
    # Those that are determined best come first, and what is left over determines them.
    _, pivots = scipy.linalg.qr(jacobian[rows][:, others], mode="r", pivoting=True)
    turned = [k for k in reversed(driven) if k in in_loops]
    order = np.array([*others[pivots], *turned], dtype=np.int64)
    dependent = set(select_independent(jacobian, order, _RANK))
    return q, [k for k in range(mechanism.n_q) if k not in dependent]


def find_assembly_modes(mechanism: Mechanism, most: int = 3) -> list[Mechanism]:
    """Find other configurations in which the loops are closed with the same independent coordinates.

    Args:
        mechanism: A mechanism with assembled loops.
        most: Largest number of modes to return, the nearest ones.

    Returns:
        The mechanism in those modes that were found from random starts; singular ones are left out.
    """
    loops = mechanism.loops
    assert loops is not None
    whole = dataclasses.replace(mechanism, loops=dataclasses.replace(loops, kept=None))
    equations = _Equations(whole)
    kept = slice(None) if loops.kept is None else list(loops.kept)
    dependent = list(mechanism.dependent)
    turns = [k for k in dependent if mechanism.bodies[k].joint == "revolute"]
    rng = np.random.default_rng(_SEED)
    modes = [loops.assembly]
    for _ in range(_MODE_STARTS):
        start = loops.assembly.copy()
        start[dependent] += rng.normal(size=len(dependent)) * rng.choice(_MODE_MOVES)
        try:
            moved = dataclasses.replace(loops, assembly=start)
            q = _close(equations, mechanism, moved, dependent)
            _check_regular(mechanism, equations.compute_jacobian(q)[kept])
            _check_hinges(mechanism, loops, q)
        except NumericalError:
            continue
        q[turns] = loops.assembly[turns] + _wrap_angles(q[turns] - loops.assembly[turns])
        if all(np.abs(q - known).max() > _ANOTHER_MODE for known in modes):
            modes.append(q)
    others = sorted(modes[1:], key=lambda q: float(np.linalg.norm(q - loops.assembly)))[:most]
    return [
        dataclasses.replace(mechanism, loops=dataclasses.replace(loops, assembly=q)) for q in others
    ]


def _wrap_angles(angles: FloatArray) -> FloatArray:
    """Return angles between minus and plus half a turn."""
    result: FloatArray = np.angle(np.exp(1j * angles))
    return result


class _Equations:
    """The closure equations Phi and their Jacobian in numbers, at one configuration."""

    def __init__(self, mechanism: Mechanism) -> None:
        q = ca.SX.sym("q", mechanism.n_q)
        phi = express_equations(mechanism, q)
        self._function = ca.Function("phi", [q], [phi, ca.jacobian(phi, q)])

    def evaluate(self, q: FloatArray) -> FloatArray:
        return np.array(self._function(q)[0]).ravel()

    def compute_jacobian(self, q: FloatArray) -> FloatArray:
        return np.array(self._function(q)[1])


def _close(
    equations: _Equations, mechanism: Mechanism, loops: Loops, moving: Iterable[int]
) -> FloatArray:
    """Move some coordinates from the guess until the loops are closed, and return the configuration.

    Raises:
        NumericalError: The loops stay open; the message says by how much, and which closure most.
    """
    free = list(moving)
    start = loops.assembly

    def insert_free(values: FloatArray) -> FloatArray:
        """Return the configuration with other values of the free coordinates."""
        q = start.copy()
        q[free] = values
        return q

    found = scipy.optimize.least_squares(
        lambda values: equations.evaluate(insert_free(values)),
        start[free],
        jac=lambda values: equations.compute_jacobian(insert_free(values))[:, free],
        method="trf",
        x_scale="jac",
        xtol=1e-15,
        ftol=1e-15,
        gtol=1e-15,
        max_nfev=300,
    )
    q = insert_free(found.x)
    gaps = np.abs(equations.evaluate(q))
    if gaps.max() > _ASSEMBLED:
        worst = int(np.argmax(gaps))
        _, open_at = list_owners(loops.closures)[worst]
        before = float(np.abs(equations.evaluate(start)).max())
        fixed = ", ".join(
            f"{mechanism.generalised_names[k]} = {start[k]:g}"
            for k in range(mechanism.n_q)
            if k not in free
        )
        raise NumericalError(
            f"the loops cannot be closed from the guess"
            f"{f' with {fixed}' if fixed else ''}: there they are open by {before:.3g}, and at "
            f"best by {gaps[worst]:.3g}, at {open_at} (m, or no unit for a tilt). Give a guess nearer to an assembly, or "
            "check lengths and frames.",
            Cause.ASSEMBLY,
        )
    return q


def _close_nearby(equations: _Equations, mechanism: Mechanism, loops: Loops) -> FloatArray:
    """Move all coordinates from the guess until the loops are closed, and return the configuration.

    If that fails from a guess of zeros, as with all links in one line, try again from random configurations. From any
    other guess, raise the error at once.

    Raises:
        NumericalError: The loops cannot be closed.
    """
    moving = _find_loop_coordinates(mechanism)
    try:
        return _close(equations, mechanism, loops, moving)
    except NumericalError:
        if loops.assembly.any():
            raise
        rng = np.random.default_rng(_SEED)
        for size in _RESTARTS:
            start = np.zeros(mechanism.n_q)
            start[moving] = size * rng.normal(size=len(moving))
            try:
                moved = dataclasses.replace(loops, assembly=start)
                return _close(equations, mechanism, moved, moving)
            except NumericalError:
                continue
        raise


def _close_as_given(
    equations: _Equations, mechanism: Mechanism, loops: Loops, nearest: FloatArray
) -> FloatArray:
    """Close the loops with the independent coordinates at the values of the guess.

    If these are all zero and the loops do not close, ``nearest`` is returned, with a warning.

    Args:
        equations: Closure equations.
        mechanism: Mechanism whose dependent coordinates are moved.
        loops: Loops with the guess.
        nearest: Configuration with closed loops that was found with all coordinates free to move.

    Raises:
        NumericalError: The loops do not close, and an independent coordinate of the guess is not zero.
    """
    try:
        return _close(equations, mechanism, loops, mechanism.dependent)
    except NumericalError:
        if loops.assembly[list(mechanism.independent)].any():
            raise
    names = mechanism.generalised_names
    guess = ", ".join(f"{names[k]}: {value:.6g}" for k, value in enumerate(nearest) if value)
    warnings.warn(
        f"the loops do not close with zero for {', '.join(names[k] for k in mechanism.independent)}; they are closed "
        f"with all coordinates free to move, at guess: {{{guess}}}, which the config may give",
        ParamreduceWarning,
        stacklevel=3,
    )
    return nearest


def _list_nearby(equations: _Equations, q: FloatArray) -> list[FloatArray]:
    """Return configurations nearby, reached by random moves along the loops."""
    rng = np.random.default_rng(_SEED)
    found = []
    for _ in range(_MOVES):
        move = rng.normal(size=q.size)
        new = q + _MOVE * move / np.linalg.norm(move)
        for _ in range(20):
            step, *_ = np.linalg.lstsq(
                equations.compute_jacobian(new), equations.evaluate(new), rcond=1e-9
            )
            new = new - step
        if np.abs(equations.evaluate(new)).max() <= _ASSEMBLED:
            found.append(new)
    return found


def _choose_generic(jacobians: list[FloatArray]) -> tuple[FloatArray, list[int]]:
    """Choose the Jacobian of largest rank, and its independent rows, each independent of the rows before it."""
    found = ((J, select_independent(J.T, _find_nonzero_rows(J), _RANK)) for J in jacobians)
    return max(found, key=lambda pair: len(pair[1]))


def _find_loop_coordinates(mechanism: Mechanism) -> list[int]:
    """Return the coordinates that closures depend on, without those of a floating base or of an arm that is in no loop."""
    assert mechanism.loops is not None
    found: set[int] = set()
    for closure in mechanism.loops.closures:
        one, other = (_find_carriers(mechanism, body) for body in closure.bodies)
        found |= set(closure.bodies) if closure.kind == "coupling" else one ^ other
    return sorted(found)


def _find_carriers(mechanism: Mechanism, body: int) -> set[int]:
    """Return a body and all bodies between it and the base."""
    found = set()
    while body != BASE:
        found.add(body)
        body = mechanism.bodies[body].parent
    return found


def _find_nonzero_rows(jacobian: FloatArray) -> IntArray:
    """Find the rows that are not zero to rounding, relative to the largest row."""
    lengths = np.linalg.norm(jacobian, axis=1)
    return np.flatnonzero(lengths > _ROUNDING * lengths.max(initial=0.0))


def _choose_equations(mechanism: Mechanism, loops: Loops, jacobians: list[FloatArray]) -> list[int]:
    """Return the equations that imply all others; a warning names the dropped ones.

    Welds of planar or spherical linkages, and rods between two ball joints, have more equations than they remove
    degrees of freedom. The surplus equations may be dropped if they are the same ones wherever the loops are closed.

    Raises:
        NumericalError: The equations leave nothing that moves, or which of them are independent changes along the
            motion.
    """
    jacobian, rows = _choose_generic(jacobians)
    if len(rows) == mechanism.n_q:
        raise NumericalError(
            f"the loops are over-constrained: {len(rows)} independent "
            f"equations for {mechanism.n_q} coordinates leave nothing that moves. Leave out a "
            "closure, or use joints or closures with more freedom.",
            Cause.CLOSURES,
        )
    owners = list_owners(loops.closures)
    if len(rows) == len(owners):
        return rows
    kept = sorted(_choose_best_conditioned(jacobian, len(rows)))
    dropped = ", ".join(name for k, (_, name) in enumerate(owners) if k not in kept)
    for other in jacobians:
        if _compute_rank(other) > _compute_rank(other[kept]):
            raise NumericalError(
                f"of the {len(owners)} equations {len(rows)} are independent, but not the same ones "
                f"wherever the loops are closed; {dropped} cannot be left to the others. Use closures "
                "with fewer equations.",
                Cause.CLOSURES,
            )
    warnings.warn(
        f"of the {len(owners)} equations that close the loops {len(rows)} are independent; dropped are "
        f"those that follow from the others: {dropped}",
        ParamreduceWarning,
        stacklevel=2,
    )
    return kept


def _choose_best_conditioned(jacobian: FloatArray, count: int) -> list[int]:
    """Return rows that span all others, chosen by pivoted QR."""
    _, order = scipy.linalg.qr(jacobian.T, mode="r", pivoting=True)
    chosen: list[int] = order[:count].tolist()
    return chosen


def _compute_rank(jacobian: FloatArray) -> int:
    """Return the numerical rank of a Jacobian."""
    s = np.linalg.svd(jacobian, compute_uv=False)
    return int(np.sum(s > _RANK * s[0]))


def _check_choice(mechanism: Mechanism, jacobians: list[FloatArray]) -> None:
    """Raise NumericalError unless the independent coordinates are as many as the degrees of freedom, and independent."""
    jacobian, rows = _choose_generic(jacobians)
    freedom = mechanism.n_q - len(rows)
    names = mechanism.generalised_names
    named = [names[k] for k in mechanism.independent]
    suggestion = ", ".join(names[k] for k in _suggest_independent(mechanism, jacobian))
    if len(named) != freedom:
        raise NumericalError(
            f"names {len(named)} coordinates, but {freedom} are "
            f"independent: {mechanism.n_q} coordinates less {len(rows)} independent equations. Name "
            f"{freedom}, for example {suggestion}.",
            Cause.INDEPENDENT,
        )
    if np.linalg.cond(np.array(jacobians)[:, :, list(mechanism.dependent)]).min() >= 1 / _RANK:
        raise NumericalError(
            f"{', '.join(named)} are not independent: the loops tie "
            "them to each other, and leave others undetermined. Choose others, for example "
            f"{suggestion}.",
            Cause.INDEPENDENT,
        )


def _check_regular(mechanism: Mechanism, jacobian: FloatArray) -> None:
    if np.linalg.cond(jacobian[:, list(mechanism.dependent)]) >= 1 / _RANK:
        named = (mechanism.generalised_names[k] for k in mechanism.independent)
        raise NumericalError(
            "the assembly it leads to is a singular configuration, in which "
            f"{', '.join(named)} do not determine the other coordinates. Give a guess away from it.",
            Cause.ASSEMBLY,
        )


def _check_hinges(mechanism: Mechanism, loops: Loops, q: FloatArray) -> None:
    """Raise NumericalError if two axes that a closure keeps parallel point in opposite directions, which the equations
    of the closure allow.

    Raises:
        NumericalError: Two axes are against each other.
    """
    poses = compute_body_poses(mechanism, q)
    for closure in loops.closures:
        A, B = (
            frame[:3, :3] if body == BASE else poses[body, :3, :3] @ frame[:3, :3]
            for body, frame in zip(closure.bodies, closure.frames, strict=True)
        )
        for k in CLOSURES[closure.kind].parallel:
            if A[:, k] @ B[:, k] < 0:
                raise NumericalError(
                    f"{closure.name} closes with its two {'xyz'[k]} axes against each other.",
                    Cause.HINGE_DIRECTION,
                )


def _suggest_independent(mechanism: Mechanism, jacobian: FloatArray) -> list[int]:
    """Return coordinates that can be independent; as many as possible of those that the user has named."""
    others = [k for k in range(mechanism.n_q) if k not in mechanism.independent]
    order = np.array([*others, *mechanism.independent], dtype=np.int64)
    dependent = select_independent(jacobian, order, _RANK)
    return [k for k in range(mechanism.n_q) if k not in dependent]
