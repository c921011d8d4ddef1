"""A search of seconds: the two-link arm's torques within five per cent."""

import numpy as np
import pytest
from conftest import model_of
from terms.test_term_removal import NOMINAL, states

from paramreduce_cli.lean.lean_models import LeanModels
from paramreduce_cli.reduction.models import make_base_model
from paramreduce_cli.terms.fit_samples import make_samples
from paramreduce_cli.terms.parallel_descents import Searcher, SearchSamples
from paramreduce_cli.terms.program_fitting import Budget
from paramreduce_cli.terms.starts import Start


@pytest.fixture(scope="module")
def searcher():
    model = model_of("two_link")
    some, more = (
        make_samples(
            model.mechanism, [states(model, count, count)], NOMINAL, np.ones(2),
            direct=False, projected=False,
        )
        for count in (60, 120)
    )  # fmt: skip
    return Searcher(
        LeanModels(model), SearchSamples(some, None), SearchSamples(more, None), None, Budget(0.05, np.inf),
        direct=False, seed=0,
    )  # fmt: skip


@pytest.fixture(scope="module")
def start():
    return Start("base", make_base_model(model_of("two_link")), 0.0, 0)
