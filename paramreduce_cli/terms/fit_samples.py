"""Samples to fit programs to, with the maps from outputs to torques and mass matrices."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from paramreduce_cli.expressions.loops import compile_loop
from paramreduce_cli.multibody.loops.coordinates import Coordinates
from paramreduce_cli.records import Block, BoolArray, FloatArray, IntArray, Mechanism
from paramreduce_cli.terms.matrices import invert
from paramreduce_cli.terms.tape import Outputs


@dataclass(frozen=True)
class TermSamples:
    """A set of samples on which a program is fitted."""

    states: FloatArray
    """Inputs of the program after its parameters, (n_states, n_samples)."""
    direct: bool
    """Whether the program gives the lower triangle of M, row by row, then delta; else torques."""
    ddq: FloatArray
    """Accelerations that M is multiplied by, (n, n_samples)."""
    tangent: FloatArray | None
    """Projection of the torques of the program's n coordinates, (n_samples, n, n_dof); None for independent ones."""
    tau: FloatArray
    """Torques to be predicted, (n_dof, n_samples)."""
    nominal_torque: FloatArray
    """(n_dof,)"""
    ddz: FloatArray
    """Accelerations that the direct dynamics is to predict, (n_dof, n_samples)."""
    nominal_acceleration: FloatArray
    """(n_dof,)"""

    def select(self, which: BoolArray) -> TermSamples:
        """Return the marked samples, (n_samples,)."""
        return replace(
            self,
            states=np.ascontiguousarray(self.states[:, which]),
            ddq=np.ascontiguousarray(self.ddq[:, which]),
            tangent=None if self.tangent is None else self.tangent[which],
            tau=np.ascontiguousarray(self.tau[:, which]),
            ddz=np.ascontiguousarray(self.ddz[:, which]),
        )

    @cached_property
    def seeds(self) -> FloatArray:
        """Derivatives of the torques with respect to the outputs of the program, (n_outputs, n_dof, n_samples)."""
        n, count = self.ddq.shape
        across = self._across
        if across is None:
            across = np.broadcast_to(np.eye(n)[:, :, None], (n, n, count))
        if not self.direct:
            return np.ascontiguousarray(across)
        i, j = self._find_positions
        mirrored = np.where(i == j, 0.0, 1.0)[:, None, None]
        lower = across[i] * self.ddq[j][:, None]
        lower = lower + mirrored * across[j] * self.ddq[i][:, None]
        return np.concatenate([lower, across])

    @cached_property
    def _across(self) -> FloatArray | None:
        """Tangent with samples last, (n, n_dof, n_samples); None without loops."""
        return (
            None if self.tangent is None else np.ascontiguousarray(np.moveaxis(self.tangent, 0, 2))
        )

    @cached_property
    def _find_positions(self) -> tuple[IntArray, IntArray]:
        """Rows and columns of the entries of M that a program gives, (n_entries,) each; none for torques."""
        return np.tril_indices(len(self.ddq) if self.direct else 0)

    def compute_residuals(self, outputs: Outputs) -> FloatArray:
        """Return the torques minus those of a program, (n_dof, n_samples)."""
        rows, columns = self._find_positions
        torques = np.zeros(self.ddq.shape)
        for place, value in zip(outputs.positions.tolist(), outputs.values, strict=True):
            if place >= rows.size:
                torques[place - rows.size] += value
                continue
            i, j = rows[place], columns[place]
            torques[i] += value * self.ddq[j]
            if i != j:
                torques[j] += value * self.ddq[i]
        if self.tangent is not None:
            torques = np.einsum("mij,im->jm", self.tangent, torques)
        result: FloatArray = self.tau - torques
        return result

    def build_mass_matrices(self, outputs: Outputs) -> FloatArray:
        """Return the mass matrices of the independent coordinates, (n_samples, n_dof, n_dof)."""
        rows, columns = self._find_positions
        number = int(np.searchsorted(outputs.positions, rows.size))
        lower, positions = outputs.values[:number], outputs.positions[:number]
        if self._across is None:
            return np.asarray(
                _build_symmetric(lower, rows[positions], columns[positions], len(self.ddq))
            )
        return np.asarray(
            _project_symmetric(lower, rows[positions], columns[positions], self._across)
        )

    def invert_mass_matrices(self, outputs: Outputs) -> FloatArray | None:
        """Return the inverses of the mass matrices, (n_samples, n_dof, n_dof); None for the inverse dynamics, or if a
        matrix is not positive definite.
        """
        if not self.direct:
            return None
        return invert(self.build_mass_matrices(outputs))

    def compute_errors(self, outputs: Outputs) -> tuple[float, float]:
        """Return the normalised errors of torques and of accelerations [Ros2019].

        The latter is infinite if a mass matrix is not positive definite, and NaN if accelerations do not matter.
        """
        return compute_joint_errors([(self, outputs)])


def compute_joint_errors(parts: Iterable[tuple[TermSamples, Outputs]]) -> tuple[float, float]:
    """Return the errors over several parts of a set together, each with its outputs."""
    squares = np.zeros(4)
    for part, given in parts:
        off, weights = part.compute_residuals(given), part.nominal_torque[:, None]
        squares[:2] += np.sum((off / weights) ** 2), np.sum((part.tau / weights) ** 2)
        inverse = part.invert_mass_matrices(given)
        if not part.direct:
            squares[2:] = np.nan
            continue
        if inverse is None:
            squares[2:] = np.inf, 1.0
            continue
        scale = part.nominal_acceleration[:, None]
        caused = np.einsum("mij,jm->im", inverse, off) / scale
        squares[2] += np.sum(caused**2)
        squares[3] += np.sum((part.ddz / scale) ** 2)
    torque, acceleration = np.sqrt(squares[[0, 2]] / squares[[1, 3]])
    return float(torque), float(acceleration)


@compile_loop()
def _build_symmetric(lower: FloatArray, rows: IntArray, columns: IntArray, n: int) -> FloatArray:
    """Return symmetric matrices, (n_samples, n, n), from some entries of their lower triangles, (n_entries, n_samples)."""
    count = lower.shape[1]
    result = np.zeros((count, n, n))
    for m in range(count):
        for e in range(rows.size):
            result[m, rows[e], columns[e]] = result[m, columns[e], rows[e]] = lower[e, m]
    return result


@compile_loop()
def _project_symmetric(
    lower: FloatArray, rows: IntArray, columns: IntArray, across: FloatArray
) -> FloatArray:
    """Return J^T M J of symmetric matrices with mostly zero entries, (n_samples, n_dof, n_dof).

    Args:
        lower: Some entries of their lower triangles, (n_entries, n_samples).
        rows: Row of each entry, (n_entries,).
        columns: Column of each entry, (n_entries,).
        across: J, (n, n_dof, n_samples).
    """
    n, n_dof, count = across.shape
    half, live = np.zeros(across.shape), np.zeros(n, dtype=np.bool_)
    for e in range(rows.size):
        i, j = rows[e], columns[e]
        live[i] = live[j] = True
        for a in range(n_dof):
            for m in range(count):
                half[i, a, m] += lower[e, m] * across[j, a, m]
            if i != j:
                for m in range(count):
                    half[j, a, m] += lower[e, m] * across[i, a, m]
    found = np.zeros((n_dof, n_dof, count))
    for i in range(n):
        if live[i]:
            for a in range(n_dof):
                for b in range(a + 1):
                    for m in range(count):
                        found[a, b, m] += across[i, a, m] * half[i, b, m]
    result = np.empty((count, n_dof, n_dof))
    for m in range(count):
        for a in range(n_dof):
            for b in range(a + 1):
                result[m, a, b] = result[m, b, a] = found[a, b, m]
    return result


def make_samples(
    mechanism: Mechanism,
    blocks: Iterable[Block],
    nominal_torque: FloatArray,
    nominal_acceleration: FloatArray,
    *,
    direct: bool,
    projected: bool,
    coordinates: Coordinates | None = None,
) -> TermSamples:
    """Return samples for the inverse or the direct dynamics.

    Args:
        mechanism: Mechanism of the robot.
        blocks: States and torques.
        nominal_torque: Divisor of the torques of each joint, (n_dof,).
        nominal_acceleration: Divisor of the accelerations of each coordinate, (n_dof,).
        direct: Whether the program gives the lower triangle of M, row by row, and delta, not torques.
        projected: Whether it does so for the independent coordinates of loops, with R and b handed in.
        coordinates: Coordinates of the mechanism, if they are at hand.
    """
    parts = list(blocks)
    coordinates = coordinates or Coordinates(mechanism, once=True)

    def join(key: str) -> FloatArray:
        return np.concatenate([getattr(part, key) for part in parts])

    q, dq, ddq, tau, ddz = (join(key) for key in ("q", "dq", "ddq", "tau", "ddz"))
    states = [q.T, dq.T, ddq.T]
    tangent = None
    if mechanism.loops is not None:
        tangent = coordinates.compute_tangent(q)
    if tangent is not None and projected:
        dependent, independent = list(mechanism.dependent), list(mechanism.independent)
        R = tangent[:, dependent]
        b = ddq[:, dependent] - np.einsum("kij,kj->ki", R, ddq[:, independent])
        states += [R.reshape(len(q), -1).T, b.T]
        # The program itself takes accelerations to torques of the independent coordinates.
        tangent, ddq = None, ddz
    return TermSamples(
        states=np.vstack(states),
        direct=direct,
        ddq=np.ascontiguousarray(ddq.T),
        tangent=tangent,
        tau=np.ascontiguousarray(tau.T),
        nominal_torque=nominal_torque,
        ddz=np.ascontiguousarray(ddz.T),
        nominal_acceleration=nominal_acceleration,
    )
