"""Bytes of files flipped, and files cut off: what is read is right, or refused."""

import dataclasses
import os
import subprocess
import sys
from collections import Counter

import numpy as np

from paramreduce_cli.artifacts.report_files import load_summary
from paramreduce_cli.artifacts.store import LAYOUTS, Store, load_file
from paramreduce_cli.errors import ArtifactError
from paramreduce_cli.records import Report

RECORDS = (*LAYOUTS, Report)


def read(store, record):
    """All that a file holds, as something that can be compared."""
    if record is Report:
        return load_summary(store.get_path(record))
    return plain(load_file(store.get_path(record), record, None, "")[0])


def plain(value):
    if hasattr(value, "iterate_blocks"):  # read in slices
        return [plain(list(value.iterate_blocks())), plain(value.compute_factors())]
    if dataclasses.is_dataclass(value):
        return [plain(getattr(value, field.name)) for field in dataclasses.fields(value)]
    if isinstance(value, np.ndarray):
        return value.dtype.str, value.shape, value.tobytes()
    if isinstance(value, float):  # what is not a number is equal to itself
        return np.float64(value).tobytes()
    if isinstance(value, dict):
        return [[key, plain(entry)] for key, entry in value.items()]
    return [plain(entry) for entry in value] if isinstance(value, tuple | list) else value


def outcome(store, record, robot, expected):
    """What became of a damaged file: noticed or harmless; or silently wrong, which must not be."""
    whole = store.is_whole(record)
    try:
        store.reject_replacement(record, robot)
    except ArtifactError:
        return "not made again"
    try:
        same = read(store, record) == expected
    except ArtifactError:
        return "noticed" if not whole else "noticed by its reader alone"
    if same:
        return "harmless"
    return "silently wrong"


def damaged(content, rng):
    """A copy with a byte flipped or, one time in ten, cut off."""
    place = int(rng.integers(len(content)))
    if rng.random() < 0.1:
        return content[:place]
    flipped = content[place] ^ int(rng.integers(1, 256))
    return content[:place] + bytes([flipped]) + content[place + 1 :]


_COMPUTED = """
import casadi as ca, numpy as np
from paramreduce_cli.expressions.compiled import BatchFunction
x = ca.SX.sym("x", 3)
found, = BatchFunction([x], [ca.vertcat(ca.sin(x[0]) * x[1], x[2] / x[1])])(np.arange(6.0).reshape(2, 3) + 1)
print(found.tolist())
"""
_LOOPED = """
import numpy as np
from paramreduce_cli.terms.matrices import multiply_triangles
print(multiply_triangles(np.arange(12.0).reshape(2, 2, 3), np.ones((1, 2, 3))).tolist())
"""


def try_cache(folder, count, seed=0):
    """Damage compiled models and loops in their caches; they are made anew and compute the same.

    Args:
        folder: For caches of their own.
        count: How often each kind of file.
        seed: Of the places.

    Returns:
        How often each thing happened.
    """
    rng, found = np.random.default_rng(seed), Counter()
    for script, endings in ((_COMPUTED, (".so",)), (_LOOPED, (".nbi", ".nbc"))):
        cache = folder / f"cache{endings[0]}"
        environment = {**os.environ, "PARAMREDUCE_CACHE": str(cache), "NUMBA_CACHE_DIR": str(cache)}

        def computed(script=script, environment=environment):
            command = [sys.executable, "-c", script]
            return subprocess.run(command, env=environment, capture_output=True).stdout

        expected = computed()
        files = [path for path in cache.rglob("*") if path.suffix in endings]
        for k in range(count):
            path = files[k % len(files)]
            content = path.read_bytes()
            path.unlink()
            path.write_bytes(wrong := damaged(content, rng))
            same = computed() == expected and path.read_bytes() != wrong
            found["noticed" if same else "wrong"] += 1
            path.write_bytes(content)
    return found


def try_damage(results, count, seed=0):
    """Damage the files of a finished run, one at a time.

    Args:
        results: Folder of the run; its files are put back.
        count: How often each file is damaged.
        seed: Of the places.

    Returns:
        How often each thing happened, by file.
    """
    rng = np.random.default_rng(seed)
    store = Store(results)
    robot = load_summary(store.get_path(Report))["robot"]
    found = {}
    for record in RECORDS:
        path = store.get_path(record)
        if not path.exists():  # only runs on a log make some of them, only others the rest
            continue
        content, expected = path.read_bytes(), read(store, record)
        found[path.name] = Counter()
        for _ in range(count):
            path.write_bytes(damaged(content, rng))
            found[path.name][outcome(store, record, robot, expected)] += 1
        path.write_bytes(content)
    return found
