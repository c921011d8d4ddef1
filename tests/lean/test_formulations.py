"""Formulations against textbook recursion, and what they take."""

import dataclasses

import casadi as ca
import numpy as np
import pytest
from conftest import MECHANISMS, whole
from oracles import textbook
from trees import random_tree

from paramreduce_cli.errors import FormulationError
from paramreduce_cli.expressions.graph import Graph
from paramreduce_cli.expressions.programs import Program
from paramreduce_cli.lean import formulation_search, lean_verification
from paramreduce_cli.lean import formulations as module
from paramreduce_cli.lean.formulations import add_formulations, find_formulations, vary_formulation
from paramreduce_cli.lean.joint_formulations import (
    OPTIONS,
    JointFormulation,
    from_data,
    list_alternatives,
    to_data,
)
from paramreduce_cli.lean.joint_frames import choose_frames
from paramreduce_cli.lean.lean_models import LeanModels
from paramreduce_cli.lean.lean_outputs import build_direct_outputs, build_inverse_outputs
from paramreduce_cli.multibody.dynamics import Dynamics
from paramreduce_cli.multibody.textbook_dynamics import PlainDynamics
from paramreduce_cli.records import Formulations, Run


def random_choices(count, rng):
    def one():
        return {name: values[rng.integers(len(values))] for name, values in OPTIONS.items()}

    return [JointFormulation(**one()) for _ in range(count)]


def relative(values, expected):
    got = np.column_stack([np.broadcast_to(value, expected.shape[0]) for value in values])
    return np.abs(got - expected).max() / np.abs(expected).max()


def compared(mechanism, choices, rng, samples=30):
    """Errors of d and of [M | delta] against textbook recursion, relative to the largest value."""
    q, dq, ddq = rng.normal(size=(3, samples, mechanism.n_q))
    phi = rng.normal(size=mechanism.n_parameters)
    plain = Dynamics(mechanism, once=True)
    M, delta = plain.compute_mass_matrix_and_bias(q, dq, phi)
    inputs = [*np.tile(phi, (samples, 1)).T, *q.T, *dq.T, *ddq.T]
    tree = choose_frames(mechanism)

    def evaluated(build):
        graph = Graph()
        return Program.from_graph(graph, build(tree, choices, graph)).evaluate(inputs)

    rows, columns = np.tril_indices(mechanism.n_q)
    direct = np.hstack([M[:, rows, columns], delta])
    return (
        relative(evaluated(build_inverse_outputs), plain.compute_torques(q, dq, ddq, phi)),
        relative(evaluated(build_direct_outputs), direct),
    )


@pytest.mark.parametrize("tree", [*MECHANISMS, *range(12)])
def test_any_choices_are_the_same_dynamics(tree):
    named = tree in MECHANISMS
    mechanism = MECHANISMS[tree]() if named else random_tree(tree)
    rng = np.random.default_rng(1 if named else tree)
    for _ in range(10 if named else 5):
        choices = random_choices(mechanism.n_q, rng)
        assert max(compared(mechanism, choices, rng)) < 1e-12


def test_choices_survive_being_written_down():
    rng = np.random.default_rng(0)
    for choice in random_choices(20, rng):
        assert from_data(to_data(choice)) == choice


def test_alternatives_differ_and_come_once():
    joint = choose_frames(MECHANISMS["puma"]()).joints[2]
    found = list_alternatives(JointFormulation(), joint)
    assert JointFormulation() not in found
    assert len(set(found)) == len(found)
    assert JointFormulation(aligned=True) in found


def test_parallel_and_opposite_axes_are_found(puma):
    joints = choose_frames(puma.mechanism).joints
    assert [joint.parallel for joint in joints] == [False, False, True, False, False, False]


PAPERS_PUMA = "m_3 Izz_5 Izz_3 my_6 mx_6 my_5 mx_2 my_4 Izz_4 my_3 Izz_6 Ixx_3 Ixz_2 mx_4 Ixx_4 mx_5 Iyy_3 my_2"
PAPERS_HEXAGLIDE = (
    "m_P Izz_P m_4 mz_1 m_5 mz_2 mz_6 m_3 mz_P mx_1 m_2 mz_4 m_6 Ixx_1 Iyy_P Ixx_P m_1"
)
FEW_OPERATIONS = "m_P mz_P Ixx_P Iyy_P Izz_P m_1 m_2 m_3 m_4 m_5 m_6 mz_1 Iyy_2 Iyy_5 Ixx_6 Iyy_6"


@pytest.mark.parametrize(
    ("name", "kept", "inverse", "direct"),
    [
        ("puma", "full", 480, 546), ("puma", "base", 445, 513), ("puma", PAPERS_PUMA, 315, 393),
        ("hexaglide", "full", 532, 445), ("hexaglide", "base", 508, 421),
        ("hexaglide", PAPERS_HEXAGLIDE, 216, 170), ("hexaglide", FEW_OPERATIONS, 143, 105),
    ],
)  # fmt: skip
def test_operations_of_the_leanest_formulations(name, kept, inverse, direct, request):
    model = request.getfixturevalue(name)
    names = model.mechanism.parameter_names
    columns = {"full": np.flatnonzero(model.affecting), "base": np.sort(model.base.columns)}
    kept = columns[kept] if kept in columns else np.sort([names.index(k) for k in kept.split()])
    lean, reduced = LeanModels(model), whole(model.mechanism, kept)
    assert lean.build_inverse(reduced).n_operations == inverse
    assert lean.build_direct(reduced).n_operations == direct


def test_any_subset_of_a_formulation_is_the_reduced_model(puma):
    rng = np.random.default_rng(4)
    mechanism = puma.mechanism
    for n in (5, 15, 30):
        kept = np.sort(rng.choice(np.flatnonzero(puma.affecting), n, replace=False))
        states = tuple(rng.normal(size=(3, 40, mechanism.n_q)))
        lean_verification.check_formulations(mechanism, puma.formulations, kept, states, rng)


def test_a_wrong_formulation_is_an_error(puma, monkeypatch):
    rng = np.random.default_rng(0)
    states = tuple(rng.normal(size=(3, 10, 6)))
    kept = np.flatnonzero(puma.affecting)
    right = lean_verification.Dynamics.compute_torques
    monkeypatch.setattr(
        lean_verification.Dynamics, "compute_torques", lambda self, *a: right(self, *a) * (1 + 1e-8)
    )
    with pytest.raises(FormulationError, match="off by 1"):
        lean_verification.check_formulations(puma.mechanism, puma.formulations, kept, states, rng)


def test_tied_and_known_parameters_take_less(puma):
    kept = np.flatnonzero(puma.affecting)
    lean = LeanModels(puma)
    reduced = whole(puma.mechanism, kept, kept / 7)
    count = lean.build_inverse(reduced).n_operations
    position = reduced.position.copy()
    position[kept[20:30]] = position[kept[5]]
    tied = dataclasses.replace(reduced, position=position)
    assert lean.build_inverse(tied).n_operations <= count
    assert lean.build_inverse(reduced, constant=True).n_operations < count


def test_estimates_are_near_the_counts(puma):
    rng = np.random.default_rng(2)
    lean = LeanModels(puma)
    for n in (6, 12, 18, 30, 45):
        kept = np.sort(rng.choice(np.flatnonzero(puma.affecting), n, replace=False))
        count = lean.build_inverse(whole(puma.mechanism, kept)).n_operations
        assert count <= lean.estimate_operations(kept) <= 1.1 * count + 10


@pytest.mark.parametrize("seed", [1, 3, 5])
def test_lean_models_never_take_more_than_plain_recursion(seed, puma):
    mechanism = random_tree(seed)
    default = tuple(to_data(JointFormulation()) for _ in range(mechanism.n_q))
    lean = LeanModels(
        dataclasses.replace(
            puma,
            mechanism=mechanism,
            affecting=np.ones(mechanism.n_parameters, dtype=np.bool_),
            formulations=Formulations((default,), (default,)),
        )
    )
    plain = PlainDynamics(mechanism)
    rng = np.random.default_rng(seed)
    for n in (0, 1, 3, 8, 20, mechanism.n_parameters):
        kept = np.sort(rng.choice(mechanism.n_parameters, n, replace=False))
        reduced = whole(mechanism, kept)
        inverse, direct = plain.count_operations(reduced)
        assert lean.build_inverse(reduced).n_operations <= inverse
        assert lean.build_direct(reduced).n_operations <= direct
    assert lean.build_inverse(reduced).n_operations > 0  # of all parameters


@pytest.mark.parametrize("name", ["standard", "tree"])
def test_lean_models_take_less_than_textbooks(name, puma):
    mechanism = MECHANISMS[name]()
    rng = np.random.default_rng(0)
    K = Dynamics(mechanism, once=True).compute_regressor(*rng.normal(size=(3, 50, mechanism.n_q)))
    affecting = np.abs(K).max(axis=(0, 1)) > 1e-9
    kept = np.flatnonzero(affecting)
    found = find_formulations(mechanism, affecting, kept)
    lean = LeanModels(
        dataclasses.replace(puma, mechanism=mechanism, affecting=affecting, formulations=found)
    )
    inverse, direct = textbook.count(mechanism, kept)
    assert lean.build_inverse(whole(mechanism, kept)).n_operations <= 0.85 * inverse
    assert lean.build_direct(whole(mechanism, kept)).n_operations <= 0.6 * direct


def test_equal_branches_get_equal_choices(hexaglide):
    names = [body.name for body in hexaglide.mechanism.bodies]
    legs = [names.index(str(leg)) for leg in range(1, 7)]
    for some in (*hexaglide.formulations.inverse, *hexaglide.formulations.direct):
        assert all(some[leg] == some[legs[0]] for leg in legs)


def test_the_search_repeats_itself(hexaglide, monkeypatch):
    monkeypatch.setattr(formulation_search, "_found", {})
    again = find_formulations(hexaglide.mechanism, hexaglide.affecting, hexaglide.base.columns)
    assert again == hexaglide.formulations


def test_processes_find_what_one_finds(puma, monkeypatch):
    monkeypatch.setattr(module, "_MANY", 0)
    told = []
    run = Run(jobs=2, progress=told.append)
    found = find_formulations(puma.mechanism, puma.affecting, puma.base.columns, run)
    assert found == puma.formulations
    assert (told[-1].done, told[-1].total) == (6, 6)


def test_no_subsets_ask_for_no_formulations(puma):
    assert add_formulations(puma, [], direct=False, jobs=2) == puma.formulations


def test_unknown_choices_are_refused():
    with pytest.raises(ValueError, match="nowhere"):
        from_data({"mass": "nowhere"})


@pytest.mark.parametrize("name", list(MECHANISMS))
def test_the_textbook_oracle_is_the_same_dynamics(name):
    mechanism = MECHANISMS[name]()
    n = mechanism.n_q
    rng = np.random.default_rng(0)
    q, dq, ddq = rng.normal(size=(3, n))
    phi = rng.normal(size=mechanism.n_parameters)
    symbols = [ca.SX.sym("x", len(x)) for x in (q, dq, ddq, phi)]
    found = ca.Function("d", symbols, [textbook.torques(mechanism, *symbols, mechanism.gravity)])
    expected = Dynamics(mechanism, once=True).compute_torques(q[None], dq[None], ddq[None], phi)[0]
    assert found(q, dq, ddq, phi).full().ravel() == pytest.approx(expected, rel=1e-12, abs=1e-11)


@pytest.mark.parametrize("direct", [False, True])
def test_formulations_for_some_parameters_are_the_same_dynamics_and_take_no_more(puma, direct):
    """Three parameters of the wrist and two before it, for which none of the model's own was searched."""
    names, kind = puma.mechanism.parameter_names, "direct" if direct else "inverse"
    kept = np.sort([names.index(k) for k in ("Iyy_2", "mx_3", "my_5", "Izz_5", "Ixz_6")])
    found = add_formulations(puma, [kept], direct=direct)
    known = getattr(puma.formulations, kind)
    new = [one for one in getattr(found, kind) if one not in known]
    assert getattr(found, kind)[: len(known)] == known
    assert new
    assert add_formulations(puma, [kept], direct=direct, jobs=2) == found
    for choices in new:
        errors = compared(puma.mechanism, list(map(from_data, choices)), np.random.default_rng(0))
        assert max(errors) < 1e-12
    tree = choose_frames(puma.mechanism)
    build = build_direct_outputs if direct else build_inverse_outputs
    dropped = set(range(len(names))) - set(kept.tolist())

    def count(choices):
        graph = Graph()
        return graph.count_operations(build(tree, list(map(from_data, choices)), graph, dropped))

    assert min(map(count, new)) < min(map(count, known))


def test_varied_formulations_have_one_or_two_other_choices_or_joints_of_another_one(puma):
    one, *others = puma.formulations.inverse
    kinds = {"choices": 0, "joints": 0}
    for seed in range(60):
        found = vary_formulation(one, others, puma.mechanism, np.random.default_rng(seed))
        assert found == vary_formulation(one, others, puma.mechanism, np.random.default_rng(seed))
        assert tuple(to_data(from_data(choices)) for choices in found) == found
        changed = [k for k in range(6) if found[k] != one[k]]
        taken = any(
            all(found[k] == (other[k] if first <= k <= last else one[k]) for k in range(6))
            for other in others
            for first in range(6)
            for last in range(first, 6)
        )
        assert taken or 1 <= len(changed) <= 2
        kinds["joints" if taken else "choices"] += 1
    assert min(kinds.values()) > 10


@pytest.mark.parametrize("direct", [False, True])
def test_the_leanest_formulation_alone_takes_what_the_leanest_of_all_does(puma, direct):
    def operations(lean):
        function = lean.build_direct if direct else lean.build_inverse
        return function(reduced, rewritten=False).n_operations

    lean, reduced = LeanModels(puma), whole(puma.mechanism, np.sort(puma.base.columns))
    known = lean.get_formulations(direct=direct)
    found = lean.choose_formulation(reduced, direct=direct)
    assert found in known
    each = [operations(lean.restrict_to(one, direct=direct)) for one in known]
    assert each[known.index(found)] == min(each) == operations(lean)
