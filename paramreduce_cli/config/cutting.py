"""Lists that a config gives for all coordinates of loops, cut to the independent ones."""

import warnings
from typing import Any

from pydantic import BaseModel

from paramreduce_cli.config.schema import Config
from paramreduce_cli.errors import ParamreduceWarning

_PER_JOINT = {
    (): ("nominal_torque",),
    ("trajectories",): (
        "position_limits", "velocity_limits", "acceleration_limits", "torque_limits",
        "power_limits", "torque_noise", "start_pose",
    ),
    ("sampling",): ("nominal_acceleration",),
}  # fmt: skip
"""Keys that take a value for each independent coordinate, by their sections."""


def cut_to_independent(config: Config) -> Config:
    """Take the entries of the independent coordinates where a list has one for every coordinate of the loops."""
    bodies = config.description.bodies
    if not bodies.closed:
        return config
    names = bodies.generalised_names()
    places = [names.index(name) for name in bodies.independent_names() if name in names]
    cut: list[str] = []

    def without_others(section: BaseModel, path: tuple[str, ...]) -> dict[str, Any]:
        found = {}
        for key in _PER_JOINT[path]:
            values = getattr(section, key)
            if isinstance(values, list) and len(values) == len(names) != len(places):
                found[key] = [values[k] for k in places]
                cut.append(".".join((*path, key)))
        return found

    update: dict[str, Any] = without_others(config, ())
    for path in (path for path in _PER_JOINT if path):
        section = getattr(config, path[0])
        if own := without_others(section, path):
            update[path[0]] = section.model_copy(update=own)
    if cut:
        warnings.warn(
            f"{', '.join(cut)}: given for all {len(names)} coordinates; those of the independent ones are "
            f"taken: {', '.join(names[k] for k in places)}",
            ParamreduceWarning,
            stacklevel=2,
        )
    return config.model_copy(update=update) if update else config
