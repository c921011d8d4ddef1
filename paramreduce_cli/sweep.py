"""Many runs of one list: robots, seeds and changes of their configs, each in a folder of its own."""

from __future__ import annotations

import itertools
import shlex
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Annotated

from pydantic import Field

from paramreduce_cli.artifacts.store import file_of
from paramreduce_cli.config import Config, load_config
from paramreduce_cli.config.loading import load_section
from paramreduce_cli.errors import ConfigError
from paramreduce_cli.fields.section import Section
from paramreduce_cli.pipeline import Stage, pipeline, stages_to_run
from paramreduce_cli.records import Report, Share, Validation

_SEED = "trajectories.seed"
"""What a seed of the list sets."""


class SweepSection(Section):
    """What is run: every robot with every seed and every variant."""

    robots: Annotated[list[Path], Field(min_length=1)]
    """Configs; relative to this file."""
    seeds: Annotated[list[int], Field(min_length=1)] | None = None
    """Of the trajectories; those in the configs if left out."""
    variants: Annotated[dict[str, list[str]], Field(min_length=1)] | None = None
    """Changes of the configs, KEY=VALUE as after --set, by a name of one's own; none if left out."""
    parts: dict[str, Annotated[int, Field(ge=1)]] = Field(default_factory=dict)
    """How many jobs a stage of every run is done as; one where nothing is said."""
    results: Path = Path("../results/sweep")
    """Folder of all results; relative to this file."""


@dataclass(frozen=True)
class SweepRun:
    """One run of a sweep."""

    name: str
    """Of its folder: ROBOT, then -SEED and -VARIANT where there are several."""
    path: Path
    """Of its config."""
    overrides: tuple[str, ...]
    folder: Path

    @cached_property
    def config(self) -> Config:
        """What it is asked for."""
        return load_config(self.path, self.overrides)

    @cached_property
    def stages(self) -> list[Stage]:
        """What it consists of."""
        return stages_to_run(self.config)

    def file(self, stage: Stage) -> str:
        """What a stage makes."""
        return str(self.folder / file_of(stage.output))

    def needs(self, stage: Stage) -> list[str]:
        """Files that a stage of it reads: its config, and what its other stages make."""
        read = {entry.type for entry in stage.artifacts}
        return [str(self.path), *(self.file(s) for s in self.stages if s.output in read)]

    def command(self, stage: Stage, share: Share | None = None, jobs: str = "") -> str:
        """What does a stage of it, or a share of that, at the shell.

        Args:
            stage: Which one.
            share: Which part; all of the stage if None.
            jobs: How many processes it may have, for stages that take more than one.
        """
        words = [sys.executable, "-m", "paramreduce_cli", stage.name, str(self.path)]
        words += ["--results", str(self.folder)]
        words += [word for text in self.overrides for word in ("--set", text)]
        words += ["--part", str(share)] if share is not None else []
        text = shlex.join([*words, "--quiet", "--wait"])
        if stage.lends_run is not None and jobs:
            text += f" --jobs {jobs}"
        # A model that is not accepted is a result, not a failure of the job.
        return f"{text} || [ $? -eq 1 ]" if stage.output is Validation else text


@dataclass(frozen=True)
class Sweep:
    """All runs of a list, by their names."""

    runs: dict[str, SweepRun]
    parts: dict[str, int]
    folder: Path

    def summaries(self) -> list[str]:
        """What all runs end with."""
        return [str(run.folder / file_of(Report)) for run in self.runs.values()]

    def table_command(self) -> str:
        """What sets all runs beside each other, at the shell."""
        words = [sys.executable, "-m", "paramreduce_cli", "table"]
        words += [str(run.folder) for run in self.runs.values()]
        return shlex.join([*words, "--output", str(self.folder / "table")])

    def shares(self, stage: Stage) -> list[Share]:
        """The jobs that a stage is done as; none where it is one."""
        count = self.parts.get(stage.name, 1) if stage.in_shares else 1
        return [Share(number, count) for number in range(1, count + 1)] if count > 1 else []

    def phases(self, jobs: str) -> list[list[str]]:
        """Commands that can run side by side, in phases of which each waits for the one before.

        What needs no other job than its own run is one command; so there are no more than two phases for
        every stage that is done as several jobs, and two.

        Args:
            jobs: How many processes a stage may have, as the shell is to understand it.
        """
        found: list[list[str]] = []
        waiting: dict[str, list[str]] = {name: [] for name in self.runs}

        def close() -> None:
            found.append([" && ".join(lines) for lines in waiting.values() if lines])
            for lines in waiting.values():
                lines.clear()

        for stage in pipeline():
            having = {name: run for name, run in self.runs.items() if stage in run.stages}
            shares = self.shares(stage)
            if shares:
                close()
                found.append(
                    [run.command(stage, share, "1") for run in having.values() for share in shares]
                )
            for name, run in having.items():
                text = run.command(stage, jobs=jobs)
                waiting[name].append(f"{{ {text}; }}" if "||" in text else text)
        close()
        return [*(commands for commands in found if commands), [self.table_command()]]


def load_sweep(path: Path) -> Sweep:
    """Read a list of runs.

    Args:
        path: The YAML; relative paths in it are relative to its folder.

    Raises:
        ConfigError: It is no such list, or two runs would have one name.
    """
    wanted = load_section(path, SweepSection)
    folder = _beside(path, wanted.results)
    runs: dict[str, SweepRun] = {}
    for run in _runs(path, wanted, folder):
        if run.name in runs:
            raise ConfigError(
                f"{path}: two runs are called {run.name}: {runs[run.name].path} and {run.path}. Give their files "
                "other names."
            )
        runs[run.name] = run
    return Sweep(runs, wanted.parts, folder)


def _runs(path: Path, wanted: SweepSection, folder: Path) -> Iterator[SweepRun]:
    seeds = {"": []} if wanted.seeds is None else {f"-{k}": [f"{_SEED}={k}"] for k in wanted.seeds}
    variants = {f"-{name}": changes for name, changes in (wanted.variants or {}).items()} or {
        "": []
    }
    for robot, (seed, seeding), (variant, changes) in itertools.product(
        wanted.robots, seeds.items(), variants.items()
    ):
        name = f"{robot.stem}{seed}{variant}"
        yield SweepRun(name, _beside(path, robot), (*seeding, *changes), folder / name)


def _beside(path: Path, other: Path) -> Path:
    """A path of a list, as seen from the working folder."""
    joined = other if other.is_absolute() else path.parent / other
    here = Path.cwd()
    resolved = joined.resolve()
    return resolved.relative_to(here) if resolved.is_relative_to(here) else resolved
