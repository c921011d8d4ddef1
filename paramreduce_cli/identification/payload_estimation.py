"""Payloads identified alone, on a robot whose other bodies are known."""

from collections.abc import Collection, Iterator

import numpy as np

from paramreduce_cli.multibody.orthogonal import select_independent
from paramreduce_cli.records import DRIVE, INERTIAL, Estimate, FloatArray, IntArray, Kind, Mechanism
from paramreduce_cli.robots.inertia import compute_pseudo_inertia, is_positive_semidefinite

_FIRST = (Kind.MX, Kind.MY, Kind.MZ)
_INDEPENDENT = 1e-4
"""Share of a column that those before it must leave for it to be fitted."""
_ROUNDING = 1e-9
"""Share of the longest column below which a column is round-off."""
_MUCH_WORSE = 1.2
"""Ratio of the errors on held-out torques from which on the other bodies' values are doubted."""


def list_payload_columns(
    mechanism: Mechanism, values: FloatArray, payloads: Collection[str], factor: FloatArray
) -> IntArray:
    """Return the parameters to be fitted: those of payloads, and those of drives whose value is zero.

    Parameters that the torques cannot tell from those before them are left out: first moments come first, then the mass,
    then inertias.

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
    lengths = np.linalg.norm(factor[:, fitted], axis=0)
    moving = np.flatnonzero(lengths > _ROUNDING * lengths.max(initial=0.0))
    order = sorted(moving.tolist(), key=lambda k: parameters[fitted[k]].kind not in _FIRST)
    chosen = select_independent(factor[:, fitted], np.array(order, dtype=np.int64), _INDEPENDENT)
    return np.array(sorted(fitted[k] for k in chosen), dtype=np.int64)


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
