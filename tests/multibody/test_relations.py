import numpy as np

from paramreduce_cli.multibody.relations import (
    approximate_expressions,
    list_functions,
    name_coefficient,
)

GEOMETRIES = [{"a_3": 0.4318, "d_4": -0.4318}, {"a_3": 0.5, "d_4": -0.4}]


def name(function):
    values = np.array([function(g["a_3"], g["d_4"]) for g in GEOMETRIES])
    found = [list_functions(g) for g in GEOMETRIES]
    functions = np.array([list(entry.values()) for entry in found])
    return name_coefficient(values, list(found[0]), functions)


def test_functions_of_the_geometry_are_told_apart_by_changing_it():
    assert name(lambda a, d: a) == "+ a_3"
    assert name(lambda a, d: -d) == "- d_4"
    assert name(lambda a, d: -2 * a * d) == "- 2 a_3 d_4"
    assert name(lambda a, d: a**2 + d**2) == "+ (a_3^2 + d_4^2)"
    assert name(lambda a, d: -1.0) == "-"


def test_what_fits_one_geometry_only_is_no_function_of_it():
    assert name(lambda a, d: 0.4318) is None
    assert name(lambda a, d: a**3) is None


def test_large_terms_come_first_and_small_ones_are_counted():
    """Parameters that are zero are not even counted; without values all terms stay in their order."""
    beta = np.array([[0.001, -0.001, 2.0, -0.5, 3.0, 0.0]])
    names, kept = ["p", "a", "b", "q", "r", "s", "t"], np.array([0])
    texts = approximate_expressions(names, kept, beta, np.array([1, 1, 1, 1, 0, 2.0, 1]))
    assert texts == ["p + 3 s + 2 q and 2 smaller terms, together 0.02 %"]
    texts = approximate_expressions(names, kept, beta)
    assert texts == ["p + 0.001 a - 0.001 b + 2 q - 0.5 r + 3 s"]
