"""Control of an arm with several models in the controller."""

from collections.abc import Mapping
from typing import Protocol

import casadi as ca
import numpy as np

from paramreduce_cli.config.schema import TrackingSection
from paramreduce_cli.expressions.compiled import BatchFunction
from paramreduce_cli.multibody.textbook_dynamics import PlainDynamics
from paramreduce_cli.records import FloatArray, Model, Tracking
from paramreduce_cli.report.tracking.control import Arm, advance_state, simulate
from paramreduce_cli.report.tracking.paths import plan_paths

_SHARE = 0.8
"""Share of the range and speed of a motion that the paths keep to."""


_CONTROL_PERIOD = 1e-3
"""Time between two torques, s."""
_PATHS = 10
"""Paths of random poses, each with its number as seed; errors are given as a range over them."""


class ControllerModel(Protocol):
    """A model of inverse dynamics as a controller has it."""

    def __call__(self, q: FloatArray, dq: FloatArray, ddq: FloatArray, /) -> FloatArray:
        """Torques of some states, (n_states, n_dof)."""


def simulate_tracking(
    section: TrackingSection,
    model: Model,
    controllers: Mapping[str, ControllerModel],
    z: FloatArray,
    dz: FloatArray,
) -> Tracking:
    """Simulate control with each model on the same paths.

    Args:
        section: Settings of the simulation.
        model: Full model, which the arm follows.
        controllers: Models of the controller, by their titles.
        z: Positions of a motion whose range the paths keep to, (n_samples, n_dof).
        dz: Velocities of that motion.
    """
    low, high = z.min(axis=0), z.max(axis=0)
    inset = (1 - _SHARE) / 2 * (high - low)
    speed = _SHARE * np.abs(dz).max(axis=0)
    paths = plan_paths(
        low + inset, high - inset, speed, section.moves, _CONTROL_PERIOD, range(_PATHS)
    )
    arm = _compile_arm(model, _CONTROL_PERIOD)
    errors = {name: simulate(paths, c, arm, section.bandwidth) for name, c in controllers.items()}
    return Tracking(paths, errors)


def _compile_arm(model: Model, period: float) -> Arm:
    """Return the full model by textbook recursion, compiled over a whole control period."""
    accelerations = PlainDynamics(model.mechanism).express_accelerations(model.values)
    states = [ca.MX.sym(name, model.mechanism.n_dof) for name in ("z", "dz", "tau")]
    return BatchFunction(states, list(advance_state(accelerations, period, *states)))
