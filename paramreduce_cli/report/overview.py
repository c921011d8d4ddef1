"""One table over several robots: what their selected models are worth [Ros2019], Table 13."""

from collections.abc import Mapping, Sequence
from typing import Any

from paramreduce_cli.records import NO_MOTIONS, ErrorRange
from paramreduce_cli.report.symbols import ACCELERATION_HEADINGS, TORQUE_HEADINGS
from paramreduce_cli.texts import format_percent, format_percent_range
from paramreduce_cli.texts.table import Table

Summary = Mapping[str, Any]

HEADER = (
    "heuristic", "acting", "base", "n", "operations inverse, full", "operations inverse", "saved, inverse", *TORQUE_HEADINGS,
    "operations direct, full", "operations direct", "saved, direct", *ACCELERATION_HEADINGS,
)  # fmt: skip


def make_overview(rows: Sequence[tuple[str, ...]]) -> Table:
    """Return a table of the selected model of every robot, or run, beside its full one, inverse and direct dynamics."""
    return Table("Reduced models", ("robot", *HEADER), tuple(rows))


def make_overview_row(summary: Summary, name: str = "") -> tuple[str, ...]:
    """Return the row of one robot.

    Args:
        summary: Contents of its ``summary.json``.
        name: Name of the run, where the robot's name is not enough.

    Raises:
        KeyError, TypeError, ValueError: It is no such summary.
    """
    model, selected = summary["model"], summary["selected"]
    return (
        name or summary["robot"],
        selected["heuristic"],
        str(model["n_affecting"]),
        str(model["n_base"]),
        str(selected["n"]),
        *_make_cells(summary, "inverse", "torque_error"),
        *_make_cells(summary, "direct", "acceleration_error"),
    )


def _make_cells(summary: Summary, name: str, error: str) -> tuple[str, ...]:
    """Return the cells of one function from a summary."""
    errors, reduced = summary["selected"][error], summary["selected"]["operations"][name]
    full = summary["full"].get(f"operations_{name}")
    test = ErrorRange(**errors["test"]) if errors.get("test") else NO_MOTIONS
    return make_function_cells(
        name, full, reduced, errors["estimation"], errors["validation"], test
    )


def make_function_cells(
    name: str,
    full: float | None,
    reduced: float | None,
    estimation: float | None,
    validation: float | None,
    test: ErrorRange,
) -> tuple[str, ...]:
    """Return cost and errors of one function: operations of both models, errors on all sets.

    Without a mechanism nothing is counted, and accelerations are not known.
    """
    errors = format_percent(estimation), format_percent(validation), format_percent_range(*test)
    if full is None or reduced is None:
        return "-", "-", "-", *(errors if name == "inverse" else ("-", "-", "-"))
    saved = f"{100 * (1 - reduced / full):.0f} %" if full else "-"
    return f"{full:.0f}", f"{reduced:.0f}", saved, *errors
