"""Zeros, directions and order of joints that would explain a log: a search over discrete hypotheses."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from paramreduce_cli.multibody.dynamics import Dynamics
from paramreduce_cli.records import BoolArray, FloatArray, IntArray
from paramreduce_cli.texts import format_percent

_TURNS = (0.0, np.pi / 2, -np.pi / 2, np.pi)
"""Offsets that are tried, rad."""
_TURN_NAMES = {0.0: "0", np.pi / 2: "pi/2", -np.pi / 2: "-pi/2", np.pi: "pi"}
_MOST_SAMPLES = 250
_STEP_GAIN = 0.8
"""Ratio of the error after one more change to the one before, below which the change is kept."""
_GAIN = 0.5
"""Ratio of the error after all changes to the one before, below which the hypothesis is named."""
_PAIRS_FROM = 0.05
"""Error from which on two joints are changed at a time if one alone does not help."""


@dataclass(frozen=True)
class JointFrames:
    """A relation of the joints of a log to those of the model.

    Attributes:
        order: Index of the log's joint behind each joint, (n_dof,).
        signs: Sign of motion and torque of each joint, (n_dof,).
        offsets: Added to the positions of each joint, rad, (n_dof,).
    """

    order: IntArray
    signs: FloatArray
    offsets: FloatArray

    def count_changes(self) -> int:
        """Return the number of joints whose order, sign or offset is changed."""
        moved = self.order != np.arange(self.order.size)
        return int(np.count_nonzero(moved | (self.signs < 0) | (self.offsets != 0)))


def hint_at_joint_frames(
    dynamics: Dynamics,
    states: Sequence[FloatArray],
    tau: FloatArray,
    measured: BoolArray,
    names: Sequence[str],
) -> Iterator[str]:
    """Yield a hint if other zeros, directions or another order of the joints explain a log far better.

    Args:
        dynamics: Dynamics of an open tree.
        states: Positions, speeds and accelerations, (n_samples, n_dof) each.
        tau: Torques, (n_samples, n_dof).
        measured: Joints whose torques are measured, (n_dof,).
        names: Names of the joints.
    """
    search = _FrameSearch(dynamics, states, tau, measured)
    usual = search.start
    before = search.compute_error(usual)
    found, after = search.run(before)
    if not found.count_changes() or after > _GAIN * before:
        return
    said = []
    for j, name in enumerate(names):
        if found.order[j] != j:
            said.append(f"the columns of {names[found.order[j]]} for {name}")
    if np.any(found.signs < 0):
        said.append(f"signs: [{', '.join(f'{sign:g}' for sign in found.signs)}]")
    if np.any(found.offsets):
        said.append(f"offsets: [{', '.join(_TURN_NAMES[float(o)] for o in found.offsets)}]")
    yield (
        f"With {' and '.join(said)} all parameters would leave {format_percent(after)} of the torques instead of "
        f"{format_percent(before)}: are zeros, directions or the order of the joints others in the log? See sampling.log; "
        "offsets are added to those that are given, signs multiply them."
    )


class _FrameSearch:
    """A search that changes one joint or one pair of joints at a time.

    Args:
        dynamics: Dynamics of an open tree.
        states: Positions, speeds and accelerations, (n_samples, n_dof) each.
        tau: Torques, (n_samples, n_dof).
        measured: Joints whose torques are measured, (n_dof,).
    """

    def __init__(
        self, dynamics: Dynamics, states: Sequence[FloatArray], tau: FloatArray, measured: BoolArray
    ) -> None:
        every = slice(None, None, max(1, len(tau) // _MOST_SAMPLES))
        self._dynamics = dynamics
        self._states = [state[every] for state in states]
        self._tau, self._measured = tau[every], measured
        n_dof = tau.shape[1]
        mechanism = dynamics.mechanism
        self._turning = [mechanism.bodies[k].joint == "revolute" for k in mechanism.independent]
        self.start = JointFrames(np.arange(n_dof), np.ones(n_dof), np.zeros(n_dof))

    def compute_error(self, frames: JointFrames) -> float:
        """Return the relative error that all parameters leave, in N m: the large torques tell most of gravity."""
        z, dz, ddz = (frames.signs * state[:, frames.order] for state in self._states)
        K = self._dynamics.compute_regressor(z + frames.offsets, dz, ddz)[:, self._measured]
        tau = (frames.signs * self._tau[:, frames.order])[:, self._measured]
        X, y = K.reshape(-1, K.shape[2]), tau.ravel()
        parameters = np.linalg.lstsq(X, y, rcond=1e-9)[0]
        return float(np.linalg.norm(y - X @ parameters) / np.linalg.norm(y))

    def run(self, before: float) -> tuple[JointFrames, float]:
        """Return the best hypothesis found and its error, given the error without any change."""
        frames, error = self.start, before
        while True:
            tried = [
                (self.compute_error(other), k, other)
                for k, other in enumerate(self._change_one(frames))
            ]
            best, _, other = min(tried)
            if best > _STEP_GAIN * error and error > _PAIRS_FROM and frames is self.start:
                tried = [
                    (self.compute_error(o), k, o) for k, o in enumerate(self._turn_two(frames))
                ]
                best, _, other = min(tried, default=(np.inf, 0, frames))
            if best > _STEP_GAIN * error:
                return frames, error
            frames, error = other, best

    def _change_one(self, frames: JointFrames) -> Iterator[JointFrames]:
        """Yield hypotheses with another sign or zero of one joint, or with two joints exchanged."""
        n_dof = frames.order.size
        for j in range(n_dof):
            for sign in (1.0, -1.0):
                for turn in _TURNS if self._turning[j] else _TURNS[:1]:
                    if (sign, turn) != (frames.signs[j], frames.offsets[j]):
                        signs, offsets = frames.signs.copy(), frames.offsets.copy()
                        signs[j], offsets[j] = sign, turn
                        yield JointFrames(frames.order, signs, offsets)
        for i, j in combinations(range(n_dof), 2):
            order = frames.order.copy()
            order[[i, j]] = order[[j, i]]
            yield JointFrames(order, frames.signs, frames.offsets)

    def _turn_two(self, frames: JointFrames) -> Iterator[JointFrames]:
        """Yield hypotheses with other zeros of two joints."""
        turning = [j for j, turns in enumerate(self._turning) if turns]
        for i, j in combinations(turning, 2):
            for first in _TURNS[1:]:
                for second in _TURNS[1:]:
                    offsets = frames.offsets.copy()
                    offsets[[i, j]] = first, second
                    yield JointFrames(frames.order, frames.signs, offsets)
