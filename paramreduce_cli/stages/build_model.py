"""build-model: from the description to parameters and their base."""

from __future__ import annotations

import dataclasses

import numpy as np

from paramreduce_cli.config import Config
from paramreduce_cli.errors import ConfigError
from paramreduce_cli.multibody.base_parameters import (
    affecting_columns,
    base_parameters,
    preference_order,
    regrouping,
)
from paramreduce_cli.multibody.dynamics import Dynamics
from paramreduce_cli.multibody.relations import regrouping_expressions
from paramreduce_cli.records import BaseParameters, FloatArray, Mechanism, Model
from paramreduce_cli.registry import stage
from paramreduce_cli.robots.dh import DHRow, mechanism_from_dh

_STATES = 300
"""Random states on which ranks are decided; many more rows than columns."""
_CHANGED_GEOMETRIES = 2
"""On which a guess of what a coefficient is must hold too."""


@stage
def build_model(config: Config) -> Model:
    """Derive the model, its parameters and its base parameters.

    The ranks are decided on seeded random states.
    """
    mechanism = _mechanism(config, 1.0)
    rng = np.random.default_rng(config.model.seed)
    states = _random_states(mechanism, rng)
    K = Dynamics(mechanism).regressor(*states)
    W = K.reshape(-1, K.shape[2])
    values = config.standard_parameters()
    given = config.nominal_torque != "standard-deviation"
    nominal = config.per_joint(config.nominal_torque) if given else np.std(K @ values, axis=0)
    if not np.all(nominal > 0):
        joint = mechanism.coordinate_names[int(np.argmin(nominal))]
        raise ConfigError(
            f"nominal_torque: {joint} carries no torque or force, so its standard deviation is no "
            "scale. Give nominal_torque in the config, in N m (N for a prismatic joint)."
        )
    base = base_parameters(W, _preference(config, mechanism), config.model.rank_tolerance)
    _check_named(config, mechanism, base)
    texts = _expressions(config, mechanism, base, states, rng)
    return Model(
        mechanism=mechanism,
        values=values,
        affecting=affecting_columns(W),
        base=dataclasses.replace(base, expressions=tuple(texts)),
        nominal_torque=nominal,
        nominal_torque_given=given,
    )


def _check_named(config: Config, mechanism: Mechanism, base: BaseParameters) -> None:
    """Refuse named base columns that are no base parameters, instead of replacing them."""
    names = mechanism.parameter_names
    for name in config.model.base_columns or []:
        if names.index(name) not in base.columns:
            raise ConfigError(
                f"model.base_columns: {name} has no effect on the torques, or depends on those "
                "named before it. Leave it out."
            )


def _expressions(
    config: Config,
    mechanism: Mechanism,
    base: BaseParameters,
    states: tuple[FloatArray, FloatArray, FloatArray],
    rng: np.random.Generator,
) -> list[str]:
    """Regrouping relations, coefficients named where they follow changed lengths as well."""
    betas, lengths = [base.beta], [mechanism.lengths]
    for _ in range(_CHANGED_GEOMETRIES):
        changed = _mechanism(config, rng)
        K = Dynamics(changed, once=True).regressor(*states)
        betas.append(regrouping(K.reshape(-1, K.shape[2]), base.columns))
        lengths.append(changed.lengths)
    return regrouping_expressions(mechanism.parameter_names, base.columns, betas, lengths)


def _mechanism(config: Config, stretch: np.random.Generator | float) -> Mechanism:
    """The mechanism of a config, its lengths multiplied by a number or by random ones."""

    def stretched(length: float) -> float:
        factor = stretch if isinstance(stretch, float) else float(stretch.uniform(0.8, 1.25))
        return length * factor

    names = config.body_names()
    rows = [
        DHRow(
            name=names[k],
            parent=_parent(joint.parent, names[k - 1] if k else None),
            joint=joint.type,
            a=stretched(joint.a),
            alpha=joint.alpha,
            d=stretched(joint.d),
            theta=joint.theta,
            gamma=joint.gamma,
            b=stretched(joint.b),
        )
        for k, joint in enumerate(config.description.dh.joints)
    ]
    return mechanism_from_dh(
        config.robot, rows, config.description.dh.convention, config.description.gravity
    )


def _parent(given: str | None, above: str | None) -> str | None:
    if given == "base":
        return None
    return given if given is not None else above


def _random_states(
    mechanism: Mechanism, rng: np.random.Generator
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Anywhere: whole turns, slides as long as the arm, speeds and accelerations normal."""
    longest = max((abs(length) for length in mechanism.lengths.values()), default=1.0)
    reach = [np.pi if body.joint == "revolute" else longest for body in mechanism.bodies]
    shape = (_STATES, mechanism.n_dof)
    z = rng.uniform(-1, 1, size=shape) * reach
    return z, rng.normal(size=shape), rng.normal(size=shape)


def _preference(config: Config, mechanism: Mechanism) -> np.ndarray:
    """Preference order of columns, those that the config names first."""
    names = mechanism.parameter_names
    usual = preference_order(names)
    if config.model.base_columns is None:
        return usual
    named = np.array([names.index(name) for name in config.model.base_columns], dtype=np.int64)
    return np.concatenate([named, usual[~np.isin(usual, named)]])
