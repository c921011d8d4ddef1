"""A manoeuvre simulated with the full and with the selected model."""

from collections.abc import Mapping

import numpy as np

from paramreduce_cli.records.arrays import FloatArray
from paramreduce_cli.records.representation import record

_STILL = 1e-9
"""Root mean square motion below which a coordinate counts as still, rad or m, rad/s^2 or m/s^2."""


@record
class SimulatedManoeuvre:
    """The motions of two models under the same inputs; each array (n_samples, n_free), for the coordinates without a
    prescribed motion.
    """

    set_name: str
    """Set whose first manoeuvre it is."""
    names: tuple[str, ...]
    """Names of the coordinates."""
    time: FloatArray
    """(n_samples,), s"""
    full: Mapping[str, FloatArray]
    """Motion of the full model: ``position``, rad or m, and ``acceleration``."""
    selected: Mapping[str, FloatArray]
    """Motion of the selected model."""

    def compute_rms(self, quantity: str) -> FloatArray:
        """Return the root mean square of the full model's motion over time, (n_free,), of positions about their mean.

        Args:
            quantity: ``position`` or ``acceleration``.
        """
        motion = self.full[quantity]
        centre = motion.mean(axis=0) if quantity == "position" else 0.0
        return np.sqrt(np.mean((motion - centre) ** 2, axis=0))

    def compute_deviations(self, quantity: str) -> FloatArray:
        """Return the root mean square deviation of the selected model as a fraction of that of the motion, (n_free,).

        Coordinates that stay still in both models have none; those that move in the selected model alone have inf.

        Args:
            quantity: ``position`` or ``acceleration``.
        """
        off = np.sqrt(np.mean((self.selected[quantity] - self.full[quantity]) ** 2, axis=0))
        rms = self.compute_rms(quantity)
        moves = rms > _STILL
        still = np.where(off > _STILL, np.inf, 0.0)
        return np.where(moves, off / np.where(moves, rms, 1.0), still)

    def compute_error(self, quantity: str) -> float:
        """Return the root mean square of the deviations of all coordinates, as a fraction.

        Args:
            quantity: ``position`` or ``acceleration``.
        """
        return float(np.sqrt(np.mean(self.compute_deviations(quantity) ** 2)))
