"""The command that shows what is in a file."""

from pathlib import Path

import click
import rich.markup
import rich.table

from paramreduce_cli.artifacts.inspection import contents
from paramreduce_cli.artifacts.report_files import load_summary
from paramreduce_cli.cli.terminal import harmless, out, say
from paramreduce_cli.errors import ConfigError
from paramreduce_cli.records import ModelChoice, Reduction


@click.command()
@click.argument("file", type=click.Path(path_type=Path))
@click.option("--model", "chosen", metavar="HEURISTIC:N", help="Show a model of a reduction.h5.")
def inspect(file: Path, chosen: str | None) -> None:
    """Show what is in an artifact and where it came from.

    Example: paramreduce inspect results/puma560/reduction.h5 --model forward-selection:18
    """
    if chosen is not None:
        _say_model(file, chosen)
        return
    if file.suffix == ".json":
        loaded = load_summary(file)
        for key, value in {**loaded.get("provenance", {}), **loaded.get("selected", {})}.items():
            say(f"{key}: {value}")
        return
    attributes, datasets = contents(file)
    for name, value in attributes.items():
        say(f"{name}: {value}")
    table = rich.table.Table(box=None, pad_edge=False)
    for heading in ("dataset", "shape", "content"):
        table.add_column(heading, overflow="fold")
    for row in datasets:
        table.add_row(*(rich.markup.escape(harmless(cell)) for cell in row))
    out.print(table)


def _say_model(file: Path, chosen: str) -> None:
    from paramreduce_cli.artifacts.store import load_file  # these load all numerics
    from paramreduce_cli.reduction.models import known_choices, reduced_model

    reduction, _ = load_file(file, Reduction, None, "reduce")
    choice = ModelChoice.parse(chosen)
    row = choice.row(reduction)
    if row is None:
        raise ConfigError(f"--model {chosen}: there is {known_choices(reduction)}.")
    found = reduction.heuristics[choice.heuristic]
    model = reduced_model(reduction, choice.heuristic, row)
    flag = ", minimum-norm fit beyond the rank" if found.minimum_norm[row] else ""
    say(f"{choice.heuristic}, n = {model.n}, torque error {found.torque_error[row]:.6g}{flag}")
    for value, text in zip(model.values, model.expressions, strict=True):
        say(f"{value: .9e}  =  {text}")
