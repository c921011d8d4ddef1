"""build-model: from the description to parameters and their base."""

from __future__ import annotations

import dataclasses

import numpy as np

from paramreduce_cli.config import Config
from paramreduce_cli.errors import ConfigError
from paramreduce_cli.lean.checking import check_formulations
from paramreduce_cli.lean.search import formulations
from paramreduce_cli.multibody.base_parameters import (
    affecting_columns,
    base_parameters,
    preference_order,
    regrouping,
)
from paramreduce_cli.multibody.dynamics import Dynamics
from paramreduce_cli.multibody.random_states import random_states
from paramreduce_cli.multibody.relations import regrouping_expressions
from paramreduce_cli.records import BaseParameters, FloatArray, Mechanism, Model
from paramreduce_cli.registry import stage
from paramreduce_cli.stages.description import described_mechanism

_STATES = 300
"""Random states on which ranks are decided; many more rows than columns."""
_CHANGED_GEOMETRIES = 2
"""On which a guess of what a coefficient is must hold too."""


@stage
def build_model(config: Config) -> Model:
    """Derive the model, its parameters and its base parameters.

    The ranks are decided on seeded random states.
    """
    mechanism = described_mechanism(config)
    rng = np.random.default_rng(config.model.seed)
    states = random_states(mechanism, _STATES, rng)
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
    affecting = affecting_columns(W)
    lean = formulations(mechanism, affecting, base.columns)
    check_formulations(mechanism, lean, np.flatnonzero(affecting), states, rng)
    return Model(
        mechanism=mechanism,
        values=values,
        affecting=affecting,
        base=dataclasses.replace(base, expressions=tuple(texts)),
        nominal_torque=nominal,
        nominal_torque_given=given,
        formulations=lean,
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
    """Regrouping relations, coefficients named where they follow changed lengths as well.

    Without named lengths, as in mechanisms with loops, coefficients are numbers.
    """
    betas, lengths = [base.beta], [mechanism.lengths]
    for _ in range(_CHANGED_GEOMETRIES if mechanism.lengths else 0):
        changed = described_mechanism(config, lambda length: length * rng.uniform(0.8, 1.25))
        K = Dynamics(changed, once=True).regressor(*states)
        betas.append(regrouping(K.reshape(-1, K.shape[2]), base.columns))
        lengths.append(changed.lengths)
    return regrouping_expressions(mechanism.parameter_names, base.columns, betas, lengths)


def _preference(config: Config, mechanism: Mechanism) -> np.ndarray:
    """Preference order of columns, those that the config names first."""
    names = mechanism.parameter_names
    usual = preference_order(names)
    if config.model.base_columns is None:
        return usual
    named = np.array([names.index(name) for name in config.model.base_columns], dtype=np.int64)
    return np.concatenate([named, usual[~np.isin(usual, named)]])
