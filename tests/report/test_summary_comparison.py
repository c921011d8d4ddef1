import copy

import pytest

from paramreduce_cli.report.summary_comparison import TOLERANCES, Tolerance, compare


def bad(a, b, **options):
    return [d.what for d in compare(a, b, **options) if not d.tolerated]


def test_a_summary_agrees_with_itself(summary):
    assert compare(summary, copy.deepcopy(summary)) == []


def changed(summary, path, change):
    result = copy.deepcopy(summary)
    where = result
    for step in path[:-1]:
        where = where[step]
    where[path[-1]] = change(where[path[-1]])
    return result


FS = "forward-selection"
ROW = ["validation", FS, 2]


@pytest.mark.parametrize(
    ("path", "change", "what"),
    [
        (["model", "n_base"], lambda v: v + 1, "model.n_base"),
        ([*ROW, "torque_error", "validation"], lambda v: v * 1.01, "torque_error"),
        ([*ROW, "torque_error", "joints_estimation", 1], lambda v: v * 1.01, "joint 2"),
        ([*ROW, "acceleration_error", "estimation"], lambda v: v * 1.01, "acceleration"),
        ([*ROW, "acceleration_error", "estimation"], lambda v: None, "acceleration"),
        ([*ROW, "operations", "direct"], lambda v: v + 1, "operations.direct"),
        (["selected", "accepted"], lambda v: not v, "selected.accepted"),
        (["reduction", FS, "order"], lambda v: v[:-1], "parameters of the subset"),
        (["trajectories", "estimation", 0, "kappa"], lambda v: v * 1.2, "kappa"),
        # What is missing is a difference.
        (["reduction"], lambda v: {k: e for k, e in v.items() if k != "qr"}, ""),
        (["validation"], lambda v: {k: e for k, e in v.items() if k != "qr"}, ""),
        (["validation", FS], lambda v: v[:2], ""),
        (["validation", FS, 1, "torque_error", "joints_estimation"], lambda v: [], ""),
        (["validation", FS, 1, "mass_matrix", "condition"], lambda v: v * 2, ""),
        (["selected", "parameters"], lambda v: {}, ""),
        (["trajectories", "estimation", 0, "kappa"], lambda v: None, ""),
    ],
)
def test_differences_are_found(summary, path, change, what):
    assert any(what in entry for entry in bad(summary, changed(summary, path, change)))


def test_small_differences_are_tolerated_and_tolerances_can_be_set(summary):
    path = [*ROW, "torque_error", "estimation"]
    other = changed(summary, path, lambda v: v * 1.00001)
    assert bad(summary, other) == []
    assert bad(summary, other, tolerances={**TOLERANCES, "torque_error": Tolerance(1e-9)})


def test_better_trajectories_are_no_regression(summary):
    other = copy.deepcopy(summary)
    for t in other["trajectories"]["estimation"]:
        t["kappa"] *= 0.5
    assert bad(summary, other) == []
    assert bad(other, summary)


def test_orders_are_compared_up_to_ties(summary):
    swap = changed(summary, ["reduction", FS, "order"], lambda v: [v[1], v[0], *v[2:]])
    assert bad(summary, swap) == []  # same errors: a tie
    dearer = changed(swap, ["validation", FS, 0, "operations", "direct"], lambda v: v + 1)
    assert bad(summary, dearer) == []  # another subset may cost something else
    different = changed(
        swap, ["validation", FS, 0, "torque_error", "estimation"], lambda v: v * 1.5
    )
    assert any("subset" in entry for entry in bad(summary, different))


def test_a_search_that_was_cut_short_may_have_found_less(summary):
    assert summary["validation"]["best-subset"][2]["n"] == 3
    proof = summary["reduction"]["proofs"][2]
    assert (proof["n"], proof["status"]) == (3, "optimal")
    path = ["validation", "best-subset", 2, "operations", "direct"]
    cut_short = changed(summary, path, lambda v: v + 1)
    assert bad(summary, cut_short)
    found = cut_short["reduction"]["proofs"][2]
    found |= {"status": "best-found", "torque_error": proof["torque_error"] * 1.1}
    assert bad(summary, cut_short) == []
    found["lower_bound"] = proof["torque_error"] * 1.05
    assert bad(summary, cut_short)  # the bound is above what is known to be possible


def test_only_what_is_asked(summary):
    other = changed(summary, ["model", "n_base"], lambda v: v + 1)
    assert bad(summary, other, only=("kappa", "order")) == []


TERM = {
    "function": "direct",
    "operations": 100,
    "budget": {"torque": 0.01, "acceleration": 0.05},
    "torque_error": {"estimation": 0.0099, "validation": 0.012},
    "acceleration_error": {"estimation": 0.04, "validation": None},
    "smallest_eigenvalue": 0.1,
}


def test_more_operations_without_small_terms_are_a_regression_and_fewer_are_not(summary):
    one = summary | {"terms": [TERM]}
    assert bad(one, summary) == ["pruned functions"]
    for operations, what in (
        (80, []),
        (104, []),
        (106, ["operations of the pruned function, direct"]),
    ):
        assert bad(one, summary | {"terms": [TERM | {"operations": operations}]}) == what
    other = TERM | {"budget": {"torque": 0.02, "acceleration": 0.05}}
    assert bad(one, summary | {"terms": [other]}) == ["budget of terms, direct"]


@pytest.mark.parametrize(
    ("changed", "what"),
    [
        ({"torque_error": {"estimation": 0.0101, "validation": 0.009}}, ["torque error of the pruned function, direct, estimation"]),
        ({"torque_error": {"estimation": 0.009, "validation": 0.02}}, []),  # was above the budget before: held out
        ({"acceleration_error": {"estimation": 0.051, "validation": None}}, ["acceleration error of the pruned function, direct, estimation"]),
        ({"acceleration_error": {"estimation": None, "validation": None}}, ["acceleration error of the pruned function, direct, estimation"]),
        ({"torque_error": {"estimation": 0.009, "validation": 0.02}, "acceleration_error": {"estimation": 0.04, "validation": 0.06}}, []),
        ({"smallest_eigenvalue": 0.01}, []),
        ({"smallest_eigenvalue": -0.01}, ["smallest eigenvalue of the pruned function, direct"]),
        ({"smallest_eigenvalue": None}, ["smallest eigenvalue of the pruned function, direct"]),
    ],
)  # fmt: skip
def test_a_budget_that_was_kept_to_is_kept_to(summary, changed, what):
    assert bad(summary | {"terms": [TERM]}, summary | {"terms": [TERM | changed]}) == what


def test_what_is_held_out_is_not_gated(summary):
    """By chance it may have been within the budget."""
    before = TERM | {"torque_error": {"estimation": 0.009, "validation": 0.009}}
    after = TERM | {"torque_error": {"estimation": 0.009, "validation": 0.02}}
    both = [summary | {"terms": [one]} for one in (before, after)]
    assert bad(*both) == ["torque error of the pruned function, direct, validation"]
    both = [summary | {"terms": [one | {"held_out": True}]} for one in (before, after)]
    assert bad(*both) == []
