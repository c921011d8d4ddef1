"""Calls that are mended from what an error says."""

import pytest

from paramreduce_cli.cli.corrections import corrected


def test_results_that_are_not_there_are_made_with_their_config(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    message = "results/arm/validation.h5: there is no such file."
    assert corrected(message, ["inspect", "results/arm"]) == ""
    (tmp_path / "configs").mkdir()
    (tmp_path / "configs" / "arm.yaml").write_text("")
    assert corrected(message, ["inspect", "results/arm"]) == "paramreduce run configs/arm.yaml"


@pytest.mark.parametrize(
    ("message", "typed", "meant"),
    [
        ("a.yaml: there is no such file. Did you mean b.yaml?", "run a.yaml --jobs 2", "run b.yaml --jobs 2"),
        ("a.yaml: there is no such file. Did you mean my arm.yaml?", "run c.yaml", None),
        ("--set x.m=4: x.m: key 'm' is not known; did you mean n?", "run a.yaml --set x.m=4", "run a.yaml --set x.n=4"),
        ("--set m.m=m: m.m: 'm' is not known; did you mean n?", "run --set m.m=m", "run --set m.m=n"),
        ("--set m=[a,sw]: m.1: 'sw' is not known; did you mean swap?", "run --set m=[a,sw]", "run --set 'm=[a,swap]'"),
        ("--set m=[sw,sw-a]: m.0: 'sw' is not known; did you mean b?", "run --set m=[sw,sw-a]", "run --set 'm=[b,sw-a]'"),
        ("--set m=: m: '' is not known; did you mean n?", "run --set m=", "run --set m=n"),
        ("--model swap:9: there is full, swap:2...7.", "export --model swap:9", "export --model swap:7"),
        ("--model swap:0: there is swap:2...7; with a log also identified.", "export --model swap:0", "export --model swap:2"),
        ("--model swop:3: there is swap:2...7.", "export --model swop:3", "export --model swap:3"),
        ("--results: say where, such as --results results/x.", "reduce --samples s.h5", "reduce --samples s.h5 --results results/x"),
        ("a.yaml, line 3: robot is missing.", "run a.yaml", "run a.yaml"),
        ("--which validation:9: there is estimation:1...10, validation:1...2.",
         "export-trajectory --which validation:9", "export-trajectory --which validation:2"),
        ("--which a: there is b:c...d.", "export-trajectory --which a", "export-trajectory --which b:c...d"),
        ("something else is wrong.", "run a.yaml", None),
    ],
)  # fmt: skip
def test_what_is_meant(message, typed, meant):
    expected = "" if meant is None else f"paramreduce {meant}"
    assert corrected(message, typed.split()) == expected
