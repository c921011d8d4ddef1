import contextlib
import signal
import warnings

import h5py
import pytest
from conftest import config_of, run_stages

from paramreduce_cli.artifacts.store import Store, get_file, load_file
from paramreduce_cli.cli.terminal import Interruption
from paramreduce_cli.errors import ArtifactError, ParamreduceWarning
from paramreduce_cli.records import Part, Reduction
from paramreduce_cli.reduction.best_subset.proofs import ProofSearch
from paramreduce_cli.running.pipeline import list_stages, list_stages_to_run
from paramreduce_cli.running.runner import Callbacks, Runner

ORDER = [
    "process-log", "build-model", "optimize-trajectories", "sample", "reduce", "reduce-terms", "validate", "identify", "report",
]  # fmt: skip
STAGES = {stage.name: stage for stage in list_stages()}


def test_order_follows_from_the_signatures():
    assert list(STAGES) == ORDER


def test_nothing_is_done_twice(two_link_copy):
    before = {p: p.stat().st_mtime_ns for p in two_link_copy.glob("*.h5")}
    assert all(run_stages(two_link_copy).values())
    assert all(p.stat().st_mtime_ns > t for p, t in before.items())  # touched, so that Make agrees


@pytest.mark.parametrize(
    ("override", "redone"),
    [
        ("report.title=Other", ["report"]),
        ("selected.n=5", ["validate", "report"]),
        ("sampling.points=50", ["sample", "reduce", "validate", "report"]),
        ("trajectories.starts=2", ORDER[2:]),
        ("model.rank_tolerance=1e-8", ORDER[1:]),
    ],
)
def test_a_change_redoes_what_depends_on_it(two_link_copy, override, redone):
    current = run_stages(two_link_copy, override)
    again = [name for name, is_current in current.items() if not is_current]
    # What was rebuilt to the same content stops the chain, so a superset may be left alone.
    assert set(again) <= set(redone)
    assert again[0] == redone[0]
    assert all(run_stages(two_link_copy, override).values())


def test_a_search_for_proofs_that_ctrl_c_ended_is_gone_on_with(two_link_copy, monkeypatch):
    path = two_link_copy / "reduction.h5"
    digest = Store(two_link_copy).read_stamp(Reduction).digest
    path.unlink()

    def ended(*_):
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(ProofSearch, "_round", ended)
        with pytest.warns(ParamreduceWarning, match="are proven"):
            current = run_stages(two_link_copy)
    assert not current["reduce"]
    stamp = Store(two_link_copy).read_stamp(Reduction)
    assert stamp.cut_short
    assert stamp.digest != digest
    assert not run_stages(two_link_copy)["reduce"]
    assert Store(two_link_copy).read_stamp(Reduction).digest == digest
    assert all(run_stages(two_link_copy).values())


def test_a_kill_ends_more_than_a_search_for_proofs(two_link_copy, monkeypatch):
    (two_link_copy / "reduction.h5").unlink()
    interruption = Interruption()

    def killed(*_):
        interruption._note(signal.SIGTERM, None)

    monkeypatch.setattr(ProofSearch, "_round", killed)
    runner = Runner(
        config_of("two_link"),
        Store(two_link_copy),
        callbacks=Callbacks(interrupted=interruption.clear),
    )
    with pytest.raises(KeyboardInterrupt):
        runner.run(STAGES["reduce"])
    assert not (two_link_copy / "reduction.h5").exists()


def test_ctrl_c_while_the_selection_is_repeated_ends_the_stage(two_link_copy, monkeypatch):
    """There is nothing worth keeping; a spoilt validation would count as current."""
    (two_link_copy / "validation.h5").unlink()

    def ended(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(ProofSearch, "_round", ended)
    config = config_of("two_link", "selected.heuristic=best-subset")
    with pytest.raises(KeyboardInterrupt):
        Runner(config, Store(two_link_copy)).run(STAGES["validate"])
    assert not (two_link_copy / "validation.h5").exists()


def test_what_a_stage_has_warned_of_is_said_again_when_it_is_up_to_date(two_link_copy):
    (two_link_copy / "reduction.h5").unlink()
    overrides = ("reduction.best_subset.time_limit=0", "reduction.heuristics=[best-subset]")
    said = []
    runner = Runner(
        config_of("two_link", *overrides, "selected.heuristic=best-subset"),
        Store(two_link_copy),
        callbacks=Callbacks(warn=said.append),
    )
    with pytest.warns(ParamreduceWarning, match="sizes are proven"):
        assert not runner.run(STAGES["reduce"]).current
    assert runner.run(STAGES["reduce"]).current
    (again,) = said
    assert "sizes are proven" in again


def test_a_share_that_ctrl_c_cut_short_is_gone_on_with(two_link_copy, monkeypatch):
    (two_link_copy / "reduction.h5").unlink()
    runner, share = Runner(config_of("two_link"), Store(two_link_copy)), Part(1, 2)

    def ended(*_):
        raise KeyboardInterrupt

    with monkeypatch.context() as patch, warnings.catch_warnings():
        warnings.simplefilter("ignore", ParamreduceWarning)
        patch.setattr(ProofSearch, "_round", ended)
        assert not runner.run(STAGES["reduce"], part=share).current
    assert not runner.run(STAGES["reduce"], part=share).current
    assert runner.run(STAGES["reduce"], part=share).current


def test_what_a_swallowed_interruption_may_have_spoilt_is_not_written(two_link_copy, monkeypatch):
    (two_link_copy / "reduction.h5").unlink()
    interruption = Interruption()

    def swallowed(self):
        with contextlib.suppress(KeyboardInterrupt):
            interruption._note(signal.SIGINT, None)

    monkeypatch.setattr(ProofSearch, "_compile", swallowed)
    runner = Runner(
        config_of("two_link"),
        Store(two_link_copy),
        callbacks=Callbacks(interrupted=interruption.clear, check=interruption.check),
    )
    with pytest.raises(KeyboardInterrupt):
        runner.run(STAGES["reduce"])
    assert not (two_link_copy / "reduction.h5").exists()


def test_a_lost_or_foreign_artifact_is_made_again(two_link_copy):
    (two_link_copy / "samples.h5").unlink()
    (two_link_copy / "model.h5").write_bytes(b"garbage")
    current = run_stages(two_link_copy)
    assert not current["build-model"]
    assert not current["sample"]
    assert current["optimize-trajectories"]


@pytest.mark.parametrize(("attribute", "value"), [("schema", 0), ("paramreduce_version", "0.0.0")])
def test_another_version_or_schema_is_made_again_by_run(two_link_copy, attribute, value):
    with h5py.File(two_link_copy / "model.h5", "a") as file:
        file.attrs[attribute] = value
    assert not run_stages(two_link_copy)["build-model"]


def test_a_stage_that_fails_leaves_everything_as_it_was(two_link_copy):
    paths = [two_link_copy / get_file(s.output) for s in list_stages_to_run(config_of("two_link"))]
    before = [path.read_bytes() for path in paths]
    config = config_of("two_link", "selected.n=20")
    with pytest.raises(Exception, match=r"selected\.n is 20"):
        Runner(config, Store(two_link_copy)).run(STAGES["validate"])
    assert [path.read_bytes() for path in paths] == before


def test_what_is_not_this_robots_is_never_overwritten(two_link_copy):
    before = {p: p.read_bytes() for p in two_link_copy.glob("*.h5")}
    with pytest.raises(ArtifactError, match="belongs to the robot two_link"):
        Runner(config_of("puma560"), Store(two_link_copy)).run(STAGES["build-model"])
    own = two_link_copy / "samples.h5"
    with h5py.File(own, "w") as file:
        file["estimation/W"] = [[1.0]]
    with pytest.raises(ArtifactError, match="was not made by paramreduce"):
        Runner(config_of("two_link"), Store(two_link_copy)).run(STAGES["sample"])
    assert all(p.read_bytes() == content for p, content in before.items() if p != own)


def test_a_report_with_a_file_missing_is_made_again(two_link_copy):
    (two_link_copy / "report" / "index.html").unlink()
    assert not run_stages(two_link_copy)["report"]
    assert (two_link_copy / "report" / "index.html").exists()


def test_files_of_a_former_report_are_removed(two_link_copy):
    run_stages(two_link_copy, "report.formats=[png]")
    kinds = {p.suffix for p in (two_link_copy / "report" / "figures").iterdir()}
    assert kinds == {".png"}


def test_new_limits_are_judged_without_measuring_again(two_link_copy, monkeypatch):
    def measured_again(*_):
        raise AssertionError("measured again")

    monkeypatch.setattr(
        "paramreduce_cli.stages.validate.compute_acceleration_errors", measured_again
    )
    stage, store = STAGES["validate"], Store(two_link_copy)
    before, _ = load_file(store.get_path(stage.output), stage.output, None, "")
    config = config_of("two_link", "validation.accept.torque_error_validation=1e-6")
    judged = Runner(config, store).run(stage).record
    assert judged.accepted is False
    assert judged.heuristics.keys() == before.heuristics.keys()
    assert judged.stability.variants == before.stability.variants
    with pytest.raises(AssertionError, match="measured again"):
        Runner(config, store).run(stage, force=True)
    config = config_of("two_link", "validation.operations=independent")
    with pytest.raises(AssertionError, match="measured again"):
        Runner(config, store).run(stage)
