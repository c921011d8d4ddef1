"""A results folder: which record is in which file, and which files are up to date."""

from __future__ import annotations

import contextlib
import dataclasses
import hashlib
import json
import os
from collections.abc import Callable, Iterator, MutableMapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import filelock

from paramreduce_cli.artifacts import layouts
from paramreduce_cli.artifacts.atomic import atomically
from paramreduce_cli.artifacts.hdf5 import (
    SCHEMA,
    Reader,
    Stamp,
    Writer,
    read_stamp,
    reading,
    write,
)
from paramreduce_cli.artifacts.sample_files import load_samples, save_samples
from paramreduce_cli.errors import ArtifactError
from paramreduce_cli.records import (
    Model,
    Reduction,
    Report,
    Samples,
    Trajectories,
    Trajectory,
    Validation,
)


@dataclass(frozen=True)
class Layout:
    """How one kind of record is kept in HDF5."""

    file: str
    save: Callable[[Writer, Any], None]
    load: Callable[[Reader], Any]


LAYOUTS: dict[type, Layout] = {
    Model: Layout("model.h5", layouts.save_model, layouts.load_model),
    Trajectories: Layout("trajectories.h5", layouts.save_trajectories, layouts.load_trajectories),
    Samples: Layout("samples.h5", save_samples, load_samples),
    Reduction: Layout("reduction.h5", layouts.save_reduction, layouts.load_reduction),
    Validation: Layout("validation.h5", layouts.save_validation, layouts.load_validation),
}
SUMMARY = "report/summary.json"


def file_of(record: type) -> str:
    """Path of a record's file below the results folder."""
    return SUMMARY if record is Report else LAYOUTS[record].file


class Store:
    """The artifacts of one robot in one folder.

    Args:
        folder: The results folder.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def path(self, record: type) -> Path:
        """Where a record is kept."""
        return self.folder / file_of(record)

    def stamp(self, record: type) -> Stamp | None:
        """Provenance of a record's file, None if it is not there or not readable."""
        path = self.path(record)
        if not path.exists():
            return None
        try:
            return _summary_stamp(path) if record is Report else read_stamp(path)
        except ArtifactError:
            return None

    def refuse_to_replace(self, record: type, robot: str) -> None:
        """Keep what is not this robot's from being overwritten.

        A damaged artifact may be replaced; a file of another robot, or one that paramreduce did
        not make, may not.

        Raises:
            ArtifactError: The record's file is such a file.
        """
        path = self.path(record)
        if not path.exists():
            return
        stamp = self.stamp(record)
        if stamp is not None and stamp.robot != robot:
            raise ArtifactError(
                f"{path}: belongs to the robot {stamp.robot} and would be overwritten by {robot}. "
                "Choose another folder with --results."
            )
        if stamp is None and is_foreign(path):
            raise ArtifactError(
                f"{path}: was not made by paramreduce and would be overwritten. Move it away, or "
                "choose another folder with --results."
            )

    def load(self, record: type, robot: str | None, maker: str) -> tuple[Any, Stamp | None]:
        """Read a record.

        Args:
            record: Its type.
            robot: Name of the robot it must belong to; None to accept any file of the right
                layout, also one that a user brings.
            maker: Command that makes it, for messages.

        Raises:
            ArtifactError: It is missing, damaged, of another robot or of an older schema.
        """
        return load_file(self.path(record), record, robot, maker)

    def save(self, record: Any, stamp: Stamp) -> Stamp:
        """Write a record to its file, whole or not at all."""
        if isinstance(record, Report):
            return _save_report(self.folder / "report", record, stamp)
        layout = LAYOUTS[type(record)]
        return write(self.folder / layout.file, stamp, lambda w: layout.save(w, record))

    def touch(self, record: type) -> None:
        """Make a file look new, so that Make agrees that it is current."""
        os.utime(self.path(record))

    @contextlib.contextmanager
    def locked(self) -> Iterator[None]:
        """Keep other runs out of the folder.

        Raises:
            ArtifactError: Another run is in it.
        """
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            lock = filelock.FileLock(self.folder / ".lock", timeout=0)
            lock.acquire()
        except filelock.Timeout as error:
            raise ArtifactError(
                f"{self.folder}: another run is using this folder. Wait for it, or choose another "
                "with --results."
            ) from error
        except OSError as error:
            raise ArtifactError(f"{self.folder}: cannot be used: {error}.") from error
        try:
            yield
        finally:
            lock.release()


def load_file(path: Path, record: type, robot: str | None, maker: str) -> tuple[Any, Stamp | None]:
    """Read a record from any file; see :meth:`Store.load`."""
    hint = f"Make it with `paramreduce {maker}`." if maker else ""
    with reading(path, hint) as reader:
        stamp = read_stamp(path)
        if stamp is not None:
            check_schema(path, stamp)
        if stamp is None and robot is not None:
            raise ArtifactError(f"{path}: was not made by paramreduce. {hint}".rstrip())
        if stamp is not None and robot is not None and stamp.robot != robot:
            raise ArtifactError(
                f"{path}: belongs to the robot {stamp.robot}, not to {robot}. Choose another folder "
                "with --results."
            )
        return LAYOUTS[record].load(reader), stamp


def check_schema(path: Path, stamp: Stamp) -> None:
    """Refuse a file of another layout.

    Raises:
        ArtifactError: It is of an older or newer schema.
    """
    if stamp.schema != SCHEMA:
        age = "an older" if stamp.schema < SCHEMA else "a newer"
        raise ArtifactError(
            f"{path}: was written in {age} layout (schema {stamp.schema}, this version reads "
            f"{SCHEMA}). Rebuild it with `paramreduce run`."
        )


class Parts(MutableMapping[str, Trajectory]):
    """Finished trajectories of an artifact that is not whole yet, a file each.

    Parts carry the digest of what they were made from; parts made from anything else are
    ignored and overwritten.

    Args:
        folder: Where they are kept.
        stamp: Provenance of the artifact they will be part of.
    """

    def __init__(self, folder: Path, stamp: Stamp) -> None:
        self._folder = folder
        self._stamp = stamp

    def _path(self, key: str) -> Path:
        return self._folder / f"{key}.h5"

    def __getitem__(self, key: str) -> Trajectory:
        path = self._path(key)
        if not path.exists():
            raise KeyError(key)
        try:
            stamp = read_stamp(path)
            if stamp is None or _origin(stamp) != _origin(self._stamp):
                raise KeyError(key)
            with reading(path) as reader:
                return layouts.load_trajectory_set(reader, "part")[0]
        except ArtifactError as error:
            raise KeyError(key) from error

    def __setitem__(self, key: str, value: Trajectory) -> None:
        write(
            self._path(key),
            self._stamp,
            lambda w: layouts.save_trajectory_set(w, "part", (value,)),
        )

    def __delitem__(self, key: str) -> None:
        self._path(key).unlink()

    def __iter__(self) -> Iterator[str]:
        return iter(sorted(path.stem for path in self._folder.glob("*.h5")))

    def __len__(self) -> int:
        return sum(1 for _ in self)

    def clear(self) -> None:
        """Remove all parts and their folder."""
        for key in list(self):
            del self[key]
        with contextlib.suppress(OSError):
            self._folder.rmdir()


def _origin(stamp: Stamp) -> tuple[Any, ...]:
    return (stamp.schema, stamp.robot, stamp.versions, stamp.sections, stamp.inputs)


def file_digest(path: Path) -> str:
    """SHA-256 of a file's bytes.

    Raises:
        ArtifactError: It cannot be read.
    """
    try:
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except FileNotFoundError as error:
        raise ArtifactError(f"{path}: there is no such file.") from error
    except OSError as error:
        raise ArtifactError(f"{path}: cannot be read: {error.strerror}.") from error


def _save_report(folder: Path, report: Report, stamp: Stamp) -> Stamp:
    digest = hashlib.sha256()
    for name, content in report.files.items():
        digest.update(name.encode() + content)
        with atomically(folder / name) as path:
            path.write_bytes(content)
    done = dataclasses.replace(stamp, digest=digest.hexdigest())
    _remove_what_a_former_report_left(folder, set(report.files))
    summary = {**report.summary, "files": sorted(report.files), "provenance": done.__dict__}
    with atomically(folder / Path(SUMMARY).name) as path:
        path.write_text(json.dumps(summary, indent=1) + "\n", encoding="utf-8")
    return done


def _remove_what_a_former_report_left(folder: Path, files: set[str]) -> None:
    try:
        former = load_json(folder / Path(SUMMARY).name).get("files", [])
    except (ArtifactError, AttributeError):
        return
    for name in set(former) - files:
        if not Path(name).is_absolute() and ".." not in Path(name).parts:
            (folder / name).unlink(missing_ok=True)


def _summary_stamp(path: Path) -> Stamp | None:
    summary = load_json(path)
    try:
        if not all((path.parent / name).exists() for name in summary.get("files", ())):
            return dataclasses.replace(Stamp(**summary["provenance"]), digest="", stage="")
        return Stamp(**summary["provenance"])
    except (KeyError, TypeError):
        return None


def is_foreign(path: Path) -> bool:
    """Whether a file without provenance is whole, so that it must be somebody's."""
    try:
        if path.suffix == ".json":
            return load_json(path) is not None
        with reading(path):
            return True
    except ArtifactError:
        return False


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
