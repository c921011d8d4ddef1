"""Payloads identified alone, on a robot whose other bodies are known."""

from collections.abc import Collection, Iterator

import numpy as np

from paramreduce_cli.multibody.base_parameters import choose_base
from paramreduce_cli.records import DRIVE, INERTIAL, Estimate, FloatArray, IntArray, Mechanism
from paramreduce_cli.robots.inertia import compute_pseudo_inertia, is_positive_semidefinite

_INDEPENDENT = 1e-6
"""Singular values of the payloads' columns below this share of the largest one count as zero."""
_MUCH_WORSE = 1.2
"""Ratio of the errors on held-out torques from which on the other bodies' values are doubted."""


def list_payload_columns(
    mechanism: Mechanism, values: FloatArray, payloads: Collection[str], factor: FloatArray
) -> IntArray:
    """Return the parameters to be fitted: those of payloads, and those of drives whose value is zero.

    Parameters that the torques cannot tell from the others are left out.

    Args:
        mechanism: The robot.
        values: Known values of all parameters, (n_parameters,).
        payloads: Names of the payloads.
        factor: Triangular factor of [W | tau] with rows divided by the noise, (k, n_parameters + 1).
    """
    parameters = mechanism.parameters
    fitted = [
        k
        for k, p in enumerate(parameters)
        if (p.kind in INERTIAL and p.owner in payloads) or (p.kind in DRIVE and values[k] == 0)
    ]
    order = np.arange(len(fitted))
    chosen = choose_base(factor[:, fitted], order, _INDEPENDENT).columns
    return np.array(fitted, dtype=np.int64)[np.sort(chosen)]


def find_payload_hints(
    mechanism: Mechanism, payloads: Collection[str], payload: Estimate, full: Estimate
) -> Iterator[str]:
    """Yield hints at payloads that cannot exist, and at wrong values of the other bodies.

    Whether a payload can exist is only known if all of its ten parameters are.

    Args:
        mechanism: The robot.
        payloads: Names of the payloads.
        payload: Estimate of the payloads alone.
        full: Estimate of all base parameters.
    """
    if payload.held_out > _MUCH_WORSE * full.held_out:
        yield (
            f"With the payload alone fitted {100 * payload.held_out:.3g} % of the held-out torques are unexplained, with all "
            f"base parameters {100 * full.held_out:.3g} %: the values of the other bodies do not fit this robot."
        )
    for body in mechanism.rigid:
        owned = [mechanism.parameters[body.columns[kind]] for kind in INERTIAL]
        values = {kind: float(payload.standard[body.columns[kind]]) for kind in INERTIAL}
        if owned[0].owner not in payloads or not {p.name for p in owned} <= set(payload.names):
            continue
        if not is_positive_semidefinite(compute_pseudo_inertia(values)):
            name = owned[0].owner
            yield (
                f"No rigid body has the identified parameters of the payload {name}. The motion may be too slow to tell its "
                "inertia, or the values of the other bodies are wrong."
            )
