"""Fits and searches on a small arm, against definitions and against all that could be left out."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from conftest import model_of

from paramreduce_cli.lean.lean_models import LeanModels
from paramreduce_cli.multibody.dynamics import Dynamics
from paramreduce_cli.records import Block, ReducedModel
from paramreduce_cli.reduction.models import make_base_model
from paramreduce_cli.terms.fit_samples import make_samples
from paramreduce_cli.terms.kernels import ITSELF
from paramreduce_cli.terms.program_fitting import Budget, Fitting
from paramreduce_cli.terms.starts import Start
from paramreduce_cli.terms.tape import Tape
from paramreduce_cli.terms.term_removal import NOISE, TermSearch

NOMINAL = np.array([20.0, 5.0])


@pytest.fixture(scope="module")
def arm():
    return model_of("two_link")


def states(model, count, seed):
    rng = np.random.default_rng(seed)
    q, dq, ddq = rng.uniform(-2, 2, (3, count, model.mechanism.n_dof))
    tau = Dynamics(model.mechanism).compute_torques(q, dq, ddq, model.values)
    return Block(0, np.zeros(count), q, dq, ddq, tau, q, dq, ddq, np.zeros((0, model.values.size)))


def fitting_of(model, direct, budget, count=60, reduced=None):
    reduced = reduced or make_base_model(model)
    program = Start("base", reduced, 0.0, 0).build_program(LeanModels(model), direct=direct)
    samples = make_samples(
        model.mechanism, [states(model, count, 0)], NOMINAL, np.array([1.0, 2.0]),
        direct=direct, projected=False,
    )  # fmt: skip
    return Fitting(Tape(program), reduced.n, samples, budget), reduced, samples


def predicted(fitting, fit, samples, direct):
    """Torques, and mass matrices, from the program that is left, written out."""
    program = fitting.tape.rebuild(fit.pruning)
    m = samples.tau.shape[1]
    given = program.evaluate(
        [*np.broadcast_to(fit.beta[:, None], (fit.beta.size, m)), *samples.states]
    )
    given = [np.broadcast_to(value, m) for value in given]
    if not direct:
        return np.array(given), None
    ddq = samples.states[4:6]
    M = np.array([[given[0], given[1]], [given[1], given[2]]])
    return np.einsum("ijm,jm->im", M, ddq) + np.array(given[3:]), M


@pytest.mark.parametrize("direct", [False, True])
def test_all_terms_are_exact_and_errors_are_what_they_are_defined_as(arm, direct):
    fitting, reduced, samples = fitting_of(arm, direct, Budget(0.1, 0.1))
    search = TermSearch(fitting, 0)
    whole = search.start(reduced.values)
    assert whole.fit.torque_error < 1e-6

    found = search.descend(whole).fit
    tau, M = predicted(fitting, found, samples, direct)
    weights = NOMINAL[:, None]
    error = np.linalg.norm((tau - samples.tau) / weights) / np.linalg.norm(samples.tau / weights)
    assert found.torque_error == pytest.approx(error, rel=1e-6)
    assert error <= 0.1
    if not direct:
        # No other values do better.
        rows = (
            np.array(
                [
                    predicted(fitting, replace(found, beta=e), samples, False)[0]
                    for e in np.eye(found.beta.size)
                ]
            )
            / weights
        )
        flat = rows.reshape(found.beta.size, -1).T
        best = np.linalg.lstsq(flat, (samples.tau / weights).ravel(), rcond=None)[0]
        left = np.linalg.norm(flat @ best - (samples.tau / weights).ravel())
        assert error == pytest.approx(left / np.linalg.norm(samples.tau / weights), rel=1e-6)
        return
    accelerations = np.linalg.solve(
        np.moveaxis(M, 2, 0), np.moveaxis(samples.tau - tau, 1, 0)[..., None]
    )[..., 0]
    scale = np.array([1.0, 2.0])
    expected = np.linalg.norm(accelerations / scale) / np.linalg.norm(samples.ddz.T / scale)
    assert found.acceleration_error == pytest.approx(expected, rel=1e-6)
    assert expected <= 0.1


@pytest.mark.parametrize("direct", [False, True])
def test_terms_are_put_back_until_a_budget_is_kept_to(arm, direct):
    fitting, reduced, _ = fitting_of(arm, direct, Budget(1e-6, np.inf))
    search, tape = TermSearch(fitting, 0), fitting.tape
    whole = search.start(reduced.values)
    terms = tape.list_candidates()[tape.list_candidates()[:, 1] != ITSELF]
    missed = helped = 0
    for term in terms:
        broken = fitting.fit(whole.fit.pruning.flip(term[None]), whole.fit.beta)
        missed += not broken.within
        mended = search.restore_budget(broken.pruning, broken.beta)
        helped += mended.fit.within and not broken.within
        assert mended.count <= whole.count
        assert np.all(mended.fit.pruning.has(terms)[broken.pruning.has(terms)]), "nothing else goes"
    assert missed > 5
    # A square whose root is gone, or a parameter whose only term is, does not tell that it helps.
    assert helped >= 0.7 * missed


def test_costs_of_combinations_of_parameters_are_exact(arm):
    fitting, reduced, _ = fitting_of(arm, False, Budget(0.1, np.inf))
    tape = fitting.tape
    terms = tape.list_candidates()[tape.list_candidates()[:, 1] != ITSELF]
    fit = fitting.fit(tape.keep_all(), reduced.values)
    for chosen in (None, 7, 12):
        if chosen is not None:
            fit = fitting.fit(fit.pruning.flip(terms[chosen][None]), fit.beta)
        live = terms[fit.pruning.has(terms)]
        combinations = tape.find_combinations(fit.pruning, live, fitting.n)
        costs = fit.linear.estimate_costs(
            fitting.compute_effects(fit, live), fit.beta, combinations
        )
        known = np.flatnonzero(combinations.any(axis=1))
        assert known.size > 10
        for k in known:
            # Numbers of one sum that cancel are lost in the square of their size.
            cost = fitting.fit(fit.pruning.flip(live[k][None]), fit.beta).cost - fit.cost
            assert costs.refitted[k] == pytest.approx(
                cost, rel=1e-6, abs=1e-8 * costs.unfitted.max()
            )
            assert costs.sure[k] == costs.refitted[k]
        others = np.setdiff1d(np.arange(len(live)), known)
        assert np.all(costs.refitted[others] <= costs.unfitted[others])


@pytest.mark.parametrize("direct", [False, True])
def test_nothing_leaner_can_be_had_on_a_small_arm(arm, direct):
    """All ways to leave addends out are tried."""
    base = make_base_model(arm)
    kept = ["Izz_upper", "mx_upper", "Izz_fore", "mx_fore"]
    assert set(kept) <= set(base.names)
    position = np.full(arm.values.size, -1)
    for k, name in enumerate(kept):
        position[arm.mechanism.parameter_names.index(name)] = k
    values = np.array([base.values[base.names.index(name)] for name in kept])
    reduced = ReducedModel(tuple(kept), values, position)
    whole, *_ = fitting_of(arm, direct, Budget(1.0, np.inf), 25, reduced)
    fit = whole.fit(whole.tape.keep_all(), values)
    budget = Budget(4 * fit.torque_error, 4 * fit.acceleration_error if direct else np.inf)
    fitting, *_ = fitting_of(arm, direct, budget, 25, reduced)

    tape = fitting.tape
    sums = sorted({k for k, what in tape.list_candidates().tolist() if what < 2})
    assert 5 <= len(sums) <= 10, "an arm of this size can be searched exhaustively"
    fewest = tape.count_operations(tape.keep_all())
    for ways in itertools.product(((True, True), (True, False), (False, True)), repeat=len(sums)):
        pruning = tape.keep_all()
        pruning.kept[sums, :2] = ways
        if tape.count_operations(pruning) < fewest and fitting.fit(pruning, values).within:
            fewest = tape.count_operations(pruning)
    search = TermSearch(fitting, 0)
    start = search.start(values)
    noisy = (search.descend(start, noise=noise) for noise in [0.0] + [NOISE] * 20)
    found = min(map(search.descend, noisy), key=lambda end: end.count)
    assert found.fit.within
    assert found.count <= fewest, "whole nodes may go as well, so it may even be leaner"
