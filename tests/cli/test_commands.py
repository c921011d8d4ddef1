import json
import re
import shutil
import sys
import types

import h5py
import pytest
from conftest import CONFIGS, ONE_FORMAT, TWO_LINK, summary_of

from paramreduce_cli.artifacts.store import Store, load_file
from paramreduce_cli.config import load_config
from paramreduce_cli.errors import DataError
from paramreduce_cli.records import Identification, Model, Reduction
from paramreduce_cli.reduction.models import make_reduced_model
from paramreduce_cli.running.pipeline import list_stages, list_stages_to_run

STAGES = [stage.name for stage in list_stages()]
USUAL = [stage.name for stage in list_stages_to_run(load_config(TWO_LINK))]
COMMANDS = [*STAGES, "run", "schema", "init", "inspect", "compare", "table", "graph", "export"]


def test_help_names_every_command(invoke):
    out = invoke("--help").out
    for command in COMMANDS:
        assert f"  {command} " in out


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_explains_itself(invoke, command):
    out = invoke(command, "--help").out.replace("\n  ", " ")
    assert f"Example: paramreduce {command}" in out
    assert command not in STAGES or re.search(r"Reads .*; writes", out)


@pytest.mark.draws
def test_a_full_run_ends_with_a_table_and_the_report(invoke, tmp_path):
    run = ("run", TWO_LINK, "--results", tmp_path / "r")
    out, err = invoke(*run, "--jobs", 2, "--verbose", settings=[ONE_FORMAT])
    assert "forward-selection" in out
    assert f"Report: {tmp_path / 'r' / 'report' / 'index.html'}" in out
    assert "validation-0000: kappa" in err
    assert invoke(*run, "--quiet", settings=[ONE_FORMAT]) == ("", "")


def test_stages_one_by_one_and_again(invoke, tmp_path):
    for again in (False, True):
        for stage in USUAL:
            command = (stage, TWO_LINK, "--results", tmp_path)
            done = invoke(*command, settings=["trajectories.starts=1", ONE_FORMAT])
            assert ("up to date" in done.out) == again


def test_not_accepted_is_exit_code_1_with_the_sentence(invoke, two_link_copy, write_config):
    path = write_config(("torque_error_test: 0.05", "torque_error_test: 1e-4"))
    sentence = "forward-selection with 4 parameters is not accepted: torque error test"
    refused = invoke("validate", path, "--results", two_link_copy, code=1)
    assert f"Not accepted: {sentence}" in refused.err
    invoke("run", path, "--results", two_link_copy, settings=[ONE_FORMAT], code=1)
    assert (two_link_copy / "report" / "summary.json").exists()
    invoke("validate", path, "--results", two_link_copy, code=1)  # also when up to date


def test_stages_without_their_inputs_say_what_to_run(invoke, tmp_path):
    reduce = ("reduce", TWO_LINK, "--results", tmp_path)
    assert "paramreduce build-model" in invoke(*reduce, code=2).err
    invoke("build-model", TWO_LINK, "--results", tmp_path)
    assert "paramreduce sample" in invoke(*reduce, code=2).err


def test_an_older_schema_is_refused_by_stages_and_rebuilt_by_run(invoke, two_link_copy):
    with h5py.File(two_link_copy / "model.h5", "a") as file:
        file.attrs["schema"] = 0
    refused = invoke("sample", TWO_LINK, "--results", two_link_copy, "--force", code=2)
    assert "paramreduce run" in refused.err
    invoke("run", TWO_LINK, "--results", two_link_copy, "--quiet", settings=[ONE_FORMAT])


def test_stale_inputs_are_warned_of(invoke, two_link_copy):
    done = invoke("reduce", TWO_LINK, "--results", two_link_copy, settings=["sampling.points=50"])
    assert "samples.h5 was made with another sampling section" in done.err


def test_so_is_what_they_were_made_from(invoke, two_link_copy):
    done = invoke(
        "reduce", TWO_LINK, "--results", two_link_copy, settings=["trajectories.harmonics=1"]
    )
    assert "trajectories.h5 was made with another trajectories section" in done.err
    assert done.err.count("was made with") == 1


def test_wrong_config_is_exit_code_2_and_leaves_artifacts_alone(
    invoke, two_link_copy, write_config
):
    before = {p: p.read_bytes() for p in two_link_copy.rglob("*") if p.is_file()}
    path = write_config(("count: 2", "count: 0"))
    refused = invoke("run", path, "--results", two_link_copy, code=2)
    assert f"Error: {path}, line 20: trajectories.count" in refused.err
    assert all(p.read_bytes() == content for p, content in before.items())


def test_a_folder_in_use(invoke, two_link_copy):
    with Store(two_link_copy).lock():
        refused = invoke("run", TWO_LINK, "--results", two_link_copy, code=2)
    assert "another run is using this folder" in refused.err


def test_anothers_robot_folder(invoke, two_link_copy, write_config):
    path = write_config(("robot: two_link", "robot: other"))
    refused = invoke("reduce", path, "--results", two_link_copy, code=2)
    assert "belongs to the robot two_link" in refused.err


@pytest.mark.parametrize("name", ["mz_upper", "Iyy_fore"])
def test_named_base_columns_that_are_none(invoke, tmp_path, name):
    build = ("build-model", TWO_LINK, "--results", tmp_path)
    assert name in invoke(*build, settings=[f"model.base_columns=[{name}]"], code=2).err


@pytest.mark.draws
def test_arms_of_one_joint_get_their_report(invoke, tmp_path, write_config):
    """Nothing but an inertia about a vertical axis: its mass matrix costs no operation."""
    path = write_config(
        ("  gravity: [0, -9.81, 0]", "  gravity: [0, 0, -9.81]"),
        ("      - {name: fore, a: 0.5}\n", ""),
        ("    fore: {m: 1.0, com: [0.2, 0.01, 0], inertia_com: [5e-4, 0, 0, 0.0135, 0, 0.0135]}\n", ""),
        ("nominal_torque: [20, 5]", "nominal_torque: 20"),
        ("  n: 4", "  n: 1"),
    )  # fmt: skip
    invoke("run", path, "--results", tmp_path / "r", "--quiet", settings=[ONE_FORMAT])


def test_compare_tells_what_differs(invoke, two_link_copy, tmp_path):
    summary = summary_of(two_link_copy)
    summary["validation"]["qr"][1]["operations"]["inverse"] += 1
    assert summary.pop("provenance")  # whose digest would not fit
    other = tmp_path / "other.json"
    other.write_text(json.dumps(summary))
    compare = ("compare", two_link_copy, other)
    assert "operations.inverse, qr, n = 2" in invoke(*compare, code=1).out
    invoke(*compare, "--only", "kappa")
    invoke("compare", two_link_copy, tmp_path / "none.json", code=2)
    assert "kappa" in invoke(*compare, "--tolerance", "speed=1", code=2).err
    for none in ("kappa=-1", "kappa=nan"):
        assert "of 0 or more" in invoke(*compare, "--tolerance", none, code=2).err


def test_inspect_shows_the_selected_model(invoke, two_link_results):
    shown = invoke("inspect", two_link_results).out
    for place in (two_link_results, two_link_results / "reduction.h5"):
        assert invoke("inspect", place, "--model", "selected").out == shown


def test_parameters_are_shown_with_units_and_deviations(invoke, two_link_results, measured_results):
    *shown, lumped = invoke("inspect", two_link_results).out.splitlines()[1:]
    assert "are lumped" in lumped
    units = {"m": "kg", "mx": "kg m", "my": "kg m", "Izz": "kg m^2"}
    assert [line.split(maxsplit=2)[2] for line in shown] == [
        units[line.split("_")[0].strip()] for line in shown
    ]
    measured = measured_results / "results"
    found = load_file(measured / "identification.h5", Identification, None, "")[0].reduced
    told = json.loads(invoke("inspect", measured, "--json").out)["parameters"]
    assert {p["name"]: p["deviation"] for p in told} == dict(
        zip(found.names, found.deviations.tolist(), strict=True)
    )
    shown = re.findall(r"(\S+) ± (\S+) ", invoke("inspect", measured).out)
    assert len(shown) == len(found.names)
    assert [float(d) for _, d in shown] == pytest.approx(found.deviations, rel=0.05)
    off = [abs(float(v) - truth) for (v, _), truth in zip(shown, found.values, strict=True)]
    assert all(o < 0.06 * d for o, d in zip(off, found.deviations, strict=True))


def test_damage_beside_what_is_looked_at_is_said(invoke, two_link_copy):
    path = two_link_copy / "model.h5"
    content = bytearray(path.read_bytes())
    content[len(content) * 3 // 5] ^= 8
    path.write_bytes(content)
    assert "model.h5: is damaged" in invoke("inspect", two_link_copy).err
    refused = invoke("export", TWO_LINK, "--results", two_link_copy, code=2)
    assert "model.h5: is damaged" in refused.err


def test_selected_is_that_of_the_only_results(invoke, two_link_results, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert "`paramreduce run CONFIG`" in invoke("inspect", "selected", code=2).err
    shutil.copytree(two_link_results, tmp_path / "results" / "a")
    assert invoke("inspect", "selected").out == invoke("inspect", "results/a").out
    shutil.copytree(two_link_results, tmp_path / "results" / "b")
    assert (
        "there are 2 results folders here. Try `paramreduce inspect results/a`"
        in invoke("inspect", "selected", code=2).err
    )


def test_datasets_of_every_size_are_one_line(invoke, two_link_results):
    file = two_link_results / "reduction.h5"
    (line,) = (
        line
        for line in invoke("inspect", file).out.splitlines()
        if line.startswith("/qr/parameters/")
    )
    assert line.split() == ["/qr/parameters/*", "7", "datasets", "float64,", "1", "to", "7"]
    names = {one["name"] for one in json.loads(invoke("inspect", file, "--json").out)["datasets"]}
    assert {f"/qr/parameters/{n}" for n in range(1, 8)} <= names


def test_relations_are_ordered_by_the_values_that_are_known(invoke, two_link_results, tmp_path):
    """As on the page; a reduction without its model beside it has them as they come."""
    asked = ("--model", "forward-selection:2", "--relations")
    alone = tmp_path / "reduction.h5"
    shutil.copy(two_link_results / "reduction.h5", alone)
    reduction = load_file(alone, Reduction, None, "")[0]
    model = load_file(two_link_results / "model.h5", Model, None, "")[0]
    row = reduction.heuristics["forward-selection"].find_row(2)
    for folder, known in ((two_link_results, model.values), (tmp_path, None)):
        out = invoke("inspect", folder / "reduction.h5", *asked).out
        wanted = make_reduced_model(reduction, "forward-selection", row, known).expressions
        assert all(f"  =  {text}" in out for text in wanted)


def test_inspect_shows_contents_and_provenance(invoke, two_link_results):
    out = invoke("inspect", two_link_results / "model.h5").out
    for text in ("robot: two_link", "stage: build-model", "/base/beta", "6 x 14"):
        assert text in out
    refused = invoke("inspect", two_link_results / "reduction.h5", "--model", "qr:99", code=2)
    assert "qr:1...7" in refused.err


def test_init_writes_a_config_that_runs(invoke, tmp_path):
    path = tmp_path / "configs" / "my_arm.yaml"
    invoke("init", "--dh", "my_arm", "--joints", 3, "--output", path)
    assert "exists already" in invoke("init", "--dh", "my_arm", "--output", path, code=2).err
    small = (
        "trajectories.count=1", "trajectories.test_count=1", "trajectories.starts=1", "trajectories.polished=1",
        "reduction.best_subset.time_limit=1", ONE_FORMAT,
    )  # fmt: skip
    invoke("run", path, "--results", tmp_path / "r", "--quiet", settings=small)


def test_a_robot_is_called_after_its_config(invoke, tmp_path):
    urdf = next((CONFIGS / "robots").glob("*.urdf"))
    invoke("init", urdf, "--output", tmp_path / "my_arm.yaml")
    assert load_config(tmp_path / "my_arm.yaml").robot == "my_arm"


@pytest.mark.parametrize("kind", ["--tree", "--loop", "--recorded"])
def test_init_writes_configs_to_be_filled_in_that_build(invoke, tmp_path, kind):
    path = tmp_path / "new.yaml"
    assert "TODO" in invoke("init", kind, "new", "--output", path).out
    invoke("build-model", path, "--results", tmp_path / "r")


def test_init_knows_robots_of_a_package_by_name(invoke, tmp_path, monkeypatch):
    """What robot_descriptions offers are modules with paths; the real one fetches them."""
    package, module = types.ModuleType("robot_descriptions"), types.ModuleType("one")
    package.__path__ = []
    urdf = tmp_path / "one.urdf"
    urdf.write_text(
        '<robot name="one"><link name="a"/><link name="b"><inertial><mass value="1"/>'
        '<inertia ixx="1" iyy="1" izz="1"/></inertial></link><joint name="j" type="continuous">'
        '<parent link="a"/><child link="b"/></joint></robot>'
    )
    module.URDF_PATH = str(urdf)
    monkeypatch.setitem(sys.modules, "robot_descriptions", package)
    monkeypatch.setitem(sys.modules, "robot_descriptions.one_description", module)
    path = tmp_path / "one.yaml"
    invoke("init", "one_description", "--output", path)
    assert "robot: one" in path.read_text()
    refused = invoke("init", "two_description", "--output", tmp_path / "two.yaml", code=2)
    assert "is no file" in " ".join(refused.err.split())


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        ([], "name the robot"),
        (["--tree", "arm", "--tip", "hand"], "--tree takes no options"),
        (["arm"], "give the path of a URDF or MJCF"),
        (["--loop", "a/b"], "is not a valid name"),
    ],
)
def test_init_says_what_it_needs(invoke, arguments, says):
    assert says in " ".join(invoke("init", *arguments, code=2).err.split())


def test_schema_is_json_schema(invoke):
    assert json.loads(invoke("schema").out)["properties"]["robot"]


@pytest.mark.parametrize(
    "arguments", [["reduce"], ["run"], ["nonsense"], ["run", "a", "--jobs", "0"]]
)
def test_wrong_usage(invoke, arguments):
    assert "Traceback" not in "".join(invoke(*arguments, code=2))


def test_run_says_what_settings_replace_in_the_default_folder(
    two_link_copy, tmp_path, monkeypatch, invoke
):
    monkeypatch.chdir(tmp_path)
    shutil.copytree(two_link_copy, "results/two_link")
    same = invoke("run", TWO_LINK, "--quiet", settings=[ONE_FORMAT])
    assert "--set" not in same.err
    changed = ["report.title=Other", ONE_FORMAT]
    err = " ".join(invoke("run", TWO_LINK, "--quiet", settings=changed).err.split())
    assert "--set replaces them from report on" in err
    assert "--set" not in invoke("run", TWO_LINK, "--quiet", "--results", "x", settings=changed).err


def test_the_first_trajectory_with_a_way_is_exported():
    from paramreduce_cli.cli.commands.export_trajectory import _find_first

    trajectories = types.SimpleNamespace(estimation=(1, 2, 3))

    def timed(which):
        if which == "estimation:1":
            raise DataError("no way to the first")
        return which

    assert _find_first(trajectories, timed) == ("estimation:2", "estimation:2")
    with pytest.raises(DataError, match="no way to the first"):
        _find_first(types.SimpleNamespace(estimation=(1,)), timed)


def test_init_asks_for_the_motion_of_a_base_that_floats(invoke, tmp_path):
    logs, path = CONFIGS / "logs", tmp_path / "ur10.yaml"
    words = ("init", logs / "ur10.urdf", "--log", logs / "ur10.csv.gz", "--output", path)
    refused = " ".join(invoke(*words, "--floating", code=2).err.split())
    assert "none for the coordinates of the base (q_" in refused
    assert "leave --floating out" in refused
    assert not path.exists()
    invoke(*words)


def test_inspect_begins_with_results_and_keeps_digests_for_later(invoke, two_link_results):
    for name, heading in (
        ("validation.h5", "Torque error on the test set, median of its motions"),
        ("reduction.h5", "Torque error on the estimation set"),
        ("trajectories.h5", "Trajectories of"),
        ("model.h5", "20 parameters, 7 act on the torques, 6 base parameters"),
    ):
        shown = invoke("inspect", two_link_results / name).out
        assert shown.startswith(heading)
        assert "digest: " in shown
    errors = invoke("inspect", two_link_results / "reduction.h5").out
    reduction = load_file(two_link_results / "reduction.h5", Reduction, None, "")[0]
    row = next(line for line in errors.splitlines() if line.startswith("3 "))
    assert row.split()[1] == f"{100 * reduction.heuristics['qr'].torque_error[2]:.3g}"


def test_records_of_tables_are_those_that_the_stages_make():
    from paramreduce_cli.cli.artifact_tables import _RECORDS
    from paramreduce_cli.running.pipeline import describe_stage
    from paramreduce_cli.stages import stages

    made = {name: describe_stage(name, stages[name]).output for name in _RECORDS}
    assert made == _RECORDS


def test_compare_says_the_worst_of_each_quantity(invoke, two_link_results, tmp_path):
    other = tmp_path / "other.json"
    summary = json.loads((two_link_results / "report/summary.json").read_text())
    assert summary.pop("provenance")  # whose digest would not fit
    for n, row in enumerate(summary["validation"]["qr"][:4], 1):
        row["torque_error"]["estimation"] *= 1 + n
    other.write_text(json.dumps(summary))
    short = invoke("compare", two_link_results, other, "--only", "torque_error", code=1).out
    assert "differ: 4 differences beyond tolerance, 0 within" in short
    assert len(short.splitlines()) == 3
    assert "qr, n = 4" in short, "the worst one"
    long = invoke("compare", two_link_results, other, "--only", "torque_error", "-v", code=1).out
    assert [f"qr, n = {n}:" in long for n in (1, 2, 3, 4)] == [True] * 4
