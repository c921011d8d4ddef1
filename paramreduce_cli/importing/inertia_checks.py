"""Checks of the inertias in a robot file, link by link."""

from collections.abc import Iterator, Mapping

import numpy as np

from paramreduce_cli.importing.imported_robot import Inertial
from paramreduce_cli.records import FloatArray
from paramreduce_cli.robots.inertia import is_positive_semidefinite

_FAR = 0.5
"""Square of the distance to the centre of mass, in squares of the radius of gyration, from which on it
matters about which point an inertia is."""
_MOST = 8
"""Links that are named in one warning."""


def find_inertia_warnings(links: Mapping[str, Inertial | None]) -> Iterator[str]:
    """Yield warnings about physically impossible masses and inertias, and about inertias that seem to be about another
    point.
    """
    given = {name: inertial for name, inertial in links.items() if inertial is not None}
    heavy = {name: one for name, one in given.items() if one.mass > 0}
    sentences = {
        "a mass below zero": [name for name, one in given.items() if one.mass < 0],
        "an inertia but no mass": [
            name for name, one in given.items() if not one.mass and one.tensor.any()
        ],
        "an inertia that no distribution of mass has": [
            name for name, one in heavy.items() if not is_physical(one.tensor)
        ],
        "an inertia that may be about the link's origin instead of its centre of mass": [
            name for name, one in heavy.items() if _is_about_origin(one)
        ],
    }
    for what, names in sentences.items():
        if names:
            more = f" and {len(names) - _MOST} more" if len(names) > _MOST else ""
            yield f"{', '.join(names[:_MOST])}{more}: {what}"


def is_physical(tensor: FloatArray) -> bool:
    """Return whether a tensor has positive second moments of mass."""
    return is_positive_semidefinite(np.trace(tensor) / 2 * np.eye(3) - tensor)


def _is_about_origin(inertial: Inertial) -> bool:
    """Return whether a tensor was probably given about the origin: it stays physical when shifted to the centre of
    mass, but becomes much smaller. A body that reaches from the origin far beyond its centre of mass is no such case: a
    rod has m l^2 / 12 about its middle, and m l^2 / 4 less than about its end.
    """
    c, m = inertial.com, inertial.mass
    gyration = np.trace(inertial.tensor) / 2 / m
    left = inertial.tensor - m * (c @ c * np.eye(3) - np.outer(c, c))
    return is_physical(inertial.tensor) and is_physical(left) and bool(c @ c > _FAR * gyration)
