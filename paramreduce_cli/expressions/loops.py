"""Loops that Numba compiles once for all runs, kept in its cache and checked before they are loaded.

Numba keeps machine code and its index without any checksum, and runs what it finds. Here a SHA-256 follows both, which
unpickling does not look at; what does not fit is compiled again. A checksum in a file beside would need the same methods:
Numba has no other place to compare one before it loads, and two files cannot be replaced at once.
"""

import hashlib
import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import numba
from numba.core.caching import IndexDataCacheFile

Loop = TypeVar("Loop", bound=Callable[..., Any])

_DIGEST = 32
"""Bytes of a SHA-256."""


class _CheckedCache(IndexDataCacheFile):
    """A cache of one function's Numba files, each with a checksum behind it."""

    def _load_index(self) -> Any:
        try:
            _read_checked(self._index_path)
            return super()._load_index()
        except OSError:
            return {}

    def _save_index(self, overloads: Any) -> None:
        """Write the index with its checksum."""
        version = pickle.dumps(self._version, protocol=-1)
        self._write(self._index_path, version + self._dump((self._source_stamp, overloads)))

    def _load_data(self, name: str) -> Any:
        return pickle.loads(_read_checked(self._data_path(name)))

    def _save_data(self, name: str, data: Any) -> None:
        self._write(self._data_path(name), self._dump(data))

    def _write(self, path: str, content: bytes) -> None:
        with self._open_for_write(path) as file:
            file.write(content + hashlib.sha256(content).digest())


def _read_checked(path: str) -> bytes:
    """Return the content of a file without the checksum at its end.

    Raises:
        OSError: The file cannot be read, or its content does not match the checksum.
    """
    content = Path(path).read_bytes()
    if hashlib.sha256(content[:-_DIGEST]).digest() != content[-_DIGEST:]:
        raise OSError(f"the checksum of {path} does not fit")
    return content[:-_DIGEST]


def _stamp_files(source: Path) -> tuple[tuple[str, float, int], ...]:
    """Return the times and sizes of all files in a folder, as a compiled function contains the functions that it calls."""
    stats = [(file, file.stat()) for file in sorted(source.parent.glob("*.py"))]
    return tuple((file.name, stat.st_mtime, stat.st_size) for file, stat in stats)


def inline(function: Loop) -> Loop:
    """Inline a function in the compiled functions that call it, if these are few.

    A function that is not inlined is compiled again, with all that it calls, in each of its callers.
    """
    made: Loop = numba.njit(inline="always")(function)
    return made


def compile_loop(*, within: bool = False, makes_arrays: bool = True) -> Callable[[Loop], Loop]:
    """Return a decorator that compiles a function with Numba at its first call, and caches the result.

    Other threads run on while the compiled function runs.

    Args:
        within: Whether only compiled functions call it. A call from Python then ends the process, because no wrapper
            for Python is compiled.
        makes_arrays: Whether the function allocates arrays. If not, references are not counted, which saves half of the
            time of small functions or more; all arrays must then belong to the caller.
    """

    def compile_function(function: Loop) -> Loop:
        """Return a function that is compiled at its first call."""
        dispatcher: Any = numba.njit(
            cache=True,
            nogil=True,
            no_cfunc_wrapper=True,
            no_cpython_wrapper=within,
            _nrt=makes_arrays,
        )(function)
        if hasattr(
            dispatcher, "_cache"
        ):  # not where NUMBA_DISABLE_JIT leaves functions as they are
            file = dispatcher._cache._cache_file
            file.__class__ = _CheckedCache
            file._source_stamp = (
                file._source_stamp,
                _stamp_files(Path(function.__code__.co_filename)),
            )
        return dispatcher

    return compile_function
