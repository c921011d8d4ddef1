"""Everything a figure or a table may show, gathered once."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from paramreduce_cli.records import (
    Block,
    FloatArray,
    Identification,
    MeasuredLog,
    Model,
    ReducedModel,
    Reduction,
    TermReduction,
    Tracking,
    Trajectories,
    Validation,
)
from paramreduce_cli.report.skeleton import Skeleton


@dataclass(frozen=True)
class ShownMotion:
    """One trajectory of the validation set with its torques over the nominal ones."""

    time: FloatArray
    """s, or numbers of samples where times are not known."""
    timed: bool
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
class ReportData:
    """What the report is made from."""

    title: str
    known_model: Model | None
    """None of samples that were brought without a robot; sections of a mechanism are then left out."""
    trajectories: Trajectories | None
    symmetries: int
    """How many symmetries complete the estimation set."""
    reduction: Reduction
    validation: Validation
    motion: ShownMotion
    skeletons: tuple[Skeleton, ...]
    tracking: Tracking | None
    """Where it was asked for."""
    log: MeasuredLog | None
    """Where there is one."""
    identification: Identification | None
    """Where torques were measured."""
    terms: TermReduction | None
    """Where terms were left out."""

    @property
    def n_affecting(self) -> int:
        """How many parameters act on the torques: columns of the observation matrix that are not zero."""
        if self.known_model is None:
            return self.reduction.n_affecting
        return int(self.known_model.affecting.sum())

    @property
    def model(self) -> Model:
        """The model, for what is of a mechanism.

        Raises:
            LookupError: There is none.
        """
        if self.known_model is None:
            raise LookupError("a figure or a table of a mechanism, and there is none")
        return self.known_model


def first_motion(
    blocks: Iterable[Block], model: ReducedModel, nominal_torque: FloatArray, most: int = 1000
) -> ShownMotion:
    """The first trajectory of a set, with full and reduced torques.

    Args:
        blocks: The set.
        model: The reduced model.
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
    phi = model.standard
    time = np.concatenate([p.time for p in parts])
    timed = bool(np.ptp(time) > 0)
    full = np.concatenate([p.tau for p in parts])
    reduced = np.concatenate([(p.W @ phi).reshape(p.tau.shape) for p in parts])
    return ShownMotion(
        time=time if timed else np.arange(float(time.size)),
        timed=timed,
        z=np.concatenate([p.z for p in parts]),
        dz=np.concatenate([p.dz for p in parts]),
        ddz=np.concatenate([p.ddz for p in parts]),
        q=np.concatenate([p.q for p in parts]),
        full=full / nominal_torque,
        reduced=reduced / nominal_torque,
    )
