"""Limits of torques and powers along a motion, of the model with the values that are known."""

from dataclasses import dataclass

import numpy as np

from paramreduce_cli.records import FloatArray


@dataclass(frozen=True)
class Loads:
    """Rows that are at most zero where torque and power keep to their limits.

    Attributes:
        values: Of the base parameters, (r,).
        torque: Limits, (n_dof,), N m or N; infinite where there is none.
        power: Limits, (n_dof,), W.
        scale: What rows of the observation matrix were divided by, (n_dof,).
    """

    values: FloatArray
    torque: FloatArray
    power: FloatArray
    scale: FloatArray

    @property
    def limited(self) -> bool:
        """Whether there is any limit."""
        return bool(np.isfinite(self.torque).any() or np.isfinite(self.power).any())

    def torques(self, W: FloatArray) -> FloatArray:
        """Torques over their scale, (n_points, n_dof), from rows of W over it."""
        found: FloatArray = (W @ self.values).reshape(-1, self.scale.size)
        return found

    def rows(self, scaled: FloatArray, dz: FloatArray) -> FloatArray:
        """Squared shares of the limits minus one, (n_points, 2 n_dof)."""
        share = scaled * self._per_torque
        power = scaled * dz * self._per_power
        return np.column_stack([share, power]) ** 2 - 1

    def pulled(
        self, scaled: FloatArray, dz: FloatArray, bar: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Derivatives by scaled torques and by speeds, from those by the rows."""
        n = self.scale.size
        torque, power = bar[:, :n], bar[:, n:]
        moved = 2 * power * scaled * dz * self._per_power**2
        return 2 * torque * scaled * self._per_torque**2 + moved * dz, moved * scaled

    @property
    def _per_torque(self) -> FloatArray:
        return np.where(np.isfinite(self.scale), self.scale, 0.0) / self.torque

    @property
    def _per_power(self) -> FloatArray:
        return np.where(np.isfinite(self.scale), self.scale, 0.0) / self.power
