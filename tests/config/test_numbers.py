import contextlib
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from paramreduce_cli.fields.numbers import parse_number


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1e-3", 1e-3), ("pi/2", math.pi / 2), ("-2*pi/3", -2 * math.pi / 3), ("2**3", 8), (3, 3),
        ("(1 + 2) / 4", 0.75), ("+.5", 0.5), (" 7 ", 7), ("inf", math.inf), ("1/24", 1 / 24),
    ],
)  # fmt: skip
def test_numbers_as_people_write_them(text, value):
    assert parse_number(text) == value


@pytest.mark.parametrize(
    "text",
    ["pie", "", "1 2", "__import__('os')", "1/0", "2**9999", "'3'", "[1]", "9" * 200, "a.b", "(-1)**.5",
     "nan", "1 if 1 else 2", "1j", True, None, [1], "("],
)  # fmt: skip
def test_anything_else_is_refused(text):
    with pytest.raises(ValueError):
        parse_number(text)


@given(st.floats(allow_nan=False))
def test_every_float_survives_its_own_text(value):
    assert parse_number(repr(value)) == value


@given(st.text(max_size=30))
def test_no_text_does_anything_but_give_a_number_or_a_value_error(text):
    with contextlib.suppress(ValueError):
        assert isinstance(parse_number(text), float)
