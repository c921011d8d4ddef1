"""The shape of friction of a two-link arm whose friction is known."""

import numpy as np
import pytest
from simulated_logs import FRICTION, TWO_LINK, two_link_log

from paramreduce_cli.config import load_config
from paramreduce_cli.config.log_settings import LogSection
from paramreduce_cli.identification import band_scoring, friction_selection
from paramreduce_cli.identification.friction_shapes import ShapeSearch, list_signs
from paramreduce_cli.multibody.dynamics import Dynamics
from paramreduce_cli.records import Kind, RawLog, RawLogs
from paramreduce_cli.stages.process_log import process_logs_of_robot

AUTO = {"all": {"friction": "auto"}}


def robot(drives=AUTO):
    log = "sampling={log: {files: log.csv}}"
    return load_config(TWO_LINK, [f"drives={drives}", log, "validation.accept={}"])


def gravity_of_two_links(z):
    """Torques of gravity by hand, (n_samples, 2): masses of 2 kg at 0.25 m and 1 kg at (0.2, 0.01) m, a link of 0.5 m."""
    angle = z.sum(axis=1)
    fore = 1.0 * 9.81 * (0.2 * np.cos(angle) - 0.01 * np.sin(angle))
    return np.column_stack([(2.0 * 0.25 + 1.0 * 0.5) * 9.81 * np.cos(z[:, 0]) + fore, fore])


def searched(friction, drives=AUTO, noise=0.01, seed=0, loss=0.0, **keys):
    """The search on a log whose friction is a function of the speeds, (n_samples, 2), with a loss per load at the first joint."""
    log = two_link_log(seconds=30.0, rate=200.0, noise=0.0)
    dz = np.column_stack([log["dq1"], log["dq2"]])
    viscous, coulomb, offset = np.array(list(FRICTION.values())).T
    tau = np.column_stack([log["tau1"], log["tau2"]])
    tau -= viscous * dz + coulomb * np.sign(dz) + offset
    load = np.abs(gravity_of_two_links(np.column_stack([log["q1"], log["q2"]]))[:, 0])
    tau[:, 0] += loss * load * np.sign(dz[:, 0])
    tau += friction(dz) + noise * np.random.default_rng(seed).normal(size=tau.shape)
    log = {"t": log["t"], "q1": log["q1"], "q2": log["q2"], "tau1": tau[:, 0], "tau2": tau[:, 1]}
    section = LogSection(files=["log.csv"], **keys)
    config = robot(drives)
    dynamics = Dynamics(config.build_mechanism(), once=True)
    logs = RawLogs((RawLog("log.csv", log, 2),), ())
    return config, process_logs_of_robot(dynamics, config, section, logs)


def test_each_joint_gets_its_smoothing():
    def friction(dz):
        return np.tanh(dz / [0.5, 0.02]) * [1.2, 0.5] + [0.8, 0.2] * dz

    _, found = searched(friction, noise=0.1)
    search = found.friction
    assert search.drives == ("z_upper", "z_fore")
    assert 0.3 < search.smoothing[0] < 0.8
    assert search.smoothing[1] < 0.1
    assert search.error < 0.5 * search.usual_error
    assert np.isnan(search.stribeck_velocity).all()
    assert not search.asymmetry.any()
    assert not search.quadratic.any()


@pytest.mark.parametrize(
    ("term", "factor"),
    [
        ("stribeck_velocity", lambda v: 1.5 * (np.tanh(v / 0.02) - np.tanh(v / 0.4))),
        ("asymmetry", lambda v: 0.3 * np.abs(v)),
        ("quadratic", lambda v: 0.3 * v * np.abs(v)),
    ],
)
def test_a_term_is_added_where_it_is(term, factor):
    def friction(dz):
        tau = np.tanh(dz / 0.02) * [1.2, 0.5] + [0.8, 0.2] * dz
        tau[:, 0] += factor(dz[:, 0])
        return tau

    config, found = searched(friction)
    added = getattr(found.friction, term)
    chosen = np.isfinite(added) if term == "stribeck_velocity" else added
    assert chosen[0]
    changed = config.apply_friction(found.friction)
    kinds = {p.kind for p in changed.build_mechanism().parameters if p.owner == "z_upper"}
    expected = {
        "stribeck_velocity": Kind.STRIBECK,
        "asymmetry": Kind.ASYMMETRY,
        "quadratic": Kind.QUADRATIC,
    }
    assert {Kind.VISCOUS, Kind.COULOMB, Kind.OFFSET, expected[term]} <= kinds
    assert changed.automatic_friction == []


def test_terms_that_the_config_gives_are_part_of_the_search():
    """The friction of the search is that of the model: what is given is not made up for by other terms."""

    def friction(dz):
        tau = np.sign(dz) * [0.3, 0.5] + [0.8, 0.2] * dz
        return tau + 0.3 * np.abs(dz) * [1, 0]

    drives = {"all": {"friction": "auto"}, "z_upper": {"asymmetry": "unknown"}}
    given, chosen = (searched(friction, d)[1].friction for d in (drives, AUTO))
    assert given.asymmetry[0]
    for name in ("smoothing", "asymmetry", "quadratic", "load", "stribeck_velocity"):
        assert np.array_equal(getattr(given, name), getattr(chosen, name), equal_nan=True)
    # Joints are weighted by the noise that the friction leaves which the search began with.
    assert given.error == pytest.approx(chosen.error, rel=0.5)
    assert given.usual_error < 0.5 * chosen.usual_error


@pytest.mark.parametrize("given", [{}, {"z_upper": {"load": "unknown"}}])
def test_friction_that_grows_with_the_load_is_found(given):
    def friction(dz):
        return np.sign(dz) * [0.3, 0.5] + [0.8, 0.2] * dz

    drives = {"all": {"friction": "auto"}, **given}
    config, found = searched(friction, drives, loss=0.1)
    assert found.friction.load.tolist() == [True, False]
    mechanism = config.apply_friction(found.friction).build_mechanism()
    log = found.training
    W = Dynamics(mechanism).compute_regressor(log.z, log.dz, log.ddz)
    values = np.linalg.lstsq(W.reshape(-1, W.shape[2]), log.tau.ravel(), rcond=None)[0]
    assert values[mechanism.parameter_names.index("fl_z_upper")] == pytest.approx(0.1, rel=0.1)
    states = np.random.default_rng(0).uniform(-2, 2, size=(20, 2))
    K = Dynamics(mechanism).compute_regressor(states, 0 * states, 0 * states)
    gravity = gravity_of_two_links(states)
    assert K @ mechanism.nominal == pytest.approx(gravity, abs=0.05 * np.abs(gravity).max())


def test_noise_alone_adds_no_terms():
    def friction(dz):
        return np.tanh(dz / 0.05) * [1.2, 0.5] + [0.8, 0.2] * dz

    added = 0
    for seed in range(5):
        search = searched(friction, noise=0.3, seed=seed)[1].friction
        added += np.count_nonzero(
            search.asymmetry
            | search.quadratic
            | search.load
            | np.isfinite(search.stribeck_velocity)
        )
    assert added <= 1


def test_a_given_smoothing_stays():
    def friction(dz):
        return np.tanh(dz / 0.5) * [1.2, 0.5] + [0.8, 0.2] * dz

    drives = {"all": {"friction": "auto"}, "z_upper": {"smoothing": 0.1, "viscous": 0.8}}
    config, found = searched(friction, drives)
    assert found.friction.smoothing[0] == 0.1
    assert found.friction.smoothing[1] > 0.2
    section = config.apply_friction(found.friction).drives["z_upper"]
    assert (section.viscous, section.coulomb) == (0.8, "unknown")


def test_cutoffs_that_are_given_are_kept():
    def friction(dz):
        return np.tanh(dz / 0.3) + dz

    _, found = searched(friction, state_cutoff=20, torque_cutoff=5)
    assert (found.state_cutoff, found.torque_cutoff) == (20, 5)
    assert found.friction.error < found.friction.usual_error


def test_without_a_log_nothing_decides(tmp_path):
    from paramreduce_cli.errors import ConfigError

    with pytest.raises(ConfigError, match=r"is auto, but there is no sampling.log"):
        load_config(TWO_LINK, [f"drives={AUTO}"])


@pytest.mark.parametrize("tremble", [1e-13, 1e-10, 1e-8])
def test_a_joint_may_rest_in_all_folds_but_one(tremble):
    """Its columns are rounding, or hardly more, in the other folds."""
    rng = np.random.default_rng(0)
    drives = robot().build_mechanism().drives
    candidates = [list_signs(drive, 1.0) for drive in drives]
    folds = []
    for fold in range(5):
        t = 0.01 * np.arange(400) + 4 * fold
        rest = tremble * rng.normal(size=t.size)
        dz = np.column_stack([np.sin(t), rest if fold else np.sin(1.7 * t)])
        others = np.stack([dz, np.gradient(dz, 0.01, axis=0)], axis=2)
        friction = [
            friction_selection._compute_friction(drive, listed, dz, 0 * dz, (0, 1))
            for drive, listed in zip(drives, candidates, strict=True)
        ]
        tau = others.sum(axis=2) + np.sign(dz) + 0.02 * rng.normal(size=dz.shape)
        folds.append(np.concatenate([others, *friction, tau[..., None]], axis=2))
    band = band_scoring._factorise(folds)
    found = ShapeSearch(
        band, candidates, ((), ()), (False, False), np.ones(2, bool)
    ).choose_smoothings()
    assert found.error < 0.1
