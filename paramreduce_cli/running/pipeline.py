"""The stages as their signatures describe them, in their order."""

import inspect
import types
import typing
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from paramreduce_cli.artifacts.store import LAYOUTS
from paramreduce_cli.config import Config
from paramreduce_cli.config.sections import has_default, is_section
from paramreduce_cli.records import (
    Artifacts,
    Coefficients,
    Identification,
    Items,
    MeasuredLog,
    ProgressCallback,
    RawLogs,
    Recordings,
    Reduction,
    Report,
    Run,
    Samples,
    SignalTables,
    TermReduction,
    Trajectories,
    Validation,
)
from paramreduce_cli.stages import stages
from paramreduce_cli.stages.process_log import make_no_log_error

ARTIFACTS: tuple[type, ...] = (*LAYOUTS, Report)
LENT: tuple[Any, ...] = (Run, ProgressCallback, Items)
"""Types of what the caller lends a stage, beside what the stage has made before."""


@dataclass(frozen=True)
class StageInput:
    """One parameter of a stage."""

    name: str
    type: type
    optional: bool
    parameter: str = ""
    """Parameter that takes this input as a field of :class:`Artifacts`; empty for a parameter of its own."""


@dataclass(frozen=True)
class Stage:
    """A stage as its signature describes it."""

    name: str
    function: Callable[..., Any]
    inputs: tuple[StageInput, ...]
    output: type

    @property
    def sections(self) -> list[StageInput]:
        """Sections of the config that the result of the stage depends on."""
        return [entry for entry in self.inputs if is_section(entry.type)]

    @property
    def artifacts(self) -> list[StageInput]:
        """Inputs that other stages make."""
        own = self.output
        return [e for e in self.inputs if e.type in ARTIFACTS and e.type is not own]

    @property
    def previous(self) -> StageInput | None:
        """Input that takes the stage's own earlier artifact, to continue from it; None if there is none."""
        return next((entry for entry in self.inputs if entry.type is self.output), None)

    @property
    def lends_run(self) -> StageInput | None:
        """Input that takes worker processes and callbacks; None if there is none."""
        return next((entry for entry in self.inputs if entry.type is Run), None)

    @property
    def has_items(self) -> bool:
        """Whether several jobs can do its items."""
        return any(entry.type is Items for entry in self.inputs)

    def call(self, values: dict[str, Any]) -> Any:
        """Call the stage's function.

        Args:
            values: Values of its inputs by name.
        """
        arguments = {entry.name: values[entry.name] for entry in self.inputs if not entry.parameter}
        for parameter in {entry.parameter for entry in self.inputs if entry.parameter}:
            own = {e.name: values[e.name] for e in self.inputs if e.parameter == parameter}
            arguments[parameter] = Artifacts(**own)
        return self.function(**arguments)

    @property
    def needs_config(self) -> bool:
        """Whether the stage cannot run on user-supplied samples without a config."""
        made = {entry.type for entry in self.artifacts if not entry.optional}
        on_samples = Samples in made and made <= {Samples, Reduction, Validation}
        return not on_samples or not all(has_default(entry.type) for entry in self.sections)


def describe_stage(name: str, function: Callable[..., Any]) -> Stage:
    """Read a stage's signature."""
    hints = typing.get_type_hints(function)
    output = hints.pop("return")
    inputs: list[StageInput] = []
    for parameter in inspect.signature(function).parameters:
        if hints[parameter] is Artifacts:
            fields = typing.get_type_hints(Artifacts).items()
            inputs += [_describe_input(field, hint, parameter) for field, hint in fields]
        else:
            inputs.append(_describe_input(parameter, hints[parameter]))
    return Stage(name, function, tuple(inputs), output)


def _describe_input(name: str, hint: Any, parameter: str = "") -> StageInput:
    """Return a stage input of a name and a type hint."""
    optional = isinstance(hint, types.UnionType)
    members = [a for a in typing.get_args(hint) if a is not type(None)] if optional else [hint]
    return StageInput(name, members[0], optional, parameter)


@cache
def list_stages() -> tuple[Stage, ...]:
    """Return all stages, each after the stages whose artifacts it reads.

    Raises:
        ValueError: Stages read one another's artifacts in a circle.
    """
    waiting = [describe_stage(name, function) for name, function in stages.items()]
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
    return tuple(ordered)


def find_maker(record: type) -> Stage:
    """Return the stage that makes a record."""
    return next(s for s in list_stages() if s.output is record)


def list_user_files(config: Config | None, kind: type) -> dict[str, Path]:
    """Return the user's files that a config names for an input of a stage, by name."""
    files: dict[str, Path | None] = {}
    if config is not None and kind is Coefficients:
        files = {"coefficients": config.trajectories.file}
    elif config is not None and kind is Recordings:
        files = config.sampling.list_recordings()
    elif config is not None and kind is SignalTables and config.sampling.simulation is not None:
        files = {**config.sampling.simulation.list_files()}
    elif config is not None and kind is RawLogs and config.sampling.log is not None:
        log = config.sampling.log
        files = {
            f"{kind} {k}.{part}": path
            for kind, recordings in (
                ("training", log.training_files),
                ("held out", log.held_out_files),
            )
            for k, paths in enumerate(recordings)
            for part, path in enumerate(paths)
        }
    return {name: path for name, path in files.items() if path is not None}


_NAMED_BY = {
    Coefficients: "trajectories.file",
    Recordings: "sampling.estimation_file, validation_file and test_file",
    RawLogs: "sampling.log.files and held_out",
    SignalTables: "sampling.simulation.motions and road",
}
"""Keys of files that users bring."""


def find_missing_files(config: Config) -> Iterator[tuple[Path, str]]:
    """Yield files that a full run needs and that do not exist, with the key that names each."""
    needed = {entry.type for stage in list_stages_to_run(config) for entry in stage.inputs}
    for kind in (kind for kind in _NAMED_BY if kind in needed):
        for path in list_user_files(config, kind).values():
            if not path.exists():
                yield path, _NAMED_BY[kind]


def has_measured_torques(config: Config) -> bool:
    """Return whether the torques of both sets were measured on a machine."""
    if config.sampling.log is not None:
        return True
    return config.sampling.recorded and config.sampling.torques == "measured"


def check_is_part(stage: Stage, config: Config) -> None:
    """Raise ConfigError if the config has no work for a stage, before other stages run for it.

    Raises:
        ConfigError: The config names no log, or no measured torques.
    """
    logged = config.sampling.log is not None
    if (stage.output is MeasuredLog and not logged) or (
        stage.output is Identification and not has_measured_torques(config)
    ):
        raise make_no_log_error()


def list_stages_to_run(config: Config) -> list[Stage]:
    """Return the stages of a full run in order, without those that have nothing to do for a config.

    No trajectories are optimised if the states come from recordings, a log or a simulation; logs, identification and
    terms need their own inputs and sections.
    """
    logged = config.sampling.log is not None
    idle = {
        Trajectories: not config.sampling.needs_trajectories,
        MeasuredLog: not logged,
        Identification: not has_measured_torques(config),
        TermReduction: config.terms is None,
    }
    return [s for s in list_stages() if not idle.get(s.output, False)]
