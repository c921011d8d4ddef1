import numpy as np

from paramreduce_cli.multibody.relations import (
    approximate_expressions,
    candidates,
    named_coefficient,
)

GEOMETRIES = [{"a_3": 0.4318, "d_4": -0.4318}, {"a_3": 0.5, "d_4": -0.4}]


def name(function):
    values = np.array([function(g["a_3"], g["d_4"]) for g in GEOMETRIES])
    found = [candidates(g) for g in GEOMETRIES]
    functions = np.array([list(entry.values()) for entry in found])
    return named_coefficient(values, list(found[0]), functions)


def test_functions_of_the_geometry_are_told_apart_by_changing_it():
    assert name(lambda a, d: a) == "+ a_3"
    assert name(lambda a, d: -d) == "- d_4"
    assert name(lambda a, d: -2 * a * d) == "- 2 a_3 d_4"
    assert name(lambda a, d: a**2 + d**2) == "+ (a_3^2 + d_4^2)"
    assert name(lambda a, d: -1.0) == "-"


def test_what_fits_one_geometry_only_is_no_function_of_it():
    assert name(lambda a, d: 0.4318) is None
    assert name(lambda a, d: a**3) is None


def test_parameters_that_are_zero_are_left_out_of_approximate_expressions():
    beta = np.array([[2.0, -0.5, 0.0]])
    known = np.array([1, 1, 0, 1.0])
    texts = approximate_expressions(["p", "q", "r", "s"], np.array([0]), beta, known)
    assert texts == ["p + 2 q"]
