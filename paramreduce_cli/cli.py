"""The command line: the only module that prints, reads flags and sets exit codes.

Stage commands are derived from the declared stages; nothing about a particular stage is
written here.
"""

from __future__ import annotations

import json
import os
import signal
import sys
import threading
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import click
import rich.box
import rich.console
import rich.markup
import rich.progress
import rich.table

from paramreduce_cli import __version__
from paramreduce_cli.artifacts.inspection import contents
from paramreduce_cli.artifacts.store import Store, file_of, load_file, load_json
from paramreduce_cli.config import Config, config_schema, load_config
from paramreduce_cli.config.template import dh_template
from paramreduce_cli.errors import ConfigError, ParamreduceError, ParamreduceWarning
from paramreduce_cli.multibody.relations import approximate_expressions
from paramreduce_cli.records import Progress, Reduction, Report, Run, Validation
from paramreduce_cli.report.comparison import (
    QUANTITIES,
    TOLERANCES,
    Difference,
    Tolerance,
    compare,
)
from paramreduce_cli.runner import (
    Outcome,
    Runner,
    Stage,
    pipeline,
    stages_to_run,
)
from paramreduce_cli.workflow import FORMATS

out = rich.console.Console(highlight=False, soft_wrap=True)
err = rich.console.Console(stderr=True, highlight=False, soft_wrap=True)

NOT_ACCEPTED = 1
WRONG = 2
INTERNAL = 70
INTERRUPTED = 130


def say(message: str) -> None:
    """Print to standard output as it is, without markup."""
    out.print(message, markup=False)


class _Interruption:
    """Ctrl-C that cannot get lost.

    A KeyboardInterrupt raised while a library calls back into Python may be swallowed there;
    it is remembered and raised again at the next step of the work.
    """

    def __init__(self) -> None:
        self._met = False

    def install(self) -> None:
        """Take over the signal."""
        signal.signal(signal.SIGINT, self._note)

    def _note(self, *_: object) -> None:
        self._met = True
        raise KeyboardInterrupt

    def check(self) -> None:
        """Raise an interruption that was met but did not get through."""
        if self._met and threading.current_thread() is threading.main_thread():
            raise KeyboardInterrupt


interruption = _Interruption()


def main() -> None:
    """Run the command line; every outcome becomes a message and an exit code."""
    interruption.install()
    warnings.simplefilter("once", ParamreduceWarning)
    warnings.showwarning = _show_warning
    try:
        code = cli.main(standalone_mode=False)
    except ParamreduceError as error:
        _show_errors(str(error))
        code = error.exit_code
    except click.exceptions.NoArgsIsHelpError as error:
        say(error.format_message())
        code = WRONG
    except click.ClickException as error:
        error.show()
        code = WRONG
    except (KeyboardInterrupt, click.exceptions.Abort):
        err.print("\nInterrupted. What is finished is kept: the same command goes on from there.")
        code = INTERRUPTED
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        code = 0
    except Exception as error:
        if os.environ.get("PARAMREDUCE_DEBUG"):
            raise
        err.print(
            f"Error: something went wrong inside paramreduce ({type(error).__name__}: {error}). "
            "This is a bug; PARAMREDUCE_DEBUG=1 shows where.",
            markup=False,
        )
        code = INTERNAL
    sys.exit(code if isinstance(code, int) else 0)


def _show_errors(text: str) -> None:
    for line in text.splitlines():
        err.print(f"Error: {line}", markup=False)


def _show_warning(message: Warning | str, category: type[Warning], *_: Any, **__: Any) -> None:
    if issubclass(category, ParamreduceWarning):
        err.print(f"Warning: {message}.", markup=False)


@click.group(context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, prog_name="paramreduce")
def cli() -> None:
    """Find the smallest set of dynamic parameters that still predicts a robot's forces.

    A robot is one YAML file; results go to results/ROBOT. Start with
    `paramreduce run configs/two_link.yaml`, or `paramreduce init --dh my_arm` for your own.
    """


CONFIG = click.argument("config", type=click.Path(path_type=Path, dir_okay=False))
RESULTS = click.option(
    "--results",
    type=click.Path(path_type=Path, file_okay=False),
    help="Folder of the artifacts.  [default: results/ROBOT]",
)
SET = click.option(
    "--set", "overrides", multiple=True, metavar="KEY=VALUE",
    help="Override a key of the config, such as trajectories.count=3; may be repeated.",
)  # fmt: skip
FORCE = click.option("--force", is_flag=True, help="Do it again even if it is up to date.")
QUIET = click.option("--quiet", is_flag=True, help="Say nothing but errors and warnings.")
JOBS = click.option(
    "--jobs", type=click.IntRange(min=1), default=None, metavar="N",
    help="Worker processes.  [default: all cores]",
)  # fmt: skip


def _cores() -> int:
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _store(config: Config | None, results: Path | None) -> Store:
    if results is not None:
        return Store(results)
    if config is None:
        raise ConfigError("--results: without a config, say where the results go.")
    return Store(Path("results") / config.robot)


def _stage_command(stage: Stage) -> click.Command:
    takes_config = any(entry.type is Config for entry in stage.inputs)
    config_optional = any(entry.type is Config and entry.optional for entry in stage.inputs)
    takes_jobs = any(entry.type is Run for entry in stage.inputs)

    def command(
        config: Path | None,
        results: Path | None,
        overrides: tuple[str, ...],
        force: bool,
        quiet: bool,
        jobs: int | None = None,
        samples: Path | None = None,
    ) -> int:
        if config is None and samples is None:
            raise click.UsageError("Give a CONFIG, or --samples FILE and --results DIR.")
        loaded = load_config(config, overrides) if config is not None else None
        store = _store(loaded, results)
        with store.locked(), progress_bars(quiet) as progress:
            runner = Runner(loaded, store, jobs or _cores(), progress, samples, _remark)
            outcome = runner.run(stage, force=force)
        if not quiet:
            _say_outcome(outcome)
        return _exit_code(stage, outcome, quiet)

    params: list[Any] = [RESULTS, SET, FORCE, QUIET]
    if takes_jobs:
        params.append(JOBS)
    if config_optional:
        params.append(
            click.option(
                "--samples", type=click.Path(path_type=Path, dir_okay=False), metavar="FILE",
                help="A samples.h5 of your own; then no CONFIG is needed.",
            )
        )  # fmt: skip
    if takes_config:
        params.append(
            click.argument(
                "config",
                type=click.Path(path_type=Path, dir_okay=False),
                required=not config_optional,
            )
        )
    decorated: Callable[..., Any] = command
    for parameter in params:
        decorated = parameter(decorated)
    return click.command(stage.name, help=_stage_help(stage, config_optional))(decorated)


def _stage_help(stage: Stage, config_optional: bool) -> str:
    reads = [file_of(entry.type) for entry in stage.artifacts]
    source = " and ".join([", ".join(reads[:-1]), reads[-1]] if len(reads) > 1 else reads)
    flow = f"Reads {source or 'the config'}; writes {file_of(stage.output)}."
    example = f"Example: paramreduce {stage.name} configs/puma560.yaml"
    if config_optional:
        example += f", or: paramreduce {stage.name} --samples my_samples.h5 --results my_results"
    text = (stage.function.__doc__ or "").strip().replace("\n    ", "\n")
    return f"{text}\n\n{flow}\n\n{example}"


def _remark(message: str) -> None:
    err.print(f"Warning: {message}.", markup=False)


def _say_outcome(outcome: Outcome) -> None:
    state = "up to date" if outcome.current else f"{outcome.seconds:.1f} s"
    say(f"{outcome.stage}: {state}, {outcome.path}")


def _exit_code(stage: Stage, outcome: Outcome, quiet: bool) -> int:
    if stage.output is not Validation:
        return 0
    record = outcome.record or load_file(outcome.path, Validation, None, stage.name)[0]
    if not quiet:
        for remark in record.remarks:
            _remark(remark.rstrip("."))
    return _say_verdict(record.accepted, record.verdict, quiet)


def _say_verdict(accepted: bool, verdict: str, quiet: bool) -> int:
    if not accepted:
        err.print(f"Not accepted: {verdict}", markup=False)
        return NOT_ACCEPTED
    if not quiet:
        say(verdict)
    return 0


for _stage in pipeline():
    cli.add_command(_stage_command(_stage))


@contextmanager
def progress_bars(quiet: bool) -> Iterator[Callable[[Progress], None]]:
    """Show long work: bars on a terminal, plain lines elsewhere, nothing if quiet."""
    with _shown_progress(quiet) as show:

        def step(p: Progress) -> None:
            show(p)
            interruption.check()

        yield step
    interruption.check()


@contextmanager
def _shown_progress(quiet: bool) -> Iterator[Callable[[Progress], None]]:
    if quiet:
        yield lambda _: None
    elif not err.is_terminal:
        yield _plain_line
    else:
        columns = (
            rich.progress.TextColumn("{task.description}"),
            rich.progress.BarColumn(),
            rich.progress.TaskProgressColumn(),
            rich.progress.TimeElapsedColumn(),
            rich.progress.TextColumn("{task.fields[remark]}"),
        )
        with rich.progress.Progress(*columns, console=err) as bars:
            tasks: dict[str, rich.progress.TaskID] = {}

            def advance(p: Progress) -> None:
                if p.task not in tasks:
                    tasks[p.task] = bars.add_task(p.task, total=p.total, remark="")
                bars.update(tasks[p.task], completed=p.done, remark=p.remark)

            yield advance


def _plain_line(p: Progress) -> None:
    if p.done >= p.total:
        err.print(f"{p.task}: done{', ' + p.remark if p.remark else ''}", markup=False)


@cli.command()
@CONFIG
@RESULTS
@SET
@FORCE
@QUIET
@JOBS
def run(
    config: Path,
    results: Path | None,
    overrides: tuple[str, ...],
    force: bool,
    quiet: bool,
    jobs: int | None,
) -> int:
    """Run all stages in order, skipping what is up to date.

    Ends with a summary table and the path of the report. Exit code 1 where the selected
    model is not accepted.

    Example: paramreduce run configs/puma560.yaml
    """
    loaded = load_config(config, overrides)
    store = _store(loaded, results)
    with store.locked():
        for stage in stages_to_run(loaded):
            with progress_bars(quiet) as progress:
                runner = Runner(loaded, store, jobs or _cores(), progress, remark=_remark)
                outcome = runner.run(stage, force=force)
            if not quiet:
                _say_outcome(outcome)
    summary = load_json(store.path(Report))
    if not quiet:
        _say_summary(summary)
        say(f"Report: {store.path(Report).with_name('index.html')}")
    selected = summary["selected"]
    return _say_verdict(selected["accepted"], selected["verdict"], quiet)


def _say_summary(summary: dict[str, Any]) -> None:
    model, n = summary["model"], summary["selected"]["n"]
    say(
        f"\n{summary['robot']}: {model['n_parameters']} parameters, {model['n_affecting']} act on the "
        f"torques, {model['n_base']} base parameters"
    )
    trajectories = summary["trajectories"]
    if trajectories is not None:
        kappas = sorted(t["kappa"] for t in trajectories["estimation"])
        say(
            f"{len(kappas)} trajectories, {trajectories['scaling']} kappa: best {kappas[0]:.4g}, "
            f"median {kappas[len(kappas) // 2]:.4g}, worst {kappas[-1]:.4g}"
        )
    table = rich.table.Table(title=f"Reduced models with {n} parameters", box=rich.box.SIMPLE)
    headings = ("heuristic", "ε_τ E", "ε_τ V", "ε_z̈ E", "ε_z̈ V", "d", "M|δ")
    for k, heading in enumerate(headings):
        table.add_column(heading, justify="left" if k == 0 else "right", no_wrap=True)
    for name, rows in summary["validation"].items():
        if len(rows) >= n:
            table.add_row(name, *_summary_cells(rows[n - 1]))
    full = summary["full"]
    operations = (f"{full['operations_inverse']:.0f}", f"{full['operations_direct']:.0f}")
    table.add_row("full model", "", "", "", "", *operations)
    out.print(table)


def _summary_cells(row: dict[str, Any]) -> list[str]:
    cells = []
    for part in ("torque_error", "acceleration_error"):
        for which in ("estimation", "validation"):
            value = row[part][which]
            cells.append(_percent(value))
    return [*cells, str(row["operations"]["inverse"]), str(row["operations"]["direct"])]


def _percent(share: float | None) -> str:
    if share is None:
        return "infinite"
    return f"{100 * share:.3g} %" if share < 10 else "> 1000 %"


@cli.command()
def schema() -> None:
    """Print the JSON Schema of a config, for editors.

    Example: paramreduce schema > paramreduce.schema.json
    """
    click.echo(json.dumps(config_schema(), indent=2, default=str))


@cli.command()
@click.argument("name")
@click.option("--dh", is_flag=True, required=True, help="A Denavit-Hartenberg description.")
@click.option("--joints", type=click.IntRange(1, 30), default=6, show_default=True)
@click.option("--output", type=click.Path(path_type=Path), help="[default: configs/NAME.yaml]")
def init(name: str, dh: bool, joints: int, output: Path | None) -> None:
    """Write a commented config for a new arm.

    Example: paramreduce init --dh my_arm --joints 6
    """
    path = output or Path("configs") / f"{name}.yaml"
    if not name.replace("_", "").replace("-", "").isalnum():
        raise ConfigError(f"NAME: {name!r} may hold letters, digits, - and _ only.")
    if path.exists():
        raise ConfigError(f"{path}: exists already; choose another with --output.")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(dh_template(name, joints), encoding="utf-8")
    except OSError as error:
        raise ConfigError(f"{path}: cannot be written: {error.strerror}.") from error
    say(f"Wrote {path}. Fill in what is marked TODO, then: paramreduce run {path}")


@cli.command()
@click.argument("file", type=click.Path(path_type=Path))
@click.option("--model", "chosen", metavar="HEURISTIC:N", help="Show a model of a reduction.h5.")
def inspect(file: Path, chosen: str | None) -> None:
    """Show what is in an artifact and where it came from.

    Example: paramreduce inspect results/puma560/reduction.h5 --model forward-selection:18
    """
    if chosen is not None:
        _say_model(file, chosen)
        return
    attributes, datasets = contents(file)
    for name, value in attributes.items():
        say(f"{name}: {value}")
    table = rich.table.Table(box=None, pad_edge=False)
    for heading in ("dataset", "shape", "content"):
        table.add_column(heading, overflow="fold")
    for row in datasets:
        table.add_row(*(rich.markup.escape(cell) for cell in row))
    out.print(table)


def _say_model(file: Path, chosen: str) -> None:
    reduction, _ = load_file(file, Reduction, None, "reduce")
    name, _, number = chosen.partition(":")
    ordering = reduction.orderings.get(name)
    if ordering is None or not number.isdigit() or not 1 <= int(number) <= ordering.order.size:
        known = ", ".join(f"{k}:1...{o.order.size}" for k, o in reduction.orderings.items())
        raise ConfigError(f"--model {chosen}: there is {known}.")
    n = int(number)
    kept = ordering.subset(n)
    texts = approximate_expressions(reduction.names, kept, ordering.beta[n - 1])
    flag = ", minimum-norm fit beyond the rank" if ordering.minimum_norm[n - 1] else ""
    say(f"{name}, n = {n}, torque error {ordering.torque_error[n - 1]:.6g}{flag}")
    for value, text in zip(ordering.parameters[n - 1], texts, strict=True):
        say(f"{value: .9e}  =  {text}")


@cli.command(name="compare")
@click.argument("first", type=click.Path(path_type=Path))
@click.argument("second", type=click.Path(path_type=Path))
@click.option(
    "--tolerance", "given", multiple=True, metavar="QUANTITY=RELATIVE",
    help=f"Relative tolerance of {', '.join(TOLERANCES)}; may be repeated.",
)  # fmt: skip
@click.option(
    "--only", multiple=True, type=click.Choice(list(QUANTITIES)), help="Compare only this."
)
def compare_command(
    first: Path, second: Path, given: tuple[str, ...], only: tuple[str, ...]
) -> int:
    """Compare two summaries or results folders; exit code 1 if they differ too much.

    Orders are compared up to ties, trajectories by the best and the median condition number.

    Example: paramreduce compare results/reference/puma560.json results/puma560
    """
    summaries = [_load_summary(path) for path in (first, second)]
    tolerances = {**TOLERANCES, **dict(map(_tolerance, given))}
    try:
        differences = compare(summaries[0], summaries[1], tolerances, only)
    except (KeyError, TypeError, IndexError) as error:
        raise ConfigError(
            f"{first} or {second}: is no summary of this version ({error})."
        ) from error
    bad = [d for d in differences if not d.tolerated]
    for difference in bad:
        say(_difference_text(difference))
    tolerated = len(differences) - len(bad)
    if bad:
        say(f"{len(bad)} differences beyond tolerance, {tolerated} within.")
        return NOT_ACCEPTED
    say(f"{first} and {second} agree: {tolerated} differences, all within tolerance.")
    return 0


def _difference_text(d: Difference) -> str:
    return f"{d.what}: {d.first} -> {d.second}"


def _tolerance(text: str) -> tuple[str, Tolerance]:
    name, _, value = text.partition("=")
    try:
        return name, Tolerance(float(value), TOLERANCES[name].absolute)
    except (KeyError, ValueError) as error:
        raise ConfigError(
            f"--tolerance {text}: write QUANTITY=NUMBER with one of {', '.join(TOLERANCES)}."
        ) from error


def _load_summary(path: Path) -> dict[str, Any]:
    if path.is_dir():
        path = Store(path).path(Report)
    loaded = load_json(path)
    if not isinstance(loaded, dict):
        raise ConfigError(f"{path}: is no summary.json.")
    return loaded


@cli.command()
@click.option("--format", "kind", type=click.Choice(list(FORMATS)), default="text")
def graph(kind: str) -> None:
    """Print the stages with their inputs and outputs, or as rules for Make.

    Example: paramreduce graph --format make > pipelines/stages.mk
    """
    click.echo(FORMATS[kind](), nl=False)


if __name__ == "__main__":
    main()
