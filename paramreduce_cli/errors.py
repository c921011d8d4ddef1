"""The errors a user can meet; each message is complete as it stands.

Every class carries the exit code its kind of failure has at the shell. Numerics know no config:
what of it stands in their way they name as a :class:`Cause`, and
:mod:`paramreduce_cli.config.error_keys` says which key that is.
"""

from collections.abc import Sequence
from enum import Enum, auto
from typing import Any

Key = tuple[str | int, ...]
"""Where something stands in a config: names of keys, and numbers of items in lists."""


class Cause(Enum):
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
    """Something the user can mend.

    Args:
        message: What is wrong and what would be right, complete as it stands but for the remedy.
        rejected: Word of the call that is wrong, as it was given: a path, an option's value, a setting.
        choices: Words that would be right in its place; the default first where it is written out.
        command: Stage, or ``run``, that mends it with the config of the call.
        remedy: Sentence on what to do, with the command where that is another one.
        options: Option and value that the call lacks, or has wrong.
    """

    exit_code = 2

    def __init__(
        self,
        message: str,
        *,
        rejected: str = "",
        choices: Sequence[str] = (),
        command: str = "",
        remedy: str = "",
        options: tuple[str, ...] = (),
    ) -> None:
        super().__init__(message)
        self.rejected, self.choices = rejected, tuple(choices)
        self.command, self.remedy, self.options = command, remedy, options

    def describe(self, arguments: str = "CONFIG") -> str:
        """Return the message with its remedy.

        Args:
            arguments: Config and options of the call, which the command takes.
        """
        parts = [str(self.args[0]), self.remedy]
        if self.command:
            parts.append(f"Run `paramreduce {self.command} {arguments}`.")
        return " ".join(part for part in parts if part)

    def __str__(self) -> str:
        return self.describe()


class ConfigError(ParamreduceError):
    """A configuration that cannot be used as it is written.

    Args:
        message: Of the key's value, if there is a key: ``is ...``, ``has ...`` or a sentence.
        key: Where it stands; the line is looked up from it.
        in_file: Whether a line of a file is wrong, not the call.
        fields: As for :class:`ParamreduceError`.
    """

    def __init__(
        self, message: str, key: Key = (), *, in_file: bool = False, **fields: Any
    ) -> None:
        super().__init__(message, **fields)
        self.key, self.in_file = key, in_file
        self.place = ""
        """File and line, or setting, in which the key stands, once that is known."""

    def describe(self, arguments: str = "CONFIG") -> str:
        """Return place, key, message and remedy."""
        text = keyed(self.key, super().describe(arguments))
        return f"{self.place}: {text}" if self.place else text


def keyed(key: Key, message: str) -> str:
    """A message about a key, which begins with it."""
    if not key:
        return message
    separator = " " if message.startswith(("is ", "has ")) else ": "
    return f"{'.'.join(map(str, key))}{separator}{message}"


class MissingConfigError(ConfigError):
    """A call that names no config where one is needed."""


class ArtifactError(ParamreduceError):
    """A file between stages that is missing, foreign, damaged or in use."""


class DataError(ParamreduceError):
    """Data brought by the user that does not fit the robot or is not usable."""


class NumericalError(ParamreduceError):
    """A calculation that something in the description or the settings does not allow.

    Args:
        message: The cause, and a remedy as far as it needs no key.
        concern: What stands in the way.
    """

    def __init__(self, message: str, cause: Cause) -> None:
        super().__init__(message)
        self.cause = cause
        self.args = (message, cause)


class FormulationError(ParamreduceError):
    """A lean model does not compute what it should."""


class ParamreduceWarning(UserWarning):
    """A sentence on something that is off, which does not stop the work."""
