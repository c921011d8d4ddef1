"""Simulated motions of a mechanism under inputs, for mechanisms that cannot follow every trajectory.

Coordinates without an input move as the others make them. States are those of the full model's
forward dynamics; accelerations follow from the inputs at each sample, so that torques and states fit
each other to round-off whatever the integration's error.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import scipy  # whose integrate is loaded when it is used

from paramreduce_cli.errors import DataError
from paramreduce_cli.multibody.dynamics import Dynamics
from paramreduce_cli.multibody.loops.coordinates import Coordinates
from paramreduce_cli.records import FloatArray

_TOLERANCE = 1e-8
"""Tolerance of the integration, relative and absolute; it moves the path, not the fit of its samples."""
_MOST_EVALUATIONS = 100
"""Most evaluations of the dynamics for each sample, on average; a dozen are usual."""
_METHOD = "LSODA"
"""Stiff where friction is smooth but steep, and not where it is not."""


@dataclass(frozen=True)
class Input:
    """A force on an independent coordinate: sines of time, and feedback towards a resting position."""

    amplitude: float = 0.0
    """Amplitude of each sine, N m or N."""
    frequencies: tuple[float, ...] = ()
    """Hz"""
    phases: tuple[float, ...] = ()
    """rad"""
    stiffness: float = 0.0
    """Stiffness of the feedback, N m/rad or N/m."""
    damping: float = 0.0
    """N m s/rad or N s/m"""
    reference: float = 0.0
    """rad or m"""

    def __call__(self, time: float, z: float, dz: float) -> float:
        """Return the force at a time and a state."""
        sines = sum(
            np.sin(2 * np.pi * frequency * time + phase)
            for frequency, phase in zip(self.frequencies, self.phases, strict=True)
        )
        feedback = self.stiffness * (self.reference - z) - self.damping * dz
        return float(self.amplitude * sines + feedback)


@dataclass(frozen=True)
class SimulatedMotion:
    """A simulated motion; each array (n_samples, n_dof)."""

    time: FloatArray
    """(n_samples,), s"""
    z: FloatArray
    dz: FloatArray
    ddz: FloatArray
    tau: FloatArray
    """Inputs, zero where there is none, (n_samples, n_dof), N m or N."""


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
    dynamics: MassAndBias, inputs: Sequence[Input], start: FloatArray, time: FloatArray
) -> SimulatedMotion:
    """Simulate the mechanism from rest under given inputs.

    Args:
        dynamics: Mass matrix and bias of the mechanism.
        inputs: Inputs, one per independent coordinate.
        start: Independent coordinates to start from, (n_dof,), rad or m.
        time: Time of the samples, from zero, (n_samples,), s.

    Raises:
        DataError: The motion grows beyond all bounds, or the loops cannot be closed.
    """
    dynamics.restart()
    forward = _ForwardDynamics(dynamics, inputs, _MOST_EVALUATIONS * time.size)
    n = start.size
    state = np.concatenate([start, np.zeros(n)])
    with np.errstate(over="ignore", invalid="ignore"):
        found = scipy.integrate.solve_ivp(
            forward.compute_rates, (0.0, float(time[-1])), state, _METHOD, time,
            rtol=_TOLERANCE, atol=_TOLERANCE,
        )  # fmt: skip
    z, dz = found.y[:n].T, found.y[n:].T
    if not found.success or not np.isfinite(found.y).all():
        raise _make_divergence_error(float(found.t[-1]) if found.t.size else 0.0)
    dynamics.restart()
    tau = np.array([forward.compute_inputs(*sample) for sample in zip(time, z, dz, strict=True)])
    samples = zip(time, z, dz, strict=True)
    ddz = np.array([forward.compute_rates(t, np.concatenate([*some]))[n:] for t, *some in samples])
    return SimulatedMotion(time, z, dz, ddz, tau)


def _make_divergence_error(time: float) -> DataError:
    """Return the error that a motion cannot be simulated beyond some time."""
    return DataError(
        f"the simulated motion cannot be followed beyond {time:.3g} s; give it smaller inputs, or "
        "feedback that keeps it within bounds."
    )


class _ForwardDynamics:
    """The forward dynamics of a mechanism under inputs."""

    def __init__(self, dynamics: MassAndBias, inputs: Sequence[Input], most: int) -> None:
        self._dynamics, self._inputs = dynamics, inputs
        self._left = most
        """Evaluations until the motion is given up."""

    def compute_inputs(self, time: float, z: FloatArray, dz: FloatArray) -> FloatArray:
        """Return the forces on the independent coordinates, (n_dof,)."""
        pairs = zip(self._inputs, z, dz, strict=True)
        return np.array([signal(time, *state) for signal, *state in pairs])

    def compute_rates(self, time: float, state: FloatArray) -> FloatArray:
        """Return the derivative of positions and velocities, (2 n_dof,).

        Raises:
            DataError: The motion diverges, or the mass matrix is singular.
        """
        self._left -= 1
        if self._left < 0 or not np.isfinite(state).all():
            raise _make_divergence_error(time)
        z, dz = np.split(state, 2)
        M, delta = self._dynamics(z, dz)
        try:
            ddz = np.linalg.solve(M, self.compute_inputs(time, z, dz) - delta)
        except np.linalg.LinAlgError as error:
            raise DataError(
                f"the mass matrix is singular at {time:.3g} s, as where a moving body has no mass; "
                "nothing can be simulated."
            ) from error
        return np.concatenate([dz, ddz])
