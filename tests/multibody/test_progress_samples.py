import numpy as np
from selecting import blocks_of

from paramreduce_cli.multibody.progress_samples import ProgressSet


class Computed:
    n_samples, recomputable = 7, True

    def iterate_blocks(self):
        rng = np.random.default_rng(0)
        return blocks_of(rng.normal(size=(14, 3)), rng.normal(size=(7, 2)), np.zeros(7), 3)

    def compute_factors(self):
        return np.ones((1, 2, 4, 4))


def test_samples_pass_unchanged_and_are_counted():
    steps = []
    told = ProgressSet(Computed(), "estimation set", steps.append)
    for a, b in zip(told.iterate_blocks(), Computed().iterate_blocks(), strict=True):
        assert np.array_equal(a.W, b.W)
        assert np.array_equal(a.tau, b.tau)
    assert [step.done for step in steps] == [3, 6, 7]
    assert {(step.task, step.total) for step in steps} == {("estimation set", 7)}
    assert np.array_equal(told.compute_factors(), Computed().compute_factors())
    assert (told.n_samples, told.recomputable) == (7, True)
