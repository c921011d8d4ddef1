"""The self-contained page for people."""

import base64
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib import resources
from typing import Any

import jinja2

from paramreduce_cli.report.data import ReportData
from paramreduce_cli.report.figures import figures
from paramreduce_cli.report.sections import PageSection, place_of
from paramreduce_cli.report.table import Table
from paramreduce_cli.report.tables import tables
from paramreduce_cli.texts import share

_FIGURE_MIME = "image/svg+xml"


@dataclass(frozen=True)
class _Item:
    """A figure or a table on the page."""

    name: str
    caption: str
    source: str = ""
    """Of a figure's image."""
    table: Table | None = None
    tall: bool = False


def render_page(
    data: ReportData,
    summary: Mapping[str, Any],
    images: Mapping[str, bytes],
    made: Mapping[str, Table],
) -> str:
    """The report as one HTML page with its figures inside.

    Args:
        data: What the report is made from.
        summary: As in summary.json.
        images: SVG of the figures that there are, by name.
        made: Tables by name.
    """
    environment = jinja2.Environment(autoescape=True, trim_blocks=True, lstrip_blocks=True)
    environment.filters["percent"] = share
    model = data.known_model
    loops = model is not None and model.mechanism.loops is not None
    context = {"s": summary, "loops": loops}
    items = _items(images, made)
    sections = [
        {
            "title": section.title,
            "text": environment.from_string(section.text).render(context),
            "items": items[section],
        }
        for section in PageSection
        if items[section]
    ]
    page = environment.from_string(_text("page.html"))
    return page.render(title=data.title, style=_text("page.css"), sections=sections, **context)


def render_sweep(title: str, records: Sequence[Mapping[str, Any]], tables: Sequence[Table]) -> str:
    """Many runs as one HTML page.

    Args:
        title: Its heading.
        records: Of the runs.
        tables: What is shown of them.
    """
    environment = jinja2.Environment(autoescape=True, trim_blocks=True, lstrip_blocks=True)
    robots = list(dict.fromkeys(record["robot"] for record in records))
    return environment.from_string(_text("sweep.html")).render(
        title=title, style=_text("page.css"), count=len(records), robots=robots, tables=tables
    )


def _text(name: str) -> str:
    return resources.files("paramreduce_cli.report").joinpath(name).read_text("utf-8")


def _items(
    images: Mapping[str, bytes], made: Mapping[str, Table]
) -> dict[PageSection, list[_Item]]:
    """Figures and tables by section, in their order; empty tables are left out."""
    found = []
    for name, svg in images.items():
        draw = figures[name]
        source = f"data:{_FIGURE_MIME};base64,{base64.b64encode(svg).decode()}"
        found.append((place_of(draw), _Item(name, (draw.__doc__ or name).strip(), source)))
    for name, table in made.items():
        if table.rows:
            make = tables[name]
            place = place_of(make)
            caption = (make.__doc__ or name).strip()
            found.append((place, _Item(name, caption, table=table, tall=place.tall)))
    found.sort(key=lambda entry: entry[0].order)
    return {
        section: [item for place, item in found if place.section is section]
        for section in PageSection
    }
