"""Columns without headings."""

import numpy as np
import pytest

from paramreduce_cli.identification.column_order import guess_order

T = np.arange(0, 5, 0.01)
Q = {k: np.sin((k + 1) * T) for k in (1, 2)}
DQ = {k: np.gradient(q, T) for k, q in Q.items()}
DDQ = {k: np.gradient(v, T) for k, v in DQ.items()}
TAU = {k: 3 * np.sign(v) + 0.1 * T for k, v in DQ.items()}


def table(*blocks, time=True):
    columns = ([T] if time else []) + [column for block in blocks for column in block.values()]
    return {str(k + 1): column for k, column in enumerate(columns)}


@pytest.mark.parametrize(
    ("blocks", "expected"),
    [
        ((Q, TAU), {"time": "1", "position": ["2", "3"], "torque": ["4", "5"]}),
        ((Q, DQ, TAU), {"time": "1", "position": ["2", "3"], "velocity": ["4", "5"], "torque": ["6", "7"]}),
        ((Q, DQ, DDQ, TAU), {"time": "1", "position": ["2", "3"], "velocity": ["4", "5"],
                             "acceleration": ["6", "7"], "torque": ["8", "9"]}),
        ((Q, TAU, TAU), {"time": "1", "position": ["2", "3"]}),
        ((Q,), {"time": "1"}),
    ],
    ids=len,
)  # fmt: skip
def test_the_order_is_that_of_states_and_torques(blocks, expected):
    assert guess_order(table(*blocks), 2) == expected


def test_without_times():
    assert guess_order(table(Q, TAU, time=False), 2) == {
        "position": ["1", "2"],
        "torque": ["3", "4"],
    }


def test_another_number_of_columns_is_not_guessed():
    assert guess_order(table(Q, TAU), 3) == {"time": "1"}
