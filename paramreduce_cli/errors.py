"""Errors that a user can meet; each message is complete in itself.

Every class carries the exit code its kind of failure has at the shell. Numerics know no config:
what of it stands in their way they name as a :class:`Cause`, and
:mod:`paramreduce_cli.config.error_keys` says which key that is.
"""

from collections.abc import Sequence
from enum import Enum, auto
from typing import Any

Key = tuple[str | int, ...]
"""Path of a value in a config: names of keys, and positions in lists."""


class Cause(Enum):
    """A part of the robot's description or of the settings that a calculation fails on, whatever its key is called."""

    ASSEMBLY = auto()
    """Guess of the coordinates from which loops are closed."""
    HINGE_DIRECTION = auto()
    """Direction in which a hinge of a loop closes."""
    CLOSURES = auto()
    """Closures of the loops."""
    INDEPENDENT = auto()
    """Choice of independent coordinates."""
    RANK = auto()
    """Size below which singular values count as zero."""
    REACH = auto()
    """Position limits within which the loops cannot be closed everywhere."""
    FULL_RANGE = auto()
    """Demand that every motion reaches its limits, which loops do not allow."""
    STATIC = auto()
    """Springs whose preload is to balance all other forces."""
    BOUNDS = auto()
    """Bounds on quantities that no position keeps."""
    BOUNDED_MOTION = auto()
    """Bounds on quantities that no motion keeps."""
    LOADS = auto()
    """Limits of torque and power that no motion keeps."""
    GRID = auto()
    """Number of points on which a trajectory is optimised."""
    SYMMETRIES = auto()
    """Symmetries that complete a set of trajectories."""


class ParamreduceError(Exception):
    """An error that the user can fix.

    Args:
        message: Sentence on what is wrong and what would be right, without the remedy.
        rejected: Word of the command line that is wrong, as the user typed it: a path, an option's value, a setting.
        choices: Words that would be right in its place; a choice with a number, such as ``swap:4``, is the default.
        command: Stage, or ``run``, that fixes the error when called with the config of the command line.
        remedy: Sentence on what to do, for commands other than ``command``.
        options: Option and value that the command line lacks, or has wrong.
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
            arguments: Config and options of the command line, which the command takes.
        """
        parts = [str(self.args[0]), self.remedy]
        if self.command:
            parts.append(f"Run `paramreduce {self.command} {arguments}`.")
        return " ".join(part for part in parts if part)

    def __str__(self) -> str:
        return self.describe()


class ConfigError(ParamreduceError):
    """A config that cannot be used as it is written.

    Args:
        message: Sentence, or the rest of a sentence about the value of the key: ``is ...``, ``has ...``.
        key: Path of the wrong value in the config; the line is looked up from this path.
        in_file: Whether a line of a file is wrong, instead of a word of the command line.
        fields: Fields of :class:`ParamreduceError`.
    """

    def __init__(
        self, message: str, key: Key = (), *, in_file: bool = False, **fields: Any
    ) -> None:
        super().__init__(message, **fields)
        self.key, self.in_file = key, in_file
        self.place = ""
        """File and line, or setting, in which the key stands, once that is known."""

    def describe(self, arguments: str = "CONFIG") -> str:
        """Return the message with its place, its key and its remedy."""
        text = prepend_key(self.key, super().describe(arguments))
        return f"{self.place}: {text}" if self.place else text


def prepend_key(key: Key, message: str) -> str:
    """Return a message with the key in front, as ``a.b.0: message``, or ``a.b is ...`` if the message starts with "is"
    or "has"; without a key the message alone.
    """
    if not key:
        return message
    separator = " " if message.startswith(("is ", "has ")) else ": "
    return f"{'.'.join(map(str, key))}{separator}{message}"


class MissingConfigError(ConfigError):
    """A command line without a config where a config is needed."""


class ArtifactError(ParamreduceError):
    """An artifact that is missing, damaged, in use, or of another robot or program."""


class DataError(ParamreduceError):
    """An error in user-supplied data that do not fit the robot or cannot be used."""


class NumericalError(ParamreduceError):
    """A calculation that the robot's description or the settings make impossible.

    Args:
        message: Sentence on what failed, with a remedy if the remedy needs no key.
        cause: Kind of failure, by which remedies are suggested.
    """

    def __init__(self, message: str, cause: Cause) -> None:
        super().__init__(message)
        self.cause = cause
        self.args = (message, cause)


class FormulationError(ParamreduceError):
    """A lean model that computes wrong values."""


class ParamreduceWarning(UserWarning):
    """A sentence on something that is off, which does not stop the work."""
