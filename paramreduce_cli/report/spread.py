"""Many runs beside each other: how results spread over the runs of a robot, and what is always chosen."""

import statistics
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from paramreduce_cli.texts import format_percent
from paramreduce_cli.texts.table import Table

Summary = Mapping[str, Any]
_LISTED = 40
"""Parameters in a cell, at most."""


def run_record(
    name: str, summary: Summary, variant: str = "", seed: int | None = None
) -> dict[str, Any]:
    """One run as one row of numbers, for analysis elsewhere; None where something is not known.

    Args:
        name: Of the run.
        summary: Contents of its ``summary.json``.
        variant: Of its config, in a sweep.
        seed: Of its trajectories, in a sweep.

    Raises:
        KeyError, TypeError, ValueError: It is no such summary.
    """
    selected, trajectories = summary["selected"], summary["trajectories"]
    kappas = [t["kappa"] for t in trajectories["estimation"]] if trajectories else []
    known = [kappa for kappa in kappas if kappa is not None]
    operations = selected["operations"]
    return {
        "run": name,
        "robot": summary["robot"],
        "variant": variant,
        "seed": seed,
        "kappa_best": min(known, default=None),
        "kappa_median": statistics.median(known) if known else None,
        "n_affecting": summary["model"]["n_affecting"],
        "n_base": summary["model"]["n_base"],
        "heuristic": selected["heuristic"],
        "n": selected["n"],
        "parameters": " ".join(selected["parameters"]),
        "torque_error_estimation": selected["torque_error"]["estimation"],
        "torque_error_validation": selected["torque_error"]["validation"],
        "torque_error_test": (selected["torque_error"].get("test") or {}).get("median"),
        "acceleration_error_estimation": selected["acceleration_error"]["estimation"],
        "acceleration_error_validation": selected["acceleration_error"]["validation"],
        "acceleration_error_test": (selected["acceleration_error"].get("test") or {}).get("median"),
        "operations_inverse": operations["inverse"],
        "operations_direct": operations["direct"],
        **{f"operations_{one['function']}_terms": one["operations"] for one in summary["terms"]},
        "accepted": selected["accepted"],
        "seconds": sum(summary["seconds"].values()),
    }


def spread(records: Sequence[Mapping[str, Any]]) -> Table:
    """Median, smallest and largest number over the runs of every robot, of its variants apart."""
    header = (
        "robot",
        "runs",
        "κ best",
        "n",
        "ε_τ E",
        "ε_τ V",
        "ε_τ T",
        "ε_z̈ E",
        "ε_z̈ V",
        "ε_z̈ T",
        "d",
        "M, δ",
        "accepted",
    )
    rows = []
    for label, own in grouped(records).items():
        cells = [
            _range([one[key] for one in own], text)
            for key, text in (
                ("kappa_best", _number),
                ("n", _number),
                ("torque_error_estimation", format_percent),
                ("torque_error_validation", format_percent),
                ("torque_error_test", format_percent),
                ("acceleration_error_estimation", format_percent),
                ("acceleration_error_validation", format_percent),
                ("acceleration_error_test", format_percent),
                ("operations_inverse", _number),
                ("operations_direct", _number),
            )
        ]
        judged = [one["accepted"] for one in own if one["accepted"] is not None]
        accepted = f"{sum(judged)} of {len(judged)}" if judged else "-"
        rows.append((label, str(len(own)), *cells, accepted))
    return Table("Spread over runs: median (smallest to largest)", header, tuple(rows))


def choices(records: Sequence[Mapping[str, Any]]) -> Table:
    """Parameters that every run of a robot, or of a variant of it, selects, and those that some do."""
    rows = []
    for label, own in grouped(records).items():
        counts = Counter(name for one in own for name in one["parameters"].split())
        always = sorted(name for name, count in counts.items() if count == len(own))
        some = [
            f"{name} {count}/{len(own)}" for name, count in counts.most_common() if count < len(own)
        ]
        rows.append((label, *map(_listed, (always, some))))
    return Table("What is selected", ("robot", "in all runs", "in some"), tuple(rows))


def grouped(records: Sequence[Mapping[str, Any]]) -> dict[str, list[Mapping[str, Any]]]:
    """Runs that differ by no more than their seeds, by their robot and variant."""
    found: dict[str, list[Mapping[str, Any]]] = {}
    for record in records:
        label = ", ".join(filter(None, (record["robot"], record["variant"])))
        found.setdefault(label, []).append(record)
    return found


def _range(values: Sequence[float | None], text: Callable[[float], str]) -> str:
    known = [value for value in values if value is not None]
    if not known:
        return "-"
    middle, low, high = (text(f(known)) for f in (statistics.median, min, max))
    return middle if low == high else f"{middle} ({low} to {high})"


def _number(value: float) -> str:
    return f"{value:.4g}"


def _listed(names: Sequence[str]) -> str:
    more = len(names) - _LISTED
    return " ".join(names[:_LISTED]) + (f" and {more} more" if more > 0 else "") or "-"
