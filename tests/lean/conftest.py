"""Tests of lean models search for the leanest formulations."""

import pytest
from shortcuts import searched_formulations


@pytest.fixture(autouse=True)
def searched():
    with searched_formulations():
        yield
