"""Units for parameters: the same function, with fewer products with constants."""

from dataclasses import replace

import numpy as np
import pytest
from conftest import model_of
from hypothesis import given, settings
from hypothesis import strategies as st

from paramreduce_cli.expressions.graph import Graph
from paramreduce_cli.expressions.programs import Program
from paramreduce_cli.expressions.scaling import rescale
from paramreduce_cli.lean.joint_formulations import JointFormulation
from paramreduce_cli.lean.joint_frames import choose_frames
from paramreduce_cli.lean.lean_outputs import build_direct_outputs, build_inverse_outputs

FREE, N = 3, 6
NUMBERS = (0.0825, 0.088, 0.5, 2.0, -0.316, 9.81)


@st.composite
def programs(draw):
    """Sums, products, products with constants and sines of three free inputs and three others."""
    graph = Graph()
    values = [graph.input(k) for k in range(N)]
    for _ in range(draw(st.integers(1, 25))):
        a, b = (draw(st.sampled_from(values)) for _ in range(2))
        b = graph.negate(b) if draw(st.booleans()) else b
        number = graph.constant(draw(st.sampled_from(NUMBERS)))
        kind = draw(st.sampled_from(("sum", "product", "multiple", "shift", "sine")))
        if kind == "sine":
            values.append(graph.call("sin", a))
        else:
            operation = graph.add if kind in ("sum", "shift") else graph.multiply
            values.append(operation(a, b if kind in ("sum", "product") else number))
    return Program.from_graph(graph, [values[-1], draw(st.sampled_from(values))])


def same(program, scaled, units):
    """Whether the functions are, of random inputs."""
    x = np.random.default_rng(0).uniform(0.5, 1.5, size=(N, 20))
    in_units = x.copy()
    in_units[:FREE] /= units[:, None]
    for one, other in zip(program.evaluate(x), scaled.evaluate(in_units), strict=True):
        np.testing.assert_allclose(other, one, rtol=1e-7, atol=1e-7 * np.abs(one).max())


@settings(deadline=None)
@given(programs())
def test_the_function_is_the_same_and_takes_no_more_operations(program):
    scaled, units = rescale(program, FREE)
    same(program, scaled, units)
    assert scaled.n_operations <= program.n_operations


def built(make):
    """The program of what is made of three free inputs and three others."""
    graph = Graph()
    outputs = make(graph, *(graph.input(k) for k in range(N)))
    return Program.from_graph(graph, outputs)


def test_a_factor_that_a_parameter_can_take_vanishes():
    program = built(lambda g, p, q, r, x, y, z: [g.multiply(p, g.multiply(g.constant(0.5), x))])
    scaled, units = rescale(program, FREE)
    assert scaled.n_operations == 1
    np.testing.assert_allclose(units, [2.0, 1.0, 1.0])


@pytest.mark.parametrize(
    "make",
    [
        lambda g, p, q, r, x, y, z: [g.multiply(g.constant(0.5), x)],
        lambda g, p, q, r, x, y, z: [g.multiply(p, g.add(x, g.multiply(g.constant(0.5), y)))],
        lambda g, p, q, r, x, y, z: [g.multiply(p, x), g.multiply(g.constant(0.5), p)],
        lambda g, p, q, r, x, y, z: [g.multiply(p, g.call("sin", g.multiply(g.constant(0.5), x)))],
        lambda g, p, q, r, x, y, z: [x],
        lambda g, p, q, r, x, y, z: [g.constant(0.0)],
    ],
)
def test_what_nothing_can_make_up_for_stays(make):
    program = built(make)
    scaled, units = rescale(program, FREE)
    assert scaled.n_operations == program.n_operations
    np.testing.assert_array_equal(units, 1.0)
    same(program, scaled, units)


def test_what_vanishes_in_more_places_goes_first():
    """A length in two places and another in one, as of an arm's links; both cannot be one."""

    def make(g, p, q, r, x, y, z):
        a, b = g.constant(0.3), g.constant(0.4)
        speeds = [g.multiply(a, x), g.multiply(a, y), g.multiply(b, z)]
        total = g.add(g.add(speeds[0], g.multiply(y, speeds[1])), speeds[2])
        return [g.multiply(p, total), g.multiply(p, g.multiply(y, speeds[0]))]

    program = built(make)
    scaled, units = rescale(program, FREE)
    assert scaled.n_operations == program.n_operations - 2
    np.testing.assert_allclose(units[0], 1 / 0.3)
    numbers = [node.number for node in scaled.nodes if node.operation == "constant"]
    assert numbers == pytest.approx([0.4 / 0.3])


@pytest.mark.parametrize("outputs", [build_inverse_outputs, build_direct_outputs])
def test_an_arm_takes_what_it_would_take_if_its_length_were_one(outputs):
    """Oracle: the same arm described anew, in the unit of its first link's length."""
    mechanism = model_of("two_link").mechanism
    tree = choose_frames(mechanism)
    length = float(np.abs(tree.joints[1].place).max())
    joints = tuple(replace(joint, place=joint.place / length) for joint in tree.joints)
    in_lengths = replace(tree, joints=joints, gravity=tree.gravity / length)

    def program(tree):
        graph = Graph()
        return Program.from_graph(graph, outputs(tree, [JointFormulation()] * 2, graph))

    n = mechanism.n_parameters
    scaled, units = rescale(program(tree), n)
    assert scaled.n_operations < program(tree).n_operations
    assert scaled.n_operations <= program(in_lengths).n_operations
    # A mass comes as m l^2, a first moment as m x l, moments of inertia as they are.
    sizes = dict(zip(mechanism.parameter_names, units, strict=True))
    for name, power in {"m_fore": 2, "mx_fore": 1, "my_fore": 1, "Izz_fore": 0}.items():
        assert sizes[name] == pytest.approx(length**-power)


@pytest.mark.parametrize("outputs", [build_inverse_outputs, build_direct_outputs])
def test_numbers_that_differ_by_rounding_are_one(outputs):
    mechanism = model_of("puma560").mechanism
    graph = Graph()
    values = outputs(choose_frames(mechanism), [JointFormulation()] * 6, graph)
    scaled, _ = rescale(Program.from_graph(graph, values), mechanism.n_parameters)
    numbers = np.sort([node.number for node in scaled.nodes if node.operation == "constant"])
    assert numbers.size > 3
    assert np.diff(numbers).min() > 1e-6
