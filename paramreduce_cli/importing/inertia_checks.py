"""What may be wrong with the inertias of a file, link by link."""

from collections.abc import Iterator, Mapping

import numpy as np

from paramreduce_cli.importing.imported import Inertial
from paramreduce_cli.records import FloatArray
from paramreduce_cli.robots.inertia import is_positive_semidefinite

_FAR = 0.5
"""Square of the distance to the centre of mass, in squares of the radius of gyration, from which on it
matters about which point an inertia is."""
_MOST = 8
"""Links that are named in one warning."""


def find_inertia_warnings(links: Mapping[str, Inertial | None]) -> Iterator[str]:
    """Sentences about masses and inertias that no body can have, or that look misplaced."""
    given = {name: inertial for name, inertial in links.items() if inertial is not None}
    heavy = {name: one for name, one in given.items() if one.mass > 0}
    sentences = {
        "a mass below zero": [name for name, one in given.items() if one.mass < 0],
        "an inertia but no mass": [
            name for name, one in given.items() if not one.mass and one.tensor.any()
        ],
        "an inertia that no distribution of mass has": [
            name for name, one in heavy.items() if not possible(one.tensor)
        ],
        "an inertia that may be about the link's origin instead of its centre of mass": [
            name for name, one in heavy.items() if _about_origin(one)
        ],
    }
    for what, names in sentences.items():
        if names:
            more = f" and {len(names) - _MOST} more" if len(names) > _MOST else ""
            yield f"{', '.join(names[:_MOST])}{more}: {what}"


def possible(tensor: FloatArray) -> bool:
    """Whether second moments of mass with this tensor are positive."""
    return is_positive_semidefinite(np.trace(tensor) / 2 * np.eye(3) - tensor)


def _about_origin(inertial: Inertial) -> bool:
    """Whether a tensor stays possible, but much smaller, if it is taken to be about the origin.

    That of a body that reaches from the origin to well beyond its centre of mass is not: a rod has a
    twelfth of m l^2 about its middle, which is a quarter of m l^2 away.
    """
    c, m = inertial.com, inertial.mass
    gyration = np.trace(inertial.tensor) / 2 / m
    left = inertial.tensor - m * (c @ c * np.eye(3) - np.outer(c, c))
    return possible(inertial.tensor) and possible(left) and bool(c @ c > _FAR * gyration)
