"""Simulated motions of a mechanism under inputs, for mechanisms that cannot follow every trajectory.

Coordinates without an input move as the others make them; those with a prescribed motion follow it, and their torques are
what it takes. States are those of the full model's forward dynamics; accelerations follow from the inputs at each sample, so
that torques and states fit each other to round-off whatever the integration's error.
"""

import contextlib
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import scipy  # whose integrate is loaded when it is used

from paramreduce_cli.errors import DataError
from paramreduce_cli.excitation.input_signals import Harmonics, Joined, Signals
from paramreduce_cli.multibody.dynamics import Dynamics
from paramreduce_cli.multibody.loops.coordinates import Coordinates
from paramreduce_cli.records import FloatArray, IntArray

_TOLERANCE = 1e-6
"""Tolerance of the integration, relative and absolute; it moves the path, not the fit of its samples."""
_MOST_EVALUATIONS = 100
"""Most evaluations of the dynamics for each sample, on average; a dozen are usual."""
_METHOD = "LSODA"
"""Stiff where friction is smooth but steep, and not where it is not."""
_BALANCED = 1e-6
"""Largest force that may be left in static equilibrium, relative to the largest force at the start."""
_CORRECTIONS = 100
"""Most steps to the equilibrium."""
_LONGEST, _SHORTEST = 0.1, 1e-12
"""Longest and shortest step of a coordinate, rad or m."""
_DIFFERENCE = 1e-6
"""Difference of a coordinate that stiffness is measured with, rad or m."""
_NEUTRAL, _SOFT = 1e-7, 1e-2
"""Stiffness relative to the largest one below which a direction counts as neutral, and at most may count so."""


@dataclass(frozen=True)
class Inputs:
    """The inputs of a mechanism with n_dof independent coordinates."""

    forces: Harmonics
    """Forces on all independent coordinates, N m or N."""
    stiffness: FloatArray
    """Stiffness of the feedback towards the reference, (n_dof,), N m/rad or N/m."""
    damping: FloatArray
    """Damping of the feedback, (n_dof,), N m s/rad or N s/m."""
    reference: FloatArray
    """Position that the feedback leads to, (n_dof,), rad or m."""
    prescribed: IntArray
    """Indices of the independent coordinates that follow a motion, (n_prescribed,)."""
    motions: Signals
    """Their motions, rad or m."""

    @classmethod
    def make_passive(cls, n_dof: int) -> "Inputs":
        """Return inputs without any force or motion."""
        zero = np.zeros(n_dof)
        none = Harmonics(np.empty(0), np.empty((n_dof, 0)))
        return cls(none, zero, zero, zero, np.empty(0, dtype=np.int64), Joined([]))

    def compute_forces(self, time: float, z: FloatArray, dz: FloatArray) -> FloatArray:
        """Return the forces on the independent coordinates at a time and a state, (n_dof,)."""
        force, _, _ = self.forces(time)
        feedback = self.stiffness * (self.reference - z) - self.damping * dz
        return np.asarray(force + feedback)

    @property
    def free(self) -> IntArray:
        """Indices of the independent coordinates without a prescribed motion."""
        return np.setdiff1d(np.arange(self.stiffness.size), self.prescribed)


@dataclass(frozen=True)
class SimulatedMotion:
    """A simulated motion; each array (n_samples, n_dof)."""

    time: FloatArray
    """(n_samples,), s"""
    z: FloatArray
    dz: FloatArray
    ddz: FloatArray
    tau: FloatArray
    """Inputs, zero where there is none, and what prescribed motions take, (n_samples, n_dof), N m or N."""


class MassAndBias(Protocol):
    """The mass matrix and bias of a mechanism at single states that follow each other."""

    def __call__(self, z: FloatArray, dz: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return M, (n_dof, n_dof), and delta, (n_dof,), at positions and velocities, (n_dof,) each."""

    def restart(self) -> None:
        """Follow loops from the assembly again, instead of from the last state."""


class TextbookMassAndBias:
    """The mass matrix and bias by the regressor.

    Args:
        dynamics: Dynamics of the mechanism.
        phi: Standard parameters, (n_parameters,).
    """

    def __init__(self, dynamics: Dynamics, phi: FloatArray) -> None:
        self._dynamics, self._phi = dynamics, phi
        self._coordinates = Coordinates(dynamics.mechanism)
        self._near: FloatArray | None = None
        """Where the mechanism was last, to close its loops from."""

    def restart(self) -> None:
        """Close the loops from the assembly again, instead of from their last position."""
        self._near = None

    def __call__(self, z: FloatArray, dz: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return M, (n_dof, n_dof), and delta, (n_dof,), at positions and velocities, (n_dof,) each.

        Raises:
            DataError: The loops cannot be closed.
        """
        q = self._coordinates.compute_positions(z[None], self._near)
        self._near = q[0]
        dq, _ = self._coordinates.compute_rates(q, dz[None], np.zeros((1, dz.size)))
        M, delta = self._dynamics.compute_mass_matrix_and_bias(q, dq, self._phi)
        return M[0], delta[0]


def simulate(
    dynamics: MassAndBias, inputs: Inputs, start: FloatArray, speed: FloatArray, time: FloatArray
) -> SimulatedMotion:
    """Simulate the mechanism under given inputs.

    Args:
        dynamics: Mass matrix and bias of the mechanism.
        inputs: Inputs.
        start: Independent coordinates to start from, (n_dof,), rad or m; prescribed ones are where their motion begins.
        speed: Velocities to start with, (n_dof,).
        time: Time of the samples, from zero, (n_samples,), s.

    Raises:
        DataError: The motion grows beyond all bounds, or the loops cannot be closed.
    """
    dynamics.restart()
    forward = _ForwardDynamics(dynamics, inputs, _MOST_EVALUATIONS * time.size)
    free = inputs.free
    state = np.concatenate([start[free], speed[free]])
    with np.errstate(over="ignore", invalid="ignore"):
        found = scipy.integrate.solve_ivp(
            forward.compute_rates, (0.0, float(time[-1])), state, _METHOD, time,
            rtol=_TOLERANCE, atol=_TOLERANCE,
        )  # fmt: skip
    if not found.success or not np.isfinite(found.y).all():
        raise _make_divergence_error(float(found.t[-1]) if found.t.size else 0.0)
    dynamics.restart()
    rows = [forward.complete(t, state) for t, state in zip(time, found.y.T, strict=True)]
    z, dz, ddz, tau = (np.array(column) for column in zip(*rows, strict=True))
    return SimulatedMotion(time, z, dz, ddz, tau)


def find_equilibrium(dynamics: MassAndBias, inputs: Inputs, start: FloatArray) -> FloatArray:
    """Return the independent coordinates of the static equilibrium nearest to a position, (n_dof,).

    Coordinates that nothing holds, such as those of a vehicle along the road, stay nearly as they are.

    Args:
        dynamics: Mass matrix and bias of the mechanism.
        inputs: Inputs, at time zero.
        start: Independent coordinates to start from, (n_dof,), rad or m.

    Raises:
        DataError: No equilibrium is found.
    """
    free, z = inputs.free, start.copy()
    z[inputs.prescribed] = inputs.motions(0.0)[0]
    still = np.zeros_like(z)
    feedback = _remove_forces(inputs)

    def compute_imbalance(values: FloatArray) -> FloatArray:
        """Return the forces that are missing at a position, (n_free,)."""
        at = z.copy()
        at[free] = values
        _, delta = dynamics(at, still)
        return np.asarray((delta - feedback.compute_forces(0.0, at, still))[free])

    dynamics.restart()
    values = z[free]
    imbalance = compute_imbalance(values)
    if not np.isfinite(imbalance).all():
        raise DataError("forces at the start are not finite; give another start.")
    first = float(np.abs(imbalance).max(initial=0.0)) or 1.0
    for _ in range(_CORRECTIONS):
        step = _find_least_step(compute_imbalance, values, imbalance)
        step *= min(1.0, _LONGEST / max(float(np.abs(step).max(initial=0.0)), _LONGEST))
        while np.abs(step).max(initial=0.0) > _SHORTEST:
            with contextlib.suppress(DataError):  # beyond the reach of the loops
                moved = compute_imbalance(values + step)
                if np.linalg.norm(moved) < np.linalg.norm(imbalance):
                    break
            step = step / 2
        else:
            break
        values, imbalance = values + step, moved
    if np.abs(imbalance).max(initial=0.0) > _BALANCED * first:
        raise DataError(
            f"there is no static equilibrium near the start: of forces of {first:.3g} N (N m) "
            f"{np.abs(imbalance).max():.3g} are left. Check rest positions and preloads, give a start nearer to it, or leave "
            "out equilibrium."
        )
    z[free] = values
    return z


def _find_least_step(
    function: Callable[[FloatArray], FloatArray], values: FloatArray, imbalance: FloatArray
) -> FloatArray:
    """Return the shortest step that cancels an imbalance to first order, so that neutral coordinates stay.

    Away from the equilibrium, neutral directions have a stiffness as large as the imbalance, which is left out.
    """
    columns = [
        (function(values + move) - imbalance) / _DIFFERENCE
        for move in _DIFFERENCE * np.eye(values.size)
    ]
    left, stiffness, right = np.linalg.svd(np.array(columns).T)
    least = max(_NEUTRAL * stiffness[0], min(_SOFT * stiffness[0], float(np.abs(imbalance).max())))
    stiff = stiffness > least
    return np.asarray(-(left[:, stiff].T @ imbalance) / stiffness[stiff] @ right[stiff])


def _remove_forces(inputs: Inputs) -> Inputs:
    """Return the inputs with feedback alone, without forces that change with time."""
    passive = Inputs.make_passive(inputs.stiffness.size)
    return Inputs(
        passive.forces, inputs.stiffness, inputs.damping, inputs.reference, inputs.prescribed, inputs.motions
    )  # fmt: skip


def _make_divergence_error(time: float) -> DataError:
    """Return the error that a motion cannot be simulated beyond some time."""
    return DataError(
        f"the simulated motion cannot be followed beyond {time:.3g} s; give it smaller inputs, or "
        "feedback that keeps it within bounds."
    )


class _ForwardDynamics:
    """The forward dynamics of a mechanism under inputs."""

    def __init__(self, dynamics: MassAndBias, inputs: Inputs, most: int) -> None:
        self._dynamics, self._inputs = dynamics, inputs
        self._free, self._held = inputs.free, inputs.prescribed
        self._left = most
        """Evaluations until the motion is given up."""

    def compute_rates(self, time: float, state: FloatArray) -> FloatArray:
        """Return the derivative of positions and velocities of the free coordinates, (2 n_free,).

        Raises:
            DataError: The motion diverges, or the mass matrix is singular.
        """
        self._left -= 1
        if self._left < 0 or not np.isfinite(state).all():
            raise _make_divergence_error(time)
        _, dz, ddz, _ = self.complete(time, state)
        return np.concatenate([dz[self._free], ddz[self._free]])

    def complete(
        self, time: float, state: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Return positions, velocities, accelerations and torques of all independent coordinates, (n_dof,) each.

        Args:
            time: Time, s.
            state: Positions and velocities of the free coordinates, (2 n_free,).

        Raises:
            DataError: The mass matrix is singular.
        """
        free, held = self._free, self._held
        n = self._inputs.stiffness.size
        z, dz, ddz = np.empty(n), np.empty(n), np.empty(n)
        z[free], dz[free] = np.split(state, 2)
        if held.size:
            z[held], dz[held], ddz[held] = self._inputs.motions(time)
        M, delta = self._dynamics(z, dz)
        tau = self._inputs.compute_forces(time, z, dz)
        needed = tau - delta
        if held.size:
            needed = needed - M[:, held] @ ddz[held]
        try:
            ddz[free] = np.linalg.solve(M[np.ix_(free, free)], needed[free])
        except np.linalg.LinAlgError as error:
            raise DataError(
                f"the mass matrix is singular at {time:.3g} s, as where a moving body has no mass; "
                "nothing can be simulated."
            ) from error
        if held.size:
            tau[held] = M[held] @ ddz + delta[held]
        return z, dz, ddz, tau
