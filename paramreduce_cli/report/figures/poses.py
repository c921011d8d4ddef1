"""The mechanism, drawn."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from paramreduce_cli.records import FloatArray
from paramreduce_cli.report.data import ReportData, Skeleton
from paramreduce_cli.report.page_sections import PageSection, placed
from paramreduce_cli.report.style import break_lines, make_figure

_MOST_NUMBERS = 8
"""Coordinates of a pose that are written above it."""


@placed(PageSection.PAPER, 9, of_mechanism=True)
def poses(data: ReportData) -> Figure:
    """Mechanism in a few poses of the validation set."""
    count = len(data.skeletons)
    drawn = make_figure(2.4 / count)
    corners = np.array([_find_extent(skeleton) for skeleton in data.skeletons])
    low, high = corners[:, 0].min(axis=0), corners[:, 1].max(axis=0)
    half = 0.55 * float((high - low).max()) or 1.0
    for k, skeleton in enumerate(data.skeletons):
        axes = drawn.add_subplot(1, count, k + 1, projection="3d")
        _draw_skeleton(axes, skeleton, half, count)
        for setter, middle in zip(
            (axes.set_xlim, axes.set_ylim, axes.set_zlim), (low + high) / 2, strict=True
        ):
            setter(middle - half, middle + half)
    return drawn


def _find_extent(skeleton: Skeleton) -> FloatArray:
    """Return the corners of the box around a pose and the base, (2, 3), m."""
    points = np.vstack(
        [
            np.zeros((0 if skeleton.closures else 1, 3)),
            skeleton.poses[:, :3, 3],
            skeleton.joints[:, :3, 3],
            skeleton.masses,
            *skeleton.closures,
        ]
    )
    return np.array([np.nanmin(points, axis=0), np.nanmax(points, axis=0)])


def _draw_skeleton(axes: Axes, skeleton: Skeleton, half: float, plots: int) -> None:
    """Draw links, joints, axes and closures of one pose."""
    link = {"color": "#44607a", "linewidth": 4, "solid_capstyle": "round", "alpha": 0.9}
    for i, parent in enumerate(skeleton.parents):
        start = np.zeros(3) if parent < 0 else skeleton.poses[parent][:3, 3]
        middle, end = skeleton.joints[i][:3, 3], skeleton.poses[i][:3, 3]
        if not skeleton.closures:
            axes.plot(*np.array([start, middle, end]).T, **link)
        elif skeleton.kinds[i] == "revolute":  # what slides is not tied to where it slides from
            axes.plot(*np.array([middle if parent < 0 else start, middle, end]).T, **link)
        if skeleton.kinds[i] == "hidden":
            continue
        if skeleton.closures and skeleton.kinds[i] == "prismatic":
            rail = np.array([middle, end]).T
            axes.plot(*rail, color="#2f8f5b", linewidth=1, linestyle=":")
        axis = skeleton.joints[i][:3, 2] * 0.14 * half
        ends = np.array([middle - axis, middle + axis]).T
        colour = "#d9730d" if skeleton.kinds[i] == "revolute" else "#2f8f5b"
        axes.plot(*ends, color=colour, linewidth=2.4, solid_capstyle="butt")
    for path in skeleton.closures:
        axes.plot(*path.T, **link)
        axes.scatter(*path[len(path) // 2], s=14, color="#d9730d")
    for i in set(range(len(skeleton.parents))) - set(skeleton.parents):
        tip = skeleton.poses[i]
        to_mass = np.array([tip[:3, 3], skeleton.masses[i]]).T
        axes.plot(*to_mass, color="#44607a", linewidth=2.5, solid_capstyle="round", alpha=0.6)
        for column, colour in zip(range(3), ("#c2384f", "#2f8f5b", "#0b62c4"), strict=True):
            arrow = np.array([tip[:3, 3], tip[:3, 3] + 0.25 * half * tip[:3, column]]).T
            axes.plot(*arrow, color=colour, linewidth=1.4)
    if not skeleton.closures:
        axes.scatter(0, 0, 0, marker="s", s=40, color="#30363d")
    axes.set_box_aspect((1, 1, 1), zoom=1.15)
    axes.view_init(elev=22, azim=-60)
    for axis in (axes.xaxis, axes.yaxis, axes.zaxis):
        axis.set_ticklabels([])
        axis.set_pane_color((0.97, 0.975, 0.98, 1.0))
    shown = ", ".join(f"{value:.2f}" for value in skeleton.z[:_MOST_NUMBERS])
    shown += ", …" if len(skeleton.z) > _MOST_NUMBERS else ""
    axes.text2D(
        0.5, 0.98, break_lines(f"z = ({shown})", plots), transform=axes.transAxes, ha="center",
        fontsize="xx-small", color="#57606a",
    ).set_in_layout(False)  # fmt: skip
