"""Many trajectories in parallel processes, each with one BLAS thread and a seed of its own.

The result of a trajectory depends on its key alone, so it is the same whatever the number
of processes.
"""

from __future__ import annotations

import contextlib
import queue
import threading
import zlib
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from multiprocessing.queues import Queue

import numpy as np

from paramreduce_cli.excitation.criteria import criteria
from paramreduce_cli.excitation.loads import Loads
from paramreduce_cli.excitation.objective import Excitation
from paramreduce_cli.excitation.optimiser import Settings, optimise_trajectory
from paramreduce_cli.excitation.scalings import scalings
from paramreduce_cli.multibody.drives import smoothed
from paramreduce_cli.multibody.dynamics import Dynamics
from paramreduce_cli.multibody.loops.coordinates import Coordinates
from paramreduce_cli.multibody.quantities import Quantities
from paramreduce_cli.processes import as_done, process_context, workers
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
    torque_scale: FloatArray
    """What rows of each joint are divided by, (n_dof,), N m or N."""
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
        torque_scale=task.torque_scale,
        criterion=criteria[task.criterion],
        scaling=scalings[task.settings.scaling],
        loads=Loads(
            task.base_values, settings.limits.torque, settings.limits.power, task.torque_scale
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
    total = _TotalProgress(run, keys)
    if found:
        total.report_done(found, f"{len(found)} kept from before")
    missing = [key for key in keys if key not in found]
    if not missing:
        return found
    excitation = excitation_of(task)  # compile once, before the workers all ask for it

    def keep(key: str, made: Trajectory) -> None:
        found[key] = run.parts[key] = made
        total.report_done([key], f"{key}: kappa {made.kappa:.4g}")

    if run.jobs < 2:
        for key in missing:
            keep(key, _optimised(task, excitation, key, total.report_fraction))
        return found
    with (
        _news_for(total) as news,
        workers(min(run.jobs, len(missing)), _start_worker, task, news) as pool,
    ):
        for key, made in as_done(pool, _optimise, missing):
            keep(key, made)
    return found


class _TotalProgress:
    """The progress of all trajectories together.

    Args:
        run: Whose progress callback is called.
        keys: Names of the trajectories.
    """

    def __init__(self, run: Run, keys: list[str]) -> None:
        self._run = run
        self._fractions = dict.fromkeys(keys, 0.0)

    def report_fraction(self, key: str, fraction: float) -> None:
        """Report which fraction of one trajectory is done."""
        self._fractions[key] = fraction
        self._report("")

    def report_done(self, keys: Iterable[str], remark: str) -> None:
        """Report that some trajectories are done."""
        self._fractions |= dict.fromkeys(keys, 1.0)
        self._report(remark)

    def _report(self, remark: str) -> None:
        done = round(sum(self._fractions.values()), 3)
        self._run.progress(Progress("trajectories", done, len(self._fractions), remark))


@contextlib.contextmanager
def _news_for(total: _TotalProgress) -> Iterator[Queue[tuple[str, float] | None]]:
    """Make a queue whose news, keys with fractions that are done, reach the progress of the run."""
    news: Queue[tuple[str, float] | None] = process_context().Queue()
    listener = threading.Thread(target=_listen, args=(news, total), daemon=True)
    listener.start()
    try:
        yield news
    except BaseException:
        news.cancel_join_thread()  # a worker that was stopped may hold the lock for ever
        raise
    finally:
        news.put(None)
        listener.join(timeout=5)


def _listen(news: Queue[tuple[str, float] | None], total: _TotalProgress) -> None:
    while True:
        try:
            item = news.get()
        except (EOFError, OSError, queue.Empty):
            return
        if item is None:
            return
        total.report_fraction(*item)


class _Worker:
    """What a worker process knows; set once when it starts."""

    task: ExcitationTask
    excitation: Excitation
    news: Queue[tuple[str, float] | None]


def _start_worker(task: ExcitationTask, news: Queue[tuple[str, float] | None]) -> None:
    _Worker.task, _Worker.news = task, news
    _Worker.excitation = excitation_of(task)


def _optimise(key: str) -> Trajectory:
    return _optimised(_Worker.task, _Worker.excitation, key, lambda *step: _Worker.news.put(step))


def _optimised(
    task: ExcitationTask, excitation: Excitation, key: str, on_step: Callable[[str, float], None]
) -> Trajectory:
    """Optimise the trajectory of one key, and tell how far that is."""

    def on_fraction(fraction: float) -> None:
        if fraction < 1.0:
            on_step(key, fraction)

    return optimise_trajectory(excitation, task.settings, _seed(task, key), on_fraction)


def _seed(task: ExcitationTask, key: str) -> list[int]:
    """Of a trajectory's own random numbers."""
    return [task.seed, zlib.crc32(key.encode())]
