"""The report's folder, and JSON."""

import dataclasses
import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from paramreduce_cli.artifacts.atomic import check_is_file, make_missing_error, replace_atomically
from paramreduce_cli.artifacts.folder_layout import SUMMARY
from paramreduce_cli.artifacts.hdf5 import Stamp, read_stamp
from paramreduce_cli.errors import ArtifactError
from paramreduce_cli.records import Report

_LISTING = ".exported.json"


def save_report(folder: Path, report: Report, stamp: Stamp) -> Stamp:
    """Write a report's files, its summary last, and remove what a former report left; return the stamp with the digest
    of what was written.
    """
    for name, content in report.files.items():
        with replace_atomically(folder / name) as path:
            path.write_bytes(content)
    _remove_former_files(folder, set(report.files))
    files = {name: hashlib.sha256(report.files[name]).hexdigest() for name in sorted(report.files)}
    summary = {**report.summary, "files": files}
    summary["provenance"] = vars(stamp)
    done = dataclasses.replace(stamp, digest=_digest_summary(summary))
    summary["provenance"] = vars(done)
    with replace_atomically(folder / Path(SUMMARY).name) as path:
        path.write_text(json.dumps(summary, indent=1, allow_nan=False) + "\n", encoding="utf-8")
    return done


def _digest_summary(summary: Mapping[str, Any]) -> str:
    """Return the digest of a summary without the digest in it."""
    content = {**summary, "provenance": {**summary["provenance"], "digest": ""}}
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


def _remove_former_files(folder: Path, files: set[str]) -> None:
    """Remove files of the former report that the new one does not write."""
    try:
        former = set(map(str, load_json(folder / Path(SUMMARY).name).get("files", ())))
    except (ArtifactError, AttributeError, TypeError):
        return
    for name in former - files:
        if not Path(name).is_absolute() and ".." not in Path(name).parts:
            (folder / name).unlink(missing_ok=True)


def save_files(folder: Path, files: Mapping[str, bytes]) -> None:
    """Write files of one kind to a folder, and remove those of the same kind that were there before.

    A hidden file lists the written files, so that no other file is removed later.
    """
    listing = folder / _LISTING
    try:
        former = set(load_json(listing)) if listing.exists() else set()
    except (ArtifactError, TypeError):
        former = set()
    for name, content in files.items():
        with replace_atomically(folder / name) as path:
            path.write_bytes(content)
    for name in former - set(files):
        if Path(str(name)).name == name:
            (folder / name).unlink(missing_ok=True)
    with replace_atomically(listing) as path:
        path.write_text(json.dumps(sorted(files)), encoding="utf-8")


def read_summary_stamp(path: Path) -> Stamp | None:
    """Return the stamp of a summary, or None if it has none.

    Raises:
        ArtifactError: The summary is missing, damaged, or no summary.
    """
    return _get_stamp(load_summary(path))


def _get_stamp(summary: Any) -> Stamp | None:
    """Return the stamp in a summary, or None."""
    try:
        return Stamp(**summary["provenance"])
    except (KeyError, TypeError):
        return None


def load_summary(path: Path) -> dict[str, Any]:
    """Read a summary, given its path or a results folder, and compare it with its digest.

    A summary without provenance, which somebody made by hand, has no digest.

    Raises:
        ArtifactError: The summary is missing, damaged, or no summary.
    """
    if path.is_dir():
        path /= SUMMARY
    summary = load_json(path)
    if not isinstance(summary, dict):
        raise ArtifactError(f"{path}: is not a summary.json.")
    if not _is_whole(summary):
        raise ArtifactError(
            f"{path}: is damaged or was changed: its digest does not fit.",
            rejected=str(path),
            command="report",
        )
    return summary


def list_newer_artifacts(results: Path) -> list[str]:
    """Return the artifacts of a results folder that have changed since its report was made.

    Raises:
        ArtifactError: The summary is missing or damaged, or an artifact is no HDF5 file.
    """
    stamp = read_summary_stamp(results / SUMMARY)
    found = []
    for name, digest in ({} if stamp is None else stamp.inputs).items():
        path = results / name
        own = read_stamp(path) if path.suffix == ".h5" and path.exists() else None
        if own is not None and own.digest != digest:
            found.append(name)
    return found


def _is_whole(summary: Mapping[str, Any]) -> bool:
    """Return whether the digest matches; without provenance, whether no entry holds a digest, as a provenance under a
    damaged key would.
    """
    if "provenance" not in summary:
        return not any(isinstance(entry, dict) and "digest" in entry for entry in summary.values())
    stamp = _get_stamp(summary)
    return stamp is not None and stamp.digest == _digest_summary(summary)


def verify_report(path: Path) -> None:
    """Compare a summary, and the files it lists, with their digests.

    Raises:
        ArtifactError: A file is missing, damaged or changed.
    """
    listed = load_summary(path).get("files")
    if not isinstance(listed, dict):
        raise ArtifactError(
            f"{path}: lists no files, so it is no report's summary.",
            rejected=str(path),
            command="run",
        )
    for name, digest in listed.items():
        check_is_file(path.parent / name)
        try:
            found = hashlib.sha256((path.parent / name).read_bytes()).hexdigest()
        except OSError as error:
            raise ArtifactError(
                f"{path.parent / name}: cannot be read: {error.strerror}.",
                rejected=str(path),
                command="run",
            ) from error
        if found != digest:
            raise ArtifactError(
                f"{path.parent / name}: is damaged or was changed.",
                rejected=str(path),
                command="run",
            )


def load_json(path: Path) -> Any:
    """Read a JSON file.

    Raises:
        ArtifactError: The file is missing or not JSON.
    """
    check_is_file(path)
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError as error:
        raise make_missing_error(path) from error
    except (OSError, ValueError, RecursionError) as error:
        raise ArtifactError(f"{path}: is not JSON: {error}.") from error
