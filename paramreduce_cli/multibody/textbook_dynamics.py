"""Inverse and direct dynamics by textbook recursion, as expressions to be counted or simulated."""

from __future__ import annotations

from functools import cached_property

import casadi as ca
import numpy as np

from paramreduce_cli.expressions.programs import Program
from paramreduce_cli.multibody.inverse_dynamics import express_mass_matrix_and_bias, express_torques
from paramreduce_cli.multibody.loops.projection import Projection
from paramreduce_cli.records import FloatArray, Mechanism, ReducedModel


class PlainDynamics:
    """The textbook recursion of a mechanism's dynamics.

    Args:
        mechanism: The mechanism.
    """

    def __init__(self, mechanism: Mechanism) -> None:
        self.mechanism = mechanism
        self._q, self._dq, self._ddq = (ca.SX.sym(s, mechanism.n_q) for s in ("q", "dq", "ddq"))
        self._phi = ca.SX.sym("phi", mechanism.n_parameters)

    @cached_property
    def _tau_q(self) -> ca.SX:
        """Forces of the open tree, d_q."""
        return ca.vertcat(*express_torques(self.mechanism, self._q, self._dq, self._ddq, self._phi))

    @cached_property
    def _direct_q(self) -> tuple[ca.SX, ca.SX]:
        """M_qq and delta_q of the open tree."""
        return express_mass_matrix_and_bias(self.mechanism, self._q, self._dq, self._phi)

    @cached_property
    def programs(self) -> tuple[Program, Program]:
        """d_q and [M_qq | delta_q], M's lower triangle row by row; inputs are phi, q, dq and ddq."""
        return self._make_programs([], self._tau_q, *self._direct_q)

    @cached_property
    def _independent_programs(self) -> tuple[Program, Program]:
        """Programs of d_z = R' d_q, M_zz = R' M_qq R and delta_z = R' (delta_q + M_qq b)."""
        if self.mechanism.loops is None:
            return self.programs
        loop = Projection(self.mechanism)
        (M, delta), R = self._direct_q, loop.R
        inputs = [loop.R_d, loop.b_d]
        return self._make_programs(
            inputs, R.T @ self._tau_q, R.T @ (M @ R), R.T @ (delta + M @ loop.b)
        )

    def _make_programs(
        self, loop: list[ca.SX], tau: ca.SX, M: ca.SX, delta: ca.SX
    ) -> tuple[Program, Program]:
        """Return the programs of the inverse dynamics and of [M | delta] with M's lower triangle; phi is the first
        input.
        """
        lower = [M[i, j] for i in range(M.shape[0]) for j in range(i + 1)]
        q, dq, ddq = self._q, self._dq, self._ddq
        inverse = ca.Function("d", [self._phi, q, dq, ddq, *loop], [tau])
        direct = ca.Function("M_delta", [self._phi, q, dq, *loop], [ca.vertcat(*lower), delta])
        return Program.from_function(inverse), Program.from_function(direct)

    def count_operations(
        self, model: ReducedModel, *, signs_free: bool = True, independent: bool = False
    ) -> tuple[int, int]:
        """Return the numbers of operations of the inverse dynamics and of [M | delta] of a model, with parameters as
        inputs.

        Args:
            model: Model that says which parameters are kept.
            signs_free: See :mod:`paramreduce_cli.expressions.programs`.
            independent: Whether d_z and [M_zz | delta_z] are counted, with R and b handed in,
                instead of d_q and [M_qq | delta_q]; on an open tree they are the same.
        """
        dropped = np.setdiff1d(np.arange(self._phi.numel()), model.kept).tolist()
        inverse, direct = self._independent_programs if independent else self.programs
        return (
            inverse.count(dropped, same=model.ties, signs_free=signs_free),
            direct.count(dropped, same=model.ties, signs_free=signs_free),
        )

    def express_accelerations(self, phi: FloatArray) -> ca.Function:
        """Return the accelerations of an open tree as a function of coordinates, velocities and torques.

        Args:
            phi: Values of the standard parameters, (n_parameters,).
        """
        M, delta = ca.substitute(list(self._direct_q), [self._phi], [ca.SX(phi)])
        tau = ca.SX.sym("tau", self.mechanism.n_dof)
        D, LT, order = ca.ldl(M)
        ddq = ca.cse(ca.ldl_solve(tau - delta, D, LT, order))
        return ca.Function("accelerations", [self._q, self._dq, tau], [ddq])
