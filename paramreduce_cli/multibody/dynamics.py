"""Numeric dynamics of a mechanism, evaluated for many states at once.

The regressor of the open tree, projected on the independent coordinates where there are loops,
and compiled; everything else follows from it, as it is linear in the accelerations too.

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
from paramreduce_cli.multibody.loops.projection import Projection
from paramreduce_cli.multibody.regressor import express_regressor
from paramreduce_cli.records import FloatArray, IntArray, Mechanism

SINGULAR_MASS = 1e-10
"""Smallest over largest eigenvalue at which a mass matrix counts as singular: accelerations are
round-off then."""


class Dynamics:
    """The inverse and direct dynamics of a mechanism, and their regressors, in independent coordinates.

    Args:
        mechanism: The mechanism; its standard parameters stay free.
        once: Whether it is evaluated so little that compiling it does not pay.
    """

    def __init__(self, mechanism: Mechanism, *, once: bool = False) -> None:
        self._once = once
        self.mechanism = mechanism
        self.n_dof = mechanism.n_dof
        self.n_parameters = mechanism.n_parameters

    @cached_property
    def _loop(self) -> Projection | None:
        return None if self.mechanism.loops is None else Projection(self.mechanism)

    def _make_symbols(self, *names: str) -> list[ca.MX]:
        """Return the symbol q, shared with the loops if there are any, and further symbols of its size."""
        q, *more = (ca.MX.sym(name, self.mechanism.n_q) for name in ("q", *names))
        return [q if self._loop is None else self._loop.q, *more]

    @cached_property
    def _regressor(self) -> BatchFunction:
        """Compiled regressor of one sample, transposed."""
        states = self._make_symbols("dq", "ddq")
        tree = express_regressor(self.mechanism)
        KT = (
            tree(*states) if self._loop is None else self._loop.project_regressor(tree, *states[1:])
        )
        return BatchFunction(states, [KT], once=self._once)

    def compute_regressor(self, q: FloatArray, dq: FloatArray, ddq: FloatArray) -> FloatArray:
        """Return the regressor of every sample, K with tau = K phi [Atkeson1986].

        Args:
            q: Generalised coordinates, (n_samples, n_q), rad or m.
            dq: Velocities, same shape.
            ddq: Accelerations, same shape.

        Returns:
            (n_samples, n_dof, n_parameters)
        """
        (K,) = self._regressor(q, dq, ddq)
        return K.reshape(-1, self.n_dof, self.n_parameters)

    def compute_torques(
        self, q: FloatArray, dq: FloatArray, ddq: FloatArray, phi: FloatArray
    ) -> FloatArray:
        """Return the torques of a motion in the independent coordinates, N m or N.

        Args:
            q: Generalised coordinates, (n_samples, n_q), rad or m.
            dq: Velocities, same shape.
            ddq: Accelerations, same shape.
            phi: Standard parameters, (n_parameters,), or of several models, (n_parameters, n_models).

        Returns:
            (n_samples, n_dof) or (n_samples, n_dof, n_models)
        """
        return self.compute_regressor(q, dq, ddq) @ phi

    def compute_mass_matrix_and_bias(
        self, q: FloatArray, dq: FloatArray, phi: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return the mass matrix and the bias, with tau = M ddz + delta.

        Args:
            q: Generalised coordinates, (n_samples, n_q), rad or m.
            dq: Velocities, same shape.
            phi: Standard parameters, (n_parameters,), or of several models, (n_parameters, n_models).

        Returns:
            M, (n_samples, n_dof, n_dof), and delta, (n_samples, n_dof); of several models with
            another axis at the end.
        """
        # At rest, so that what the velocities need does not cancel: near singular configurations
        # of loops it is large. Regressors are subtracted, so that stiff springs cancel exactly.
        rest = np.zeros_like(q)
        tangent, drift = self._compute_tangent_and_drift(q, dq)
        still = self.compute_regressor(q, rest, rest)
        columns = [
            (self.compute_regressor(q, rest, unit) - still) @ phi
            for unit in tangent.transpose(2, 0, 1)
        ]
        return np.stack(columns, axis=2), self.compute_torques(q, dq, drift, phi)

    def _compute_tangent_and_drift(
        self, q: FloatArray, dq: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return R, (n_samples, n_q, n_dof), and b, (n_samples, n_q), with ddq = R ddz + b."""
        if self._loop is None:
            return np.broadcast_to(np.eye(self.n_dof), (*q.shape, self.n_dof)), np.zeros_like(q)
        tangent, drift = self._rates(q, dq)
        return tangent.reshape(*q.shape, self.n_dof), drift

    @cached_property
    def _rates(self) -> BatchFunction:
        """R, row by row, and b of a mechanism with loops."""
        assert self._loop is not None
        q, dq = self._make_symbols("dq")
        R, b = self._loop.whole_tangent, self._loop.express_whole_drift(dq)
        return BatchFunction([q, dq], [R.T, b], once=self._once)

    def make_observation(self, columns: IntArray) -> ObservationFunction:
        """Return the function that computes some columns of W along a trajectory, and its adjoint."""
        tree = express_regressor(self.mechanism, columns.tolist())
        loop = self._loop
        if loop is None:
            states = self._make_symbols("dq", "ddq")
            return ObservationFunction(states, tree(*states), lambda q_bar: q_bar)
        dz, ddz = ca.MX.sym("dz", self.n_dof), ca.MX.sym("ddz", self.n_dof)
        KT = loop.project_regressor(tree, *loop.express_rates(dz, ddz))
        return ObservationFunction([loop.q, dz, ddz], KT, loop.compute_vector_jacobian_product)


class ObservationFunction:
    """A function that gives some columns of W along a trajectory, and the gradient of any function of W.

    Args:
        states: Symbols of q, dz and ddz.
        KT: Columns of the regressor of one sample in them, transposed, (n_columns, n_dof).
        gradient: Takes a derivative by q to one by z.
    """

    def __init__(self, states: list[ca.MX], KT: ca.MX, gradient: Callable[[ca.MX], ca.MX]) -> None:
        self.n_columns, self.n_dof = KT.shape
        self._forward = BatchFunction(states, [KT])
        seed = ca.MX.sym("seed", self.n_columns, self.n_dof)
        inner = ca.dot(seed, KT)
        q_bar, dz_bar, ddz_bar = (ca.gradient(inner, state) for state in states)
        self._adjoint = BatchFunction([*states, ca.vec(seed)], [gradient(q_bar), dz_bar, ddz_bar])

    def evaluate(self, q: FloatArray, dz: FloatArray, ddz: FloatArray) -> FloatArray:
        """Return W, (n_samples * n_dof, n_columns).

        Args:
            q: Generalised coordinates, (n_samples, n_q).
            dz: Velocities of the independent coordinates, (n_samples, n_dof).
            ddz: Accelerations, same shape.
        """
        (K,) = self._forward(q, dz, ddz)
        return K.reshape(-1, self.n_columns)

    def compute_vector_jacobian_product(
        self, q: FloatArray, dz: FloatArray, ddz: FloatArray, W_bar: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return the derivatives of a function with respect to positions, velocities and accelerations of the
        independent coordinates, given its derivative with respect to W.

        Args:
            q: Generalised coordinates, (n_samples, n_q).
            dz: Velocities of the independent coordinates, (n_samples, n_dof).
            ddz: Accelerations, same shape.
            W_bar: Derivative of a scalar with respect to W, (n_samples * n_dof, n_columns).

        Returns:
            Derivatives with respect to z, dz and ddz, each (n_samples, n_dof).
        """
        seed = W_bar.reshape(q.shape[0], self.n_dof * self.n_columns)
        z_bar, dz_bar, ddz_bar = self._adjoint(q, dz, ddz, seed)
        return z_bar, dz_bar, ddz_bar
