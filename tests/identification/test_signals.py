import gzip
import io
import re
import zipfile

import h5py
import numpy as np
import pytest
from simulated_logs import two_link_log, write_log

from paramreduce_cli.artifacts import array_files
from paramreduce_cli.artifacts.log_files import load_log
from paramreduce_cli.config.column_matching import guess_columns, list_named_joints
from paramreduce_cli.config.log_settings import LogSection
from paramreduce_cli.errors import ArtifactError, ConfigError, DataError
from paramreduce_cli.identification.signals import read_signals, resample_evenly
from paramreduce_cli.records import RawLog

NAMES = ("upper", "fore")
LOG = two_link_log(seconds=2.0)


def section(**keys):
    return LogSection(files=["log.csv"], **keys)


def raw(**changed):
    return RawLog("log.csv", {**LOG, **changed}, 2)


def as_csv(path):
    write_log(path, LOG)


def as_gz(path):
    write_log(path.with_suffix(""), LOG)
    path.write_bytes(gzip.compress(path.with_suffix("").read_bytes()))


def as_hdf5(path):
    with h5py.File(path, "w") as file:
        for name, values in LOG.items():
            file[name] = values


def as_matrices(path):
    matrices = {
        key: np.column_stack([LOG[f"{key}1"], LOG[f"{key}2"]]) for key in ("q", "dq", "tau")
    }
    np.savez(path, t=LOG["t"], **matrices)


@pytest.mark.parametrize(
    ("name", "write"),
    [("log.csv", as_csv), ("log.csv.gz", as_gz), ("log.h5", as_hdf5), ("log.npz", as_matrices)],
)
def test_all_formats_hold_the_same(name, write, tmp_path):
    write(tmp_path / name)
    found = load_log(tmp_path / name).columns
    assert set(found) == set(LOG)
    assert all(np.allclose(found[key], LOG[key], rtol=1e-8, atol=1e-12) for key in LOG)


@pytest.mark.parametrize("gripper", [0, 1, 3], ids=lambda every: f"a gripper {every} times")
def test_joint_states_of_a_bag(tmp_path, gripper):
    """Joints come in another order than in the robot, and other nodes publish to the same topic, as in bags."""
    pytest.importorskip("rosbags")
    from rosbags.rosbag2 import Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    State, Header = (
        store.types[f"{kind}"] for kind in ("sensor_msgs/msg/JointState", "std_msgs/msg/Header")
    )
    Time = store.types["builtin_interfaces/msg/Time"]
    with Writer(tmp_path / "bag", version=9) as writer:
        connection = writer.add_connection("/joint_states", State.__msgtype__, typestore=store)
        for k, t in enumerate(LOG["t"]):
            stamp = round(1e9 * (t + 1000))
            header = Header(Time(stamp // 10**9, stamp % 10**9), "")
            rows = [np.array([LOG[f"{key}2"][k], LOG[f"{key}1"][k]]) for key in ("q", "dq", "tau")]
            message = State(header, ["fore", "upper"], *rows)
            writer.write(connection, stamp, store.serialize_cdr(message, State.__msgtype__))
            for _ in range(gripper):
                message = State(header, ["finger"], *[np.zeros(1)] * 3)
                writer.write(connection, stamp, store.serialize_cdr(message, State.__msgtype__))
    log = load_log(tmp_path / "bag")
    columns = {
        "time": "/joint_states/time",
        "position": "/joint_states/position/{name}",
        "velocity": "/joint_states/velocity/{name}",
        "torque": "/joint_states/effort/{name}",
    }
    found = read_signals(log, section(columns=columns), NAMES)
    assert np.allclose(found.time, LOG["t"], atol=1e-6)
    assert np.allclose(found.z[:, 0], LOG["q1"])
    assert np.allclose(found.tau[:, 1], LOG["tau2"])


@pytest.mark.parametrize("name", ["log.npz", "log.h5", "log.csv", "log.db3"])
@pytest.mark.parametrize("content", [b"", b"nonsense", None])
def test_files_that_are_no_logs(name, content, tmp_path):
    if name.endswith("db3"):
        pytest.importorskip("rosbags")
    if content is not None:
        (tmp_path / name).write_bytes(content)
    with pytest.raises((ArtifactError, DataError), match=name):
        read_signals(load_log(tmp_path / name), section(), NAMES)


def test_units_signs_offsets_motors():
    """From what the motors would have recorded, in other units, back to the joints."""
    N = np.array([[50.0, 0.0], [20.0, 40.0]])
    q = np.column_stack([LOG["q1"] - 0.1, LOG["q2"] + 0.2])
    tau = np.column_stack([LOG["tau1"], LOG["tau2"]])
    motors, currents = q @ N.T, tau @ np.linalg.inv(N) / [0.5, 0.25]
    sign = np.array([1, -1])
    recorded = {"t": 1e3 * LOG["t"]}
    recorded |= {f"q{j + 1}": np.degrees(motors[:, j] * sign[j]) for j in range(2)}
    recorded |= {f"tau{j + 1}": 1e3 * currents[:, j] * sign[j] for j in range(2)}
    wanted = section(
        units={"time": "ms", "position": "deg", "torque": "mA"},
        torque_constants=[0.5, 0.25], signs=[1, -1], transmission=N.tolist(), offsets=[0.1, -0.2],
    )  # fmt: skip
    found = read_signals(RawLog("log.csv", recorded, 2), wanted, NAMES)
    assert np.allclose(found.time, LOG["t"])
    assert np.allclose(found.z, np.column_stack([LOG["q1"], LOG["q2"]]))
    assert np.allclose(found.tau, tau)


def swapped_rows(values):
    values = values.copy()
    values[[100, 101]] = values[[101, 100]]
    return values


def with_at(values, row, value):
    values = values.copy()
    values[row] = value
    return values


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"t": swapped_rows(LOG["t"])}, r"log\.csv, line 103, column t: time goes back"),
        ({"t": with_at(LOG["t"], 7, LOG["t"][6])}, r"line 9, column t: time stands still"),
        (
            {"q2": with_at(LOG["q2"], 50, np.nan)},
            r"line 52, column q2: is empty or not a finite number",
        ),
        (
            {"q2": with_at(LOG["q2"], 50, 1e308)},
            r"line 52, column q2: is empty or not a finite number below 1e\+30",
        ),
        ({"tau1": with_at(LOG["tau1"], 3, np.inf)}, r"line 5, column tau1"),
        ({"q3": LOG["q1"]}, r"column q3, but the robot has 2 joints"),
    ],
)
def test_what_cannot_be_is_said_with_row_and_column(changes, said):
    with pytest.raises(DataError, match=said):
        read_signals(raw(**changes), section(), NAMES)


def test_missing_columns_are_listed():
    with pytest.raises(DataError, match=r"no column tau1. Columns: t, q1.*sampling\.log\.columns"):
        read_signals(
            RawLog("x", {k: v for k, v in LOG.items() if "tau" not in k}, 2), section(), NAMES
        )


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ({"transmission": [[1, 2], [2, 4]]}, "has no inverse"),
        ({"transmission": [1, 2, 3]}, "3 ratios for 2 joints"),
        ({"offsets": [1, 2, 3]}, "has 3 values for 2 joints"),
        ({"columns": {"position": ["q1", "q2", "q1"]}}, "names 3 columns for 2 joints"),
    ],
)
def test_settings_that_do_not_fit_the_robot(keys, said):
    with pytest.raises(ConfigError, match=said):
        read_signals(raw(), section(**keys), NAMES)


def test_uneven_time_is_resampled():
    """Onto what the true motion is at even times."""
    rng = np.random.default_rng(0)
    time = np.sort(LOG["t"] + 0.001 * rng.uniform(-1, 1, LOG["t"].size))
    uneven = {key: np.interp(time, LOG["t"], values) for key, values in LOG.items()} | {"t": time}
    uneven["q1"] = np.sin(3 * time)
    pieces, rate, said = resample_evenly(read_signals(RawLog("x", uneven, 2), section(), NAMES))
    assert len(pieces) == 1
    assert rate == pytest.approx(200, rel=0.01)
    assert "resampled" in said[0]
    assert np.allclose(np.diff(pieces[0].time), 1 / rate)
    assert np.abs(pieces[0].z[:, 0] - np.sin(3 * pieces[0].time)).max() < 1e-6


def test_gaps_part_a_log():
    kept = np.r_[0:150, 230:390]
    log = RawLog("x", {key: values[kept] for key, values in LOG.items()}, 2)
    pieces, _, said = resample_evenly(read_signals(log, section(), NAMES))
    assert [piece.time.size for piece in pieces] == [150, 160]
    assert "1 gaps in time, the longest of 0.405 s" in said[0]


def test_signals_of_different_length_are_named():
    log = RawLog("x", {**LOG, "tau2": LOG["tau2"][:-3]}, None)
    with pytest.raises(DataError, match="column tau2 has 397 rows, t has 400"):
        read_signals(log, section(), NAMES)
    unused = RawLog("x", {"calibration": np.ones(3), **LOG}, None)
    assert read_signals(unused, section(), NAMES).time.size == 400


TOPICS = {"time": "/states/time", "position": "/states/q/{}", "torque": "/motors/effort/{}"}


def topics(first=-0.1, last=2.1):
    """Positions and torques of topics with rates of their own, as a bag has them."""
    t, own = np.arange(400) / 200, np.arange(first, last, 1 / 130)
    columns = {"/states/time": t, "/motors/time": own}
    for j in (1, 2):
        columns |= {f"/states/q/{j}": np.sin(j * t), f"/motors/effort/{j}": np.cos(3 * j * own)}
    return columns


def test_topics_with_times_of_their_own_are_joined():
    found = read_signals(RawLog("x", topics(), None), section(columns=TOPICS), NAMES)
    t = np.arange(400) / 200
    assert np.allclose(found.tau, np.cos(3 * np.outer(t, [1, 2])), atol=1e-4)


def test_torques_of_a_topic_that_begins_late_are_missing():
    found = read_signals(RawLog("x", topics(first=0.3), None), section(columns=TOPICS), NAMES)
    assert np.array_equal(np.isnan(found.tau[:, 0]), found.time < 0.3)


def test_only_common_times_of_topics_are_used():
    """With the torques' times; positions begin later and end earlier."""
    other = {**TOPICS, "time": "/motors/time"}
    found = read_signals(RawLog("x", topics(), None), section(columns=other), NAMES)
    assert found.time[0] >= 0
    assert found.time[-1] <= 1.995
    assert np.allclose(found.z, np.sin(np.outer(found.time, [1, 2])), atol=1e-5)


def test_topics_of_equal_length_are_joined_by_their_times():
    late = topics()
    late["/motors/time"] = late["/states/time"] + 0.3
    late |= {f"/motors/effort/{j}": np.cos(3 * j * late["/motors/time"]) for j in (1, 2)}
    found = read_signals(RawLog("x", late, None), section(columns=TOPICS), NAMES)
    seen = found.time > 0.31
    assert np.allclose(found.tau[seen], np.cos(3 * np.outer(found.time[seen], [1, 2])), atol=1e-4)
    assert np.isnan(found.tau[found.time < 0.29]).all()


def test_gaps_of_a_topic_are_not_bridged():
    gappy = topics()
    kept = (gappy["/motors/time"] < 0.5) | (gappy["/motors/time"] > 1.0)
    gappy |= {key: gappy[key][kept] for key in gappy if key.startswith("/motors")}
    found = read_signals(RawLog("x", gappy, None), section(columns=TOPICS), NAMES)
    assert np.isnan(found.tau[(found.time > 0.51) & (found.time < 0.99)]).all()


def test_topics_without_common_times_are_said():
    other = topics()
    other["/motors/time"] = other["/motors/time"] + 100
    with pytest.raises(DataError, match="have no time in common"):
        read_signals(RawLog("x", other, None), section(columns=TOPICS), NAMES)


def test_text_and_objects_that_nobody_asks_for(tmp_path):
    rows = (tmp_path / "log.csv", tmp_path / "log.npz")
    lines = ["t,mode,q1", *(f"{k},AUTO,{k / 2}" for k in range(60)), ""]
    rows[0].write_text("\n".join(lines))
    np.savez(
        rows[1], t=np.arange(60.0)[:, None], who=np.array([{}], dtype=object), q=np.ones((60, 2))
    )
    assert set(load_log(rows[0]).columns) == {"t", "q1"}
    assert set(load_log(rows[1]).columns) == {"t", "q1", "q2"}
    np.save(tmp_path / "plain.npy", np.ones(3))
    (tmp_path / "plain.npy").rename(tmp_path / "plain.npz")
    with pytest.raises(ArtifactError, match=r"plain\.npz"):
        load_log(tmp_path / "plain.npz")


@pytest.mark.parametrize("save", [np.savez, np.savez_compressed])
def test_arrays_of_all_kinds_of_numbers_and_orders(tmp_path, save, monkeypatch):
    monkeypatch.setattr(array_files, "_AT_ONCE", 7)
    rng = np.random.default_rng(0)
    q = rng.normal(size=(60, 3))
    brought = {
        "t": np.arange(60), "on": rng.random(60) < 0.5, "q": q.astype(np.float32),
        "dq": np.asfortranarray(q).astype(">f8"), "cube": np.ones((2, 2, 2)),
    }  # fmt: skip
    save(tmp_path / "log.npz", **brought)
    log = load_log(tmp_path / "log.npz")
    found = log.columns
    names = [f"{name}{k + 1}" for name in ("q", "dq") for k in range(3)]
    assert set(found) == {"t", *names}
    assert log.others == {"on": "true and false"}
    for name in names:
        np.testing.assert_array_equal(found[name], brought[name[:-1]][:, int(name[-1]) - 1])


def test_an_array_that_is_cut_off_is_refused(tmp_path):
    whole = io.BytesIO()
    np.save(whole, np.ones(100))
    with zipfile.ZipFile(tmp_path / "log.npz", "w") as archive:
        archive.writestr("t.npy", whole.getvalue()[:-8])
    with pytest.raises(
        ArtifactError, match=r"t\.npy does not hold the \(100,\) numbers it declares"
    ):
        load_log(tmp_path / "log.npz")


def test_empty_lines_inside_are_refused(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text("t,q1\n1,2\n\n3,4\n")
    with pytest.raises(DataError, match=r"log\.csv, line 3: is empty"):
        load_log(path)


def columns_of(*stems):
    return [f"{stem}{j}" for stem in stems for j in (1, 2)]


@pytest.mark.parametrize(
    ("names", "expected"),
    [
        (["t", *columns_of("q", "tau")], ("t", "q{}", "tau{}")),
        (["time", *columns_of("current", "q", "tau")], ("time", "q{}", "tau{}")),
        (["t", *columns_of("commanded_position", "measured_position", "desired_torque", "torque")],
         ("t", "measured_position{}", "torque{}")),
        (["/clock/time", "/js/time", *columns_of("/js/position/", "/js/effort/")],
         ("/js/time", "/js/position/{}", "/js/effort/{}")),
        (["timestamp", "actual_q_0", "actual_q_1", "actual_current_0", "actual_current_1"],
         ("timestamp", ["actual_q_0", "actual_q_1"], ["actual_current_0", "actual_current_1"])),
        (["t", "upper/pos", "fore/pos", "upper/tau", "fore/tau"],
         ("t", ["upper/pos", "fore/pos"], ["upper/tau", "fore/tau"])),
    ],
)  # fmt: skip
def test_guesses(names, expected):
    found = guess_columns(names, NAMES)
    assert (found["time"], found["position"], found["torque"]) == expected


def test_nothing_to_guess():
    with pytest.raises(ConfigError, match="no columns for torque of 2 joints"):
        guess_columns(["t", "q1", "q2"], NAMES)


@pytest.mark.parametrize("torque", ["tau{}", ["tau1"], ["tau1", "none"]], ids=str)
@pytest.mark.parametrize("change", ["absent", "not numbers"])
def test_torques_that_are_not_measured_need_no_column(torque, change):
    columns = {**LOG, "tau2": np.full_like(LOG["tau2"], np.nan)}
    if change == "absent":
        del columns["tau2"]
    wanted = section(columns={"torque": torque})
    found = read_signals(RawLog("x.csv", columns, 2), wanted, NAMES, unmeasured=[NAMES[1]])
    np.testing.assert_array_equal(found.tau[:, 0], LOG["tau1"])
    assert not found.tau[:, 1].any()
    with pytest.raises((DataError, ConfigError)):
        read_signals(RawLog("x.csv", columns, 2), wanted, NAMES)


@pytest.mark.parametrize(
    ("names", "joints"),
    [
        (["/js/time", "/js/position/elbow", "/js/position/hand", "/js/effort/elbow"], ["elbow", "hand"]),
        (["t", "elbow.q", "hand.q", "elbow.tau"], ["elbow", "hand"]),
        (["t", "elbow_position", "hand_position"], ["elbow", "hand"]),
        (["t", "q1", "tau1"], []),
    ],
)  # fmt: skip
def test_joints_are_read_from_columns_of_their_names(names, joints):
    assert list_named_joints(names) == joints


def test_a_log_with_more_joints_than_the_robot_is_refused():
    names = ["t", *(f"{kind}{j}" for kind in ("q", "tau") for j in (1, 2, 3))]
    with pytest.raises(ConfigError, match="3 joints by its columns, the robot 2"):
        guess_columns(names, ["a", "b"])
    assert guess_columns(names, ["a", "b", "c"])["position"] == "q{}"


@pytest.mark.parametrize(
    ("names", "locked"), [(["t", "q1", "tau1"], True), (["t", "q1", "q2", "tau1"], False)]
)
def test_joints_are_to_be_locked_where_they_have_no_column_at_all(names, locked):
    with pytest.raises(ConfigError) as caught:
        guess_columns(names, NAMES)
    assert ("--lock fore=0" in str(caught.value)) == locked


@pytest.mark.parametrize("mark", [",", "\t", ";", " ", "   "])
@pytest.mark.parametrize("comment", ["", "# "])
def test_tables_are_separated_by_what_their_headings_are(tmp_path, mark, comment):
    rows = np.random.default_rng(0).normal(size=(60, 3)).round(6)
    lines = [mark.join(["t", "q1", "tau1"]), *(mark.join(map(str, row)) for row in rows.tolist())]
    path = tmp_path / "log.txt"
    path.write_text(comment + "\n".join(lines) + "\n")
    found = load_log(path).columns
    assert list(found) == ["t", "q1", "tau1"]
    np.testing.assert_array_equal(np.column_stack(list(found.values())), rows)


def test_cells_that_are_empty_are_missing_numbers_and_no_text(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text("t,q1,mode,tau1\n" + "".join(f"{k},{k},run,{k or ''}\n" for k in range(60)))
    log = load_log(path)
    assert list(log.columns) == ["t", "q1", "tau1"]
    found = read_signals(log, LogSection(files=["x"], columns={"torque": "tau{}"}), ["a"])
    assert np.flatnonzero(np.isnan(found.tau)).tolist() == [0]
    log = RawLog("log.csv", {**log.columns, "q1": log.columns["tau1"]}, 2)
    with pytest.raises(DataError, match="line 2, column q1: is empty or not a finite number"):
        read_signals(log, LogSection(files=["x"], columns={"torque": "tau{}"}), ["a"])


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("0.0\n1.0\n", "line 1: holds numbers where headings should be"),
        ("t;q1\n0;1,5\n", "line 2, column q1: '1,5' is not a number. Write decimal points"),
    ],
)
def test_tables_that_cannot_be_read_say_why(tmp_path, text, says):
    (tmp_path / "log.csv").write_text(text)
    with pytest.raises(DataError, match=re.escape(says)):
        load_log(tmp_path / "log.csv")


def test_speeds_without_any_number_are_to_be_left_out():
    log = RawLog("x.csv", {**LOG, "dq1": np.full(LOG["t"].size, np.nan)}, 2)
    with pytest.raises(DataError, match=r"column dq1 holds no number at all\. Leave it out"):
        read_signals(log, section(columns={"velocity": "dq{}"}), NAMES)


def test_joints_in_rows_are_told_by_the_time(tmp_path):
    q = np.random.default_rng(0).normal(size=(3, 100))
    np.savez(tmp_path / "log.npz", t=np.arange(100.0), q=q)
    found = load_log(tmp_path / "log.npz").columns
    np.testing.assert_array_equal([found[f"q{k}"] for k in (1, 2, 3)], q)
    np.savez(tmp_path / "log.npz", q=q)
    with pytest.raises(DataError, match="q has 3 rows and 100 columns"):
        load_log(tmp_path / "log.npz")


@pytest.mark.parametrize(
    ("values", "held"),
    [
        (np.ones(60, complex), "complex numbers"),
        (np.ones(60, bool), "true and false"),
        (np.array([b"x"] * 60), "text"),
    ],
)
@pytest.mark.parametrize("kind", ["h5", "npz"])
def test_columns_that_hold_no_numbers_are_named(tmp_path, values, held, kind):
    path = tmp_path / f"log.{kind}"
    arrays = {"t": np.arange(60.0), "q1": np.arange(60.0), "tau1": values}
    if kind == "npz":
        np.savez(path, **arrays)
    else:
        with h5py.File(path, "w") as file:
            for name, array in arrays.items():
                file[name] = array
    with pytest.raises(DataError, match=f"column tau1 holds {held}"):
        read_signals(load_log(path), LogSection(files=["x"], columns={"torque": "tau{}"}), ["a"])


def test_a_column_of_one_joint_is_not_that_of_another():
    names = ["t", "left_lift/q", "lift/q", "lift/tau", "left_lift/tau"]
    assert guess_columns(names, ["lift"])["position"] == ["lift/q"]
    names = ["t", "joint_10/q", "joint_1/q", "joint_10/tau", "joint_1/tau"]
    found = guess_columns(names, ["joint_1", "joint_10"])
    assert found["torque"] == ["joint_1/tau", "joint_10/tau"]
    names = ["t", "left_lift/q", "right_lift/q", "left_lift/tau", "right_lift/tau"]
    with pytest.raises(
        ConfigError, match="several columns may be of the joint lift: left_lift/q, right_lift/q"
    ):
        guess_columns(names, ["lift"])
    assert guess_columns(["t", "robot_lift/q", "robot_lift/tau"], ["lift"])["torque"] == [
        "robot_lift/tau"
    ]
    names = ["t", "arm/q", "arm/target_q", "arm/tau"]
    assert guess_columns(names, ["arm"])["position"] == ["arm/q"]


def test_a_table_without_headings_has_columns_by_number(tmp_path):
    rows = np.random.default_rng(0).normal(size=(60, 3)).round(6)
    path = tmp_path / "log.csv"
    path.write_text("\n".join(",".join(map(str, row)) for row in rows.tolist()) + "\n")
    log = load_log(path)
    assert list(log.columns) == ["1", "2", "3"]
    assert log.describe_row(0).endswith("log.csv, line 1")
    np.testing.assert_array_equal(np.column_stack(list(log.columns.values())), rows)
    path.write_text("1,2\n3,x\n")
    with pytest.raises(DataError, match="line 2, column 2: 'x' is not a number"):
        load_log(path)


def test_columns_by_number():
    by_number = RawLog("x.csv", {str(k + 1): column for k, column in enumerate(LOG.values())}, 1)
    columns = {"time": 1, "position": [2, 3], "velocity": [4, 5], "torque": [6, 7]}
    found = read_signals(by_number, section(columns=columns), NAMES)
    np.testing.assert_array_equal(found.tau[:, 1], LOG["tau2"])


def test_a_rate_instead_of_times():
    log = RawLog("x.csv", {name: values for name, values in LOG.items() if name != "t"}, 2)
    found = read_signals(log, section(recorded_rate=200), NAMES)
    np.testing.assert_allclose(found.time, LOG["t"], atol=1e-12)
    with pytest.raises(DataError, match="there is no column t"):
        read_signals(log, section(), NAMES)


def as_npy(path):
    np.save(path, np.column_stack(list(LOG.values())))


def as_mat(path):
    import scipy.io

    q, tau = (np.column_stack([LOG[f"{key}1"], LOG[f"{key}2"]]) for key in ("q", "tau"))
    scipy.io.savemat(path, {"run": {"t": LOG["t"], "q": q, "tau": tau, "note": "warm"}})


def as_mat73(path):
    q, tau = (np.array([LOG[f"{key}1"], LOG[f"{key}2"]]) for key in ("q", "tau"))
    with h5py.File(path, "w") as file:  # MATLAB stores columns first
        file["run/t"], file["run/q"], file["run/tau"] = LOG["t"][None], q, tau


@pytest.mark.parametrize(
    ("name", "write", "column"),
    [("log.npy", as_npy, "2"), ("log.mat", as_mat, "run/q1"), ("log.mat", as_mat73, "run/q1")],
)
def test_arrays_of_other_programs(name, write, column, tmp_path):
    write(tmp_path / name)
    np.testing.assert_array_equal(load_log(tmp_path / name).columns[column], LOG["q1"])


@pytest.mark.parametrize("name", ["log.npy", "log.mat"])
def test_damaged_arrays_are_refused(name, tmp_path):
    (tmp_path / name).write_bytes(b"nothing of the kind")
    with pytest.raises(ArtifactError, match="cannot be read as"):
        load_log(tmp_path / name)
    with pytest.raises(ArtifactError):
        load_log(tmp_path / f"missing_{name}")


@pytest.mark.parametrize("name", ["log.xlsx", "log.parquet", "log.ulg"])
def test_files_that_are_not_read_are_answered_with_how_to_convert(name, tmp_path):
    (tmp_path / name).write_bytes(b"PK")
    with pytest.raises(ArtifactError, match="such files are not read") as caught:
        load_log(tmp_path / name)
    assert re.search("CSV|ulog2csv", caught.value.remedy)


def test_a_ros_1_bag(tmp_path):
    rosbag1 = pytest.importorskip("rosbags.rosbag1")
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC)
    kind = "sensor_msgs/msg/JointState"
    time, header = (
        store.types[f"{name}"] for name in ("builtin_interfaces/msg/Time", "std_msgs/msg/Header")
    )
    with rosbag1.Writer(tmp_path / "log.bag") as writer:
        connection = writer.add_connection("/joint_states", kind, typestore=store)
        for k in range(5):
            values = [np.array([0.1 * k, 0.2 * k]) for _ in range(3)]
            stamp = header(k, time(10 + k, 0), "base")
            message = store.types[kind](stamp, ["upper", "fore"], *values)
            writer.write(connection, k * 10**9, store.serialize_ros1(message, kind))
    found = load_log(tmp_path / "log.bag").columns
    np.testing.assert_allclose(found["/joint_states/position/fore"], 0.2 * np.arange(5))
    np.testing.assert_allclose(found["/joint_states/time"], np.arange(5))
