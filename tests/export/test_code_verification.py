"""Checks of exported code."""

import numpy as np
import pytest

from paramreduce_cli.export.code_verification import find_unsafe_mass_matrices


@pytest.mark.parametrize(
    ("wrong", "count"), [([], 0), ([0], 1), ([np.nan, 0], 2), ([np.nan, np.inf, -1], 3)]
)
def test_unsafe_mass_matrices_are_counted_also_those_that_are_not_finite(wrong, count):
    M = np.tile(np.eye(2), (5, 1, 1))
    M[: len(wrong), 1, 1] = wrong
    found = find_unsafe_mass_matrices(M)
    assert (f"on {count} of 5" in found) if count else not found
