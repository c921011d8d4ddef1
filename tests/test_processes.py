"""Work in other processes."""

import os
import signal
from functools import partial

import pytest

from paramreduce_cli.errors import DataError
from paramreduce_cli.resources.processes import start_workers


@pytest.mark.parametrize("jobs", [1, 2])
def test_each_item_comes_with_its_result(jobs):
    with start_workers(jobs, partial(int, "3")) as pool:
        assert dict(pool.map_unordered(pow, range(5))) == {k: 3**k for k in range(5)}
        assert dict(pool.map_unordered(divmod, [2])) == {2: (1, 1)}


def end_process(_, status):
    os._exit(status)


@pytest.mark.parametrize("between", [False, True])
def test_a_process_that_dies_is_said_whenever_it_does(between):
    with start_workers(2, partial(int, "3")) as pool:
        assert dict(pool.map_unordered(pow, range(50))) == {k: 3**k for k in range(50)}
        if between:
            for number in pool._processes._processes:
                os.kill(number, signal.SIGKILL)
        with pytest.raises(DataError, match="a worker process died"):
            list(pool.map_unordered(pow if between else end_process, range(100)))
