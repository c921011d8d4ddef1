"""Results folder: the files of records, and whether they are up to date."""

import contextlib
import hashlib
import os
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import filelock

from paramreduce_cli.artifacts import layouts
from paramreduce_cli.artifacts.atomic import check_is_file, make_missing_error, remove_leftovers
from paramreduce_cli.artifacts.folder_layout import SUMMARY
from paramreduce_cli.artifacts.hdf5 import (
    SCHEMA,
    Reader,
    Stamp,
    Writer,
    open_reader,
    read_stamp,
    read_stamp_from,
    write,
)
from paramreduce_cli.artifacts.report_files import (
    load_json,
    read_summary_stamp,
    save_report,
    verify_report,
)
from paramreduce_cli.artifacts.sample_files import load_samples, save_samples
from paramreduce_cli.errors import ArtifactError
from paramreduce_cli.records import STORED, Report, Samples


@dataclass(frozen=True)
class Layout:
    """A layout of one kind of record in HDF5."""

    file: str
    save: Callable[[Writer, Any], None]
    load: Callable[[Reader], Any]


LAYOUTS: dict[type, Layout] = {
    record: Layout(record.FILE, layouts.save, partial(layouts.load, record=record))
    for record in STORED
} | {Samples: Layout(Samples.FILE, save_samples, load_samples)}
"""How the records that name their file are kept."""


def get_file(record: type) -> str:
    """Return the path of a record's file below the results folder."""
    return SUMMARY if record is Report else LAYOUTS[record].file


class Store:
    """The artifacts of one robot in one folder.

    Args:
        folder: The results folder.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def get_path(self, record: type) -> Path:
        """Return the path of a record's file."""
        return self.folder / get_file(record)

    def read_stamp(self, record: type) -> Stamp | None:
        """Return the stamp of a record's file, or None if it does not exist or is not readable."""
        path = self.get_path(record)
        if not path.exists():
            return None
        try:
            return read_summary_stamp(path) if record is Report else read_stamp(path)
        except ArtifactError:
            return None

    def is_whole(self, record: type) -> bool:
        """Whether a record's file can be read to its end: no checksum in it is wrong."""
        try:
            if record is Report:
                verify_report(self.get_path(record))
            else:
                with open_reader(self.get_path(record)) as reader:
                    reader.verify()
        except ArtifactError:
            return False
        return True

    def reject_replacement(self, record: type, robot: str) -> None:
        """Raise ArtifactError if a file of another robot would be overwritten.

        A damaged artifact may be replaced; a file of another robot, or one that paramreduce did
        not make, may not.

        Raises:
            ArtifactError: The record's file is such a file.
        """
        path = self.get_path(record)
        if not path.exists():
            return
        stamp = self.read_stamp(record)
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

    def save(self, record: Any, stamp: Stamp, path: Path | None = None) -> Stamp:
        """Write a record, whole or not at all: to its file, or to another path."""
        if isinstance(record, Report):
            return save_report(self.folder / "report", record, stamp)
        layout = LAYOUTS[type(record)]
        return write(path or self.folder / layout.file, stamp, lambda w: layout.save(w, record))

    def touch(self, record: type) -> None:
        """Make a file look new, so that Make agrees that it is current."""
        with contextlib.suppress(OSError):  # where nobody may write Make cannot be told
            os.utime(self.get_path(record))

    @contextlib.contextmanager
    def lock(self, part: str = "", *, wait: bool = False) -> Iterator[None]:
        """Keep other runs out of the folder, or away from one part of an artifact, within the block.

        Args:
            part: Name of the part; the whole folder if empty.
            wait: Whether to wait for another run instead of raising an error.

        Raises:
            ArtifactError: Another run is in the folder.
        """
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            lock = filelock.FileLock(self.folder / f".lock{part}", timeout=-1 if wait else 0)
            lock.acquire()
        except filelock.Timeout as error:
            what = "is at work on this part" if part else "is using this folder"
            raise ArtifactError(
                f"{self.folder}: another run {what}. Wait for it, or choose another with --results."
            ) from error
        except OSError as error:
            if not self.folder.is_dir():
                raise ArtifactError(f"{self.folder}: cannot be used: {error}.") from error
            yield  # nobody writes to it, so what is up to date may be looked at
            return
        try:
            if not part:
                remove_leftovers(self.folder)
            yield
        finally:
            if part:  # before others can take it, who see so that it is gone
                (self.folder / f".lock{part}").unlink(missing_ok=True)
            lock.release()


def load_file(path: Path, record: type, robot: str | None, maker: str) -> tuple[Any, Stamp | None]:
    """Read a record.

    Args:
        path: The file.
        record: Type of the record.
        robot: Name of the robot it must belong to; None to accept any file of the right
            layout, also one that a user brings.
        maker: Command that makes it, for messages.

    Raises:
        ArtifactError: The file is missing, damaged, of another robot or of another schema.
    """
    with open_reader(path, command=maker) as reader:
        stamp = read_stamp_from(reader)
        if stamp is not None:
            check_schema(path, stamp)
        if stamp is None and robot is not None:
            raise ArtifactError(
                f"{path}: was not made by paramreduce.", rejected=str(path), command=maker
            )
        if stamp is not None and robot is not None and stamp.robot != robot:
            raise ArtifactError(
                f"{path}: belongs to the robot {stamp.robot}, not to {robot}. Choose another folder "
                "with --results."
            )
        return LAYOUTS[record].load(reader), stamp


def check_schema(path: Path, stamp: Stamp) -> None:
    """Refuse a file of another layout.

    Raises:
        ArtifactError: The file is of an older or newer schema.
    """
    if stamp.schema != SCHEMA:
        age = "an older" if stamp.schema < SCHEMA else "a newer"
        raise ArtifactError(
            f"{path}: was written in {age} layout (schema {stamp.schema}, this version reads "
            f"{SCHEMA}).",
            rejected=str(path),
            command="run",
        )


def digest_file(path: Path) -> str:
    """Return the SHA-256 of a file's bytes.

    Raises:
        ArtifactError: The file cannot be read.
    """
    if not path.is_dir():
        check_is_file(path)
    try:
        if path.is_dir():  # a bag
            parts = {p.name: digest_file(p) for p in sorted(path.iterdir()) if p.is_file()}
            return hashlib.sha256(repr(parts).encode()).hexdigest()
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except FileNotFoundError as error:
        raise make_missing_error(path) from error
    except OSError as error:
        raise ArtifactError(f"{path}: cannot be read: {error.strerror}.") from error


def is_foreign(path: Path) -> bool:
    """Whether a file without provenance is somebody's, and not one of ours that is damaged."""
    try:
        if path.suffix == ".json":
            data = load_json(path)
            return not (isinstance(data, dict) and {"provenance", "config_sha256"} & data.keys())
        with open_reader(path) as reader:
            for name in reader.file.attrs:
                reader.read_attribute(name)
            return True
    except ArtifactError:
        return False
