"""Many trajectories in parallel processes, each with one BLAS thread and a seed of its own.

The result of a trajectory depends on its key alone, so it is the same whatever the number
of processes.
"""

from __future__ import annotations

import zlib
from dataclasses import dataclass
from functools import partial

import numpy as np

from paramreduce_cli.excitation.criteria import criteria
from paramreduce_cli.excitation.excitation_objective import Excitation
from paramreduce_cli.excitation.optimiser import TrajectorySettings, optimise_trajectory
from paramreduce_cli.excitation.scalings import scalings
from paramreduce_cli.excitation.torque_constraints import TorqueConstraints
from paramreduce_cli.multibody.drive_dynamics import smooth_friction
from paramreduce_cli.multibody.dynamics import Dynamics
from paramreduce_cli.multibody.loops.coordinates import Coordinates
from paramreduce_cli.multibody.quantities import Quantities
from paramreduce_cli.records import (
    BaseParameters,
    Constraint,
    FloatArray,
    Items,
    Mechanism,
    Run,
    Trajectory,
)
from paramreduce_cli.resources.item_completion import complete_items


@dataclass(frozen=True)
class ExcitationTask:
    """The settings that all trajectories share."""

    mechanism: Mechanism
    base: BaseParameters
    base_values: FloatArray
    """Values of the base parameters, (r,)."""
    torque_scale: FloatArray
    """Divisor of the rows of each joint, (n_dof,), N m or N."""
    criterion: str
    constraints: tuple[Constraint, ...]
    settings: TrajectorySettings
    seed: int


def build_excitation(task: ExcitationTask) -> Excitation:
    """Return the excitation criterion of a mechanism's base columns; its regressor is compiled here."""
    mechanism, columns = task.mechanism, task.base.columns
    settings = task.settings
    # No motion of the series is faster, whatever the limits allow.
    fastest = settings.limits.reach * 2 * np.pi * settings.harmonics / settings.period
    smooth = smooth_friction(mechanism, np.minimum(settings.limits.velocity, fastest))
    coordinates, true = Coordinates(mechanism), Dynamics(mechanism)
    observation = Dynamics(smooth).make_observation(columns)

    def compute_columns(q: FloatArray, dz: FloatArray, ddz: FloatArray) -> FloatArray:
        """Return the base columns of W with the exact sign of friction, (n_points * n_dof, r)."""
        K = true.compute_regressor(q, *coordinates.compute_rates(q, dz, ddz))
        return K[..., columns].reshape(-1, columns.size)

    return Excitation(
        observation=observation,
        measured=observation.evaluate if smooth is mechanism else compute_columns,
        coordinates=coordinates,
        quantities=Quantities(mechanism, task.constraints),
        beta=task.base.beta,
        torque_scale=task.torque_scale,
        criterion=criteria[task.criterion],
        scaling=scalings[task.settings.scaling],
        loads=TorqueConstraints(
            task.base_values, settings.limits.torque, settings.limits.power, task.torque_scale
        ),
    )


def optimise_all(
    task: ExcitationTask, keys: list[str], run: Run, items: Items
) -> dict[str, Trajectory]:
    """Optimise the trajectories that are not among the finished items yet.

    Args:
        task: Task with objective, limits and settings.
        keys: Names of the trajectories; each seeds its own random numbers.
        run: Number of processes, and the progress callback.
        items: Finished trajectories, and the part of this job.

    Returns:
        Trajectories by key.

    Raises:
        PartFinished: This job does only a part of the trajectories, and that is done.
        KeyboardInterrupt: After all workers have been stopped; finished trajectories are kept.
    """

    def prepare() -> None:
        build_excitation(task)  # compile once, before the processes all ask for it

    return complete_items(
        run, items, keys, partial(_Optimiser, task), _optimise,
        task="trajectories", jobs=run.jobs, describe=lambda made: f": kappa {made.kappa:.4g}", prepare=prepare,
    )  # fmt: skip


class _Optimiser:
    """An optimiser of a task's trajectories.

    Args:
        task: Settings that all trajectories share.
    """

    def __init__(self, task: ExcitationTask) -> None:
        self._task, self._excitation = task, build_excitation(task)

    def optimise(self, key: str) -> Trajectory:
        """Return the trajectory of a key, which seeds its random numbers."""
        seed = [self._task.seed, zlib.crc32(key.encode())]
        return optimise_trajectory(self._excitation, self._task.settings, seed)


def _optimise(optimiser: _Optimiser, key: str) -> Trajectory:
    return optimiser.optimise(key)
