"""The self-contained page for people."""

from __future__ import annotations

import base64
from collections.abc import Mapping
from importlib import resources
from typing import Any

import jinja2

from paramreduce_cli.report.data import ReportData
from paramreduce_cli.report.tables import Table, percent

_FIGURE_MIME = "image/svg+xml"


def render_page(
    data: ReportData,
    summary: Mapping[str, Any],
    figures: Mapping[str, tuple[str, bytes]],
    tables: Mapping[str, Table],
) -> str:
    """The report as one HTML page with its figures inside.

    Args:
        data: What the report is made from.
        summary: As in summary.json.
        figures: Caption and SVG by name.
        tables: By name.
    """
    environment = jinja2.Environment(autoescape=True, trim_blocks=True, lstrip_blocks=True)
    environment.filters["percent"] = lambda v: "∞" if v is None else percent(v)
    text = resources.files("paramreduce_cli.report").joinpath("page.html").read_text("utf-8")
    images = {
        name: {
            "caption": caption,
            "source": f"data:{_FIGURE_MIME};base64,{base64.b64encode(svg).decode()}",
        }
        for name, (caption, svg) in figures.items()
    }
    return environment.from_string(text).render(
        title=data.title,
        loops=data.model.mechanism.loops is not None,
        s=summary,
        figures=images,
        tables=tables,
    )
