"""The numeric model of a mechanism, evaluated for many states at once.

Everything is derived from the symbolic inverse and direct dynamics of the open tree by
CasADi, projected on the independent coordinates where there are loops, and compiled; this
is the only place that knows which formulation a mechanism needs.

States are generalised coordinates q, dq, ddq that satisfy the loops
(:class:`paramreduce_cli.multibody.loops.coordinates.Coordinates` finds them); those of an open
tree are its independent ones.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property

import casadi as ca
import numpy as np

from paramreduce_cli.expressions.compiled import BatchFunction
from paramreduce_cli.expressions.operations import Program
from paramreduce_cli.multibody.inverse_dynamics import direct_dynamics, inverse_dynamics
from paramreduce_cli.multibody.loops.projection import Projection
from paramreduce_cli.records import FloatArray, IntArray, Mechanism, ReducedModel

SINGULAR_MASS = 1e-10
"""Smallest over largest eigenvalue at which a mass matrix counts as singular: accelerations are
round-off then."""


class Dynamics:
    """Inverse and direct dynamics and their regressors in independent coordinates.

    Args:
        mechanism: The mechanism; its standard parameters stay free.
        once: Whether it is evaluated so little that compiling it does not pay.
    """

    def __init__(self, mechanism: Mechanism, *, once: bool = False) -> None:
        self._once = once
        self.mechanism = mechanism
        self.n_dof = mechanism.n_dof
        self.n_parameters = mechanism.n_parameters
        self._q, self._dq, self._ddq = (ca.SX.sym(s, mechanism.n_q) for s in ("q", "dq", "ddq"))
        self._phi = ca.SX.sym("phi", self.n_parameters)

    @cached_property
    def _tau_q(self) -> ca.SX:
        """Forces of the open tree, d_q."""
        return ca.vertcat(
            *inverse_dynamics(self.mechanism, self._q, self._dq, self._ddq, self._phi)
        )

    @cached_property
    def _direct_q(self) -> tuple[ca.SX, ca.SX]:
        """M_qq and delta_q of the open tree."""
        return direct_dynamics(self.mechanism, self._q, self._dq, self._phi)

    @cached_property
    def _projection(self) -> Projection | None:
        return None if self.mechanism.loops is None else Projection(self.mechanism)

    @cached_property
    def _tau(self) -> ca.SX:
        """d_z = R' d_q"""
        return self._tau_q if self._projection is None else self._projection.R.T @ self._tau_q

    @cached_property
    def _direct(self) -> tuple[ca.SX, ca.SX]:
        """M_zz = R' M_qq R and delta_z = R' (delta_q + M_qq b)"""
        M, delta = self._direct_q
        if self._projection is None:
            return M, delta
        R, b = self._projection.R, self._projection.b
        return R.T @ (M @ R), R.T @ (delta + M @ b)

    @cached_property
    def _regressor(self) -> BatchFunction:
        K = ca.jacobian(self._tau, self._phi)
        return self._compiled([self._q, self._dq, self._ddq], [K.T], drift=False)

    @cached_property
    def _direct_regressor(self) -> BatchFunction:
        """[M | delta] as linear maps of the parameters, row by row."""
        M, delta = self._direct
        stacked = ca.vertcat(ca.vec(M.T), delta)
        maps = ca.jacobian(stacked, self._phi).T
        return self._compiled([self._q, self._dq], [maps], drift=True)

    def _compiled(self, states: list[ca.SX], outputs: list[ca.SX], *, drift: bool) -> BatchFunction:
        """A function of states alone: R, and b if there is a drift, are solved for inside."""
        loop = self._projection
        if loop is None:
            return BatchFunction(states, outputs, once=self._once)
        inner = ca.Function("inner", [*states, loop.R_d, loop.b_d], ca.cse(outputs))
        inputs = [ca.MX.sym(f"s{k}", state.numel()) for k, state in enumerate(states)]
        q, dq = inputs[:2]
        b = loop.drift(q, dq) if drift else ca.MX(loop.b_d.numel(), 1)
        return BatchFunction(inputs, [inner(*inputs, loop.tangent(q), b)], once=self._once)

    def regressor(self, q: FloatArray, dq: FloatArray, ddq: FloatArray) -> FloatArray:
        """Single-sample observation matrices K with tau = K phi [Atkeson1986].

        Args:
            q: Generalised coordinates, (n_samples, n_q), rad or m.
            dq: Velocities, same shape.
            ddq: Accelerations, same shape.

        Returns:
            (n_samples, n_dof, n_parameters)
        """
        (K,) = self._regressor(q, dq, ddq)
        return K.reshape(-1, self.n_dof, self.n_parameters)

    def inverse(
        self, q: FloatArray, dq: FloatArray, ddq: FloatArray, phi: FloatArray
    ) -> FloatArray:
        """Torques of a motion in the independent coordinates, (n_samples, n_dof), N m or N."""
        return self.regressor(q, dq, ddq) @ phi

    def direct_regressor(self, q: FloatArray, dq: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Mass matrix and bias as linear maps of the standard parameters.

        Args:
            q: Generalised coordinates, (n_samples, n_q), rad or m.
            dq: Velocities, same shape.

        Returns:
            Maps A and B with M = A @ phi, (n_samples, n_dof, n_dof, n_parameters), and
            delta = B @ phi, (n_samples, n_dof, n_parameters).
        """
        (flat,) = self._direct_regressor(q, dq)
        n = self.n_dof
        both = flat.reshape(-1, n * (n + 1), self.n_parameters)
        return both[:, : n * n].reshape(-1, n, n, self.n_parameters), both[:, n * n :]

    def accelerations(self, phi: FloatArray) -> ca.Function:
        """Accelerations of an open tree by coordinates, velocities and torques, of symbols.

        Args:
            phi: Values of the standard parameters, (n_parameters,).
        """
        M, delta = ca.substitute(list(self._direct_q), [self._phi], [ca.SX(phi)])
        tau = ca.SX.sym("tau", self.n_dof)
        D, LT, order = ca.ldl(M)
        ddq = ca.cse(ca.ldl_solve(tau - delta, D, LT, order))
        return ca.Function("accelerations", [self._q, self._dq, tau], [ddq])

    def observation(self, columns: IntArray) -> ObservationFunction:
        """W of a set of columns along a trajectory, and its adjoint."""
        K = ca.densify(ca.jacobian(self._tau, self._phi))[:, columns.tolist()]
        states = [self._q, self._dq, self._ddq]
        loop = self._projection
        if loop is None:
            return ObservationFunction(states, K, lambda q_bar: q_bar)
        inner = ca.Function("inner", [*states, loop.R_d], [ca.cse(K)])
        q = loop.q
        dz, ddz = ca.MX.sym("dz", self.n_dof), ca.MX.sym("ddz", self.n_dof)
        closed = inner(q, *loop.rates(q, dz, ddz), loop.tangent(q))
        return ObservationFunction([q, dz, ddz], closed, lambda q_bar: loop.pulled(q, q_bar))

    def count_operations(
        self, model: ReducedModel, *, signs_free: bool = True, independent: bool = False
    ) -> tuple[int, int]:
        """Operations of IDM and [M | delta] of a model, parameters as inputs.

        Args:
            model: Which parameters are kept.
            signs_free: See :mod:`paramreduce_cli.expressions.operations`.
            independent: Whether d_z and [M_zz | delta_z] are counted, with R and b handed in,
                instead of d_q and [M_qq | delta_q]; on an open tree they are the same.
        """
        dropped = np.setdiff1d(np.arange(self.n_parameters), model.kept).tolist()
        inverse, direct = self._independent_programs if independent else self.programs
        return (
            inverse.count(dropped, same=model.ties, signs_free=signs_free),
            direct.count(dropped, same=model.ties, signs_free=signs_free),
        )

    @cached_property
    def programs(self) -> tuple[Program, Program]:
        """d_q and [M_qq | delta_q], M's lower triangle row by row; inputs are phi, q, dq and ddq."""
        return self._counted(self._tau_q, *self._direct_q)

    @cached_property
    def _independent_programs(self) -> tuple[Program, Program]:
        return self._counted(self._tau, *self._direct)

    def _counted(self, tau: ca.SX, M: ca.SX, delta: ca.SX) -> tuple[Program, Program]:
        """Straight-line programs of IDM and [M | delta], M's lower triangle; phi comes first."""
        lower = [M[i, j] for i in range(M.shape[0]) for j in range(i + 1)]
        loop = [] if self._projection is None else [self._projection.R_d, self._projection.b_d]
        q, dq, ddq = self._q, self._dq, self._ddq
        inverse = ca.Function("d", [self._phi, q, dq, ddq, *loop], [tau])
        direct = ca.Function("M_delta", [self._phi, q, dq, *loop], [ca.vertcat(*lower), delta])
        return Program.of_function(inverse), Program.of_function(direct)


class ObservationFunction:
    """Chosen columns of W for a trajectory, with the gradient of any function of W.

    Args:
        states: Symbols of q, dz and ddz.
        K: Columns of the regressor of one sample in them, (n_dof, n_columns).
        pulled: Takes a derivative by q to one by z.
    """

    def __init__(
        self,
        states: list[ca.SX] | list[ca.MX],
        K: ca.SX | ca.MX,
        pulled: Callable[[ca.SX], ca.SX] | Callable[[ca.MX], ca.MX],
    ) -> None:
        self.n_dof, self.n_columns = K.shape
        self._forward = BatchFunction(states, [K.T])
        seed = type(K).sym("seed", self.n_columns, self.n_dof)
        inner = ca.dot(seed, K.T)
        q_bar, dz_bar, ddz_bar = (ca.gradient(inner, state) for state in states)
        self._adjoint = BatchFunction([*states, ca.vec(seed)], [pulled(q_bar), dz_bar, ddz_bar])

    def forward(self, q: FloatArray, dz: FloatArray, ddz: FloatArray) -> FloatArray:
        """W, (n_samples * n_dof, n_columns).

        Args:
            q: Generalised coordinates, (n_samples, n_q).
            dz: Velocities of the independent ones, (n_samples, n_dof).
            ddz: Accelerations, same shape.
        """
        (K,) = self._forward(q, dz, ddz)
        return K.reshape(-1, self.n_columns)

    def adjoint(
        self, q: FloatArray, dz: FloatArray, ddz: FloatArray, W_bar: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Pull a derivative with respect to W back to the independent coordinates.

        The derivative by z is taken through the position problem: dq/dz = R.

        Args:
            q: Generalised coordinates, (n_samples, n_q).
            dz: Velocities of the independent ones, (n_samples, n_dof).
            ddz: Accelerations, same shape.
            W_bar: Derivative of a scalar with respect to W, (n_samples * n_dof, n_columns).

        Returns:
            Derivatives with respect to z, dz and ddz, each (n_samples, n_dof).
        """
        seed = W_bar.reshape(q.shape[0], self.n_dof * self.n_columns)
        z_bar, dz_bar, ddz_bar = self._adjoint(q, dz, ddz, seed)
        return z_bar, dz_bar, ddz_bar
