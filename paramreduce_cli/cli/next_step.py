"""What to do next in a folder, for who calls paramreduce without a command."""

import re
import shlex
from pathlib import Path

from paramreduce_cli.artifacts.places import SUMMARY
from paramreduce_cli.errors import ArtifactError
from paramreduce_cli.texts import share

_READ = 100_000
"""Characters of a file in which a config must have begun."""
_MOST = 8
"""Robots that are listed."""


def next_steps(folder: Path) -> list[str]:
    """Lines that say what there is and what to type.

    Args:
        folder: Where the user is.
    """
    configs = [path for path in _candidates(folder) if _is_config(path)]
    if not configs:
        return [
            "There is no robot here yet. Begin with one of these:",
            "  paramreduce init my_robot.urdf        a robot from its URDF or MJCF",
            "  paramreduce init --dh my_arm          an arm in Denavit-Hartenberg parameters, to be filled in",
            "  paramreduce init --example puma560    one that works",
            "",
            "paramreduce --help lists all commands.",
        ]
    configs.sort(key=lambda path: not (folder / _results(path) / SUMMARY).exists())
    lines = [line for path in configs[:_MOST] for line in _robot(folder, path)]
    if len(configs) > _MOST:
        lines.append(f"and {len(configs) - _MOST} more")
    return [*lines, "", "paramreduce --help lists all commands."]


def _candidates(folder: Path) -> list[Path]:
    found = [*sorted(folder.glob("*.yaml")), *sorted((folder / "configs").glob("*.yaml"))]
    return [path.relative_to(folder) if folder != Path() else path for path in found]


def _is_config(path: Path) -> bool:
    try:
        with path.open(encoding="utf-8", errors="replace") as file:
            return re.search(r"^robot:", file.read(_READ), re.MULTILINE) is not None
    except OSError:
        return False


def _results(path: Path) -> Path:
    """Where the results of a config go."""
    text = path.read_text(encoding="utf-8", errors="replace")
    named = re.search(r"^robot:\s*[\"']?([\w.-]+)", text, re.MULTILINE)
    return Path("results") / (named[1] if named else path.stem)


def _robot(folder: Path, path: Path) -> list[str]:
    """What was made of a robot, and the next command."""
    results, shown = _results(path), shlex.quote(str(path))
    made = sorted(file.name for file in (folder / results).glob("*.h5"))
    if not (folder / results / SUMMARY).exists():
        state = f"begun ({', '.join(made)}); go on" if made else "not run yet"
        return [f"{path}: {state}: paramreduce run {shown}"]
    from paramreduce_cli.artifacts.report_files import load_summary  # it loads HDF5

    try:
        selected = load_summary(folder / results)["selected"]
        error = share(selected["torque_error"]["estimation"])
    except (ArtifactError, KeyError, TypeError) as problem:
        return [f"{path}: its report cannot be read ({problem}): paramreduce run {shown}"]
    return [
        f"{path}: {selected['heuristic']} with {selected['n']} parameters, torque error {error}",
        f"  paramreduce open {shlex.quote(str(results))}    its report",
        f"  paramreduce export {shown}    its code",
        f"  paramreduce run {shown}    again, if the config has changed",
    ]
