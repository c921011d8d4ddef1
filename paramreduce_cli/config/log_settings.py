"""Settings for logs of the machine."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import AfterValidator, BeforeValidator, Field, model_validator

from paramreduce_cli.fields.numbers import Number, Whole
from paramreduce_cli.fields.section import PerJoint, Positive, Section
from paramreduce_cli.records import FloatArray

TODO = "TODO"
"""Stands for a column that the user has to name."""
NUMBER = "{}"
"""Stands for the number of the joint in names of columns."""


def _name_numbers(value: object) -> object:
    """Return columns that are given by their numbers as names; other values unchanged."""
    if isinstance(value, list):
        return [_name_numbers(entry) for entry in value]
    return str(value) if isinstance(value, int) and not isinstance(value, bool) else value


def _check_named(value: str | list[str]) -> str | list[str]:
    """Raise ValueError if columns are still to be named."""
    if value == TODO:
        raise ValueError(f"is still {TODO}. Name the columns")
    return value


Name = Annotated[str, BeforeValidator(_name_numbers)]
Names = Annotated[str | list[str], BeforeValidator(_name_numbers), AfterValidator(_check_named)]
"""One name with ``{}`` for the joint's number, or a name for every joint; a file without headings has numbers from 1."""
Frequency = Positive | Literal["auto", "none"]
Files = Annotated[
    list[Path | Annotated[list[Path], Field(min_length=1)]],
    BeforeValidator(lambda value: value if isinstance(value, list) else [value]),
    Field(min_length=1),
]

ANGLES = {"rad": 1.0, "deg": np.pi / 180, "rev": 2 * np.pi, "m": 1.0, "mm": 1e-3}
SPEEDS = {"rad/s": 1.0, "deg/s": np.pi / 180, "rpm": 2 * np.pi / 60, "m/s": 1.0, "mm/s": 1e-3}
ACCELERATIONS = {"rad/s^2": 1.0, "deg/s^2": np.pi / 180, "m/s^2": 1.0, "mm/s^2": 1e-3}
TORQUES = {"N m": 1.0, "mN m": 1e-3, "kN m": 1e3, "N": 1.0, "A": 1.0, "mA": 1e-3}
TIMES = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}


class ColumnsSection(Section):
    """The names of columns, datasets or topics in a log, with `{}` for the joint's number, or one name for each joint."""

    time: Name = "t"
    """Time."""
    position: Names = "q{}"
    """Positions."""
    velocity: Names | None = None
    """Speeds; made of the positions if left out."""
    acceleration: Names | None = None
    """Accelerations; made of the speeds if left out."""
    torque: Names = "tau{}"
    """Torques, or currents where torque_constants are given."""


class UnitsSection(Section):
    """The units of the columns of a log."""

    time: Literal["s", "ms", "us", "ns"] = "s"
    """Unit of time."""
    position: Literal["rad", "deg", "rev", "m", "mm"] = "rad"
    """Unit of positions."""
    velocity: Literal["rad/s", "deg/s", "rpm", "m/s", "mm/s"] = "rad/s"
    """Unit of speeds."""
    acceleration: Literal["rad/s^2", "deg/s^2", "m/s^2", "mm/s^2"] = "rad/s^2"
    """Unit of accelerations."""
    torque: Literal["N m", "mN m", "kN m", "N", "A", "mA"] = "N m"
    """Unit of torques or currents."""


class SignsSection(Section):
    """The signs of joints (or motors) whose motion and torque have different signs."""

    motion: PerJoint = [1.0]
    """1, or -1 for motions that were counted the other way."""
    torque: PerJoint = [1.0]
    """1, or -1 for torques that were counted the other way."""


class LogSection(Section):
    """The logs of the machine as they were recorded.

    They are processed and split into a training part and a held-out part.
    """

    files: Files
    """Text tables (also .gz), HDF5, NPZ, NPY, MATLAB files or ROS bags; relative to this file. A list among these are the files of one recording, which are joined by their times. Where held_out names files all of these are learned from."""
    held_out: Annotated[Number, Field(ge=0.05, le=0.9)] | Files = 0.4
    """Held-out data: a fraction of every file, at its end, or a list of other files."""
    columns: ColumnsSection = ColumnsSection()
    """Columns that hold each quantity."""
    units: UnitsSection = UnitsSection()
    """Units of the columns."""
    recorded_rate: Positive | None = None
    """Rows per second of files without times; the column of times is not read then."""
    transmission: list[PerJoint] | PerJoint | None = None
    """Motor over joint: one number per joint, or a matrix N of them (motor position = N joint position); recorded positions and torques are then the motors'."""
    torque_constants: PerJoint | None = None
    """Torque over the recorded current, N m (N) per its unit; before the transmission."""
    signs: PerJoint | SignsSection = [1.0]
    """1, or -1 for joints (or motors) that were counted the other way in motion and torque alike; or motion and torque apart."""
    offsets: PerJoint = [0.0]
    """Added to the joint positions, rad (m)."""
    delay: Number = 0.0
    """Delay of the recorded torques against positions, s."""
    trim: Annotated[list[Annotated[Number, Field(ge=0)]], Field(min_length=2, max_length=2)] = [
        0,
        0,
    ]
    """Seconds that are cut off at the start and at the end."""
    standstill: Literal["cut", "keep"] = "cut"
    """Treatment of the time before the first joint moves and after the last one stops."""
    outliers: Literal["replace", "keep"] = "replace"
    """`replace` adds whole turns that positions jump by, cuts out rows in which positions jump to and fro, and interpolates single torques and positions far from their neighbours; `keep` leaves all of them."""
    state_cutoff: Frequency = "auto"
    """Cut-off frequency of the zero-phase low-pass on positions and speeds, Hz; auto chooses it by cross-validation."""
    torque_cutoff: Frequency = "auto"
    """Torque cutoff of the zero-phase low-pass that torques and observation matrix share, Hz; auto is the end of the band that the model explains, none leaves torques as recorded."""
    rate: Positive | None = None
    """Samples per second that are used; if left out ten per period of the torque cut-off, or as recorded."""
    folds: Annotated[Whole, Field(ge=2, le=100)] = 5
    """Parts in time of what is learned from, one of which at a time is left out in cross-validation."""

    @model_validator(mode="after")
    def _check_signs(self) -> LogSection:
        """Raise ValueError if a sign is not 1 or -1, or a torque constant is 0."""
        if any(abs(value) != 1 for value in (*self.apart.motion, *self.apart.torque)):
            raise ValueError("signs are 1 or -1")
        if self.torque_constants is not None and 0 in self.torque_constants:
            raise ValueError(
                "a torque constant of 0 takes all torque away; `unmeasured` is for joints without torques"
            )
        return self

    @property
    def apart(self) -> SignsSection:
        """Signs of motions and of torques."""
        if isinstance(self.signs, SignsSection):
            return self.signs
        return SignsSection(motion=self.signs, torque=self.signs)

    @property
    def held_out_fraction(self) -> float:
        """Share of every file that is held out; zero where other files are."""
        return 0.0 if isinstance(self.held_out, list) else self.held_out

    @property
    def training_files(self) -> list[list[Path]]:
        """Files of each recording that is learned from."""
        return _list_parts(self.files)

    @property
    def held_out_files(self) -> list[list[Path]]:
        """Files of each recording that is held out; none where it is a share of each."""
        return _list_parts(self.held_out) if isinstance(self.held_out, list) else []

    def compute_motor_matrix(self, n_dof: int) -> FloatArray | None:
        """Return the motor positions per joint position, (n_dof, n_dof), or None if joints were recorded.

        Raises:
            ValueError: The matrix has another size, or no inverse.
        """
        if self.transmission is None:
            return None
        rows = self.transmission
        matrix = np.array(rows, dtype=float)
        if matrix.ndim == 2 and 1 in matrix.shape and n_dof > 1:
            matrix = matrix.ravel()
        if matrix.ndim == 1:
            if matrix.size not in (1, n_dof):
                raise ValueError(f"{matrix.size} ratios for {n_dof} joints")
            matrix = np.diag(np.broadcast_to(matrix, n_dof))
        if matrix.shape != (n_dof, n_dof):
            raise ValueError(f"is {matrix.shape[0]} x {matrix.shape[1]} for {n_dof} joints")
        if np.linalg.cond(matrix) > 1e9:
            raise ValueError("has no inverse")
        return matrix


def _list_parts(entries: Iterable[Path | list[Path]]) -> list[list[Path]]:
    """Return the files of each recording, most often one."""
    return [entry if isinstance(entry, list) else [entry] for entry in entries]
