"""report: figures, tables, the page and summary.json."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from paramreduce_cli import registry
from paramreduce_cli.config import Config
from paramreduce_cli.errors import ConfigError, DataError
from paramreduce_cli.multibody.coordinates import Coordinates
from paramreduce_cli.multibody.kinematics import body_poses
from paramreduce_cli.records import (
    BASE,
    Body,
    FloatArray,
    Mechanism,
    Model,
    Provenance,
    Reduction,
    Report,
    Samples,
    Trajectories,
    Validation,
)
from paramreduce_cli.registry import stage
from paramreduce_cli.report.data import (
    Motion,
    ReportData,
    Skeleton,
    TrajectorySetup,
    first_motion,
)
from paramreduce_cli.report.figures import render
from paramreduce_cli.report.page import render_page
from paramreduce_cli.report.summary import summary_of
from paramreduce_cli.report.tracking import Tracking
from paramreduce_cli.stages.tracking import tracked

_POSES = 3


@stage
def report(
    config: Config,
    model: Model,
    trajectories: Trajectories | None,
    samples: Samples,
    reduction: Reduction,
    validation: Validation,
    provenance: Provenance,
) -> Report:
    """Draw the figures, set the tables and write the page and summary.json."""
    data = _gather(config, model, trajectories, samples, reduction, validation)
    summary = summary_of(model, trajectories, reduction, validation, provenance)
    files: dict[str, bytes] = {}
    images = {}
    formats = [str(name) for name in config.report.formats]
    for name, draw in registry.figure.items():
        encoded = render(draw, data, sorted({*formats, "svg"}))
        if not encoded:
            continue
        images[name] = ((draw.__doc__ or name).strip(), encoded["svg"])
        files |= {f"figures/{name}.{kind}": encoded[kind] for kind in formats}
    tables = {name: make(data) for name, make in registry.table.items()}
    for name, made in tables.items():
        files[f"tables/{name}.csv"] = made.to_csv().encode()
        files[f"tables/{name}.tex"] = made.to_latex().encode()
    files["index.html"] = render_page(data, summary, images, tables).encode()
    return Report(summary, files)


def _gather(
    config: Config,
    model: Model,
    trajectories: Trajectories | None,
    samples: Samples,
    reduction: Reduction,
    validation: Validation,
) -> ReportData:
    selected = validation.selected
    subset = reduction.heuristics[selected.heuristic].subset(selected.n)
    column = reduction.standard(subset, selected.values)
    shown = samples.validation if samples.validation is not None else samples.estimation
    motion = first_motion(shown.blocks(), column, reduction.nominal_torque)
    return ReportData(
        title=config.report.title or config.robot,
        model=model,
        trajectories=trajectories,
        setup=_setup(config),
        reduction=reduction,
        validation=validation,
        motion=motion,
        skeletons=tuple(_skeleton(model, q) for q in _shown_poses(config, model, motion)),
        tracking=_tracking(config, model, reduction, validation, motion),
    )


def _tracking(
    config: Config, model: Model, reduction: Reduction, validation: Validation, motion: Motion
) -> Tracking | None:
    section = config.report.tracking
    if section is None:
        return None
    return tracked(section, model, reduction, validation, motion)


def _shown_poses(config: Config, model: Model, motion: Motion) -> list[FloatArray]:
    if config.report.poses is not None:
        wanted = np.array([config.per_joint(pose) for pose in config.report.poses])
        coordinates = Coordinates(model.mechanism, once=True)
        try:
            return [coordinates.states(*[z[None]] * 3)[0][0] for z in wanted]
        except DataError as error:
            raise ConfigError(f"report.poses: {error}") from error
    picks = np.linspace(0, motion.time.size, _POSES, endpoint=False).astype(int)
    return [motion.q[k] for k in picks]


def _skeleton(model: Model, q: FloatArray) -> Skeleton:
    mechanism = model.mechanism
    poses = body_poses(mechanism, q)
    joints = [
        body.before if body.parent == BASE else poses[body.parent] @ body.before
        for body in mechanism.bodies
    ]
    standard = model.values.reshape(len(mechanism.inertial), -1)
    m = np.where(standard[:, :1] > 0, standard[:, :1], np.nan)
    own = poses[list(mechanism.inertial)]
    centres = np.full((len(mechanism.bodies), 3), np.nan)
    centres[list(mechanism.inertial)] = own[:, :3, 3] + np.einsum(
        "kij,kj->ki", own[:, :3, :3], standard[:, 1:4] / m
    )
    return Skeleton(
        z=q[list(mechanism.independent)],
        poses=poses,
        masses=centres,
        joints=np.array(joints),
        parents=tuple(body.parent for body in mechanism.bodies),
        kinds=tuple(_drawn_as(body) for body in mechanism.bodies),
        closures=tuple(_closure_path(mechanism, poses)),
    )


def _drawn_as(body: Body) -> str:
    """How a joint is drawn; slides inside a free joint are no parts of the mechanism."""
    inside = body.massless and ":" in body.name and body.joint == "prismatic"
    return "hidden" if inside else body.joint


def _closure_path(mechanism: Mechanism, poses: FloatArray) -> Iterator[FloatArray]:
    """From body to body by way of each closure; ends on the base are left out."""
    for closure in mechanism.loops.closures if mechanism.loops is not None else ():
        points: list[FloatArray] = []
        for body, frame in zip(closure.bodies, closure.frames, strict=True):
            pose = np.eye(4) if body == BASE else poses[body]
            way = [pose[:3, 3], (pose @ frame)[:3, 3]]
            ends = way[1:] if body == BASE else way
            points += ends if not points else ends[::-1]
        yield np.array(points)


def _setup(config: Config) -> TrajectorySetup:
    t = config.trajectories
    n = config.n_dof

    def spread(values: object) -> str:
        array = np.atleast_2d(np.array(values, dtype=float))
        return "; ".join(" ".join(f"{v:.4g}" for v in row) for row in array)

    rows = [
        ("criterion", f"{t.criterion}, {t.scaling}"),
        ("actuated joints", str(n)),
        ("harmonics", str(t.harmonics)),
        ("trajectory parameters", str(n * (1 + 2 * t.harmonics))),
        ("grid points", str(t.points)),
        ("period, s", f"{t.period:.6g}"),
        ("position limits, rad or m", spread(t.position_limits)),
        ("velocity limits, rad/s or m/s", spread(t.velocity_limits)),
        ("estimation trajectories", str(t.count)),
        ("validation trajectories", str(t.validation_count)),
        ("every joint uses its range", "yes" if t.use_full_range else "no"),
    ]
    if t.acceleration_limits is not None:
        rows.append(("acceleration limits, rad/s² or m/s²", spread(t.acceleration_limits)))
    for c in t.constraints:
        low = "" if c.min is None else f"{c.min:.4g} ≤ "
        high = "" if c.max is None else f" ≤ {c.max:.4g}"
        rows.append((f"{c.quantity} {c.name}", f"{low}{c.name}{high}"))
    if config.sampling.symmetries:
        rows.append(
            ("estimation set completed by symmetries", str(len(config.sampling.symmetries)))
        )
    if t.file is not None:
        rows.append(("coefficients brought in", t.file.name))
    return TrajectorySetup(tuple(rows))
