"""The figures of the report; each is a function from ReportData to a matplotlib figure."""

from __future__ import annotations

import io
from collections.abc import Callable

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from paramreduce_cli.records import FloatArray
from paramreduce_cli.registry import figure
from paramreduce_cli.report.data import ReportData, Skeleton

_STYLE = {
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
_WIDE = (8.4, 3.8)
_EXACT = 1e-7
"""Where errors are cut off below: what is less is round-off."""
_HIGHEST_ERROR = 1e3
_WIDE_SPREAD = 100.0
"""Per cent of change from which on a logarithmic scale shows more."""

FORMATS: dict[str, dict] = {
    "pdf": {"metadata": {"CreationDate": None}},
    "svg": {"metadata": {"Date": None}},
    "png": {"dpi": 160, "metadata": {"Software": None}},
}


def render(
    draw: Callable[[ReportData], Figure | None], data: ReportData, formats: list[str]
) -> dict[str, bytes]:
    """Draw a figure and encode it in each format; nothing where there is nothing to draw."""
    with mpl.rc_context(_STYLE):
        drawn = draw(data)
        if drawn is None:
            return {}
        result = {}
        for name in formats:
            buffer = io.BytesIO()
            drawn.savefig(buffer, format=name, **FORMATS[name])
            result[name] = buffer.getvalue()
    return result


def _heuristic_style(data: ReportData, name: str) -> tuple[str, str]:
    k = list(data.validation.heuristics).index(name)
    return _HEURISTIC_COLOURS[k % len(_HEURISTIC_COLOURS)], _MARKERS[k % len(_MARKERS)]


def _joint_label(data: ReportData, j: int) -> str:
    return data.model.mechanism.coordinate_names[j]


@figure("poses")
def poses(data: ReportData) -> Figure:
    """The mechanism in a few poses of the validation set."""
    count = len(data.skeletons)
    drawn = Figure(figsize=(2.8 * count, 3.1))
    corners = np.array([_extent(skeleton) for skeleton in data.skeletons])
    low, high = corners[:, 0].min(axis=0), corners[:, 1].max(axis=0)
    half = 0.55 * float((high - low).max()) or 1.0
    for k, skeleton in enumerate(data.skeletons):
        axes = drawn.add_subplot(1, count, k + 1, projection="3d")
        _draw_skeleton(axes, skeleton, half)
        for setter, middle in zip(
            (axes.set_xlim, axes.set_ylim, axes.set_zlim), (low + high) / 2, strict=True
        ):
            setter(middle - half, middle + half)
    return drawn


def _extent(skeleton: Skeleton) -> FloatArray:
    """Corners of the box around a pose and the base, (2, 3), m."""
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


def _draw_skeleton(axes: Axes, skeleton: Skeleton, half: float) -> None:
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
    shown = ", ".join(f"{value:.2f}" for value in skeleton.z)
    axes.text2D(
        0.5, 0.98, f"z = ({shown})", transform=axes.transAxes, ha="center", fontsize=6.5,
        color="#57606a",
    )  # fmt: skip


@figure("trajectory")
def trajectory(data: ReportData) -> Figure:
    """A characteristic trajectory of the validation set: positions, velocities, accelerations."""
    drawn = Figure(figsize=(7.2, 5.4))
    motion = data.motion
    rows = (
        (motion.z, "z  (rad, m)"),
        (motion.dz, "ż  (rad/s, m/s)"),
        (motion.ddz, "z̈  (rad/s², m/s²)"),
    )
    all_axes = drawn.subplots(3, 1, sharex=True)
    for axes, (values, label) in zip(all_axes, rows, strict=True):
        _joint_lines(axes, data, values)
        axes.set_ylabel(label)
    all_axes[0].legend(
        ncols=min(values.shape[1], 7), fontsize=8, loc="lower center", bbox_to_anchor=(0.5, 1.0)
    )
    all_axes[-1].set_xlabel("t (s)")
    return drawn


def _joint_lines(axes: Axes, data: ReportData, values: FloatArray) -> None:
    for j in range(values.shape[1]):
        colour = _JOINT_COLOURS[j % len(_JOINT_COLOURS)]
        line = _LINES[j // len(_JOINT_COLOURS) % len(_LINES)]
        label = _joint_label(data, j)
        axes.plot(data.motion.time, values[:, j], color=colour, linestyle=line, label=label)


@figure("torque-error")
def torque_error(data: ReportData) -> Figure:
    """Torque error against the number of parameters, on both sets."""
    return _error_figure(
        data, "torque_error_estimation", "torque_error_validation", r"$\varepsilon_\tau$"
    )


@figure("proven-bound")
def proven_bound(data: ReportData) -> Figure:
    """Torque error of every heuristic over what is proven to be possible; no subset is below the grey."""
    drawn = Figure(figsize=_WIDE)
    axes = drawn.subplots()
    proofs = data.reduction.proofs
    if proofs is None:
        axes.text(0.5, 0.5, "best-subset was not run", ha="center", transform=axes.transAxes)
        axes.set_axis_off()
        return drawn
    shown = np.maximum(proofs.lower_bound, _EXACT)
    axes.fill_between(proofs.n, shown, _EXACT, step="mid", color="#d5d9de", zorder=0)
    axes.step(proofs.n, shown, where="mid", color="#30363d", linewidth=0.9, label="proven bound")
    for name, found in data.reduction.heuristics.items():
        if "@" in name:
            continue
        colour, marker = _heuristic_style(data, name)
        optimal = name == "best-subset"
        axes.semilogy(
            found.n, np.maximum(found.torque_error, _EXACT), color=colour, marker=marker,
            markersize=4 if optimal else 2.5, linewidth=0.8, label=name, linestyle="none" if optimal
            else "-",
        )  # fmt: skip
    axes.set_yscale("log")
    axes.set_ylim(bottom=_EXACT)
    unproven = [status != "optimal" for status in proofs.status]
    axes.set_title(
        f"optimal for {len(unproven) - sum(unproven)} of {len(unproven)} sizes",
        fontsize=9,
        loc="left",
    )
    _mark_selected(axes, data)
    axes.set_xlabel("number of parameters n")
    axes.set_ylabel(r"$\varepsilon_\tau$, estimation")
    _legend_beside(axes)
    return drawn


@figure("stability")
def stability(data: ReportData) -> Figure:
    """How often each parameter is chosen, the spread of its value, and the torque error, on other data."""
    found, names = data.validation.stability, data.reduction.names
    drawn = Figure(figsize=(7.2, 4.6))
    if found is None:
        axes = drawn.subplots()
        axes.text(0.5, 0.5, "validation.stability is off", ha="center", transform=axes.transAxes)
        axes.set_axis_off()
        return drawn
    often = found.chosen.mean(axis=0)
    order = np.argsort(-often, kind="stable")[: int(np.sum(often > 0))]
    upper, middle, lower = drawn.subplots(3, 1)
    places = np.arange(order.size)
    own = np.isin(order, np.flatnonzero(found.chosen[0]))
    upper.bar(places, 100 * often[order], color=np.where(own, "#0b62c4", "#b9c2cc"), width=0.7)
    upper.set_ylabel("chosen, %")
    for place, column in zip(places, order, strict=True):
        values = found.values[found.chosen[:, column], column]
        scale = np.abs(np.median(values)) or 1.0
        middle.plot([place, place], 100 * (np.array([values.min(), values.max()]) / scale
                    - np.sign(np.median(values))), color="#0b62c4", linewidth=3)  # fmt: skip
    if np.abs(middle.get_ylim()).max() > _WIDE_SPREAD:
        middle.set_yscale("symlog", linthresh=10)
    middle.set_ylabel("φ' - median, %")
    for axes, shown in ((upper, False), (middle, True)):
        labels = [names[k] for k in order] if shown else []
        axes.set_xticks(places, labels if shown else [""] * order.size, rotation=90, fontsize=7)
        axes.set_xlim(-0.7, order.size - 0.3)
        axes.grid(axis="x", visible=False)
    kinds = np.array([not v.startswith("every") for v in found.variants])
    numbers = np.arange(len(found.variants))
    for chosen, colour, label in (
        (kinds, "#0b62c4", "all, then one trajectory left out"),
        (
            ~kinds,
            "#d9730d",
            ", ".join(v for v in found.variants if "every" in v),
        ),
    ):
        if chosen.any():
            lower.plot(
                numbers[chosen], 100 * found.torque_error[chosen], "o", color=colour, markersize=4,
                label=label,
            )  # fmt: skip
    lower.set_xticks(numbers, ["all", *map(str, numbers[1:])], fontsize=7)
    lower.set_xlabel("which trajectory is left out; then fewer samples")
    lower.set_ylabel(r"$\varepsilon_\tau$, %")
    lower.legend(fontsize=7, ncols=2, loc="lower center", bbox_to_anchor=(0.5, 1.0))
    return drawn


@figure("acceleration-error")
def acceleration_error(data: ReportData) -> Figure:
    """Acceleration error against the number of parameters, on both sets."""
    return _error_figure(
        data,
        "acceleration_error_estimation",
        "acceleration_error_validation",
        r"$\varepsilon_{\ddot z}$",
    )


def _error_figure(data: ReportData, estimation: str, validation: str, label: str) -> Figure:
    drawn = Figure(figsize=_WIDE)
    axes = drawn.subplots()
    for name, result in data.validation.heuristics.items():
        colour, marker = _heuristic_style(data, name)
        for key, line in ((estimation, "-"), (validation, "--")):
            values = _visible(getattr(result, key))
            axes.semilogy(
                result.n, values, line, color=colour, label=name if line == "-" else None,
                marker=marker if line == "-" else None, markersize=3,
            )  # fmt: skip
    axes.set_ylim(bottom=_EXACT, top=min(axes.get_ylim()[1], _HIGHEST_ERROR))
    axes.axvline(data.reduction.rank, color="#57606a", linewidth=0.8, linestyle=":")
    axes.annotate(
        f" r = {data.reduction.rank}", (data.reduction.rank, 1.0),
        xycoords=("data", "axes fraction"), va="top", fontsize=8, color="#57606a",
    )  # fmt: skip
    _mark_selected(axes, data)
    axes.set_xlabel("number of parameters n")
    axes.set_ylabel(label)
    axes.plot([], [], color="#57606a", label="estimation")
    axes.plot([], [], "--", color="#57606a", label="validation")
    _legend_beside(axes)
    return drawn


def _legend_beside(axes: Axes) -> None:
    axes.legend(fontsize=8, loc="center left", bbox_to_anchor=(1.0, 0.5))


def _visible(values: FloatArray) -> FloatArray:
    """Errors as they can be drawn: infinite ones leave a gap, exact ones stand at the floor."""
    result: FloatArray = np.where(np.isfinite(values), np.maximum(values, _EXACT), np.nan)
    return result


def _mark_selected(axes: Axes, data: ReportData) -> None:
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    axes.axvline(data.validation.selected.n, color="#0b62c4", linewidth=0.8, alpha=0.5)


_FUNCTIONS = (("inverse", "d", "-"), ("direct", "[M | δ]", "--"))


@figure("operations")
def operations(data: ReportData) -> Figure:
    """Operations of the lean inverse and direct dynamics against the number of parameters; thin lines: the full model."""
    drawn = Figure(figsize=_WIDE)
    axes = drawn.subplots()
    for name, result in data.validation.heuristics.items():
        colour, marker = _heuristic_style(data, name)
        for key, _, line in _FUNCTIONS:
            values = getattr(result, f"operations_{key}")
            axes.plot(
                result.n, values, line, color=colour, marker=marker, markersize=2.5,
                label=name if line == "-" else None,
            )  # fmt: skip
    for key, _, line in _FUNCTIONS:
        axes.axhline(
            data.validation.full[f"operations_{key}"],
            color="#57606a", linewidth=0.8, linestyle=":" if line == "-" else "-.",
        )  # fmt: skip
    _mark_selected(axes, data)
    axes.set_ylim(bottom=0)
    axes.set_xlabel("number of parameters n")
    axes.set_ylabel("operations")
    for _, label, line in _FUNCTIONS:
        axes.plot([], [], line, color="#57606a", label=label)
    _legend_beside(axes)
    return drawn


@figure("tracking")
def tracking(data: ReportData) -> Figure | None:
    """Computed-torque control on a path that is in neither set: how far each joint is off with the full and with the selected model in the controller, and what one evaluation of the exported model takes."""
    result = data.tracking
    if result is None:
        return None
    drawn = Figure(figsize=(8.4, 4.6))
    top, *below = drawn.subplots(
        1 + len(result.errors), 1, sharex=True, height_ratios=[1.2] + [1] * len(result.errors)
    )
    for j in range(result.path.z.shape[1]):
        colour = _JOINT_COLOURS[j % len(_JOINT_COLOURS)]
        label = _joint_label(data, j)
        top.plot(result.path.time, result.path.z[:, j], color=colour, label=label)
        for axes, errors in zip(below, result.errors.values(), strict=True):
            axes.plot(result.path.time, 1e3 * errors[:, j], color=colour, linewidth=1.0)
    top.set_ylabel("path, rad or m")
    _legend_beside(top)
    for axes, (name, errors) in zip(below, result.errors.items(), strict=True):
        rms = 1e3 * float(np.sqrt(np.mean(errors**2)))
        spent = 1e9 * result.seconds[name]
        axes.set_ylabel("off, mrad or mm")
        axes.set_title(
            f"{name}: {rms:.3g} mrad rms, at most {1e3 * float(np.abs(errors).max()):.3g}; "
            f"{spent:.3g} ns a step in {result.language}",
            fontsize=9.5,
            loc="left",
        )
    below[-1].set_xlabel("time, s")
    return drawn


@figure("error-vs-operations")
def error_vs_operations(data: ReportData) -> Figure:
    """Torque error on the estimation set against the operations it costs."""
    drawn = Figure(figsize=_WIDE)
    axes = drawn.subplots(1, 2, sharey=True)
    for one, (key, label, _) in zip(axes, _FUNCTIONS, strict=True):
        for name, result in data.validation.heuristics.items():
            colour, marker = _heuristic_style(data, name)
            values = _visible(result.torque_error_estimation)
            one.semilogy(
                getattr(result, f"operations_{key}"), values,
                color=colour, marker=marker, markersize=3, linewidth=0.8, label=name,
            )  # fmt: skip
        front = [
            (float(cost), float(error))
            for r in data.validation.heuristics.values()
            for cost, error in zip(
                getattr(r, f"operations_{key}"), _visible(r.torque_error_estimation), strict=True
            )
        ]
        stairs = np.array(_staircase(front))
        if stairs.size:
            one.step(*stairs.T, where="post", color="#30363d", linewidth=1.2, label="best known")
        one.set_xlabel(f"operations of {label}")
    axes[0].set_ylabel(r"$\varepsilon_\tau$, estimation")
    _legend_beside(axes[1])
    return drawn


def _staircase(points: list[tuple[float, float]]) -> list[tuple[float, float]]:
    """Of points (cost, error) those that no cheaper one beats, by cost."""
    best, kept = np.inf, []
    for cost, error in sorted(points):
        if error < best:
            best = error
            kept.append((cost, error))
    return kept


@figure("torques")
def torques(data: ReportData) -> Figure:
    """Normalised torques of the full and of the selected model along the validation trajectory."""
    n_dof = data.motion.full.shape[1]
    columns = 2 if n_dof > 1 else 1
    rows = -(-n_dof // columns)
    drawn = Figure(figsize=(7.2, 1.55 * rows + 0.5))
    grid = np.atleast_1d(drawn.subplots(rows, columns, sharex=True)).ravel()
    for j in range(n_dof):
        colour = _JOINT_COLOURS[j % len(_JOINT_COLOURS)]
        grid[j].plot(data.motion.time, data.motion.full[:, j], color=colour, label="full")
        grid[j].plot(
            data.motion.time, data.motion.reduced[:, j], color="#111", linestyle=(0, (3, 2)),
            linewidth=1.1, label=f"n = {data.validation.selected.n}",
        )  # fmt: skip
        grid[j].set_ylabel(f"τ / nom, {_joint_label(data, j)}", fontsize=8)
        grid[j].legend(fontsize=7, loc="upper right", ncols=2)
    for spare in grid[n_dof:]:
        spare.set_visible(False)
    for axes in grid[max(0, n_dof - columns) : n_dof]:
        axes.set_xlabel("t (s)")
    return drawn


@figure("mass-matrix-condition")
def mass_matrix_condition(data: ReportData) -> Figure:
    """Largest condition number of the mass matrix over the samples; hollow where it is indefinite."""
    drawn = Figure(figsize=_WIDE)
    axes = drawn.subplots()
    for name, result in data.validation.heuristics.items():
        colour, marker = _heuristic_style(data, name)
        condition = _visible(result.mass_matrix_condition)
        positive = result.mass_matrix_smallest_eigenvalue > 0
        axes.semilogy(result.n, condition, color=colour, linewidth=0.8, label=name)
        for chosen, fill in ((positive, colour), (~positive, "white")):
            axes.semilogy(
                result.n[chosen], condition[chosen], linestyle="none", marker=marker,
                markersize=4, markerfacecolor=fill, color=colour,
            )  # fmt: skip
    full = data.validation.full["mass_matrix_condition"]
    axes.axhline(full, color="#57606a", linewidth=0.8, linestyle=":")
    axes.annotate("full model", (1.0, full), xycoords=("axes fraction", "data"), ha="right",
                  va="bottom", fontsize=8, color="#57606a")  # fmt: skip
    axes.set_ylim(top=min(axes.get_ylim()[1], full * 1e6))
    _mark_selected(axes, data)
    axes.set_xlabel("number of parameters n")
    axes.set_ylabel("largest κ(M) over the samples")
    _legend_beside(axes)
    return drawn
