"""Commands that run stages; derived from their signatures, nothing about a stage is written here."""

import os
import statistics
from collections.abc import Callable
from pathlib import Path
from typing import Any

import click
import rich.box
import rich.table

from paramreduce_cli.artifacts.report_files import load_json
from paramreduce_cli.artifacts.store import Store, file_of, load_file
from paramreduce_cli.cli.terminal import err, interruption, out, progress_bars, remark, say
from paramreduce_cli.config import Config, load_config, placed_errors
from paramreduce_cli.errors import ConfigError
from paramreduce_cli.pipeline import Stage, stages_to_run
from paramreduce_cli.records import Report, Validation
from paramreduce_cli.runner import Outcome, Runner
from paramreduce_cli.texts import share

NOT_ACCEPTED = 1
_TABLE_WIDTH = 110

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


def stage_command(stage: Stage) -> click.Command:
    config_optional = not stage.needs_config

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
        if config is None and overrides:
            raise click.UsageError("--set changes keys of a CONFIG; give one.")
        loaded = load_config(config, overrides) if config is not None else None
        store = _store(loaded, results)
        placed = placed_errors(config, overrides)
        with placed, store.locked(), progress_bars(quiet) as progress:
            runner = Runner(
                loaded, store, jobs or _cores(), progress, samples, remark, interruption.heeded
            )
            outcome = runner.run(stage, force=force, go_on=True)
        if not quiet:
            _say_outcome(outcome)
        return _exit_code(stage, outcome, quiet)

    params: list[Any] = [RESULTS, SET, FORCE, QUIET]
    if stage.lends_run is not None:
        params.append(JOBS)
    if config_optional:
        params.append(
            click.option(
                "--samples", type=click.Path(path_type=Path, dir_okay=False), metavar="FILE",
                help="A samples.h5 of your own; then no CONFIG is needed.",
            )
        )  # fmt: skip
    params.append(
        click.argument(
            "config", type=click.Path(path_type=Path, dir_okay=False), required=not config_optional
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


def _say_outcome(outcome: Outcome) -> None:
    state = "up to date" if outcome.current else f"{outcome.seconds:.1f} s"
    say(f"{outcome.stage}: {state}, {outcome.path}")


def _exit_code(stage: Stage, outcome: Outcome, quiet: bool) -> int:
    if stage.output is not Validation:
        return 0
    record = outcome.record or load_file(outcome.path, Validation, None, stage.name)[0]
    if not quiet:
        for entry in record.remarks:
            remark(entry.text.rstrip("."))
    return _say_verdict(record.accepted, record.verdict, quiet)


def _say_verdict(accepted: bool, verdict: str, quiet: bool) -> int:
    if not accepted:
        err.print(f"Not accepted: {verdict}", markup=False)
        return NOT_ACCEPTED
    if not quiet:
        say(verdict)
    return 0


@click.command()
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
    with placed_errors(config, overrides), store.locked():
        for stage in stages_to_run(loaded):
            with progress_bars(quiet) as progress:
                runner = Runner(
                    loaded, store, jobs or _cores(), progress, None, remark, interruption.heeded
                )
                outcome = runner.run(stage, force=force)
            if not quiet:
                _say_outcome(outcome)
    summary = load_json(store.path(Report))
    if not quiet:
        _say_summary(summary)
        say(f"Report: {store.path(Report).with_name('index.html')}")
    selected = summary["selected"]
    if not quiet:
        say(f"Selected: {selected['reason']}")
        for text in selected["remarks"]:
            remark(text.rstrip("."))
    return _say_verdict(selected["accepted"], selected["verdict"], quiet)


def _say_summary(summary: dict[str, Any]) -> None:
    model, n = summary["model"], summary["selected"]["n"]
    say(
        f"\n{summary['robot']}: {model['n_parameters']} parameters, {model['n_affecting']} act on the "
        f"torques, {model['n_base']} base parameters"
    )
    trajectories = summary["trajectories"]
    if trajectories is not None:
        kappas = [t["kappa"] for t in trajectories["estimation"]]
        say(
            f"{len(kappas)} trajectories, {trajectories['scaling']} kappa: best {min(kappas):.4g}, "
            f"median {statistics.median(kappas):.4g}, worst {max(kappas):.4g}"
        )
    table = rich.table.Table(title=f"Reduced models with {n} parameters", box=rich.box.SIMPLE)
    headings = ("heuristic", "ε_τ E", "ε_τ V", "ε_z̈ E", "ε_z̈ V", "d", "M|δ")
    for k, heading in enumerate(headings):
        table.add_column(heading, justify="left" if k == 0 else "right", no_wrap=True)
    for name, rows in summary["validation"].items():
        for row in rows:
            if row["n"] == n:
                table.add_row(name, *_summary_cells(row))
    full = summary["full"]
    operations = (f"{full['operations_inverse']:.0f}", f"{full['operations_direct']:.0f}")
    table.add_row("full model", "", "", "", "", *operations)
    out.print(table, width=max(out.width, _TABLE_WIDTH))


def _summary_cells(row: dict[str, Any]) -> list[str]:
    cells = []
    for part in ("torque_error", "acceleration_error"):
        for which in ("estimation", "validation"):
            value = row[part][which]
            cells.append(share(value))
    return [*cells, str(row["operations"]["inverse"]), str(row["operations"]["direct"])]
