"""Logs of a machine as recorded, motions made from logs, and what is identified from motions."""

from collections.abc import Iterable, Mapping
from dataclasses import field
from typing import ClassVar

import numpy as np

from paramreduce_cli.records.arrays import BoolArray, FloatArray, IntArray
from paramreduce_cli.records.reduction import ReducedModel
from paramreduce_cli.records.representation import record

_SAME_VALUES = 0.05
"""Standard deviations by which values of the same fit may differ."""
_ROUNDING = 1e-4
"""The same as a share of a value, where a deviation is next to nothing."""


@record
class RawLog:
    """A log file as it was recorded."""

    source: str
    columns: Mapping[str, FloatArray]
    """Columns by name, (n_rows,) each; a matrix gives one column for each of its columns."""
    first_line: int | None
    """Line of the first row in the file, None where it has no lines."""
    others: Mapping[str, str] = field(default_factory=dict)
    """Contents of columns without numbers, such as text, by name."""

    def describe_row(self, row: int) -> str:
        """Return file and line of a row, for messages."""
        if self.first_line is None:
            return f"{self.source}, row {row + 1}"
        return f"{self.source}, line {self.first_line + row}"


@record
class RawLogs:
    """The user's log files: files to train on and files that are held out.

    Long files are read only when they are iterated over, one at a time.
    """

    training: Iterable[RawLog]
    held_out: Iterable[RawLog]


@record
class MeasuredMotions:
    """A sequence of measured motions, evenly spaced in time within each piece.

    Arrays of long motions stay in a file: they give slices with a positive step, and ``numpy.asarray`` reads the whole
    array.
    """

    time: FloatArray
    """(n_samples,), s."""
    z: FloatArray
    """Like all others (n_samples, n_dof)."""
    dz: FloatArray
    ddz: FloatArray
    tau: FloatArray
    """Measured torques, before any low-pass that the observation matrix shares."""
    piece: IntArray
    """Number of the uninterrupted motion that a sample belongs to, (n_samples,)."""
    fold: IntArray
    """Part of the data that is left out together in cross-validation; -1 for samples that only serve
    filters: before and after what is used, (n_samples,)."""


@record
class ShownSignals:
    """The signals before and after processing, downsampled for figures: of the longest training motion, and of the
    held-out part of the same motion.
    """

    raw_time: FloatArray
    """s"""
    raw_z: FloatArray
    """Positions as recorded, without outliers, (n_raw, n_dof)."""
    raw_dz: FloatArray
    """Speeds as recorded, or differences of the positions as recorded."""
    raw_tau: FloatArray
    time: FloatArray
    """s"""
    z: FloatArray
    """Positions after processing, (n_shown, n_dof)."""
    dz: FloatArray
    ddz: FloatArray
    tau: FloatArray
    """Through the low-pass that the observation matrix passes too."""
    learned: FloatArray
    """First and last time of what is learned from, (2,), s."""
    held_out: FloatArray
    """The same of what is held out; not numbers where that is in other motions."""
    outliers: FloatArray
    """Replaced samples in a row each, (n_outliers, 3): 0 of a position, 1 of a torque; joint from 0; time, s."""


@record
class Spectra:
    """The power spectral densities of recorded signals."""

    frequency: FloatArray
    """(n_frequencies,), Hz."""
    velocity: FloatArray
    """Power spectral densities of the speeds as recorded, (n_frequencies, n_dof)."""
    torque: FloatArray
    """Power spectral densities of the torques, (n_frequencies, n_dof)."""


@record
class CutoffSearch:
    """The cut-off frequencies of a log chosen by cross-validation, and the errors with others.

    All errors are relative errors of the torques in the scored band on folds that were left out.
    """

    state: float
    """Chosen cut-off frequency of positions and speeds, Hz."""
    torque: float
    """Chosen cut-off frequency of torques and observation matrix, Hz."""
    scored: float
    """Frequency up to which torques are scored, Hz: up to it the model explains most of their power."""
    states: FloatArray
    """State cut-offs that were tried, ascending, Hz; infinite for no low-pass, (n_states,)."""
    state_errors: FloatArray
    """Errors with these, fitted to the scored band, (n_states,)."""
    bands: FloatArray
    """Torque cut-offs that were tried, ascending, Hz, (n_bands,)."""
    torque_errors: FloatArray
    """Errors of parameters that were fitted to torques up to these, with the chosen state cut-off, (n_bands,)."""
    unexplained: FloatArray
    """Share of the power between each of these and the one before that the model leaves, (n_bands,)."""


@record
class FrictionSearch:
    """The shape of the friction of drives, chosen within the training part."""

    drives: tuple[str, ...]
    """Names of the drives, (n_drives,)."""
    smoothing: FloatArray
    """Speed of the smoothing of Coulomb friction, zero for the sign of the speed, rad/s or m/s, (n_drives,)."""
    stribeck_velocity: FloatArray
    """Speed beyond which Stribeck friction fades, rad/s or m/s; not a number for drives without such friction, (n_drives,)."""
    asymmetry: BoolArray
    """Whether viscous friction differs by direction, (n_drives,)."""
    quadratic: BoolArray
    """Whether there is friction that is quadratic in the speed, (n_drives,)."""
    load: BoolArray
    """Whether there is friction that grows with the load, (n_drives,)."""
    bodies: FloatArray
    """Parameters of the bodies and payloads, fitted with this friction, SI, (n_inertial,): the load is their torque of gravity.
    Those that are no base parameters are zero."""
    error: float
    """Relative error of torques on left-out folds with this friction."""
    usual_error: float
    """The same with the smoothing that the search began with."""


@record
class MeasuredLog:
    """A log made ready: motions to train on and motions held out, and what was done to them."""

    FILE: ClassVar[str] = "log.h5"
    training: MeasuredMotions
    held_out: MeasuredMotions
    rate: float
    """Samples per second of the motions."""
    recorded_rate: float
    """Recorded rate of the files."""
    state_cutoff: float
    """Cut-off frequency of the low-pass on positions and speeds, Hz; infinite where there is none."""
    torque_cutoff: float
    """Cut-off frequency of the low-pass on torques and observation matrix alike, Hz; infinite where there is none."""
    output_rate: float
    """Samples per second that are taken of what passes that, Hz."""
    delay: float
    """Delay of the recorded torques that was taken back, s."""
    noise: FloatArray
    """Standard deviation of the torques above the torque cut-off, or above what the motion
    contains where there is none, (n_dof,): no model explains it."""
    noise_share: float
    """The same of all joints together, a share of the torques."""
    position_noise: FloatArray
    """Power spectral density of the noise of the positions, rad^2/Hz (m^2/Hz); zero where speeds were recorded, (n_dof,)."""
    shown: ShownSignals
    spectra: Spectra
    search: CutoffSearch | None
    """Search for cut-off frequencies; None if the config gives all, or without a model."""
    friction: FrictionSearch | None
    """Search for the shape of friction; None if the config asks for none."""
    steps: tuple[str, ...]
    """Processing steps, one sentence each."""
    warnings: tuple[str, ...]
    """Warnings, one sentence each."""


@record
class Estimate:
    """The values of a model's parameters identified from measured torques, with their uncertainty and the errors that
    remain.
    """

    names: tuple[str, ...]
    values: FloatArray
    """(n,)"""
    deviations: FloatArray
    """Standard deviations, for noise as coloured as the residuals are, (n,)."""
    half_widths: FloatArray
    """Half widths of the 95 % intervals around the values, (n,)."""
    standard: FloatArray
    """The same values as standard parameters, (n_standard,)."""
    train: float
    """Norm of the residuals over that of the torques, N m (N), on what was learned from."""
    held_out: float
    """The same on what was held out."""
    joint_train: FloatArray
    """Root mean square of the residuals joint by joint, N m (N), (n_dof,); not a number where torques
    are not measured, in all such arrays."""
    joint_held_out: FloatArray
    folds: FloatArray
    """Error on each part of the training data when fitted without it, like ``train``, (n_folds,)."""

    def find_deviations(self, model: ReducedModel) -> dict[str, float]:
        """Return standard deviations by name, or nothing if the model has other values, as other weights give."""
        values = dict(zip(self.names, self.values, strict=True))
        if set(values) != set(model.names):
            return {}
        own = np.array([values[name] for name in model.names])
        deviations = dict(zip(self.names, self.deviations.tolist(), strict=True))
        spread = np.array([deviations[name] for name in model.names])
        near = _SAME_VALUES * spread + _ROUNDING * np.abs(own)
        return deviations if np.all(np.abs(own - model.values) <= near) else {}


@record
class Residuals:
    """The statistics of the residuals that all base parameters leave on the training data."""

    deviation: FloatArray
    """(n_dof,), N m (N)."""
    lag_one: FloatArray
    """Correlation of a residual with the one before, (n_dof,)."""
    effective_samples: FloatArray
    """White samples that would tell as much of a constant, (n_dof,)."""
    white: FloatArray
    """Probability of residuals like these if they were white (Ljung-Box), (n_dof,)."""


@record
class Consistency:
    """The physically consistent standard parameters nearest to the data."""

    standard: FloatArray
    """(n_standard,)"""
    train: float
    held_out: float
    smallest_eigenvalues: FloatArray
    """Smallest eigenvalues of each body's pseudo-inertia matrix, kg (kg m^2), (n_bodies,)."""
    unconstrained_eigenvalues: FloatArray
    """Smallest eigenvalues of the unconstrained fit nearest to the known parameters, (n_bodies,)."""
    bodies: tuple[str, ...]
    smallest_drive: float
    """Smallest friction, rotor inertia or stiffness; infinite where there is none."""

    @property
    def positive(self) -> bool:
        """Whether every body and every drive can exist."""
        return bool(np.all(self.smallest_eigenvalues > 0)) and self.smallest_drive >= 0


@record
class Identification:
    """The parameters identified from measured torques, with residuals, consistency and hints."""

    FILE: ClassVar[str] = "identification.h5"
    estimator: str
    torque_deviation: FloatArray
    """Divisor of the torques of each joint, (n_dof,)."""
    torque_size: FloatArray
    """Root mean square of the torques held out, (n_dof,)."""
    full: Estimate
    """All base parameters."""
    reduced: Estimate
    """Estimate of the selected model."""
    payload: Estimate | None
    """Estimate of payloads alone, with the other bodies' values given; None if the config names no payloads."""
    residuals: Residuals
    consistency: Consistency | None
    hints: tuple[str, ...]
    """Hints at causes of the residuals, one sentence each."""
    comparison: str
    """Comparison of the reduced model with the full one, a sentence."""
    shown_time: FloatArray
    """Times of the held-out samples that figures show, s."""
    shown_measured: FloatArray
    """(n_shown, n_dof), N m (N)."""
    shown_full: FloatArray
    shown_reduced: FloatArray
