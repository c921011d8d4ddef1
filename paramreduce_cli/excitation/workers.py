"""Many trajectories in parallel processes, each with one BLAS thread and a seed of its own.

The result of a trajectory depends on its key alone, so it is the same whatever the number
of processes. Worker processes ignore Ctrl-C; their parent stops them.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import queue
import signal
import threading
import time
import warnings
import zlib
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from multiprocessing.queues import Queue

import numpy as np

from paramreduce_cli.errors import DataError, ParamreduceWarning
from paramreduce_cli.excitation.criteria import criteria
from paramreduce_cli.excitation.loads import Loads
from paramreduce_cli.excitation.objective import Excitation
from paramreduce_cli.excitation.optimiser import Settings, optimise_trajectory
from paramreduce_cli.excitation.scalings import scalings
from paramreduce_cli.multibody.drives import smoothed
from paramreduce_cli.multibody.dynamics import Dynamics
from paramreduce_cli.multibody.loops.coordinates import Coordinates
from paramreduce_cli.multibody.quantities import Quantities
from paramreduce_cli.records import (
    BaseParameters,
    Constraint,
    FloatArray,
    Mechanism,
    Progress,
    Run,
    Trajectory,
)


@dataclass(frozen=True)
class ExcitationTask:
    """What is asked of all trajectories."""

    mechanism: Mechanism
    base: BaseParameters
    base_values: FloatArray
    """Of the base parameters, (r,)."""
    nominal_torque: FloatArray
    criterion: str
    constraints: tuple[Constraint, ...]
    settings: Settings
    seed: int


def excitation_of(task: ExcitationTask) -> Excitation:
    """The measurement of a mechanism's base columns; compiles its regressor."""
    mechanism, columns = task.mechanism, task.base.columns
    settings = task.settings
    # No motion of the series is faster, whatever the limits allow.
    fastest = settings.limits.reach * 2 * np.pi * settings.harmonics / settings.period
    smooth = smoothed(mechanism, np.minimum(settings.limits.velocity, fastest))
    coordinates, true = Coordinates(mechanism), Dynamics(mechanism)
    observation = Dynamics(smooth).observation(columns)

    def measured(q: FloatArray, dz: FloatArray, ddz: FloatArray) -> FloatArray:
        K = true.regressor(q, *coordinates.rates(q, dz, ddz))
        return K[..., columns].reshape(-1, columns.size)

    return Excitation(
        observation=observation,
        measured=observation.forward if smooth is mechanism else measured,
        coordinates=coordinates,
        quantities=Quantities(mechanism, task.constraints),
        beta=task.base.beta,
        nominal_torque=task.nominal_torque,
        criterion=criteria[task.criterion],
        scaling=scalings[task.settings.scaling],
        loads=Loads(
            task.base_values, settings.limits.torque, settings.limits.power, task.nominal_torque
        ),
    )


def optimise_all(task: ExcitationTask, keys: list[str], run: Run) -> dict[str, Trajectory]:
    """Optimise the trajectories that are not among the finished parts yet.

    Args:
        task: What is asked.
        keys: Names of the trajectories; each seeds its own random numbers.
        run: Workers, finished parts and progress.

    Raises:
        KeyboardInterrupt: After all workers have been stopped; finished parts are kept.
    """
    found = {key: run.parts[key] for key in keys if key in run.parts}
    for key in found:
        run.progress(Progress(key, 1.0, 1.0, "kept from before"))
    missing = [key for key in keys if key not in found]
    if not missing:
        return found
    excitation = excitation_of(task)  # compile once, before the workers all ask for it
    if run.jobs == 0:
        for key in missing:
            made = optimise_trajectory(excitation, task.settings, _seed(task, key), lambda _: None)
            found[key] = run.parts[key] = made
            run.progress(Progress(key, 1.0, 1.0, f"kappa {made.kappa:.4g}"))
        return found
    with _pool(task, min(run.jobs, len(missing)), run) as pool:
        with _interruption_held():  # so that new processes are born without it
            futures = {pool.submit(_optimise, key): key for key in missing}
        try:
            for future in as_completed(futures):
                key = futures[future]
                found[key] = run.parts[key] = future.result()
                run.progress(Progress(key, 1.0, 1.0, f"kappa {found[key].kappa:.4g}"))
        except BrokenProcessPool as error:
            raise DataError(
                "a worker process died, perhaps for want of memory. Finished trajectories are "
                "kept; run the same command again, with fewer jobs."
            ) from error
    return found


@contextlib.contextmanager
def _pool(task: ExcitationTask, jobs: int, run: Run) -> Iterator[ProcessPoolExecutor]:
    context = multiprocessing.get_context("spawn")
    news: Queue[Progress | None] = context.Queue()
    listener = threading.Thread(target=_listen, args=(news, run), daemon=True)
    listener.start()
    pool = ProcessPoolExecutor(jobs, context, _start_worker, (os.getpid(), task, news))
    try:
        yield pool
        pool.shutdown()
    except BaseException:
        pool.shutdown(wait=False, cancel_futures=True)
        for process in multiprocessing.active_children():
            process.terminate()
        raise
    finally:
        news.put(None)
        listener.join(timeout=5)


@contextlib.contextmanager
def _interruption_held() -> Iterator[None]:
    """Keep Ctrl-C waiting; processes started meanwhile never get it."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _listen(news: Queue[Progress | None], run: Run) -> None:
    while True:
        try:
            item = news.get()
        except (EOFError, OSError, queue.Empty):
            return
        if item is None:
            return
        run.progress(item)


class _Worker:
    """What a worker process knows; set once when it starts."""

    task: ExcitationTask
    excitation: Excitation
    news: Queue[Progress | None]


def _start_worker(parent: int, task: ExcitationTask, news: Queue[Progress | None]) -> None:
    # First of all, with the number that the parent gave: it may be gone already.
    threading.Thread(target=_end_with, args=(parent,), daemon=True).start()
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    warnings.simplefilter("ignore", ParamreduceWarning)  # the parent has said it
    _Worker.task, _Worker.news = task, news
    _Worker.excitation = excitation_of(task)


def _end_with(parent: int) -> None:
    """End this process when its parent is gone, however that ended."""
    while os.getppid() == parent:
        time.sleep(0.5)
    os._exit(1)


def _optimise(key: str) -> Trajectory:
    task = _Worker.task

    def tell(share: float) -> None:
        if share < 1.0:
            _Worker.news.put(Progress(key, share, 1.0))

    return optimise_trajectory(_Worker.excitation, task.settings, _seed(task, key), tell)


def _seed(task: ExcitationTask, key: str) -> list[int]:
    """Of a trajectory's own random numbers."""
    return [task.seed, zlib.crc32(key.encode())]
