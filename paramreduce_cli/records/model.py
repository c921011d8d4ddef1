"""The model of a robot: mechanism, values of parameters, base parameters, and lean formulations."""

from collections.abc import Mapping
from enum import StrEnum
from typing import ClassVar

import numpy as np

from paramreduce_cli.records.arrays import BoolArray, FloatArray, IntArray
from paramreduce_cli.records.mechanism import Mechanism
from paramreduce_cli.records.representation import record


@record
class BaseParameters:
    """A choice of independent columns of W and the relations of the others to them."""

    columns: IntArray
    """Indices of the independent columns, (r,)."""
    beta: FloatArray
    """W[:, others] = W[:, columns] @ beta with the others in ascending order, (r, n - r)."""
    singular_values: FloatArray
    """Singular values of W with its columns scaled to unit length, descending."""
    rank_gap: float
    """Last singular value kept over the first one dropped; infinite where none was dropped."""
    expressions: tuple[str, ...] = ()
    """Sum of standard parameters behind each base parameter, for people."""


Formulation = tuple[Mapping[str, str | bool], ...]
"""What is chosen at every joint."""


@record
class Formulations:
    """The choices between equivalent lean ways to write a mechanism's dynamics."""

    inverse: tuple[Formulation, ...]
    direct: tuple[Formulation, ...]


@record
class Model:
    """A mechanism with its standard parameters and their base."""

    FILE: ClassVar[str] = "model.h5"
    mechanism: Mechanism
    values: FloatArray
    """Standard parameters, (n,), kg, kg m, kg m^2."""
    affecting: BoolArray
    """Mask of the parameters that change the torques, (n,)."""
    base: BaseParameters
    nominal_torque: FloatArray
    """Characteristic size of each joint's torque or force, (n_dof,), N m or N; infinite where it is not
    measured, so that its rows of W weigh nothing."""
    nominal_torque_given: bool
    """Whether the config gave it; if not, the estimation set's replaces it from `sample` on."""
    formulations: Formulations

    @property
    def unmeasured(self) -> tuple[str, ...]:
        """Names of the independent coordinates whose torques are not measured."""
        pairs = zip(self.mechanism.coordinate_names, self.nominal_torque, strict=True)
        return tuple(name for name, size in pairs if np.isinf(size))

    @property
    def base_values(self) -> FloatArray:
        """Values of the base parameters, in the order of ``base.columns``, (r,)."""
        others = np.setdiff1d(np.arange(self.values.size), self.base.columns)
        result: FloatArray = self.values[self.base.columns] + self.base.beta @ self.values[others]
        return result


class CountedDynamics(StrEnum):
    """The functions of closed loops whose operations are counted; on an open tree both choices are the same."""

    GENERALISED = "generalised"
    """d_q and [M_qq | delta_q] of the open tree."""
    INDEPENDENT = "independent"
    """d_z and [M_zz | delta_z], with R and b handed in."""
