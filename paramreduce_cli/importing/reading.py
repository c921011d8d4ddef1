"""A robot of a file, as the config's source section asks for it."""

from paramreduce_cli.config.schema import SourceSection
from paramreduce_cli.importing.simplified import SimplifiedRobot, simplified
from paramreduce_cli.importing.urdf import read_urdf


def imported(source: SourceSection) -> SimplifiedRobot:
    """Read a robot's file, and merge what does not move.

    Raises:
        ConfigError: The file cannot be read, or does not hold what is asked for.
    """
    return simplified(read_urdf(source.file), source)
