"""Records as tables."""

import numpy as np
import pytest

import paramreduce_cli as pr


@pytest.fixture(scope="module")
def results(two_link_results):
    return pr.open_results(two_link_results)


def test_a_model_has_a_row_for_every_parameter(results):
    table = pr.frame(results.model)
    assert tuple(table["name"]) == results.model.mechanism.parameter_names
    np.testing.assert_array_equal(table["value"], results.model.values)
    (row,) = table[table["name"] == "mx_fore"].to_dict("records")
    assert (row["body"], row["kind"], row["unit"]) == ("fore", "mx", "kg m")


def test_trajectories_of_all_sets(results):
    table = pr.frame(results.trajectories)
    found = results.trajectories
    sets = {name: getattr(found, name) for name in ("estimation", "validation", "test")}
    assert table["set"].tolist() == [name for name, own in sets.items() for _ in own]
    assert table["kappa"].tolist() == [t.kappa for own in sets.values() for t in own]


def test_every_model_of_a_reduction_and_of_its_validation(results):
    reduced, judged = pr.frame(results.reduction), pr.frame(results.validation)
    found = results.reduction.heuristics["swap"]
    own = reduced[reduced["heuristic"] == "swap"]
    np.testing.assert_array_equal(own["torque_error"], found.torque_error)
    assert [len(names) for names in own["parameters"]] == found.n.tolist()
    errors = judged[judged["heuristic"] == "swap"]["torque_error_estimation"]
    np.testing.assert_array_equal(
        errors, results.validation.heuristics["swap"].torque_error.estimation
    )


def test_parameters_of_a_reduced_model(results):
    chosen = pr.chosen(results.reduction, "swap", 3, results.model)
    table = pr.frame(chosen)
    assert tuple(table["name"]) == chosen.names
    assert tuple(table["stands_for"]) == chosen.expressions
    np.testing.assert_array_equal(table["value"], chosen.values)


def test_identified_parameters_with_their_deviations(measured_results):
    found = pr.open_results(measured_results / "results").identification
    table = pr.frame(found)
    own = table[table["model"] == "reduced"]
    assert tuple(own["name"]) == found.reduced.names
    np.testing.assert_array_equal(own["deviation"], found.reduced.deviations)


def test_other_records_are_refused(results):
    with pytest.raises(TypeError, match="no table is made of a Samples"):
        pr.frame(results.samples)
