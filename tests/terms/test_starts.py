"""In which order subsets are gone down from."""

from types import SimpleNamespace

from paramreduce_cli.terms.starts import Start, promising


def start(n, cost, error):
    return Start("swap", SimpleNamespace(n=n), error, cost)


def test_the_leanest_of_every_size_come_first_and_of_far_sizes_the_most_exact_one_too():
    starts = [
        start(10, 100, 0.009), start(10, 120, 0.008), start(11, 110, 0.007), start(18, 200, 0.005),
        start(19, 210, 0.005), start(22, 230, 0.004), start(22, 240, 0.002), start(22, 250, 0.003),
        start(9, 300, 0.009),
    ]  # fmt: skip
    order = [(one.model.n, one.cost) for one in promising(starts, 10)]
    assert order == [(10, 100), (11, 110), (18, 200), (22, 230), (10, 120), (22, 240)]


def test_a_subset_that_is_both_the_leanest_and_the_most_exact_is_one_start():
    starts = [start(10, 100, 0.009), start(22, 230, 0.001), start(22, 240, 0.002)]
    assert [one.cost for one in promising(starts, 10)] == [100, 230]
