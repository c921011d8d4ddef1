"""The command that runs everything."""

import statistics
from pathlib import Path
from typing import Any

import click
import rich.box
import rich.table

from paramreduce_cli.artifacts.atomic import make_missing_error
from paramreduce_cli.artifacts.report_files import load_summary
from paramreduce_cli.cli.example_command import ExampleCommand
from paramreduce_cli.cli.options import (
    CONFIG,
    FORCE,
    JOBS,
    QUIET,
    RESULTS,
    SET,
    count_cores,
    make_callbacks,
    make_store,
)
from paramreduce_cli.cli.stage_messages import say_outcome, say_verdict
from paramreduce_cli.cli.terminal import (
    JSON,
    LOG,
    VERBOSE,
    emit,
    say,
    say_table,
    show_progress,
    warn_user,
)
from paramreduce_cli.config import load_config, locate_errors
from paramreduce_cli.records import Report
from paramreduce_cli.resources.memory import release_memory
from paramreduce_cli.running.pipeline import find_missing_files, list_stages_to_run
from paramreduce_cli.running.runner import Runner, format_arguments
from paramreduce_cli.texts import format_percent, format_percent_range

_TABLE_WIDTH = 110
_MOST_PLACES = 8
"""Lines that a warning names."""


@click.command(cls=ExampleCommand, example="run {config}")
@CONFIG
@RESULTS
@SET
@FORCE
@QUIET
@JOBS
@JSON
@VERBOSE
@LOG
def run(
    config: Path,
    results: Path | None,
    overrides: tuple[str, ...],
    force: bool,
    quiet: bool,
    jobs: int | None,
    as_json: bool,
) -> int:
    """Run all stages in order, skipping what is up to date.

    The command ends with a summary table and the path of the report. The exit code is 1 if the selected model is not
    accepted.

    With --json every event is printed as a line: stages, progress, and at the end the verdict.
    """
    quiet = quiet or as_json
    loaded = load_config(config, overrides)
    store = make_store(loaded, results)
    _warn_of_open_tasks(config)
    for path, key in find_missing_files(loaded):
        raise make_missing_error(
            path,
            remedy=f"It is named under {key} in {config}, whose comments may say where it is from.",
        )
    with locate_errors(config, overrides), store.lock():
        words = format_arguments(config, results, overrides)
        _say_what_is_replaced(
            Runner(loaded, store, arguments=words), changed=bool(overrides) and results is None
        )
        stages = list_stages_to_run(loaded)
        for number, stage in enumerate(stages, 1):
            label = f"{number}/{len(stages)} {stage.name}"
            with show_progress(label, quiet, as_json) as progress:
                runner = Runner(
                    loaded, store, jobs or count_cores(), make_callbacks(progress), arguments=words
                )
                outcome = runner.run(stage, force=force)
            if as_json:
                emit(event="stage", stage=stage.name, up_to_date=outcome.current,
                     seconds=outcome.seconds, path=str(outcome.path))  # fmt: skip
            elif not quiet:
                say_outcome(outcome)
            del outcome  # its record is large, and the next stage reads what it needs
            release_memory()
    summary = load_summary(store.get_path(Report))
    if not quiet:
        _say_summary(summary)
        say(f"Report: {store.get_path(Report).with_name('index.html')}")
    selected = summary["selected"]
    if as_json:
        page = store.get_path(Report).with_name("index.html")
        emit(event="done", report=str(page), selected=selected)
    if not quiet:
        say(f"Selected: {selected['reason']}")
        for text in selected["remarks"]:
            warn_user(text.rstrip("."))
    return say_verdict(selected["accepted"], selected["verdict"], quiet)


def _warn_of_open_tasks(config: Path) -> None:
    """Warn if a config still has TODO marks; skip pipes, which can be read only once."""
    if not config.is_file():
        return
    lines = config.read_text(encoding="utf-8", errors="replace").splitlines()
    marked = [str(k) for k, line in enumerate(lines, start=1) if "# TODO" in line]
    if marked:
        more = ", ..." if len(marked) > _MOST_PLACES else ""
        warn_user(
            f"{config}: line {', '.join(marked[:_MOST_PLACES])}{more}: marked TODO; replace the "
            "template's numbers there"
        )


def _say_what_is_replaced(runner: Runner, *, changed: bool) -> None:
    """Warn if results of another config, or of other --set options, will be replaced."""
    assert runner.config is not None
    others = [s for s in list_stages_to_run(runner.config) if runner.is_of_other_config(s)]
    if not others:
        return
    stamp = runner.store.read_stamp(others[0].output)
    owner = stamp.config if stamp is not None else ""
    folder = runner.store.folder
    if owner not in ("", runner.config_name):
        warn_user(
            f"{folder} holds results of {owner}. Results of {runner.config_name} replace them from {others[0].name} on. To keep "
            "both, change robot: in one config, or name another folder with --results"
        )
    elif changed:
        warn_user(
            f"{folder} holds results of other settings. --set replaces them from "
            f"{others[0].name} on. To keep both, name another folder with --results"
        )


def _say_summary(summary: dict[str, Any]) -> None:
    """Print the table at the end of a run."""
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
    tested = summary["selected"]["torque_error"]["test"] is not None
    table = rich.table.Table(title=f"Reduced models with {n} parameters", box=rich.box.SIMPLE)
    parts = ("median", "worst") if tested else ("est.", "val.")
    headings = [
        "heuristic",
        *(f"{what}\nerror,\n{part}" for what in ("torque", "accel.") for part in parts),
        *(f"ops,\n{function}" for function in ("inv.", "dir.")),
    ]
    for k, heading in enumerate(headings):
        table.add_column(heading, justify="left" if k == 0 else "right", no_wrap=True)
    for name, rows in summary["validation"].items():
        for row in rows:
            if row["n"] == n:
                table.add_row(name, *_list_cells(row, tested=tested))
    full = summary["full"]
    operations = (f"{full['operations_inverse']:.0f}", f"{full['operations_direct']:.0f}")
    found = summary["identification"]
    table.add_row("full model" if found is None else "all parameters", "", "", "", "", *operations)
    say_table(table, _TABLE_WIDTH)
    if tested:
        say("Errors: median and worst of the motions in the test set, which no search has seen.")
    else:
        say("Errors: on the estimation and on the validation set.")
    say("Ops: operations of the inverse dynamics, and of mass matrix and bias (direct dynamics).")
    for one in summary["terms"]:
        texts = "".join(
            f", {what} error {known}"
            for what in ("torque", "acceleration")
            if (known := _format_errors(one[f"{what}_error"]))
        )
        say(
            f"Negligible terms removed, {one['function']} dynamics: {one['operations']} operations{texts}"
        )
    if found is not None:
        say(found["comparison"])
        if found["payload"] is not None:
            say(_describe_payload(found["payload"]))
        if found["consistent"] is not None:
            say(
                f"Physically consistent parameters: {format_percent(found['consistent']['held_out'])} held out"
            )


def _describe_payload(payload: dict[str, Any]) -> str:
    """Return a sentence on the payload that was identified alone: its values with 95 % intervals."""
    values = ", ".join(
        f"{name} = {value:.4g} ± {payload['half_widths'][name]:.2g}"
        for name, value in payload["values"].items()
    )
    return f"Payload alone, with 95 % intervals: {values} (SI units). Its error is {format_percent(payload['held_out'])} held out."


def _list_cells(row: dict[str, Any], *, tested: bool) -> list[str]:
    """Return errors and operations of a model as cells of the table: on the test set if there is one, else on both
    other sets.
    """
    cells = []
    for what in ("torque_error", "acceleration_error"):
        error = row[what]
        if tested:
            error, keys = error["test"] or {}, ("median", "worst")
        else:
            keys = ("estimation", "validation")
        cells += [format_percent(error.get(key)) for key in keys]
    return [*cells, str(row["operations"]["inverse"]), str(row["operations"]["direct"])]


def _format_errors(error: dict[str, Any]) -> str:
    """Return the errors of a function on the test set, or on the other sets; empty if none are known."""
    if error["test"] is not None:
        return format_percent_range(**error["test"])
    return " / ".join(format_percent(one) for one in error.values() if one is not None)
