"""Items of stages: whatever jobs do them, and whenever, what is combined is what one job makes."""

import shutil

import h5py
import numpy as np
import pytest
from conftest import ONE_FORMAT, TWO_LINK, config_of

from paramreduce_cli.artifacts.store import Store
from paramreduce_cli.errors import DataError, ParamreduceWarning
from paramreduce_cli.multibody import observation
from paramreduce_cli.records import (
    Items,
    Part,
    ProofItem,
    Proofs,
    ProofStatus,
    Reduction,
    Samples,
    TermReduction,
    Trajectories,
)
from paramreduce_cli.reduction.best_subset.kept_proofs import KeptProofs
from paramreduce_cli.running.pipeline import list_stages, list_stages_to_run
from paramreduce_cli.running.runner import Callbacks, Runner

STAGES = {stage.name: stage for stage in list_stages()}
SHARED = ("optimize-trajectories", "sample", "reduce", "reduce-terms")


def digest(folder, name):
    with h5py.File(folder / name) as file:
        return file.attrs["digest"]


def run_in_parts(folder, count):
    """Run everything, the stages that can be as several jobs, the last of them first."""
    runner = Runner(config_of("two_link", ONE_FORMAT), Store(folder))
    for stage in list_stages_to_run(runner.config)[:-1]:  # the page tells nothing new
        if stage.has_items:
            for number in range(count, 0, -1):
                runner.run(stage, part=Part(number, count))
        runner.run(stage)


def test_stages_that_are_done_in_parts():
    assert tuple(name for name, stage in STAGES.items() if stage.has_items) == SHARED


def test_parts_make_what_one_job_makes(two_link_results, tmp_path):
    """To the digest of all numbers, in whatever order the jobs are done."""
    run_in_parts(tmp_path, 3)
    for name in ("trajectories.h5", "samples.h5", "reduction.h5", "validation.h5"):
        assert digest(tmp_path, name) == digest(two_link_results, name)
    assert not list(tmp_path.glob("*.items"))


def test_more_parts_than_trajectories_make_what_one_job_makes(two_link_results, tmp_path):
    long = ["sampling.points=9000"]  # in two blocks
    runner = Runner(config_of("two_link", ONE_FORMAT, *long), Store(tmp_path))
    for name in ("model.h5", "trajectories.h5"):
        shutil.copy(two_link_results / name, tmp_path / name)
    runner.run(STAGES["sample"])
    whole = digest(tmp_path, "samples.h5")
    runner.store.get_path(Samples).unlink()
    for number in range(1, 6):
        runner.run(STAGES["sample"], part=Part(number, 5))
    runner.run(STAGES["sample"])
    assert digest(tmp_path, "samples.h5") == whole


def test_parts_of_loops_are_whole_trajectories(tmp_path):
    few = ["trajectories.count=2", "trajectories.test_count=1", "trajectories.starts=1", "trajectories.polished=1",
           "trajectories.points=30"]  # fmt: skip
    runner = Runner(config_of("four_bar", *few), Store(tmp_path))
    for name in ("build-model", "optimize-trajectories", "sample"):
        runner.run(STAGES[name])
    whole = digest(tmp_path, "samples.h5")
    runner.store.get_path(Samples).unlink()
    for number in (1, 2):
        runner.run(STAGES["sample"], part=Part(number, 2))
    runner.run(STAGES["sample"])
    assert digest(tmp_path, "samples.h5") == whole


def test_parts_of_one_recording(two_link_results, tmp_path, monkeypatch):
    """A recording is cut anywhere; its triangular factor is combined from those of the pieces."""
    monkeypatch.setattr(observation, "PIECE_SAMPLES", 2 * observation.BLOCK_SAMPLES)
    with h5py.File(two_link_results / "samples.h5") as file:
        found = file["estimation"]
        z, dz, ddz, tau = (np.tile(found[key][:], (9, 1)) for key in ("z", "dz", "ddz", "tau"))
    recording = tmp_path / "recording.h5"
    with h5py.File(recording, "w") as file:
        file["time"] = np.arange(len(z)) / 100
        file["z"], file["dz"], file["ddz"], file["tau"] = z, dz, ddz, tau
    given = [f"sampling.estimation_file={recording}", f"sampling.validation_file={recording}",
             "validation.accept={}"]  # fmt: skip
    runner = Runner(config_of("two_link", *given), Store(tmp_path / "r"))
    runner.run(STAGES["build-model"])
    runner.run(STAGES["sample"])
    path = runner.store.get_path(Samples)
    with h5py.File(path) as file:
        whole = {name: file[f"estimation/{name}"][:] for name in ("W", "tau", "factors", "time")}
    path.unlink()
    for number in range(1, 5):
        runner.run(STAGES["sample"], part=Part(number, 4))
    runner.run(STAGES["sample"])
    with h5py.File(path) as file:
        for name in ("W", "tau", "time"):
            assert np.array_equal(file[f"estimation/{name}"][:], whole[name])
        one, other = file["estimation/factors"][:], whole["factors"]
    squared = [np.einsum("tjki,tjkl->tjil", factor, factor) for factor in (one, other)]
    np.testing.assert_allclose(
        squared[0], squared[1], rtol=0, atol=1e-12 * np.abs(other).max() ** 2
    )


def test_functions_whose_terms_are_reduced_by_several_jobs(two_link_results, tmp_path):
    rough = ["terms.torque_error=0.5", "terms.acceleration_error=2", "terms.rounds=0"]
    for name in ("model.h5", "trajectories.h5", "samples.h5", "reduction.h5"):
        shutil.copy(two_link_results / name, tmp_path / name)
    runner = Runner(config_of("two_link", ONE_FORMAT, *rough), Store(tmp_path))
    runner.run(STAGES["reduce-terms"])
    whole = digest(tmp_path, "terms.h5")
    runner.store.get_path(TermReduction).unlink()
    for number in (1, 2, 3):  # one more than there are functions
        runner.run(STAGES["reduce-terms"], part=Part(number, 3))
    runner.run(STAGES["reduce-terms"])
    assert digest(tmp_path, "terms.h5") == whole


def test_what_jobs_were_warned_of_is_said_of_the_whole(two_link_results, tmp_path):
    rough = ["terms.torque_error=0.5", "terms.functions=[inverse]", "terms.time_limit=1e-9"]
    for name in ("model.h5", "trajectories.h5", "samples.h5", "reduction.h5"):
        shutil.copy(two_link_results / name, tmp_path / name)
    told = []
    runner = Runner(
        config_of("two_link", ONE_FORMAT, *rough),
        Store(tmp_path),
        callbacks=Callbacks(warn=told.append),
    )
    with pytest.warns(ParamreduceWarning, match="time_limit"):
        runner.run(STAGES["reduce-terms"], part=Part(1, 2))
    assert not told
    runner.run(STAGES["reduce-terms"])
    (text,) = runner.store.read_stamp(TermReduction).warnings
    assert "terms.time_limit ended the search" in text
    assert told == [text]


@pytest.fixture(scope="module")
def both_parts(tmp_path_factory):
    """A folder with both parts of the samples; look, do not touch."""
    folder = tmp_path_factory.mktemp("parts")
    runner = Runner(config_of("two_link"), Store(folder))
    for name in ("build-model", "optimize-trajectories"):
        runner.run(STAGES[name])
    for number in (1, 2):
        runner.run(STAGES["sample"], part=Part(number, 2))
    return folder


@pytest.fixture
def sampled(both_parts, tmp_path):
    """Both parts of the samples, and a runner to put them together."""
    shutil.copytree(both_parts, tmp_path, dirs_exist_ok=True)
    return Runner(config_of("two_link"), Store(tmp_path)), tmp_path / "samples.h5.items"


def test_a_part_that_is_done_is_not_done_again(sampled):
    runner, _ = sampled
    assert runner.run(STAGES["sample"], part=Part(1, 2)).current
    assert not runner.run(STAGES["sample"], part=Part(1, 2), force=True).current


def test_what_is_missing_is_done_with_what_is_combined(sampled, both_parts):
    runner, folder = sampled
    kept = sorted(path.name for path in folder.glob("*.h5"))
    runner.run(STAGES["sample"])
    whole = digest(folder.parent, "samples.h5")
    runner.store.get_path(Samples).unlink()
    shutil.copytree(both_parts / folder.name, folder)
    for name in kept[:3]:
        (folder / name).unlink()
    runner.run(STAGES["sample"])
    assert digest(folder.parent, "samples.h5") == whole
    assert not folder.exists()


def test_items_are_done_again_by_force_alone(sampled):
    runner, folder = sampled
    path = folder / "estimation-000000.h5"
    with h5py.File(path, "a") as file:
        file.attrs["wall_seconds"] = 1000.0
    runner.run(STAGES["sample"], force=True)
    assert runner.store.read_stamp(Samples).seconds < 1000


def test_what_is_put_together_has_taken_as_long_as_its_parts(sampled):
    runner, folder = sampled
    parts = 0.0
    for path in folder.glob("*.h5"):
        with h5py.File(path, "a") as file:
            file.attrs["wall_seconds"] = 100.0
            parts += 100.0
    runner.run(STAGES["sample"])
    assert parts < runner.store.read_stamp(Samples).seconds < parts + 60


def test_a_damaged_item_is_done_again(sampled):
    runner, folder = sampled
    path = folder / "estimation-000000.h5"
    with h5py.File(path) as file:
        first = file["item/tau"][0].tobytes()
    content = bytearray(path.read_bytes())
    content[content.index(first)] ^= 1
    path.write_bytes(content)
    assert not runner.run(STAGES["sample"], part=Part(1, 2)).current
    assert runner.run(STAGES["sample"], part=Part(1, 2)).current
    runner.run(STAGES["sample"])
    assert runner.store.get_path(Samples).exists()
    assert not folder.exists()


def test_parts_of_another_config_are_of_no_concern(sampled, tmp_path):
    _, folder = sampled
    other = Runner(config_of("two_link", "sampling.points=60"), Store(tmp_path))
    other.run(STAGES["sample"])
    with h5py.File(other.store.get_path(Samples)) as file:
        assert len(file["estimation/tau"]) == 120
    assert not folder.exists()


def test_proofs_of_parts_are_those_of_their_sizes(tmp_path):
    """Each part proves its own sizes alone; together all are proven."""
    runner = Runner(config_of("two_link"), Store(tmp_path))
    for name in ("build-model", "optimize-trajectories", "sample"):
        runner.run(STAGES[name])
    folder = tmp_path / "reduction.h5.items"
    for number in (1, 2):
        assert not runner.run(STAGES["reduce"], part=Part(number, 2)).current
        own = {f"n-{n:04d}.h5" for n in range(number, 8, 2)}
        assert {path.name for path in folder.glob("n-*.h5")} >= own
    assert runner.run(STAGES["reduce"], part=Part(3, 4)).current, "whoever has done the sizes"
    assert {path.name for path in folder.glob("n-*.h5")} == {f"n-{n:04d}.h5" for n in range(1, 8)}
    assert set(runner.run(STAGES["reduce"]).record.proofs.status) == {"optimal", "beyond-rank"}
    assert runner.store.get_path(Reduction).exists()
    assert runner.store.get_path(Trajectories).exists()


def test_proofs_of_subtrees_make_what_one_job_makes(two_link_results, tmp_path):
    """Every job takes a part in every proof; what it is told is gone when all is put together."""
    runner = Runner(config_of("two_link", "reduction.best_subset.parts=subtrees"), Store(tmp_path))
    for name in ("build-model", "optimize-trajectories", "sample"):
        runner.run(STAGES[name])
    for number in (1, 2):
        runner.run(STAGES["reduce"], part=Part(number, 2))
    runner.run(STAGES["reduce"])
    assert digest(tmp_path, "reduction.h5") == digest(two_link_results, "reduction.h5")
    assert not list(tmp_path.glob("*.items"))


def test_shares_of_a_proof_hold_together_alone():
    """Parts of other last digits are left out where they are proofs of their own sizes, and missed else."""
    factor = np.eye(3)
    both = [shared_proofs(factor), shared_proofs(factor * (1 + 1e-16) + 1e-16)]

    def load(*found, key="subtrees-{:04d}-of-0002"):
        kept = {key.format(k): one for k, one in enumerate(found, 1)}
        return KeptProofs(Items(kept), factor, by_subtrees=True).load(None)

    with pytest.raises(DataError, match=r"1 of the 2 parts are of samples .* other last digits"):
        load(*both)
    with pytest.raises(DataError, match=r"1 of the 2 parts .* missing. .*--part \(2/2\)"):
        load(both[0])
    assert load(both[0], both[0]).nodes.tolist() == [2]
    assert load(*both, key="n-{:04d}").nodes.tolist() == [1]


def test_jobs_that_are_complete_count_whatever_others_have_begun():
    item = shared_proofs(np.eye(3))
    kept = {f"subtrees-{k:04d}-of-0002": item for k in (1, 2)}
    kept["subtrees-0001-of-0003"] = item
    with pytest.warns(ParamreduceWarning, match=r"2 of the 3 parts .* are missing"):
        found = KeptProofs(Items(kept), np.eye(3), by_subtrees=True).load(None)
    assert found.nodes.tolist() == [2]


@pytest.mark.parametrize("other", [False, True])
def test_a_job_is_finished_where_sizes_have_no_subset_and_factors_are_equal(other):
    items = Items({}, Part(1, 1))
    kept = KeptProofs(items, np.eye(3), by_subtrees=False)
    assert not kept.is_finished([1, 2])
    kept.keep(shared_proofs(np.eye(3)).proofs, [1, 2])
    assert kept.is_finished([1, 2])
    assert kept.load(None).n.tolist() == [1]
    again = KeptProofs(items, np.eye(3) * (1 + other * 1e-15), by_subtrees=False)
    assert again.is_finished([1, 2]) is not other


def shared_proofs(factor, dealt=5):
    one = np.ones(1)
    proofs = Proofs(
        units=(np.arange(1),), n=np.array([1]), subsets=(np.arange(1),), torque_error=one,
        lower_bound=one, status=(ProofStatus.OPTIMAL,), seconds=one, nodes=np.array([1]),
        logs=(np.zeros(0, int),), dealt=np.array([dealt]),
    )  # fmt: skip
    return ProofItem(factor, proofs)


@pytest.mark.parametrize(
    ("text", "says"),
    [("3", "form 3/8"), ("a/b", "form 3/8"), ("0/4", "count from 1"), ("5/4", "count from 1")],
)
def test_what_is_no_part(invoke, tmp_path, text, says):
    refused = invoke("sample", TWO_LINK, "--results", tmp_path, "--part", text, code=2)
    assert says in refused.err


def test_what_cannot_be_done_in_parts(invoke, tmp_path, measured_copy):
    call = ("--results", tmp_path / "r", "--part", "1/2")
    assert "there is no option --part" in invoke("build-model", TWO_LINK, *call, code=2).err
    log = (next(measured_copy.glob("*.yaml")), "--results", measured_copy / "results")
    assert "sampled as a whole" in invoke("sample", *log, "--part", "1/2", "--force", code=2).err


@pytest.mark.parametrize("count", [1, 3, 7, 12])
def test_parts_are_everything_once(count):
    items = list(range(10))
    parts = [Part(number, count) for number in range(1, count + 1)]
    assert sorted(item for part in parts for item in part.select(items)) == items
    assert all(Part.parse(str(part)) == part for part in parts)
