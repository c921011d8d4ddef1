"""Hints at what is wrong or missing in the model or the log, from the residuals of a fit.

Each hint rests on a signal that the residuals would contain if it were true. Only the part of a signal that the
parameters cannot explain counts. A hint is given if the residuals contain the signal beyond what noise of their colour
explains, the strongest first, each tested with those before it accounted for.
"""

from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from paramreduce_cli.identification.estimation import LinearFit, fit_weighted
from paramreduce_cli.identification.uncertainty import compute_score_covariance
from paramreduce_cli.multibody.orthogonal import solve_least_squares
from paramreduce_cli.records import FloatArray

_ROUNDING = 1e-9
"""Share of the largest value below which a value is round-off."""
_SURE = 5.0
"""Standard deviations from zero at which a signal is there."""
_SHARE = 0.02
"""Share of a joint's residuals that it must explain, squared."""
_OBVIOUS = 0.25
"""Share that needs less sureness, as what is missing has coloured the noise that it is measured by."""
_OBVIOUSLY_SURE = 3.0
_VISIBLE = 1e-3
"""Share of a signal that the parameters must leave, squared, for it to be told from them."""
_MOST = 4
_GAIN = 0.08
"""Relative error of a torque's scale that is worth a word."""
_LARGEST_SCALE = 5.0
"""Largest wrong scale of one joint: what is farther off, or negative, comes from few samples of small torques."""
_DELAY = 0.15
"""Delay of a sampling step, likewise."""
_TILT = 1.0
"""Degrees, likewise."""
_SMOOTH = 0.05
"""Share of a joint's largest speed over which a smooth sign goes up."""
_MUCH_BETTER = 0.5
"""What squared residuals fall to when signs or columns of torques are put right."""


@dataclass(frozen=True)
class _Signal:
    """A signal that residuals may contain."""

    joint: int | None
    """Whose residuals; None for all together."""
    signal: tuple[FloatArray, ...]
    """(n_samples, n_dof) for each part."""
    make_hint: Callable[[float, float], str | None]
    """The sentence for its coefficient and share; None where that is too small to matter."""


def find_residual_hints(
    fitted: LinearFit,
    names: Sequence[str],
    tilts: Sequence[tuple[FloatArray, ...]] = (),
    gravity: float = 9.81,
    delay: float = 0.0,
    sliding: Sequence[bool] = (),
    modelled: Collection[str] = (),
    tuned: Collection[str] = (),
) -> list[str]:
    """Return hints about likely causes of the residuals, the strongest first.

    Args:
        fitted: Fit of all base parameters on the training data.
        names: Names of the coordinates.
        tilts: Torques that gravity of one unit along each horizontal axis would cause, (n_samples, n_dof)
            for each part of the rows.
        gravity: m/s^2
        delay: Delay that was already taken back, s.
        sliding: Whether coordinates are lengths; none if left out.
        modelled: Keys of drives that are in the model, such as ``drives.q1.coulomb``.
        tuned: Names of the drives whose smoothing of friction the log has decided.
    """
    mistaken = list(_find_mistaken_columns(fitted, names))
    if mistaken:
        return mistaken
    found: list[str] = []
    tried: set[int] = set()
    slides = list(sliding) or [False] * len(names)
    candidates = list(_list_signals(fitted, names, tilts, gravity, delay, slides, modelled, tuned))
    while len(found) < _MOST:
        judged = [
            (*_test_signal(fitted, candidate), k)
            for k, candidate in enumerate(candidates)
            if k not in tried
        ]
        good = [entry for entry in judged if _is_convincing(*entry[:3])]
        if not good:
            break
        _, fraction, coefficient, k = max(good, key=lambda entry: entry[1])
        tried.add(k)
        text = candidates[k].make_hint(coefficient, fraction)
        if text is None:
            continue
        found.append(text)
        if (
            candidates[k].joint is None
        ):  # all joints are wrong in it, and what else is seen follows from that
            break
        fitted = _add_column(fitted, candidates[k].signal)
    return found


def _is_convincing(sureness: float, fraction: float, coefficient: float) -> bool:
    """Return whether a signal is significant and explains enough of the residuals to be reported."""
    sure = abs(sureness) > _SURE and fraction > _SHARE
    return sure or (abs(sureness) > _OBVIOUSLY_SURE and fraction > _OBVIOUS)


def _test_signal(fitted: LinearFit, candidate: _Signal) -> tuple[float, float, float]:
    """Return the coefficient of a signal in the residuals: its value in standard deviations, the fraction of the
    residuals that it explains, and the value itself.
    """
    left = fitted.compute_residuals_of(candidate.signal)
    weights = fitted.weights
    size = sum(float(np.sum(u**2 * weights)) for u in left)
    whole = sum(float(np.sum(u**2 * weights)) for u in candidate.signal)
    if whole == 0 or size < _VISIBLE * whole:
        return 0.0, 0.0, 0.0
    pairs = list(zip(left, fitted.residuals, strict=True))
    score = sum(float(np.sum(u * e * weights)) for u, e in pairs)
    spread = compute_score_covariance([u[..., None] for u in left], fitted.noise, weights)[0, 0]
    picked = slice(None) if candidate.joint is None else candidate.joint
    own = sum(float(np.sum((e**2 * weights)[:, picked])) for e in fitted.residuals)
    return score / np.sqrt(max(spread, 1e-300)), score**2 / (size * max(own, 1e-300)), score / size


def _add_column(fitted: LinearFit, signal: Sequence[FloatArray]) -> LinearFit:
    """Return the fit with one additional column."""
    rows = fitted.rows
    X = tuple(
        np.concatenate([x, u[..., None]], axis=2) for x, u in zip(rows.X, signal, strict=True)
    )
    return fit_weighted(replace(rows, X=X), fitted.deviation)


def _restrict_to_joint(values: Sequence[FloatArray], joint: int) -> tuple[FloatArray, ...]:
    """Return signals of one joint, zero for the others."""
    found = []
    for part in values:
        signal = np.zeros_like(part)
        signal[:, joint] = part[:, joint]
        found.append(signal)
    return tuple(found)


def _list_signals(
    fitted: LinearFit,
    names: Sequence[str],
    tilts: Sequence[tuple[FloatArray, ...]],
    gravity: float,
    delay: float,
    sliding: Sequence[bool],
    modelled: Collection[str],
    tuned: Collection[str],
) -> Iterator[_Signal]:
    """Yield the signals that residuals may contain: those of each measured joint, then delay and tilt.

    Terms that are part of the model are tried too; their hint suggests another form.
    """

    def _missing(name: str, what: str, unit: str, key: str) -> Callable[[float, float], str]:
        return _make_missing_hint(what, unit, name, f"drives.{name}.{key}", modelled)

    rows = fitted.rows
    fastest = np.max([np.abs(v).max(axis=0) for v in rows.dz], axis=0)
    fastest = np.where(fastest > 0, fastest, 1.0)
    model = [x @ fitted.parameters for x in rows.X]
    for j, name in enumerate(names):
        if not np.isfinite(fitted.deviation[j]):
            continue
        force = "N" if sliding[j] else "N m"
        signs = [np.sign(v) for v in rows.dz]
        smooth = [np.tanh(v / (_SMOOTH * fastest)) for v in rows.dz]
        constant = [np.ones_like(v) for v in rows.dz]
        yield _Signal(
            j,
            _restrict_to_joint(signs, j),
            _missing(name, "the sign of its speed", force, "coulomb"),
        )
        if name not in tuned:
            yield _Signal(
                j, _restrict_to_joint(smooth, j), _make_smoothing_hint(name, _SMOOTH * fastest[j])
            )
        yield _Signal(
            j,
            _restrict_to_joint(rows.dz, j),
            _missing(name, "its speed", "N s/m" if sliding[j] else "N m s/rad", "viscous"),
        )
        yield _Signal(
            j,
            _restrict_to_joint(rows.ddz, j),
            _missing(name, "its acceleration", "kg" if sliding[j] else "kg m^2", "inertia"),
        )
        yield _Signal(
            j, _restrict_to_joint(constant, j), _missing(name, "a constant", force, "offset")
        )
        yield _Signal(j, _restrict_to_joint(model, j), _make_scale_hint(name))
    slopes = tuple(
        np.gradient(t, rows.step, axis=0) if len(t) > 1 else np.zeros_like(t) for t in model
    )
    yield _Signal(None, slopes, _make_delay_hint(rows.step, delay))
    for axis, signal in zip("xy", tilts, strict=False):
        yield _Signal(None, signal, _make_tilt_hint(axis, gravity))


def _make_missing_hint(
    what: str, unit: str, name: str, key: str, modelled: Collection[str]
) -> Callable[[float, float], str]:
    """Return a function that words the hint at a missing term."""

    def word_hint(coefficient: float, fraction: float) -> str:
        return (
            f"Residuals of {name} follow {what} ({coefficient:.3g} {unit}, {100 * fraction:.0f} % of them): "
            f"{key} is {'of another form' if key in modelled else 'missing'}."
        )

    return word_hint


def _make_smoothing_hint(name: str, speed: float) -> Callable[[float, float], str | None]:
    """Return a function that turns the fitted coefficient and the fraction of the residuals that it explains into a
    hint at smooth friction.
    """

    def word_hint(coefficient: float, fraction: float) -> str:
        return (
            f"Residuals of {name} follow a smooth sign of its speed ({100 * fraction:.0f} % of them): friction that "
            f"goes over from one sign to the other; try drives.{name}.smoothing: {speed:.2g}."
        )

    return word_hint


def _make_scale_hint(name: str) -> Callable[[float, float], str | None]:
    """Return a function that words the hint at a wrong scale of torques, or None for small errors."""

    def word_hint(coefficient: float, fraction: float) -> str | None:
        """Return the hint; None for a small error of scale, and for a scale that no torque constant explains."""
        scale = 1 + coefficient
        if abs(coefficient) < _GAIN or not 1 / _LARGEST_SCALE <= scale <= _LARGEST_SCALE:
            return None
        return (
            f"Torques of {name} are {scale:.3g} times what those of the other joints let expect: a "
            "wrong torque constant or gear ratio?"
        )

    return word_hint


def _make_delay_hint(step: float, known_delay: float) -> Callable[[float, float], str | None]:
    """Return a function that turns the fitted delay and the fraction of the residuals that it explains into a hint;
    None for delays far below a time step.
    """

    def word_hint(coefficient: float, fraction: float) -> str | None:
        """Return the hint, or None for a delay far below a time step."""
        if abs(coefficient) < _DELAY * step:
            return None
        later = "later" if coefficient < 0 else "earlier"
        return (
            f"Torques come {abs(coefficient) * 1e3:.3g} ms {later} than positions; try "
            f"sampling.log.delay: {known_delay - coefficient:.3g}."
        )

    return word_hint


def _make_tilt_hint(axis: str, gravity: float) -> Callable[[float, float], str | None]:
    """Return a function that turns the fitted acceleration and the fraction of the residuals that it explains into a
    hint at a tilted base; None for small angles.
    """

    def word_hint(coefficient: float, fraction: float) -> str | None:
        """Return the hint, or None for a small angle."""
        angle = float(np.degrees(np.arctan2(abs(coefficient), gravity)))
        if angle < _TILT:
            return None
        return (
            f"Gravity seems to have {coefficient:.2g} m/s^2 along {axis} of the base, {angle:.2g} degrees: is the "
            "base level, and description.gravity right?"
        )

    return word_hint


def hint_at_negative_friction(
    names: Sequence[str], owners: Sequence[str], values: FloatArray, deviations: FloatArray
) -> list[str]:
    """Return a hint if friction surely drives the machine, as with the wrong sign of torques or speeds.

    Args:
        names: Names of the friction parameters, (n,).
        owners: Joints of the friction parameters, (n,).
        values: Values of the friction parameters, (n,).
        deviations: Standard deviations, (n,).
    """
    rounding = _ROUNDING * np.abs(values).max(initial=0.0)
    wrong: list[int] = np.flatnonzero(values < -_SURE * deviations - rounding).tolist()
    joints = list(dict.fromkeys(owners[k] for k in wrong))
    if not joints:
        return []
    listed = ", ".join(f"{names[k]} = {values[k]:.3g}" for k in wrong[:_MOST])
    if len(joints) > max(1, len(set(owners)) / 2):
        return [
            f"Friction comes out negative at most joints ({listed}): is the sign of all torques wrong? See "
            "sampling.log.signs."
        ]
    return [
        f"Friction of {' and '.join(joints)} comes out negative ({listed}): is the sign of its torques or speeds "
        "wrong, or friction of another form? See sampling.log.signs."
    ]


def _find_mistaken_columns(fitted: LinearFit, names: Sequence[str]) -> Iterator[str]:
    """Yield hints at torques with the wrong sign or of another joint: with them corrected the residuals collapse."""
    rows = fitted.rows
    n_dof, p = len(names), fitted.parameters.size
    tau = np.concatenate(rows.tau)
    scale = np.sqrt(np.mean(tau**2, axis=0))
    scale[(scale == 0) | ~np.isfinite(fitted.deviation)] = np.inf
    X = np.concatenate(rows.X)
    factors = [
        np.linalg.qr(np.column_stack([X[:, j], tau]), mode="r") / scale[j] for j in range(n_dof)
    ]

    def compute_misfit(owner: Sequence[int], signs: FloatArray) -> float:
        """Return the misfit with the torques of other joints or with other signs."""
        A = np.concatenate([f[:, :p] for f in factors])
        y = np.concatenate([f[:, p + owner[j]] * signs[j] for j, f in enumerate(factors)])
        solution = solve_least_squares(np.column_stack([A, y]))
        return float(np.sum((y - A @ solution) ** 2))

    usual, plain = list(range(n_dof)), np.ones(n_dof)
    before = compute_misfit(usual, plain)
    found: list[tuple[float, str]] = []
    seen = np.flatnonzero(np.isfinite(scale)).tolist()
    for j in seen:
        name = names[j]
        signs = plain.copy()
        signs[j] = -1
        found.append(
            (
                compute_misfit(usual, signs),
                f"With the other sign of {name}'s torques the residuals are far smaller: is its sign "
                "wrong? See sampling.log.signs.",
            )
        )
    for i, j in combinations(seen, 2):
        owner = usual.copy()
        owner[i], owner[j] = j, i
        found.append(
            (
                compute_misfit(owner, plain),
                f"With the torques of {names[i]} and {names[j]} exchanged the residuals are far smaller: "
                "are their columns swapped?",
            )
        )
    after, text = min(found, default=(before, ""))
    if after < _MUCH_BETTER * before:
        yield text
