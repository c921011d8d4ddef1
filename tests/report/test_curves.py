"""Heuristics that found the same models share a curve."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from paramreduce_cli.artifacts.store import Store, load_file
from paramreduce_cli.records import Reduction, Validation
from paramreduce_cli.report.curves import gather_curves


@pytest.fixture
def found(two_link_results):
    store = Store(two_link_results)
    reduction, validation = (
        load_file(store.get_path(kind), kind, None, "")[0] for kind in (Reduction, Validation)
    )
    name = next(iter(validation.heuristics))
    reduction = replace(reduction, heuristics={"one": reduction.heuristics[name],
                                               "two": reduction.heuristics[name]})  # fmt: skip
    validation = replace(
        validation, heuristics=dict.fromkeys(("one", "two"), validation.heuristics[name])
    )
    return SimpleNamespace(reduction=reduction, validation=validation)


def test_the_same_models_are_one_curve(found):
    (curve,) = gather_curves(found)
    assert curve.names == ("one", "two")
    assert curve.label == "one, two"


def test_of_curves_that_meet_only_what_is_new_is_drawn(found):
    two = found.reduction.heuristics["two"]
    values = [np.array(v) for v in two.parameters]
    values[3] = values[3] * 1.01
    found.reduction.heuristics["two"] = replace(two, parameters=tuple(values))
    one, other = gather_curves(found)
    assert one.own.all()
    assert np.flatnonzero(other.own).tolist() == [2, 3, 4]  # and where it leaves and comes back
    drawn = other.hide_shared(np.arange(float(one.own.size)))
    assert np.flatnonzero(np.isfinite(drawn)).tolist() == [2, 3, 4]


def test_one_other_value_is_another_curve(found):
    two = found.reduction.heuristics["two"]
    values = [np.array(v) for v in two.parameters]
    values[-1] = values[-1] * 1.01
    found.reduction.heuristics["two"] = replace(two, parameters=tuple(values))
    assert [curve.names for curve in gather_curves(found)] == [("one",), ("two",)]
    assert len({curve.colour for curve in gather_curves(found)}) == 2
