"""The self-contained page for people."""

import base64
import io
import json
import zipfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib import resources
from typing import Any

import jinja2

from paramreduce_cli.records import Provenance
from paramreduce_cli.report.answer import gather_answer
from paramreduce_cli.report.data import ReportData
from paramreduce_cli.report.explorer import pack_explorer
from paramreduce_cli.report.figures import figures
from paramreduce_cli.report.methods import write_methods
from paramreduce_cli.report.page_sections import PageSection, get_place
from paramreduce_cli.report.symbols import explain_symbols
from paramreduce_cli.report.tables import tables
from paramreduce_cli.texts import format_percent
from paramreduce_cli.texts.table import Table

_FIGURE_MIME = "image/svg+xml"


@dataclass(frozen=True)
class _Item:
    """A figure or a table on the page."""

    name: str
    caption: str
    source: str = ""
    """Image of a figure, as an address."""
    table: Table | None = None
    tall: bool = False
    symbols: Sequence[tuple[str, str]] = ()
    """Symbols of the headings, with what they mean."""


def render_page(
    data: ReportData,
    summary: Mapping[str, Any],
    images: Mapping[str, bytes],
    made: Mapping[str, Table],
    provenance: Provenance,
    code: Mapping[str, bytes],
) -> str:
    """Return the report as one HTML page with its figures and its explorer inside.

    Args:
        data: Records that the report shows.
        summary: Contents of summary.json.
        images: SVG of the figures that there are, by name.
        made: Tables by name.
        provenance: Provenance of the run.
        code: Files of the selected model as code, by name; empty where there is none.
    """
    environment = jinja2.Environment(autoescape=True, trim_blocks=True, lstrip_blocks=True)
    environment.filters["percent"] = format_percent
    model = data.model
    loops = model is not None and model.mechanism.loops is not None
    context = {"s": summary, "loops": loops, "answer": gather_answer(data, provenance.arguments)}
    items = _group_items(images, made)
    sections = [
        {
            "title": section.title,
            "anchor": section.name.lower(),
            "text": environment.from_string(section.text).render(context),
            "unfolded": section.unfolded,
            "items": items[section],
        }
        for section in PageSection
        if items[section] or section is PageSection.PAPER
    ]
    page = environment.from_string(_read_text("page.html"))
    methods, bibtex = write_methods(data)
    return page.render(
        title=data.title,
        style=_read_text("uplot/uPlot.min.css") + _read_text("page.css"),
        script=_read_text("uplot/uPlot.iife.min.js") + _read_text("explorer.js"),
        # Inside a script nothing may look like the end of it.
        explored=json.dumps(pack_explorer(data), separators=(",", ":")).replace("<", "\\u003c"),
        sections=sections,
        warnings=[(stage, text) for stage, texts in provenance.warnings.items() for text in texts],
        settings=json.dumps(provenance.settings, indent=2, ensure_ascii=False),
        methods=methods,
        bibtex=bibtex,
        code=_make_archive(code) if code else "",
        **context,
    )


def _make_archive(files: Mapping[str, bytes]) -> str:
    """Return files as a ZIP archive in base64; equal files give equal archives."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in files.items():
            archive.writestr(zipfile.ZipInfo(name), content, zipfile.ZIP_DEFLATED)
    return base64.b64encode(buffer.getvalue()).decode()


def render_sweep(
    title: str, records: Sequence[Mapping[str, Any]], tables: Sequence[Table], figure: bytes
) -> str:
    """Return an HTML page about many runs: their count, robots, tables and a figure.

    Args:
        title: Heading of the page.
        records: One record of numbers per run; only their number and robots are shown.
        tables: Tables to show.
        figure: SVG of all runs.
    """
    environment = jinja2.Environment(autoescape=True, trim_blocks=True, lstrip_blocks=True)
    robots = list(dict.fromkeys(record["robot"] for record in records))
    return environment.from_string(_read_text("sweep.html")).render(
        title=title, style=_read_text("page.css"), count=len(records), robots=robots, tables=tables,
        figure=_encode_source(figure),
    )  # fmt: skip


def _read_text(name: str) -> str:
    return resources.files("paramreduce_cli.report").joinpath(name).read_text("utf-8")


def _encode_source(svg: bytes) -> str:
    return f"data:{_FIGURE_MIME};base64,{base64.b64encode(svg).decode()}"


def _group_items(
    images: Mapping[str, bytes], made: Mapping[str, Table]
) -> dict[PageSection, list[_Item]]:
    """Return figures and tables by section, in their order."""
    found = []
    for name, svg in images.items():
        draw = figures[name]
        source = _encode_source(svg)
        found.append((get_place(draw), _Item(name, (draw.__doc__ or name).strip(), source)))
    for name, table in made.items():
        make = tables[name]
        place = get_place(make)
        caption = (make.__doc__ or name).strip()
        symbols = explain_symbols(name, table.header)
        item = _Item(name, caption, table=table, tall=place.tall, symbols=symbols)
        found.append((place, item))
    found.sort(key=lambda entry: entry[0].order)
    return {
        section: [item for place, item in found if place.section is section]
        for section in PageSection
    }
