"""What the parts of a config must say about each other."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator

import numpy as np

from paramreduce_cli.config.names import unknown
from paramreduce_cli.config.reading import Path
from paramreduce_cli.config.schema import Config
from paramreduce_cli.errors import ParamreduceWarning
from paramreduce_cli.records import PARAMETER_KINDS

Problem = tuple[Path, str]
Check = Callable[[Config], Iterator[Problem]]


def check(config: Config) -> list[Problem]:
    """All problems between the parts of a config that is valid part by part."""
    tree = list(_bodies(config))
    if tree:
        return tree
    found = [problem for one in _CHECKS for problem in one(config)]
    if not found:
        _remark_on_physics(config)
    return found


def _bodies(config: Config) -> Iterator[Problem]:
    seen: set[str] = set()
    names = config.body_names()
    for k, (name, joint) in enumerate(zip(names, config.description.dh.joints, strict=True)):
        path = ("description", "dh", "joints", k)
        if name in seen or name == "base":
            yield (*path, "name"), f"{name!r} is taken; every body needs a name of its own"
        if joint.parent is not None and joint.parent not in {"base", *seen}:
            if joint.parent in names:
                message = f"{joint.parent!r} is not above {name!r}; put parents above children"
            else:
                message = unknown("body", joint.parent, ["base", *seen])
            yield (*path, "parent"), message
        seen.add(name)


def _parameter_sets(config: Config) -> Iterator[Problem]:
    names = config.body_names()
    for label, bodies in config.parameter_sets.items():
        for body in bodies:
            if body not in names:
                yield ("parameter_sets", label, body), unknown("body", body, names)
        for name in names:
            if name not in bodies:
                yield (
                    ("parameter_sets", label),
                    f"has no body {name}; write `{name}: {{}}` if it has no mass",
                )
    if config.parameters is not None and config.parameters not in config.parameter_sets:
        yield ("parameters",), unknown("parameter set", config.parameters, config.parameter_sets)


def _per_joint(config: Config) -> Iterator[Problem]:
    n = config.n_dof
    trajectories = config.trajectories
    counted: list[tuple[Path, object, str]] = [
        (("nominal_torque",), config.nominal_torque, "N m (N for a prismatic joint)"),
        (
            ("trajectories", "position_limits"),
            trajectories.position_limits,
            "rad (m for a prismatic joint)",
        ),
        (
            ("trajectories", "velocity_limits"),
            trajectories.velocity_limits,
            "rad/s (m/s for a prismatic joint)",
        ),
        (
            ("trajectories", "acceleration_limits"),
            trajectories.acceleration_limits,
            "rad/s^2 (m/s^2 for a prismatic joint)",
        ),
        (
            ("sampling", "nominal_acceleration"),
            config.sampling.nominal_acceleration,
            "rad/s^2 (m/s^2 for a prismatic joint)",
        ),
    ]
    for path, values, unit in counted:
        if isinstance(values, list) and len(values) not in (1, n):
            yield (
                path,
                f"has {len(values)} values, but {config.robot} has {n} joints. Give one per joint, "
                f"or one for all, in {unit}",
            )
    for k, pose in enumerate(config.report.poses or []):
        if len(pose) not in (1, n):
            yield ("report", "poses", k), f"has {len(pose)} values, but there are {n} joints"


def _limits(config: Config) -> Iterator[Problem]:
    for k, (lower, upper) in enumerate(config.trajectories.position_limits):
        path: Path = ("trajectories", "position_limits")
        if len(config.trajectories.position_limits) > 1:
            path = (*path, k)
        if not np.isfinite([lower, upper]).all():
            yield path, f"[{lower:g}, {upper:g}] must be finite"
        elif lower == upper:
            yield path, f"the joint never moves between {lower:g} and {upper:g}; fix it or free it"
        elif lower > upper:
            yield path, f"the limits cross: {lower:g} is above {upper:g}; write [lower, upper]"
    t = config.trajectories
    if t.points <= 2 * t.harmonics:
        yield (
            ("trajectories", "points"),
            f"{t.points} points cannot hold {t.harmonics} harmonics within their limits; use at "
            f"least {2 * t.harmonics + 1}, better {20 * t.harmonics}",
        )
    if t.polished > t.starts:
        yield ("trajectories", "polished"), f"is {t.polished}, but there are {t.starts} starts"


def _parameter_names(config: Config) -> Iterator[Problem]:
    known = [f"{kind}_{body}" for body in config.body_names() for kind in PARAMETER_KINDS]
    for k, name in enumerate(config.model.base_columns or []):
        if name not in known:
            yield ("model", "base_columns", k), unknown("parameter", name, known)
        elif name in (config.model.base_columns or [])[:k]:
            yield ("model", "base_columns", k), f"{name} stands there twice"


def _numbers_of_parameters(config: Config) -> Iterator[Problem]:
    total = config.n_dof * len(PARAMETER_KINDS)
    if config.selected.heuristic not in config.reduction.heuristics:
        yield (
            ("selected", "heuristic"),
            f"{config.selected.heuristic} does not run; it must be one of reduction.heuristics: "
            f"{', '.join(config.reduction.heuristics)}",
        )
    for path, n in (
        (("selected", "n"), config.selected.n),
        (("reduction", "stop", "parameters"), config.reduction.stop.parameters),
    ):
        if n is not None and n > total:
            yield path, f"is {n}, but {config.robot} has {total} parameters"
    most, wanted = config.reduction.stop.parameters, config.selected.n
    if most is not None and wanted is not None and wanted > most:
        yield (
            ("selected", "n"),
            f"is {wanted}, but reduction.stop.parameters stops at {most}; raise that, or lower this",
        )


_CHECKS: tuple[Check, ...] = (
    _parameter_sets,
    _per_joint,
    _limits,
    _parameter_names,
    _numbers_of_parameters,
)


def _remark_on_physics(config: Config) -> None:
    """Warn of bodies that cannot exist; reduced sets are not physical either, so go on."""
    values = config.standard_parameters().reshape(-1, len(PARAMETER_KINDS))
    for name, (m, mx, my, mz, xx, xy, xz, yy, yz, zz) in zip(
        config.body_names(), values, strict=True
    ):
        if m < 0:
            _remark(f"body {name} has the negative mass {m:g} kg")
            continue
        moment = np.array([mx, my, mz])
        tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        pseudo = np.block(
            [
                [np.trace(tensor) / 2 * np.eye(3) - tensor, moment[:, None]],
                [moment[None, :], np.array([[m]])],
            ]
        )
        eigenvalues = np.linalg.eigvalsh(pseudo)
        if eigenvalues[0] < -1e-9 * max(abs(eigenvalues[-1]), 1e-300):
            _remark(
                f"the inertia of body {name} is not physical: no distribution of mass has it (its "
                f"pseudo-inertia matrix has the eigenvalue {eigenvalues[0]:.3g})"
            )


def _remark(message: str) -> None:
    warnings.warn(f"{message}; going on", ParamreduceWarning, stacklevel=2)
