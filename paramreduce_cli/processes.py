"""Work in other processes, which end with their parent and leave interruptions to it."""

import contextlib
import multiprocessing
import os
import signal
import sys
import threading
import warnings
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from multiprocessing.context import BaseContext
from typing import Any, TypeVar

from paramreduce_cli.errors import DataError, ParamreduceWarning

Item = TypeVar("Item")
Result = TypeVar("Result")


def process_context() -> BaseContext:
    """Return how processes are started: forked from a server that has imported this package once.

    A fork of this process could hang, as Matplotlib, h5py and the progress display keep threads and locks. Where there
    is no server, as on Windows, each process imports all by itself.
    """
    if "forkserver" not in multiprocessing.get_all_start_methods():
        return multiprocessing.get_context("spawn")
    context = multiprocessing.get_context("forkserver")
    package = __name__.partition(".")[0]
    context.set_forkserver_preload([name for name in sys.modules if name.startswith(package)])
    return context


@contextlib.contextmanager
def workers(
    jobs: int, start: Callable[..., None], *arguments: Any
) -> Iterator[ProcessPoolExecutor]:
    """Start processes that ignore Ctrl-C; their parent stops them, however the parent ends.

    Args:
        jobs: How many processes.
        start: Function that each process calls when it begins.
        arguments: Arguments of ``start``.
    """
    others = set(multiprocessing.active_children())
    environment = dict(os.environ)  # the server of processes keeps the one that it was started in
    pool = ProcessPoolExecutor(jobs, process_context(), _begin, (environment, start, arguments))
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


def _begin(
    environment: dict[str, str], start: Callable[..., None], arguments: tuple[Any, ...]
) -> None:
    """Prepare a worker process, then call its ``start``."""
    threading.Thread(target=_end_with_parent, daemon=True).start()
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    os.environ.clear()
    os.environ.update(environment)
    warnings.simplefilter("ignore", ParamreduceWarning)  # the parent has said it
    start(*arguments)


def _end_with_parent() -> None:
    """End this process when the process that asked for it is gone, however that ended."""
    parent = multiprocessing.parent_process()
    assert parent is not None
    parent.join()
    os._exit(1)
