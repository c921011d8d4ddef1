"""Calls that are corrected from the fields of errors that the program raises."""

import pytest

from paramreduce_cli.cli.suggestions import CommandLine, find_nearest_choice, suggest_after_error
from paramreduce_cli.errors import ArtifactError, ConfigError, DataError, MissingConfigError


def suggested(error, typed):
    lines = suggest_after_error(error, CommandLine(typed.split(), None))
    return lines if lines.startswith(("Next", "Then")) else ""


def test_results_that_are_not_there_are_made_with_their_config(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    error = ArtifactError(
        "results/arm/validation.h5: there is no such file.", rejected="results/arm/validation.h5"
    )
    assert suggested(error, "inspect results/arm") == ""
    (tmp_path / "configs").mkdir()
    (tmp_path / "configs" / "arm.yaml").write_text("")
    assert suggested(error, "inspect results/arm") == "Next: paramreduce run configs/arm.yaml"


@pytest.mark.parametrize(
    ("error", "typed", "meant"),
    [
        (ConfigError("x", rejected="a.yaml", choices=["b.yaml"]), "run a.yaml --jobs 2", "Next: paramreduce run b.yaml --jobs 2"),
        (ConfigError("x", rejected="a", choices=["my arm.yaml"]), "run --set=a", "Next: paramreduce run '--set=my arm.yaml'"),
        (ConfigError("x", rejected="a.yaml", choices=["b.yaml"]), "run c.yaml", ""),
        (ConfigError("x", rejected="s:9", choices=["full", "s:2...7"]), "export --model s:9", "Next: paramreduce export --model s:7"),
        (MissingConfigError("x", options=("--results", "r")), "reduce --samples s.h5", "Next: paramreduce reduce --samples s.h5 --results r"),
        (ConfigError("x", rejected="a", options=("--output", "b")), "init --dh c", "Next: paramreduce init --dh c --output b"),
        (ConfigError("x", rejected="a", options=("--output", "b")), "init --output a", "Next: paramreduce init --output b"),
        (ConfigError("x", in_file=True), "run a.yaml", "Then again: paramreduce run a.yaml"),
        (DataError("x", command="sample"), "run a.yaml", ""),
        (DataError("x"), "run a.yaml", ""),
    ],
)  # fmt: skip
def test_what_is_meant(error, typed, meant, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert suggested(error, typed) == meant


@pytest.mark.parametrize(
    ("rejected", "choices", "nearest"),
    [
        ("swap:9", ["full", "swap:2...7"], "swap:7"),
        ("swap:0", ["swap:2...7"], "swap:2"),
        ("swop:3", ["swap:2...7"], "swap:3"),
        ("swap", ["qr:4", "qr:1...7", "swap:2...7"], "swap:4"),
        ("3", ["swap:4", "qr:1...7", "swap:2...7"], "swap:3"),
        (":3", ["qr:1...7", "swap:2...7"], "qr:3"),
        ("validation:9", ["estimation:1...10", "validation:1...2"], "validation:2"),
        ("a", ["b:c...d"], "b:c...d"),
        ("swap", ["swap:1|3"], "swap:1"),
        ("swap:5", ["swap:2|4|8"], "swap:4"),
        ("4", ["swap:4", "swap:2|4|8"], "swap:4"),
        ("pareto:9", ["full", "base", "swap:1...7", "pareto:4"], "pareto:4"),
    ],
)
def test_the_nearest_choice(rejected, choices, nearest):
    assert find_nearest_choice(rejected, choices) == nearest


def test_commands_have_the_arguments_of_the_call():
    error = DataError("there is no log.h5.", command="process-log")
    assert (
        error.describe("a.yaml --set x=1")
        == "there is no log.h5. Run `paramreduce process-log a.yaml --set x=1`."
    )
    assert str(error) == "there is no log.h5. Run `paramreduce process-log CONFIG`."
