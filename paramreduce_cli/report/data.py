"""Everything a figure or a table may show, gathered once."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from paramreduce_cli.records import (
    Artifacts,
    Block,
    CountedDynamics,
    FloatArray,
    LoopEvaluation,
    Model,
    ReducedModel,
    Samples,
    SimulatedManoeuvre,
    Speed,
    Tracking,
)
from paramreduce_cli.report.skeleton import Animation, Skeleton

NO_TORQUE = 1e-100
"""What stands for zero, N m or N."""


@dataclass(frozen=True)
class ShownMotion:
    """One trajectory of the validation set with its torques."""

    time: FloatArray
    """s, or numbers of samples where times are not known."""
    timed: bool
    z: FloatArray
    dz: FloatArray
    ddz: FloatArray
    q: FloatArray
    """Generalised coordinates, (n_samples, n_q)."""
    tau: FloatArray
    """Torques of the full model or measured ones, (n_samples, n_dof), N m or N."""
    W: FloatArray
    """Observation matrix, (n_samples, n_dof, n_parameters)."""
    full: FloatArray
    """Full model, (n_samples, n_dof), N m or N."""
    reduced: FloatArray
    """Selected model, (n_samples, n_dof), N m or N."""


@dataclass(frozen=True)
class ReportData(Artifacts):
    """All records that the report shows; without a model the sections of a mechanism are missing."""

    title: str
    symmetries: int
    """Number of symmetries that complete the estimation set."""
    weighting: str
    """Weighting of the residuals in fits, as the config names it."""
    counted: CountedDynamics
    """Functions of closed loops that are counted."""
    simulated: bool
    """Whether the states of the samples are those of a simulation."""
    rms_torque: Mapping[str, FloatArray]
    """Root mean square of each joint's torque by set, (n_dof,), N m or N: what a relative error of one
    is; next to nothing where the torque is zero, so that errors there are not lost."""
    motion: ShownMotion
    skeletons: tuple[Skeleton, ...]
    animation: Animation | None
    """Animation of the motions of both sets, where there is a mechanism."""
    unsafe: bool
    """Whether the selected model must not be simulated, as its mass matrix is indefinite or nearly singular."""
    speed: Speed | None
    """Speed of the inverse dynamics of the full and of the selected model; None without a robot."""
    speed_direct: Speed | None
    """Speed of the direct dynamics of the full and of the selected model; None without a robot."""
    loops: LoopEvaluation | None
    """Operations and time of the kinematics of closed loops; None without loops."""
    tracking: Tracking | None
    """Simulated control; None if it was not requested."""
    manoeuvre: SimulatedManoeuvre | None
    """A simulated manoeuvre of the full and of the selected model; None where samples are not simulated, or the selected
    model cannot be.
    """

    @property
    def n_affecting(self) -> int:
        """Number of parameters that act on the torques: columns of the observation matrix that are not zero."""
        if self.model is None:
            return self.reduction.n_affecting
        return int(self.model.affecting.sum())

    def find_unit(self, parameter: int) -> str:
        """Return the unit of a standard parameter; empty for user-supplied columns without a robot."""
        if self.model is None:
            return ""
        return self.model.mechanism.parameters[parameter].unit

    def find_force_unit(self, joint: int) -> str:
        """Return the unit of what acts on a joint; empty without a robot."""
        if self.model is None:
            return ""
        mechanism = self.model.mechanism
        kind = mechanism.bodies[mechanism.independent[joint]].joint
        return "N m" if kind == "revolute" else "N"

    def find_length_unit(self, coordinate: str) -> str:
        """Return the unit of an independent coordinate of the robot: rad or m."""
        joint = self.robot_model.mechanism.coordinate_names.index(coordinate)
        return "rad" if self.find_force_unit(joint) == "N m" else "m"

    def name_joint(self, joint: int) -> str:
        """Return the name of a joint's coordinate."""
        if self.model is None:
            return f"joint {joint + 1}"
        return self.model.mechanism.coordinate_names[joint]

    @property
    def functions(self) -> tuple[str, str]:
        """Symbols of the functions whose operations are counted: inverse and direct dynamics."""
        if self.model is None or self.model.mechanism.loops is None:
            return "d", "[M | δ]"
        if self.counted is CountedDynamics.INDEPENDENT:
            return "d_z", "[M_zz | δ_z]"
        return "d_q", "[M_qq | δ_q]"

    @property
    def robot_model(self) -> Model:
        """Model of the robot, for figures and tables that need a mechanism.

        Raises:
            LookupError: The report is of user-supplied columns, without a robot.
        """
        if self.model is None:
            raise LookupError("a figure or a table of a mechanism, and there is none")
        return self.model


def downsample_motions(samples: Samples, most: int, frames: int) -> dict[str, FloatArray]:
    """Return generalised coordinates along the trajectories of both sets, the characteristic motion first.

    Args:
        samples: Samples of both sets.
        most: Largest number of trajectories of each set.
        frames: Approximate number of frames of all motions together.

    Returns:
        (n_frames, n_q) by the name of each motion, evenly spread over it.
    """
    found: dict[str, list[FloatArray]] = {}
    for name, part in (("validation", samples.validation), ("estimation", samples.estimation)):
        for block in part.iterate_blocks() if part is not None else ():
            if block.trajectory >= most:
                break
            found.setdefault(f"{name} {block.trajectory + 1}", []).append(block.q)
    whole = {name: np.concatenate(parts) for name, parts in found.items()}
    return {name: q[:: max(1, -(-len(q) * len(whole) // frames))] for name, q in whole.items()}


def find_first_motion(
    blocks: Iterable[Block], model: ReducedModel, most: int = 1000
) -> ShownMotion:
    """Return the first trajectory of a set, with full and reduced torques.

    Args:
        blocks: Blocks of the set.
        model: Reduced model.
        most: Number of samples; motions with more than twice as many are decimated by 2, 4, ...
    """
    parts: list[Block] = []
    every, seen = 1, 0
    for block in blocks:
        if block.trajectory != 0:
            break
        parts.append(_downsample_block(block, -seen % every, every))
        seen += block.time.size
        while seen > 2 * most * every:
            first = np.cumsum([0, *(p.time.size for p in parts)])
            parts = [
                _downsample_block(p, -int(k) % 2, 2) for p, k in zip(parts, first[:-1], strict=True)
            ]
            every *= 2
    phi = model.standard
    time = np.concatenate([p.time for p in parts])
    timed = bool(np.ptp(time) > 0)
    tau = np.concatenate([p.tau for p in parts])
    W = np.concatenate([p.W for p in parts]).reshape(*tau.shape, -1)
    return ShownMotion(
        time=time if timed else np.arange(float(time.size)),
        timed=timed,
        z=np.concatenate([p.z for p in parts]),
        dz=np.concatenate([p.dz for p in parts]),
        ddz=np.concatenate([p.ddz for p in parts]),
        q=np.concatenate([p.q for p in parts]),
        tau=tau,
        W=W,
        full=tau,
        reduced=W @ phi,
    )


def _downsample_block(block: Block, first: int, every: int) -> Block:
    """Return every n-th sample of a block."""
    picked = slice(first, None, every)
    W = block.W.reshape(*block.tau.shape, block.W.shape[1])[picked]
    states = {
        name: getattr(block, name)[picked]
        for name in ("time", "z", "dz", "ddz", "tau", "q", "dq", "ddq")
    }
    return replace(block, **states, W=W.reshape(-1, W.shape[2]))
