"""Hints from torques beside those that the config's values give, and with gravity or joints reversed.

Base parameters take up a common factor of all torques, and most of what another direction of gravity or the other sign of
a joint does: residuals alone do not show what it is.
"""

from collections.abc import Iterable, Sequence

import numpy as np

from paramreduce_cli.multibody.orthogonal import solve_least_squares
from paramreduce_cli.records import FloatArray

_ALIKE = 0.8
"""Correlation from which on torques are the expected ones but for a factor."""
_OTHER_UNIT = 3.0
"""Factor beyond which that is no error of the parameters."""
_FAR_LESS = 0.5
"""What squared residuals fall to once gravity is along the axis that it has, or a joint counts as it does."""
_LESS_WITHOUT = 0.8
"""The same without gravity, which nothing but its absence can bring: the model has no column more."""
_TOO_LARGE, _TOO_SMALL = 3.0, 0.01
"""Largest torques over the nominal ones that make another unit likely."""
_NEAR = 0.1
"""Share of gravity by which its direction may be off an axis of the base."""


def hint_at_unit(expected: FloatArray, identified: FloatArray) -> list[str]:
    """Return a hint if measured torques are the config's torques times a large, small or negative factor, as with a
    wrong unit or sign.

    Args:
        expected: Torques of the bodies with the values in the config, (n_samples, n_dof).
        identified: Torques of the bodies with the identified values, (n_samples, n_dof).
    """
    # The largest torques decide: those of small joints are often noise, and their values in robots' files guesses.
    product = float(np.sum(expected * identified))
    length = float(np.linalg.norm(expected))
    if not abs(product) > _ALIKE * length * float(np.linalg.norm(identified)) > 0:
        return []
    factor = product / length**2
    if factor < 0:
        return [
            "Bodies weigh the opposite of what the parameters in the config let expect: does gravity point the "
            "other way (description.gravity), or have all torques the wrong sign (sampling.log.signs)?"
        ]
    if 1 / _OTHER_UNIT < factor < _OTHER_UNIT:
        return []
    return [
        f"Torques are {factor:.3g} times what the parameters in the config let expect: are they in another unit, or "
        "currents, or before the gears? See units, torque_constants and transmission under sampling.log."
    ]


def hint_at_rating(tau: FloatArray, rating: FloatArray, names: Sequence[str]) -> list[str]:
    """Return a hint if torques are far from the ratings of the joints.

    Args:
        tau: Torques, (n_samples, n_dof).
        rating: Nominal torques, (n_dof,); infinite where none is measured.
        names: Names of the coordinates.
    """
    shares = np.abs(tau).max(axis=0) / rating
    j = int(shares.argmax())
    if _TOO_SMALL <= shares[j] <= _TOO_LARGE or shares[j] == 0:
        return []
    return [
        f"The torque that is largest beside its nominal_torque, of {names[j]}, goes up to {shares[j]:.2g} times it: "
        "are torques in another unit, or currents, or before the gears? See units, torque_constants and transmission "
        "under sampling.log."
    ]


def hint_at_sign(
    usual: FloatArray,
    mirrored: Iterable[FloatArray],
    tau: FloatArray,
    deviation: FloatArray,
    names: Sequence[str],
) -> list[str]:
    """Return a hint if the fit is far better with one joint reversed.

    Args:
        usual: Observation matrix, (n_samples, n_dof, n).
        mirrored: Observation matrices with the motion of one joint after the other reversed; may be empty.
        tau: Torques, (n_samples, n_dof).
        deviation: Standard deviations of the torques, (n_dof,).
        names: Names of the coordinates.
    """
    found: list[tuple[float, str]] = []
    for j, W in enumerate(mirrored):
        turned = np.where(np.arange(tau.shape[1]) == j, -tau, tau)
        for torques, what in ((tau, "but not torques"), (turned, "and torques")):
            text = (
                f"With positions and speeds of {names[j]} counted the other way, {what}, the residuals are far "
                "smaller: are the signs under sampling.log right?"
            )
            found.append((_compute_misfit(W, torques, deviation), text))
    left, text = min(found, default=(np.inf, ""))
    return [text] if left < _FAR_LESS * _compute_misfit(usual, tau, deviation) else []


def _compute_misfit(W: FloatArray, tau: FloatArray, deviation: FloatArray) -> float:
    """Return the sum of squared residuals of the best fit; residuals are divided by their standard deviations."""
    weighted = np.concatenate([W, tau[..., None]], axis=2) / deviation[:, None]
    rows: FloatArray = weighted.reshape(-1, weighted.shape[2])
    # A triangular factor first: rows are many, and columns depend on each other.
    factor = np.asarray(np.linalg.qr(rows, mode="r"))
    return float(np.sum((factor[:, -1] - factor[:, :-1] @ solve_least_squares(factor)) ** 2))


def hint_at_gravity(
    W: FloatArray, pulls: FloatArray, tau: FloatArray, deviation: FloatArray, gravity: FloatArray
) -> list[str]:
    """Return a hint if residuals are far smaller with gravity along another axis of the base, or without gravity.

    Args:
        W: Observation matrix with the gravity of the config, (n_samples, n_dof, n).
        pulls: Change of W by a unit of gravity along each axis of the base, (3, n_samples, n_dof, n).
        tau: Torques, (n_samples, n_dof).
        deviation: Standard deviations of the torques, (n_dof,); infinite where they are not measured.
        gravity: Gravity of the config, (3,), m/s^2.
    """
    size = float(np.linalg.norm(gravity))

    def compute_misfit(assumed: FloatArray) -> float:
        """Return the misfit with another gravity."""
        added = np.tensordot(assumed - gravity, pulls, axes=1)
        return _compute_misfit(W + added, tau, deviation)

    if size == 0:
        return []
    others = [
        (sign * size * axis, f"along {'-' if sign < 0 else ''}{name} of the base")
        for axis, name in zip(np.eye(3), "xyz", strict=True)
        for sign in (1, -1)
        if np.linalg.norm(sign * size * axis - gravity) > _NEAR * size
    ]
    least, where = min((compute_misfit(assumed), where) for assumed, where in others)
    without, usual = compute_misfit(np.zeros(3)), compute_misfit(gravity)
    if without < min(least, _LESS_WITHOUT * usual):
        return [
            "Without gravity the residuals are smaller: has the controller taken gravity out of the recorded torques "
            "already? If so, set description.gravity to [0, 0, 0]."
        ]
    if least > _FAR_LESS * usual:
        return []
    return [f"With gravity {where} the residuals are far smaller: is description.gravity right?"]
