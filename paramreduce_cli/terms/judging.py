"""What a program without some of its terms is worth: on whole sets, and on random states."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from functools import cached_property

import numpy as np

from paramreduce_cli.errors import DataError
from paramreduce_cli.multibody.dynamics import Dynamics
from paramreduce_cli.multibody.loops.coordinates import Coordinates
from paramreduce_cli.multibody.observation import thinned_blocks
from paramreduce_cli.records import Block, FloatArray, Model, Samples, SampleSet
from paramreduce_cli.terms.descent import Simplified
from paramreduce_cli.terms.fitting import Budget
from paramreduce_cli.terms.samples import TermSamples, errors_over, term_samples

_TORQUES = 1000
"""Random states on which torques are compared with those of the full model."""
_MASSES = 100_000
"""Random states on which mass matrices are looked at."""
_AT_ONCE = 2000
"""Of them at a time."""
_JUDGED = 20_000
"""Samples of a set, evenly spread, that programs are judged on: more of them tell no more."""
_BLOCKS = 16
"""Blocks of samples that are judged together."""
_NONE = (np.nan, np.nan)

Errors = tuple[float, float]
"""Of torques and of accelerations."""


class Judge:
    """Judges programs of one function.

    Args:
        model: Of the robot.
        samples: Both sets.
        nominal_torque: (n_dof,)
        direct: Whether the function is [M | delta].
        projected: Whether it is of the independent coordinates of loops.
        measured: Whether torques were measured, so that those at other states are not known.
    """

    def __init__(
        self,
        model: Model,
        samples: Samples,
        nominal_torque: FloatArray,
        *,
        direct: bool,
        projected: bool,
        measured: bool,
    ) -> None:
        self.direct, self.projected = direct, projected
        self._n_standard = model.values.size
        self._model, self._samples, self._nominal_torque = model, samples, nominal_torque
        self.measured = measured
        self._rng = np.random.default_rng(0)
        if samples.nominal_acceleration is None:
            raise DataError(
                "samples.h5 holds no /nominal_acceleration; make it with `paramreduce sample`."
            )
        self._nominal_acceleration = samples.nominal_acceleration
        self._coordinates = Coordinates(model.mechanism, once=True)
        ranges = [
            [(x.min(axis=0), x.max(axis=0)) for x in (b.z, b.dz, b.ddz)]
            for b in samples.estimation.blocks()
        ]
        self.lower = np.array(ranges)[:, :, 0].min(axis=0)
        """Smallest z, dz and ddz of the estimation set, (3, n_dof)."""
        self.upper = np.array(ranges)[:, :, 1].max(axis=0)

    def thinned(self, part: SampleSet, most: int) -> TermSamples:
        """So many samples of a set at most, evenly spread."""
        return self._made(thinned_blocks(part.blocks(), -(-part.n_samples // most)))

    def _made(self, blocks: Iterable[Block]) -> TermSamples:
        return term_samples(
            self._model.mechanism, blocks, self._nominal_torque,
            self._nominal_acceleration, direct=self.direct, projected=self.projected,
            coordinates=self._coordinates,
        )  # fmt: skip

    def errors(self, program: Simplified) -> tuple[Errors, Errors]:
        """On the estimation and on the validation set; not numbers where there is no such set."""
        estimation, validation = (
            errors_over((one, program.outputs(one.states)) for one in parts) if parts else _NONE
            for parts in self._sets
        )
        return estimation, validation

    def allowed(self, errors: tuple[Errors, Errors], budget: Budget) -> bool:
        """Whether errors on both sets are; where torques were measured, what is held out is not looked at.

        What is not a number is not allowed.
        """
        no_other = self.measured or self._samples.validation is None
        return all(
            torque <= budget.torque and (not self.direct or acceleration <= budget.acceleration)
            for torque, acceleration in (errors[:1] if no_other else errors)
        )

    @cached_property
    def _sets(self) -> list[list[TermSamples]]:
        """Both sets in parts."""
        result = []
        for part in (self._samples.estimation, self._samples.validation):
            blocks: list[Block] = []
            if part is not None:
                blocks = list(thinned_blocks(part.blocks(), -(-part.n_samples // _JUDGED)))
            result.append([self._made(some) for some in _together(blocks)])
        return result

    def random(self, program: Simplified) -> tuple[float, FloatArray]:
        """Torque error on random states inside the ranges, and the largest difference of each joint.

        With loops, or where torques were measured, there is no error, and differences are those on both
        sets.
        """
        if self.measured or self._model.mechanism.loops is not None:
            off = [
                np.abs(s.differences(program.outputs(s.states))).max(axis=1)
                for parts in self._sets
                for s in parts
            ]
            return np.nan, np.max(off, axis=0)
        q, dq, ddq = self._random_states(_TORQUES)
        tau = Dynamics(self._model.mechanism, once=True).inverse(q, dq, ddq, self._model.values)
        made_up = self._made([self._block(q, dq, ddq, tau)])
        outputs = program.outputs(made_up.states)
        return made_up.errors(outputs)[0], np.abs(made_up.differences(outputs)).max(axis=1)

    def smallest_eigenvalue(self, program: Simplified) -> tuple[float, int]:
        """Of all mass matrices looked at, and on how many random states; with loops both sets alone."""
        smallest = min(
            float(np.linalg.eigvalsh(one.mass_matrices(program.outputs(one.states)))[:, 0].min())
            for one in self._looked_at()
        )
        return smallest, 0 if self._model.mechanism.loops is not None else _MASSES

    def poses(self, count: int) -> TermSamples | None:
        """States inside the ranges, half of them in their corners; None where M does not matter, or with
        loops, whose states would have to be assembled.
        """
        if not self.direct or self._model.mechanism.loops is not None:
            return None
        corners = self._rng.random((count - count // 2, *self.lower.shape)) < 0.5
        q, dq, ddq = np.moveaxis(np.where(corners, self.lower, self.upper), 1, 0)
        inside = self._random_states(count // 2)
        return self._made(
            [self._block(*(np.vstack(pair) for pair in zip((q, dq, ddq), inside, strict=True)))]
        )

    def _looked_at(self) -> Iterator[TermSamples]:
        for parts in self._sets:
            yield from parts
        if self._model.mechanism.loops is None:
            for _ in range(_MASSES // _AT_ONCE):
                yield self._made([self._block(*self._random_states(_AT_ONCE))])

    def _block(
        self, q: FloatArray, dq: FloatArray, ddq: FloatArray, tau: FloatArray | None = None
    ) -> Block:
        """States of a tree; without torques where these do not matter."""
        nothing = np.zeros((0, self._n_standard))
        tau = np.zeros_like(q) if tau is None else tau
        return Block(0, np.zeros(len(q)), q, dq, ddq, tau, q, dq, ddq, nothing)

    def _random_states(self, count: int) -> tuple[FloatArray, FloatArray, FloatArray]:
        drawn = self._rng.uniform(self.lower, self.upper, size=(count, *self.lower.shape))
        return drawn[:, 0], drawn[:, 1], drawn[:, 2]


def _together(blocks: list[Block]) -> Iterator[list[Block]]:
    for start in range(0, len(blocks), _BLOCKS):
        yield blocks[start : start + _BLOCKS]
