"""The stages on a log of the two-link arm with friction, whose truth is known."""

import json
import re

import h5py
import numpy as np
import pytest
from conftest import ROOT
from simulated_logs import FRICTION, log_config, two_link_log, write_log

from paramreduce_cli.artifacts.store import Store, load_file
from paramreduce_cli.config import load_config
from paramreduce_cli.records import Identification, Samples, Validation
from paramreduce_cli.running.pipeline import list_stages_to_run
from paramreduce_cli.running.runner import Runner

_LINK = '<link name="{}"><inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>'
_JOINT = '<joint name="{}" type="continuous"><parent link="{}"/><child link="{}"/><axis xyz="0 1 0"/></joint>'
TWO_JOINTS = (
    '<robot name="arm"><link name="a"/>' + _LINK.format("b") + _LINK.format("c")
    + _JOINT.format("upper", "a", "b") + _JOINT.format("fore", "b", "c") + "</robot>"
)  # fmt: skip


@pytest.fixture(scope="module")
def identification(measured_results):
    path = Store(measured_results / "results").get_path(Identification)
    return load_file(path, Identification, "two_link", "identify")[0]


def test_friction_is_what_it_was(identification):
    full = dict(zip(identification.full.names, identification.full.values, strict=True))
    deviations = dict(zip(identification.full.names, identification.full.deviations, strict=True))
    for name, truth in FRICTION.items():
        for symbol, value in zip(("fv", "fc", "off"), truth, strict=True):
            key = f"{symbol}_{'z_' if f'{symbol}_{name}' not in full else ''}{name}"
            assert abs(full[key] - value) < 4 * deviations[key] + 0.01


def test_errors_are_those_of_the_samples(identification, measured_results):
    """Anew, by plain NumPy on what samples.h5 holds."""
    path = Store(measured_results / "results").get_path(Samples)
    samples = load_file(path, Samples, "two_link", "sample")[0]
    for part, which in ((samples.estimation, "train"), (samples.validation, "held_out")):
        W = np.concatenate([b.W for b in part.iterate_blocks()])
        tau = np.concatenate([b.tau for b in part.iterate_blocks()])
        for estimate in (identification.full, identification.reduced):
            left = tau.ravel() - W @ estimate.standard
            assert getattr(estimate, which) == pytest.approx(
                np.linalg.norm(left) / np.linalg.norm(tau)
            )


def test_bodies_can_exist(identification):
    pytest.importorskip("cvxpy")
    assert identification.consistency.positive
    assert identification.consistency.held_out < 1.1 * identification.full.held_out + 1e-3


def test_a_good_log_gives_no_hints(identification):
    assert identification.hints == ()


def test_the_size_is_chosen_without_the_held_out_part(measured_copy, invoke):
    """Noise on what is held out changes errors there, and nothing else."""
    results = Store(measured_copy / "results")
    before = load_file(results.get_path(Validation), Validation, "two_link", "validate")[0]
    with h5py.File(results.get_path(Samples), "a") as file:
        file["validation/tau"][...] += np.random.default_rng(0).normal(
            size=file["validation/tau"].shape
        )
        del file["validation/tau"].attrs["checks"]
    invoke("validate", measured_copy / "arm.yaml", "--results", results.folder, "--force")
    after = load_file(results.get_path(Validation), Validation, "two_link", "validate")[0]
    assert after.selected.n == before.selected.n
    name = before.selected.heuristic
    assert np.array_equal(
        after.cross_validation[name].torque_error, before.cross_validation[name].torque_error
    )
    worse = after.heuristics[name].torque_error.validation
    assert np.all(worse > before.heuristics[name].torque_error.validation)


@pytest.mark.draws
def test_summary_and_page(measured_results):
    report = measured_results / "results" / "report"
    found = json.loads((report / "summary.json").read_text())["identification"]
    assert set(found["full"]) >= {"train", "held_out"}
    assert set(found["reduced"]) >= {"n", "train", "held_out"}
    assert found["reduced"]["held_out"] < 0.1
    page = (report / "index.html").read_text().split("<script")[0]
    assert "Identified parameters" in page
    assert "full model" not in page.lower().replace("beats the full one", "")
    for name in (
        "log-motion",
        "log-torques",
        "log-spectra",
        "measured-torques",
        "cross-validation",
    ):
        assert (report / "figures" / f"{name}.svg").exists()


@pytest.mark.parametrize("model", ["identified", "consistent"])
def test_identified_models_are_exported(model, measured_copy, invoke, tmp_path):
    if model == "consistent":
        pytest.importorskip("cvxpy")
    invoke(
        "export", measured_copy / "arm.yaml", "--results", measured_copy / "results", "--format", "python",
        "--model", model, "--output", tmp_path / "code",
    )  # fmt: skip
    assert list((tmp_path / "code").glob("*.py"))


@pytest.mark.parametrize("estimator", ["ordinary", "robust"])
def test_other_estimators_agree_on_a_good_log(estimator, measured_copy, invoke, identification):
    folder = measured_copy / "results"
    settings = [f"identification.estimator={estimator}", "identification.consistency=none"]
    invoke("identify", measured_copy / "arm.yaml", "--results", folder, settings=settings)
    found = load_file(
        Store(folder).get_path(Identification), Identification, "two_link", "identify"
    )[0]
    assert found.consistency is None
    close = np.abs(found.full.values - identification.full.values)
    assert np.all(close < 4 * identification.full.deviations + 1e-6)


def test_a_log_that_is_missing_or_wrong_is_said(tmp_path, invoke):
    path = log_config(tmp_path)
    error = invoke("run", path, "--results", tmp_path / "r", code=2).err
    assert "log.csv: there is no such file" in error
    log = two_link_log()
    log["t"] = log["t"][::-1]
    write_log(tmp_path / "log.csv", log)
    error = invoke("run", path, "--results", tmp_path / "r", code=2).err
    assert "log.csv, line 3, column t: time goes back" in error
    assert not (tmp_path / "r" / "log.h5").exists()


def test_a_log_of_which_nothing_is_left(tmp_path, invoke):
    log = two_link_log(seconds=2)
    write_log(tmp_path / "log.csv", log)
    path = log_config(tmp_path)
    settings = ["sampling.log.torque_cutoff=0.3", "sampling.log.state_cutoff=5"]
    error = invoke("run", path, "--results", tmp_path / "r", settings=settings, code=2).err
    assert "sampling.log.torque_cutoff" in error
    assert "longer than the motion" in error


@pytest.mark.parametrize(
    ("setting", "said"),
    [
        ("sampling.log.signs=[1, 2]", "signs are 1 or -1"),
        ("sampling.log.torque_constants=[0, 1]", "takes all torque away"),
        ("sampling.log.delay=-100", "is longer than"),
        ("sampling.log.units.position=degrees", "'degrees'"),
        ("sampling.log.held_out=0.99", "held_out"),
        ("selected.n=3", "cross_validation chooses n itself"),
    ],
)
def test_settings_that_cannot_be(setting, said, tmp_path, invoke):
    write_log(tmp_path / "log.csv", two_link_log(seconds=2))
    error = invoke(
        "run", log_config(tmp_path), "--results", tmp_path / "r", settings=[setting], code=2
    ).err
    assert said in error


def test_check_data(measured_results, invoke):
    log = measured_results / "log.csv"
    alone = invoke("check-data", log).out
    assert "at 200 Hz" in alone
    with_robot = invoke("check-data", log, measured_results / "arm.yaml").out
    assert "Excitation: rank" in with_robot


def test_columns_are_guessed(tmp_path, invoke):
    from conftest import ROOT

    folder = ROOT / "configs" / "logs"
    path = tmp_path / "arm.yaml"
    out = invoke(
        "init", folder / "ur10.urdf", "--log", folder / "ur10.csv.gz", "--output", path
    ).out
    assert "torque: tau{}" in out
    log = load_config(path).sampling.log
    assert (log.columns.position, log.columns.velocity) == ("q{}", "dq{}")


def test_joints_that_a_log_does_not_have_are_named(tmp_path, invoke):
    folder = ROOT / "configs/logs"
    log = ("init", folder / "panda.urdf", "--log", folder / "panda.csv.gz")
    said = " ".join(invoke(*log, "--output", tmp_path / "p.yaml").out.split())
    assert 'position: "TODO"' in (tmp_path / "p.yaml").read_text()
    (lock,) = re.findall(r"The log has 7 joints: .*? try (--lock \S+)\.", said)
    invoke(*log, *lock.split(), "--output", tmp_path / "q.yaml")
    assert "TODO" not in (tmp_path / "q.yaml").read_text().partition("sampling:")[2]


def test_a_config_is_written_for_what_is_recognised(tmp_path, invoke, monkeypatch):
    """Positions and currents of two files of one recording; what is missing is marked, and run says so."""
    monkeypatch.chdir(tmp_path)
    log = two_link_log()
    write_log(tmp_path / "states.csv", {"t": log["t"], "q1": log["q1"], "q2": log["q2"]})
    currents = {"t": log["t"][::2], "i1 [A]": log["tau1"][::2], "i2 [A]": log["tau2"][::2]}
    write_log(tmp_path / "drives.csv", currents)
    mixed = {"t": log["t"], "q1 [deg]": log["q1"], "q2 [rad]": log["q2"]}
    write_log(tmp_path / "mixed.csv", mixed | {f"tau{j}": log[f"tau{j}"] for j in (1, 2)})
    write_log(tmp_path / "odd.csv", {"q1": log["q1"], "q2": log["q2"], "foo": log["tau1"]})
    (tmp_path / "arm.urdf").write_text(TWO_JOINTS)
    invoke("init", "arm.urdf", "--log", "states.csv", "--log", "drives.csv", "--output", "a.yaml")
    text = (tmp_path / "a.yaml").read_text()
    assert 'files: [["states.csv", "drives.csv"]]' in text
    assert "torque_constants: TODO" in text
    error = invoke("process-log", "a.yaml", code=2).err
    assert "sampling.log.torque_constants: 'TODO' is not a number" in " ".join(error.split())
    said = invoke("init", "arm.urdf", "--log", "mixed.csv", "--output", "c.yaml").out
    assert "position: the units in the headings are unknown or differ" in " ".join(said.split())
    said = invoke("init", "arm.urdf", "--log", "odd.csv", "--output", "b.yaml").out
    assert "time, torque: not recognised among the columns q1, q2, foo" in " ".join(said.split())
    error = invoke("process-log", "b.yaml", settings=["sampling.log.recorded_rate=200"], code=2).err
    assert re.search(r"b.yaml, line \d+: sampling.log.columns.torque is still TODO", error)


def test_a_log_that_is_absent_is_said_before_anything_is_done(tmp_path, invoke):
    config = log_config(tmp_path)
    error = " ".join(invoke("run", config, "--results", tmp_path / "r", code=2).err.split())
    assert "log.csv: there is no such file. It is named under sampling.log.files" in error
    assert not list((tmp_path / "r").glob("*.h5"))


def test_torques_of_another_machine_are_suspected(tmp_path, invoke):
    log = two_link_log()
    rng = np.random.default_rng(3)
    for j in (1, 2):
        log[f"tau{j}"] = 10 * np.sin(np.cumsum(rng.normal(size=log["t"].size)) / 60)
    write_log(tmp_path / "log.csv", log)
    settings = ["report.formats=[svg]", "identification.consistency=none"]
    error = invoke("run", log_config(tmp_path), "--results", tmp_path / "r", settings=settings).err
    assert "of the torques unexplained: is the log of this robot" in error.replace("\n", " ")


def test_torques_in_another_unit_are_suspected(tmp_path, invoke):
    log = two_link_log()
    for j in (1, 2):
        log[f"tau{j}"] = 1000 * log[f"tau{j}"]
    write_log(tmp_path / "log.csv", log)
    settings = ["report.formats=[svg]", "identification.consistency=none"]
    error = invoke("run", log_config(tmp_path), "--results", tmp_path / "r", settings=settings).err
    assert re.search(
        r"Torques are (9\d\d|1[.\d]*e\+03) times what the parameters", error.replace("\n", " ")
    )


def test_another_heuristic_is_cross_validated_anew(measured_copy, invoke):
    folder = measured_copy / "results"
    for heuristic in ("essential", "forward-selection"):
        settings = [f"selected.heuristic={heuristic}"]
        invoke("validate", measured_copy / "arm.yaml", "--results", folder, settings=settings)
        found = load_file(Store(folder).get_path(Validation), Validation, "two_link", "validate")[0]
        assert list(found.cross_validation) == [heuristic] == [found.selected.heuristic]


def test_a_joint_whose_torque_is_not_measured(tmp_path, invoke):
    """Its column is not needed; it makes no hints, and all else is identified."""
    log = two_link_log()
    del log["tau2"]
    write_log(tmp_path / "log.csv", log)
    extra = "unmeasured: [z_fore]\n"
    path = log_config(tmp_path, extra)
    settings = ["report.formats=[svg]"]
    error = invoke("run", path, "--results", tmp_path / "r", settings=settings).err
    assert "exchanged" not in error
    said = invoke("check-data", tmp_path / "log.csv", path).out
    assert re.search(
        r"rank (\d+) of \1 base parameters", said
    )  # those that the measured torques can tell
    assert "sampling.log.signs" not in error


def test_a_joint_that_never_moves_is_told_by_rank(tmp_path, invoke):
    """Round-off of differentiated positions is no motion; its parameters are not told, and nothing stops."""
    log = two_link_log()
    log = {name: values for name, values in log.items() if not name.startswith("dq")}
    log["q2"] = np.full_like(log["q2"], 0.3)
    write_log(tmp_path / "log.csv", log)
    path = log_config(tmp_path)
    settings = ["report.formats=[svg]", "identification.consistency=none"]
    columns = "sampling.log.columns={time: t, position: 'q{}', torque: 'tau{}'}"
    said = invoke("check-data", tmp_path / "log.csv", path, settings=[columns])
    assert "rank 10 of 12 base parameters" in said.out
    error = invoke("run", path, "--results", tmp_path / "r", settings=[*settings, columns]).err
    assert "only 10 of the 12 base parameters" in " ".join(error.split())
    assert "negative" not in error


def test_folds_of_which_nothing_is_left_are_none(tmp_path, invoke):
    log = two_link_log(seconds=20)
    gone = (log["t"] > 3) & (log["t"] < 8) & (np.sin(40 * log["t"]) > 0.9)
    write_log(tmp_path / "log.csv", {key: values[~gone] for key, values in log.items()})
    settings = ["report.formats=[svg]", "sampling.log.folds=12", "identification.consistency=none"]
    invoke("run", log_config(tmp_path), "--results", tmp_path / "r", settings=settings)
    found = load_file(
        Store(tmp_path / "r").get_path(Identification), Identification, "two_link", "identify"
    )[0]
    assert 2 <= found.full.folds.size < 12
    assert found.full.folds.min() > 1e-3


def test_a_log_of_other_kinematics_is_suspected(tmp_path, invoke):
    """Base parameters take up much of it; bodies that can exist do not."""
    pytest.importorskip("cvxpy")
    write_log(tmp_path / "log.csv", two_link_log())
    path = log_config(tmp_path)
    path.write_text(path.read_text().replace("{name: fore, a: 0.5}", "{name: fore, a: 0.5, alpha: pi/2}"))  # fmt: skip
    settings = ["report.formats=[svg]"]
    error = invoke("run", path, "--results", tmp_path / "r", settings=settings).err
    assert "are the kinematics in the config right" in " ".join(error.split())


@pytest.fixture
def identify_payload(tmp_path):
    """Return the identification of a log with a tool of 0.7 kg, whose parameters the config does not know."""

    def identify(settings=()):
        tool = "payloads.tool={body: fore, m: 0.7, com: [0.3, 0.05, 0], inertia_com: [0, 0, 0, 0, 0, 0.01]}"
        write_log(tmp_path / "log.csv", two_link_log(settings=[tool]))
        extra = "payloads: {tool: {body: fore}}\nidentification: {payloads: [tool], consistency: none}\n"
        config = load_config(
            log_config(tmp_path, extra), [*settings, "reduction.heuristics=[essential]"]
        )
        store = Store(tmp_path / "results")
        for stage in list_stages_to_run(config):
            Runner(config, store).run(stage)
            if stage.name == "identify":
                break
        return load_file(store.get_path(Identification), Identification, "two_link", "identify")[0]

    return identify


def test_a_payload_alone_is_identified(identify_payload):
    """Against the truth. In a plane, mass, centre of mass and one inertia can be told."""
    found = identify_payload()
    payload = found.payload
    inertia = 0.01 + 0.7 * (0.3**2 + 0.05**2)
    truth = {"m_tool": 0.7, "mx_tool": 0.7 * 0.3, "my_tool": 0.7 * 0.05, "Izz_tool": inertia}
    values = dict(zip(payload.names, payload.values, strict=True))
    widths = dict(zip(payload.names, payload.half_widths, strict=True))
    assert {name for name in values if name.endswith("_tool")} == set(truth)
    for name, value in truth.items():
        assert abs(values[name] - value) < 2 * widths[name] + 1e-3
        assert widths[name] < 0.1
    assert payload.held_out < 1.1 * found.full.held_out
    assert found.hints == ()


def test_wrong_values_of_the_arm_are_hinted_at(identify_payload):
    found = identify_payload(["parameter_sets.slender_rods.upper.m=4"])
    assert any("values of the other bodies do not fit" in text for text in found.hints)


def test_an_unknown_payload_is_said(tmp_path, invoke):
    path = log_config(tmp_path, "identification: {payloads: [tool]}\n")
    error = invoke("run", path, "--results", tmp_path / "r", code=2).err
    assert "identification.payloads" in error
    assert "tool" in error
