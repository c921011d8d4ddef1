"""Everything a figure or a table may show, gathered once."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from paramreduce_cli.records import (
    Block,
    FloatArray,
    Model,
    Reduction,
    Trajectories,
    Validation,
)
from paramreduce_cli.report.tracking import Tracking


@dataclass(frozen=True)
class Motion:
    """One trajectory of the validation set with its torques over the nominal ones."""

    time: FloatArray
    z: FloatArray
    dz: FloatArray
    ddz: FloatArray
    q: FloatArray
    """Generalised coordinates, (n_samples, n_q)."""
    full: FloatArray
    """Full model, (n_samples, n_dof)."""
    reduced: FloatArray
    """Selected model, (n_samples, n_dof)."""


@dataclass(frozen=True)
class TrajectorySetup:
    """What was asked of the trajectories, as (label, text)."""

    rows: tuple[tuple[str, str], ...]


@dataclass(frozen=True)
class Skeleton:
    """A mechanism in one pose, for drawing."""

    z: FloatArray
    poses: FloatArray
    """Frames of the bodies, (n_bodies, 4, 4)."""
    joints: FloatArray
    """Frames of the joints, before their motion, (n_bodies, 4, 4)."""
    masses: FloatArray
    """Centres of mass, NaN for bodies without mass, (n_bodies, 3), m."""
    parents: tuple[int, ...]
    kinds: tuple[str, ...]
    closures: tuple[FloatArray, ...]
    """From one body's origin over the closure to the other's, for each loop, (n_points, 3), m."""


@dataclass(frozen=True)
class ReportData:
    """What the report is made from."""

    title: str
    model: Model
    trajectories: Trajectories | None
    setup: TrajectorySetup
    reduction: Reduction
    validation: Validation
    motion: Motion
    skeletons: tuple[Skeleton, ...]
    tracking: Tracking | None
    """Where it was asked for."""


def first_motion(
    blocks: Iterable[Block], column: FloatArray, nominal_torque: FloatArray, most: int = 1000
) -> Motion:
    """The first trajectory of a set, with full and reduced torques.

    Args:
        blocks: The set.
        column: The reduced model's parameters, zero where one is not kept, (n_parameters,).
        nominal_torque: (n_dof,)
        most: Samples at which to stop.
    """
    parts: list[Block] = []
    count = 0
    for block in blocks:
        if block.trajectory != 0 or count >= most:
            break
        parts.append(block)
        count += block.time.size
    full = np.concatenate([p.tau for p in parts])
    reduced = np.concatenate([(p.W @ column).reshape(p.tau.shape) for p in parts])
    return Motion(
        time=np.concatenate([p.time for p in parts]),
        z=np.concatenate([p.z for p in parts]),
        dz=np.concatenate([p.dz for p in parts]),
        ddz=np.concatenate([p.ddz for p in parts]),
        q=np.concatenate([p.q for p in parts]),
        full=full / nominal_torque,
        reduced=reduced / nominal_torque,
    )
