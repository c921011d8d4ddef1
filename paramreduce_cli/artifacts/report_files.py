"""The report's folder, and JSON."""

import dataclasses
import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from paramreduce_cli.artifacts.atomic import atomically
from paramreduce_cli.artifacts.hdf5 import Stamp
from paramreduce_cli.errors import ArtifactError
from paramreduce_cli.records import Report

_LISTING = ".exported.json"
SUMMARY = "report/summary.json"


def save_report(folder: Path, report: Report, stamp: Stamp) -> Stamp:
    """Write a report's files, its summary last, and remove what a former report left."""
    digest = hashlib.sha256()
    for name, content in report.files.items():
        digest.update(name.encode() + content)
        with atomically(folder / name) as path:
            path.write_bytes(content)
    done = dataclasses.replace(stamp, digest=digest.hexdigest())
    _remove_what_a_former_report_left(folder, set(report.files))
    summary = {**report.summary, "files": sorted(report.files), "provenance": done.__dict__}
    with atomically(folder / Path(SUMMARY).name) as path:
        path.write_text(json.dumps(summary, indent=1, allow_nan=False) + "\n", encoding="utf-8")
    return done


def _remove_what_a_former_report_left(folder: Path, files: set[str]) -> None:
    try:
        former = load_json(folder / Path(SUMMARY).name).get("files", [])
    except (ArtifactError, AttributeError):
        return
    for name in set(former) - files:
        if not Path(name).is_absolute() and ".." not in Path(name).parts:
            (folder / name).unlink(missing_ok=True)


def save_files(folder: Path, files: Mapping[str, bytes]) -> None:
    """Write files of one kind to a folder, and remove those of the same kind that were there before.

    What was written is listed in a hidden file, so that nothing else is touched.
    """
    listing = folder / _LISTING
    try:
        former = set(load_json(listing)) if listing.exists() else set()
    except (ArtifactError, TypeError):
        former = set()
    for name, content in files.items():
        with atomically(folder / name) as path:
            path.write_bytes(content)
    for name in former - set(files):
        if Path(str(name)).name == name:
            (folder / name).unlink(missing_ok=True)
    with atomically(listing) as path:
        path.write_text(json.dumps(sorted(files)), encoding="utf-8")


def summary_stamp(path: Path) -> Stamp | None:
    """Provenance of a summary; one that no stage made where files of the report are missing."""
    summary = load_json(path)
    try:
        if not all((path.parent / name).exists() for name in summary.get("files", ())):
            return dataclasses.replace(Stamp(**summary["provenance"]), digest="", stage="")
        return Stamp(**summary["provenance"])
    except (KeyError, TypeError):
        return None


def load_json(path: Path) -> Any:
    """Read a JSON file.

    Raises:
        ArtifactError: It is missing or not JSON.
    """
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError as error:
        raise ArtifactError(f"{path}: there is no such file.") from error
    except (OSError, ValueError) as error:
        raise ArtifactError(f"{path}: is not JSON: {error}.") from error
