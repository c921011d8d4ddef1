"""Dynamic parameters of a model: each has a kind, an owner and a unit."""

from __future__ import annotations

from collections.abc import Sequence
from enum import Enum

import numpy as np

from paramreduce_cli.records.arrays import IntArray
from paramreduce_cli.records.representation import record


class Kind(Enum):
    """A kind of parameter: its symbol, unit, formula, and rank of preference in a base.

    The smaller its rank, the more a kind is preferred as a base parameter. For revolute arms these ranks yield Khalil's
    set [Khalil1987]: Izz of the first body and seven parameters of every other one, with Iyy, mz and m regrouped. In
    formulas m with an axis is the first moment. Units of drives are those of rotating ones; sliding drives have N for N
    m and m for rad.
    """

    M = ("m", "kg", 9, "m", "")
    MX = ("mx", "kg m", 5, "m", "x")
    MY = ("my", "kg m", 6, "m", "y")
    MZ = ("mz", "kg m", 8, "m", "z")
    IXX = ("Ixx", "kg m^2", 1, "I", "xx")
    IXY = ("Ixy", "kg m^2", 2, "I", "xy")
    IXZ = ("Ixz", "kg m^2", 3, "I", "xz")
    IYY = ("Iyy", "kg m^2", 7, "I", "yy")
    IYZ = ("Iyz", "kg m^2", 4, "I", "yz")
    IZZ = ("Izz", "kg m^2", 0, "I", "zz")
    ROTOR = ("Ia", "kg m^2", 10, "I", "a", "inertia", "kg", 2)
    VISCOUS = ("fv", "N m s/rad", 11, "f", "v", "viscous", "N s/m", 1)
    COULOMB = ("fc", "N m", 12, "f", "c", "coulomb", "N", None)
    OFFSET = ("off", "N m", 13, "f", "0", "offset", "N", None)
    STIFFNESS = ("k", "N m/rad", 14, "k", "", "stiffness", "N/m", 0)
    STRIBECK = ("fs", "N m", 15, "f", "s", "stribeck", "N", None)
    ASYMMETRY = ("fa", "N m s/rad", 16, "f", "a", "asymmetry", "N s/m", None)
    QUADRATIC = ("fq", "N m s^2/rad^2", 17, "f", "q", "quadratic", "N s^2/m^2", None)
    LOAD = ("fl", "", 18, "f", "l", "load", "", None)
    SPRING_TABLE = ("ks", "", 19, "k", "s", "spring_table", "", None)
    DAMPER_TABLE = ("fd", "", 20, "f", "d", "damper_table", "", None)
    CREEP = ("C", "N m", 21, "C", "", "creep", "N", None)

    def __init__(
        self, symbol: str, unit: str, preference: int, letter: str, axes: str,
        key: str = "", sliding_unit: str = "", order: int | None = None,
    ) -> None:  # fmt: skip
        self.symbol = symbol
        self.unit = unit
        self.preference = preference
        self.letter = letter
        self.axes = axes
        self.key = key
        """Key of a drive in a config; empty for what belongs to a body."""
        self.sliding_unit = sliding_unit
        """Unit where the drive slides."""
        self.order = order
        """Derivative of the drive's position that its force is proportional to; None for none."""

    @property
    def is_signed(self) -> bool:
        """Whether the parameter may be negative on a real drive."""
        return self in (Kind.OFFSET, Kind.STRIBECK, Kind.ASYMMETRY, Kind.QUADRATIC)

    @classmethod
    def parse(cls, symbol: str) -> Kind:
        """Return the kind with a symbol.

        Raises:
            KeyError: There is no kind with this symbol.
        """
        return _BY_SYMBOL[symbol]


_BY_SYMBOL = {kind.symbol: kind for kind in Kind}

INERTIAL = (
    Kind.M, Kind.MX, Kind.MY, Kind.MZ,
    Kind.IXX, Kind.IXY, Kind.IXZ, Kind.IYY, Kind.IYZ, Kind.IZZ,
)  # fmt: skip
"""The standard parameters of a rigid body about its frame's origin: mass, first moments, inertia."""

DRIVE = tuple(kind for kind in Kind if kind.key)
"""What a drive or force element adds to the torques: inertia of a rotor, friction, a constant, springs, dampers, creep."""

SIGN_FRICTION = (Kind.COULOMB, Kind.STRIBECK, Kind.LOAD)
"""Friction that has the sign of the speed as a factor."""

LAST = max(kind.preference for kind in Kind) + 1
"""Rank of preference of columns of which nothing is known."""


@record
class Parameter:
    """One dynamic parameter, and so one column of the observation matrix."""

    kind: Kind
    owner: str
    """Name of the body, payload or drive it belongs to."""
    sliding: bool = False
    """Whether it is of a drive along which things slide."""

    @property
    def name(self) -> str:
        """Such as ``Izz_3``; the same in every file and table."""
        return f"{self.kind.symbol}_{self.owner}"

    @property
    def latex(self) -> str:
        """LaTeX formula of the symbol."""
        place = [part for part in (self.kind.axes, to_latex_subscript(self.owner)) if part]
        return f"{self.kind.letter}_{{{','.join(place)}}}"

    @property
    def unit(self) -> str:
        """SI, such as ``kg m^2``."""
        return self.kind.sliding_unit if self.sliding else self.kind.unit

    @property
    def preference(self) -> int:
        """Rank among base parameters, the smaller the more wanted."""
        return self.kind.preference


def to_latex_subscript(name: str) -> str:
    """Return a body's name as a LaTeX subscript."""
    escaped = name.replace("_", r"\_")
    return rf"\mathrm{{{escaped}}}"


def order_by_preference(ranks: Sequence[int] | IntArray) -> IntArray:
    """Return columns from the most to the least preferred, by rank, then by position, (n,).

    This order breaks every tie in the project.
    """
    return np.argsort(np.asarray(ranks), kind="stable").astype(np.int64)
