"""A robot of a file, as the config's source section asks for it."""

import pkgutil
from pathlib import Path

from lxml import etree

from paramreduce_cli.config.schema import SourceSection
from paramreduce_cli.errors import ConfigError
from paramreduce_cli.importing.imported import ImportedRobot
from paramreduce_cli.importing.mjcf import read_mjcf
from paramreduce_cli.importing.simplified import SimplifiedRobot, simplified
from paramreduce_cli.importing.urdf import read_urdf


def imported(source: SourceSection) -> SimplifiedRobot:
    """Read a robot's file, and merge what does not move.

    Raises:
        ConfigError: The file cannot be read, or does not hold what is asked for.
    """
    return simplified(_read(source.file), source)


def described(name: str) -> Path | None:
    """The file of a robot that the package robot_descriptions knows by name, such as ur5_description.

    The package fetches it on first use. None where there is no such package or name.

    Raises:
        ConfigError: The package cannot bring it.
    """
    if not name.isidentifier() or Path(name).exists():
        return None
    for what in ("URDF_PATH", "MJCF_PATH"):
        try:
            return Path(pkgutil.resolve_name(f"robot_descriptions.{name}:{what}"))
        except (ImportError, AttributeError):
            continue
        except Exception as error:  # of git, of the net, of the disk: whatever fetching meets
            raise ConfigError(f"{name}: robot_descriptions cannot fetch it: {error}.") from error
    return None


def kind_of(path: Path) -> str:
    """``mjcf`` where a file's outermost element says so, else ``urdf``."""
    return "mjcf" if _outermost(path) == "mujoco" else "urdf"


def _read(path: Path) -> ImportedRobot:
    return read_mjcf(path) if kind_of(path) == "mjcf" else read_urdf(path)


def _outermost(path: Path) -> str | None:
    """Tag of a file's outermost element; None where there is none."""
    if not path.is_file():
        return None
    try:
        elements = etree.iterparse(str(path), ("start",), resolve_entities=False, no_network=True)
        _, element = next(iter(elements))
    except (etree.XMLSyntaxError, StopIteration, OSError):
        return None
    return str(element.tag)
