"""Speed and tracking errors of a controller that uses a reduced model."""

from collections.abc import Mapping

import numpy as np

from paramreduce_cli.records.arrays import FloatArray, IntArray
from paramreduce_cli.records.representation import record


@record
class Speed:
    """The time that an exported function takes on the machine at hand."""

    seconds: Mapping[str, float]
    """Seconds of one evaluation by model, the full one first, s."""
    language: str
    """Language in which the functions ran."""


@record
class LoopEvaluation:
    """Operations and time of what a controller evaluates for closed loops, besides the torques."""

    newton: int
    """Operations of one of Newton's corrections of the positions."""
    velocities: int
    """Operations of R and all velocities."""
    accelerations: int
    """Operations of b and all accelerations, for a known R."""
    rates: int
    """Operations of R, b, all velocities and all accelerations at once."""
    inverse: Mapping[str, int]
    """Operations of d_z with R handed in, by model, the full one first."""
    seconds: float | None
    """Time of one correction and the rates, s; None if it was not measured."""

    @property
    def whole(self) -> dict[str, int]:
        """Operations of one correction, the rates and d_z, by model, the full one first."""
        return {name: self.newton + self.rates + count for name, count in self.inverse.items()}


@record
class Paths:
    """A set of motions at the times of a controller; each rests at its end while others still move.

    States are (n_samples, n_paths, n_dof).
    """

    time: FloatArray
    """(n_samples,), s."""
    samples: IntArray
    """Number of samples after which each path ends, (n_paths,)."""
    z: FloatArray
    dz: FloatArray
    ddz: FloatArray


@record
class Tracking:
    """The tracking errors of a controller with each of several models."""

    paths: Paths
    errors: Mapping[str, FloatArray]
    """Errors by the model of the controller: z_d - z, (n_samples, n_paths, n_dof), rad or m."""

    def compute_rms(self, model: str) -> FloatArray:
        """Return the root mean square error over time and joints, (n_paths,), rad or m."""
        squares = self.errors[model] ** 2
        own = [squares[:n, k].mean() for k, n in enumerate(self.paths.samples)]
        return np.sqrt(own)
