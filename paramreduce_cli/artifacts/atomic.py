"""Files that are replaced whole or not at all, whatever the disk does."""

import contextlib
import difflib
import errno
import glob
import os
import re
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from paramreduce_cli.artifacts.folder_layout import ITEMS
from paramreduce_cli.errors import ArtifactError


@contextlib.contextmanager
def replace_atomically(path: Path) -> Iterator[Path]:
    """Yield a temporary path beside ``path`` that replaces it when the block ends without an error.

    Raises:
        ArtifactError: The disk is full, the folder is not writable, or the like.
    """
    temporary = None
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.", suffix=".tmp")
        os.close(handle)
        temporary = Path(name)
        temporary.chmod(0o644)
        yield temporary
        with temporary.open("rb") as file:
            os.fsync(file.fileno())
        temporary.replace(path)
        for left in path.parent.glob(f".{glob.escape(path.name)}.*.tmp"):
            if _LEFT.fullmatch(left.name) and not _may_be_written(left):
                left.unlink(missing_ok=True)
    except (OSError, RuntimeError) as error:
        raise ArtifactError(f"{path}: cannot be written: {_explain_failure(error)}") from error
    finally:
        if temporary is not None:
            temporary.unlink(missing_ok=True)


def check_is_file(path: Path) -> None:
    """Raise ArtifactError if a path is a pipe or a folder; accept a path that does not exist.

    Raises:
        ArtifactError: The path is a folder or the like.
    """
    if path.exists() and not path.is_file():
        raise ArtifactError(f"{path}: is not a file.")


def make_missing_error(path: Path, *, command: str = "", remedy: str = "") -> ArtifactError:
    """Return the error that a file does not exist, with its remedy, or with a file of nearly the same name.

    Args:
        path: Path of the file.
        command: Stage that makes the file.
        remedy: Sentence on where the file comes from.
    """
    beside = [other.name for other in path.parent.iterdir()] if path.parent.is_dir() else []
    near = [] if command or remedy else difflib.get_close_matches(path.name, beside, n=1)
    choices = [str(path.with_name(name)) for name in near]
    meant = f" Did you mean {choices[0]}?" if choices else ""
    return ArtifactError(
        f"{path}: there is no such file.{meant}",
        rejected=str(path), choices=choices, command=command, remedy=remedy,
    )  # fmt: skip


_LEFT = re.compile(r"\..+\.\w{8}\.tmp")
"""Names of temporary files."""
_LONGEST_WRITING = 24 * 3600
"""Seconds for which nobody writes one file without a pause."""


def remove_leftovers(folder: Path) -> None:
    """Remove temporary files of runs that were killed, in a folder that nobody writes to."""
    for path in folder.rglob(".*.tmp"):
        # Other machines may be at work on items of the stage.
        shared = path.parent.suffix == ITEMS
        if _LEFT.fullmatch(path.name) and not (shared and _may_be_written(path)):
            path.unlink(missing_ok=True)


def _may_be_written(path: Path) -> bool:
    """Return whether another process could still be writing a temporary file."""
    with contextlib.suppress(FileNotFoundError):
        return time.time() - path.stat().st_mtime < _LONGEST_WRITING
    return False


def _explain_failure(error: Exception) -> str:
    """Return a sentence on why writing failed, and what to do."""
    number = getattr(error, "errno", None)
    text = str(error)
    if number in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG) or "No space left" in text:
        return "the disk is full. What was there before is unchanged; make room and run it again."
    if number in (errno.EACCES, errno.EROFS, errno.EPERM):
        return "the folder is not writable. Choose another with --results."
    return f"{text.splitlines()[0] if text else type(error).__name__}."


class PatientFile:
    """A file for HDF5 to write to, which stores its first error instead of raising it.

    HDF5 cannot close a file on a full disk, and crashes the process at its end. After an error all further writes are
    therefore ignored, the file is closed, and :meth:`check` raises the error.
    """

    def __init__(self, path: Path) -> None:
        self._file = path.open("r+b", buffering=0)
        self._error: OSError | None = None

    def check(self) -> None:
        """Raise the error that was kept, if there is one."""
        if self._error is not None:
            raise self._error

    def write(self, data: Any) -> int:
        """Write data unless an earlier write has failed, and return their size either way."""
        view = memoryview(data).cast("B")
        done = 0
        try:
            while self._error is None and done < len(view):
                done += self._file.write(view[done:])
        except OSError as error:
            self._error = error
        return len(view)

    def truncate(self, size: int) -> int:
        """Set the size of the file unless an earlier write has failed."""
        try:
            if self._error is None:
                self._file.truncate(size)
        except OSError as error:
            self._error = error
        return size

    def readinto(self, buffer: Any) -> int:
        return self._file.readinto(buffer) or 0

    def read(self, size: int = -1) -> bytes:
        return self._file.read(size) or b""

    def seek(self, offset: int, whence: int = os.SEEK_SET) -> int:
        return self._file.seek(offset, whence)

    def tell(self) -> int:
        return self._file.tell()

    def flush(self) -> None:
        """Do nothing, as nothing is buffered."""

    def close(self) -> None:
        self._file.close()
