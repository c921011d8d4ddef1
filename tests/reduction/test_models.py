"""The models that subsets make, with tied parameters and groups."""

import numpy as np
import pytest
from conftest import model_of

from paramreduce_cli.records import (
    NOT_KEPT,
    Columns,
    ModelChoice,
    Reduction,
    SelectionMethod,
    Subsets,
)
from paramreduce_cli.reduction.models import (
    find_carriers,
    list_choices,
    make_base_model,
    make_full_model,
    make_reduced_model,
)
from paramreduce_cli.report.summary import _find_first_beyond_rank


def grouped_reduction():
    """Three columns for four parameters; with groups there are subsets of one and three."""
    columns = Columns(("a", "both", "d"), np.array([0, 1, 1, 2]))
    found = Subsets(
        n=np.array([1, 3]),
        heuristic="swap",
        subsets=(np.array([1]), np.array([2, 0, 1])),
        torque_error=np.array([0.5, 0.1]),
        torque_error_1=np.zeros(2),
        torque_error_inf=np.zeros(2),
        parameters=(np.array([7.0]), np.array([4.0, 5.0, 6.0])),
        minimum_norm=np.array([False, True]),
        seconds=0.0,
    )
    # Of the columns a, both, d; both takes over 2 a - d.
    factor = np.array([[1.0, 0, 0, 1], [2, 1, -1, 1], [0, 0, 1, 1], [0, 0, 0, 1]])
    return Reduction(columns, np.ones(2), 2, factor, {"swap": found}, None)


def test_tied_parameters_have_one_value():
    model = grouped_reduction().make_model("swap", 1)
    assert model.names == ("a", "both", "d")  # as in the columns, not as they were taken
    assert model.position.tolist() == [0, 1, 1, 2]
    assert model.standard.tolist() == [5.0, 6.0, 6.0, 4.0]
    assert model.ties == {2: 1}
    assert model.drop_unaffecting(np.array([True, False, True, True])).ties == {}


def test_what_is_not_kept_is_zero():
    reduction = grouped_reduction()
    model = make_reduced_model(reduction, "swap", 0)
    assert model.position.tolist() == [NOT_KEPT, 0, 0, NOT_KEPT]
    assert model.standard.tolist() == [0.0, 7.0, 7.0, 0.0]
    assert model.kept.tolist() == [1, 2]
    assert model.expressions == ("both + 2 a - d",)


def test_sizes_that_groups_leave_out_are_not_offered():
    reduction = grouped_reduction()
    assert list_choices(reduction) == ["swap:1|3"]
    assert ModelChoice.parse("swap:3").find_row(reduction) == 1
    for text in ("swap:2", "swap", "swap:", "swap:x", "qr:1"):
        assert ModelChoice.parse(text).find_row(reduction) is None


def test_the_first_size_beyond_the_rank_is_a_size_not_a_place():
    assert _find_first_beyond_rank(grouped_reduction().heuristics["swap"]) == 3


@pytest.mark.parametrize("text", ["swap", "swap@operations"])
def test_methods_survive_being_written(text):
    assert str(SelectionMethod.parse(text)) == text
    assert SelectionMethod.parse(text).by_torque == ("@" not in text)


def test_full_and_base_models_are_the_same_dynamics():
    model = model_of("two_link")
    full, base = make_full_model(model), make_base_model(model)
    assert full.n == model.affecting.sum()
    assert np.array_equal(full.standard[model.affecting], model.values[model.affecting])
    assert base.expressions == model.base.expressions
    others = np.setdiff1d(np.arange(model.values.size), model.base.columns)
    expected = model.values[model.base.columns] + model.base.beta @ model.values[others]
    assert base.values == pytest.approx(expected)


def test_a_value_says_whose_it_is_mostly():
    reduction = grouped_reduction()
    # both = 2 a - d and its own: parts of 2 * 4, 1 and 3.
    assert find_carriers(reduction, "swap", 0, np.array([4.0, 3.0, 3.0, 1.0])) == {"both": "a"}
    assert find_carriers(reduction, "swap", 0, np.array([4.0, 8.0, 8.0, 1.0])) == {}
    assert find_carriers(reduction, "swap", 1, np.array([4.0, 3.0, 3.0, 1.0])) == {}
