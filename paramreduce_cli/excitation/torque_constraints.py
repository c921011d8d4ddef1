"""Limits of torques and powers along a motion, of the model with the values that are known."""

from dataclasses import dataclass

import numpy as np

from paramreduce_cli.records import FloatArray


@dataclass(frozen=True)
class TorqueConstraints:
    """The limits of torque and power as rows that are at most zero where the limits are kept.

    Attributes:
        values: Values of the base parameters, (r,).
        torque: Limits, (n_dof,), N m or N; infinite where there is none.
        power: Limits, (n_dof,), W.
        scale: Divisor of the rows of the observation matrix, (n_dof,).
    """

    values: FloatArray
    torque: FloatArray
    power: FloatArray
    scale: FloatArray

    @property
    def limited(self) -> bool:
        """Whether there is any limit."""
        return bool(np.isfinite(self.torque).any() or np.isfinite(self.power).any())

    def compute_torques(self, W: FloatArray) -> FloatArray:
        """Return torques divided by their scale, (n_points, n_dof), from scaled rows of W."""
        found: FloatArray = (W @ self.values).reshape(-1, self.scale.size)
        return found

    def compute_rows(self, scaled: FloatArray, dz: FloatArray) -> FloatArray:
        """Return the squared ratios of torques and powers to their limits, minus one, (n_points, 2 n_dof)."""
        ratios = scaled * self._per_torque
        power = scaled * dz * self._per_power
        return np.column_stack([ratios, power]) ** 2 - 1

    def compute_vector_jacobian_product(
        self, scaled: FloatArray, dz: FloatArray, bar: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return the derivatives with respect to scaled torques and speeds, from those with respect to the rows."""
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
