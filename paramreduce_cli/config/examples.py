"""Example configs: from the repository of the package, or from the data of its distribution."""

import difflib
import importlib.metadata
import re
import shutil
from pathlib import Path

from paramreduce_cli.errors import ConfigError

_LOGS = (".csv", ".csv.gz", ".gz", ".h5", ".npz")
_LIKE = 0.5
"""How alike an unknown name must be to an example's."""
_INSTALLED = "share/paramreduce/configs/"


def list_examples() -> dict[str, Path]:
    """Return the files of all example robots by name."""
    beside = Path(__file__).parents[2] / "configs"
    if (beside.parent / "pyproject.toml").exists():
        files = list(beside.glob("*.yaml"))
    else:
        listed = importlib.metadata.distribution("paramreduce").files or ()
        found = [entry for entry in listed if _INSTALLED in entry.as_posix()]
        files = [Path(str(entry.locate())) for entry in found if entry.suffix == ".yaml"]
    return {path.stem: path for path in sorted(files)}


def make_exists_error(path: Path, config: Path | None = None) -> ConfigError:
    """Return the error that a command would overwrite a file, with a free path for the config.

    Args:
        path: File that would be overwritten.
        config: Config that comes with this file, and would have to be in another folder; None if it is the file.
    """
    numbers = range(2, 1000)
    if config is None:
        free = (path.with_stem(f"{path.stem}_{k}") for k in numbers)
    else:
        free = (config.parent / f"{config.stem}_{k}" / config.name for k in numbers)
    there = next((other for other in free if not other.exists()), path)
    return ConfigError(
        f"{path}: exists already; choose another place with --output.",
        rejected=str(path), options=("--output", str(there)),
    )  # fmt: skip


def copy_example(name: str, path: Path) -> tuple[list[Path], list[str]]:
    """Copy an example config and the files that it refers to.

    Args:
        name: Name of the robot.
        path: Destination of the config.

    Returns:
        Copied files, the config first; and names of files that it refers to but that are not part of the package.

    Raises:
        ConfigError: There is no such robot, a file with other contents exists already, or a file cannot be written.
    """
    known = list_examples()
    if name not in known:
        near = difflib.get_close_matches(name, known, n=1, cutoff=_LIKE)
        raise ConfigError(
            f"--example {name}: there is {', '.join(known)}.", rejected=name, choices=near
        )
    source = known[name]
    named = re.findall(r"[\w./-]+/[\w.-]+\.\w+", source.read_text(encoding="utf-8"))
    beside = [entry for entry in dict.fromkeys(named) if (source.parent / entry).is_file()]
    inside = [entry for entry in beside if ".." not in Path(entry).parts]
    pairs = [(source, path), *((source.parent / e, path.parent / e) for e in inside)]
    existing = [new for old, new in pairs if new.exists() and new.read_bytes() != old.read_bytes()]
    if existing:
        raise make_exists_error(existing[0], None if existing[0] == path else path)
    try:
        for original, target in pairs:
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(original, target)
    except OSError as error:
        raise ConfigError(f"{path}: cannot be written: {error.strerror}.") from error
    absent = [
        entry for entry in dict.fromkeys(named) if entry.endswith(_LOGS) and entry not in inside
    ]
    return [target for _, target in pairs], absent
