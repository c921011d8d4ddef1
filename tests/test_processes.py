"""Work in other processes."""

import operator
import os
import signal
import time

import pytest

from paramreduce_cli.errors import DataError
from paramreduce_cli.processes import as_done, workers


def test_each_item_comes_with_its_result():
    with workers(2, time.sleep, 0) as pool:
        assert dict(as_done(pool, operator.neg, range(5))) == {k: -k for k in range(5)}


@pytest.mark.parametrize("between", [False, True])
def test_a_process_that_dies_is_said_whenever_it_does(between):
    with workers(1, time.sleep, 0) as pool:
        assert list(as_done(pool, operator.neg, [1])) == [(1, -1)]
        if between:
            for number in pool._processes:
                os.kill(number, signal.SIGKILL)
        with pytest.raises(DataError, match="a worker process died"):
            list(as_done(pool, operator.neg if between else os._exit, range(100)))
