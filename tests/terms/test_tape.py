"""Tapes against the program that is left when terms are set to zero."""

import numpy as np
import pytest

from paramreduce_cli.expressions.graph import Graph
from paramreduce_cli.expressions.programs import Program
from paramreduce_cli.terms import kernels
from paramreduce_cli.terms.kernels import ITSELF, NUMBER, WHOLE
from paramreduce_cli.terms.tape import Tape


@pytest.fixture
def program():
    """Two outputs, linear in the first two inputs, with all that tapes know."""
    g = Graph()
    a, b, x, y = map(g.input, range(4))
    s, c = g.call("sin", x), g.call("cos", g.add(x, y))
    inner = g.add(g.multiply(a, s), g.multiply(b, g.subtract(c, y)))
    drag = g.multiply(b, g.add(g.call("tanh", y), g.multiply(g.constant(0.1), g.call("sign", x))))
    outputs = [g.add(g.multiply(inner, y), drag), g.negate(g.add(inner, g.multiply(a, y)))]
    return Program.from_graph(g, outputs)


@pytest.fixture
def inputs():
    rng = np.random.default_rng(0)
    return np.vstack([np.full((2, 20), [[0.7], [-0.3]]), rng.uniform(-1, 1, (2, 20))])


def random_remains(tape, seed):
    """Some terms left out, and some nodes that stand for others, times a factor, or for numbers."""
    rng = np.random.default_rng(seed)
    candidates = tape.list_candidates()
    pruning = tape.keep_all().flip(candidates[rng.random(len(candidates)) < 0.12])
    linear, made = tape.mark_dependent(2), tape.mark_computed()
    for k in np.flatnonzero(made & (rng.random(tape.size) < 0.15)):
        like = np.flatnonzero(linear[:k] == linear[k])
        factor = rng.choice([1.0, -1.0, 0.37, -2.2])
        if not linear[k] and rng.random() < 0.3:
            pruning = pruning.replace(k, NUMBER, factor)
        elif like.size:
            pruning = pruning.replace(k, int(rng.choice(like)), factor)
    for k in tape.find_constants()[rng.random(tape.find_constants().size) < 0.3]:
        pruning = pruning.replace(k, NUMBER, 1.0)
    return pruning


def everywhere(tape):
    return np.ones(tape.size, dtype=bool)


def outputs_of(tape, pruning, inputs):
    values = tape.evaluate(pruning, inputs, tape.mark_live(pruning))
    return [values[o >> 1] * (-1 if o & 1 else 1) for o in tape.program.outputs]


@pytest.mark.parametrize("seed", range(40))
def test_what_is_left_is_the_program_with_terms_set_to_zero(program, inputs, seed):
    tape = Tape(program)
    pruning = random_remains(tape, seed)
    rebuilt = tape.rebuild(pruning)
    expected = [np.broadcast_to(v, 20) for v in rebuilt.evaluate(list(inputs))]
    np.testing.assert_allclose(outputs_of(tape, pruning, inputs), expected, atol=1e-14)
    assert rebuilt.n_operations <= tape.count_operations(pruning) <= program.n_operations


def test_a_constant_that_stands_for_one_saves_all_products_with_it():
    g = Graph()
    p, x, y = map(g.input, range(3))
    length = g.constant(1.07)
    lengths = g.add(g.multiply(length, x), g.multiply(x, g.multiply(length, y)))
    tape = Tape(Program.from_graph(g, [g.multiply(p, lengths)]))
    (constant,) = tape.find_constants()
    pruning = tape.keep_all().replace(constant, NUMBER, 1.0)
    assert tape.count_operations(pruning) == tape.count_operations(tape.keep_all()) - 2
    assert tape.rebuild(pruning).n_operations == tape.count_operations(pruning)
    itself = np.array([[constant, ITSELF]])
    assert itself[0].tolist() in tape.list_candidates().tolist()
    assert tape.count_operations(pruning.flip(itself)) == tape.count_operations(tape.keep_all())


@pytest.mark.parametrize("seed", range(40))
def test_what_is_left_is_linear_in_the_parameters(program, inputs, seed):
    tape = Tape(program)
    pruning = random_remains(tape, seed)

    def at(a, b):
        return np.array(
            outputs_of(tape, pruning, np.vstack([np.full(20, a), np.full(20, b), inputs[2:]]))
        )

    np.testing.assert_allclose(at(0, 0), 0, atol=1e-14)
    np.testing.assert_allclose(2 * at(1, 0) - 3 * at(0, 1), at(2, -3), atol=1e-13)


@pytest.mark.parametrize("seed", range(5))
def test_adjoints_are_derivatives(program, inputs, seed):
    tape = Tape(program)
    pruning = random_remains(tape, seed) if seed else tape.keep_all()
    values = tape.evaluate(pruning, inputs, everywhere(tape))
    seeds = np.eye(2)[:, :, None] * np.ones(20)
    adjoints = tape.compute_adjoints(pruning, values, seeds, everywhere(tape))
    places = {int(n.number): k for k, n in enumerate(program.nodes) if n.operation == "input"}
    for position in (0, 1, 3):
        if not pruning.kept[places[position], WHOLE]:
            continue
        ahead, behind = inputs.copy(), inputs.copy()
        ahead[position] += 1e-6
        behind[position] -= 1e-6
        change = (
            np.subtract(outputs_of(tape, pruning, ahead), outputs_of(tape, pruning, behind)) / 2e-6
        )
        np.testing.assert_allclose(adjoints[places[position]], change, atol=1e-8)


@pytest.mark.parametrize("seed", range(10))
def test_nodes_that_are_not_asked_for_change_nothing(program, inputs, seed):
    tape = Tape(program)
    pruning = random_remains(tape, seed)
    seeds, linear = np.eye(2)[:, :, None] * np.ones(20), tape.mark_dependent(2)
    values = tape.evaluate(pruning, inputs, everywhere(tape))
    some = tape.evaluate(pruning, inputs, tape.mark_live(pruning))
    np.testing.assert_array_equal(some[tape.mark_live(pruning)], values[tape.mark_live(pruning)])
    np.testing.assert_array_equal(
        tape.compute_adjoints(pruning, some, seeds, linear)[linear],
        tape.compute_adjoints(pruning, values, seeds, everywhere(tape))[linear],
    )


@pytest.mark.parametrize("seed", range(10))
def test_what_is_in_memory_where_there_are_no_derivatives_is_not_told(
    program, inputs, seed, monkeypatch
):
    tape = Tape(program)
    pruning = random_remains(tape, seed)
    swept = kernels.accumulate_adjoints

    def spoilt(*arguments):
        found, reached = swept(*arguments)
        found[~reached] = np.nan
        return found, reached

    monkeypatch.setattr(kernels, "accumulate_adjoints", spoilt)
    values = tape.evaluate(pruning, inputs, everywhere(tape))
    given = (pruning, values, np.eye(2)[:, :, None] * np.ones(20), everywhere(tape))
    adjoints, nodes = tape.compute_adjoints(*given), tape.find_parameters(2)
    assert np.all(np.isfinite(adjoints))
    np.testing.assert_array_equal(tape.compute_adjoints_of(*given, nodes), adjoints[nodes])


@pytest.mark.parametrize("seed", range(40))
def test_effects_are_what_outputs_lose_or_gain(program, inputs, seed):
    """Exactly, where the parameters are part of a node: outputs are linear in those."""
    tape = Tape(program)
    pruning = random_remains(tape, seed) if seed else tape.keep_all()
    values = tape.evaluate(pruning, inputs, everywhere(tape))
    own = tape.evaluate_unreplaced(pruning, inputs, values)
    adjoints = tape.compute_adjoints(
        pruning, values, np.eye(2)[:, :, None] * np.ones(20), everywhere(tape)
    )
    candidates = tape.list_candidates()
    candidates = candidates[tape.mark_dependent(2)[candidates[:, 0]]]
    effects = tape.estimate_effects(pruning, candidates, values, own, adjoints).reshape(-1, 2, 20)
    now = np.array(outputs_of(tape, pruning, inputs))
    for term, here, effect in zip(candidates, pruning.has(candidates), effects, strict=True):
        other = outputs_of(tape, pruning.flip(term[None]), inputs)
        lost = now - other if here and term[1] != ITSELF else other - now
        np.testing.assert_allclose(effect, lost, atol=1e-13)


def test_nodes_that_stand_for_others_can_be_what_they_are_again(program, inputs):
    tape = Tape(program)
    everything = tape.keep_all()
    last = int(np.flatnonzero(tape.mark_computed() & tape.mark_dependent(2))[-1])
    pruning = everything.replace(last, last - 1, 0.7)
    back = np.array([[last, ITSELF]])
    again = pruning.flip(back)
    assert again.has(back).all()
    assert not pruning.has(back).any()
    np.testing.assert_array_equal(
        outputs_of(tape, again, inputs), outputs_of(tape, everything, inputs)
    )


@pytest.mark.parametrize("seed", range(5))
def test_counts_of_single_changes(program, seed):
    tape = Tape(program)
    pruning = random_remains(tape, seed)
    candidates = tape.list_candidates()
    for term, count in zip(candidates, tape.count_flipped(pruning, candidates), strict=True):
        assert count == tape.count_operations(pruning.flip(term[None]))
    nodes = np.flatnonzero(tape.mark_computed())
    sources, factors = np.maximum(nodes - 3, NUMBER), np.tile([1.0, 0.3], nodes.size)[: nodes.size]
    counts = tape.count_replaced(pruning, nodes, sources, factors)
    for *way, count in zip(nodes, sources, factors, counts, strict=True):
        assert count == tape.count_operations(pruning.replace(*way))


def test_outputs_are_those_that_are_not_zero(inputs):
    g = Graph()
    a, x = g.input(0), g.input(2)
    tape = Tape(
        Program.from_graph(g, [g.constant(0.0), g.negate(g.multiply(a, x)), g.constant(0.0)])
    )
    pruning = tape.keep_all()
    found = tape.get_outputs(tape.evaluate(pruning, inputs, tape.mark_live(pruning)))
    assert found.positions.tolist() == [1]
    np.testing.assert_allclose(found.values, -inputs[:1] * inputs[2:3])
