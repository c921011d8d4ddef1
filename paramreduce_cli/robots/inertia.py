"""Standard parameters of a body in a YAML file."""

from __future__ import annotations

from typing import Annotated, Any

import numpy as np
from pydantic import BeforeValidator, Field, WithJsonSchema, model_validator

from paramreduce_cli.fields.numbers import Number
from paramreduce_cli.fields.section import VECTOR, Section, Triple
from paramreduce_cli.records import INERTIAL, FloatArray, Kind

_FIRST_MOMENTS = (Kind.MX, Kind.MY, Kind.MZ)
_TENSOR = (Kind.IXX, Kind.IXY, Kind.IXZ, Kind.IYY, Kind.IYZ, Kind.IZZ)


def _take_upper_triangle(value: Any) -> Any:
    """Return the six elements of a tensor that may be written as a symmetric matrix.

    Raises:
        ValueError: The matrix is not symmetric.
    """
    rows = isinstance(value, list) and len(value) == 3 and all(isinstance(r, list) for r in value)
    if not rows or any(len(row) != 3 for row in value):
        return value
    if any(value[i][j] != value[j][i] for i in range(3) for j in range(i)):
        raise ValueError("is no symmetric matrix; write [Ixx, Ixy, Ixz, Iyy, Iyz, Izz]")
    return [value[i][j] for i in range(3) for j in range(i, 3)]


class BodyParameters(Section):
    """The standard parameters of one body about the origin of its frame; missing ones are zero."""

    m: Number = 0.0
    """Mass, kg."""
    mx: Number = 0.0
    """First moment m x, kg m."""
    my: Number = 0.0
    """First moment m y, kg m."""
    mz: Number = 0.0
    """First moment m z, kg m."""
    Ixx: Number = 0.0
    """Inertia about the frame's origin, kg m^2."""
    Ixy: Number = 0.0
    """Tensor element (not the product of inertia with the other sign), kg m^2."""
    Ixz: Number = 0.0
    """Tensor element, kg m^2."""
    Iyy: Number = 0.0
    """Inertia about the frame's origin, kg m^2."""
    Iyz: Number = 0.0
    """Tensor element, kg m^2."""
    Izz: Number = 0.0
    """Inertia about the frame's origin, kg m^2."""
    com: Annotated[Triple, WithJsonSchema({"anyOf": [VECTOR, {"type": "string"}]})] | None = None
    """Centre of mass in the body's frame, m, or the name of a point; instead of mx, my, mz. Without inertias: a point mass."""
    inertia_com: (
        Annotated[
            list[Number], BeforeValidator(_take_upper_triangle), Field(min_length=6, max_length=6)
        ]
        | None
    ) = None
    """[Ixx, Ixy, Ixz, Iyy, Iyz, Izz] or all three rows, about the centre of mass, kg m^2; instead of Ixx ... Izz, needs com."""

    @model_validator(mode="after")
    def _check_alternatives(self) -> BodyParameters:
        """Raise ValueError if centre of mass or inertia is given twice, in different forms."""
        if self.com is not None and self._has_any(_FIRST_MOMENTS):
            raise ValueError("give com or mx, my, mz, not both")
        if self.inertia_com is not None and self.com is None:
            raise ValueError("inertia_com needs com")
        if self.inertia_com is not None and self._has_any(_TENSOR):
            raise ValueError("give inertia_com or Ixx ... Izz, not both")
        return self

    def _has_any(self, kinds: tuple[Kind, ...]) -> bool:
        return any(kind.symbol in self.model_fields_set for kind in kinds)

    def get_values(self) -> dict[Kind, float]:
        """Return the standard parameters by kind, kg, kg m, kg m^2."""
        values = {kind: float(getattr(self, kind.symbol)) for kind in INERTIAL}
        if self.com is not None:
            c = np.array(self.com)
            values |= zip(_FIRST_MOMENTS, (self.m * c).tolist(), strict=True)
            if not self._has_any(_TENSOR):
                shift = self.m * (c @ c * np.eye(3) - np.outer(c, c))
                tensor = np.array(self.inertia_com or [0.0] * 6) + shift[np.triu_indices(3)]
                values |= zip(_TENSOR, tensor.tolist(), strict=True)
        return values


_ROUNDING = 1e-9
"""Share of the largest second moment that is no more than the digits of a file."""


def is_positive_semidefinite(moments: FloatArray) -> bool:
    """Return whether second moments of mass, such as a pseudo-inertia matrix, are positive semidefinite up to rounding.

    Args:
        moments: Symmetric matrix, (n, n).
    """
    eigenvalues = np.linalg.eigvalsh(moments)
    largest = max(abs(float(eigenvalues[-1])), float(np.finfo(float).tiny))
    return bool(eigenvalues[0] >= -_ROUNDING * largest)


def compute_pseudo_inertia(values: dict[Kind, float]) -> FloatArray:
    """Return the pseudo-inertia matrix of a body, (4, 4) [Wensing2018]; some mass distribution has it if and only if it
    is positive semidefinite.

    Args:
        values: All ten standard parameters by kind.
    """
    m, mx, my, mz, xx, xy, xz, yy, yz, zz = (values[kind] for kind in INERTIAL)
    moment = np.array([[mx, my, mz]])
    tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    second_moments = np.trace(tensor) / 2 * np.eye(3) - tensor
    return np.block([[second_moments, moment.T], [moment, np.array([[m]])]])
