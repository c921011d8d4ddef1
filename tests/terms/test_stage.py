"""reduce-terms on whole robots, its records and its exported code against definitions."""

import ctypes
import itertools
import json
import shutil
import subprocess
import sys
from functools import cache

import numpy as np
import pytest
from conftest import ONE_FORMAT, config_of

from paramreduce_cli.artifacts.store import Store, load_file
from paramreduce_cli.config import load_config
from paramreduce_cli.errors import ConfigError, ParamreduceWarning
from paramreduce_cli.export.code_generation import Exported, make_exported_model, make_functions
from paramreduce_cli.export.languages import languages
from paramreduce_cli.export.named_models import find_pruned_model
from paramreduce_cli.export.values import write_values
from paramreduce_cli.expressions.compiled import load
from paramreduce_cli.expressions.programs import Program
from paramreduce_cli.multibody.dynamics import Dynamics
from paramreduce_cli.multibody.loops.coordinates import Coordinates
from paramreduce_cli.records import Model, Reduction, Report, Samples, TermReduction
from paramreduce_cli.running.pipeline import list_stages, list_stages_to_run
from paramreduce_cli.running.runner import Runner
from paramreduce_cli.stages import reduce_terms
from paramreduce_cli.terms import leanest_program
from paramreduce_cli.texts import format_percent

TERMS = ("terms={}", "terms.torque_error=0.05", "terms.acceleration_error=0.2", "terms.rounds=4")
STAGES = {stage.name: stage for stage in list_stages()}


GEARED = """
robot: geared
description:
  gravity: [0, -9.81, 0]
  dh:
    joints:
      - {name: upper, a: 0}
      - {name: fore, a: 0.5}
parameter_sets:
  rods:
    upper: {m: 2.0, com: [0.25, 0, 0], inertia_com: [1e-3, 0, 0, 1/24, 0, 1/24]}
    fore: {m: 1.0, com: [0.2, 0.01, 0], inertia_com: [5e-4, 0, 0, 0.0135, 0, 0.0135]}
drives:
  z_upper: {viscous: 0.8, coulomb: 1.5}
  z_fore: {viscous: 0.2, coulomb: 0.5, inertia: 0.01}
trajectories: {position_limits: [-pi/2, pi/2], velocity_limits: 3, count: 2, harmonics: 2, points: 40, starts: 1, polished: 1}
selected: {torque_error: 0.05}
reduction: {heuristics: [qr, forward-selection]}
terms: {torque_error: 0.05, acceleration_error: 0.2, rounds: 0}
"""
FLOATING = """
robot: afloat
description:
  gravity: [0, 0, -9.81]
  tree:
    bodies:
      - {name: hull, joint: free}
      - {name: arm, parent: hull, joint: revolute, at: [{xyz: [0.2, 0, 0.1]}]}
parameter_sets:
  solid:
    hull: {m: 4.0, com: [0.02, 0, 0.01], inertia_com: [0.05, 0, 0, 0.06, 0, 0.07]}
    arm: {m: 1.0, com: [0.2, 0.01, 0], inertia_com: [5e-4, 0, 0, 0.0135, 0, 0.0135]}
trajectories: {position_limits: [-0.5, 0.5], velocity_limits: 1, count: 2, harmonics: 2, points: 60, starts: 1, polished: 1}
selected: {torque_error: 0.05}
reduction: {heuristics: [qr, forward-selection]}
terms: {torque_error: 0.05, acceleration_error: 0.3, functions: [direct], rounds: 0}
"""


def simplified(folder, robot, *overrides):
    """Run a config that ships as far as its functions with pruned terms."""
    return as_far(config_of(robot, ONE_FORMAT, *TERMS, *overrides), folder)


def as_far(config, folder):
    runner = Runner(config, Store(folder))
    for stage in list_stages_to_run(config):
        runner.run(stage)
        if stage.output is TermReduction:
            return runner
    raise AssertionError("there is no such stage")


def loaded(runner, record):
    return load_file(runner.store.get_path(record), record, None, "")[0]


@pytest.fixture(autouse=True, scope="module")
def few_starts():
    """Descend from three starts instead of a dozen, which take most of the time."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(leanest_program, "_FEWEST", 3)
        patch.setattr(leanest_program, "_MOST", 3)
        yield


LOOPS = ["four_bar-generalised", "four_bar-independent"]
OTHERS = {"geared": GEARED, "afloat": FLOATING}
"""An arm with friction and a rotor, and one on a floating base."""


@pytest.fixture(scope="module")
def run_of(made_once):
    """Runs of robots by name, each made once."""

    def config_for(name, folder):
        robot, _, counted = name.partition("-")
        if name not in OTHERS:
            counts = [f"validation.operations={counted}"] if counted else []
            return config_of(robot, ONE_FORMAT, *TERMS, *counts)
        path = folder / "config.yaml"
        path.write_text(OTHERS[name])
        return load_config(path, [ONE_FORMAT])

    @cache
    def made(name):
        folder = made_once(
            f"terms-{name}", lambda folder: as_far(config_for(name, folder), folder / "results")
        )
        return Runner(config_for(name, folder), Store(folder / "results"))

    return made


@pytest.fixture(scope="module")
def two_link(run_of):
    return run_of("two_link")


@pytest.fixture(params=LOOPS)
def four_bar(request, run_of):
    return run_of(request.param)


def errors_by_definition(runner, name):
    """Torque errors on both sets, from the stored program and plain formulas alone."""
    model, samples, found = (loaded(runner, r) for r in (Model, Samples, TermReduction))
    term = found.functions[name]
    mechanism, program = model.mechanism, Program.from_stored(term.program)
    coordinates = Coordinates(mechanism)
    result = []
    for part in (samples.estimation, samples.validation):
        off = total = 0.0
        for b in part.iterate_blocks():
            n = b.q.shape[1]
            tangent = np.broadcast_to(np.eye(n), (len(b.q), n, n))
            inputs = [*b.q.T, *b.dq.T, *b.ddq.T]
            ddq = b.ddq
            if mechanism.loops is not None:
                tangent = coordinates.compute_tangent(b.q)
            if term.projected:
                d, z = list(mechanism.dependent), list(mechanism.independent)
                drift = b.ddq[:, d] - np.einsum("kij,kj->ki", tangent[:, d], b.ddq[:, z])
                inputs += [*tangent[:, d].reshape(len(b.q), -1).T, *drift.T]
                n = mechanism.n_dof
                tangent, ddq = np.broadcast_to(np.eye(n), (len(b.q), n, n)), b.ddz
            values = [np.full(len(b.q), value) for value in term.values]
            given = [np.broadcast_to(x, len(b.q)) for x in program.evaluate([*values, *inputs])]
            torques = np.array(given).T
            if name == "direct":
                M = np.zeros((len(b.q), n, n))
                for (i, j), entry in zip(
                    zip(*np.tril_indices(n), strict=True), given, strict=False
                ):
                    M[:, i, j] = M[:, j, i] = entry
                torques = np.einsum("kij,kj->ki", M, ddq) + np.array(given[-n:]).T
                M_zz = np.einsum("kia,kij,kjb->kab", tangent, M, tangent)
                assert np.linalg.eigvalsh(M_zz).min() > 0
            tau = np.einsum("kij,ki->kj", tangent, torques)
            off += np.sum(((tau - b.tau) / model_weights(runner)) ** 2)
            total += np.sum((b.tau / model_weights(runner)) ** 2)
        result.append(float(np.sqrt(off / total)))
    return term, result


def model_weights(runner):
    return loaded(runner, Reduction).nominal_torque


def test_a_function_for_which_nothing_is_found_stops_no_run(tmp_path, monkeypatch):
    record = reduce_terms._make_record

    def none_for(*functions):
        def found(one, judge, *others):
            name = "direct" if judge.direct else "inverse"
            return None if name in functions else record(one, judge, *others)

        monkeypatch.setattr(reduce_terms, "_make_record", found)

    none_for("direct")
    with pytest.warns(
        ParamreduceWarning, match="nothing within 80 % of it, .* was found for the direct"
    ):
        runner = simplified(tmp_path, "two_link")
    assert list(loaded(runner, TermReduction).functions) == ["inverse"]
    for stage in list_stages_to_run(runner.config):
        runner.run(stage)
    summary = json.loads((tmp_path / "report" / "summary.json").read_text())
    assert [term["function"] for term in summary["terms"]] == ["inverse"]
    none_for("inverse", "direct")
    with pytest.raises(ConfigError, match="the inverse and the direct dynamics"):
        runner.run(STAGES["reduce-terms"], force=True)


@pytest.mark.parametrize("name", ["inverse", "direct"])
def test_errors_are_what_they_are_defined_as_and_within_the_budget(two_link, name):
    term, (estimation, validation) = errors_by_definition(two_link, name)
    assert term.torque_error.estimation == pytest.approx(estimation, rel=1e-9)
    assert term.torque_error.validation == pytest.approx(validation, rel=1e-9)
    assert max(estimation, validation) <= 0.05
    assert 0 < term.operations < term.operations_start
    assert term.operations == Program.from_stored(term.program).n_operations
    if name == "direct":
        assert term.smallest_eigenvalue > 0
        assert term.mass_states == 100_000
        assert max(term.acceleration_error.estimation, term.acceleration_error.validation) <= 0.2
    front = term.front
    assert np.all(np.diff(front.operations) > 0)
    assert front.torque_error.estimation[-1] < front.torque_error.estimation[0]


@pytest.mark.parametrize("name", ["inverse", "direct"])
def test_loops(four_bar, name):
    term, (estimation, validation) = errors_by_definition(four_bar, name)
    assert term.torque_error.estimation == pytest.approx(estimation, rel=1e-8)
    assert term.torque_error.validation == pytest.approx(validation, rel=1e-8)
    assert max(estimation, validation) <= 0.05
    assert 0 < term.random_states <= 1000
    assert np.isnan(term.random_acceleration_error) == (name == "inverse")
    if name == "direct":
        assert term.mass_states == term.random_states
        assert term.smallest_eigenvalue > 0


@pytest.mark.parametrize("name", ["inverse", "direct"])
def test_exported_functions_compute_the_same(four_bar, name):
    """The export checks itself against the stored program, projected by matrices."""
    model, found = loaded(four_bar, Model), loaded(four_bar, TermReduction)
    chosen, term, title = find_pruned_model(found, name)
    what = {"inverse": Exported.IDM, "direct": Exported.DDM}[name]
    for constant in (False, True):
        files = languages["python"](
            make_exported_model(
                model, chosen, title=title, what=what, constant=constant, simplified=term
            )
        )
        assert any(name.endswith(".py") for name in files)


def test_units_of_parameters_are_said(two_link):
    model = loaded(two_link, Model)
    chosen, term, title = find_pruned_model(loaded(two_link, TermReduction), "inverse")
    files = languages["c"](
        make_exported_model(model, chosen, title=title, what=Exported.IDM, simplified=term)
    )
    header = files["two_link.h"].decode()
    values = json.loads(write_values(chosen, title, "", model.mechanism)["parameters.json"])
    for k, (name, value, size) in enumerate(zip(term.names, term.values, term.units, strict=True)):
        si = model.mechanism.parameters[model.mechanism.parameter_names.index(name)].unit
        unit = si if size == 1.0 else f"({size:.9g} {si})"
        assert f"{name} = {value:.9g} {unit}\n" in header
        assert values["parameters"][k]["unit"] == unit
        assert values["parameters"][k]["unit_size"] == size
        assert chosen.standard[term.position == k] == pytest.approx(value * size)
    assert np.any(term.units != 1.0), "the arm's lengths are no units"


def given_by(runner, name):
    """What the stored program gives for states, in plain NumPy: torques, and M of the direct dynamics; of trees."""
    model, term = loaded(runner, Model), loaded(runner, TermReduction).functions[name]
    assert model.mechanism.loops is None
    program = Program.from_stored(term.program)

    def given(q, dq, ddq):
        count, n = q.shape
        inputs = [*(np.full(count, value) for value in term.values), *q.T, *dq.T, *ddq.T]
        outputs = np.array([np.broadcast_to(x, count) for x in program.evaluate(inputs)])
        if name == "inverse":
            return outputs.T, None
        M = np.zeros((count, n, n))
        for (i, j), entry in zip(zip(*np.tril_indices(n), strict=True), outputs, strict=False):
            M[:, i, j] = M[:, j, i] = entry
        return np.einsum("kij,kj->ki", M, ddq) + outputs[-n:].T, M

    return given


@pytest.mark.parametrize("name", ["inverse", "direct"])
def test_random_states_are_inside_the_limits_and_have_the_errors_that_are_said(two_link, name):
    """Drawn anew, other states of the same limits are as far off; the worst one is exactly."""
    model, samples = loaded(two_link, Model), loaded(two_link, Samples)
    term, given = loaded(two_link, TermReduction).functions[name], given_by(two_link, name)
    (low, dlow, ddlow), (high, dhigh, ddhigh) = term.drawn
    np.testing.assert_allclose([low, high], [[-np.pi / 2] * 2, [np.pi / 2] * 2])
    np.testing.assert_allclose([dlow, dhigh], [[-3] * 2, [3] * 2])
    np.testing.assert_array_equal([ddlow, ddhigh], [term.lower[2], term.upper[2]])  # no limits
    q, dq, ddq = np.random.default_rng(7).uniform(*term.drawn, size=(20_000, 3, 2)).swapaxes(0, 1)
    dynamics = Dynamics(model.mechanism)

    def off(q, dq, ddq):
        tau = dynamics.compute_torques(q, dq, ddq, model.values)
        torques, M = given(q, dq, ddq)
        return tau, tau - torques, M

    tau, missed, M = off(q, dq, ddq)
    nominal = model_weights(two_link)
    expected = np.linalg.norm(missed / nominal) / np.linalg.norm(tau / nominal)
    assert term.random_states == 10_000
    assert term.random_torque_error == pytest.approx(expected, rel=0.03)
    if name == "direct":
        scale = samples.nominal_acceleration
        caused = np.linalg.solve(M, missed[..., None])[..., 0] / scale
        expected = np.linalg.norm(caused) / np.linalg.norm(ddq / scale)
        assert term.random_acceleration_error == pytest.approx(expected, rel=0.1)
        assert 0 < term.smallest_eigenvalue <= np.linalg.eigvalsh(M).min() * 1.01
    _, worst, _ = off(*term.worst_state[:, None])
    assert abs(worst[0, term.worst_joint]) == pytest.approx(
        term.largest_difference[term.worst_joint], rel=1e-9
    )
    assert np.argmax(term.largest_difference / nominal) == term.worst_joint
    assert np.all(np.abs(missed).max(axis=0) < 1.1 * term.largest_difference)


def test_the_worst_state_of_loops_is_assembled_inside_the_limits(four_bar):
    model, found = loaded(four_bar, Model), loaded(four_bar, TermReduction)
    mechanism = model.mechanism
    for term in found.functions.values():
        (lower, upper), (z, dz, ddz) = term.drawn, term.worst_state[:, None]
        assert np.all((term.worst_state >= lower) & (term.worst_state <= upper))
        q, dq, ddq = Coordinates(mechanism).compute_states(z, dz, ddz)
        tau = Dynamics(mechanism).compute_torques(q, dq, ddq, model.values)
        assert np.abs(tau).max() < 5 * largest_torque(four_bar), "no singular one"


def largest_torque(runner):
    """Largest torque of the estimation set."""
    return max(np.abs(b.tau).max() for b in loaded(runner, Samples).estimation.iterate_blocks())


def recomputed_in_c(runner, name):
    """Errors of torques and accelerations on the validation set, by the exported C code, state by state."""
    model, samples = loaded(runner, Model), loaded(runner, Samples)
    mechanism, robot = model.mechanism, model.mechanism.robot
    chosen, term, title = find_pruned_model(loaded(runner, TermReduction), name)
    what = Exported.IDM if name == "inverse" else Exported.DDM
    files = languages["c"](
        make_exported_model(model, chosen, title=title, what=what, simplified=term)
    )
    header, source = files[f"{robot}.h"].decode(), files[f"{robot}.c"].decode()
    library = load(header + source.replace(f'#include "{robot}.h"', ""))
    function = getattr(library, f"{robot}_{name}_dynamics")
    (declared,) = make_functions(model, chosen, what, simplified=term)
    n, dependent = mechanism.n_dof, list(mechanism.dependent)
    results = {"inverse": [np.empty(n)], "direct": [np.empty((n, n)), np.empty(n)]}[name]
    off, total = np.zeros(2), np.zeros(2)
    nominal, scale = model_weights(runner), samples.nominal_acceleration
    for block in samples.validation.iterate_blocks():
        tangent = Coordinates(mechanism).compute_tangent(block.q)
        R = tangent[:, dependent]
        b = block.ddq[:, dependent] - np.einsum("kij,kj->ki", R, block.ddz)
        for k, (tau, ddz) in enumerate(zip(block.tau, block.ddz, strict=True)):
            state = {"q": block.q[k], "dq": block.dq[k], "ddq": block.ddq[k], "R": R[k], "b": b[k]}
            arrays = [
                np.ascontiguousarray(state.get(a.name, term.values)) for a in declared.arguments
            ]
            function(*[ctypes.c_void_p(one.ctypes.data) for one in (*arrays, *results)])
            torques, motion = results[0], ddz
            if name == "direct":
                M, delta = results
                torques, motion = M @ ddz + delta, np.linalg.solve(M, tau - delta)
            pairs = ((torques, tau, nominal), (motion, ddz, scale))
            off += [np.sum(((found - true) / unit) ** 2) for found, true, unit in pairs]
            total += [np.sum((true / unit) ** 2) for _, true, unit in pairs]
    return term, np.sqrt(off / total)


@pytest.mark.skipif(shutil.which("gcc") is None, reason="gcc is not installed")
@pytest.mark.parametrize(
    ("robot", "name"),
    [
        *itertools.product(["two_link", *LOOPS, "geared"], ["inverse", "direct"]),
        ("afloat", "direct"),
    ],
)
def test_the_exported_c_has_the_reported_errors_on_the_validation_set(robot, name, run_of):
    term, (torque_error, acceleration_error) = recomputed_in_c(run_of(robot), name)
    assert term.torque_error.validation == pytest.approx(torque_error, rel=1e-9)
    if name == "direct":
        assert term.acceleration_error.validation == pytest.approx(acceleration_error, rel=1e-9)


@pytest.mark.parametrize("robot", OTHERS)
def test_friction_and_floating_bases(robot, run_of):
    """Errors by definition, and columns of friction among those that are left."""
    others = run_of(robot)
    for name, term in loaded(others, TermReduction).functions.items():
        _, (estimation, validation) = errors_by_definition(others, name)
        assert term.torque_error.estimation == pytest.approx(estimation, rel=1e-8)
        assert term.torque_error.validation == pytest.approx(validation, rel=1e-8)
        assert max(estimation, validation) <= 0.05
        assert term.operations < term.operations_start
        assert 0 < term.random_torque_error < 0.5
        if robot == "geared":
            assert any(one.startswith(("fv", "fc")) for one in term.names)


@pytest.mark.parametrize("name", ["inverse", "direct"])
def test_the_exported_header_says_where_a_function_holds(two_link, name):
    model = loaded(two_link, Model)
    chosen, term, title = find_pruned_model(loaded(two_link, TermReduction), name)
    what = Exported.IDM if name == "inverse" else Exported.DDM
    files = languages["c"](
        make_exported_model(model, chosen, title=title, what=what, simplified=term)
    )
    header = " ".join(files["two_link.h"].decode().replace("*", " ").split())
    assert "NEGLIGIBLE TERMS WERE PRUNED" in header
    names = model.mechanism.coordinate_names
    joints = zip(
        names, term.lower.T, term.upper.T, term.largest_difference,
        strict=True,
    )  # fmt: skip
    for joint, lower, upper, largest in joints:
        assert (
            f"{joint}: position {lower[0]:.4g} to {upper[0]:.4g} rad, velocity {lower[1]:.4g}"
            in header
        )
        assert f"{joint}: {largest:.3g} " in header
    for joint, (lower, upper) in zip(names, np.moveaxis(term.drawn, 2, 0), strict=True):
        assert f"{joint}: position {lower[0]:.4g} to {upper[0]:.4g} rad, velocity {lower[1]:.4g} to {upper[1]:.4g}" in header  # fmt: skip
    said = f"Torque error on {term.random_states} random states: {format_percent(term.random_torque_error)}."
    assert said in header
    assert f"that of {names[term.worst_joint]}, at" in header
    for joint, state in zip(names, term.worst_state.T, strict=True):
        assert f"{joint}: position {state[0]:.4g} rad, velocity {state[1]:.4g} rad/s" in header
    eigenvalue = f"on {term.mass_states} random states: {term.smallest_eigenvalue:.3g}."
    error = f"accelerations on the random states: {format_percent(term.random_acceleration_error)}."
    assert (eigenvalue in header) == (error in header) == (name == "direct")
    assert "allowed 5 %" in header
    values = write_values(chosen, title, "", model.mechanism, term)["parameters.json"].decode()
    for line in json.loads(values)["holds"]:
        assert " ".join(line.split()) in header
    errors = (term.acceleration_error.estimation, term.acceleration_error.validation)
    assert (" / ".join(map(format_percent, errors)) in header) == (name == "direct")


def test_what_is_found_does_not_depend_on_processes(two_link, tmp_path, monkeypatch):
    monkeypatch.setattr(leanest_program, "_MANY", 0)
    started, start_searchers = [], leanest_program.start_searchers
    monkeypatch.setattr(
        leanest_program,
        "start_searchers",
        lambda one, jobs, *more: started.append(jobs) or start_searchers(one, jobs, *more),
    )
    shutil.copytree(two_link.store.folder, tmp_path / "r")
    runner = Runner(two_link.config, Store(tmp_path / "r"), jobs=2)
    runner.run(STAGES["reduce-terms"], force=True)
    assert started == [2, 2]
    one, two = loaded(two_link, TermReduction), loaded(runner, TermReduction)
    for name in ("inverse", "direct"):
        np.testing.assert_array_equal(one.functions[name].values, two.functions[name].values)
        assert one.functions[name].operations == two.functions[name].operations


def test_a_search_that_its_time_ended_is_said(two_link, tmp_path):
    shutil.copytree(two_link.store.folder, tmp_path / "r")
    config = config_of("two_link", ONE_FORMAT, *TERMS, "terms.time_limit=1e-6")
    runner = Runner(config, Store(tmp_path / "r"))
    ended = r"terms\.time_limit ended the search for the inverse"
    with pytest.warns(ParamreduceWarning, match=ended):
        runner.run(STAGES["reduce-terms"])
    before, after = loaded(two_link, TermReduction), loaded(runner, TermReduction)
    for name, whole in before.functions.items():
        found = after.functions[name]
        assert whole.operations <= found.operations < whole.operations_start
        assert found.torque_error.validation <= config.terms.torque_error


def share_of(row, kind, part, budget):
    """An error as a share of what is allowed; zero where there is none."""
    error = row[f"{kind}_error"][part]
    return 0.0 if error is None else error / budget[kind]


def test_summary_and_page(two_link, tmp_path, invoke):
    shutil.copytree(two_link.store.folder, tmp_path / "r")
    runner = Runner(two_link.config, Store(tmp_path / "r"))
    for stage in ("validate", "report"):
        runner.run(STAGES[stage])
    path = runner.store.get_path(Report)
    summary = json.loads(path.read_text())
    assert [one["function"] for one in summary["terms"]] == ["inverse", "direct"]
    for one in summary["terms"]:
        assert max(one["torque_error"][part] for part in ("estimation", "validation")) <= 0.04
        assert one["torque_error"]["test"]["median"] <= 0.05
        assert one["pareto"][0]["operations"] <= one["operations"]
        strains = [
            max(
                share_of(row, kind, part, one["budget"])
                for kind in ("torque", "acceleration")
                for part in ("estimation", "validation")
            )
            for row in one["pareto"]
        ]
        assert np.all(np.diff(strains) < 0), "no leaner one is as good"
        least = summary["selected"]["leanest"][one["function"]]
        assert least["model"] == "terms"
        assert least["operations"] == one["operations"]
    page = path.with_name("index.html").read_text()
    for one in summary["terms"]:
        assert f"{one['operations']} with pruned terms</a>, which is the leanest" in page
    common = ("export", "configs/two_link.yaml", "--results", tmp_path / "r", "--what", "idm")
    sets = [part for setting in (ONE_FORMAT, *TERMS) for part in ("--set", setting)]
    for name in ("leanest", "terms"):
        invoke(*common, *sets, "--model", name, "--output", tmp_path / name)
    for file in ("two_link.c", "two_link.h"):
        assert (tmp_path / "leanest" / file).read_text() == (tmp_path / "terms" / file).read_text()
    nothing = ("--set", "selected={torque_error: 1e-30}")
    invoke(
        "validate", "configs/two_link.yaml", "--results", tmp_path / "r", *sets, *nothing, code=1
    )
    refused = invoke(*common, *sets, *nothing, "--model", "leanest", code=2)
    assert "no model's inverse dynamics is within" in refused.err
    assert "Pruned terms" in page
    term = loaded(runner, TermReduction).functions["direct"]
    ranges = (path.parent / "tables" / "term-ranges.csv").read_text()
    assert f"{term.lower[0, 0]:.4g} to {term.upper[0, 0]:.4g}" in ranges
    differences = (path.parent / "tables" / "term-differences.csv").read_text()
    assert f"{term.largest_difference[1]:.3g}" in differences
    assert f"{term.worst_state[0, 1]:.4g}" in differences
    assert f"{term.lower[1, 1]:.4g} to {term.upper[1, 1]:.4g}" in page
    assert (path.parent / "figures" / "terms.svg").exists()


def test_accelerations_of_pruned_functions_are_exported(two_link, tmp_path, invoke):
    """Units of FMI simulate the pruned mass matrix and bias; Python's self-test compares with their accelerations."""
    shutil.copytree(two_link.store.folder, tmp_path / "r")
    common = ("export", "configs/two_link.yaml", "--results", tmp_path / "r", "--model", "terms")
    sets = [part for setting in (ONE_FORMAT, *TERMS) for part in ("--set", setting)]
    out = tmp_path / "out"
    invoke(*common, *sets, "--what", "ddm", "--format", "fmu", "--output", tmp_path / "units")
    invoke(*common, *sets, "--what", "forward-dynamics", "--format", "python", "--output", out)
    assert (tmp_path / "units" / "two_link_forward_dynamics.fmu").exists()
    test = [sys.executable, "two_link_test.py"]
    done = subprocess.run(test, cwd=out, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout
    assert "forward_dynamics" in done.stdout


def test_measured_torques_are_fitted_and_what_is_held_out_is_not_looked_at(measured_copy):
    settings = [text for text in TERMS if "acceleration" not in text]
    settings.append("terms.torque_error=0.2")
    config = load_config(measured_copy / "arm.yaml", [ONE_FORMAT, *settings])
    runner = Runner(config, Store(measured_copy / "results"))
    runner.run(STAGES["reduce-terms"])
    for name in ("inverse", "direct"):
        term, (estimation, validation) = errors_by_definition(runner, name)
        assert term.torque_error.estimation == pytest.approx(estimation, rel=1e-8)
        assert term.torque_error.validation == pytest.approx(validation, rel=1e-8)
        assert estimation <= 0.2
        assert np.isnan(term.random_torque_error), "torques at other states are not known"
        assert term.random_states == 0
        assert term.mass_states == (100_000 if name == "direct" else 0)
        assert np.isnan(term.drawn).all() == (name == "inverse")


def test_errors_on_a_log_are_watched_on_other_quarters_than_are_fitted(measured_copy, monkeypatch):
    seen = []

    def nothing(searcher, starts, **__):
        seen.extend([searcher.search_samples, searcher.closely])
        return leanest_program.Found([], [])

    module = sys.modules["paramreduce_cli.stages.reduce_terms"]
    monkeypatch.setattr(module, "simplify", nothing)
    settings = [text for text in TERMS if "acceleration" not in text]
    config = load_config(measured_copy / "arm.yaml", [ONE_FORMAT, *settings])
    runner = Runner(config, Store(measured_copy / "results"))
    with pytest.raises(ConfigError):
        runner.run(STAGES["reduce-terms"])
    blocks = loaded(runner, Samples).estimation.iterate_blocks()
    training = np.hstack([np.vstack([b.z.T, b.dz.T]) for b in blocks])

    def places(some):
        return np.array(
            [np.argmin(np.abs(training.T - z).sum(axis=1)) for z in some.states[: len(training)].T]
        )

    assert len(seen) == 4, "of two functions, at first and closely"
    for some in seen:
        parts = [places(part) for part in (some.samples, some.watched)]
        every = np.sort(np.concatenate(parts))
        assert np.all(np.diff(every) > 0), "none is in both"
        quarters = [np.searchsorted(every, part) * 4 // every.size for part in parts]
        assert [set(numbers.tolist()) for numbers in quarters] == [{0, 2}, {1, 3}]


def test_bad_input(two_link, invoke, tmp_path):
    config = config_of("two_link", *TERMS)
    assert config.terms is not None
    results = tmp_path / "r"
    shutil.copytree(two_link.store.folder, results)
    common = ("--results", results)
    sets = [part for setting in (ONE_FORMAT, *TERMS) for part in ("--set", setting)]
    path = "configs/two_link.yaml"
    refused = invoke("reduce-terms", path, *common, code=2)
    assert "terms is missing" in refused.err
    refused = invoke(
        "reduce-terms", path, *common, *sets, "--set", "terms.torque_error=1e-15", code=2
    )
    assert "terms.torque_error" in refused.err
    refused = invoke("reduce-terms", path, *common, *sets, "--set", "terms.torque_error=2", code=2)
    assert "less than 1" in refused.err
    for options, said in (
        ((), "--what idm or --what ddm"),
        (("--what", "regressor"), "each function has its own values"),
        (("--what", "idm", "--format", "urdf"), "not for a robot's file"),
    ):
        refused = invoke("export", path, *common, *sets, "--model", "terms", *options, code=2)
        assert said in refused.err
