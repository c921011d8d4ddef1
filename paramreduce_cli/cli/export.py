"""The command that writes a reduced model as code."""

from __future__ import annotations

from pathlib import Path

import click

from paramreduce_cli.artifacts.atomic import atomically
from paramreduce_cli.artifacts.store import Store, load_file
from paramreduce_cli.cli.stages import CONFIG, RESULTS, SET
from paramreduce_cli.cli.terminal import say
from paramreduce_cli.config import load_config
from paramreduce_cli.records import Model, Reduction, Validation
from paramreduce_cli.registry import exporter
from paramreduce_cli.stages.export import WHAT, chosen_model
from paramreduce_cli.stages.export import export as exported


@click.command()
@CONFIG
@RESULTS
@SET
@click.option(
    "--format", "kind", type=click.Choice(sorted(exporter)), default="c", show_default=True,
    help="Language of the code.",
)  # fmt: skip
@click.option(
    "--what", type=click.Choice(list(WHAT)), default="both", show_default=True,
    help="Inverse dynamics, direct dynamics [M | delta], both, or the regressor.",
)  # fmt: skip
@click.option(
    "--model", "text", metavar="HEURISTIC:N", help="Or full, or base.  [default: the selected one]"
)
@click.option("--constants", is_flag=True, help="Put the parameters' values into the code.")
@click.option("--single", is_flag=True, help="Single precision, in C.")
@click.option(
    "--output", type=click.Path(path_type=Path, file_okay=False), metavar="DIR",
    help="[default: RESULTS/export/FORMAT]",
)  # fmt: skip
def export(
    config: Path,
    results: Path | None,
    overrides: tuple[str, ...],
    kind: str,
    what: str,
    text: str | None,
    constants: bool,
    single: bool,
    output: Path | None,
) -> None:
    """Write a model as code with the fewest operations known.

    The code is checked against plain recursion on random states before it is written. For
    mechanisms with loops it also solves positions, velocities and accelerations.

    Example: paramreduce export configs/puma560.yaml --format c --model best-subset:18
    """
    loaded = load_config(config, overrides)
    store = Store(results or Path("results") / loaded.robot)
    if single and kind != "c":
        raise click.UsageError("--single goes with --format c.")
    model = load_file(store.path(Model), Model, loaded.robot, "build-model")[0]
    reduction = validation = None
    if text not in ("full", "base"):
        reduction = load_file(store.path(Reduction), Reduction, loaded.robot, "reduce")[0]
        if text is None:
            path = store.path(Validation)
            validation = load_file(path, Validation, loaded.robot, "validate")[0]
    chosen = chosen_model(text, model, reduction, validation)
    files = exported(model, chosen, kind=kind, what=what, constant=constants, single=single)
    folder = output or store.folder / "export" / kind
    for name, content in files.items():
        with atomically(folder / name) as path:
            path.write_bytes(content)
    say(f"{chosen.title}: {', '.join(files)} in {folder}")
