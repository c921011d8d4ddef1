"""Headings of columns with units, such as ``q1 [deg]`` or ``tau_2 (Nm)``."""

import re
from collections.abc import Iterable, Mapping

_UNITS = {
    "time": {"s": "s", "sec": "s", "ms": "ms", "us": "us", "µs": "us", "ns": "ns"},
    "position": {
        "rad": "rad", "deg": "deg", "°": "deg", "degrees": "deg", "rev": "rev", "m": "m", "mm": "mm",
    },
    "velocity": {
        "rad/s": "rad/s", "rad/sec": "rad/s", "deg/s": "deg/s", "°/s": "deg/s", "rpm": "rpm", "r/min": "rpm", "1/min": "rpm",
        "m/s": "m/s", "mm/s": "mm/s",
    },
    "acceleration": {
        "rad/s^2": "rad/s^2", "rad/s2": "rad/s^2", "rad/s²": "rad/s^2", "deg/s^2": "deg/s^2", "deg/s2": "deg/s^2",
        "deg/s²": "deg/s^2", "m/s^2": "m/s^2", "m/s2": "m/s^2", "m/s²": "m/s^2", "mm/s^2": "mm/s^2",
    },
    "torque": {
        "nm": "N m", "n m": "N m", "n*m": "N m", "n·m": "N m", "n.m": "N m", "mnm": "mN m", "knm": "kN m", "n": "N",
        "a": "A", "ma": "mA",
    },
}  # fmt: skip
"""Units of the config by quantity and by what headings call them, in small letters."""
_WITH_UNIT = re.compile(r"(.*?)[\s_]*[\[(]\s*([^\[\]()\d][^\[\]()]*?)\s*[\])]\s*$")
"""A heading, and a unit in brackets; numbers in brackets are those of joints."""

CURRENTS = ("A", "mA")
"""Units of torques that are those of currents."""


def split_unit(heading: str) -> tuple[str, str]:
    """Return a heading without its unit in brackets, and the unit; empty if there is none."""
    match = _WITH_UNIT.fullmatch(heading)
    return (match[1], match[2]) if match else (heading, "")


def read_units(columns: Mapping[str, str | Iterable[str]]) -> dict[str, str]:
    """Return the units that headings name, by quantity, as the config calls them.

    Args:
        columns: Headings or patterns of headings by quantity.
    """
    found = {}
    for key, names in columns.items():
        listed = [names] if isinstance(names, str) else list(names)
        units = {_UNITS[key].get(split_unit(name)[1].lower()) for name in listed}
        if len(units) == 1 and (unit := units.pop()) is not None:
            found[key] = unit
    return found
