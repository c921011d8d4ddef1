"""The errors a user can meet; each message is complete as it stands.

Every class carries the exit code its kind of failure has at the shell.
"""


class ParamreduceError(Exception):
    """Something the user can mend: cause and remedy in one message."""

    exit_code = 2


class ConfigError(ParamreduceError):
    """A configuration that cannot be used as it is written."""


class ArtifactError(ParamreduceError):
    """A file between stages that is missing, foreign, damaged or in use."""


class DataError(ParamreduceError):
    """Data brought by the user that does not fit the robot or is not usable."""


class RankError(ParamreduceError):
    """Columns that had to be independent are not."""


class ParamreduceWarning(UserWarning):
    """A remark for the user that does not stop the work."""


class FormulationError(ParamreduceError):
    """A lean model does not compute what it should."""
