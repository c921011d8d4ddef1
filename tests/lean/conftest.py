"""Tests of lean models search for the leanest formulations."""

import pytest
from conftest import searched_formulations


@pytest.fixture(autouse=True)
def searched():
    with searched_formulations():
        yield
