"""Configs and results in a folder, found without reading whole files."""

import contextlib
import re
import shlex
from collections.abc import Callable
from pathlib import Path

from paramreduce_cli.artifacts.folder_layout import SUMMARY
from paramreduce_cli.errors import ArtifactError

_READ = 100_000
"""Characters of a file in which a config must have begun."""
_UP = 4
"""Folders above in which configs are looked for."""
_CONFIGS, _RESULTS = Path("configs"), Path("results")


def list_configs(folder: Path) -> list[Path]:
    """Return the configs in a folder or in its ``configs``, relative to the folder; those with results first."""
    found = [*sorted(folder.glob("*.yaml")), *sorted((folder / _CONFIGS).glob("*.yaml"))]
    configs = [path.relative_to(folder) for path in found if is_config(path)]
    return sorted(
        configs, key=lambda path: not has_report(folder / get_results_path(folder / path))
    )


def find_project_above(folder: Path) -> Path | None:
    """Return the nearest parent folder that holds configs, as a path relative to the given folder; None if there is
    none.
    """
    for k in range(1, _UP + 1):
        above = Path("/".join([".."] * k))
        if (folder / above / _CONFIGS).is_dir() and list_configs(folder / above):
            return above
    return None


def is_config(path: Path) -> bool:
    """Return whether a file is a config: it names a robot, and has more keys."""
    if not _is(path, Path.is_file):  # a pipe would be waited for
        return False
    try:
        with path.open(encoding="utf-8", errors="replace") as file:
            text = file.read(_READ)
    except OSError:
        return False
    keys = re.findall(r"^(\w+):", text, re.MULTILINE)
    return "robot" in keys and len(keys) > 1


def get_results_path(config: Path) -> Path:
    """Return the results folder of a config, relative to the working folder."""
    text = config.read_text(encoding="utf-8", errors="replace")
    named = re.search(r"^robot:\s*[\"']?([\w.-]+)", text, re.MULTILINE)
    return _RESULTS / (named[1] if named else config.stem)


def has_report(results: Path) -> bool:
    """Return whether a results folder has a report, as far as the folder may be read."""
    return _is(results / SUMMARY, Path.is_file)


def _is(path: Path, kind: Callable[[Path], bool]) -> bool:
    try:
        return kind(path)
    except OSError:  # no access, or too long a name
        return False


def list_results(folder: Path) -> list[Path]:
    """Return the folders of finished runs: those in ``results`` of a folder, then those in the folder itself."""
    return [
        path
        for place in (folder / _RESULTS, folder)
        for path in sorted(place.glob("*"))
        if has_report(path)
    ]


def find_config(folder: Path) -> Path | None:
    """Return the config that a results folder was made with; None if there is no such config here.

    Artifacts hold the name of the config's file and of the robot.
    """
    from paramreduce_cli.artifacts.hdf5 import read_stamp

    names, robots = set(), set()
    for artifact in sorted(folder.glob("*.h5")):
        with contextlib.suppress(ArtifactError):
            stamp = read_stamp(artifact)
            if stamp is not None:
                names.add(stamp.config)
                robots.add(stamp.robot)
    configs = list_configs(Path())
    named = [path for path in configs if path.name in names]
    of_robot = [path for path in configs if get_results_path(path).name in robots]
    return next(iter(named or of_robot), None)


def guess_config(word: str) -> Path | None:
    """Return the config of a word that may be a robot's name, its results or a file in them, or None."""
    found = _CONFIGS / f"{_guess_robot(word)}.yaml"
    return found if _is(found, Path.is_file) else None


def guess_results(word: str) -> Path | None:
    """Return the results of a word that may be a robot's name, its config or a file in its results, or None."""
    found = _RESULTS / _guess_robot(word)
    made = _is(found, Path.is_dir) and found != _RESULTS and any(found.glob("*.h5"))
    return found if made else None


def _guess_robot(word: str) -> str:
    """Return the robot's name in a path of a config or of results."""
    parts = Path(word).parts
    if len(parts) > 1 and parts[0] == _RESULTS.name:
        return parts[1]
    return Path(word).name.removesuffix(".yaml").replace("..", "")


def list_results_below(folder: Path) -> list[str]:
    """List the results folders in a folder."""
    return [str(path.parents[1]) for path in sorted(folder.glob(f"*/{SUMMARY}"))]


def make_no_results_error(folder: Path, command: str) -> ArtifactError:
    """Return the error that a folder holds no results itself, with those below it.

    Args:
        folder: Folder that was named.
        command: Command that takes results.
    """
    below = list_results_below(folder)
    found = f"Did you mean `paramreduce {command} {shlex.quote(below[0])}`?" if below else ""
    return ArtifactError(
        f"{folder}: holds no results itself.",
        rejected=str(folder), command="" if below else "run", remedy=found,
    )  # fmt: skip
