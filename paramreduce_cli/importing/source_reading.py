"""Reading of a robot's file as the config's source section asks."""

import pkgutil
from pathlib import Path

from lxml import etree

from paramreduce_cli.config.schema import SourceSection
from paramreduce_cli.errors import ConfigError
from paramreduce_cli.importing.formats import formats
from paramreduce_cli.importing.simplification import SimplifiedRobot, simplify_robot


def read_robot(source: SourceSection) -> SimplifiedRobot:
    """Read a robot's file, and merge what does not move.

    Raises:
        ConfigError: The file cannot be read, or does not hold what is asked for.
    """
    return simplify_robot(formats[detect_format(source.file)]().read(source.file), source)


def find_described_robot(name: str) -> Path | None:
    """Return the file of a robot that the package robot_descriptions knows by name, such as ur5_description, or None.

    The package fetches the file on first use. The result is None if there is no such package or name.

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


def detect_format(path: Path) -> str:
    """Return the name of the format whose outermost element a file has; ``urdf``, which refuses other files, if no
    format fits.
    """
    tag = _read_root_tag(path)
    return next((name for name, found in formats.items() if found().tag == tag), "urdf")


def _read_root_tag(path: Path) -> str | None:
    """Return the tag of a file's outermost element, or None if there is none."""
    if not path.is_file():
        return None
    try:
        elements = etree.iterparse(str(path), ("start",), resolve_entities=False, no_network=True)
        _, element = next(iter(elements))
    except (etree.XMLSyntaxError, StopIteration, OSError):
        return None
    return str(element.tag)
