"""All figures of a report, drawn in this process or in several."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import NamedTuple

from paramreduce_cli.report.data import ReportData
from paramreduce_cli.report.figures import figures
from paramreduce_cli.report.style import render
from paramreduce_cli.resources.processes import start_workers

Encoded = dict[str, bytes]
"""A figure in each format; empty where there is nothing to draw."""
_AT_LEAST = 4
"""Figures for which the start of a process pays."""


def render_figures(
    names: Sequence[str],
    data: ReportData,
    formats: list[str],
    *,
    jobs: int = 1,
    on_figure: Callable[[int, str], None] = lambda *_: None,
) -> dict[str, Encoded]:
    """Return figures by name, in the given order, without those that have nothing to draw.

    Args:
        names: Names from :data:`paramreduce_cli.report.figures.figures`.
        data: Records that the figures show.
        formats: Formats in which the figures are encoded.
        jobs: Processes at most; a few figures are drawn in this one.
        on_figure: Progress callback with the number of finished figures and the name of the last one.

    Raises:
        DataError: A process died.
    """
    found: dict[str, Encoded] = {}
    jobs = min(jobs, len(names) // _AT_LEAST)
    shown = replace(data, animation=None)  # the page's alone, and large
    with start_workers(jobs, partial(_DrawingTask, shown, formats)) as pool:
        for name, encoded in pool.map_unordered(_draw, names):
            found[name] = encoded
            on_figure(len(found), name)
    return {name: found[name] for name in names if found[name]}


class _DrawingTask(NamedTuple):
    """The data of figures and the formats in which they are encoded."""

    data: ReportData
    formats: list[str]


def _draw(drawn: _DrawingTask, name: str) -> Encoded:
    return render(figures[name], drawn.data, drawn.formats)
