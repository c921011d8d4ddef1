"""The stage report: figures, tables, the page and summary.json."""

import warnings
from collections.abc import Mapping
from typing import Any

import numpy as np

from paramreduce_cli.config.schema import (
    ReductionSection,
    ReportSection,
    SamplingSection,
    SelectedSection,
    SimulationSection,
)
from paramreduce_cli.errors import ConfigError, DataError, FormulationError, ParamreduceWarning
from paramreduce_cli.excitation.manoeuvres import draw_manoeuvres
from paramreduce_cli.export.code_generation import make_exported_model
from paramreduce_cli.export.exported_model import ExportedModel
from paramreduce_cli.export.languages import languages
from paramreduce_cli.export.named_models import find_chosen_model
from paramreduce_cli.export.running import (
    CompiledModel,
    RunningModel,
    compile_model,
    evaluate_loops,
    make_forward_dynamics,
    measure_speeds,
)
from paramreduce_cli.fields.section import expand_per_joint
from paramreduce_cli.judgement.leanest import find_leanest
from paramreduce_cli.judgement.verdict import find_unsafe_models
from paramreduce_cli.multibody.loops.coordinates import Coordinates
from paramreduce_cli.records import (
    SETS,
    Artifacts,
    CountedDynamics,
    FloatArray,
    LoopEvaluation,
    Model,
    Progress,
    Provenance,
    Reduction,
    Report,
    Run,
    Samples,
    Selected,
    SignalTables,
    SimulatedManoeuvre,
    Tracking,
    Validation,
)
from paramreduce_cli.reduction.models import make_full_model
from paramreduce_cli.registry import Registry
from paramreduce_cli.report.data import (
    ReportData,
    ShownMotion,
    downsample_motions,
    find_first_motion,
)
from paramreduce_cli.report.figures import figures
from paramreduce_cli.report.page_sections import get_place
from paramreduce_cli.report.skeleton import (
    Animation,
    Skeleton,
    hold_travel,
    make_animation,
    make_skeleton,
)
from paramreduce_cli.report.summary import gather_summary
from paramreduce_cli.report.tables import tables
from paramreduce_cli.report.tracking.demonstration import simulate_tracking
from paramreduce_cli.resources.memory import release_memory
from paramreduce_cli.texts import format_percent
from paramreduce_cli.texts.latex_table import format_latex_table

_POSES = 3
_MOTIONS, _FRAMES = 40, 1200
"""Motions of each set that are animated at most, and poses of all of them together."""
_STRAYED = 0.05
"""Deviation of the positions in a simulated manoeuvre that a warning is given from."""
_ANIMATED = 100_000
"""Samples of a set from which on its first motion alone is animated: finding the others would take long."""


def report(
    section: ReportSection,
    sampling: SamplingSection,
    search: ReductionSection,
    limits: SelectedSection,
    counted: CountedDynamics,
    artifacts: Artifacts,
    samples: Samples,
    signals: SignalTables | None,
    provenance: Provenance,
    run: Run,
) -> Report:
    """Draw figures, make tables and write the page and summary.json.

    The samples may be user-supplied; without a model the sections on the mechanism are left out. Figures are SVG;
    --set report.formats=pdf,png draws other formats instead.
    """
    # Late: every command that knows the stages would load Matplotlib and Jinja otherwise.
    from paramreduce_cli.report.figure_rendering import render_figures
    from paramreduce_cli.report.page import render_page

    model, reduction, validation = artifacts.model, artifacts.reduction, artifacts.validation
    selected = validation.selected
    judged = validation.heuristics[selected.heuristic]
    shown = samples.validation if samples.validation is not None else samples.estimation
    motion = find_first_motion(shown.iterate_blocks(), selected.model)
    exported = _export_selected(model, reduction, validation, provenance)
    compiled = _compile_models(model, selected, exported)
    running, direct = (
        {title: RunningModel(one, name) for title, one in compiled.items()}
        for name in ("inverse_dynamics", "direct_dynamics")
    )
    states = {} if model is None else _compute_states(model, motion)
    data = ReportData(
        **vars(artifacts),
        title=section.title or provenance.robot,
        symmetries=len(sampling.symmetries),
        weighting=search.weighting,
        counted=counted,
        simulated=sampling.simulation is not None,
        rms_torque=_compute_torque_rms(samples, reduction.nominal_torque),
        motion=motion,
        skeletons=() if model is None else _draw_skeletons(section, model, motion),
        animation=None if model is None else _make_animation(model, samples),
        unsafe=bool(find_unsafe_models(validation.full, judged)[judged.find_row(selected.n)]),
        speed=measure_speeds(running, states) if running else None,
        speed_direct=measure_speeds(direct, states) if direct else None,
        loops=_evaluate_loops(model, compiled, motion),
        tracking=_simulate_tracking(section, model, running, motion),
        manoeuvre=_simulate_manoeuvre(sampling.simulation, model, compiled, selected, signals),
    )
    lean = {
        name: found
        for name in (("inverse", "direct") if model is not None else ())
        if (found := find_leanest(name, limits, validation.heuristics, artifacts.terms)) is not None
    }
    summary = gather_summary(artifacts, lean, data.loops, data.manoeuvre, provenance)
    formats = [str(name) for name in section.formats]
    drawn = [name for name, _ in _list_shown(figures, model)]

    def report_progress(done: int, name: str = "") -> None:
        run.progress(Progress("figures, tables and page", done, len(drawn) + 1, name))

    report_progress(0)
    release_memory()
    encoded = render_figures(
        drawn, data, sorted({*formats, "svg"}), jobs=run.jobs, on_figure=report_progress
    )
    images = {name: one["svg"] for name, one in encoded.items()}
    files = {
        f"figures/{name}.{kind}": one[kind] for name, one in encoded.items() for kind in formats
    }
    every = ((name, make(data)) for name, make in _list_shown(tables, model))
    made = {name: table for name, table in every if table.rows}
    symbols = {} if model is None else model.mechanism.symbols
    for name, table in made.items():
        files[f"tables/{name}.csv"] = table.to_csv().encode()
        files[f"tables/{name}.tex"] = format_latex_table(table, symbols).encode()
    files["index.html"] = render_page(
        data,
        summary,
        images,
        made,
        provenance,
        {} if exported is None else languages["c"](exported),
    ).encode()
    report_progress(len(drawn) + 1)
    return Report(summary, files)


def _list_shown(offered: Registry, model: Model | None) -> list[tuple[str, Any]]:
    """Return figures or tables by name, without those of a mechanism if there is none."""
    return [
        (name, draw)
        for name, draw in offered.items()
        if model is not None or not get_place(draw).of_mechanism
    ]


def _compile_models(
    model: Model | None, selected: Selected, exported: ExportedModel | None
) -> dict[str, CompiledModel]:
    """Return the code of the full and of the selected model, compiled; nothing if a formulation fails."""
    if model is None or exported is None:
        return {}
    try:
        full = compile_model(model, make_full_model(model))
        reduced = CompiledModel(model.mechanism, exported)
        return {"full model": full, f"{selected.n} parameters": reduced}
    except FormulationError as error:
        warnings.warn(f"nothing is timed: {error}", ParamreduceWarning, stacklevel=2)
        return {}


def _compute_states(model: Model, motion: ShownMotion) -> dict[str, FloatArray]:
    """Return the inputs of exported functions along a motion."""
    mechanism = model.mechanism
    if mechanism.loops is None:
        return {"q": motion.z, "dq": motion.dz, "ddq": motion.ddz}
    coordinates = Coordinates(mechanism)
    dq, ddq = coordinates.compute_rates(motion.q, motion.dz, motion.ddz)
    dependent = list(mechanism.dependent)
    R = coordinates.compute_tangent(motion.q)[:, dependent]
    b = coordinates.compute_rates(motion.q, motion.dz, np.zeros_like(motion.ddz))[1][:, dependent]
    return {"q": motion.q, "dq": dq, "ddq": ddq, "R": R, "b": b}


def _evaluate_loops(
    model: Model | None, compiled: Mapping[str, CompiledModel], motion: ShownMotion
) -> LoopEvaluation | None:
    """Return the operations and the time of the kinematics of loops, or None without loops."""
    if model is None or model.mechanism.loops is None or not compiled:
        return None
    return evaluate_loops(compiled, motion.q, motion.dz, motion.ddz)


def _simulate_tracking(
    section: ReportSection,
    model: Model | None,
    running: Mapping[str, RunningModel],
    motion: ShownMotion,
) -> Tracking | None:
    """Return the tracking of a controller with the full and with the selected model, or None if it is not asked for."""
    if section.tracking is None or model is None or not running:
        return None
    return simulate_tracking(section.tracking, model, running, motion.z, motion.dz)


def _simulate_manoeuvre(
    section: SimulationSection | None,
    model: Model | None,
    compiled: Mapping[str, CompiledModel],
    selected: Selected,
    signals: SignalTables | None,
) -> SimulatedManoeuvre | None:
    """Return a manoeuvre of the full and of the selected model; None where samples are not simulated.

    Where the selected model cannot be simulated, a warning says why.
    """
    if section is None or model is None or not compiled:
        return None
    name = "test" if section.test_runs else "validation"
    tables = signals or SignalTables({})
    manoeuvre = next(draw_manoeuvres(section, model.mechanism, tables, name))
    values = model.values, selected.model.standard
    try:
        full, reduced = (
            manoeuvre.simulate(make_forward_dynamics(one, standard))
            for one, standard in zip(compiled.values(), values, strict=True)
        )
    except DataError as error:
        text = f"the selected model cannot be simulated in the first manoeuvre of the {name} set: {error}"
        warnings.warn(text, ParamreduceWarning, stacklevel=2)
        return None
    free = manoeuvre.inputs.free
    names = model.mechanism.coordinate_names
    motions = (
        {"position": motion.z[:, free], "acceleration": motion.ddz[:, free]}
        for motion in (full, reduced)
    )
    result = SimulatedManoeuvre(name, tuple(names[k] for k in free), manoeuvre.time, *motions)
    _warn_of_straying(result)
    return result


def _warn_of_straying(manoeuvre: SimulatedManoeuvre) -> None:
    """Warn if the selected model strays far from the full one, as small errors add up over time."""
    deviations = manoeuvre.compute_deviations("position")
    if manoeuvre.compute_error("position") > _STRAYED:
        worst = int(deviations.argmax())
        text = (
            f"in a simulated manoeuvre the positions of the selected model stray by {format_percent(manoeuvre.compute_error('position'))} "
            f"from those of the full one, {manoeuvre.names[worst]} by {format_percent(float(deviations[worst]))}. Lower "
            "selected.acceleration_error or selected.torque_error for a model that follows."
        )
        warnings.warn(text, ParamreduceWarning, stacklevel=3)


def _export_selected(
    model: Model | None, reduction: Reduction, validation: Validation, provenance: Provenance
) -> ExportedModel | None:
    """Return the selected model, checked and ready to be written as code; None without a mechanism."""
    if model is None:
        return None
    chosen, title = find_chosen_model(None, model, reduction, validation)
    origin = f"report of config {provenance.config_sha256[:12]}"
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ParamreduceWarning)  # the header says it too
            return make_exported_model(
                model, chosen, title=title, validation=validation, origin=origin
            )
    except FormulationError as error:
        warnings.warn(f"the page has no code: {error}", ParamreduceWarning, stacklevel=2)
        return None


def _compute_torque_rms(samples: Samples, nominal: FloatArray) -> dict[str, FloatArray]:
    """Return the root mean square of each joint's torques in each set, (n_dof,); at least a tiny fraction of the
    nominal torque, 0 where torques are not measured.

    Args:
        samples: Samples of the sets.
        nominal: Nominal torques, (n_dof,), infinite where torques are not measured.
    """
    found = {}
    for name in SETS:
        one = getattr(samples, name)
        if one is not None:
            squares = (one.compute_factors()[..., -1] ** 2).sum(axis=(0, 2)) / nominal**2
            least = np.maximum(squares, np.finfo(float).tiny)
            measured = np.where(np.isfinite(nominal), nominal, 0.0)
            found[name] = measured * np.sqrt(least / one.n_samples)
    return found


def _make_animation(model: Model, samples: Samples) -> Animation:
    """Return the animation of the motions of both sets."""
    sets = [part for part in (samples.validation, samples.estimation) if part is not None]
    short = all(part.n_samples <= _ANIMATED for part in sets)
    return make_animation(model, downsample_motions(samples, _MOTIONS if short else 1, _FRAMES))


def _draw_skeletons(
    section: ReportSection, model: Model, motion: ShownMotion
) -> tuple[Skeleton, ...]:
    """Return the mechanism in the poses that are drawn."""
    poses = np.array(_choose_poses(section, model, motion))
    return tuple(make_skeleton(model, q) for q in hold_travel(model.mechanism, poses))


def _choose_poses(section: ReportSection, model: Model, motion: ShownMotion) -> list[FloatArray]:
    """Return the poses that the config names, or some along the motion.

    Raises:
        ConfigError: A pose of the config cannot be used.
    """
    if section.poses is not None:
        poses = [expand_per_joint(pose, model.mechanism.n_dof) for pose in section.poses]
        coordinates = Coordinates(model.mechanism, once=True)
        try:
            return [coordinates.compute_states(*[z[None]] * 3)[0][0] for z in poses]
        except DataError as error:
            raise ConfigError(str(error), ("report", "poses")) from error
    picks = np.linspace(0, motion.time.size, _POSES, endpoint=False).astype(int)
    return [motion.q[k] for k in picks]
