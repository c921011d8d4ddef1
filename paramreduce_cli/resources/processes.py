"""Worker processes, which end with their parent and leave interruptions to the parent."""

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
from typing import Any, Generic, TypeVar

from paramreduce_cli.errors import DataError, ParamreduceWarning

State = TypeVar("State")
Item = TypeVar("Item")
Result = TypeVar("Result")


class WorkerPool(Generic[State]):
    """A pool of workers that hold the same state: other processes, or this process alone.

    Args:
        state: Function that returns the state; called only if this process itself works.
        processes: Worker processes that hold the state; None to work in this process.
    """

    def __init__(self, state: Callable[[], State], processes: ProcessPoolExecutor | None) -> None:
        self._state, self._processes = state, processes

    def map_unordered(
        self, work: Callable[[State, Item], Result], items: Iterable[Item]
    ) -> Iterator[tuple[Item, Result]]:
        """Yield items with their results, in the order of completion.

        Args:
            work: Called with the state and an item; picklable.
            items: Picklable items.

        Yields:
            Each item with its result, in the order in which they are done.

        Raises:
            DataError: A process died.
        """
        if self._processes is None:
            state = self._state()
            for item in items:
                yield item, work(state, item)
            return
        try:
            with _block_interrupts():  # so that new processes are born without it
                futures = {self._processes.submit(_work_on, work, item): item for item in items}
            for future in as_completed(futures):
                yield futures[future], future.result()
        except BrokenProcessPool as error:
            raise DataError(
                "a worker process died, for want of memory, or because a script asks for jobs outside of "
                '`if __name__ == "__main__":`, which each of them runs again. Run it again, with fewer jobs.'
            ) from error


@contextlib.contextmanager
def start_workers(jobs: int, state: Callable[[], State]) -> Iterator[WorkerPool[State]]:
    """Start worker processes that ignore Ctrl-C, and stop them at the end of the block, however it ends.

    Args:
        jobs: Number of processes; with fewer than 2 this process does all work.
        state: Function that returns the state that the work on every item needs; picklable. Each process calls it once.
    """
    if jobs < 2:
        yield WorkerPool(state, None)
        return
    others = set(multiprocessing.active_children())
    environment = dict(os.environ)  # the server of processes keeps the one that it was started in
    processes = ProcessPoolExecutor(
        jobs, choose_start_method(), _initialise_worker, (environment, state)
    )
    try:
        yield WorkerPool(state, processes)
        processes.shutdown()
    except BaseException:
        processes.shutdown(wait=False, cancel_futures=True)
        for process in set(multiprocessing.active_children()) - others:
            process.terminate()
        raise


def choose_start_method() -> BaseContext:
    """Return the context that starts processes: forked from a server that has imported this package once.

    A fork of this process itself could hang, as Matplotlib, h5py and the progress display keep threads and locks.
    Without a server, as on Windows, each process imports everything by itself.
    """
    if "forkserver" not in multiprocessing.get_all_start_methods():
        return multiprocessing.get_context("spawn")
    context = multiprocessing.get_context("forkserver")
    package = __name__.partition(".")[0]
    context.set_forkserver_preload([name for name in sys.modules if name.startswith(package)])
    return context


@contextlib.contextmanager
def _block_interrupts() -> Iterator[None]:
    """Block Ctrl-C within the block; processes that start in the block never receive it."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


class _Worker:
    """The state that a worker process holds; set once when the process begins."""

    state: Any


def _initialise_worker(environment: dict[str, str], state: Callable[[], Any]) -> None:
    """Prepare a worker process, and compute its state."""
    threading.Thread(target=_exit_with_parent, daemon=True).start()
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    os.environ.clear()
    os.environ.update(environment)
    warnings.simplefilter("ignore", ParamreduceWarning)  # the parent has said it
    _Worker.state = state()


def _work_on(work: Callable[[Any, Item], Result], item: Item) -> Result:
    return work(_Worker.state, item)


def _exit_with_parent() -> None:
    """End this process as soon as its parent process is gone."""
    parent = multiprocessing.parent_process()
    assert parent is not None
    parent.join()
    os._exit(1)
