import contextlib
import json
import re
import warnings

import jsonschema
import numpy as np
import pytest
from conftest import CONFIGS, config_of
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from paramreduce_cli.config import get_schema, load_config
from paramreduce_cli.config.former_keys import FORMER_KEYS
from paramreduce_cli.config.template import format_dh_template
from paramreduce_cli.config.yaml_reading import read_yaml
from paramreduce_cli.errors import ConfigError, ParamreduceWarning

pytestmark = pytest.mark.filterwarnings("ignore::paramreduce_cli.errors.ParamreduceWarning")


def errors_of(path, *overrides):
    with pytest.raises(ConfigError) as caught:
        load_config(path, overrides)
    return str(caught.value).splitlines()


@pytest.mark.parametrize("path", sorted(CONFIGS.glob("*.yaml")), ids=lambda p: p.stem)
def test_configs_that_ship_are_valid_and_satisfy_the_json_schema(path):
    config = load_config(path)
    jsonschema.validate(read_yaml(path.read_text(), str(path)).data, get_schema())
    assert config.robot == path.stem
    for name in config.parameter_sets:
        load_config(path, [f"parameters={name}"])


def test_misprint_of_the_papers_table_stays_in_its_own_set():
    for name, Ixz_6 in (("unrounded", 0.0002), ("table", 0.002)):
        assert config_of("puma560", f"parameters={name}").get_values()[56] == Ixz_6


@pytest.mark.parametrize(
    ("old", "new", "line", "says"),
    [
        ("harmonics: 2", "harmonic: 2", 23, ["trajectories.harmonic", "Did you mean harmonics?"]),
        ("count: 2", "count: -2", 20, ["trajectories.count", "greater than or equal to 1", "-2"]),
        ("count: 2", "count: many", 20, ["trajectories.count", "many"]),
        ("velocity_limits: 3", "velocity_limits: [1, 2, 3]", 26,
         ["trajectories.velocity_limits has 3 values, but two_link has 2 joints", "rad/s"]),
        ("velocity_limits: 3", "velocity_limits: fast", 26, ["velocity_limits", "'fast' is not a number"]),
        ("velocity_limits: 3", "velocity_limits: -3", 26, ["velocity_limits", "greater than"]),
        ("[-pi/2, pi/2]", "[pi/2, -pi/2]", 25, ["position_limits", "the limits cross"]),
        ("[-pi/2, pi/2]", "[1, 1]", 25, ["position_limits", "never moves"]),
        ("points: 40", "points: 4", 24, ["trajectories.points", "4 points cannot hold 2 harmonics"]),
        ("convention: modified", "convention: moddified", 7, ["convention", "'modified' or 'standard'"]),
        ("a: 0.5", "a: 0.5m", 10, ["joints.1.a", "'0.5m' is not a number"]),
        ("name: fore", "name: upper", 10, ["joints.1.name", "used twice"]),
        ("name: fore", "name: fore, parent: base_", 10, ["parent", "Did you mean base?"]),
        ("    fore: {m", "    for: {m", 15, ["parameter_sets.slender_rods.for", "Did you mean fore?"]),
        ("com: [0.2, 0.01, 0]", "com: [0.2, 0.01]", 15, ["fore.com", "3 items"]),
        ("com: [0.2, 0.01, 0]", "mx: 1", 15, ["inertia_com needs com"]),
        ("nominal_torque: [20, 5]", "nominal_torque: [20, 0]", 17, ["nominal_torque", "greater than 0"]),
        ("heuristic: forward-selection", "heuristic: forward_selction", 31,
         ["heuristic", "Did you mean forward-selection?"]),
        ("  n: 4", "  n: 40", 32, ["selected.n is 40, but two_link has 20 parameters"]),
        ("  n: 4", "  n: 4\n  torque_error: 0.1", 30, ["give n or torque_error, not both"]),
        ("robot: two_link", "robot: two/link", 2, ["robot"]),
        ("starts: 3\n  polished: 1", "starts: 1\n  polished: 2", 28, ["polished"]),
        ("gravity: [0, -9.81, 0]", "gravity: 9.81", 5, ["gravity"]),
    ],
)  # fmt: skip
def test_errors_name_file_line_key_and_remedy(write_config, old, new, line, says):
    path = write_config((old, new))
    messages = errors_of(path)
    matching = [m for m in messages if all(text in m for text in says)]
    assert matching, messages
    assert f"{path}, line {line}:" in matching[0]


@pytest.mark.parametrize(
    ("robot", "override", "says"),
    [
        ("four_bar", "drives.{}={{load: unknown}}", "is for open trees only"),
        ("two_link", "drives.z_{}={{load: unknown}}", "no body has a mass"),
    ],
)
def test_friction_per_load_needs_an_open_tree_and_masses(robot, override, says):
    name = config_of(robot).build_mechanism().coordinate_names[0]
    massless = ["parameter_sets={none: {upper: {}, fore: {}}}"] if robot == "two_link" else []
    lines = errors_of(
        CONFIGS / f"{robot}.yaml", override.format(name.removeprefix("z_")), *massless
    )
    assert f"drives.{name}.load" in lines[0]
    assert says in " ".join(lines)


def test_friction_per_load_is_left_to_a_log_where_one_decides():
    massless = ["parameter_sets={none: {upper: {}, fore: {}}}", "nominal_torque=[20, 5]"]
    log = ["sampling={log: {files: log.csv}}", "validation.accept={}"]
    drives = "drives={all: {friction: auto}, z_upper: {load: unknown}}"
    config = load_config(CONFIGS / "two_link.yaml", [drives, *massless, *log])
    assert config.build_mechanism().nominal is not None
    names = errors_of(
        CONFIGS / "two_link.yaml", "drives={all: {load: 0.1, smoothing: 1}}", "parameters=nope"
    )
    assert "nope" in " ".join(names)


def test_friction_per_load_leaves_out_a_payload_that_is_to_be_found():
    payload = ["payloads={tool: {body: fore, at: [0, 0, 0]}}", "identification.payloads=[tool]"]
    lines = errors_of(CONFIGS / "two_link.yaml", "drives.z_fore={load: 0.1}", *payload)
    assert "leaves out the weight of the payloads" in " ".join(lines)


def test_all_errors_of_a_file_come_at_once(write_config):
    path = write_config(
        ("harmonics: 2", "harmonic: 2"),
        ("velocity_limits: 3", "velocity_limits: [1, 2, 3]"),
        ("[-pi/2, pi/2]", "[pi/2, -pi/2]"),
        ("count: 2", "count: -2"),
        ("    fore: {m: 1.0", "    fore: {m: heavy"),
    )
    messages = errors_of(path)
    assert len(messages) == 5
    assert sorted(int(re.search(r"line (\d+)", m)[1]) for m in messages) == [15, 20, 23, 25, 26]


def test_a_missing_key_says_what_it_would_hold(write_config):
    path = write_config(("  velocity_limits: 3\n", ""))
    (message,) = errors_of(path)
    assert "trajectories.velocity_limits is missing" in message
    assert "rad/s" in message


def test_a_key_that_stands_twice_is_an_error(write_config):
    path = write_config(("  count: 2", "  count: 2\n  count: 3"))
    (message,) = errors_of(path)
    assert "line 21" in message
    assert "already on line 20" in message


def test_a_key_that_stands_twice_on_one_line_is_an_error(write_config):
    path = write_config(("  count: 2", "  constraints: [{kind: load, kind: position}]\n  count: 2"))
    assert "key kind stands here again" in errors_of(path)[0]


def test_a_key_may_stand_for_a_merged_one():
    read = read_yaml("a: &x {b: 1, c: 2}\nd: {<<: *x, b: 3}\n", "x.yaml")
    assert read.data["d"] == {"b": 3, "c": 2}
    assert not read.problems


def test_limits_in_degrees_are_warned_of(write_config):
    path = write_config(("[-pi/2, pi/2]", "[-90, 90]"))
    with pytest.warns(ParamreduceWarning, match="rad .m., not degrees"):
        load_config(path)


def test_a_budget_of_terms_that_nothing_keeps_to_is_warned_of(write_config):
    terms = "terms: {{acceleration_error: 0.05, functions: [{}]}}\nselected:"
    with pytest.warns(ParamreduceWarning, match="terms.acceleration_error is of the direct"):
        load_config(write_config(("selected:", terms.format("inverse"))))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        load_config(write_config(("selected:", terms.format("inverse, direct"))))


@pytest.mark.parametrize(
    ("text", "says"),
    [("robot: [", "not YAML"), ("", "mapping"), ("- 1", "mapping"), ("robot: !!python/object:x 1", "not YAML"),
     ("robot: x\nreport: {title: 2020-13-45}\n", ""), ("robot: x\nselected: &x {n: *x}\n", "")],
)  # fmt: skip
def test_what_is_no_config_at_all(tmp_path, text, says):
    path = tmp_path / "x.yaml"
    path.write_text(text)
    assert says in errors_of(path)[0]


def test_a_missing_file_offers_those_that_are_there(tmp_path, write_config):
    write_config()
    (message,) = errors_of(tmp_path / "two_lnk.yaml")
    assert "two_link.yaml" in message


def test_overrides(write_config):
    path = write_config()
    settings = ["trajectories.count=3", "description.dh.joints.1.a=2*pi", "trajectories.seed=5",
                "trajectories.points=1e2"]  # fmt: skip
    config = load_config(path, settings)
    assert config.trajectories.count == 3
    assert config.trajectories.points == 100
    assert config.description.dh.joints[1].a == pytest.approx(2 * np.pi)
    assert config.trajectories.seed == 5
    (message,) = errors_of(path, "trajectories.count=none_at_all")
    assert message.startswith("--set trajectories.count=none_at_all: ")
    for wrong in ("trajectories.count", "robot.name=1", "description.dh.joints.9.a=1", "a=[", "=1"):
        assert wrong in errors_of(path, wrong)[0]


def test_centre_of_mass_form_is_the_parallel_axis_theorem():
    values = config_of("two_link").get_values()
    across = 1 / 24 + 2 * 0.25**2
    assert values[:10] == pytest.approx([2, 0.5, 0, 0, 1e-3, 0, 0, across, 0, across])
    assert values[15] == pytest.approx(-1.0 * 0.2 * 0.01)  # Ixy_fore of a point mass


@pytest.mark.parametrize(
    ("old", "new"), [("m: 2.0", "m: -2.0"), ("1e-3, 0, 0, 1/24", "1, 0, 0, 1/24")]
)
def test_bodies_that_cannot_exist_are_warned_of_and_go_on(write_config, old, new):
    with pytest.warns(ParamreduceWarning, match="upper"):
        load_config(write_config((old, new)))


def test_every_key_of_the_schema_is_documented():
    schema = get_schema()
    for model in (schema, *schema["$defs"].values()):
        for key, entry in model.get("properties", {}).items():
            assert entry.get("description"), (model["title"], key)


@pytest.mark.parametrize(
    "override",
    ["description.dh.joints.0.a=inf", "description.dh.joints.0.a=1e200", "nominal_torque=inf",
     "trajectories.period=1e-200", "trajectories.velocity_limits=1e-300",
     "trajectories.points=999999999999", "trajectories.count=1e24", "trajectories.count=true",
     "trajectories.count=1.5", "report.poses=[]", "trajectories.position_limits=[]"],
)  # fmt: skip
def test_numbers_that_no_machine_has_are_refused(write_config, override):
    (message,) = errors_of(write_config(), override)
    assert message.startswith(f"--set {override}")


@pytest.mark.parametrize("joints", [1, 2, 6, 9])
def test_the_template_is_valid_and_physical(tmp_path, joints):
    path = tmp_path / "arm.yaml"
    path.write_text(format_dh_template("arm", joints))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert load_config(path).n_dof == joints


@settings(
    max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(
    st.sampled_from(["robot", "description", "trajectories", "selected", "nominal_torque", "report"]),
    st.recursive(
        st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
        lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner, max_size=3),
        max_leaves=5,
    ),
)  # fmt: skip
def test_nothing_in_a_config_raises_anything_but_a_config_error(write_config, key, value):
    path = write_config()
    with contextlib.suppress(ConfigError):
        assert load_config(path, [f"{key}={json.dumps(value)}"]).robot


@pytest.mark.parametrize("listed", ["pdf,png", "[pdf, png]", "pdf, png"])
def test_words_may_be_listed_with_commas(listed):
    config = config_of("two_link", f"report.formats={listed}")
    assert config.report.formats == ["pdf", "png"]


@pytest.mark.parametrize(("counts", "expected"), [("", 0), ("  test_count: 4\n", 4)])
def test_a_recorded_test_set_needs_no_test_trajectories(write_config, counts, expected):
    recorded = "sampling:\n  test_file: test.csv\n\nselected:"
    path = write_config(("  test_count: 4\n", counts), ("selected:", recorded))
    assert load_config(path).trajectories.test_count == expected


@pytest.mark.parametrize("key", FORMER_KEYS, ids=".".join)
def test_former_keys_say_what_stands_in_their_place(write_config, key):
    with pytest.raises(ConfigError, match=re.escape(FORMER_KEYS[key])):
        load_config(write_config(), [f"{'.'.join(key)}=1"])


def test_a_misspelt_key_of_a_section_that_may_be_a_list_has_a_suggestion(write_config):
    with pytest.raises(ConfigError, match=r"Did you mean motion\?"):
        load_config(write_config(), ["sampling.log.signs={motin: [1, -1]}"])


def test_a_line_that_two_problems_share_is_a_config_error(write_config):
    path = write_config(
        ("com: [0.25, 0, 0]", "com: [99999999999999999999, 99999999999999999999, 0]")
    )
    with pytest.raises(ConfigError, match="too large"):
        load_config(path)


def test_simulated_samples_need_no_limits_but_characteristic_torques(tmp_path):
    text = (CONFIGS / "quarter_car.yaml").read_text()
    assert "trajectories" not in text
    path = tmp_path / "quarter_car.yaml"
    path.write_text(text.replace("nominal_torque: [2000, 2000]\n", ""))
    (message,) = errors_of(path)
    assert (
        "nominal_torque is missing: without an input there is no torque, whose standard deviation is no scale, on z_chassis"
        in message
    )
    assert "N m" in message


@pytest.mark.parametrize(
    ("motion", "unit"),
    [
        ("{z_chassis: 1, a_lower: 0.3}", "N s/m"),
        ("{z_chassis: -1, a_lower: 1}", "N s/m"),
        ("{z_chassis: 20, a_lower: 1}", "N m s/rad"),
        ("{z_chassis: 0.5, a_lower: 0.3}", "N s/m"),
        ("{a_lower: 0.5, a_upper: 0.3}", "N m s/rad"),
        ("{z_chassis: 50}", "N s/m"),
    ],
)
def test_unit_of_a_drive_along_several_coordinates(tmp_path, motion, unit):
    text = (CONFIGS / "quarter_car.yaml").read_text()
    path = tmp_path / "quarter_car.yaml"
    path.write_text(
        text.replace("drives:\n", f"drives:\n  mixed: {{motion: {motion}, viscous: 3}}\n")
    )
    parameters = {p.name: p for p in load_config(path).list_parameters()}
    assert parameters["fv_mixed"].unit == unit
