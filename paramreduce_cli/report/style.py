"""How all figures are drawn, and what several of them have in common."""

import io
from collections.abc import Callable

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from paramreduce_cli.records import FloatArray
from paramreduce_cli.report.data import ReportData

STYLE = {
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
_JOINT_COLOURS = ("#0b6e99", "#d9730d", "#2f8f5b", "#8e5bb5", "#c2384f", "#7a6a53", "#4d7c8a")
_HEURISTIC_COLOURS = (
    "#7d8590", "#0b62c4", "#5fa3d9", "#8e5bb5", "#d9730d", "#e0a526", "#2f8f5b", "#c2384f", "#7a6a53",
    "#0b8f8f",
)  # fmt: skip
_LINES = ("-", "--", ":", "-.")
_MARKERS = ("s", "o", "v", "P", "^", "X", "D", "*", "p")
WIDE = (8.4, 3.8)
"""Size of a figure over the whole width, inches."""
FUNCTIONS = (("inverse", "d", "-"), ("direct", "[M | δ]", "--"))
"""Names of the dynamics in records and in figures, and their lines."""
FLOOR = 1e-7
"""Where errors are cut off below: what is less is round-off."""
HIGHEST_ERROR = 1e3
_LEAST_MEASURED = 1e-3
"""Where errors of measured torques are cut off below."""

FORMATS: dict[str, dict] = {
    "pdf": {"metadata": {"CreationDate": None}},
    "svg": {"metadata": {"Date": None}},
    "png": {"dpi": 160, "metadata": {"Software": None}},
}


def render(
    draw: Callable[[ReportData], Figure | None], data: ReportData, formats: list[str]
) -> dict[str, bytes]:
    """Draw a figure and encode it in each format; nothing where there is nothing to draw."""
    with mpl.rc_context(STYLE):
        drawn = draw(data)
        if drawn is None:
            return {}
        result = {}
        for name in formats:
            buffer = io.BytesIO()
            drawn.savefig(buffer, format=name, **FORMATS[name])
            drawn.set_layout_engine("none")  # the others keep what was laid out for the first
            result[name] = buffer.getvalue()
    return result


def heuristic_style(data: ReportData, name: str) -> tuple[str, str]:
    """Colour and marker of a heuristic, the same in all figures."""
    k = list(data.validation.heuristics).index(name)
    return _HEURISTIC_COLOURS[k % len(_HEURISTIC_COLOURS)], _MARKERS[k % len(_MARKERS)]


def joint_style(j: int) -> tuple[str, str]:
    """Colour and line of a joint, the same in all figures."""
    colours = len(_JOINT_COLOURS)
    return _JOINT_COLOURS[j % colours], _LINES[j // colours % len(_LINES)]


def joint_label(data: ReportData, j: int) -> str:
    """Name of a joint's coordinate."""
    if data.known_model is None:
        return f"joint {j + 1}"
    return data.known_model.mechanism.coordinate_names[j]


def legend_beside(axes: Axes) -> None:
    """A legend on the right, where it covers nothing."""
    axes.legend(fontsize=8, loc="center left", bbox_to_anchor=(1.0, 0.5))


def visible(values: FloatArray) -> FloatArray:
    """Errors as they can be drawn: infinite ones leave a gap, exact ones stand at the floor."""
    result: FloatArray = np.where(np.isfinite(values), np.maximum(values, FLOOR), np.nan)
    return result


def mark_selected(axes: Axes, data: ReportData) -> None:
    """A line at the number of parameters that was selected."""
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    axes.axvline(data.validation.selected.n, color="#0b62c4", linewidth=0.8, alpha=0.5)


def message(text: str) -> Figure:
    """A figure that says why there is nothing to draw."""
    drawn = Figure(figsize=WIDE)
    axes = drawn.subplots()
    axes.text(0.5, 0.5, text, ha="center", transform=axes.transAxes)
    axes.set_axis_off()
    return drawn


def error_figure(data: ReportData, quantity: str, label: str) -> Figure:
    """An error against the number of parameters, on both sets."""
    drawn = Figure(figsize=WIDE)
    axes = drawn.subplots()
    for name, result in data.validation.heuristics.items():
        colour, marker = heuristic_style(data, name)
        for which, line in (("estimation", "-"), ("validation", "--")):
            values = visible(getattr(result, f"{quantity}_{which}"))
            axes.semilogy(
                result.n, values, line, color=colour, label=name if line == "-" else None,
                marker=marker if line == "-" else None, markersize=3,
            )  # fmt: skip
    # Measured torques are never explained to round-off.
    bottom = FLOOR if data.identification is None else _LEAST_MEASURED
    axes.set_ylim(bottom=bottom, top=min(axes.get_ylim()[1], HIGHEST_ERROR))
    axes.axvline(data.reduction.rank, color="#57606a", linewidth=0.8, linestyle=":")
    axes.annotate(
        f" r = {data.reduction.rank}", (data.reduction.rank, 1.0),
        xycoords=("data", "axes fraction"), va="top", fontsize=8, color="#57606a",
    )  # fmt: skip
    mark_selected(axes, data)
    axes.set_xlabel("number of parameters n")
    axes.set_ylabel(label)
    axes.plot([], [], color="#57606a", label="estimation")
    axes.plot([], [], "--", color="#57606a", label="validation")
    legend_beside(axes)
    return drawn
