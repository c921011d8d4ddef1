"""Reduced models of which terms are removed too."""

from collections.abc import Mapping
from typing import ClassVar

from paramreduce_cli.records.arrays import FloatArray, IntArray
from paramreduce_cli.records.choices import Choices
from paramreduce_cli.records.model_errors import ModelErrors, SetErrors
from paramreduce_cli.records.representation import record

TERMS = "terms"
"""What the model is called of which each function has terms left out."""
NO_OPERAND = -1
"""Where an operation has fewer than two operands."""


@record
class StoredProgram:
    """A straight-line program: nodes, each made of those before it."""

    operations: tuple[str, ...]
    """``constant``, ``input``, ``+``, ``*`` or the name of a function, (n_nodes,)."""
    operands: IntArray
    """Twice the number of the node that is meant, plus one if it is negated, (n_nodes, 2)."""
    numbers: FloatArray
    """Numbers of a constant, its size; of an input, its position, (n_nodes,)."""
    outputs: IntArray
    """Like operands, (n_outputs,)."""


@record
class TermFront:
    """The Pareto front of one function's models, by operations and error; one row per model."""

    operations: IntArray
    torque_error: SetErrors
    acceleration_error: SetErrors
    """Acceleration errors; NaN for the inverse dynamics."""


@record
class TermModel:
    """A function of the dynamics with pruned terms and replaced nodes, and its accuracy."""

    heuristic: str
    """Whose subset it started from."""
    n_start: int
    """Parameters of that subset."""
    names: tuple[str, ...]
    """Names of the parameters that are left, (n,)."""
    values: FloatArray
    """(n,), in units of their own; of use to this function alone."""
    units: FloatArray
    """Sizes of these units, SI, (n,): with them there are fewer products with constants."""
    position: IntArray
    """Position of each standard parameter's value, -1 for none, (n_standard,)."""
    program: StoredProgram
    """Program whose inputs are the parameters, q, dq and ddq, and for functions of independent coordinates the dependent rows of R, row by row, and b. The inverse dynamics gives torques, the direct dynamics the lower triangle of M, row by row, then delta."""
    projected: bool
    """Whether it is of the independent coordinates of loops; else of all coordinates of the tree."""
    operations: int
    """Sums, products and function calls that it takes."""
    operations_start: int
    """The same with all terms of the subset."""
    torque_error: ModelErrors
    acceleration_error: ModelErrors
    """Acceleration errors; NaN for the inverse dynamics."""
    random_torque_error: float
    """Torque error on random states inside the limits; NaN if the torques are not known there."""
    random_acceleration_error: float
    random_states: int
    """Number of these random states; 0 if torques were measured, or none were found."""
    largest_difference: FloatArray
    """Largest difference of each joint's torque on those states, else on both sets, N m (N), (n_dof,); not a number where
    it was not measured."""
    worst_joint: int
    """The joint whose largest difference is the largest share of its nominal torque."""
    worst_state: FloatArray
    """State of the largest difference: z, dz and ddz, (3, n_dof)."""
    smallest_eigenvalue: float
    """Smallest eigenvalue of all evaluated mass matrices, kg m^2 (kg)."""
    mass_states: int
    """Number of random states inside the limits on which mass matrices were evaluated."""
    lower: FloatArray
    """Smallest z, dz and ddz of the estimation set, (3, n_dof): the model holds within."""
    upper: FloatArray
    """The largest."""
    drawn: FloatArray
    """Between what random states were drawn, smallest and largest z, dz and ddz, (2, 3, n_dof): the limits, or what the
    estimation set reaches where there is none; of loops what they came to. Not numbers if there are none."""
    front: TermFront


@record
class TermReduction:
    """The functions whose terms were removed within a budget."""

    FILE: ClassVar[str] = "terms.h5"
    torque_budget: float
    """Torque error allowed on both sets, or on the estimation set."""
    acceleration_budget: float
    """The same of accelerations, for the direct dynamics; infinite where none was given."""
    held_out: bool
    """Whether budgets are on the estimation set alone, the other one being held out, or absent."""
    functions: Mapping[str, TermModel]
    """``inverse`` and ``direct``."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "functions", Choices(self.functions))
