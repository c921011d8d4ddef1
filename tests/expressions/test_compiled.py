import errno
import os
import warnings

import casadi as ca
import numpy as np
import pytest

from paramreduce_cli.errors import ParamreduceWarning
from paramreduce_cli.expressions import compiled
from paramreduce_cli.expressions.compiled import BatchFunction


@pytest.fixture(autouse=True)
def own_cache(tmp_path, monkeypatch):
    monkeypatch.setenv("PARAMREDUCE_CACHE", str(tmp_path / "cache"))
    compiled.find_compiler.cache_clear()
    yield
    compiled.find_compiler.cache_clear()


def example():
    x, y = ca.SX.sym("x", 2), ca.SX.sym("y", 3)
    return BatchFunction([x, y], [x[0] * y, ca.vertcat(ca.sin(x[1]), y[2])])


def check(function):
    rng = np.random.default_rng(0)
    x, y = rng.normal(size=(20, 2)), rng.normal(size=(20, 3))
    one, two = function(x, y)
    assert np.allclose(one, x[:, :1] * y, atol=1e-15)
    assert np.allclose(two, np.column_stack([np.sin(x[:, 1]), y[:, 2]]), atol=1e-15)


def test_compiled_loop():
    if compiled.find_compiler() is None:
        pytest.skip("there is no C compiler")
    check(example())
    assert len(list(compiled.find_cache_folder().glob("*.so"))) == 1
    check(example())
    assert len(list(compiled.find_cache_folder().glob("*.so"))) == 1


def test_a_cache_that_is_named_but_cannot_be_is_said(monkeypatch, tmp_path):
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("PARAMREDUCE_CACHE", str(tmp_path / "file" / "cache"))
    with pytest.warns(ParamreduceWarning, match="PARAMREDUCE_CACHE cannot be used"):
        assert compiled.find_cache_folder().is_dir()


def test_a_cache_that_can_be_read_alone_is_said_and_models_are_compiled_all_the_same(monkeypatch):
    if compiled.find_compiler() is None:
        pytest.skip("there is no C compiler")
    monkeypatch.setenv("PARAMREDUCE_CACHE", "/sys/kernel")  # whatever the user's rights
    with pytest.warns(ParamreduceWarning, match="/sys/kernel cannot (be written|hold)") as said:
        check(example())
    assert not any("compiler" in str(one.message) for one in said)


def test_a_cache_that_cannot_hold_models_is_no_fault_of_the_compiler(monkeypatch):
    if compiled.find_compiler() is None:
        pytest.skip("there is no C compiler")

    def full(built, library):
        if library.parent == compiled.find_cache_folder():
            raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(compiled, "keep", full)
    with pytest.warns(ParamreduceWarning, match="cannot hold compiled models .No space left"):
        library = compiled.load("int one(void) { return 1; }")
    assert library is None or library.one() == 1


def test_machines_of_two_kinds_share_a_folder(monkeypatch):
    """Each takes what was compiled for its own processor."""
    if compiled.find_compiler() is None:
        pytest.skip("there is no C compiler")
    check(example())
    monkeypatch.setattr(compiled, "identify_machine", lambda: "another processor")
    check(example())
    assert len(list(compiled.find_cache_folder().glob("*.so"))) == 2


def test_without_a_compiler_the_result_is_the_same_and_it_is_said_once(monkeypatch):
    monkeypatch.delenv("CC", raising=False)
    monkeypatch.setattr(compiled.shutil, "which", lambda name: None)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        check(example())
        check(example())
    assert [w.category for w in caught] == [ParamreduceWarning]


def test_a_compiler_that_fails_is_survived(monkeypatch, tmp_path):
    broken = tmp_path / "broken-cc"
    broken.write_text("#!/bin/sh\necho 'no such thing' >&2\nexit 1\n")
    broken.chmod(0o755)
    monkeypatch.setenv("CC", str(broken))
    with pytest.warns(ParamreduceWarning, match="no such thing"):
        function = example()
    check(function)


def test_states_that_do_not_fit_are_refused():
    with pytest.raises(ValueError):
        example()(np.zeros((4, 2)), np.zeros((4, 4)))


def libraries():
    return sorted(compiled.find_cache_folder().glob("*.so"))


needs_compiler = pytest.mark.skipif(
    compiled.find_compiler() is None, reason="there is no C compiler"
)


@needs_compiler
@pytest.mark.parametrize("place", [0, 0.3, 0.5, 0.99, None])
def test_a_damaged_library_is_never_loaded(place):
    check(example())
    (library,) = libraries()
    whole = library.read_bytes()
    wrong = bytearray(whole)
    if place is None:
        del wrong[-10:]
    else:
        wrong[int(place * len(whole))] ^= 1
    library.unlink()  # the mapped one lives on
    library.write_bytes(wrong)
    check(example())
    assert libraries() == [library]
    assert library.read_bytes() != wrong


@needs_compiler
def test_a_folder_that_others_can_write_to_is_not_trusted():
    folder = compiled.find_cache_folder()
    folder.chmod(0o777)
    with pytest.warns(ParamreduceWarning, match="can be written by others"):
        check(example())
    assert not list(folder.glob("*.so"))


@needs_compiler
def test_libraries_that_were_not_used_for_long_go():
    old = compiled.find_cache_folder() / "old.so"
    old.write_bytes(b"something")
    os.utime(old, (0, 0))
    check(example())
    assert len(libraries()) == 1
    assert not old.exists()
