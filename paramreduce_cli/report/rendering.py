"""All figures of a report, drawn in this process or in several."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

from paramreduce_cli.processes import as_done, workers
from paramreduce_cli.report.data import ReportData
from paramreduce_cli.report.figures import figures
from paramreduce_cli.report.style import render

Encoded = dict[str, bytes]
"""A figure in each format; empty where there is nothing to draw."""
_AT_LEAST = 4
"""Figures for which the start of a process pays."""


def rendered(
    names: Sequence[str],
    data: ReportData,
    formats: list[str],
    *,
    jobs: int = 1,
    told: Callable[[int, str], None] = lambda *_: None,
) -> dict[str, Encoded]:
    """Figures by name, in the order that is asked for, without those that have nothing to draw.

    Args:
        names: Of :data:`paramreduce_cli.report.figures.figures`.
        data: What they show.
        formats: In which they are encoded.
        jobs: Processes at most; a few figures are drawn in this one.
        told: How many figures are done, and the name of the last one.

    Raises:
        DataError: A process died.
    """
    found: dict[str, Encoded] = {}
    jobs = min(jobs, len(names) // _AT_LEAST)
    for name, encoded in _drawn(names, data, formats, jobs):
        found[name] = encoded
        told(len(found), name)
    return {name: found[name] for name in names if found[name]}


def _drawn(
    names: Sequence[str], data: ReportData, formats: list[str], jobs: int
) -> Iterator[tuple[str, Encoded]]:
    """In any order."""
    if jobs < 2:
        yield from ((name, render(figures[name], data, formats)) for name in names)
        return
    data = replace(data, animation=None)  # the page's alone, and large
    with workers(jobs, _start_worker, data, formats) as pool:
        yield from as_done(pool, _in_worker, names)


class _Worker:
    """What a worker process knows; set once when it starts."""

    data: ReportData
    formats: list[str]


def _start_worker(data: ReportData, formats: list[str]) -> None:
    _Worker.data, _Worker.formats = data, formats


def _in_worker(name: str) -> Encoded:
    return render(figures[name], _Worker.data, _Worker.formats)
