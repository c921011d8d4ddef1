"""Files of samples, the project's own or the user's: written and read block by block.

A large observation matrix is not kept where the model next to the file gives it back: it is sooner
computed than read.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from paramreduce_cli.artifacts import layouts
from paramreduce_cli.artifacts.folder_layout import ITEMS
from paramreduce_cli.artifacts.hdf5 import Reader, Writer, open_reader, read_stamp
from paramreduce_cli.errors import ArtifactError
from paramreduce_cli.multibody.joined_samples import JoinedSet
from paramreduce_cli.multibody.observation import (
    BLOCK_SAMPLES,
    FactorAccumulator,
    compute_joint_factors,
)
from paramreduce_cli.records import LAST, SETS, Block, FloatArray, Model, Samples, SampleSet

if TYPE_CHECKING:
    from paramreduce_cli.multibody.dynamics import Dynamics

_MOST_KEPT = 1 << 27
"""Numbers of an observation matrix that are kept though they can be computed again: 1 GiB."""
_LEFT_OUT = "W_left_out"
"""Dataset with the shape of an observation matrix that is not kept."""
_MODEL = "model.h5"

States = Callable[[int, int], list[FloatArray]]


def save_samples(writer: Writer, samples: Samples) -> None:
    """Write samples.h5, block by block."""
    writer.write_dataset("parameters/names", samples.names)
    writer.write_dataset("parameters/preference", samples.preference)
    for name in ("values", "nominal_torque", "nominal_acceleration"):
        value = getattr(samples, name)
        if value is not None:
            writer.write_dataset("parameters/values" if name == "values" else name, value)
    for name in SETS:
        one = getattr(samples, name)
        if one is not None:
            save_sample_set(writer, name, one)


_STATES = ("z", "dz", "ddz", "tau")
_GENERALISED = ("q", "dq", "ddq")


def save_sample_set(writer: Writer, name: str, sample_set: SampleSet) -> None:
    """Write one set; its triangular factors are computed unless its parts have stored them."""
    known = sample_set.compute_factors() if isinstance(sample_set, JoinedSet) else None
    accumulator = FactorAccumulator()
    appenders: dict[str, Any] = {}
    for block in _iterate_blocks(sample_set, known):
        if not appenders:
            n_parameters = block.W.shape[1]
            kept = not _is_matrix_omitted(sample_set, block.tau.shape[1], n_parameters)
            appenders = _start_datasets(writer, name, block, sample_set.n_samples, kept=kept)
        for key, append in appenders.items():  # in this order: the digest depends on it
            own = np.full(block.time.size, float(block.trajectory))
            append(own if key == "trajectory" else getattr(block, key))
        if known is None:
            accumulator.add(block)
    writer.write_dataset(f"{name}/factors", accumulator.get_factors() if known is None else known)


def _iterate_blocks(sample_set: SampleSet, known_factors: FloatArray | None) -> Iterator[Block]:
    """Yield the samples, without observation matrices if neither the file nor the factors need these."""
    if isinstance(sample_set, JoinedSet) and known_factors is not None:
        _, n_dof, k, _ = known_factors.shape
        if _is_matrix_omitted(sample_set, n_dof, k - 1):
            return sample_set.iterate_states()
    return sample_set.iterate_blocks()


def _is_matrix_omitted(sample_set: SampleSet, n_dof: int, n_parameters: int) -> bool:
    """Return whether the observation matrix is not kept."""
    return sample_set.recomputable and sample_set.n_samples * n_dof * n_parameters > _MOST_KEPT


def _start_datasets(
    writer: Writer, name: str, first: Block, n_samples: int, *, kept: bool
) -> dict[str, Callable[[FloatArray], None]]:
    """Return the functions that write each dataset of a set, block by block."""
    (_, n_dof), n_parameters = first.tau.shape, first.W.shape[1]
    appenders = {key: writer.start_rows(f"{name}/{key}", n_dof) for key in _STATES}
    appenders["time"] = writer.start_rows(f"{name}/time", None)
    appenders["trajectory"] = writer.start_rows(f"{name}/trajectory", None)
    if kept:
        appenders["W"] = writer.start_rows(f"{name}/W", n_parameters)
    else:
        writer.write_dataset(f"{name}/{_LEFT_OUT}", (n_samples * n_dof, n_parameters))
    n_q = first.q.shape[1]
    if n_q != n_dof:  # loops: the independent coordinates are not all there is
        appenders |= {key: writer.start_rows(f"{name}/{key}", n_q) for key in _GENERALISED}
    return appenders


class StoredSet:
    """A sample set in a file, read in slices.

    Args:
        path: The file.
        name: Name of the group in the file.
        n_parameters: Columns that W must have.
        owns_file: Whether the project wrote the file, so that its triangular factors can be trusted.

    Raises:
        ArtifactError: W and tau do not fit each other, or hold numbers that are not finite.
    """

    def __init__(self, path: Path, name: str, n_parameters: int, *, owns_file: bool) -> None:
        self._path, self._name, self._own = path, name, owns_file
        self._n_parameters = n_parameters
        with open_reader(path) as reader:
            tau = reader.open_rows(f"{name}/tau")
            self.recomputable = owns_file and f"{name}/{_LEFT_OUT}" in reader
            self._check_matrix(_read_matrix_shape(reader, name), tau.shape, n_parameters)
            self.n_samples, self.n_dof = tau.shape
            present = [key for key in ("z", "dz", "ddz") if f"{name}/{key}" in reader]
            self._has_states = len(present) == 3
            for key in present:
                if reader.open_rows(f"{name}/{key}").shape != tau.shape:
                    raise ArtifactError(f"{path}: /{name}/{key} must have the shape {tau.shape}.")
            self._has_generalised = all(f"{name}/{key}" in reader for key in _GENERALISED)
            if self._has_generalised:
                shapes = {reader.open_rows(f"{name}/{key}").shape for key in _GENERALISED}
                if len(shapes) > 1 or next(iter(shapes))[0] != self.n_samples:
                    raise ArtifactError(
                        f"{path}: /{name}/q, dq and ddq must have one shape, (n_samples, n_q)."
                    )
            self._read_column(reader, "time")
            self.first = int(self._read_column(reader, "trajectory")[0])
            """Number of its first trajectory."""

    def _check_matrix(self, W: tuple[int, ...], tau: tuple[int, ...], n_parameters: int) -> None:
        """Raise ArtifactError unless the observation matrix has one row per sample and joint."""
        place = f"{self._path}: /{self._name}/"
        if len(W) != 2 or len(tau) != 2 or W[0] != tau[0] * tau[1]:
            raise ArtifactError(
                f"{place}W has shape {W} and /{self._name}/tau {tau}; W needs one row per sample and "
                "joint, (n_samples * n_dof, n_parameters)."
            )
        if 0 in W:
            raise ArtifactError(f"{place}W is empty.")
        if W[1] != n_parameters:
            raise ArtifactError(f"{place}W has {W[1]} columns for {n_parameters} parameters.")

    @cached_property
    def _dynamics(self) -> Dynamics:
        """Dynamics of the model with which the samples were computed.

        Raises:
            ArtifactError: The file of the model is missing, or holds another model.
        """
        path = self._path.with_name(_MODEL)
        if self._path.parent.suffix == ITEMS:
            path = self._path.parent.with_name(_MODEL)
        own = read_stamp(self._path)
        needed = f"The observation matrix of {self._path} is computed from it."
        with open_reader(path, remedy=needed) as reader:
            stamp = read_stamp(path)
            if own is None or stamp is None or own.inputs.get(_MODEL) != stamp.digest:
                raise ArtifactError(
                    f"{path}: is not the model that {self._path} was computed with. Rebuild both.",
                    rejected=str(path),
                    command="run",
                )
            # Late: CasADi and all kinds of robots, of which looking at a file needs nothing.
            from paramreduce_cli.multibody.dynamics import Dynamics

            return Dynamics(layouts.load(reader, Model).mechanism)

    def iterate_blocks(self) -> Iterator[Block]:
        """Yield the samples in order; every call starts anew."""
        return self._iterate(W=True)

    def iterate_states(self) -> Iterator[Block]:
        """Yield the samples with observation matrices without rows."""
        return self._iterate(W=False)

    def _iterate(self, *, W: bool) -> Iterator[Block]:
        """Yield the samples block by block, with or without rows of W.

        Raises:
            ArtifactError: A number is not finite.
        """
        with open_reader(self._path) as reader:
            base = self._name
            tau = reader.open_rows(f"{base}/tau")
            rows = None if self.recomputable else reader.open_rows(f"{base}/W")
            none = np.zeros((0, self._n_parameters))
            owner = self._read_column(reader, "trajectory")
            time = self._read_column(reader, "time")
            states_of = self._open_states(reader, _STATES[:3])
            generalised_of = self._open_states(
                reader, _GENERALISED if self._has_generalised else ()
            )
            for start, stop in _iterate_ranges(owner, BLOCK_SAMPLES):
                tau_block = tau[start:stop].astype(float)
                states = states_of(start, stop)
                whole = generalised_of(start, stop) if self._has_generalised else states
                if not W:
                    W_block = none
                elif rows is None:
                    K = self._dynamics.compute_regressor(*whole)
                    W_block = K.reshape(-1, K.shape[2])
                else:
                    W_block = rows[start * self.n_dof : stop * self.n_dof].astype(float)
                if not (np.isfinite(tau_block).all() and np.isfinite(W_block).all()):
                    raise ArtifactError(
                        f"{self._path}: /{base} holds numbers that are not finite between samples "
                        f"{start} and {stop}. Remove those samples."
                    )
                (z, dz, ddz), (q, dq, ddq) = states, whole
                yield Block(
                    int(owner[start]), time[start:stop], z, dz, ddz, tau_block, q, dq, ddq, W_block
                )

    def _open_states(self, reader: Reader, keys: tuple[str, ...]) -> States:
        """Return a function that reads the states of a range of samples; NaN if the file has none."""
        if not self._has_states:
            return lambda start, stop: [np.full((stop - start, self.n_dof), np.nan)] * 3
        rows = [reader.open_rows(f"{self._name}/{key}") for key in keys]
        return lambda start, stop: [data[start:stop] for data in rows]

    def _read_column(self, reader: Reader, key: str) -> FloatArray:
        """Return one number per sample; zeros if the file has none.

        Raises:
            ArtifactError: The dataset has another length or numbers that are not finite; numbers of trajectories must
                be 0, 1, 2, ...
        """
        name = f"{self._name}/{key}"
        if name not in reader:
            return np.zeros(self.n_samples)
        column = reader.read_array(name, 1).astype(float)
        if column.size != self.n_samples or not np.isfinite(column).all():
            raise ArtifactError(
                f"{self._path}: /{name} must hold {self.n_samples} finite numbers, one per sample."
            )
        if key == "trajectory" and (column.min() < 0 or np.any(column != np.floor(column))):
            raise ArtifactError(f"{self._path}: /{name} must hold the numbers 0, 1, 2, ...")
        return column

    def compute_factors(self) -> FloatArray:
        """Return the triangular factors by trajectory and joint, stored or computed."""
        if self._own:
            with open_reader(self._path) as reader:
                return reader.read_array(f"{self._name}/factors", 4)
        return compute_joint_factors(self.iterate_blocks())


def _iterate_ranges(owner: FloatArray, most: int) -> Iterator[tuple[int, int]]:
    """Yield consecutive ranges of samples, none longer than ``most`` or across two trajectories."""
    edges = [0, *(np.flatnonzero(np.diff(owner)) + 1).tolist(), owner.size]
    for first, last in itertools.pairwise(edges):
        for start in range(first, last, most):
            yield start, min(start + most, last)


def load_samples(reader: Reader) -> Samples:
    """Return the samples in a file, the project's own or the user's.

    Raises:
        ArtifactError: The file is unreadable, or a dataset is missing or has a wrong shape or wrong numbers.
    """
    own = reader.read_attribute("stage") == "sample"
    W = _read_matrix_shape(reader, "estimation")
    if len(W) != 2:
        raise ArtifactError(f"{reader.path}: /estimation/W must be a matrix.")
    n = W[1]
    if "parameters/names" in reader:
        names = reader.read_texts("parameters/names")
        if len(names) != n or len(set(names)) != n:
            raise ArtifactError(
                f"{reader.path}: /parameters/names must hold {n} different names, one per column "
                "of W."
            )
    else:
        names = tuple(f"p{k + 1}" for k in range(n))

    def open_set(name: str) -> SampleSet | None:
        """Return a stored set, or None if the file lacks it."""
        if f"{name}/W" in reader or f"{name}/{_LEFT_OUT}" in reader:
            return StoredSet(reader.path, name, n, owns_file=own)
        return None

    estimation = open_set("estimation")
    assert estimation is not None
    nominal = {
        key: _read_optional(reader, key, reader.open_rows("estimation/tau").shape[1])
        for key in ("nominal_torque", "nominal_acceleration")
        if key in reader
    }
    ranks = _read_optional(reader, "parameters/preference", n)
    return Samples(
        names=names,
        preference=np.full(n, LAST) if ranks is None else ranks.astype(np.int64),
        values=_read_optional(reader, "parameters/values", n),
        nominal_torque=nominal.get("nominal_torque"),
        nominal_acceleration=nominal.get("nominal_acceleration"),
        estimation=estimation,
        validation=open_set("validation"),
        test=open_set("test"),
    )


def load_item_set(reader: Reader, name: str) -> StoredSet:
    """Return a set that the project wrote as an item."""
    return StoredSet(reader.path, name, _read_matrix_shape(reader, name)[1], owns_file=True)


def _read_matrix_shape(reader: Reader, name: str) -> tuple[int, ...]:
    """Return the shape of an observation matrix, whether it is kept or not."""
    if f"{name}/{_LEFT_OUT}" in reader:
        return tuple(reader.read_array(f"{name}/{_LEFT_OUT}", 1).tolist())
    return tuple(reader.open_rows(f"{name}/W").shape)


def _read_optional(reader: Reader, name: str, size: int) -> FloatArray | None:
    """Return a vector of finite numbers, or None if the file has none.

    Raises:
        ArtifactError: The vector has another length, or numbers that are not finite; nominal torques and accelerations may be infinite.
    """
    if name not in reader:
        return None
    value = reader.read_array(name, 1)
    numbers = ~np.isnan(value) if name.startswith("nominal") else np.isfinite(value)
    if value.size != size or not numbers.all():
        raise ArtifactError(f"{reader.path}: /{name} must hold {size} finite numbers.")
    return value
