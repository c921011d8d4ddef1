"""Cache of compiled libraries: checked before they are loaded, and removed after a time without use.

A library is kept with its SHA-256 behind it, which a loader of programs does not look at.
"""

import hashlib
import os
import platform
import shutil
import stat
import tempfile
import time
import warnings
from functools import cache
from pathlib import Path

from paramreduce_cli.errors import ParamreduceWarning

_DIGEST = 32
"""Bytes of a SHA-256."""
_OLDEST = 90 * 24 * 3600.0
"""Seconds after its last use that a library is kept."""
_KILLED = 24 * 3600.0
"""Seconds after which a folder to compile in belongs to no process any more."""
_MOST = 512 * 2**20
"""Bytes of all libraries together; of more the ones used longest ago go."""


def find_cache_folder() -> Path:
    """Return the folder of compiled models: ``$PARAMREDUCE_CACHE`` or the user's cache.

    Return a temporary folder of this process instead if that folder cannot be made or written to, or if other users
    could place code in it.
    """
    try:
        folder = _get_preferred_folder()
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        found = folder.stat()
    except (OSError, RuntimeError) as error:  # the latter where there is no home
        if os.environ.get("PARAMREDUCE_CACHE"):
            warnings.warn(
                f"PARAMREDUCE_CACHE cannot be used ({error}), so compiled models are not kept; name a folder "
                "that can be written",
                ParamreduceWarning,
                stacklevel=2,
            )
        return get_temporary_folder()
    others = stat.S_IWGRP | stat.S_IWOTH
    if hasattr(os, "getuid") and (found.st_uid != os.getuid() or found.st_mode & others):
        warnings.warn(
            f"{folder} can be written by others, so no compiled models are taken from there or kept; "
            "`chmod go-w` it, or name another folder in PARAMREDUCE_CACHE",
            ParamreduceWarning,
            stacklevel=2,
        )
        return get_temporary_folder()
    if not os.access(folder, os.W_OK | os.X_OK):
        warnings.warn(
            f"{folder} cannot be written, so compiled models are compiled in every run; name another folder in "
            "PARAMREDUCE_CACHE",
            ParamreduceWarning,
            stacklevel=2,
        )
        return get_temporary_folder()
    return folder


@cache
def identify_machine() -> str:
    """Return the architecture and the features of the processor, so that machines that share a folder load only
    libraries that they can run.
    """
    able = platform.processor()
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
        able = next(line for line in lines if line.startswith(("flags", "Features")))
    except (OSError, StopIteration):
        pass
    return "\n".join([platform.system(), platform.machine(), *platform.libc_ver(), able])


def _get_preferred_folder() -> Path:
    """Return the folder that the environment asks for."""
    named = os.environ.get("PARAMREDUCE_CACHE")
    if named:
        return Path(named)
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "paramreduce"


def get_temporary_folder() -> Path:
    """Return a folder that lasts as long as this process."""
    return Path(_make_temporary_folder().name)


@cache
def _make_temporary_folder() -> tempfile.TemporaryDirectory[str]:
    return tempfile.TemporaryDirectory(prefix="paramreduce-")


def is_kept(library: Path) -> bool:
    """Return whether a library is complete in the cache; mark it as used, or remove it if it is damaged."""
    try:
        if library.exists() and not library.is_file():  # a pipe would be waited for
            library.unlink()
        content = library.read_bytes()
        if hashlib.sha256(content[:-_DIGEST]).digest() == content[-_DIGEST:]:
            os.utime(library)
            return True
        library.unlink(missing_ok=True)
    except OSError:
        pass
    return False


def keep(built: Path, library: Path) -> None:
    """Move a new library into the cache atomically, and remove old ones.

    Raises:
        OSError: The folder cannot be written to.
    """
    with built.open("r+b") as file:
        digest = hashlib.sha256(file.read()).digest()
        file.write(digest)
        file.flush()
        os.fsync(file.fileno())
    _prune(library.parent, library)
    built.replace(library)


def _prune(folder: Path, new: Path) -> None:
    """Remove libraries without recent use, and folders of killed compilations."""
    for left in folder.glob("tmp*"):  # by compilations that were killed
        if left.is_dir() and left.stat().st_mtime < time.time() - _KILLED:
            shutil.rmtree(left, ignore_errors=True)
    found = []
    for path in folder.glob(f"*{new.suffix}"):
        try:
            found.append((path.stat().st_mtime, path.stat().st_size, path))
        except OSError:  # another process was faster
            continue
    total, oldest = 0, time.time() - _OLDEST
    for used, size, path in sorted(found, reverse=True):
        total += size
        if used < oldest or total > _MOST:
            path.unlink(missing_ok=True)
