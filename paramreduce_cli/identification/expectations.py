"""What measured torques look like beside the config's values, and with gravity along other axes.

Base parameters take up a common factor of all torques, and most of what another direction of gravity does: residuals
alone do not show either.
"""

import numpy as np

from paramreduce_cli.multibody.orthogonal import least_squares
from paramreduce_cli.records import FloatArray

_ALIKE = 0.8
"""Correlation from which on torques are the expected ones but for a factor."""
_OTHER_UNIT = 3.0
"""Factor beyond which that is no error of the parameters."""
_FAR_LESS = 0.5
"""What squared residuals fall to with gravity along the axis that it has."""
_NEAR = 0.1
"""Share of gravity by which its direction may be off an axis of the base."""


def doubted_unit(expected: FloatArray, found: FloatArray) -> list[str]:
    """A sentence where the bodies' torques are those of the config's values but for a large factor.

    Args:
        expected: Torques of the bodies with the values in the config, (n_samples, n_dof).
        found: The same with the identified values.
    """
    sizes = np.sqrt(np.mean(found**2, axis=0))
    scaled = [torques / np.where(sizes > 0, sizes, np.inf) for torques in (expected, found)]
    product = float(np.sum(scaled[0] * scaled[1]))
    lengths = [float(np.linalg.norm(torques)) for torques in scaled]
    if not abs(product) > _ALIKE * lengths[0] * lengths[1] > 0:
        return []
    factor = product / lengths[0] ** 2
    if factor < 0:
        return [
            "Bodies weigh the opposite of what the parameters in the config let expect: does gravity point the "
            "other way (description.gravity), or have all torques the wrong sign (sampling.log.torque_signs)?"
        ]
    if 1 / _OTHER_UNIT < factor < _OTHER_UNIT:
        return []
    return [
        f"Torques are {factor:.3g} times what the parameters in the config let expect: are they in another unit, or "
        "currents, or before the gears? See units, torque_constants and transmission under sampling.log."
    ]


def doubted_gravity(
    W: FloatArray, pulls: FloatArray, tau: FloatArray, deviation: FloatArray, gravity: FloatArray
) -> list[str]:
    """A sentence where another axis of the base fits far better as that of gravity.

    Args:
        W: Observation matrix with the gravity of the config, (n_samples, n_dof, n).
        pulls: What gravity of one unit along each axis of the base adds to it, (3, n_samples, n_dof, n).
        tau: (n_samples, n_dof)
        deviation: Standard deviations of the torques, (n_dof,); infinite where they are not measured.
        gravity: Of the config, (3,), m/s^2.
    """
    size = float(np.linalg.norm(gravity))

    def left(direction: FloatArray) -> float:
        added = np.tensordot(size * direction - gravity, pulls, axes=1)
        weighted = np.concatenate([W + added, tau[..., None]], axis=2) / deviation[:, None]
        rows: FloatArray = weighted.reshape(-1, weighted.shape[2])
        # A triangular factor first: rows are many, and columns depend on each other.
        factor = np.asarray(np.linalg.qr(rows, mode="r"))
        return float(np.sum((factor[:, -1] - factor[:, :-1] @ least_squares(factor)) ** 2))

    if size == 0:
        return []
    others = [
        (sign * axis, f"{'-' if sign < 0 else ''}{name}")
        for axis, name in zip(np.eye(3), "xyz", strict=True)
        for sign in (1, -1)
        if np.linalg.norm(size * sign * axis - gravity) > _NEAR * size
    ]
    least, name = min(((left(direction), name) for direction, name in others))
    if least > _FAR_LESS * left(gravity / size):
        return []
    return [
        f"With gravity along {name} of the base the residuals are far smaller: is description.gravity right?"
    ]
