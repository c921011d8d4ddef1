"""Keys of the config that numerical errors are about, with remedies."""

from paramreduce_cli.errors import Cause, ConfigError, Key, NumericalError

_TREE: Key = ("description", "tree")
_POSITION_LIMITS: Key = ("trajectories", "position_limits")
_CONSTRAINTS: Key = ("trajectories", "constraints")

_KEYS: dict[Cause, tuple[Key, str]] = {
    Cause.ASSEMBLY: ((*_TREE, "guess"), ""),
    Cause.HINGE_DIRECTION: (
        (*_TREE, "guess"),
        "Give a guess in which they agree, or turn one of its frames by {rx: pi}.",
    ),
    Cause.CLOSURES: ((*_TREE, "closures"), ""),
    Cause.INDEPENDENT: ((*_TREE, "independent"), ""),
    Cause.RANK: (("model", "rank_tolerance"), "Raise or lower it."),
    Cause.REACH: (_POSITION_LIMITS, ""),
    Cause.FULL_RANGE: (
        _POSITION_LIMITS,
        "If trajectories.use_full_range is true every motion reaches the limits: narrow them, or set "
        "it to false.",
    ),
    Cause.STATIC: (("forces",), ""),
    Cause.BOUNDS: (_CONSTRAINTS, ""),
    Cause.BOUNDED_MOTION: (
        _CONSTRAINTS,
        "Loosen it, or set trajectories.use_full_range to false if it is true.",
    ),
    Cause.LOADS: (
        ("trajectories", "torque_limits"),
        "If trajectories.use_full_range is true every motion reaches the limits: set it to false.",
    ),
    Cause.GRID: (("trajectories", "points"), ""),
    Cause.SYMMETRIES: (("sampling", "symmetries"), ""),
}


def locate_error(error: NumericalError) -> ConfigError:
    """Return a numerical error as an error of a config key, with the remedy that the key offers."""
    key, remedy = _KEYS[error.cause]
    return ConfigError(str(error), key, remedy=remedy)
