"""Samples: states, torques and observation matrices."""

from collections.abc import Iterator, Mapping
from typing import ClassVar, Protocol

from paramreduce_cli.records.arrays import FloatArray, IntArray
from paramreduce_cli.records.representation import record

SETS = ("estimation", "validation", "test")
"""What a search fits to, what it chooses by, and what none looks at."""


@record
class Recording:
    """A user's recording of states, and perhaps of torques; each array (n_samples, n_dof)."""

    source: str
    time: FloatArray
    z: FloatArray
    dz: FloatArray
    ddz: FloatArray
    tau: FloatArray | None


@record
class Recordings:
    """The user's recordings by set; None where there is none."""

    estimation: Recording | None
    validation: Recording | None
    test: Recording | None


@record
class SignalTable:
    """Signals from a file."""

    source: str
    """Name of the file."""
    arguments: FloatArray
    """Times, s, or distances, m, ascending, (n_points,)."""
    values: FloatArray
    """Values, (n_points, n_columns)."""


@record
class SignalTables:
    """Signals from the user's files, by coordinate; a road's profile under ``road profile``."""

    tables: Mapping[str, SignalTable]


@record
class Block:
    """A block of consecutive samples of one trajectory."""

    trajectory: int
    time: FloatArray
    """(n_samples,), s."""
    z: FloatArray
    dz: FloatArray
    ddz: FloatArray
    tau: FloatArray
    """Torques of the full model, or measured ones; like the states (n_samples, n_dof)."""
    q: FloatArray
    """Generalised coordinates, (n_samples, n_q); the independent ones where there are no loops."""
    dq: FloatArray
    ddq: FloatArray
    W: FloatArray
    """(n_samples * n_dof, n_parameters), sample-major."""


class SampleSet(Protocol):
    """A set of samples that is read block by block, so that memory stays flat."""

    @property
    def n_samples(self) -> int:
        """Samples over all trajectories."""

    @property
    def recomputable(self) -> bool:
        """Whether each sample's state and the model give its rows of the observation matrix back."""

    def iterate_blocks(self) -> Iterator[Block]:
        """Yield the samples in order, block by block, from the first one at every call."""

    def compute_factors(self) -> FloatArray:
        """Return the triangular factors of [W | tau] by trajectory and joint, (n_trajectories, n_dof, n_parameters + 1,
        n_parameters + 1).
        """


@record
class Samples:
    """The estimation, validation and test sets with the scales their errors are measured in."""

    FILE: ClassVar[str] = "samples.h5"
    names: tuple[str, ...]
    """Names of the columns of W."""
    preference: IntArray
    """Ranks of the columns among base parameters, the smaller the more wanted, (n,)."""
    values: FloatArray | None
    """Standard parameters, (n,), where they are known."""
    nominal_torque: FloatArray | None
    """(n_dof,); without it the standard deviation over the estimation set is meant."""
    nominal_acceleration: FloatArray | None
    """(n_dof,); without it the standard deviation over the estimation set is meant."""
    estimation: SampleSet
    validation: SampleSet | None
    test: SampleSet | None
    """Motions that no search looks at: errors on them are what a model is worth."""
