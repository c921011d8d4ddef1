"""The tables of the report; each is a function from ReportData to a Table."""

from __future__ import annotations

import csv
import io
import re
import unicodedata
from dataclasses import dataclass

import numpy as np

from paramreduce_cli.records import PARAMETER_KINDS, Trajectory
from paramreduce_cli.registry import table
from paramreduce_cli.report.data import ReportData


@dataclass(frozen=True)
class Table:
    """Cells of text under a header."""

    title: str
    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]

    def to_text(self) -> str:
        """Aligned columns under the title."""
        lines = [self.header, *self.rows]
        widths = [max(_width(line[k]) for line in lines) for k in range(len(self.header))]

        def aligned(cells: tuple[str, ...]) -> str:
            padded = (
                cell + " " * (width - _width(cell))
                for cell, width in zip(cells, widths, strict=True)
            )
            return "  ".join(padded).rstrip()

        rule = "  ".join("-" * width for width in widths)
        body = [aligned(self.header), rule, *map(aligned, self.rows)]
        return "\n".join([self.title, "", *body]) + "\n"

    def to_csv(self) -> str:
        """Comma-separated values with a header line."""
        buffer = io.StringIO()
        writer = csv.writer(buffer, lineterminator="\n")
        writer.writerow(self.header)
        writer.writerows(self.rows)
        return buffer.getvalue()

    def to_latex(self) -> str:
        """A tabular with its caption, ready to be included."""
        lines = [
            r"\begin{table}[ht]",
            r"\centering",
            rf"\caption{{{_latex(self.title)}}}",
            rf"\begin{{tabular}}{{{'l' * len(self.header)}}}",
            r"\hline",
            " & ".join(map(_latex, self.header)) + r" \\",
            r"\hline",
            *(" & ".join(map(_latex, row)) + r" \\" for row in self.rows),
            r"\hline",
            r"\end{tabular}",
            r"\end{table}",
        ]
        return "\n".join(lines) + "\n"


def _width(text: str) -> int:
    """Columns that a text takes; accents stand on the letter before them."""
    return sum(1 for character in text if not unicodedata.combining(character))


_SYMBOLS = {
    "n_φ": r"$n_\varphi$",
    "κ": r"$\kappa$",
    "ε_τ": r"$\varepsilon_\tau$",
    "ε_z̈": r"$\varepsilon_{\ddot z}$",
    "δ": r"$\delta$",
    "φ'": r"$\varphi'$",
    "²": r"$^2$",
}
_ESCAPES = {
    "\\": r"\textbackslash{}", "%": r"\%", "&": r"\&", "#": r"\#", "$": r"\$", "{": r"\{",
    "}": r"\}", "~": r"\textasciitilde{}", "^": r"\^{}", "_": r"\_",
}  # fmt: skip
_NAME = re.compile(r"(?<![\w.-])(m[xyz]?|I[xyz]{2}|z|a|d|b)_([\w.-]*\w)(\^\d)?")


def _latex(text: str) -> str:
    """Escape text; names of parameters and lengths become formulas."""
    pieces = []
    last = 0
    for match in _NAME.finditer(text):
        pieces.append(_escape(text[last : match.start()]))
        symbol, subscript, power = match.groups()
        pieces.append(f"${symbol}_{{\\mathrm{{{_escape(subscript)}}}}}{power or ''}$")
        last = match.end()
    return "".join([*pieces, _escape(text[last:])])


def _escape(text: str) -> str:
    for symbol, latex in _SYMBOLS.items():
        if symbol in text:
            before, _, after = text.partition(symbol)
            return _escape(before) + latex + _escape(after)
    return "".join(_ESCAPES.get(character, character) for character in text)


_FAR_OFF = 10.0


def percent(value: float) -> str:
    """A share as text."""
    if not np.isfinite(value):
        return "∞"
    if value >= _FAR_OFF:
        return "> 1000 %"
    return f"{100 * value:.2f} %" if value < 1 else f"{100 * value:.0f} %"


@table("kinematics")
def kinematics(data: ReportData) -> Table:
    """The geometry as the config gives it."""
    header, *rows = data.model.mechanism.table
    return Table("Kinematic parameters (m, rad)", header, tuple(rows))


@table("dynamic-parameters")
def dynamic_parameters(data: ReportData) -> Table:
    """The standard parameters of every body."""
    values = data.model.values.reshape(-1, len(PARAMETER_KINDS))
    rows = [
        (data.model.mechanism.bodies[k].name, *(f"{value:g}" for value in row))
        for k, row in zip(data.model.mechanism.inertial, values, strict=True)
    ]
    title = "Standard parameters (kg, kg m, kg m²)"
    return Table(title, ("body", *PARAMETER_KINDS), tuple(rows))


@table("base-parameters")
def base_parameters(data: ReportData) -> Table:
    """The base parameters with the relations that regroup the others."""
    base = data.model.base
    others = np.setdiff1d(np.arange(data.model.values.size), base.columns)
    values = data.model.values[base.columns] + base.beta @ data.model.values[others]
    rows = [
        (str(k + 1), expression, f"{value:.6g}")
        for k, (expression, value) in enumerate(zip(base.expressions, values, strict=True))
    ]
    return Table("Base parameters", ("no.", "expression", "value"), tuple(rows))


@table("trajectory-setup")
def trajectory_setup(data: ReportData) -> Table:
    """What was asked of the trajectories."""
    return Table("Trajectory setup", ("setting", "value"), data.setup.rows)


@table("trajectories")
def trajectories(data: ReportData) -> Table:
    """What every trajectory reached."""
    found = data.trajectories
    if found is None:
        return Table("Trajectories: recorded states were used", ("set",), ())
    variants = tuple(found.estimation[0].kappa_variants)
    header = (
        "trajectory", *(f"κ {name}" for name in variants), "κ at start",
        "peak |z - middle|", "peak speed", "share of limits",
        *(f"{c.name}" for c in found.constraints), "CPU s", "iterations", "status",
    )  # fmt: skip
    rows = [
        _trajectory_row(f"{name} {k + 1}", t)
        for name in ("estimation", "validation")
        for k, t in enumerate(getattr(found, name))
    ]
    return Table("Trajectories", header, tuple(rows))


def _trajectory_row(label: str, t: Trajectory) -> tuple[str, ...]:
    def spread(values: np.ndarray) -> str:
        return " ".join(f"{value:.3g}" for value in values)

    return (
        label,
        *(f"{value:.4g}" for value in t.kappa_variants.values()),
        f"{t.kappa_start:.3g}",
        spread(t.peak_position),
        spread(t.peak_velocity),
        spread(t.reach),
        *(f"{low:.3g} ... {high:.3g}" for low, high in t.extremes),
        f"{t.cpu_seconds:.2f}",
        str(t.iterations),
        t.status.replace("_", " "),
    )


@table("parameter-ordering")
def parameter_ordering(data: ReportData) -> Table:
    """The order in which each heuristic takes the parameters."""
    found = data.reduction.heuristics
    orders = {name: f.order for name, f in found.items() if f.order is not None}
    names = data.reduction.names
    longest = max((order.size for order in orders.values()), default=0)
    rows = [
        (
            str(k + 1),
            *(names[order[k]] if k < order.size else "" for order in orders.values()),
        )
        for k in range(longest)
    ]
    return Table("Parameter ordering", ("no.", *orders), tuple(rows))


@table("selected-subsets")
def selected_subsets(data: ReportData) -> Table:
    """What every heuristic takes at the selected number of parameters."""
    n, names = data.validation.selected.n, data.reduction.names
    rows = []
    for name, found in data.reduction.heuristics.items():
        row = found.row(n)
        if row is not None:
            kept = " ".join(names[k] for k in sorted(found.subsets[row]))
            rows.append((name, percent(float(found.torque_error[row])), kept))
    return Table(f"Subsets of {n} parameters", ("heuristic", "ε_τ E", "parameters"), tuple(rows))


@table("proofs")
def proofs(data: ReportData) -> Table:
    """How good the best subsets are proven to be, for every number of parameters."""
    found = data.reduction.proofs
    header = ("n", "ε_τ", "no subset below", "gap", "status", "nodes", "s")
    if found is None:
        return Table("Proofs: best-subset was not run", header, ())
    rows = []
    for k, n in enumerate(found.n):
        error, bound = float(found.torque_error[k]), float(found.lower_bound[k])
        gap = "0" if found.status[k] == "optimal" else percent(1 - bound / error if error else 0.0)
        rows.append(
            (
                str(n), f"{100 * error:.4g} %", f"{100 * bound:.4g} %", gap, found.status[k],
                str(found.nodes[k]), f"{found.seconds[k]:.2f}",
            )
        )  # fmt: skip
    return Table("Proofs of the best subsets", header, tuple(rows))


@table("pareto-front")
def pareto_front(data: ReportData) -> Table:
    """Models that no other one beats in all respects."""
    header = ("heuristic", "n", "ε_τ E", "ε_τ V", "ε_z̈ E", "ε_z̈ V", "d", "M, δ")
    rows = []
    for name, n in data.validation.pareto:
        r = data.validation.heuristics[name]
        k = r.row(n)
        errors = (
            r.torque_error_estimation, r.torque_error_validation,
            r.acceleration_error_estimation, r.acceleration_error_validation,
        )  # fmt: skip
        counts = (r.operations_inverse, r.operations_direct)
        cells = (*(percent(float(e[k])) for e in errors), *(str(int(c[k])) for c in counts))
        rows.append((name, str(n), *cells))
    return Table("Pareto front", header, tuple(rows))


@table("summary")
def summary(data: ReportData) -> Table:
    """Every heuristic at the selected number of parameters, both functions."""
    n = data.validation.selected.n
    full = data.validation.full
    header = (
        "heuristic", "n_φ", "r", "n", "d", "d, n", "saved", "ε_τ E", "ε_τ V",
        "M, δ", "M, δ, n", "saved", "ε_z̈ E", "ε_z̈ V",
    )  # fmt: skip
    rows = []
    for name, r in data.validation.heuristics.items():
        k = r.row(n)
        if k is None:
            continue
        cells = [name, str(int(data.model.affecting.sum())), str(data.reduction.rank), str(n)]
        for key, error in (("inverse", "torque"), ("direct", "acceleration")):
            whole = int(full[f"operations_{key}"])
            reduced = int(getattr(r, f"operations_{key}")[k])
            cells += [
                str(whole),
                str(reduced),
                f"{100 * (1 - reduced / whole):.0f} %" if whole else "-",
            ]
            cells += [
                percent(float(getattr(r, f"{error}_error_{which}")[k]))
                for which in ("estimation", "validation")
            ]
        rows.append(tuple(cells))
    return Table(f"Reduced models with {n} parameters", header, tuple(rows))


@table("approximate-base-parameters")
def approximate_base_parameters(data: ReportData) -> Table:
    """The parameters of the selected model: value, and what they take over from the others."""
    selected = data.validation.selected
    rows = [
        (str(k + 1), name, f"{value:.6g}", expression)
        for k, (name, value, expression) in enumerate(
            zip(selected.parameters, selected.values, selected.expressions, strict=True)
        )
    ]
    title = f"Approximate base parameters: {selected.heuristic}, n = {selected.n}"
    return Table(title, ("no.", "parameter", "φ' value", "made of"), tuple(rows))


@table("operations")
def operations(data: ReportData) -> Table:
    """Operations of the full, the base and the selected model: lean, plain recursion, the paper's rule."""
    selected = data.validation.selected
    result = data.validation.heuristics[selected.heuristic]
    keys = tuple(
        f"operations_{function}{rule}"
        for function in ("inverse", "direct")
        for rule in ("", "_plain", "_paper_rule")
    )
    affecting = int(data.model.affecting.sum())
    rows = [
        ("full", str(affecting), *(f"{data.validation.full[key]:.0f}" for key in keys)),
        (
            "base",
            str(data.model.base.columns.size),
            *(f"{data.validation.full[f'base_{key}']:.0f}" for key in keys),
        ),
        (
            selected.heuristic,
            str(selected.n),
            *(str(int(getattr(result, key)[result.row(selected.n)])) for key in keys),
        ),
    ]
    header = (
        "model", "n", "d, lean", "d, plain recursion", "d, the paper's rule",
        "[M, δ], lean", "[M, δ], plain recursion", "[M, δ], the paper's rule",
    )  # fmt: skip
    return Table("Operations", header, tuple(rows))
