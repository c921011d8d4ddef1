"""A reduced model with all that its code says, checked before it is written in some language."""

import warnings
from collections.abc import Mapping, Sequence
from enum import StrEnum

import numpy as np

from paramreduce_cli import __version__
from paramreduce_cli.errors import DataError, ParamreduceWarning
from paramreduce_cli.export.code_verification import (
    check,
    check_against_mechanism,
    check_closures,
    check_loop_problems,
    find_massive_coordinates,
    find_unsafe_mass_matrices,
    make_random_cases,
    measure_single_precision,
)
from paramreduce_cli.export.exported_model import ExportedModel, ParameterValue
from paramreduce_cli.export.term_sizes import estimate_term_sizes
from paramreduce_cli.export.validity import describe_ranges, describe_validity
from paramreduce_cli.expressions.functions import Function
from paramreduce_cli.lean.dynamics_parts import DynamicsParts
from paramreduce_cli.lean.lean_functions import LeanFunctions
from paramreduce_cli.lean.loop_kinematics import LoopKinematics
from paramreduce_cli.records import (
    FloatArray,
    Mechanism,
    Model,
    Progress,
    ProgressCallback,
    ReducedModel,
    TermModel,
    Validation,
)
from paramreduce_cli.texts.table import Table

_TASK = "write code"

_CASES = 16
"""States in the self-test."""
_CHECKED = 200
"""States on which the functions are checked before they are written."""
_LOOPS = {"z", "dz", "ddz", "guess", "q", "dq", "ddq", "R", "b"}
"""What the position, velocity and acceleration problems take and give."""


class Exported(StrEnum):
    """A selection of functions to export."""

    IDM = "idm"
    DDM = "ddm"
    BOTH = "both"
    REGRESSOR = "regressor"
    GRAVITY = "gravity"
    CORIOLIS = "coriolis"
    NONLINEAR = "nonlinear"
    MASS_MATRIX = "mass-matrix"
    CORIOLIS_MATRIX = "coriolis-matrix"
    MOMENTUM = "momentum"
    DERIVATIVES = "derivatives"
    FORWARD_DYNAMICS = "forward-dynamics"


_FUNCTIONS = {
    Exported.IDM: (LeanFunctions.make_inverse,),
    Exported.DDM: (LeanFunctions.make_direct,),
    Exported.BOTH: (LeanFunctions.make_inverse, LeanFunctions.make_direct),
    Exported.REGRESSOR: (LeanFunctions.make_regressor,),
    Exported.GRAVITY: (DynamicsParts.make_gravity,),
    Exported.CORIOLIS: (DynamicsParts.make_coriolis,),
    Exported.NONLINEAR: (DynamicsParts.make_nonlinear,),
    Exported.MASS_MATRIX: (DynamicsParts.make_mass_matrix,),
    Exported.CORIOLIS_MATRIX: (DynamicsParts.make_coriolis_matrix,),
    Exported.MOMENTUM: (DynamicsParts.make_momentum,),
    Exported.DERIVATIVES: (DynamicsParts.make_derivatives,),
    Exported.FORWARD_DYNAMICS: (DynamicsParts.make_forward_dynamics,),
}


_SIMULATED = {
    Exported.DDM: (Exported.FORWARD_DYNAMICS,),
    Exported.BOTH: (Exported.IDM, Exported.FORWARD_DYNAMICS),
}
"""Functions of units that simulate, by what they are in other languages."""
_WITH_MASS_MATRIX = (Exported.DDM, Exported.BOTH, Exported.MASS_MATRIX, Exported.FORWARD_DYNAMICS)


def make_exported_model(
    model: Model,
    chosen: ReducedModel,
    *,
    title: str,
    what: Exported | Sequence[Exported] = Exported.BOTH,
    name: str = "",
    constant: bool = False,
    single: bool = False,
    origin: str = "",
    simplified: TermModel | None = None,
    validation: Validation | None = None,
    report_progress: ProgressCallback = lambda _: None,
) -> ExportedModel:
    """Return a model for :data:`paramreduce_cli.export.languages.languages` to write, its functions checked.

    Args:
        model: Model of the robot.
        chosen: Reduced model to export, with expressions.
        title: Title of the model.
        what: Functions to export, one kind or several.
        name: Name that files and functions begin with; the robot's if empty.
        constant: Whether the values of the parameters are part of the code.
        single: Whether numbers have single precision.
        origin: Artifact that the model is from, for the comment that opens every file.
        simplified: The function that is asked for with pruned terms, whose parameters are those of
            the model.
        validation: Validation, for the ranges that the model was validated in; None without one.
        report_progress: Progress callback.

    Raises:
        FormulationError: The functions do not compute what the straightforward model does.
        DataError: Accelerations are asked for, and the mass matrix is not positive definite.
    """
    mechanism = model.mechanism
    report_progress(Progress(_TASK, 0, 2, "functions"))
    functions = make_functions(model, chosen, what, constant=constant, simplified=simplified)
    closures: tuple[Function, ...] = ()
    problems: tuple[Function, ...] = ()
    least_pivots = np.empty(0)
    if mechanism.loops is not None:
        closures = tuple(LeanFunctions(model, chosen, constant=constant).make_closures())
        kinematics = LoopKinematics(mechanism)
        problems, least_pivots = kinematics.make_problems(), kinematics.least_pivots
    report_progress(Progress(_TASK, 1, 2, "checks"))
    rng = np.random.default_rng(0)
    result_names = {result.name for function in functions for result in function.results}
    checked = make_random_cases(mechanism, chosen, _CHECKED, rng, simplified, result_names)
    least = estimate_term_sizes(mechanism, chosen, checked)
    kinds = _list_kinds(what)
    if Exported.FORWARD_DYNAMICS in kinds:
        _require_accelerations(model, checked)
    # With pruned terms M was positive definite wherever these hold; the random states may be beyond.
    unsafe = _check_mass_matrices(model, checked, kinds, title) if simplified is None else ""
    check(functions, checked, least)
    whole = np.array_equal(chosen.standard[model.affecting], model.values[model.affecting])
    if whole and simplified is None:
        check_against_mechanism(model, checked, least)
    if closures:
        check_closures(closures, checked, least)
        check_loop_problems(problems, least_pivots, checked, least)
    worth = _describe_accuracy(model, unsafe, simplified, validation)
    if single:
        worth.append(_describe_rounding(functions, checked, least))
    used = {a.name for f in functions for a in (*f.arguments, *f.results)}
    if mechanism.loops is not None:
        used |= _LOOPS
    stored = make_random_cases(mechanism, chosen, _CASES, rng, simplified, result_names)
    report_progress(Progress(_TASK, 2, 2))
    return ExportedModel(
        robot=name or mechanism.robot,
        heading=(f"{mechanism.robot}: {title}.", *worth, *_describe_origin(mechanism, origin)),
        frames=_describe_frames(mechanism),
        coordinates=mechanism.generalised_names,
        units=tuple(body.unit for body in mechanism.bodies),
        independent=np.array(mechanism.independent, dtype=np.int64),
        start=np.zeros(mechanism.n_q) if mechanism.loops is None else mechanism.loops.assembly,
        parameters=_list_values(model, chosen),
        symbols=mechanism.symbols,
        constant=constant,
        functions=functions,
        closures=closures,
        loop_problems=problems,
        least_pivots=least_pivots,
        single=single,
        cases={name: values for name, values in stored.items() if name in used},
        least=least,
    )


def _require_accelerations(model: Model, stored: Mapping[str, FloatArray]) -> None:
    """Raise DataError if forces do not determine all accelerations, whatever the parameters.

    Raises:
        DataError: Torques were not measured, or a coordinate moves no mass.
    """
    if model.unmeasured:
        raise DataError(
            f"{Exported.FORWARD_DYNAMICS}: the torques of {', '.join(model.unmeasured)} were not measured, so that the mass "
            f"matrix is not known there. Export {Exported.IDM}."
        )
    massive = find_massive_coordinates(model, stored)
    names = [model.mechanism.generalised_names[k] for k in model.mechanism.independent]
    massless = [name for k, name in enumerate(names) if k not in massive]
    if massless:
        raise DataError(
            f"{Exported.FORWARD_DYNAMICS}: no mass moves with {', '.join(massless)}, so that forces determine no acceleration "
            f"there. Export {Exported.IDM}; languages other than fmu also have {Exported.DDM}, for the other accelerations."
        )


def _check_mass_matrices(
    model: Model, stored: Mapping[str, FloatArray], kinds: Sequence[Exported], title: str
) -> str:
    """Describe on how many states the mass matrix is not positive definite, and warn of them; empty if on none, or if no
    function needs it.

    Raises:
        DataError: Accelerations are asked for, which need a positive definite mass matrix.
    """
    if not set(kinds) & set(_WITH_MASS_MATRIX):
        return ""
    massive = find_massive_coordinates(model, stored)
    unsafe = find_unsafe_mass_matrices(stored["M"][:, massive][:, :, massive])
    if Exported.FORWARD_DYNAMICS in kinds and unsafe:
        raise DataError(
            f"{Exported.FORWARD_DYNAMICS}: it needs a positive definite M, and of {title} {unsafe}. Choose a model that is "
            "selected by accelerations, such as one of swap@acceleration, or full."
        )
    if unsafe:
        warnings.warn(f"{title}: {unsafe}", ParamreduceWarning, stacklevel=3)
    return unsafe


def _describe_accuracy(
    model: Model, unsafe: str, simplified: TermModel | None, validation: Validation | None
) -> list[str]:
    """Describe how accurate a model is and where it holds, line by line."""
    lines = [f"NOT SAFE FOR DIRECT DYNAMICS: {unsafe}."] if unsafe else []
    if model.unmeasured:
        names = ", ".join(model.unmeasured)
        lines.append(f"NOT PREDICTED, as not measured: the torques of {names}.")
    if validation is not None:
        lines.append("Errors were measured on motions within")
        lines += describe_ranges(model.mechanism, validation.lower, validation.upper)
    if simplified is not None:
        lines += describe_validity(model.mechanism, simplified)
    return lines


def _describe_origin(mechanism: Mechanism, origin: str) -> tuple[str, str]:
    """Return sentences on the gravity that the model assumes, and on what made the model."""
    gravity = " ".join(f"{g:.6g}" for g in mechanism.gravity)
    return (
        f"Gravity in the base frame, m/s^2: {gravity}",
        f"Made by paramreduce {__version__} ({origin}).",
    )


def _describe_rounding(
    functions: tuple[Function, ...], checked: Mapping[str, FloatArray], least: Mapping[str, float]
) -> str:
    """Describe the rounding error in single precision, on the states that the functions are checked on."""
    errors = measure_single_precision(functions, checked, least)
    listed = ", ".join(f"{name} {error:.1e}" for name, error in errors.items())
    return f"Single precision, on {_CHECKED} random states off by about (of the largest): {listed}."


def _describe_frames(mechanism: Mechanism) -> tuple[str, ...]:
    """Return the table of joints and frames of the config, line by line, for the header of the code."""
    header, *rows = mechanism.table
    lines = Table(mechanism.frames, header, tuple(rows)).to_text().splitlines()
    return tuple(f"  {line}".rstrip() for line in lines if line)


def _list_values(model: Model, chosen: ReducedModel) -> tuple[ParameterValue, ...]:
    """Return the parameters of the model with values and units."""
    units = chosen.list_units(model.mechanism.parameters)
    found = zip(chosen.names, chosen.values.tolist(), units, chosen.expressions, strict=True)
    return tuple(ParameterValue(*one) for one in found)


def make_functions(
    model: Model,
    chosen: ReducedModel,
    what: Exported | Sequence[Exported],
    *,
    constant: bool = False,
    simplified: TermModel | None = None,
) -> tuple[Function, ...]:
    """Return the functions of a model.

    Args:
        model: Model of the robot.
        chosen: Reduced model.
        what: Functions to return, one kind or several.
        constant: Whether the values of the parameters are part of them.
        simplified: The one function with pruned terms.
    """
    lean = DynamicsParts(model, chosen, constant=constant, simplified=simplified)
    makers = [make for kind in _list_kinds(what) for make in _FUNCTIONS[kind]]
    return tuple(make(lean) for make in dict.fromkeys(makers))


def adapt_kinds(what: Exported | Sequence[Exported], language: str) -> tuple[Exported, ...]:
    """Return the functions to export in a language; units of FMI simulate the direct model, for which they need accelerations.

    Args:
        what: Functions that are asked for, one kind or several.
        language: Name of the language.
    """
    kinds = _list_kinds(what)
    if language != "fmu":
        return kinds
    return tuple(simulated for kind in kinds for simulated in _SIMULATED.get(kind, (kind,)))


def _list_kinds(what: Exported | Sequence[Exported]) -> tuple[Exported, ...]:
    """Return kinds of functions as a tuple, whether one or several are given."""
    return (what,) if isinstance(what, Exported) else tuple(what)
