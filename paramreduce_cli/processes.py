"""Work in other processes, which end with their parent and leave interruptions to it."""

import contextlib
import multiprocessing
import os
import signal
import threading
import time
import warnings
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from typing import Any, TypeVar

from paramreduce_cli.errors import DataError, ParamreduceWarning

Item = TypeVar("Item")
Result = TypeVar("Result")


@contextlib.contextmanager
def workers(
    jobs: int, start: Callable[..., None], *arguments: Any
) -> Iterator[ProcessPoolExecutor]:
    """Processes that ignore Ctrl-C; their parent stops them, however it ends.

    Args:
        jobs: How many.
        start: Called in each when it begins.
        arguments: Of that.
    """
    context = multiprocessing.get_context("spawn")
    others = set(multiprocessing.active_children())
    pool = ProcessPoolExecutor(jobs, context, _begin, (os.getpid(), start, arguments))
    try:
        yield pool
        pool.shutdown()
    except BaseException:
        pool.shutdown(wait=False, cancel_futures=True)
        for process in set(multiprocessing.active_children()) - others:
            process.terminate()
        raise


def as_done(
    pool: ProcessPoolExecutor, work: Callable[[Item], Result], items: Iterable[Item]
) -> Iterator[tuple[Item, Result]]:
    """Work on items in any order.

    Yields:
        Each item with its result, when it is done.

    Raises:
        DataError: A process died.
    """
    try:
        with _interruption_held():  # so that new processes are born without it
            futures = {pool.submit(work, item): item for item in items}
        for future in as_completed(futures):
            yield futures[future], future.result()
    except BrokenProcessPool as error:
        raise DataError(
            "a worker process died, for want of memory, or because a script asks for jobs outside of "
            '`if __name__ == "__main__":`, which each of them runs again. Run it again, with fewer jobs.'
        ) from error


@contextlib.contextmanager
def _interruption_held() -> Iterator[None]:
    """Keep Ctrl-C waiting; processes started meanwhile never get it."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _begin(parent: int, start: Callable[..., None], arguments: tuple[Any, ...]) -> None:
    # First of all, with the number that the parent gave: it may be gone already.
    threading.Thread(target=_end_with, args=(parent,), daemon=True).start()
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    warnings.simplefilter("ignore", ParamreduceWarning)  # the parent has said it
    start(*arguments)


def _end_with(parent: int) -> None:
    """End this process when its parent is gone, however that ended."""
    while os.getppid() == parent:
        time.sleep(0.5)
    os._exit(1)
