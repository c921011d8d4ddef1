"""The runner of stages: it finds their inputs, skips what is up to date, and writes what they make.

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
from paramreduce_cli.artifacts.store import Store, check_schema, digest_file, get_file, load_file
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
    ProgressCallback,
    Provenance,
    Report,
    Run,
    Samples,
)
from paramreduce_cli.running.pipeline import (
    LENT,
    Stage,
    StageInput,
    find_maker,
    list_stages,
    list_stages_to_run,
)
from paramreduce_cli.running.stage_inputs import OUTSIDE, Inputs, call_stage, note_warnings


def make_provenance(
    config: Config | Settings,
    robot: str,
    seconds: Mapping[str, float],
    warnings: Mapping[str, Sequence[str]],
    arguments: str,
) -> Provenance:
    """Return the provenance of results, whatever has run the stages.

    Args:
        config: Config or settings.
        robot: Name of the robot.
        seconds: Times of the stages by name, s.
        warnings: Warnings of the stages by name.
        arguments: Config and options of the call, as in :class:`Provenance`.
    """
    text = json.dumps(config.model_dump(mode="json"), sort_keys=True)
    digest = hashlib.sha256(text.encode()).hexdigest()
    changed = config.model_dump(mode="json", exclude_defaults=True)
    if isinstance(config, Config):
        warnings = {"config": find_warnings(config), **warnings}
    return Provenance(robot, digest, get_versions(), seconds, warnings, arguments, changed)


@cache
def get_versions() -> dict[str, str]:
    """Return the versions of this package and of the libraries that numbers depend on."""
    return {"paramreduce": __version__} | {
        name: importlib.metadata.version(name) for name in ("numpy", "scipy", "casadi")
    }


@dataclass(frozen=True)
class Outcome:
    """The outcome of one stage."""

    stage: str
    path: Path
    current: bool
    seconds: float
    record: Any = None


def format_arguments(config: Path | None, results: Path | None, overrides: Sequence[str]) -> str:
    """Return the config and the options of a command line, for commands that follow it."""
    words = [str(config)] if config is not None else []
    words += ["--results", str(results)] if results is not None else []
    words += [word for text in overrides for word in ("--set", text)]
    return shlex.join(words)


@dataclass(frozen=True)
class Callbacks:
    """The functions that a run calls."""

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
    """A runner of stages on one robot in one folder.

    Attributes:
        config: Config; None if a stage is run on user-supplied files alone.
        store: The results folder.
        jobs: Worker processes.
        callbacks: Functions that a run calls.
        samples: A samples.h5 brought by the user instead of the folder's own.
        settings: Settings, if there is no config.
        arguments: Config and options that name the run at the shell.
    """

    config: Config | None
    store: Store
    jobs: int = 1
    callbacks: Callbacks = Callbacks()
    samples: Path | None = None
    settings: Settings | None = None
    arguments: str = ""
    _cut_short: bool = field(default=False, init=False)
    """Whether Ctrl-C has ended a search of the stage at hand."""

    def run(
        self, stage: Stage, *, force: bool = False, go_on: bool = False, part: Part = WHOLE
    ) -> Outcome:
        """Run one stage, unless its artifact is up to date, or do a part of its items.

        Args:
            stage: Stage to run.
            force: Run it even so, and do finished items again.
            go_on: Run it also where more time could make its artifact better.
            part: Items to be done; the artifact is made only where they are all items.

        Raises:
            ParamreduceError: The inputs of the stage are missing or wrong, or the stage fails.
        """
        path = self.store.get_path(stage.output)
        self._cut_short = False
        self.store.reject_replacement(stage.output, self._robot)
        self._check_inputs(stage)
        previous = self._load_previous(stage)
        better = go_on and getattr(previous, "unfinished", False)
        if not force and not better and self.is_current(stage):
            return self._make_current_outcome(stage, part)
        started = time.perf_counter()
        inputs = Inputs(self.config, self.callbacks.progress)
        lent_types = (*LENT, stage.output)
        arguments = {
            i.name: self._load_argument(i, inputs) for i in stage.inputs if i.type not in lent_types
        }
        with note_warnings() as warnings:

            def stamp(seconds: float) -> Stamp:
                return self._make_stamp(stage, inputs, seconds, warnings)

            kept = StoredItems(path, stamp, from_start=force, check=self.callbacks.check)
            earlier = kept.list_stamps() if part.is_whole else []
            said = dict.fromkeys(text for one in earlier for text in one.warnings)
            for text in said:
                self.callbacks.warn(text)
            unchanged = (
                self._find_unchanged(stage, inputs) if previous and not force else frozenset()
            )
            run = Run(self.jobs, self.callbacks.progress, self._mark_cut_short, unchanged)
            lent = {
                Run: run,
                ProgressCallback: self.callbacks.progress,
                Items: Items(kept, part),
                stage.output: previous,
            }
            arguments |= {i.name: lent[i.type] for i in stage.inputs if i.type in lent}
            try:
                record = call_stage(stage, arguments)
            except PartFinished:
                self.callbacks.check()
                seconds = time.perf_counter() - started
                return Outcome(stage.name, kept.folder, not kept.written, seconds)
        self.callbacks.check()
        seconds = time.perf_counter() - started
        total = seconds + sum(one.seconds for one in earlier)
        texts = tuple(dict.fromkeys([*said, *warnings]))
        self.store.save(record, self._make_stamp(stage, inputs, total, texts))
        kept.clear()
        return Outcome(stage.name, path, False, time.perf_counter() - started, record)

    def _make_current_outcome(self, stage: Stage, part: Part) -> Outcome:
        """Return the outcome of an artifact that is up to date, after repeating its warnings."""
        path = self.store.get_path(stage.output)
        stamp = self.store.read_stamp(stage.output)
        assert stamp is not None, "an artifact that is up to date has one"
        if part.is_whole:
            self.store.touch(stage.output)
            for text in stamp.warnings:
                self.callbacks.warn(text)
        return Outcome(stage.name, path, True, stamp.seconds)

    def _load_previous(self, stage: Stage) -> Any:
        """Return the artifact that this version of the stage has made before, or None."""
        stamp = self.store.read_stamp(stage.output)
        known = stamp is not None and (stamp.schema, stamp.versions) == (SCHEMA, get_versions())
        if stage.previous is None or not known:
            return None
        try:
            path = self.store.get_path(stage.output)
            return load_file(path, stage.output, self._robot, stage.name)[0]
        except ArtifactError:  # damaged: it is made again
            return None

    def is_current(self, stage: Stage) -> bool:
        """Whether a stage's artifact was made by this version from just these inputs."""
        stamp = self.store.read_stamp(stage.output)
        if stamp is None or stamp.cut_short or self.config is None or self.samples is not None:
            return False
        made = (stamp.schema, stamp.stage, stamp.robot, stamp.versions)
        if made != (SCHEMA, stage.name, self.config.robot, get_versions()):
            return False
        if self._find_changed_sections(stamp) or stamp.inputs != self._digest_inputs(stage):
            return False
        return self.store.is_whole(stage.output)

    def is_of_other_config(self, stage: Stage) -> bool:
        """Return whether a stage's artifact exists, but from other sections of the config."""
        stamp = self.store.read_stamp(stage.output)
        return (
            self.config is not None
            and stamp is not None
            and bool(self._find_changed_sections(stamp))
        )

    def _find_changed_sections(self, stamp: Stamp) -> list[str]:
        """Return the sections of the config that have changed since the artifact was made."""
        assert self.config is not None
        return [
            name
            for name, digest in stamp.sections.items()
            if digest_section(self.config, tuple(name.split("."))) != digest
        ]

    def _find_unchanged(self, stage: Stage, inputs: Inputs) -> frozenset[str]:
        """Return the sections and files that have not changed since the stage last ran."""
        stamp = self.store.read_stamp(stage.output)
        if stamp is None or self.config is None:
            return frozenset()
        sections = set(stamp.sections) - set(self._find_changed_sections(stamp))
        same = {name for name, digest in inputs.digests.items() if stamp.inputs.get(name) == digest}
        return frozenset(sections | same)

    def _digest_inputs(self, stage: Stage) -> dict[str, str]:
        """Return the digests of the stage's inputs by file name."""
        inputs = Inputs(self.config)
        for entry in stage.inputs:
            if entry in stage.artifacts:
                stamp = self.store.read_stamp(entry.type)
                if stamp is not None:
                    inputs.digests[get_file(entry.type)] = stamp.digest
            else:
                inputs.note_files(entry.type)
        return inputs.digests

    def _load_argument(self, entry: StageInput, inputs: Inputs) -> Any:
        """Return the value of a stage input: a section, provenance, user files, or an artifact."""
        if is_section(entry.type):
            return get_section(self.config or self.settings, entry.type)
        if entry.type is Provenance:
            return self._make_provenance()
        if entry.type in OUTSIDE:
            return OUTSIDE[entry.type](inputs)
        return self._load_artifact(entry, inputs)

    def _load_artifact(self, entry: StageInput, inputs: Inputs) -> Any:
        """Return an artifact, and note its digest; None if it is optional and this config does not make it."""
        supplied = self.samples if entry.type is Samples else None
        path = supplied or self.store.get_path(entry.type)
        if entry.optional and not self._is_expected(entry.type):
            return None
        robot = self.config.robot if self.config is not None and supplied is None else None
        maker = "" if supplied else find_maker(entry.type).name
        record, stamp = load_file(path, entry.type, robot, maker)
        inputs.digests[get_file(entry.type)] = stamp.digest if stamp else digest_file(path)
        return record

    def _is_expected(self, record: type) -> bool:
        """Return whether an optional input must exist because a full run of this config would make it."""
        if self.config is None:
            return False
        return record in [s.output for s in list_stages_to_run(self.config)]

    @property
    def config_name(self) -> str:
        """Name of the config's file; empty if the run has no config, or was not started from the shell."""
        words = shlex.split(self.arguments) if self.config is not None else []
        return Path(words[0]).name if words else ""

    @property
    def _robot(self) -> str:
        """Name of the robot: the config's, or the folder's without a config."""
        if self.config is not None:
            return self.config.robot
        return self.store.folder.resolve().name

    def _check_inputs(self, stage: Stage) -> None:
        """Raise an error for inputs of another layout; warn of inputs that were made with other settings."""
        for record in self._list_upstream(stage):
            if text := self.describe_mismatch(record):
                run = f"`paramreduce run {self.arguments}`".replace(" `", "`")
                remedy = f"{run} rebuilds it" if self.config is not None else "make it again"
                self.callbacks.warn(f"{text}; {remedy}")

    def _list_upstream(self, stage: Stage) -> list[type]:
        """Return the records that a stage's artifact depends on, each after those it depends on itself."""
        records: dict[type, None] = {}
        for entry in stage.artifacts:
            supplied = entry.type is Samples and self.samples is not None
            if not supplied and (not entry.optional or self._is_expected(entry.type)):
                records |= dict.fromkeys(self._list_upstream(find_maker(entry.type)))
                records[entry.type] = None
        return list(records)

    def describe_mismatch(self, record: type) -> str:
        """Describe how a record's file differs from what the config and the files here would give; empty if it does
        not.

        Raises:
            ArtifactError: The file is of another layout.
        """
        stamp = self.store.read_stamp(record)
        if stamp is None:
            return ""
        path = self.store.get_path(record)
        check_schema(path, stamp)
        changed = []
        if self.config is not None:
            changed += [f"another {name} section" for name in self._find_changed_sections(stamp)]
        changed += [f"another {name}" for name in self._find_changed_artifacts(record, stamp)]
        return f"{path} was made with {' and '.join(changed)}" if changed else ""

    def _find_changed_artifacts(self, record: type, stamp: Stamp) -> list[str]:
        """Return the files of the folder that differ from those a record was made from."""
        stamps = {
            get_file(entry.type): self.store.read_stamp(entry.type)
            for entry in find_maker(record).artifacts
        }
        return [
            name
            for name, found in stamps.items()
            if found is not None and name in stamp.inputs and found.digest != stamp.inputs[name]
        ]

    def _mark_cut_short(self) -> None:
        """Note that Ctrl-C has ended a search of the stage."""
        self.callbacks.interrupted()
        self._cut_short = True

    def _make_stamp(
        self, stage: Stage, inputs: Inputs, seconds: float, warnings: Sequence[str] = ()
    ) -> Stamp:
        """Return the stamp of an artifact: versions, digests of sections and inputs, time and warnings."""
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
            versions=get_versions(),
            sections=sections,
            inputs=dict(inputs.digests),
            seed=next((seed for seed in seeds if seed is not None), 0),
            seconds=seconds,
            cut_short=self._cut_short,
            config=self.config_name,
            warnings=tuple(warnings),
        )

    def _make_provenance(self) -> Provenance:
        """Return the provenance of the results in the folder: config, versions, and seconds and warnings of each
        finished stage but the report.
        """
        seconds, warnings = {}, {}
        for stage in list_stages():
            stamp = self.store.read_stamp(stage.output)
            if stamp is not None and stage.output is not Report:
                seconds[stage.name] = stamp.seconds
                warnings[stage.name] = stamp.warnings
        settings = self.config or self.settings or Settings()
        return make_provenance(settings, self._robot, seconds, warnings, self.arguments)
