"""Which key of a config a numerical error is about, and what can be done there."""

from paramreduce_cli.errors import Concern, ConcernError, ConfigError, Key

_TREE: Key = ("description", "tree")
_POSITION_LIMITS: Key = ("trajectories", "position_limits")
_CONSTRAINTS: Key = ("trajectories", "constraints")

_KEYS: dict[Concern, tuple[Key, str]] = {
    Concern.ASSEMBLY: ((*_TREE, "guess"), ""),
    Concern.HINGE_DIRECTION: (
        (*_TREE, "guess"),
        "Give a guess in which they agree, or turn one of its frames by {rx: pi}.",
    ),
    Concern.CLOSURES: ((*_TREE, "closures"), ""),
    Concern.INDEPENDENT: ((*_TREE, "independent"), ""),
    Concern.RANK: (("model", "rank_tolerance"), "Raise or lower it."),
    Concern.REACH: (_POSITION_LIMITS, ""),
    Concern.FULL_RANGE: (
        _POSITION_LIMITS,
        "If trajectories.use_full_range is true every motion reaches the limits: narrow them, or set "
        "it to false.",
    ),
    Concern.BOUNDS: (_CONSTRAINTS, ""),
    Concern.BOUNDED_MOTION: (
        _CONSTRAINTS,
        "Loosen it, or set trajectories.use_full_range to false if it is true.",
    ),
    Concern.LOADS: (
        ("trajectories", "torque_limits"),
        "If trajectories.use_full_range is true every motion reaches the limits: set it to false.",
    ),
    Concern.GRID: (("trajectories", "points"), ""),
    Concern.SYMMETRIES: (("sampling", "symmetries"), ""),
}


def explained(error: ConcernError) -> ConfigError:
    """A numerical error as one about a key, with the remedy that the key offers."""
    key, remedy = _KEYS[error.concern]
    return ConfigError(str(error), key, remedy=remedy)
