"""Control of an arm with several models in the controller."""

from collections.abc import Mapping
from typing import Protocol

import numpy as np

from paramreduce_cli.config.schema import TrackingSection
from paramreduce_cli.multibody.dynamics import Dynamics
from paramreduce_cli.records import FloatArray, Model, Tracking
from paramreduce_cli.tracking.control import Torque, simulate
from paramreduce_cli.tracking.paths import point_to_point

_SHARE = 0.8
"""Of the range and speed of a motion that the paths keep to."""


class ControllerModel(Protocol):
    """Inverse dynamics as a controller has it."""

    @property
    def language(self) -> str:
        """In which it runs."""

    def __call__(self, q: FloatArray, dq: FloatArray, ddq: FloatArray) -> FloatArray:
        """Torques of some states, (n_states, n_dof)."""

    def seconds(self, q: FloatArray, dq: FloatArray, ddq: FloatArray) -> float:
        """Of one evaluation, s."""


def tracked(
    section: TrackingSection,
    model: Model,
    controllers: Mapping[str, ControllerModel],
    z: FloatArray,
    dz: FloatArray,
) -> Tracking:
    """Simulate control with each model on the same paths.

    Args:
        section: What is asked for.
        model: The full one, which the arm follows.
        controllers: Models of the controller, by their titles.
        z: Of a motion to whose range the paths keep, (n_samples, n_dof).
        dz: Its speeds.
    """
    low, high = z.min(axis=0), z.max(axis=0)
    inset = (1 - _SHARE) / 2 * (high - low)
    speed = _SHARE * np.abs(dz).max(axis=0)
    seeds = range(section.seed, section.seed + section.paths)
    paths = point_to_point(
        low + inset, high - inset, speed, section.moves, section.control_period, seeds
    )
    arm = _arm(model)
    along = [x[: paths.samples[0], 0] for x in (paths.z, paths.dz, paths.ddz)]
    return Tracking(
        paths,
        {name: simulate(paths, c, arm, section.bandwidth) for name, c in controllers.items()},
        {name: c.seconds(*along) for name, c in controllers.items()},
        next(c.language for c in controllers.values()),
    )


def _arm(model: Model) -> Torque:
    """Accelerations of the full model by plain recursion."""
    dynamics = Dynamics(model.mechanism)

    def accelerations(z: FloatArray, dz: FloatArray, tau: FloatArray) -> FloatArray:
        A, B = dynamics.direct_regressor(z, dz)
        right = tau - B @ model.values
        return np.asarray(np.linalg.solve(A @ model.values, right[..., None])[..., 0], float)

    return accelerations
