"""Derivatives of the torques of open trees, by algorithmic differentiation of textbook recursion."""

import casadi as ca
import numpy as np

from paramreduce_cli.multibody.inverse_dynamics import express_mass_matrix_and_bias, express_torques
from paramreduce_cli.records import FloatArray, Mechanism


def compute_derivatives(
    mechanism: Mechanism, phi: FloatArray, q: FloatArray, dq: FloatArray, ddq: FloatArray
) -> dict[str, FloatArray]:
    """Return derivatives of the torques of an open tree, and its Coriolis matrix.

    Args:
        mechanism: The open tree.
        phi: Standard parameters, (n_parameters,).
        q: Coordinates, (n_states, n_q), rad or m.
        dq: Velocities, same shape.
        ddq: Accelerations, same shape.

    Returns:
        By name, (n_states, n_q, n_q) each: ``tau_by_q`` and ``tau_by_dq``, and ``C`` of Christoffel symbols of the first kind.
    """
    n = mechanism.n_q
    position, speed, acceleration = (ca.SX.sym(name, n) for name in ("q", "dq", "ddq"))
    values = ca.SX(ca.DM(phi))
    tau = ca.vertcat(*express_torques(mechanism, position, speed, acceleration, values))
    M, _ = express_mass_matrix_and_bias(mechanism, position, speed, values)
    rates = [ca.jacobian(M[:, j], position) for j in range(n)]
    # dM_ij/dq_k = rates[j][i, k]; M is symmetric.
    C = ca.SX.zeros(n, n)
    for i in range(n):
        for j in range(n):
            for k in range(n):
                symbol = rates[j][i, k] + rates[k][i, j] - rates[k][j, i]
                C[i, j] += symbol * speed[k] / 2
    function = ca.Function(
        "derivatives",
        [position, speed, acceleration],
        [ca.jacobian(tau, position), ca.jacobian(tau, speed), C],
    )
    results = [
        [np.array(part) for part in function(*state)] for state in zip(q, dq, ddq, strict=True)
    ]
    names = ("tau_by_q", "tau_by_dq", "C")
    return {name: np.array([one[k] for one in results]) for k, name in enumerate(names)}
