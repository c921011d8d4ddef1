"""Tapes against the program that is left when terms are set to zero."""

import numpy as np
import pytest

from paramreduce_cli.expressions.graph import Graph
from paramreduce_cli.expressions.operations import Program
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
    return Program.of_graph(g, outputs)


@pytest.fixture
def inputs():
    rng = np.random.default_rng(0)
    return np.vstack([np.full((2, 20), [[0.7], [-0.3]]), rng.uniform(-1, 1, (2, 20))])


def random_mask(tape, seed):
    mask = tape.everything()
    candidates = tape.candidates()
    rng = np.random.default_rng(seed)
    for k, what in candidates[rng.random(len(candidates)) < 0.15]:
        mask[k, what] = False
    return mask


def outputs_of(tape, mask, inputs):
    values, _ = tape.values(mask, inputs)
    return [values[o >> 1] * (-1 if o & 1 else 1) for o in tape.program.outputs]


@pytest.mark.parametrize("seed", range(20))
def test_what_is_left_is_the_program_with_terms_set_to_zero(program, inputs, seed):
    tape = Tape(program)
    mask = random_mask(tape, seed)
    rebuilt = tape.rebuilt(mask)
    expected = [np.broadcast_to(v, 20) for v in rebuilt.evaluated(list(inputs))]
    np.testing.assert_allclose(outputs_of(tape, mask, inputs), expected, atol=1e-14)
    assert rebuilt.n_operations <= tape.count(mask) <= program.n_operations


@pytest.mark.parametrize("seed", range(5))
def test_adjoints_are_derivatives(program, inputs, seed):
    tape = Tape(program)
    mask = random_mask(tape, seed) if seed else tape.everything()
    values, _ = tape.values(mask, inputs)
    seeds = np.eye(2)[:, :, None] * np.ones(20)
    adjoints = tape.adjoints(mask, values, seeds)
    places = {int(n.number): k for k, n in enumerate(program.nodes) if n.operation == "input"}
    for position in (0, 1, 3):
        if not mask[places[position], 2]:
            continue
        ahead, behind = inputs.copy(), inputs.copy()
        ahead[position] += 1e-6
        behind[position] -= 1e-6
        change = np.subtract(outputs_of(tape, mask, ahead), outputs_of(tape, mask, behind)) / 2e-6
        np.testing.assert_allclose(adjoints[places[position]], change, atol=1e-8)


def test_effects_of_addends_are_what_is_lost_without_them(program, inputs):
    """Exactly, as outputs are linear in every addend that no function is taken of."""
    tape = Tape(program)
    everything = tape.everything()
    values, own = tape.values(everything, inputs)
    adjoints = tape.adjoints(everything, values, np.eye(2)[:, :, None] * np.ones(20))
    candidates = tape.candidates()
    effects = tape.effects(candidates, values, own, adjoints).reshape(-1, 2, 20)
    whole = np.array(outputs_of(tape, everything, inputs))
    angles = {
        value >> 1 for n in program.nodes if n.operation in ("sin", "cos", "tanh", "sign")
        for value in n.operands
    }  # fmt: skip
    tried = 0
    for (k, what), effect in zip(candidates, effects, strict=True):
        if program.nodes[k].operation != "+" or what == 2 or k in angles:
            continue
        mask = tape.everything()
        mask[k, what] = False
        np.testing.assert_allclose(whole - outputs_of(tape, mask, inputs), effect, atol=1e-14)
        # Put back, it gives the same again.
        v, o = tape.values(mask, inputs)
        back = tape.effects(
            np.array([[k, what]]), v, o, tape.adjoints(mask, v, np.eye(2)[:, :, None] * np.ones(20))
        )
        np.testing.assert_allclose(back.reshape(2, 20), effect, atol=1e-14)
        tried += 1
    assert tried >= 4


def test_counts_of_single_changes(program):
    tape = Tape(program)
    mask = random_mask(tape, 3)
    candidates = tape.candidates()
    for (k, what), count in zip(candidates, tape.counts(mask, candidates), strict=True):
        changed = mask.copy()
        changed[k, what] ^= True
        assert count == tape.count(changed)
