"""Operations of many models, one after the other or in several processes."""

import numpy as np
import pytest

from paramreduce_cli.artifacts.store import Store, load_file
from paramreduce_cli.lean import counting
from paramreduce_cli.records import CountedDynamics, Model, Reduction, Run
from paramreduce_cli.reduction.models import make_base_model, make_full_model


@pytest.fixture(scope="module")
def models(two_link_results):
    store = Store(two_link_results)
    model, reduction = (
        load_file(store.get_path(record), record, None, "")[0] for record in (Model, Reduction)
    )
    found = [
        reduction.make_model(name, k)
        for name, f in reduction.heuristics.items()
        for k in range(f.n.size)
    ]
    return model, [*found, make_full_model(model), make_base_model(model)]


def test_processes_count_what_one_counts(models, monkeypatch):
    one = counting.count_all(models[0], CountedDynamics.GENERALISED, models[1], Run(1))
    monkeypatch.setattr(counting, "_MANY", 0)
    monkeypatch.setattr(counting, "_AT_ONCE", 2)
    steps = []
    two = counting.count_all(
        models[0], CountedDynamics.GENERALISED, models[1], Run(2, progress=steps.append)
    )
    assert np.array_equal(one, two)
    assert steps[-1].done == steps[-1].total < len(models[1])  # of many models several are the same


def test_models_are_counted_one_by_one(models):
    """By definition, without what is remembered."""
    model, chosen = models
    counts = counting.Counts(model, CountedDynamics.GENERALISED)
    together = counting.count_all(model, CountedDynamics.GENERALISED, chosen, Run(1))
    assert together.tolist() == [counts.count_lean(one) for one in chosen]
