"""Input that nobody means to give: one message each and exit code 2, at once and in little memory."""

import os
import subprocess
import sys

import h5py
import numpy as np
import pytest
from conftest import ONE_FORMAT, TWO_LINK

from paramreduce_cli.expressions import cache

ALIASES = "a0: &a0 [x, x]\n" + "".join(
    f"a{k}: &a{k} [{', '.join([f'*a{k - 1}'] * 9)}]\n" for k in range(1, 9)
)
MERGES = "a0: &a0 {x: 1}\n" + "".join(
    f"a{k}: &a{k}\n  <<: [*a{k - 1}, *a{k - 1}]\n" for k in range(1, 40)
)
SECONDS, MEGABYTES = 10, 200
"""Of a process with its libraries; a busy machine takes longer than the second it should be."""


LIMITED = f"""
import os, resource, sys
import paramreduce_cli.stages.build_model
from paramreduce_cli.cli import main

for path in sys.argv[1:]:
    child = os.fork()
    if not child:
        resource.setrlimit(resource.RLIMIT_CPU, ({SECONDS}, {SECONDS}))
        resource.setrlimit(resource.RLIMIT_DATA, ({MEGABYTES << 20}, {MEGABYTES << 20}))
        os.dup2(os.open(path + ".err", os.O_WRONLY | os.O_CREAT), 2)
        sys.argv[1:] = ["build-model", path]
        main()
    print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))
"""
"""A process that loads the libraries once, and makes models in others that can take little."""


def command(*arguments, **options):
    """The command line in a process of its own."""
    return subprocess.run(
        [sys.executable, "-m", "paramreduce_cli", *map(str, arguments)],
        capture_output=True, check=False, timeout=120, **options,
    )  # fmt: skip


BOMBS = {
    "aliases": (ALIASES, "holds more than"),
    "merges": (MERGES, "holds more than"),
    "itself": ("a: &a [*a]", "refers to itself"),
    "brackets": ("[" * 900, "nested too deep"),
    # From 6.0.4 of PyYAML on its own scanner refuses it first: "exceeded maximum nesting depth".
    "nesting": ("x: " + "[" * 5000 + "]" * 5000, "nest"),
    "tag": ("robot: !unknown 3", "could not determine a constructor"),
    "keys": ("".join(f"k{k}: 1\n" for k in range(30_000)), "holds more than"),
    "fewer keys": ("".join(f"k{k}: 1\n" for k in range(3_000)), "more problems like these"),
    "long": ("x: '" + "y" * 2_000_000 + "'", "more than a config needs"),
}


def test_yaml_that_would_take_for_ever(tmp_path):
    paths = {name: tmp_path / f"{name}.yaml" for name in BOMBS}
    for name, path in paths.items():
        path.write_text(BOMBS[name][0])
    done = subprocess.run(
        [sys.executable, "-c", LIMITED, *map(str, paths.values())],
        capture_output=True, check=True, timeout=120, text=True,
    )  # fmt: skip
    codes = dict(zip(BOMBS, map(int, done.stdout.split()), strict=True))
    assert codes == dict.fromkeys(BOMBS, 2)
    for name, path in paths.items():
        said = path.with_name(f"{path.name}.err").read_text()
        assert BOMBS[name][1] in said
        assert len(said) < 20_000


@pytest.mark.parametrize(
    "value",
    ["1" + "0" * 400, "9" * 5000, "!!bool x", "!!timestamp x", "!!int x", "!!int ''", "!!float x", "2001-99-99",
     "1e400", "{[1]: 2}", "null", "[1]"],
)  # fmt: skip
@pytest.mark.parametrize("key", ["gravity: [0, -9.81, 0]", "  count: 2", "  seed: 0"])
def test_values_that_do_not_fit(invoke, write_config, value, key):
    name, separator, _ = key.partition(": ")
    if key not in TWO_LINK.read_text():
        pytest.skip(f"the config has no {key}")
    refused = invoke("build-model", write_config((key, f"{name}{separator}{value}")), code=2)
    assert "Error: " in refused.err
    assert len(refused.err) < 2000
    refused = invoke("build-model", TWO_LINK, settings=[f"{name.strip()}={value}"], code=2)
    assert "Error: " in refused.err


@pytest.mark.parametrize("value", ["!!bool x", "!!timestamp x", "9" * 400])
def test_a_value_that_cannot_be_read_is_said_once(invoke, write_config, value):
    gravity = "gravity: [0, -9.81, 0]"
    refused = invoke("build-model", write_config((gravity, f"gravity: [0, {value}, 0]")), code=2)
    assert refused.err.count("Error: ") == 1


def test_a_long_value_is_shown_in_part(invoke, write_config):
    for value in ("+".join(["1"] * 5000), "-" * 5000 + "1"):
        refused = invoke("build-model", write_config(("  count: 2", f"  period: {value}")), code=2)
        assert "is not a number" in refused.err
        assert len(refused.err) < 1000


@pytest.mark.parametrize("text", ["{}", '{"robot": 1}'])
def test_a_summary_without_files_is_none_of_a_page(invoke, tmp_path, text):
    (tmp_path / "report").mkdir()
    for name, content in (("summary.json", text), ("index.html", "<p>")):
        (tmp_path / "report" / name).write_text(content)
    assert "no report's summary" in invoke("open", tmp_path, code=2).err


@pytest.mark.parametrize("text", ["[1]", "null", "3", '"a"', "{}", "[" * 900, '{"reduction": 1}'])
@pytest.mark.parametrize("command", ["compare", "table", "inspect"])
def test_summaries_that_are_none(invoke, tmp_path, text, command):
    path = tmp_path / "summary.json"
    path.write_text(text)
    if command == "inspect" and text in ("{}", '{"reduction": 1}'):
        pytest.skip("nothing is asked of it")
    assert "Error: " in invoke(command, *[path] * (1 + (command == "compare")), code=2).err


@pytest.fixture
def brought(tmp_path):
    """Writes an observation matrix with torques; returns what to call."""

    def write(W, tau, links=()):
        path = tmp_path / "samples.h5"
        with h5py.File(path, "w") as file:
            for name, value in (("estimation/W", W), ("estimation/tau", tau)):
                if isinstance(value, tuple):
                    file.create_dataset(name, value, "f8", chunks=(100, value[1]))
                else:
                    file[name] = value
            for name, link in links:
                file.pop(name, None)
                file[name] = link
        return "reduce", "--samples", path, "--results", tmp_path / "r"

    return write


W = np.random.default_rng(0).normal(size=(300, 5))
TAU = (W @ np.arange(1.0, 6)).reshape(150, 2)


@pytest.mark.parametrize(
    ("matrix", "torques", "says"),
    [
        (W, TAU * 1e200, "too small or too large to calculate with"),
        (W, TAU * 1e-300, "too small or too large to calculate with"),
        (W * 1e160, TAU, "too large to calculate with"),
        (W * 1e-200, TAU, "too small to calculate with"),
        ((10**10, 2), (5 * 10**9, 2), "declares 10000000000 x 2 numbers, but holds almost none"),
        (W, (150, 2), "no torque to weigh"),
    ],
)
def test_numbers_beyond_all_measure(invoke, brought, matrix, torques, says):
    assert says in invoke(*brought(matrix, torques), code=2).err


def test_long_doubles_are_read(invoke, brought, tmp_path):
    invoke(*brought(W.astype(np.longdouble), TAU.astype(np.longdouble)))
    with h5py.File(tmp_path / "r" / "reduction.h5") as file:
        assert file["forward-selection/torque_error"][4] < 1e-12


def test_columns_that_count_as_zero_are_named(invoke, brought):
    done = invoke(*brought(W * [1, 1e14, 1, 1, 1], TAU))
    assert "4 columns of the observation matrix count as zero beside p2" in done.err
    for size in (1e-20, 1e-200):
        done = invoke(*brought(W * [1, 1, 1, size, 1], TAU), "--force")
        assert "1 columns of the observation matrix count as zero" in done.err


@pytest.mark.parametrize("size", [1e-12, 1e12])
def test_columns_far_apart_are_not_proven_unless_values_say_what_they_contribute(
    invoke, brought, tmp_path, size
):
    def statuses():
        with h5py.File(tmp_path / "r" / "reduction.h5") as file:
            return set(file["proofs/status"].asstr()[:])

    scales = np.array([1, 1, size, 1, 1])
    invoke(*brought(W * scales, TAU))
    assert statuses() == {"uncertified"}
    invoke(
        *brought(W * scales, TAU, [("parameters/values", np.arange(1.0, 6) / scales)]), "--force"
    )
    assert statuses() == {"optimal"}


def test_links_out_of_a_file_are_not_followed(invoke, brought, tmp_path):
    with h5py.File(tmp_path / "other.h5", "w") as file:
        file["W"] = W
    link = h5py.ExternalLink(str(tmp_path / "other.h5"), "/W")
    refused = invoke(*brought(W, TAU, [("estimation/W", link)]), code=2)
    assert "/estimation/W is in another file" in refused.err


def test_a_pipe_is_no_file(invoke, tmp_path):
    pipe = tmp_path / "pipe.h5"
    os.mkfifo(pipe)
    log, bag = tmp_path / "pipe.csv", tmp_path / "pipe.mcap"
    os.mkfifo(log)
    os.mkfifo(bag)
    for arguments in (
        ("check-data", log),
        ("check-data", bag),
        ("check-data", tmp_path, "--log-file", log),
        ("inspect", pipe),
        ("compare", pipe, pipe),
        ("reduce", "--samples", pipe, "--results", tmp_path / "r"),
    ):
        assert "is not a file" in invoke(*arguments, code=2).err


def test_a_pipe_in_the_folder_is_no_config_to_propose(tmp_path):
    os.mkfifo(tmp_path / "a.yaml")
    done = command("inspect", "nothing", cwd=tmp_path)
    assert done.returncode == 2


def test_a_pipe_in_the_cache_is_no_library(tmp_path):
    library = tmp_path / "kept.so"
    os.mkfifo(library)
    assert not cache.is_kept(library)
    assert not library.exists()


def test_folders_of_killed_compilations_go_after_a_day(tmp_path):
    old, new = tmp_path / "tmpold", tmp_path / "tmpnew"
    for folder in (old, new):
        folder.mkdir()
    os.utime(old, (1e9, 1e9))
    built = tmp_path / "built.so"
    built.write_bytes(b"code")
    cache.keep(built, tmp_path / "kept.so")
    assert cache.is_kept(tmp_path / "kept.so")
    assert not old.exists()
    assert new.exists()


def test_names_cannot_steer_the_terminal(invoke, brought, tmp_path):
    names = np.array(["a", "\x1b[31mred\x1b[0m", "\u202ec", "d", "e"], dtype=h5py.string_dtype())
    invoke(*brought(W, TAU, [("parameters/names", names)]))
    out = invoke("inspect", tmp_path / "r" / "reduction.h5", "--model", "qr:5").out
    assert r"\x1b[31mred" in out
    assert "\x1b" not in out
    assert r"\u202ec" in out


@pytest.mark.parametrize(
    "changes",
    [{"COLUMNS": "0"}, {"PYTHONIOENCODING": "ascii"}, {"HOME": None, "XDG_CACHE_HOME": None}],
)
def test_odd_surroundings(two_link_results, changes):
    environment = {k: v for k, v in {**os.environ, **changes}.items() if v is not None}
    environment.pop("PARAMREDUCE_CACHE", None)
    same = ("--results", two_link_results, "--set", ONE_FORMAT)
    run = command("run", TWO_LINK, *same, env=environment)
    assert run.returncode == 0, run.stderr
    assert b"forward-selection" in run.stdout
    done = command("inspect", two_link_results / "model.h5", env=environment)
    assert b"/parameters/values" in done.stdout


def test_a_compiler_that_cannot_be_read(two_link_results, tmp_path):
    environment = {**os.environ, "CC": "gcc '"}
    arguments = ("sample", TWO_LINK, "--results", two_link_results, "--force")
    done = command(*arguments, env=environment)
    assert (done.returncode, b"CC holds no command" in done.stderr) == (2, True)
