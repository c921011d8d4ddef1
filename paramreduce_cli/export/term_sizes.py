"""Sizes of the terms that results are sums of, against which differences of results are judged.

Results may be zero but for rounding: the torque of gravity about a vertical axis, the bias of a parallelogram. Beside
their own values every difference would then be large.
"""

from collections.abc import Mapping

import numpy as np

from paramreduce_cli.records import INERTIAL, FloatArray, Kind, Mechanism, ReducedModel

_SHARE = 1e-3
"""Share of the bound of all terms that a result is taken for at least; bounds are far from being reached."""
_SMALLEST = 1e-300
_EPSILON = float(np.finfo(float).eps)


def estimate_term_sizes(
    mechanism: Mechanism, model: ReducedModel, stored: Mapping[str, FloatArray]
) -> dict[str, float]:
    """Return the smallest magnitudes that errors of each result are divided by, by its name: a thousandth of a bound of
    the terms that it is the sum of.

    Args:
        mechanism: The robot.
        model: The model that is exported.
        stored: Arguments and results for some states, (n_states, ...) by name.

    Returns:
        A size in the unit of each result, by its name.
    """
    speed = float(np.abs(stored["dq"]).sum(axis=1).max())
    change = float(np.abs(stored["ddq"]).sum(axis=1).max()) + speed**2
    reach = mechanism.size + float(np.abs(stored["q"]).max())
    tangent = max(1.0, float(np.abs(stored["R"]).max())) if "R" in stored else 1.0
    fall = float(np.linalg.norm(mechanism.gravity)) + reach * change
    moments = _assign_by_kind(mechanism, reach * fall, fall, change) * tangent
    inertias = _assign_by_kind(mechanism, reach**2, reach, 1.0) * tangent**2
    values = np.abs(model.standard)
    bend = float(moments @ values)
    kept = moments[model.kept]
    sizes = {
        "tau": float(moments @ values),
        "delta": float(moments @ values),
        "g": float(moments @ values),
        "c": float(moments @ values),
        "M": float(inertias @ values),
        "p": float(inertias @ values) * speed,
        "beta": bend,
        "C": float(inertias @ values) * speed,
        "tau_by_q": bend,
        "tau_by_dq": float(inertias @ values) * speed,
        "K": float(kept[kept > 0].min()) if kept.any() else 0.0,
        "gamma": reach * speed**2,
        "Phi": reach,
        "Phi_z": reach,
        "Phi_d": reach,
    }
    least = {name: max(_SHARE * sizes.get(name, 1.0), _SMALLEST) for name in {*stored, *sizes}}
    least["ddz" if "ddz" in stored else "ddq"] = _estimate_solution_size(stored)
    # The bias b is added to the accelerations that the independent coordinates bring.
    return {**least, "b": max(float(np.abs(stored["ddq"]).max()), _SMALLEST)}


def _estimate_solution_size(stored: Mapping[str, FloatArray]) -> float:
    """Return the largest acceleration that the torques of a state could bring, by the least eigenvalue of its M: the
    rounding errors of the torques bring accelerations in the same ratio.
    """
    eigenvalues = np.abs(np.linalg.eigvalsh(stored["M"]))
    smallest = np.maximum(eigenvalues.min(axis=1), _EPSILON * eigenvalues.max(axis=1))
    torques = np.linalg.norm(stored["tau"], axis=1) + np.linalg.norm(stored["delta"], axis=1)
    return max(float((torques / np.maximum(smallest, _SMALLEST)).max()), _SMALLEST)


def _assign_by_kind(mechanism: Mechanism, mass: float, moment: float, inertia: float) -> FloatArray:
    """Assign a value to each inertial parameter by its kind, zero to those of drives, (n_parameters,)."""
    values = dict.fromkeys(INERTIAL, inertia)
    values |= {Kind.M: mass, Kind.MX: moment, Kind.MY: moment, Kind.MZ: moment}
    return np.array([values.get(parameter.kind, 0.0) for parameter in mechanism.parameters])


def find_entry_sizes(name: str, expected: FloatArray, least: float) -> FloatArray:
    """Return the magnitude that errors of each entry of a result are divided by.

    Args:
        name: Name of the result.
        expected: Values of the result, (n_states, ...).
        least: Smallest size of the result.

    Returns:
        An array that broadcasts to one state of the result.
    """
    if name in ("tau", "delta", "g", "c", "p", "beta"):
        return np.maximum(np.abs(expected).max(axis=0), least)
    if name == "M":
        diagonal = np.sqrt(np.abs(np.diagonal(expected, axis1=1, axis2=2)).max(axis=0))
        return np.maximum(np.outer(diagonal, diagonal), least)
    if name == "K":
        return np.maximum(np.abs(expected).max(axis=(0, 1)), least)
    return np.array(max(float(np.abs(expected).max(initial=0.0)), least))
