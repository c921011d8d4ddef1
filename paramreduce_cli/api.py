"""The pipeline from Python: stages as functions on records, and the contents of a results folder.

The functions call the stages that the commands call, with the sections of the config that these
name. Records are immutable dataclasses of NumPy arrays, documented in :mod:`paramreduce_cli.records`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from paramreduce_cli.artifacts.report_files import load_summary
from paramreduce_cli.artifacts.store import Store, load_file
from paramreduce_cli.config import Config
from paramreduce_cli.config import load_config as loaded_config
from paramreduce_cli.config.schema import Settings
from paramreduce_cli.errors import DataError, ParamreduceError
from paramreduce_cli.export.code_generation import Exported, adapt_kinds, make_exported_model
from paramreduce_cli.export.languages import languages
from paramreduce_cli.multibody.dynamics import Dynamics
from paramreduce_cli.records import (
    FloatArray,
    Identification,
    MeasuredLog,
    Model,
    Progress,
    ReducedModel,
    Reduction,
    Report,
    Run,
    Samples,
    TermReduction,
    Trajectories,
    Validation,
)
from paramreduce_cli.reduction.models import make_base_model as base_model
from paramreduce_cli.reduction.models import make_full_model as full_model
from paramreduce_cli.reduction.models import make_reduced_model
from paramreduce_cli.report.data_frames import make_data_frame as frame
from paramreduce_cli.report.notebook import format_results_html
from paramreduce_cli.running.in_memory import run_in_memory
from paramreduce_cli.running.pipeline import find_maker, list_stages_to_run
from paramreduce_cli.running.runner import Callbacks, Runner, format_arguments, make_provenance

__all__ = [
    "Config",
    "ParamreduceError",
    "Results",
    "base_model",
    "build_model",
    "chosen",
    "code",
    "frame",
    "full_model",
    "identify",
    "inverse_dynamics",
    "load_config",
    "make_report",
    "open_results",
    "optimize_trajectories",
    "process_log",
    "reduce",
    "reduce_terms",
    "run",
    "sample",
    "validate",
]


def load_config(path: Path | str, overrides: Sequence[str] = ()) -> Config:
    """Return the config of a robot from its YAML file.

    Args:
        path: YAML file.
        overrides: ``key.key=value`` texts that replace what the file says.

    Raises:
        ParamreduceError: With all that is wrong, one problem a line.
    """
    return loaded_config(Path(path), overrides)


def build_model(config: Config, log: MeasuredLog | None = None) -> Model:
    """Derive a robot's model, its parameters and its base parameters.

    Args:
        config: Config from :func:`load_config`.
        log: Log from :func:`process_log`, which decides on friction that the config leaves to it (``friction: auto``).

    Raises:
        ParamreduceError: The config describes no mechanism that can be.
    """
    return _run_stage(Model, config, log)


def optimize_trajectories(config: Config, model: Model, *, jobs: int = 1) -> Trajectories:
    """Find exciting trajectories, or take those that the config names.

    Args:
        config: Config; its section is ``trajectories``.
        model: Model from :func:`build_model`.
        jobs: Number of worker processes, as --jobs; 1 works in this process. With more, a script needs
            ``if __name__ == "__main__":``. The results do not depend on it.
    """
    return _run_stage(Trajectories, config, model, jobs=jobs)


def process_log(config: Config) -> MeasuredLog:
    """Process the logs that ``sampling.log`` names: clean, filter, differentiate and split them."""
    return _run_stage(MeasuredLog, config)


def sample(
    config: Config, model: Model, source: Trajectories | MeasuredLog | None = None
) -> Samples:
    """Sample the estimation, validation and test set.

    Args:
        config: Config; its section is ``sampling``.
        model: Model from :func:`build_model`.
        source: Trajectories or a log; None for recordings that the config names.

    Returns:
        Samples whose sets are computed block by block whenever they are read.
    """
    return _run_stage(Samples, config, model, source)


def reduce(
    samples: Samples, config: Config | None = None, model: Model | None = None, *, jobs: int = 1
) -> Reduction:
    """Select parameters with each heuristic, for every number of them.

    Args:
        samples: Samples from :func:`sample`, or user-supplied ones.
        config: Config; its section is ``reduction``. Defaults if None.
        model: Model of the robot, for criteria that need one.
        jobs: Number of worker processes and threads, as --jobs.
    """
    return _run_stage(Reduction, config or Settings(), samples, model, jobs=jobs)


def reduce_terms(
    config: Config, model: Model, samples: Samples, reduction: Reduction, *, jobs: int = 1
) -> TermReduction:
    """Prune negligible terms of the functions of reduced models, and fit the rest."""
    return _run_stage(TermReduction, config, model, samples, reduction, jobs=jobs)


def validate(
    samples: Samples,
    reduction: Reduction,
    config: Config | None = None,
    model: Model | None = None,
    *,
    jobs: int = 1,
) -> Validation:
    """Compute errors and costs of all reduced models on all sets, and select one.

    Args:
        samples: Samples of all sets.
        reduction: Subsets from :func:`reduce`.
        config: Config; its sections are ``selected`` and ``validation``. Defaults if None.
        model: Model of the robot; without it only torque errors are computed.
        jobs: Number of worker processes and threads, as --jobs; with more than 1, a script needs
            ``if __name__ == "__main__":``.
    """
    return _run_stage(Validation, config or Settings(), samples, reduction, model, jobs=jobs)


def identify(
    config: Config,
    model: Model,
    samples: Samples,
    validation: Validation,
    log: MeasuredLog | None = None,
) -> Identification:
    """Identify base parameters and those of the selected model from measured torques."""
    return _run_stage(Identification, config, model, samples, validation, log)


def make_report(
    samples: Samples,
    reduction: Reduction,
    validation: Validation,
    config: Config | None = None,
    model: Model | None = None,
    *more: Trajectories | TermReduction | MeasuredLog | Identification,
) -> Report:
    """Make the page, figures, tables and the summary.

    Args:
        samples: Samples of all sets.
        reduction: Subsets from :func:`reduce`.
        validation: Errors from :func:`validate`.
        config: Config; its section is ``report``. Defaults if None.
        model: Model of the robot; without it sections of a mechanism are missing.
        more: Further records: trajectories, pruned functions, a log, identified values.

    Returns:
        Report with files by their path, and the summary as a mapping.
    """
    settings = config or Settings()
    robot = "" if model is None else model.mechanism.robot
    records = (
        samples,
        reduction,
        validation,
        model,
        *more,
        make_provenance(settings, robot, {}, {}, ""),
    )
    return _run_stage(Report, settings, *records)


def chosen(
    reduction: Reduction, heuristic: str, n: int, model: Model | None = None
) -> ReducedModel:
    """Return a reduced model by heuristic and size.

    Args:
        reduction: Subsets from :func:`reduce`.
        heuristic: Name of the heuristic, such as ``swap`` or ``swap@operations``.
        n: Number of parameters.
        model: Model of the robot, whose values order the expressions of the parameters.

    Raises:
        KeyError: There is no such model; the message lists the models there are.
    """
    subsets = reduction.heuristics[heuristic]
    row = subsets.find_row(n)
    if row is None:
        sizes = ", ".join(map(str, subsets.n.tolist()))
        raise KeyError(f"{heuristic} has no model with {n} parameters. Choose from: {sizes}")
    return make_reduced_model(reduction, heuristic, row, None if model is None else model.values)


def code(
    model: Model,
    parameters: ReducedModel,
    language: str = "c",
    *,
    what: str | Sequence[str] = "both",
    title: str = "",
    name: str = "",
    constant: bool = False,
    single: bool = False,
    validation: Validation | None = None,
) -> dict[str, bytes]:
    """Return the files of a model in some language, checked against textbook recursion.

    Args:
        model: Model of the robot.
        parameters: Model from :func:`chosen`, :func:`full_model` or :func:`base_model`.
        language: Language: c, casadi, fmu, jax, latex, matlab, python, rust or torch.
        what: Functions, one or several of those that ``paramreduce export --what`` lists.
        title: Title of the model in the files; the number of its parameters if empty.
        name: Name that files and functions begin with; the robot's if empty.
        constant: Whether the values are part of the code.
        single: Whether numbers have single precision, in C and Rust.
        validation: Validation, for the ranges of motion in the header.

    Raises:
        KeyError: The language or a function is unknown; the message lists all.
        ParamreduceError: The functions differ from textbook recursion.
    """
    kinds = [what] if isinstance(what, str) else list(what)
    for kind in kinds:
        if kind not in list(Exported):
            raise KeyError(f"unknown function {kind!r}. Choose from: {', '.join(Exported)}")
    exported = make_exported_model(
        model, parameters, title=title or f"{parameters.n} parameters", what=adapt_kinds([Exported(kind) for kind in kinds], language), name=name,
        constant=constant, single=single, origin="from Python", validation=validation,
    )  # fmt: skip
    files: dict[str, bytes] = languages[language](exported)
    return files


def inverse_dynamics(
    model: Model, parameters: ReducedModel
) -> Callable[[FloatArray, FloatArray, FloatArray], FloatArray]:
    """Return the torques of a model as a function of a motion.

    Args:
        model: Model of the robot.
        parameters: Model from :func:`chosen`, :func:`full_model` or :func:`base_model`.

    Returns:
        Function of q, dq and ddq, (n_samples, n_q) each, rad or m and their rates; it returns torques,
        (n_samples, n_dof), N m or N.
    """
    regressor, standard = Dynamics(model.mechanism).compute_regressor, parameters.standard

    def torques(q: FloatArray, dq: FloatArray, ddq: FloatArray) -> FloatArray:
        """Return the torques of states, (n_samples, n_dof)."""
        arrays = [np.ascontiguousarray(x, dtype=float) for x in (q, dq, ddq)]
        _check_states(model, arrays)
        found: FloatArray = regressor(*arrays) @ standard
        return found

    return torques


def _check_states(model: Model, arrays: Sequence[FloatArray]) -> None:
    """Raise DataError if q, dq or ddq has the wrong shape."""
    names = model.mechanism.generalised_names
    for name, array in zip(("q", "dq", "ddq"), arrays, strict=True):
        if array.ndim != 2 or array.shape[1] != len(names) or array.shape != arrays[0].shape:
            raise DataError(
                f"{name} has the shape {array.shape}; it must be (n_samples, {len(names)}), a column for each of "
                f"{', '.join(names)}, as many rows as q."
            )


def run(
    config: Path | str,
    results: Path | str | None = None,
    overrides: Sequence[str] = (),
    *,
    jobs: int = 1,
    progress: Callable[[Progress], None] = lambda _: None,
) -> Results:
    """Run all stages in order, skipping what is up to date, as ``paramreduce run`` does.

    Args:
        config: YAML file of the robot.
        results: Folder of the artifacts; results/ROBOT if None.
        overrides: ``key.key=value`` texts that replace what the file says.
        jobs: Number of worker processes, as --jobs; 1 works in this process.
        progress: Progress callback.

    Raises:
        ParamreduceError: A stage fails; what was finished is kept.
    """
    loaded = load_config(config, overrides)
    store = Store(Path(results) if results is not None else Path("results") / loaded.robot)
    words = format_arguments(Path(config), None if results is None else Path(results), overrides)
    with store.lock():
        for stage in list_stages_to_run(loaded):
            Runner(loaded, store, jobs, Callbacks(progress), arguments=words).run(stage)
    return Results(store.folder)


def open_results(folder: Path | str) -> Results:
    """Return the records of a results folder, loaded when they are first asked for."""
    return Results(Path(folder))


@dataclass(frozen=True)
class Results:
    """A results folder; each record is read, and checked, when it is first asked for."""

    folder: Path

    @cached_property
    def summary(self) -> dict[str, Any]:
        """Contents of ``summary.json``."""
        return load_summary(self.folder)

    @cached_property
    def model(self) -> Model:
        """Model of the robot."""
        return self._record(Model)

    @cached_property
    def trajectories(self) -> Trajectories:
        """Trajectories of all sets."""
        return self._record(Trajectories)

    @cached_property
    def samples(self) -> Samples:
        """Samples of all sets, read from the file block by block."""
        return self._record(Samples)

    @cached_property
    def reduction(self) -> Reduction:
        """Subsets of all heuristics."""
        return self._record(Reduction)

    @cached_property
    def validation(self) -> Validation:
        """Errors and costs of all models, and the selected model."""
        return self._record(Validation)

    @cached_property
    def identification(self) -> Identification:
        """Values identified from measured torques."""
        return self._record(Identification)

    @cached_property
    def terms(self) -> TermReduction:
        """Functions with pruned terms."""
        return self._record(TermReduction)

    def _repr_html_(self) -> str:
        """Return the selected model and all heuristics at its size as HTML, for notebooks."""
        return format_results_html(self.summary)

    def _record(self, kind: type) -> Any:
        return load_file(Store(self.folder).get_path(kind), kind, None, find_maker(kind).name)[0]


def _run_stage(kind: type, config: Config | Settings, *records: Any, jobs: int = 1) -> Any:
    """Run the stage that makes a kind of record.

    Raises:
        TypeError: The config is neither a Config nor Settings.
    """
    stage = find_maker(kind)
    if not isinstance(config, Config | Settings):
        raise TypeError(
            f"{stage.function.__name__} takes a config, not {config!r:.80}; load_config(path) reads one"
        )
    given = {type(record): record for record in records if record is not None}
    return run_in_memory(stage, config, given, Run(jobs))
