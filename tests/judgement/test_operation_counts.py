"""Which reduced models are counted, and that their counts are those of each model by itself."""

import numpy as np
import pytest
from conftest import ONE_FORMAT, config_of

from paramreduce_cli.artifacts.store import Store, load_file
from paramreduce_cli.judgement import operation_counts
from paramreduce_cli.lean.counting import Counts
from paramreduce_cli.records import CountedDynamics, Model, Reduction, Validation
from paramreduce_cli.running.pipeline import list_stages
from paramreduce_cli.running.runner import Runner

VALIDATE = next(stage for stage in list_stages() if stage.output is Validation)


@pytest.fixture
def validated(two_link_copy, monkeypatch):
    """Model, reduction and validation of an arm that is called too large to count all of its models."""
    monkeypatch.setattr(operation_counts, "_FEW", 0)
    store = Store(two_link_copy)
    Runner(config_of("two_link", ONE_FORMAT), store).run(VALIDATE, force=True)
    return [
        load_file(store.get_path(record), record, None, "")[0]
        for record in (Model, Reduction, Validation)
    ]


def test_counts_are_those_of_each_model_by_itself(validated):
    model, reduction, validation = validated
    counts = Counts(model, CountedDynamics.GENERALISED)
    counted = 0
    for name, result in validation.heuristics.items():
        for row in np.flatnonzero(np.isfinite(result.operations.inverse)):
            expected = counts.count_lean(reduction.make_model(name, int(row)))
            assert [result.operations.inverse[row], result.operations.direct[row]] == expected
            counted += 1
    assert counted > 10


def test_what_is_shown_is_counted_and_the_front_is_of_it(validated):
    _, _, validation = validated
    selected = validation.selected
    for name, result in validation.heuristics.items():
        known = np.isfinite(result.operations.inverse)
        assert known[result.find_row(selected.n)]
        if name in (selected.heuristic, "forward-selection"):
            assert known.all()
    assert not all(
        np.isfinite(result.operations.inverse).all() for result in validation.heuristics.values()
    )
    for choice in validation.pareto:
        result = validation.heuristics[choice.heuristic]
        assert np.isfinite(result.operations.inverse[result.find_row(choice.n)])
