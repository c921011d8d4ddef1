"""Symmetries of a mechanism, which complete a set of trajectories.

A symmetry lets each independent coordinate move as another one did, perhaps the other way.
All products of those given are taken, so that the set has the symmetry of their group.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from paramreduce_cli.errors import Cause, NumericalError
from paramreduce_cli.records import FloatArray

_MOST = 200


@dataclass(frozen=True)
class Symmetry:
    """A symmetry of a motion: coordinate k moves as coordinate ``sources[k]``, times ``signs[k]``."""

    sources: tuple[int, ...]
    signs: tuple[int, ...]

    def compose(self, other: Symmetry) -> Symmetry:
        """Return the symmetry that applies first the other one, then this."""
        return Symmetry(
            tuple(other.sources[k] for k in self.sources),
            tuple(s * other.signs[k] for s, k in zip(self.signs, self.sources, strict=True)),
        )

    def map_series(self, coefficients: FloatArray) -> FloatArray:
        """Return the image of a series, (n_dof, 1 + 2 harmonics)."""
        return coefficients[list(self.sources)] * np.array(self.signs)[:, None]


def generate_group(given: Sequence[Sequence[str]], names: Sequence[str]) -> list[Symmetry]:
    """Return the group that some symmetries generate, the identity first.

    Args:
        given: Symmetries; each lists, for every coordinate, the name of the coordinate whose motion it takes, ``-NAME``
            for the opposite motion.
        names: Names of the independent coordinates, (n_dof,).

    Raises:
        NumericalError: The group has too many elements.
    """
    generators = [
        Symmetry(
            tuple(names.index(entry.removeprefix("-")) for entry in images),
            tuple(-1 if entry.startswith("-") else 1 for entry in images),
        )
        for images in given
    ]
    found = [Symmetry(tuple(range(len(names))), (1,) * len(names))]
    known = set(found)
    for element in found:  # grows while it is walked through, until nothing new comes
        for generator in generators:
            product = generator.compose(element)
            if product not in known:
                known.add(product)
                found.append(product)
        if len(found) > _MOST:
            raise NumericalError(
                f"they generate more than {_MOST} images of every trajectory; that is no symmetry of a "
                "mechanism.",
                Cause.SYMMETRIES,
            )
    return found


def complete_series(series: Sequence[FloatArray], images: Sequence[Symmetry]) -> list[FloatArray]:
    """Return all images of all series; the images of one series stand together."""
    return [symmetry.map_series(coefficients) for coefficients in series for symmetry in images]
