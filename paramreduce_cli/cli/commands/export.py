"""The command that writes a reduced model as code."""

import contextlib
from pathlib import Path
from typing import Any

import click

from paramreduce_cli.artifacts.report_files import save_files
from paramreduce_cli.artifacts.store import Store
from paramreduce_cli.cli.example_command import ExampleCommand
from paramreduce_cli.cli.exporting import load_current
from paramreduce_cli.cli.options import OPTIONAL_CONFIG, RESULTS, SET, make_store
from paramreduce_cli.cli.terminal import LOG, VERBOSE, say, show_progress
from paramreduce_cli.config import Config, load_config
from paramreduce_cli.errors import ArtifactError, ConfigError
from paramreduce_cli.export.code_generation import Exported, adapt_kinds, make_exported_model
from paramreduce_cli.export.languages import languages
from paramreduce_cli.export.named_models import (
    BASE,
    CONSISTENT,
    FULL,
    IDENTIFIED,
    find_chosen_model,
    find_pruned_model,
)
from paramreduce_cli.export.robot_file import write_robot_file
from paramreduce_cli.export.values import VALUES, write_values
from paramreduce_cli.importing.formats import formats
from paramreduce_cli.judgement.leanest import find_leanest
from paramreduce_cli.records import (
    TERMS,
    FloatArray,
    Identification,
    Model,
    ReducedModel,
    Reduction,
    TermReduction,
    Validation,
)
from paramreduce_cli.reduction.models import find_closest_standard

_FUNCTIONS = {
    str(Exported.IDM): "inverse",
    str(Exported.DDM): "direct",
    str(Exported.FORWARD_DYNAMICS): "direct",
}
"""Functions that have pruned terms, by what is exported of them."""
LEANEST = "leanest"
"""The model of whichever function is asked for that has it with the fewest operations."""
_LONGEST_NAME = 60
"""Characters of a name, at most."""
_WITH_PRECISION = ("c", "rust")
"""Languages whose code has a precision of its own."""
_OF_ONE = (TERMS, LEANEST)
"""Models of one function alone."""
_OF_A_ROBOT = (FULL, BASE, IDENTIFIED, CONSISTENT, *_OF_ONE)
"""Models that need more than an observation matrix."""


@click.command(cls=ExampleCommand, example="export {config} --format matlab --what idm")
@OPTIONAL_CONFIG
@RESULTS
@SET
@click.option(
    "--format", "kind", type=click.Choice([*sorted(languages), *formats, VALUES]), default="c", show_default=True,
    help="Language of the code. urdf and mjcf write the robot's own file with the model's parameters, values writes JSON.",
)  # fmt: skip
@click.option(
    "--what", type=click.Choice([str(what) for what in Exported]), multiple=True, default=["both"], show_default=True,
    help="Function to export; give it several times for several in one file: inverse dynamics (idm), direct dynamics [M | delta] (ddm), both, the regressor, or a part: torques at rest (gravity), Coriolis torques C dz, all torques without acceleration (nonlinear), M (mass-matrix), C in Christoffel form (coriolis-matrix), momentum and its rate (momentum), derivatives of the inverse dynamics (derivatives), accelerations (forward-dynamics).",
)  # fmt: skip
@click.option(
    "--model",
    "text",
    metavar="HEURISTIC:N",
    help="Model to export: HEURISTIC:N, full or base; with a log also identified or consistent; terms (one function with pruned terms); leanest (fewest operations within the limits of selected and terms).  [default: the selected model]",
)
@click.option("--constants", is_flag=True, help="Write the values of the parameters into the code.")
@click.option("--name", default="", help="Name that files and functions begin with.  [default: that of the robot]")  # fmt: skip
@click.option("--single", is_flag=True, help="Use single precision (C and Rust).")
@click.option(
    "-o", "--output", type=click.Path(path_type=Path, file_okay=False), metavar="DIR",
    help="[default: RESULTS/export/FORMAT]",
)  # fmt: skip
@VERBOSE
@LOG
def export(
    config: Path | None,
    results: Path | None,
    overrides: tuple[str, ...],
    kind: str,
    what: tuple[str, ...],
    text: str | None,
    constants: bool,
    name: str,
    single: bool,
    output: Path | None,
) -> None:
    """Write a model as code with few operations.

    The code is compared with textbook recursion on random states before it is written. For
    mechanisms with loops it also solves positions, velocities and accelerations.

    For user-supplied samples without a CONFIG, only --format values works.
    """
    loaded = load_config(config, overrides) if config is not None else None
    store = make_store(loaded, results)
    if loaded is None and (kind != VALUES or text in _OF_A_ROBOT):
        raise click.UsageError(
            f"Code and robots' files need a CONFIG. Without a CONFIG only --format {VALUES} works."
        )
    if single and kind not in _WITH_PRECISION:
        raise click.UsageError(f"--single needs --format {' or --format '.join(_WITH_PRECISION)}.")
    if (
        kind in (*formats, VALUES)
        and (what != (Exported.BOTH,) or constants or name)
        and text not in _OF_ONE
    ):
        raise click.UsageError(
            f"--what, --constants and --name apply to code, not to --format {kind}."
        )
    if text in _OF_ONE and kind in formats:
        raise click.UsageError(
            f"--model {text}: these values are valid for one function only, not for a robot's file. "
            f"Write code, or use --format {VALUES}."
        )
    if len(name) > _LONGEST_NAME:
        raise click.UsageError(f"--name is too long. Give at most {_LONGEST_NAME} characters.")
    if text == TERMS and loaded is not None and loaded.terms is None:
        raise click.UsageError(
            f"--model {TERMS}: the config has no terms section. Add one, such as terms: {{torque_error: 0.01}}, and run "
            "reduce-terms."
        )
    single_function = _FUNCTIONS.get(what[0], "") if len(what) == 1 else ""
    if text in _OF_ONE and not single_function:
        raise click.UsageError(
            f"--model {text}: each function has its own values. Give one: --what {' or --what '.join(_FUNCTIONS)}."
        )
    if text == LEANEST:
        assert loaded is not None
        text = _find_leanest(loaded, store, single_function)
    records: list[type] = [] if loaded is None else [Model]
    if text == TERMS:
        records.append(TermReduction)
    elif text in (IDENTIFIED, CONSISTENT):
        records.append(Identification)
    elif text not in (FULL, BASE):
        records += [Reduction] if text is not None else [Reduction, Validation]
    loading = {record: load_current(loaded, store, record) for record in records}
    if Reduction in loading and Validation not in loading:
        with contextlib.suppress(ArtifactError):  # it only tells more
            loading[Validation] = load_current(loaded, store, Validation)
    simplified = None
    if text == TERMS:
        chosen, simplified, title = find_pruned_model(loading[TermReduction], single_function)
    else:
        chosen, title = find_chosen_model(
            text,
            loading.get(Model),
            loading.get(Reduction),
            loading.get(Validation),
            loading.get(Identification),
        )
    stamp = store.read_stamp(records[-1])
    folder = output or store.folder / "export" / kind
    origin = f"{store.get_path(records[-1]).name} {stamp.digest[:12] if stamp else ''}"
    if kind == VALUES:
        known = loading[Model].mechanism if Model in loading else None
        files = write_values(chosen, title, origin, known, simplified)
    elif kind in formats:
        assert loaded is not None
        files = write_robot_file(
            loaded, loading[Model], _find_standard(loading, text, chosen), kind
        )
    else:
        with show_progress("export") as progress:
            checked = make_exported_model(
                loading[Model],
                chosen,
                title=title,
                what=adapt_kinds([Exported(function) for function in what], kind),
                name=name,
                constant=constants,
                single=single,
                simplified=simplified,
                origin=origin,
                validation=loading.get(Validation),
                report_progress=progress,
            )
        files = languages[kind](checked)
    save_files(folder, files)
    say(f"{title}: {', '.join(files)} in {folder}")


def _find_leanest(config: Config, store: Store, function: str) -> str:
    """Return the name of the model whose function has the fewest operations within the config's limits.

    Raises:
        ConfigError: No function is within the limits.
    """
    validation = load_current(config, store, Validation)
    terms = load_current(config, store, TermReduction) if config.terms is not None else None
    found = find_leanest(function, config.selected, validation.heuristics, terms)
    if found is None:
        raise ConfigError(
            f"--model {LEANEST}: no model's {function} dynamics is within the limits. Set selected.torque_error, or raise it."
        )
    return found.model


def _find_standard(loading: dict[type, Any], text: str | None, chosen: ReducedModel) -> FloatArray:
    """Return standard parameters for a robot's file.

    For base parameters they are the closest to the robot's own among all that give the same torques; those of
    consistent models are taken as they are.
    """
    if text == CONSISTENT:
        consistent: FloatArray = loading[Identification].consistency.standard
        return consistent
    return find_closest_standard(loading[Model], chosen)
