"""Sweeps: many runs of one list, of robots, seeds and variants, each in a folder of its own."""

from __future__ import annotations

import itertools
import re
import shlex
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Annotated

from pydantic import AfterValidator, Field

from paramreduce_cli.artifacts.store import get_file
from paramreduce_cli.config import Config, load_config
from paramreduce_cli.config.loading import load_section
from paramreduce_cli.errors import ConfigError
from paramreduce_cli.fields.names import UnknownNameError
from paramreduce_cli.fields.section import Section
from paramreduce_cli.records import PROVING, Part, Reduction, Report, Samples, Validation
from paramreduce_cli.running.pipeline import Stage, list_stages, list_stages_to_run

_SEED = "trajectories.seed"
"""What a seed of the list sets."""
_VARIANT = re.compile(r"\w[\w.-]*")
"""Names of variants, which become part of a folder's."""


def _check_seeds(seeds: list[int]) -> list[int]:
    """Raise ValueError if a seed is listed twice."""
    twice = sorted({seed for seed in seeds if seeds.count(seed) > 1})
    if twice:
        raise ValueError(f"the seed {twice[0]} is listed twice")
    return seeds


def _check_variants(variants: dict[str, list[str]]) -> dict[str, list[str]]:
    """Raise ValueError if the name of a variant cannot be part of a folder's name."""
    for name in variants:
        if not _VARIANT.fullmatch(name):
            raise ValueError(
                f"the name {name!r} becomes part of a folder's; use letters, digits, ., - and _"
            )
    return variants


def _check_parts(parts: dict[str, int]) -> dict[str, int]:
    """Raise UnknownNameError unless all names are stages that can be done in parts."""
    names = [stage.name for stage in list_stages() if stage.has_items]
    for name in parts:
        if name not in names:
            raise UnknownNameError("stage that is done in parts", name, names)
    return parts


class SweepSection(Section):
    """The list of a sweep: every robot with every seed and every variant."""

    robots: Annotated[list[Path], Field(min_length=1)]
    """Configs; relative to this file."""
    seeds: Annotated[list[int], Field(min_length=1), AfterValidator(_check_seeds)] | None = None
    """Seeds of the trajectories; those in the configs if left out."""
    variants: (
        Annotated[dict[str, list[str]], Field(min_length=1), AfterValidator(_check_variants)] | None
    ) = None
    """Changes of the configs, KEY=VALUE as after --set, by a name of one's own; none if left out."""
    parts: Annotated[dict[str, Annotated[int, Field(ge=1)]], AfterValidator(_check_parts)] = Field(
        default_factory=dict
    )
    """Number of jobs that a stage of every run is split into; default 1."""
    results: Path = Path("../results/sweep")
    """Folder of all results; relative to this file."""


@dataclass(frozen=True)
class SweepRun:
    """One run of a sweep."""

    name: str
    """Name of its folder: ROBOT, then -SEED and -VARIANT where there are several."""
    path: Path
    """Path of its config."""
    overrides: tuple[str, ...]
    folder: Path
    seed: int | None = None
    """Seed of the list; None where it has none."""
    variant: str = ""
    """Name of the variant; empty if the list has none."""

    @cached_property
    def config(self) -> Config:
        """Config of the run."""
        return load_config(self.path, self.overrides)

    @cached_property
    def stages(self) -> list[Stage]:
        """Stages of the run."""
        return list_stages_to_run(self.config)

    def divides(self, stage: Stage) -> bool:
        """Return whether a stage of the run can be split into jobs."""
        if stage.output is Samples and self.config.sampling.log is not None:
            return False
        if stage.output is Reduction and PROVING not in self.config.reduction.heuristics:
            return False
        return stage.has_items

    def get_file(self, stage: Stage) -> str:
        """Return the path of the file that a stage of the run makes."""
        return str(self.folder / get_file(stage.output))

    def list_required_files(self, stage: Stage) -> list[str]:
        """Return the files that a stage of the run reads: its config and the artifacts of other stages."""
        read = {entry.type for entry in stage.artifacts}
        return [str(self.path), *(self.get_file(s) for s in self.stages if s.output in read)]

    def format_command(self, stage: Stage, part: Part | None = None, jobs: str = "") -> str:
        """Return the shell command for a stage of the run, or for a part of it.

        Args:
            stage: Stage to run.
            part: Part of the stage's items; None for all items.
            jobs: Number of processes, for stages that take more than one; may be a shell variable.
        """
        words = [sys.executable, "-m", "paramreduce_cli", stage.name, str(self.path)]
        words += ["--results", str(self.folder)]
        words += [word for text in self.overrides for word in ("--set", text)]
        words += ["--part", str(part)] if part is not None else []
        text = shlex.join([*words, "--quiet", "--wait"])
        if stage.lends_run is not None and jobs:
            text += f" --jobs {jobs}"
        # A model that is not accepted is a result, not a failure of the job.
        return f"{text} || [ $? -eq 1 ]" if stage.output is Validation else text


@dataclass(frozen=True)
class Sweep:
    """The runs of a list by name."""

    path: Path
    """Path of the list."""
    runs: dict[str, SweepRun]
    parts: dict[str, int]
    folder: Path

    def list_summaries(self) -> list[str]:
        """Return the paths of the files that all runs end with."""
        return [str(run.folder / get_file(Report)) for run in self.runs.values()]

    def format_table_command(self) -> str:
        """Return the shell command that tabulates all finished runs."""
        words = [sys.executable, "-m", "paramreduce_cli", "table", "--sweep", str(self.path)]
        return shlex.join([*words, "--output", str(self.folder / "table")])

    def list_parts(self, stage: Stage, run: SweepRun) -> list[Part]:
        """Return the parts that a stage of a run is split into; nothing if it is one job."""
        count = self.parts.get(stage.name, 1) if run.divides(stage) else 1
        return [Part(number, count) for number in range(1, count + 1)] if count > 1 else []

    def list_phases(self, jobs: str) -> list[list[str]]:
        """Return commands that can run side by side, in phases of which each waits for the one before.

        Stages that need no other jobs than those of their own run are one command. So there are at most two phases for
        every stage that is divided into jobs, and two more.

        Args:
            jobs: Number of processes for a stage, as the shell understands it.
        """
        found: list[list[str]] = []
        waiting: dict[str, list[str]] = {name: [] for name in self.runs}

        def close_phase() -> None:
            """End a phase: chain the waiting commands of each run."""
            found.append([" && ".join(lines) for lines in waiting.values() if lines])
            for lines in waiting.values():
                lines.clear()

        for stage in list_stages():
            having = {name: run for name, run in self.runs.items() if stage in run.stages}
            parts = [
                run.format_command(stage, part, "1")
                for run in having.values()
                for part in self.list_parts(stage, run)
            ]
            if parts:
                close_phase()
                found.append(parts)
            for name, run in having.items():
                text = run.format_command(stage, jobs=jobs)
                waiting[name].append(f"{{ {text}; }}" if "||" in text else text)
        close_phase()
        return [*(commands for commands in found if commands), [self.format_table_command()]]


def load_sweep(path: Path) -> Sweep:
    """Read a list of runs.

    Args:
        path: The YAML; relative paths in it are relative to its folder.

    Raises:
        ConfigError: The file is no list of runs, two runs have one name, or a config cannot be used.
    """
    section = load_section(path, SweepSection)
    folder = _resolve_beside(path, section.results)
    runs: dict[str, SweepRun] = {}
    for run in _iterate_runs(path, section, folder):
        if run.name in runs:
            raise ConfigError(
                f"{path}: two runs are called {run.name}: {runs[run.name].path} and {run.path}. Give their files "
                "other names."
            )
        runs[run.name] = run
    first = {(run.path, run.variant): run for run in reversed(runs.values())}
    for run in first.values():  # seeds change nothing that could be wrong
        _check_config(path, run)
    return Sweep(path, runs, section.parts, folder)


def _check_config(path: Path, run: SweepRun) -> None:
    """Raise ConfigError, with the place in the list, if the config of a run cannot be used.

    Raises:
        ConfigError: The config cannot be used; the message names the list and the key of the run in the list.
    """
    try:
        run.stages  # noqa: B018
    except ConfigError as error:
        place = f"variants.{run.variant}" if run.variant and "--set" in str(error) else "robots"
        raise ConfigError(f"{path}: {place}: {error}") from error


def _iterate_runs(path: Path, section: SweepSection, folder: Path) -> Iterator[SweepRun]:
    """Yield the runs of a list."""
    seeds: list[int | None] = [None] if section.seeds is None else [*section.seeds]
    for robot, seed, (variant, changes) in itertools.product(
        section.robots, seeds, (section.variants or {"": []}).items()
    ):
        name = "-".join(
            [robot.stem, *([] if seed is None else [str(seed)]), *filter(None, [variant])]
        )
        seeding = [] if seed is None else [f"{_SEED}={seed}"]
        yield SweepRun(
            name, _resolve_beside(path, robot), (*seeding, *changes), folder / name, seed, variant
        )


def _resolve_beside(path: Path, other: Path) -> Path:
    """Return a path of the list, relative to the working folder if it is inside, otherwise absolute."""
    joined = other if other.is_absolute() else path.parent / other
    here = Path.cwd()
    resolved = joined.resolve()
    return resolved.relative_to(here) if resolved.is_relative_to(here) else resolved
