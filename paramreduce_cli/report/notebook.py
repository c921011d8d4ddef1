"""Results as HTML for notebooks: the selected model, and all heuristics at its size."""

from collections.abc import Mapping
from html import escape
from typing import Any

from paramreduce_cli.texts import format_percent, format_percent_range


def format_results_html(summary: Mapping[str, Any]) -> str:
    """Return the verdict and a table of all heuristics at the selected size.

    Args:
        summary: Contents of summary.json.
    """
    selected = summary["selected"]
    rows = "".join(
        f"<tr><td>{escape(name)}</td><td>{_format_error(row['torque_error'])}</td>"
        f"<td>{row['operations']['inverse']}</td><td>{row['operations']['direct']}</td></tr>"
        for name, found in summary["validation"].items()
        for row in found
        if row["n"] == selected["n"]
    )
    heading = "".join(
        f"<th>{text}</th>"
        for text in ("heuristic", "torque error", "operations, inverse", "operations, direct")
    )
    return (
        f"<p><b>{escape(summary['robot'])}</b>: {escape(selected['heuristic'])} with {selected['n']} of "
        f"{summary['model']['n_parameters']} parameters. {escape(selected['verdict'])}</p>"
        f"<table><tr>{heading}</tr>{rows}</table>"
    )


def _format_error(error: Mapping[str, Any]) -> str:
    """Return the error on the test set, or on the validation set without a test set."""
    if error["test"] is not None:
        return format_percent_range(**error["test"])
    return format_percent(error["validation"])
