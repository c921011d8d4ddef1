"""report: figures, tables, the page and summary.json."""

from __future__ import annotations

import numpy as np

from paramreduce_cli import registry
from paramreduce_cli.config import Config
from paramreduce_cli.multibody.kinematics import body_poses
from paramreduce_cli.records import (
    BASE,
    FloatArray,
    Model,
    Provenance,
    Reduction,
    Report,
    Samples,
    Trajectories,
    Validation,
)
from paramreduce_cli.reduction.fitting import model_column
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
    ordering = reduction.orderings[selected.heuristic]
    column = model_column(ordering.subset(selected.n), selected.values, len(reduction.names))
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
        skeletons=tuple(_skeleton(model, z) for z in _shown_poses(config, motion)),
    )


def _shown_poses(config: Config, motion: Motion) -> list[FloatArray]:
    if config.report.poses is not None:
        return [config.per_joint(pose) for pose in config.report.poses]
    picks = np.linspace(0, motion.time.size, _POSES, endpoint=False).astype(int)
    return [motion.z[k] for k in picks]


def _skeleton(model: Model, z: FloatArray) -> Skeleton:
    mechanism = model.mechanism
    poses = body_poses(mechanism, z)
    joints = [
        body.before if body.parent == BASE else poses[body.parent] @ body.before
        for body in mechanism.bodies
    ]
    standard = model.values.reshape(len(mechanism.bodies), -1)
    m = np.where(standard[:, :1] > 0, standard[:, :1], np.nan)
    centres = np.einsum("kij,kj->ki", poses[:, :3, :3], standard[:, 1:4] / m) + poses[:, :3, 3]
    return Skeleton(
        z=z,
        poses=poses,
        masses=centres,
        joints=np.array(joints),
        parents=tuple(body.parent for body in mechanism.bodies),
        kinds=tuple(body.joint for body in mechanism.bodies),
    )


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
    if t.file is not None:
        rows.append(("coefficients brought in", t.file.name))
    return TrajectorySetup(tuple(rows))
