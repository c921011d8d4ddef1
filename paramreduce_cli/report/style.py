"""How all figures are drawn, and what several of them have in common."""

import io
import textwrap
from collections.abc import Callable
from typing import Any, TypeVar

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from paramreduce_cli.records import FloatArray
from paramreduce_cli.report.curves import gather_curves
from paramreduce_cli.report.data import ReportData

D = TypeVar("D")
"""What is drawn."""

STYLE = {
    "figure.figsize": (8.4, 3.8),
    "font.size": 9.5,
    "font.family": "DejaVu Sans",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#e3e6ea",
    "grid.linewidth": 0.7,
    "axes.edgecolor": "#8a929c",
    "axes.labelcolor": "#30363d",
    "xtick.color": "#57606a",
    "ytick.color": "#57606a",
    "lines.linewidth": 1.5,
    "legend.frameon": False,
    "figure.constrained_layout.use": True,
    "svg.hashsalt": "paramreduce",
    "svg.fonttype": "path",
    "pdf.fonttype": 42,
}
"""Style on the page, and in pictures for slides."""
COLUMN = {
    "figure.figsize": (3.5, 2.4),
    "font.size": 8.5,
    "axes.linewidth": 0.6,
    "axes.labelsize": "small",
    "xtick.labelsize": "small",
    "ytick.labelsize": "small",
    "lines.linewidth": 1.0,
}
"""What differs in a column of a paper, 3.5 inches wide, where the PDF is included as it is."""
_NARROW = 5.0
"""Inches below which plots stand under each other, and legends under plots."""
_JOINT_COLOURS = ("#0b6e99", "#d9730d", "#2f8f5b", "#8e5bb5", "#c2384f", "#7a6a53", "#4d7c8a")
_LINES = ("-", "--", ":", "-.")
FUNCTIONS = (("inverse", "d", "-"), ("direct", "[M | δ]", "--"))
"""Names of the dynamics in records and in figures, and their lines."""
FLOOR = 1e-7
"""Where errors are cut off below: what is less is round-off."""
HIGHEST_ERROR = 1e3
_LONG_LABEL = 30
"""Characters from which on entries of a legend stand alone in a row."""
_LINE = 52
"""Characters of small print that have room in a column."""
_LEGEND_ROW = 0.13
"""Height of a row of a legend, inches."""
LEAST_MEASURED = 1e-3
"""Where errors of measured torques are cut off below."""

FORMATS: dict[str, dict] = {
    "pdf": {"metadata": {"CreationDate": None}},
    "svg": {"metadata": {"Date": None}},
    "png": {"dpi": 160, "metadata": {"Software": None}},
}


def render(draw: Callable[[D], Figure | None], data: D, formats: list[str]) -> dict[str, bytes]:
    """Draw a figure and encode it in each format, PDF for a column; nothing where there is nothing to draw."""
    of_papers = [name for name in formats if name == "pdf"]
    of_pages = [name for name in formats if name != "pdf"]
    return {
        **_encode_figure(draw, data, of_pages, STYLE),
        **_encode_figure(draw, data, of_papers, STYLE | COLUMN),
    }


def _encode_figure(
    draw: Callable[[D], Figure | None], data: D, formats: list[str], style: dict[str, Any]
) -> dict[str, bytes]:
    """Return a figure in each format; empty if there is nothing to draw."""
    with mpl.rc_context(style):
        drawn = draw(data) if formats else None
        if drawn is None:
            return {}
        result = {}
        for name in formats:
            buffer = io.BytesIO()
            drawn.savefig(buffer, format=name, **FORMATS[name])
            # The others keep what was laid out for the first; a placeholder would have all drawn twice.
            with mpl.rc_context({"figure.constrained_layout.use": False}):
                drawn.set_layout_engine(None)
            result[name] = buffer.getvalue()
    return result


def make_figure(tall: float = 1.0) -> Figure:
    """Return an empty figure over the width of the place where it stands.

    Args:
        tall: Height relative to the usual one.
    """
    width, height = mpl.rcParams["figure.figsize"]
    return Figure(figsize=(width, tall * height))


def make_two_plots(shared: bool = True) -> tuple[Figure, Axes, Axes]:
    """Return a figure with two plots, beside each other, or one below the other where it is narrow.

    Args:
        shared: Whether both plots share the vertical axis.
    """
    rows, columns = (2, 1) if _is_narrow() else (1, 2)
    drawn = make_figure(1.8 if _is_narrow() else 1.0)
    first, second = drawn.subplots(rows, columns, sharey=shared)
    return drawn, first, second


def break_lines(text: str, plots: int = 1) -> str:
    """Return a title of a plot in lines that are no longer than the plot is wide.

    Args:
        text: Text in about the size of an axis' label.
        plots: Number of plots beside each other.
    """
    return textwrap.fill(text, _LINE // plots) if _is_narrow() else text


def _is_narrow() -> bool:
    return bool(mpl.rcParams["figure.figsize"][0] < _NARROW)


def choose_joint_style(j: int) -> tuple[str, str]:
    """Return colour and line style of a joint, the same in all figures."""
    colours = len(_JOINT_COLOURS)
    return _JOINT_COLOURS[j % colours], _LINES[j // colours % len(_LINES)]


def place_legend_beside(axes: Axes) -> None:
    """Place a legend where it covers nothing: on the right, or below in a narrow figure; none without labels."""
    if not axes.get_legend_handles_labels()[1]:
        return
    if not _is_narrow():
        axes.legend(fontsize="small", loc="center left", bbox_to_anchor=(1.0, 0.5))
        return
    drawn = axes.get_figure(root=True)
    assert drawn is not None
    handles, labels = axes.get_legend_handles_labels()
    columns = 1 if max(map(len, labels), default=0) > _LONG_LABEL else 2
    rows = -(-len(labels) // columns)
    drawn.set_figheight(drawn.get_figheight() + _LEGEND_ROW * rows)
    drawn.legend(handles, labels, fontsize="x-small", loc="outside lower center", ncols=columns)


def place_legend_above(axes: Axes, columns: int) -> None:
    """Place a legend over a plot, with half as many columns in a narrow figure."""
    axes.legend(
        fontsize="x-small" if _is_narrow() else "small",
        ncols=-(-columns // 2) if _is_narrow() else columns,
        loc="lower center",
        bbox_to_anchor=(0.5, 1.0),
    )


def clip_errors(values: FloatArray) -> FloatArray:
    """Return errors as they can be drawn: infinite ones leave a gap, exact ones stand at the floor."""
    result: FloatArray = np.where(np.isfinite(values), np.maximum(values, FLOOR), np.nan)
    return result


def mark_selected(axes: Axes, data: ReportData) -> None:
    """Draw a line at the number of parameters that is selected."""
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    axes.axvline(data.validation.selected.n, color="#0b62c4", linewidth=0.8, alpha=0.5)


def draw_message(text: str) -> Figure:
    """Return a figure that says why there is nothing to draw."""
    drawn = make_figure()
    axes = drawn.subplots()
    axes.text(0.5, 0.5, text, ha="center", transform=axes.transAxes)
    axes.set_axis_off()
    return drawn


def draw_errors(data: ReportData, quantity: str, label: str) -> Figure:
    """Return a figure of an error against the number of parameters, on both sets."""
    drawn = make_figure()
    axes = drawn.subplots()
    for curve in gather_curves(data):
        for which, line in (("estimation", "-"), ("validation", "--")):
            values = curve.hide_shared(clip_errors(curve.result.get_errors(quantity)[which]))
            axes.semilogy(
                curve.result.n, values, line, color=curve.colour, markersize=3,
                label=curve.label if line == "-" else None, marker=curve.marker if line == "-" else None,
            )  # fmt: skip
    # Measured torques are never explained to round-off.
    bottom = FLOOR if data.identification is None else LEAST_MEASURED
    axes.set_ylim(bottom=bottom, top=min(axes.get_ylim()[1], HIGHEST_ERROR))
    axes.axvline(data.reduction.rank, color="#57606a", linewidth=0.8, linestyle=":")
    axes.annotate(
        f" r = {data.reduction.rank}", (data.reduction.rank, 1.0),
        xycoords=("data", "axes fraction"), va="top", fontsize="small", color="#57606a",
    )  # fmt: skip
    mark_selected(axes, data)
    axes.set_xlabel("number of parameters n")
    axes.set_ylabel(label)
    axes.plot([], [], color="#57606a", label="estimation")
    axes.plot([], [], "--", color="#57606a", label="validation")
    place_legend_beside(axes)
    return drawn
