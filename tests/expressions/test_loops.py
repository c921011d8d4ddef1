"""Compiled loops are kept with checksums: what is damaged is compiled again."""

import pkgutil
import subprocess
import sys

from numba.core.caching import IndexDataCacheFile
from numba.core.dispatcher import Dispatcher

import paramreduce_cli
from paramreduce_cli.expressions.loops import _CheckedCache

KEY, STAMP = ("signature", "processor"), (1.0, 2)


def test_a_flip_in_any_byte_is_noticed(tmp_path):
    cache = _CheckedCache(str(tmp_path), "loop", STAMP)
    kept = {"code": bytes(range(200)), "name": "search"}
    cache.save(KEY, kept)
    assert _CheckedCache(str(tmp_path), "loop", STAMP).load(KEY) == kept
    paths = sorted(tmp_path.iterdir())
    assert len(paths) == 2
    for path in paths:
        whole = path.read_bytes()
        for place in range(len(whole)):
            path.write_bytes(whole[:place] + bytes([whole[place] ^ 4]) + whole[place + 1 :])
            assert cache.load(KEY) is None
        path.write_bytes(whole[: len(whole) // 2])
        assert cache.load(KEY) is None
        path.write_bytes(whole)
    assert cache.load(KEY) == kept


def test_what_is_damaged_or_was_kept_without_checksums_is_replaced(tmp_path):
    IndexDataCacheFile(str(tmp_path), "loop", STAMP).save(KEY, "old")
    cache = _CheckedCache(str(tmp_path), "loop", STAMP)
    assert cache.load(KEY) is None
    cache.save(KEY, "new")
    assert cache.load(KEY) == "new"


def test_a_damaged_loop_runs_as_before(tmp_path):
    (tmp_path / "loop_to_keep.py").write_text(
        "from paramreduce_cli.expressions.loops import compile_loop\n"
        "@compile_loop()\ndef added(a, b):\n    return a + b\n"
    )
    program = "import loop_to_keep; print(loop_to_keep.added(2, 3), sum(loop_to_keep.added.stats.cache_hits.values()))"

    def said():
        done = subprocess.run(
            [sys.executable, "-c", program],
            cwd=tmp_path,
            capture_output=True,
            text=True,
            check=True,
        )
        return done.stdout.split()

    assert said() == ["5", "0"]
    assert said() == ["5", "1"]
    (code,) = tmp_path.rglob("*.nbc")
    content = bytearray(code.read_bytes())
    content[len(content) // 2] ^= 1
    code.write_bytes(content)
    assert said() == ["5", "0"]
    assert said() == ["5", "1"]


def test_all_loops_of_the_package_are_kept_that_way():
    """But those that are written out in others, with which they are kept."""
    found = 0
    for info in pkgutil.walk_packages(paramreduce_cli.__path__, "paramreduce_cli."):
        if info.name.endswith("__main__"):
            continue
        module = __import__(info.name, fromlist=["_"])
        for loop in vars(module).values():
            if isinstance(loop, Dispatcher) and loop.targetoptions.get("inline") != "always":
                found += 1
                assert isinstance(loop._cache._cache_file, _CheckedCache), loop
    assert found > 20


def test_a_change_in_a_file_beside_is_noticed(tmp_path):
    (tmp_path / "inner_loop.py").write_text(
        "from paramreduce_cli.expressions.loops import compile_loop\n"
        "@compile_loop()\ndef inner(a):\n    return a + 1\n"
    )
    (tmp_path / "outer_loop.py").write_text(
        "from paramreduce_cli.expressions.loops import compile_loop\nfrom inner_loop import inner\n"
        "@compile_loop()\ndef outer(a):\n    return 2 * inner(a)\n"
    )

    def said():
        program = "import outer_loop; print(outer_loop.outer(3))"
        command = [sys.executable, "-c", program]
        return subprocess.run(
            command, cwd=tmp_path, capture_output=True, text=True, check=True
        ).stdout.strip()

    assert said() == "8"
    inner = tmp_path / "inner_loop.py"
    inner.write_text(inner.read_text().replace("a + 1", "a + 20"))
    assert said() == "46"
