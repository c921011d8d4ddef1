"""Runs stages: finds their inputs, skips what is up to date, writes what they make.

All it knows of a stage is its signature: a parameter's type says where the value comes
from, the return type which artifact is written.
"""

import hashlib
import importlib.metadata
import json
import shlex
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

from paramreduce_cli import __version__
from paramreduce_cli.artifacts.hdf5 import SCHEMA, Stamp
from paramreduce_cli.artifacts.store import Store, check_schema, file_digest, file_of, load_file
from paramreduce_cli.artifacts.stored_items import StoredItems
from paramreduce_cli.config import Config
from paramreduce_cli.config.checks import find_warnings
from paramreduce_cli.config.schema import Settings
from paramreduce_cli.config.sections import digest_section, digest_sections, get_section, is_section
from paramreduce_cli.errors import ArtifactError
from paramreduce_cli.records import (
    WHOLE,
    Items,
    Part,
    PartFinished,
    Progress,
    Provenance,
    Report,
    Run,
    Samples,
    Tell,
)
from paramreduce_cli.running.pipeline import (
    LENT,
    Stage,
    StageInput,
    maker_of,
    pipeline,
    stages_to_run,
)
from paramreduce_cli.running.stage_inputs import OUTSIDE, Inputs, called, noted_warnings


def provenance(
    wanted: Config | Settings,
    robot: str,
    seconds: Mapping[str, float],
    warnings: Mapping[str, Sequence[str]],
    asked: str,
) -> Provenance:
    """Where results come from, whatever ran the stages.

    Args:
        wanted: What was asked for.
        robot: Its name.
        seconds: That stages took, by name.
        warnings: That stages gave, by name.
        asked: See :class:`Provenance`.
    """
    text = json.dumps(wanted.model_dump(mode="json"), sort_keys=True)
    digest = hashlib.sha256(text.encode()).hexdigest()
    changed = wanted.model_dump(mode="json", exclude_defaults=True)
    if isinstance(wanted, Config):
        warnings = {"config": find_warnings(wanted), **warnings}
    return Provenance(robot, digest, versions(), seconds, warnings, asked, changed)


@cache
def versions() -> dict[str, str]:
    """Of this package and of the libraries that numbers depend on."""
    return {"paramreduce": __version__} | {
        name: importlib.metadata.version(name) for name in ("numpy", "scipy", "casadi")
    }


@dataclass(frozen=True)
class Outcome:
    """What became of one stage."""

    stage: str
    path: Path
    current: bool
    seconds: float
    record: Any = None


def asked(config: Path | None, results: Path | None, overrides: Sequence[str]) -> str:
    """The arguments that name a run at the shell, for commands that are to follow it."""
    words = [str(config)] if config is not None else []
    words += ["--results", str(results)] if results is not None else []
    words += [word for text in overrides for word in ("--set", text)]
    return shlex.join(words)


@dataclass(frozen=True)
class Callbacks:
    """Functions that a run calls."""

    progress: Callable[[Progress], None] = lambda _: None
    """Called with each step of long work."""
    warn: Callable[[str], None] = lambda _: None
    """Called with things the user should know."""
    interrupted: Callable[[], None] = lambda: None
    """Called where a stage has met Ctrl-C and ends early, but whole."""
    check: Callable[[], None] = lambda: None
    """Called before anything is written; raises a KeyboardInterrupt that a library swallowed, which may have spoilt
    what was computed."""


@dataclass
class Runner:
    """Runs stages on one robot in one folder.

    Attributes:
        config: None where a stage is run on brought files alone.
        store: The results folder.
        jobs: Worker processes.
        callbacks: Functions that a run calls.
        samples: A samples.h5 brought by the user instead of the folder's own.
        settings: What is asked where there is no config.
        asked: Config and options that name the run at the shell.
    """

    config: Config | None
    store: Store
    jobs: int = 1
    callbacks: Callbacks = Callbacks()
    samples: Path | None = None
    settings: Settings | None = None
    asked: str = ""
    _cut_short: bool = field(default=False, init=False)
    """Whether Ctrl-C has ended a search of the stage at hand."""

    def run(
        self, stage: Stage, *, force: bool = False, go_on: bool = False, part: Part = WHOLE
    ) -> Outcome:
        """Run one stage, unless its artifact is up to date, or do a part of its items.

        Args:
            stage: Which one.
            force: Run it even so, and do finished items again.
            go_on: Run it also where more time could make its artifact better.
            part: Items to be done; the artifact is made only where they are all items.

        Raises:
            ParamreduceError: Its inputs are missing or wrong, or it fails.
        """
        path = self.store.path(stage.output)
        self._cut_short = False
        self.store.refuse_to_replace(stage.output, self._robot)
        self._look_at_inputs(stage)
        previous = self._previous(stage)
        better = go_on and getattr(previous, "unfinished", False)
        if not force and not better and self.is_current(stage):
            return self._current_outcome(stage, part)
        started = time.perf_counter()
        inputs = Inputs(self.config, self.callbacks.progress)
        lent_types = (*LENT, stage.output)
        arguments = {
            i.name: self._argument(i, inputs) for i in stage.inputs if i.type not in lent_types
        }
        with noted_warnings() as warnings:

            def stamp(seconds: float) -> Stamp:
                return self._stamp(stage, inputs, seconds, warnings)

            kept = StoredItems(path, stamp, from_start=force, check=self.callbacks.check)
            earlier = kept.stamps() if part.is_whole else []
            said = dict.fromkeys(text for one in earlier for text in one.warnings)
            for text in said:
                self.callbacks.warn(text)
            unchanged = self._unchanged(stage, inputs) if previous and not force else frozenset()
            run = Run(self.jobs, self.callbacks.progress, self._cut, unchanged)
            lent = {
                Run: run,
                Tell: self.callbacks.progress,
                Items: Items(kept, part),
                stage.output: previous,
            }
            arguments |= {i.name: lent[i.type] for i in stage.inputs if i.type in lent}
            try:
                record = called(stage, arguments)
            except PartFinished:
                self.callbacks.check()
                seconds = time.perf_counter() - started
                return Outcome(stage.name, kept.folder, not kept.written, seconds)
        self.callbacks.check()
        seconds = time.perf_counter() - started
        total = seconds + sum(one.seconds for one in earlier)
        texts = tuple(dict.fromkeys([*said, *warnings]))
        self.store.save(record, self._stamp(stage, inputs, total, texts))
        kept.clear()
        return Outcome(stage.name, path, False, time.perf_counter() - started, record)

    def _current_outcome(self, stage: Stage, part: Part) -> Outcome:
        """Say again what is still true of an artifact that is up to date."""
        path = self.store.path(stage.output)
        stamp = self.store.stamp(stage.output)
        assert stamp is not None, "an artifact that is up to date has one"
        if part.is_whole:
            StoredItems(
                path, lambda _: stamp
            ).clear()  # of jobs that ended after the artifact was combined
            self.store.touch(stage.output)
            for text in stamp.warnings:
                self.callbacks.warn(text)
        return Outcome(stage.name, path, True, stamp.seconds)

    def _previous(self, stage: Stage) -> Any:
        """What this version of the stage has made before, None if there is nothing to go on from."""
        stamp = self.store.stamp(stage.output)
        known = stamp is not None and (stamp.schema, stamp.versions) == (SCHEMA, versions())
        if stage.previous is None or not known:
            return None
        try:
            path = self.store.path(stage.output)
            return load_file(path, stage.output, self._robot, stage.name)[0]
        except ArtifactError:  # damaged: it is made again
            return None

    def is_current(self, stage: Stage) -> bool:
        """Whether a stage's artifact was made by this version from just these inputs."""
        stamp = self.store.stamp(stage.output)
        if stamp is None or stamp.cut_short or self.config is None or self.samples is not None:
            return False
        made = (stamp.schema, stamp.stage, stamp.robot, stamp.versions)
        if made != (SCHEMA, stage.name, self.config.robot, versions()):
            return False
        if self._changed_sections(stamp) or stamp.inputs != self._input_digests(stage):
            return False
        return self.store.is_whole(stage.output)

    def made_otherwise(self, stage: Stage) -> bool:
        """Whether a stage's artifact is there, made from other sections of the config."""
        stamp = self.store.stamp(stage.output)
        return self.config is not None and stamp is not None and bool(self._changed_sections(stamp))

    def _changed_sections(self, stamp: Stamp) -> list[str]:
        assert self.config is not None
        return [
            name
            for name, digest in stamp.sections.items()
            if digest_section(self.config, tuple(name.split("."))) != digest
        ]

    def _unchanged(self, stage: Stage, inputs: Inputs) -> frozenset[str]:
        """Sections and files that are what they were when the stage ran before."""
        stamp = self.store.stamp(stage.output)
        if stamp is None or self.config is None:
            return frozenset()
        sections = set(stamp.sections) - set(self._changed_sections(stamp))
        same = {name for name, digest in inputs.digests.items() if stamp.inputs.get(name) == digest}
        return frozenset(sections | same)

    def _input_digests(self, stage: Stage) -> dict[str, str]:
        inputs = Inputs(self.config)
        for entry in stage.inputs:
            if entry in stage.artifacts:
                stamp = self.store.stamp(entry.type)
                if stamp is not None:
                    inputs.digests[file_of(entry.type)] = stamp.digest
            else:
                inputs.files(entry.type)
        return inputs.digests

    def _argument(self, entry: StageInput, inputs: Inputs) -> Any:
        if is_section(entry.type):
            return get_section(self.config or self.settings, entry.type)
        if entry.type is Provenance:
            return self._provenance()
        if entry.type in OUTSIDE:
            return OUTSIDE[entry.type](inputs)
        return self._artifact(entry, inputs)

    def _artifact(self, entry: StageInput, inputs: Inputs) -> Any:
        brought = self.samples if entry.type is Samples else None
        path = brought or self.store.path(entry.type)
        if entry.optional and not self._expected(entry.type):
            return None
        robot = self.config.robot if self.config is not None and brought is None else None
        maker = "" if brought else maker_of(entry.type).name
        record, stamp = load_file(path, entry.type, robot, maker)
        inputs.digests[file_of(entry.type)] = stamp.digest if stamp else file_digest(path)
        return record

    def _expected(self, record: type) -> bool:
        """Whether an optional input must be there: a full run of this config would make it."""
        if self.config is None:
            return False
        return record in [s.output for s in stages_to_run(self.config)]

    @property
    def config_name(self) -> str:
        """Name of the config's file; empty where the run was not started with one at the shell."""
        words = shlex.split(self.asked) if self.config is not None else []
        return Path(words[0]).name if words else ""

    @property
    def _robot(self) -> str:
        if self.config is not None:
            return self.config.robot
        return self.store.folder.resolve().name

    def _look_at_inputs(self, stage: Stage) -> None:
        """Refuse inputs of another layout; say which ones, or what these were made from, do not fit."""
        for record in self._upstream(stage):
            if text := self.describe_mismatch(record):
                run = f"`paramreduce run {self.asked}`".replace(" `", "`")
                again = f"{run} rebuilds it" if self.config is not None else "make it again"
                self.callbacks.warn(f"{text}; {again}")

    def _upstream(self, stage: Stage) -> list[type]:
        """Records of files that a stage's artifact comes from, each after those that it is made from."""
        records: dict[type, None] = {}
        for entry in stage.artifacts:
            brought = entry.type is Samples and self.samples is not None
            if not brought and (not entry.optional or self._expected(entry.type)):
                records |= dict.fromkeys(self._upstream(maker_of(entry.type)))
                records[entry.type] = None
        return list(records)

    def describe_mismatch(self, record: type) -> str:
        """Return from what else a record's file was made than the config and the files here; empty if from these.

        Raises:
            ArtifactError: The file is of another layout.
        """
        stamp = self.store.stamp(record)
        if stamp is None:
            return ""
        path = self.store.path(record)
        check_schema(path, stamp)
        changed = []
        if self.config is not None:
            changed += [f"another {name} section" for name in self._changed_sections(stamp)]
        changed += [f"another {name}" for name in self._changed_artifacts(record, stamp)]
        return f"{path} was made with {' and '.join(changed)}" if changed else ""

    def _changed_artifacts(self, record: type, stamp: Stamp) -> list[str]:
        """Files of the folder that are not those a record was made from."""
        stamps = {
            file_of(entry.type): self.store.stamp(entry.type)
            for entry in maker_of(record).artifacts
        }
        return [
            name
            for name, found in stamps.items()
            if found is not None and name in stamp.inputs and found.digest != stamp.inputs[name]
        ]

    def _cut(self) -> None:
        self.callbacks.interrupted()
        self._cut_short = True

    def _stamp(
        self, stage: Stage, inputs: Inputs, seconds: float, warnings: Sequence[str] = ()
    ) -> Stamp:
        sections: dict[str, str] = {}
        seeds = []
        if self.config is not None:
            for entry in stage.sections:
                sections |= digest_sections(self.config, entry.type)
                seeds += [getattr(get_section(self.config, entry.type), "seed", None)]
        return Stamp(
            schema=SCHEMA,
            robot=self._robot,
            stage=stage.name,
            versions=versions(),
            sections=sections,
            inputs=dict(inputs.digests),
            seed=next((seed for seed in seeds if seed is not None), 0),
            seconds=seconds,
            cut_short=self._cut_short,
            config=self.config_name,
            warnings=tuple(warnings),
        )

    def _provenance(self) -> Provenance:
        seconds, warnings = {}, {}
        for stage in pipeline():
            stamp = self.store.stamp(stage.output)
            if stamp is not None and stage.output is not Report:
                seconds[stage.name] = stamp.seconds
                warnings[stage.name] = stamp.warnings
        wanted = self.config or self.settings or Settings()
        return provenance(wanted, self._robot, seconds, warnings, self.asked)
