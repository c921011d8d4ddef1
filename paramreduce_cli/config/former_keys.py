"""Keys that configs had before, and what stands in their place."""

from typing import Any

from paramreduce_cli.errors import Key

_LEAVE_OUT = "is no longer a key; leave it out"

FORMER_KEYS: dict[Key, str] = {
    ("model", "seed"): _LEAVE_OUT,
    ("reduction", "backward_elimination"): _LEAVE_OUT,
    ("reduction", "swap"): _LEAVE_OUT,
    ("sampling", "simulation", "seed"): _LEAVE_OUT,
    ("sampling", "log", "held_out_files"): "is called held_out: give that the list of files",
    ("sampling", "log", "torque_signs"): (
        "is part of signs: write signs: {motion: [...], torque: [...]}, where signs that hold for both stand in both"
    ),
    ("validation", "condition_factor"): _LEAVE_OUT,
    ("validation", "error_factor"): _LEAVE_OUT,
    ("report", "tracking", "control_period"): _LEAVE_OUT,
    ("report", "tracking", "paths"): _LEAVE_OUT,
    ("report", "tracking", "seed"): _LEAVE_OUT,
    ("terms", "seed"): _LEAVE_OUT,
}
"""Messages by key."""

_BETWEEN = "a drive acts along coordinates. Write a spring or damper between two bodies under forces, with type: line, bodies and at"
KEYS_ELSEWHERE: dict[tuple[Any, Any], str] = {
    ("drives", "bodies"): _BETWEEN,
    ("drives", "at"): _BETWEEN,
    ("drives", "type"): _BETWEEN,
}
"""Advice for keys that belong elsewhere, by the first and the last step of the path."""
