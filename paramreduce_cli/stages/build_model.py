"""The stage build-model: from the description of a robot to its parameters and base parameters."""

import dataclasses
import warnings

import numpy as np

from paramreduce_cli.config.schema import ModelSection
from paramreduce_cli.errors import ConfigError, DataError, NumericalError, ParamreduceWarning
from paramreduce_cli.lean.formulations import find_formulations
from paramreduce_cli.lean.lean_verification import check_formulations
from paramreduce_cli.multibody.base_parameters import (
    choose_base,
    compute_regrouping,
    find_affecting_parameters,
)
from paramreduce_cli.multibody.drive_motions import compute_lengths
from paramreduce_cli.multibody.dynamics import Dynamics
from paramreduce_cli.multibody.loops.assembly import assemble, find_assembly_modes
from paramreduce_cli.multibody.random_states import draw_states
from paramreduce_cli.multibody.relations import format_regrouping
from paramreduce_cli.multibody.static_rests import set_static_rests
from paramreduce_cli.records import (
    BaseParameters,
    BoolArray,
    FloatArray,
    IntArray,
    MeasuredLog,
    Mechanism,
    Model,
    Run,
)
from paramreduce_cli.robots import Robot

_STATES = 300
"""Random states on which ranks are decided; many more rows than columns."""
_CHANGED_GEOMETRIES = 2
"""On which a guess of what a coefficient is must hold too."""

States = tuple[FloatArray, FloatArray, FloatArray]

_NO_LENGTH = 1e-9
"""Length of a force element that counts as zero, m."""
_SEED = 0
"""Seed of the random states on which ranks are decided."""


def build_model(
    robot: Robot, model: ModelSection, run: Run, log: MeasuredLog | None = None
) -> Model:
    """Derive the model, its parameters and its base parameters.

    Friction that the config leaves to the log is that of the processed log.

    The number of base parameters is determined on seeded random states. An interrupted run starts again; it takes less
    than a minute for thirty joints.

    Raises:
        ConfigError: The nominal torque of a joint is zero and the config gives none.
        DataError: The log is to decide on friction, and is not processed.
    """
    if robot.automatic_friction:
        if log is None:
            raise DataError("there is no log.h5, which decides on friction.", command="process-log")
        if log.friction is not None:
            robot = robot.apply_friction(log.friction)
    mechanism = set_static_rests(assemble(robot.build_mechanism()), robot.get_values())
    rng = np.random.default_rng(_SEED)
    states = draw_states(mechanism, _STATES, rng)
    _check_lengths(mechanism, states[0])
    K = Dynamics(mechanism).compute_regressor(*states)
    measured = robot.find_measured()
    W = K[:, measured].reshape(-1, K.shape[2])
    values = robot.get_values()
    given = robot.get_nominal_torque()
    nominal = np.std(K @ values, axis=0) if given is None else given
    nominal = np.where(measured, nominal, np.inf)
    if not np.all(nominal > 0):
        joint = mechanism.coordinate_names[int(np.argmin(nominal))]
        raise ConfigError(
            f"{joint} carries no torque or force, so its standard deviation is no scale. Give "
            "nominal_torque in the config, in N m (N for a prismatic joint).",
            ("nominal_torque",),
        )
    affects = find_affecting_parameters(mechanism, K[:, measured])
    base = choose_base(W, _order_columns(model, mechanism), model.rank_tolerance, affects)
    _check_named(model, mechanism, base)
    _say_other_modes(robot, model, mechanism, base)
    texts = _format_expressions(robot, mechanism, base, affects, states, rng)
    lean = find_formulations(mechanism, affects, base.columns, run)
    check_formulations(mechanism, lean, np.flatnonzero(affects), states, rng)
    return Model(
        mechanism=mechanism,
        values=values,
        affecting=affects,
        base=dataclasses.replace(base, expressions=tuple(texts)),
        nominal_torque=nominal,
        nominal_torque_given=given is not None,
        formulations=lean,
    )


def _check_lengths(mechanism: Mechanism, q: FloatArray) -> None:
    """Raise ConfigError if the two points of a force element coincide; warn if they do in the zero position alone.

    Args:
        mechanism: Mechanism with assembled loops.
        q: Generalised coordinates of some states, (n_states, n_q).
    """
    closed = mechanism.loops is not None
    start = mechanism.loops.assembly if mechanism.loops is not None else np.zeros(mechanism.n_q)
    for name, lengths in compute_lengths(mechanism, np.vstack([start, q])).items():
        if lengths[0] > _NO_LENGTH:
            continue
        text = "its two points coincide, so that it has no direction"
        if closed or lengths.max() <= _NO_LENGTH:
            raise ConfigError(f"{text}. Move one of them.", ("forces", name, "at"))
        warnings.warn(
            f"forces.{name}: with zero for all coordinates {text}; keep away from there",
            ParamreduceWarning,
            stacklevel=3,
        )


def _say_other_modes(
    robot: Robot, model: ModelSection, mechanism: Mechanism, base: BaseParameters
) -> None:
    """Warn if the loops have another assembly mode with a different number of base parameters.

    Nothing else shows that the guess leads to the wrong assembly mode.
    """
    if mechanism.loops is None:
        return
    counts = []
    for mode in find_assembly_modes(mechanism):
        try:
            states = draw_states(mode, _STATES // 2, np.random.default_rng(_SEED))
            K = Dynamics(mode).compute_regressor(*states)[:, robot.find_measured()]
            affects = find_affecting_parameters(mode, K)
            W = K.reshape(-1, K.shape[2])
            found = choose_base(W, _order_columns(model, mode), model.rank_tolerance, affects)
        except (NumericalError, DataError):
            continue
        counts.append(found.columns.size)
    others = sorted({count for count in counts if count != base.columns.size})
    if others:
        warnings.warn(
            f"the loops have {base.columns.size} base parameters in the assembly that the guess leads to, and "
            f"{' or '.join(map(str, others))} in others nearby with the same independent coordinates: see on the page that it "
            "is the one that is built, or give another guess",
            ParamreduceWarning,
            stacklevel=2,
        )


def _check_named(model: ModelSection, mechanism: Mechanism, base: BaseParameters) -> None:
    """Raise ConfigError if a column that the config names cannot be a base parameter."""
    names = mechanism.parameter_names
    for name in model.base_columns or []:
        if names.index(name) not in base.columns:
            raise ConfigError(
                f"{name} has no effect on the torques, or depends on those named before it. Leave it "
                "out.",
                ("model", "base_columns"),
            )


def _format_expressions(
    robot: Robot,
    mechanism: Mechanism,
    base: BaseParameters,
    affects: BoolArray,
    states: States,
    rng: np.random.Generator,
) -> list[str]:
    """Return the base parameters as sums of standard ones, with coefficients as products of lengths where these
    reproduce them for other lengths too.

    Without named lengths, as in mechanisms with loops, coefficients are numbers.
    """
    betas, geometries = [base.beta], [mechanism]
    for _ in range(_CHANGED_GEOMETRIES if mechanism.lengths else 0):
        stretched = robot.stretch(lambda length: length * rng.uniform(0.8, 1.25))
        changed = set_static_rests(stretched.build_mechanism(), stretched.get_values())
        K = Dynamics(changed, once=True).compute_regressor(*states)[:, robot.find_measured()]
        betas.append(compute_regrouping(K.reshape(-1, K.shape[2]), base.columns, affects))
        geometries.append(changed)
    lengths = [{length.name: length.value for length in entry.lengths} for entry in geometries]
    return format_regrouping(mechanism.parameter_names, base.columns, betas, lengths)


def _order_columns(model: ModelSection, mechanism: Mechanism) -> IntArray:
    """Return the preference order of the columns, those that the config names first."""
    usual = mechanism.preference_order
    if model.base_columns is None:
        return usual
    names = mechanism.parameter_names
    named = np.array([names.index(name) for name in model.base_columns], dtype=np.int64)
    return np.concatenate([named, usual[~np.isin(usual, named)]])
