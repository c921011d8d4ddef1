"""The command that says what this machine has."""

import importlib.metadata
import os
import platform
import re
import shutil
import subprocess
import sys
import tempfile
import time
import warnings
from collections.abc import Iterator
from pathlib import Path

import click
import rich.markup
import rich.table

from paramreduce_cli import __version__
from paramreduce_cli.cli.options import count_cores
from paramreduce_cli.cli.terminal import JSON, emit, say_table
from paramreduce_cli.errors import ParamreduceError

_EXTRAS = {
    "identify": ("cvxpy", "clarabel"), "pandas": ("pandas",), "mjcf": ("mujoco",), "rosbag": ("rosbags",),
    "parquet": ("pyarrow",), "sweep": ("snakemake",),
}  # fmt: skip
"""Packages that each extra brings, under the names that they are imported by."""
_WIDTHS = (24, 6, None)
"""Columns of the table."""
_SHOWN = {"ok": "[green]ok[/]", "slow": "[yellow]slower[/]", "none": "-", "wrong": "[red]wrong[/]"}
WRONG = 1


@click.command()
@JSON
def doctor(as_json: bool) -> int:
    """Check this machine: compiler, caches, linear algebra, threads, extras.

    The loops of all searches are compiled, so that no later run waits for that.

    The exit code is 1 if something is missing that every run needs.
    """
    findings = []
    for what, state, found in _check_machine():
        findings.append((what, state, found))
        if not as_json:  # row by row, as some take seconds
            table = rich.table.Table(box=None, pad_edge=False, show_header=False)
            for width in _WIDTHS:
                table.add_column(width=width)
            table.add_row(what, _SHOWN[state], rich.markup.escape(found))
            say_table(table)
    if as_json:
        emit(findings=[dict(zip(("what", "state", "found"), one, strict=True)) for one in findings])
    return WRONG if any(state == "wrong" for _, state, _ in findings) else 0


def _check_machine() -> Iterator[tuple[str, str, str]]:
    """Yield what was checked, whether it is all right, and what was found."""
    yield "paramreduce", "ok", f"{__version__} in {Path(__file__).parents[2]}"
    yield "Python", "ok", f"{platform.python_version()}, {sys.executable}, {platform.machine()}"
    yield _check_compiler()
    yield from _check_caches()
    yield _check_loops()
    yield "cores", "ok", f"{count_cores()} that this process may use"
    threads = {name: os.environ.get(name) for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS")}
    yield "threads", "ok", ", ".join(f"{k}={v}" for k, v in threads.items() if v)
    yield _check_algebra()
    for extra, names in _EXTRAS.items():
        yield _check_extra(extra, names)


def _check_extra(extra: str, names: tuple[str, ...]) -> tuple[str, str, str]:
    """Check that the packages of an extra are there and can be imported."""
    versions = [_find_version(name) for name in names]
    if None in versions:
        text = f"pip install 'paramreduce[{extra}]' brings {' and '.join(names)}"
        return f"extra {extra}", "none", text
    # In a process of its own, which a broken library may end.
    words = [sys.executable, "-c", f"import {', '.join(names)}"]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    if done.returncode:
        message = done.stderr.strip().rpartition("\n")[2] or f"exit code {done.returncode}"
        return f"extra {extra}", "wrong", f"{', '.join(names)} cannot be imported: {message}"
    listed = (f"{name} {version}" for name, version in zip(names, versions, strict=True))
    return f"extra {extra}", "ok", ", ".join(listed)


def _check_compiler() -> tuple[str, str, str]:
    """Check the C compiler."""
    from paramreduce_cli.expressions.compiled import find_compiler

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            command = find_compiler()
    except ParamreduceError as error:
        return "C compiler", "wrong", str(error)
    if command is None:
        return "C compiler", "slow", "none; install gcc, or set CC: models run several times slower"
    with tempfile.TemporaryDirectory() as folder:
        source, made = Path(folder, "a.c"), Path(folder, "a.so")
        source.write_text("int one(void) { return 1; }\n", encoding="utf-8")
        words = [*command, "-shared", "-fPIC", "-o", str(made), str(source)]
        subprocess.run(words, capture_output=True, check=False)
        if not made.exists():
            text = f"{' '.join(command)} compiles nothing; models run several times slower"
            return "C compiler", "slow", text
    output = subprocess.run(
        [*command, "--version"], capture_output=True, text=True, check=False, timeout=20
    )
    return "C compiler", "ok", f"{' '.join(command)}: {output.stdout.partition(chr(10))[0]}"


def _check_caches() -> Iterator[tuple[str, str, str]]:
    """Check the folders of compiled code."""
    yield _check_model_cache()
    package = Path(__file__).parents[2]
    place = os.environ.get("NUMBA_CACHE_DIR")
    writable = place is not None or os.access(package, os.W_OK)
    text = (
        place
        or f"beside the package{'' if writable else ', which cannot be written: set NUMBA_CACHE_DIR'}"
    )
    yield "cache of Numba", "ok" if writable else "slow", text


def _check_model_cache() -> tuple[str, str, str]:
    """Compile a small library, keep it in the cache and load it from there."""
    from paramreduce_cli.expressions.cache import find_cache_folder
    from paramreduce_cli.expressions.compiled import load

    what = "cache of compiled models"
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            folder = find_cache_folder()
            load("int paramreduce_doctor(void) { return 1; }\n")
        except (ParamreduceError, OSError) as error:
            return what, "wrong", str(error)
    if caught:
        return what, "slow", str(caught[-1].message)
    files = list(folder.glob("*.so"))
    size = sum(file.stat().st_size for file in files) / 1e6
    free = shutil.disk_usage(folder).free / 1e9
    return what, "ok", f"{folder}: {len(files)} models, {size:.1f} MB; {free:.1f} GB are free"


def _check_loops() -> tuple[str, str, str]:
    """Compile the loops of all searches."""
    from paramreduce_cli.cli.precompilation import compile_loops

    started = time.perf_counter()
    try:
        compile_loops()
    except ParamreduceError as error:
        return "compiled loops", "wrong", str(error)
    return "compiled loops", "ok", f"ready after {time.perf_counter() - started:.0f} s"


def _check_algebra() -> tuple[str, str, str]:
    """Return the library of linear algebra that NumPy uses."""
    import numpy as np

    found = np.show_config(mode="dicts")["Build Dependencies"]["blas"]
    version = re.sub(r"\s+", " ", str(found.get("version", "")))
    return "linear algebra", "ok", f"NumPy {np.__version__}, {found.get('name')} {version}"


def _find_version(name: str) -> str | None:
    """Return the version of a package; None if it is not installed."""
    try:
        return importlib.metadata.version(name)
    except importlib.metadata.PackageNotFoundError:
        return None
