"""Results of another config in the same folder, and examples of commands that name the config at hand."""

from conftest import TWO_LINK

QUICK = (
    "trajectories.count=1",
    "trajectories.test_count=0",
    "trajectories.starts=1",
    "trajectories.polished=1",
)


def test_results_of_another_config_are_not_replaced_without_a_word(invoke, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    text = TWO_LINK.read_text()
    for name, count in (("one", 1), ("two", 2)):
        (tmp_path / f"{name}.yaml").write_text(text.replace("  count: 2", f"  count: {count}"))
    said = invoke("run", "one.yaml", settings=QUICK[1:]).err
    assert "holds results of" not in said
    said = " ".join(invoke("run", "two.yaml", settings=QUICK[1:]).err.split())
    assert (
        "results/two_link holds results of one.yaml. Results of two.yaml replace them from optimize-trajectories on"
        in said
    )
    assert "change robot: in one config" in said
    (tmp_path / "two.yaml").write_text(text.replace("  count: 2", "  count: 1"))
    said = invoke("run", "two.yaml", settings=QUICK[1:]).err
    assert "holds results of one.yaml" not in said, "an edited config replaces its own results"


def test_examples_name_the_config_at_hand(invoke, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "configs").mkdir()
    for name in ("another", "zebra"):
        (tmp_path / "configs" / f"{name}.yaml").write_text(TWO_LINK.read_text())
    refused = invoke("identify", "configs/zebra.yaml", code=2).err
    assert "another" not in refused
    assert "configs/zebra.yaml" in refused
