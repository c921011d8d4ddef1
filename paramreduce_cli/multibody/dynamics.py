"""The numeric model of a mechanism, evaluated for many states at once.

Everything is derived from the symbolic inverse and direct dynamics by CasADi and compiled;
this is the only place that knows which formulation a mechanism needs.
"""

from __future__ import annotations

from functools import cached_property

import casadi as ca
import numpy as np

from paramreduce_cli.expressions.compiled import BatchFunction
from paramreduce_cli.expressions.operations import Program
from paramreduce_cli.multibody.direct_dynamics import direct_dynamics
from paramreduce_cli.multibody.inverse_dynamics import inverse_dynamics
from paramreduce_cli.records import FloatArray, IntArray, Mechanism


class Dynamics:
    """Inverse and direct dynamics, regressor and its adjoint.

    Args:
        mechanism: The mechanism; its standard parameters stay free.
        once: Whether it is evaluated so little that compiling it does not pay.
    """

    def __init__(self, mechanism: Mechanism, *, once: bool = False) -> None:
        self._once = once
        self.mechanism = mechanism
        self.n_dof = mechanism.n_dof
        self.n_parameters = len(mechanism.parameter_names)
        self._z, self._dz, self._ddz = (ca.SX.sym(name, self.n_dof) for name in ("z", "dz", "ddz"))
        self._phi = ca.SX.sym("phi", self.n_parameters)

    @cached_property
    def _tau(self) -> ca.SX:
        return ca.vertcat(
            *inverse_dynamics(self.mechanism, self._z, self._dz, self._ddz, self._phi)
        )

    @cached_property
    def _K(self) -> ca.SX:
        return ca.jacobian(self._tau, self._phi)

    @cached_property
    def _direct(self) -> tuple[ca.SX, ca.SX]:
        rows, delta = direct_dynamics(self.mechanism, self._z, self._dz, self._phi)
        return ca.vertcat(*(ca.horzcat(*row) for row in rows)), ca.vertcat(*delta)

    @cached_property
    def _regressor(self) -> BatchFunction:
        return BatchFunction([self._z, self._dz, self._ddz], [self._K.T], once=self._once)

    @cached_property
    def _direct_regressor(self) -> BatchFunction:
        """[M | delta] as linear maps of the parameters, row by row."""
        M, delta = self._direct
        stacked = ca.vertcat(ca.vec(M.T), delta)
        return BatchFunction([self._z, self._dz], [ca.jacobian(stacked, self._phi).T])

    def regressor(self, z: FloatArray, dz: FloatArray, ddz: FloatArray) -> FloatArray:
        """Single-sample observation matrices K with tau = K phi [Atkeson1986].

        Args:
            z: Coordinates, (n_samples, n_dof), rad or m.
            dz: Velocities, same shape.
            ddz: Accelerations, same shape.

        Returns:
            (n_samples, n_dof, n_parameters)
        """
        (K,) = self._regressor(z, dz, ddz)
        return K.reshape(-1, self.n_dof, self.n_parameters)

    def inverse(
        self, z: FloatArray, dz: FloatArray, ddz: FloatArray, phi: FloatArray
    ) -> FloatArray:
        """Joint torques of a motion, (n_samples, n_dof), N m or N."""
        return self.regressor(z, dz, ddz) @ phi

    def direct_regressor(self, z: FloatArray, dz: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Mass matrix and bias as linear maps of the standard parameters.

        Args:
            z: Coordinates, (n_samples, n_dof), rad or m.
            dz: Velocities, same shape.

        Returns:
            Maps A and B with M = A @ phi, (n_samples, n_dof, n_dof, n_parameters), and
            delta = B @ phi, (n_samples, n_dof, n_parameters).
        """
        (flat,) = self._direct_regressor(z, dz)
        n = self.n_dof
        both = flat.reshape(-1, n * (n + 1), self.n_parameters)
        return both[:, : n * n].reshape(-1, n, n, self.n_parameters), both[:, n * n :]

    def observation(self, columns: IntArray) -> ObservationFunction:
        """W of a set of columns along a trajectory, and its adjoint."""
        return ObservationFunction(
            [self._z, self._dz, self._ddz], ca.densify(self._K)[:, columns.tolist()]
        )

    @cached_property
    def inverse_program(self) -> Program:
        """Straight-line program of the IDM, for counting; phi is the last input."""
        function = ca.Function("d", [self._z, self._dz, self._ddz, self._phi], [self._tau])
        return Program(function)

    @cached_property
    def direct_program(self) -> Program:
        """Straight-line program of [M | delta], M's lower triangle; phi is the last input."""
        M, delta = self._direct
        lower = [M[i, j] for i in range(self.n_dof) for j in range(i + 1)]
        function = ca.Function(
            "M_delta", [self._z, self._dz, self._phi], [ca.vertcat(*lower), delta]
        )
        return Program(function)

    def count_operations(self, kept: IntArray, *, signs_free: bool = True) -> tuple[int, int]:
        """Operations of IDM and [M | delta] when only some parameters are kept.

        Args:
            kept: Indices of the parameters that are not zero.
            signs_free: See :mod:`paramreduce_cli.expressions.operations`.

        Returns:
            Counts of the IDM and of the DDM functions.
        """
        dropped = np.setdiff1d(np.arange(self.n_parameters), kept)
        counts = []
        for program in (self.inverse_program, self.direct_program):
            start = program.input_offsets[-1]
            zero = [start + int(k) for k in dropped]
            counts.append(program.count(zero, signs_free=signs_free))
        return counts[0], counts[1]


class ObservationFunction:
    """Chosen columns of W for a trajectory, with the gradient of any function of W."""

    def __init__(self, states: list[ca.SX], K: ca.SX) -> None:
        self.n_dof, self.n_columns = K.shape
        self._forward = BatchFunction(states, [K.T])
        seed = ca.SX.sym("seed", self.n_columns, self.n_dof)
        inner = ca.dot(seed, K.T)
        gradients = [ca.gradient(inner, state) for state in states]
        self._adjoint = BatchFunction([*states, ca.vec(seed)], gradients)

    def forward(self, z: FloatArray, dz: FloatArray, ddz: FloatArray) -> FloatArray:
        """W, (n_samples * n_dof, n_columns), from states (n_samples, n_dof)."""
        (K,) = self._forward(z, dz, ddz)
        return K.reshape(-1, self.n_columns)

    def adjoint(
        self, z: FloatArray, dz: FloatArray, ddz: FloatArray, W_bar: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Pull a derivative with respect to W back to the states.

        Args:
            z: Coordinates, (n_samples, n_dof).
            dz: Velocities.
            ddz: Accelerations.
            W_bar: Derivative of a scalar with respect to W, (n_samples * n_dof, n_columns).

        Returns:
            Derivatives with respect to z, dz and ddz, each (n_samples, n_dof).
        """
        seed = W_bar.reshape(z.shape[0], self.n_dof * self.n_columns)
        z_bar, dz_bar, ddz_bar = self._adjoint(z, dz, ddz, seed)
        return z_bar, dz_bar, ddz_bar
