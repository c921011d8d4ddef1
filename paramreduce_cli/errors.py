"""The errors a user can meet; each message is complete as it stands.

Every class carries the exit code its kind of failure has at the shell. Numerics know no config:
what of it stands in their way they name as a :class:`Concern`, and
:mod:`paramreduce_cli.config.concerns` says which key that is.
"""

from enum import Enum, auto

Key = tuple[str | int, ...]
"""Where something stands in a config: names of keys, and numbers of items in lists."""


class Concern(Enum):
    """What a numerical error is about, whatever it is called in a config."""

    ASSEMBLY = auto()
    """Where the closing of loops starts from."""
    HINGE_DIRECTION = auto()
    """Which way round a hinge of a loop closes."""
    CLOSURES = auto()
    """How the loops are closed."""
    INDEPENDENT = auto()
    """Which coordinates are independent."""
    RANK = auto()
    """From which size on singular values count as zero."""
    REACH = auto()
    """Where the loops cannot be closed any more, within the position limits."""
    FULL_RANGE = auto()
    """That every motion must come to its limits, which loops do not allow."""
    BOUNDS = auto()
    """Bounds on quantities that no position keeps."""
    BOUNDED_MOTION = auto()
    """Bounds on quantities that no motion keeps."""
    LOADS = auto()
    """Limits of torque and power that no motion keeps."""
    GRID = auto()
    """How many points a trajectory is optimised on."""
    SYMMETRIES = auto()
    """Images that complete a set of trajectories."""


class ParamreduceError(Exception):
    """Something the user can mend: cause and remedy in one message."""

    exit_code = 2


class ConfigError(ParamreduceError):
    """A configuration that cannot be used as it is written.

    Args:
        message: Of the key's value, if there is a key: ``is ...``, ``has ...`` or a sentence.
        key: Where it stands; the line is looked up from it.
    """

    def __init__(self, message: str, key: Key = ()) -> None:
        self.key = key
        super().__init__(message, key)

    def __str__(self) -> str:
        return keyed(self.key, self.args[0])


def keyed(key: Key, message: str) -> str:
    """A message about a key, which begins with it."""
    if not key:
        return message
    separator = " " if message.startswith(("is ", "has ")) else ": "
    return f"{'.'.join(map(str, key))}{separator}{message}"


class ArtifactError(ParamreduceError):
    """A file between stages that is missing, foreign, damaged or in use."""


class DataError(ParamreduceError):
    """Data brought by the user that does not fit the robot or is not usable."""


class ConcernError(ParamreduceError):
    """A calculation that something in the description or the settings does not allow.

    Args:
        message: The cause, and a remedy as far as it needs no key.
        concern: What stands in the way.
    """

    def __init__(self, message: str, concern: Concern) -> None:
        self.concern = concern
        super().__init__(message, concern)

    def __str__(self) -> str:
        return str(self.args[0])


class FormulationError(ParamreduceError):
    """A lean model does not compute what it should."""


class ParamreduceWarning(UserWarning):
    """A remark for the user that does not stop the work."""
