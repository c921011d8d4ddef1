"""Projection of the generalised coordinates of an open tree on the independent ones of closed loops.

With Phi(q) = 0, d the dependent coordinates and z the independent ones [Ros2019]:

* dq = R dz with R = [-Phi_d^-1 Phi_z; 1];
* ddq = R ddz + b with b = [Phi_d^-1 gamma; 0] and gamma = -dPhi_q/dt dq;
* d_z = R' d_q, M_zz = R' M_qq R, delta_z = R' (delta_q + M_qq b).

The sum in delta_z has M_qq, and b its sign, by inserting ddq into d_q = M_qq ddq + delta_q;
the paper prints it without and with the other sign.
"""

from functools import cached_property
from typing import TypeVar

import casadi as ca
import numpy as np

from paramreduce_cli.multibody.loops.closures import express_equations
from paramreduce_cli.records import Mechanism

Expression = TypeVar("Expression", ca.SX, ca.MX)

_SOLVER = "qr"
"""Sparse and with generated C code; structure is analysed once."""


class Projection:
    """The kinematics of loops as expressions of its symbol ``q`` that can be compiled and differentiated.

    ``R`` and ``b`` are symbols, because scalar expressions cannot contain a linear solver; :attr:`whole_tangent` and
    :meth:`express_whole_drift` compute their values with expressions of matrices.

    Args:
        mechanism: Mechanism with as many independent equations as dependent coordinates.
    """

    def __init__(self, mechanism: Mechanism) -> None:
        self._d, self._z = list(mechanism.dependent), list(mechanism.independent)
        n_d, n_z = len(self._d), len(self._z)
        self.q = ca.MX.sym("q", mechanism.n_q)
        self.R_d, self.b_d = ca.SX.sym("R_d", n_d, n_z), ca.SX.sym("b_d", n_d)
        self.R = self._interleave(self.R_d, ca.SX.eye(n_z))
        self.b = self._interleave(self.b_d, ca.SX(n_z, 1))
        q, dq = ca.SX.sym("q", mechanism.n_q), ca.SX.sym("dq", mechanism.n_q)
        equations = express_equations(mechanism, q)
        jacobian = ca.jacobian(equations, q)
        gamma = -ca.jtimes(ca.jtimes(equations, q, dq), q, dq)
        self._equations = ca.Function("closure", [q], [ca.cse(equations)])
        self._jacobian = ca.Function("closure_jacobian", [q], [ca.cse(jacobian)])
        self._gamma = ca.Function("closure_gamma", [q, dq], [ca.cse(gamma)])

    @cached_property
    def gap(self) -> ca.MX:
        """Phi, (n_equations,)."""
        return self._equations(self.q)

    @cached_property
    def dependent_jacobian(self) -> ca.MX:
        """Phi_d, (n_d, n_d); sparse."""
        return self._whole_jacobian[:, self._d]

    @cached_property
    def _whole_jacobian(self) -> ca.MX:
        return self._jacobian(self.q)

    def solve(self, right: ca.MX) -> ca.MX:
        """Return Phi_d^-1 right."""
        return ca.solve(self.dependent_jacobian, right, _SOLVER)

    @cached_property
    def tangent(self) -> ca.MX:
        """Derivative of the dependent coordinates by the independent ones, (n_d, n_dof).

        The expression is shared by all that depends on it, because CasADi does not recognise equal solvers and would
        solve again, also in every derivative.
        """
        return -self.solve(ca.densify(self._whole_jacobian[:, self._z]))

    @property
    def whole_tangent(self) -> ca.MX:
        """R, (n_q, n_dof)."""
        return self._interleave(self.tangent, ca.MX(ca.DM.eye(len(self._z))))

    def express_whole_drift(self, dq: ca.MX) -> ca.MX:
        """Return the accelerations of all coordinates at ddz = 0, b, (n_q,)."""
        return self._interleave(self.express_drift(dq), ca.MX(len(self._z), 1))

    def express_rates(self, dz: ca.MX, ddz: ca.MX) -> tuple[ca.MX, ca.MX]:
        """Return velocities dq and accelerations ddq, (n_q,) each."""
        dq = self._interleave(self.tangent @ dz, dz)
        return dq, self._interleave(self.tangent @ ddz + self.express_drift(dq), ddz)

    def express_drift(self, dq: ca.MX) -> ca.MX:
        """Return the accelerations of the dependent coordinates at ddz = 0, Phi_d^-1 gamma, (n_d,)."""
        return self.solve(self._gamma(self.q, dq))

    def compute_vector_jacobian_product(self, q_bar: ca.MX) -> ca.MX:
        """Return R' q_bar: derivatives by all coordinates as derivatives by the independent ones, in columns."""
        return q_bar[self._z, :] + self.tangent.T @ q_bar[self._d, :]

    def project_regressor(self, tree: ca.Function, dq: ca.MX, ddq: ca.MX) -> ca.MX:
        """Return the transposed regressor in the independent coordinates, KT R, (n_parameters, n_dof).

        If the tree's regressor consists of scalars, so does the product: most of KT is zero, which derivatives of
        products of matrices do not exploit.

        Args:
            tree: The open tree's transposed regressor KT by q, dq and ddq, (n_parameters, n_q).
            dq: Velocities of all coordinates, (n_q,).
            ddq: Accelerations, same shape.
        """
        if not tree.is_a("SXFunction"):
            return tree(self.q, dq, ddq) @ self.whole_tangent
        states = [ca.SX.sym(name, self.q.numel()) for name in ("q", "dq", "ddq")]
        product = ca.Function("projected", [*states, self.R_d], [tree(*states) @ self.R])
        whole: ca.MX = product(self.q, dq, ddq, self.tangent)
        return whole

    def _interleave(self, dependent: Expression, independent: Expression) -> Expression:
        """Return dependent and independent rows in the order of the generalised coordinates."""
        order = np.argsort([*self._d, *self._z]).tolist()
        return ca.vertcat(dependent, independent)[order, :]

    @property
    def distance(self) -> ca.MX:
        """Distance to singularity n / (|Phi_q| |Phi_d^-1|) in Frobenius norms, n equations.

        The distance is 0 where the dependent coordinates are not determined, at most 1, and smooth.
        """
        n = len(self._d)
        inverse = self.solve(ca.MX(ca.DM.eye(n)))
        return n / ca.sqrt(ca.sumsqr(self._whole_jacobian) * ca.sumsqr(inverse))
