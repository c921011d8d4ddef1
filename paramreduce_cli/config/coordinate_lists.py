"""Lists that a config gives for all coordinates of loops, cut to the independent ones."""

import warnings
from typing import Any

from paramreduce_cli.config.schema import Config
from paramreduce_cli.errors import ParamreduceWarning

_TORQUE, _POSITION = "N m (N for a prismatic joint)", "rad (m for a prismatic joint)"
PER_JOINT: dict[tuple[str, ...], str] = {
    ("nominal_torque",): _TORQUE,
    ("trajectories", "position_limits"): _POSITION,
    ("trajectories", "velocity_limits"): "rad/s (m/s for a prismatic joint)",
    ("trajectories", "acceleration_limits"): "rad/s^2 (m/s^2 for a prismatic joint)",
    ("trajectories", "torque_limits"): _TORQUE,
    ("trajectories", "power_limits"): "W",
    ("trajectories", "torque_noise"): _TORQUE,
    ("trajectories", "start_pose"): _POSITION,
    ("sampling", "nominal_acceleration"): "rad/s^2 (m/s^2 for a prismatic joint)",
}
"""Units of the keys that take a value for each independent coordinate."""


def read_per_joint(config: Config, key: tuple[str, ...]) -> Any:
    """Return the value of a key of :data:`PER_JOINT`."""
    value: Any = config
    for part in key:
        value = getattr(value, part)
    return value


def cut_to_independent(config: Config) -> Config:
    """Return the config with lists for the independent coordinates only, where a list had one entry for every
    coordinate of the loops.
    """
    bodies = config.description.bodies
    if not bodies.closed:
        return config
    names = bodies.list_coordinates()
    indices = [names.index(name) for name in bodies.list_independent_coordinates() if name in names]
    cut: list[str] = []
    for key in PER_JOINT:
        values = read_per_joint(config, key)
        if not isinstance(values, list) or len(values) != len(names) or len(values) == len(indices):
            continue
        cut.append(".".join(key))
        own: Any = [values[k] for k in indices]
        for depth in range(len(key) - 1, 0, -1):
            own = read_per_joint(config, key[:depth]).model_copy(update={key[depth]: own})
        config = config.model_copy(update={key[0]: own})
    if cut:
        warnings.warn(
            f"{', '.join(cut)}: given for all {len(names)} coordinates; those of the independent ones are "
            f"taken: {', '.join(names[k] for k in indices)}",
            ParamreduceWarning,
            stacklevel=2,
        )
    return config
