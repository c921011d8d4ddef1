"""Angles that were rounded, and how they are written."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from paramreduce_cli.fields.numbers import parse_number
from paramreduce_cli.importing.angles import (
    find_near_angle,
    format_angle,
    format_number,
    unround_angle,
)


@pytest.mark.parametrize(
    ("text", "angle"),
    [
        ("1.57", math.pi / 2), ("3.14", math.pi), ("-1.5708", -math.pi / 2), ("1.5707", math.pi / 2),
        ("0.785", math.pi / 4), ("2.6180", 5 * math.pi / 6), ("1.570796325", math.pi / 2),
        ("0.78", 0.78), ("0.52", 0.52), ("1.5", 1.5), ("2", 2.0), ("1.56", 1.56), ("1.5718", 1.5718),
        ("1.58", 1.58), ("0.786", 0.786), ("3.15", 3.15), ("3.141", math.pi), ("3.1415", math.pi), ("3.1417", 3.1417),
        ("1.571", math.pi / 2), ("1.572", 1.572), ("-2.22045e-16", 0.0), ("0", 0.0), ("0.0001", 0.0001), ("15e-1", 1.5),
    ],
)  # fmt: skip
def test_what_an_angle_was_rounded_from(text, angle):
    assert unround_angle(text) == angle


@pytest.mark.parametrize(
    ("text", "near"),
    [("1.58", math.pi / 2), ("0.786", math.pi / 4), ("3.15", math.pi), ("1.57", None), ("1.3", None), ("0", None),
     ("0.3", None), ("1.6", None)],
)  # fmt: skip
def test_angles_that_are_almost_rounded_ones_are_hinted_at(text, near):
    assert find_near_angle(text) == near


@given(st.integers(-24, 24), st.integers(4, 15))
def test_multiples_of_15_degrees_survive_rounding(twelfths, digits):
    angle = twelfths * math.pi / 12
    assert unround_angle(f"{angle:.{digits}f}") == pytest.approx(angle, abs=1e-15)


@given(st.floats(-7, 7))
def test_angles_are_written_as_a_config_reads_them(angle):
    assert parse_number(format_angle(angle)) == pytest.approx(angle, rel=1e-11, abs=1e-30)


@pytest.mark.parametrize(
    ("angle", "text"),
    [(math.pi, "pi"), (-math.pi / 2, "-pi/2"), (5 * math.pi / 6, "5*pi/6"), (0.0, "0"), (1.0, "1")],
)
def test_texts_of_angles(angle, text):
    assert format_angle(angle) == text


@given(st.floats(-1e6, 1e6))
def test_numbers_keep_twelve_digits(value):
    assert float(format_number(value)) == pytest.approx(value, rel=1e-11, abs=1e-300)
