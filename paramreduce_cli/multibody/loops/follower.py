"""Positions of closed loops along a motion that an optimiser changes step by step."""

import contextlib

import numpy as np

from paramreduce_cli.errors import DataError
from paramreduce_cli.multibody.loops.coordinates import Coordinates
from paramreduce_cli.records import FloatArray


class Follower:
    """A follower of positions along a motion that changes a little from call to call.

    Each call starts from the positions that :meth:`keep` stored last, which must be of as many samples, or from the
    assembly if none are stored. Positions stay on the side of singular configurations that the assembly is on.

    Args:
        coordinates: Coordinates of the mechanism.
    """

    def __init__(self, coordinates: Coordinates) -> None:
        self._coordinates = coordinates
        self._kept: FloatArray | None = None
        self._last: tuple[FloatArray, FloatArray] | None = None

    def __call__(self, z: FloatArray) -> FloatArray:
        """Generalised coordinates, (n_samples, n_q), at z (n_samples, n_dof).

        Raises:
            DataError: The loops cannot be closed at a sample without passing a singularity.
        """
        if self._coordinates.mechanism.loops is None:
            return z
        if self._last is None or not np.array_equal(self._last[0], z):
            self._last = (z, self._find_positions(z))
        return self._last[1]

    def _find_positions(self, z: FloatArray) -> FloatArray:
        """Return positions, found from those that :meth:`keep` stored.

        Start from the assembly if there are none, or if the loops cannot be closed from there or end beyond a singular
        configuration.
        """
        if self._kept is not None:
            with contextlib.suppress(DataError):
                q = self._coordinates.compute_positions(z, self._kept)
                self._coordinates.check_side(z, q)
                return q
        q = self._coordinates.compute_positions(z, None)
        self._coordinates.check_side(z, q)
        return q

    def keep(self) -> None:
        """Start from the positions found last from now on, because they are good ones."""
        if self._last is not None:
            self._kept = self._last[1]
