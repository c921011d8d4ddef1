"""What follows from the outputs of a program, against the laws written out."""

import numpy as np
import pytest

from paramreduce_cli.terms.fit_samples import TermSamples
from paramreduce_cli.terms.tape import Outputs

N, M, COUNT = 5, 3, 11
"""Coordinates, independent ones among them, and samples."""


def samples(rng, direct, tangent):
    free = N if tangent is None else M
    return TermSamples(
        states=np.zeros((1, COUNT)), direct=direct, ddq=rng.normal(size=(N, COUNT)), tangent=tangent,
        tau=rng.normal(size=(free, COUNT)), nominal_torque=np.ones(free),
        ddz=rng.normal(size=(free, COUNT)), nominal_acceleration=np.ones(free),
    )  # fmt: skip


def symmetric(lower):
    """(n_samples, n, n)"""
    found = np.zeros((COUNT, N, N))
    for (i, j), entry in zip(zip(*np.tril_indices(N), strict=True), lower, strict=True):
        found[:, i, j] = found[:, j, i] = entry
    return found


@pytest.mark.parametrize("share", [0.6, 1.0])
@pytest.mark.parametrize("with_loops", [False, True])
@pytest.mark.parametrize("direct", [False, True])
def test_torques_and_mass_matrices_of_outputs_most_of_which_are_zero(direct, with_loops, share):
    rng = np.random.default_rng(0)
    tangent = rng.normal(size=(COUNT, N, M)) if with_loops else None
    some = samples(rng, direct, tangent)
    J = tangent if with_loops else np.broadcast_to(np.eye(N), (COUNT, N, N))
    everything = rng.normal(size=((N * (N + 1) // 2 if direct else 0) + N, COUNT))
    everything[rng.random(len(everything)) < share] = 0.0
    outputs = Outputs.drop_zero(everything)
    assert (len(outputs.positions) > 0) == (share < 1)
    assert len(outputs.positions) < len(everything)

    torques = everything[-N:].copy()
    if direct:
        matrices = symmetric(everything[:-N])
        torques += np.einsum("mij,jm->im", matrices, some.ddq)
        np.testing.assert_allclose(
            some.build_mass_matrices(outputs), np.swapaxes(J, 1, 2) @ matrices @ J, atol=1e-13
        )
    given = some.tau - some.compute_residuals(outputs)
    np.testing.assert_allclose(given, np.einsum("mij,im->jm", J, torques), atol=1e-13)
    across = np.einsum("oqm,om->qm", some.seeds, everything)
    np.testing.assert_allclose(across, given, atol=1e-13)
