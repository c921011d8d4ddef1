"""How numbers are written for people."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from paramreduce_cli.texts import format_percent_range
from paramreduce_cli.texts.measured_values import format_measured


@pytest.mark.parametrize(
    ("value", "deviation", "said"),
    [
        (6.7633864, 0.097, ("6.763", "0.097")),
        (0.0814335, 0.003, ("0.0814", "0.0030")),
        (-153.2, 12.4, ("-153", "12")),
        (1.5, None, ("1.5", "")),
        (2.0, float("nan"), ("2", "nan")),
        (1.234567e-9, 3.2e-11, ("1.235e-09", "3.2e-11")),
        (0.5, 0.0, ("0.5", "0")),
    ],
)
def test_values_have_the_digits_that_are_sure(value, deviation, said):
    assert format_measured(value, deviation) == said


@given(st.floats(-1e6, 1e6), st.floats(1e-12, 1e6))
def test_what_is_left_out_is_far_less_than_the_deviation(value, deviation):
    told, _ = format_measured(value, deviation)
    assert abs(float(told) - value) <= 0.06 * deviation + 1e-12 * abs(value) or deviation > 10
    assert abs(float(told) - value) <= 0.5


@pytest.mark.parametrize(
    ("errors", "text"),
    [
        ((0.0133, 0.0105, 0.0224), "1.33 % (1.05 to 2.24 %)"),
        ((0.5, 0.5, 0.5), "50 %"),
        ((99.0, 20.0, math.inf), "> 1000 % (> 1000 to ∞)"),
        ((99.0, 20.0, 30.0), "> 1000 %"),
        ((0.0, 0.0, 1e-14), "0 %"),
        ((math.nan, math.nan, math.nan), "-"),
    ],
)
def test_ranges_of_errors(errors, text):
    assert format_percent_range(*errors) == text
