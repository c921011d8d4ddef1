"""Runs stages: finds their inputs, skips what is up to date, writes what they make.

All it knows of a stage is its signature: a parameter's type says where the value comes
from, the return type which artifact is written.
"""

from __future__ import annotations

import dataclasses
import hashlib
import inspect
import json
import time
import types
import typing
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import casadi
import numpy
import scipy

from paramreduce_cli import __version__
from paramreduce_cli.artifacts.brought import load_coefficients, load_recording
from paramreduce_cli.artifacts.hdf5 import SCHEMA, Stamp
from paramreduce_cli.artifacts.store import LAYOUTS, Parts, Store, file_digest, file_of, load_file
from paramreduce_cli.config import Config, section_digest
from paramreduce_cli.errors import ParamreduceError
from paramreduce_cli.records import (
    Coefficients,
    Progress,
    Provenance,
    Recording,
    Recordings,
    Report,
    Run,
    Trajectories,
)
from paramreduce_cli.registry import stages

ARTIFACTS: tuple[type, ...] = (*LAYOUTS, Report)


@dataclass(frozen=True)
class StageInput:
    """One parameter of a stage."""

    name: str
    type: type
    optional: bool


@dataclass(frozen=True)
class Stage:
    """A declared stage as its signature describes it."""

    name: str
    function: Callable[..., Any]
    inputs: tuple[StageInput, ...]
    output: type

    @property
    def artifacts(self) -> list[StageInput]:
        """The inputs that other stages make."""
        return [entry for entry in self.inputs if entry.type in ARTIFACTS]


def describe_stage(name: str, function: Callable[..., Any]) -> Stage:
    """Read a stage's signature."""
    hints = typing.get_type_hints(function)
    output = hints.pop("return")
    inputs = []
    for parameter in inspect.signature(function).parameters:
        hint = hints[parameter]
        optional = isinstance(hint, types.UnionType)
        members = [a for a in typing.get_args(hint) if a is not type(None)] if optional else [hint]
        inputs.append(StageInput(parameter, members[0], optional))
    return Stage(name, function, tuple(inputs), output)


def pipeline() -> list[Stage]:
    """All stages, each after those whose artifacts it reads."""
    waiting = [describe_stage(name, function) for name, function in stages().items()]
    ordered: list[Stage] = []
    made: set[type] = set()
    while waiting:
        ready = [s for s in waiting if all(a.type in made for a in s.artifacts)]
        if not ready:
            raise ValueError(f"stages wait for each other: {[s.name for s in waiting]}")
        # Of several that are ready the one with the fewest needs is the earliest.
        ready.sort(key=lambda s: (len(s.artifacts), s.name))
        ordered.append(ready[0])
        made.add(ready[0].output)
        waiting.remove(ready[0])
    return ordered


def maker_of(record: type) -> str:
    """Name of the stage that makes a record."""
    return next(s.name for s in pipeline() if s.output is record)


class _Watched:
    """A config that notes which of its sections are read."""

    def __init__(self, config: Config) -> None:
        self._config = config
        self._seen: set[str] = set()

    def __getattr__(self, name: str) -> Any:
        if name in Config.model_fields:
            self._seen.add(name)
            return getattr(self._config, name)
        attribute = getattr(Config, name)
        if isinstance(attribute, property):
            assert attribute.fget is not None
            return attribute.fget(self)
        return types.MethodType(attribute, self)

    def digests(self) -> dict[str, str]:
        """Of the sections that were read."""
        return {name: _digest(section_digest(self._config, name)) for name in sorted(self._seen)}


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()


def versions() -> dict[str, str]:
    """Of this package and of the libraries that numbers depend on."""
    return {
        "paramreduce": __version__,
        "numpy": numpy.__version__,
        "scipy": scipy.__version__,
        "casadi": casadi.__version__,
    }


@dataclass(frozen=True)
class Outcome:
    """What became of one stage."""

    stage: str
    path: Path
    current: bool
    seconds: float
    record: Any = None


@dataclass
class Runner:
    """Runs stages on one robot in one folder.

    Attributes:
        config: None where a stage is run on brought files alone.
        store: The results folder.
        jobs: Worker processes.
        progress: Told of long work.
        samples: A samples.h5 brought by the user instead of the folder's own.
        remark: Told of things the user should know.
    """

    config: Config | None
    store: Store
    jobs: int = 1
    progress: Callable[[Progress], None] = lambda _: None
    samples: Path | None = None
    remark: Callable[[str], None] = lambda _: None
    _brought: dict[str, str] = field(default_factory=dict)

    def run(self, stage: Stage, *, force: bool = False) -> Outcome:
        """Run one stage, unless its artifact is up to date.

        Raises:
            ParamreduceError: Its inputs are missing or wrong, or it fails.
        """
        path = self.store.path(stage.output)
        if not force and self.is_current(stage):
            self.store.touch(stage.output)
            stamp = self.store.stamp(stage.output)
            return Outcome(stage.name, path, True, stamp.seconds if stamp else 0.0)
        started = time.perf_counter()
        watched = _Watched(self.config) if self.config is not None else None
        digests: dict[str, str] = {}
        arguments = {i.name: self._argument(i, watched, digests) for i in stage.inputs}
        parts = self._lend_run(stage, arguments, watched, digests)
        record = stage.function(**arguments)
        # Lazy records read the config while they are written, so sections are stamped twice.
        stamp = self._stamp(stage, watched, digests, started)
        self.store.save(record, stamp)
        if parts is not None:
            parts.clear()
        return Outcome(stage.name, path, False, time.perf_counter() - started, record)

    def is_current(self, stage: Stage) -> bool:
        """Whether a stage's artifact was made by this version from just these inputs."""
        stamp = self.store.stamp(stage.output)
        if stamp is None or self.config is None or self.samples is not None:
            return False
        if (stamp.schema, stamp.stage, stamp.robot) != (SCHEMA, stage.name, self.config.robot):
            return False
        if stamp.versions != versions():
            return False
        for name, digest in stamp.sections.items():
            if name not in Config.model_fields:
                return False
            if _digest(section_digest(self.config, name)) != digest:
                return False
        return stamp.inputs == self._input_digests(stage)

    def _input_digests(self, stage: Stage) -> dict[str, str]:
        digests: dict[str, str] = {}
        for entry in stage.inputs:
            if entry.type in ARTIFACTS:
                stamp = self.store.stamp(entry.type)
                if stamp is not None:
                    digests[file_of(entry.type)] = stamp.digest
            elif entry.type in (Coefficients, Recordings) and self.config is not None:
                for path in _brought_files(self.config, entry.type).values():
                    digests[str(path)] = file_digest(path)
        return digests

    def _argument(
        self, entry: StageInput, watched: _Watched | None, digests: dict[str, str]
    ) -> Any:
        if entry.type is Config:
            return watched
        if entry.type is Run:
            return None  # lent once all other inputs are known
        if entry.type is Provenance:
            return self._provenance()
        if entry.type is Coefficients:
            return self._coefficients(watched, digests)
        if entry.type is Recordings:
            return self._recordings(watched, digests)
        return self._artifact(entry, digests)

    def _artifact(self, entry: StageInput, digests: dict[str, str]) -> Any:
        brought = self.samples if file_of(entry.type) == "samples.h5" else None
        path = brought or self.store.path(entry.type)
        if entry.optional and (not path.exists() or self.config is None):
            return None
        robot = self.config.robot if self.config is not None and brought is None else None
        record, stamp = load_file(path, entry.type, robot, "" if brought else maker_of(entry.type))
        digests[file_of(entry.type)] = stamp.digest if stamp else file_digest(path)
        if stamp is not None and brought is None:
            self._remark_if_stale(entry.type, stamp)
        return record

    def _remark_if_stale(self, record: type, stamp: Stamp) -> None:
        assert self.config is not None
        changed = [
            name
            for name, digest in stamp.sections.items()
            if name in Config.model_fields and _digest(section_digest(self.config, name)) != digest
        ]
        if changed:
            self.remark(
                f"{self.store.path(record)} was made with another {', '.join(changed)} section; "
                "`paramreduce run` rebuilds it"
            )

    def _coefficients(
        self, watched: _Watched | None, digests: dict[str, str]
    ) -> Coefficients | None:
        assert self.config is not None and watched is not None
        _ = watched.trajectories
        files = _brought_files(self.config, Coefficients)
        for path in files.values():
            digests[str(path)] = file_digest(path)
            return load_coefficients(path)
        return None

    def _recordings(self, watched: _Watched | None, digests: dict[str, str]) -> Recordings:
        assert self.config is not None and watched is not None
        _ = watched.sampling
        found: dict[str, Recording | None] = {"estimation": None, "validation": None}
        for name, path in _brought_files(self.config, Recordings).items():
            digests[str(path)] = file_digest(path)
            found[name] = load_recording(path, self.config.n_dof)
        return Recordings(**found)

    def _lend_run(
        self,
        stage: Stage,
        arguments: dict[str, Any],
        watched: _Watched | None,
        digests: dict[str, str],
    ) -> Parts | None:
        lent = next((entry for entry in stage.inputs if entry.type is Run), None)
        if lent is None:
            return None
        assert self.config is not None and watched is not None
        # A part belongs to a run with the same settings, seed and inputs.
        _ = (watched.trajectories, watched.description)
        stamp = self._stamp(stage, watched, digests, time.perf_counter())
        folder = self.store.path(stage.output)
        parts = Parts(folder.with_name(f"{folder.name}.parts"), stamp)
        arguments[lent.name] = Run(self.jobs, parts, self.progress)
        return parts

    def _stamp(
        self, stage: Stage, watched: _Watched | None, digests: dict[str, str], started: float
    ) -> Stamp:
        return Stamp(
            schema=SCHEMA,
            robot=self.config.robot if self.config is not None else self.store.folder.name,
            stage=stage.name,
            versions=versions(),
            sections=watched.digests() if watched is not None else {},
            inputs=dict(digests),
            seed=self.config.trajectories.seed if self.config is not None else 0,
            seconds=time.perf_counter() - started,
        )

    def _provenance(self) -> Provenance:
        assert self.config is not None
        seconds = {}
        for stage in pipeline():
            stamp = self.store.stamp(stage.output)
            if stamp is not None and stage.output is not Report:
                seconds[stage.name] = stamp.seconds
        text = json.dumps(self.config.model_dump(mode="json"), sort_keys=True)
        return Provenance(self.config.robot, _digest(text), versions(), seconds)


def _brought_files(config: Config, kind: type) -> dict[str, Path]:
    if kind is Coefficients:
        files = {"coefficients": config.trajectories.file}
    else:
        files = {
            "estimation": config.sampling.estimation_file,
            "validation": config.sampling.validation_file,
        }
    return {name: path for name, path in files.items() if path is not None}


def stages_to_run(config: Config) -> list[Stage]:
    """The stages of a full run: without trajectories where both sets are recordings."""
    recorded = len(_brought_files(config, Recordings)) == 2
    return [s for s in pipeline() if not (recorded and s.output is Trajectories)]


def check_accepted(record: Any) -> tuple[bool, str] | None:
    """The verdict that a record carries, if it carries one."""
    if dataclasses.is_dataclass(record) and hasattr(record, "accepted"):
        return bool(record.accepted), str(record.verdict)
    return None


__all__ = [
    "ARTIFACTS",
    "Outcome",
    "ParamreduceError",
    "Runner",
    "Stage",
    "check_accepted",
    "pipeline",
    "stages_to_run",
]
