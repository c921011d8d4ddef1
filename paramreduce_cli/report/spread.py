"""Many runs beside each other: how results spread over the runs of a robot, and what is always chosen."""

import statistics
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from paramreduce_cli.report.symbols import ACCELERATION_HEADINGS, TORQUE_HEADINGS
from paramreduce_cli.texts import format_percent
from paramreduce_cli.texts.table import Table

Summary = Mapping[str, Any]
_LISTED = 40
"""Parameters in a cell, at most."""


def make_run_record(
    name: str, summary: Summary, variant: str = "", seed: int | None = None
) -> dict[str, Any]:
    """Return the numbers of one run by name; None where a number is not known.

    Args:
        name: Name of the run.
        summary: Contents of its ``summary.json``.
        variant: Variant of the config, in a sweep.
        seed: Seed of the trajectories, in a sweep.

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


def tabulate_spread(records: Sequence[Mapping[str, Any]]) -> Table:
    """Return a table of the median, smallest and largest number over the runs of every robot and variant."""
    header = (
        "robot",
        "runs",
        "κ best",
        "n",
        *TORQUE_HEADINGS,
        *ACCELERATION_HEADINGS,
        "operations inverse",
        "operations direct",
        "accepted",
    )
    rows = []
    for label, own in group_runs(records).items():
        cells = [
            _format_range([one[key] for one in own], text)
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


def tabulate_choices(records: Sequence[Mapping[str, Any]]) -> Table:
    """Return a table of the parameters that every run of a robot and variant selects, and those that some runs select."""
    rows = []
    for label, own in group_runs(records).items():
        counts = Counter(name for one in own for name in one["parameters"].split())
        always = sorted(name for name, count in counts.items() if count == len(own))
        some = [
            f"{name} {count}/{len(own)}" for name, count in counts.most_common() if count < len(own)
        ]
        rows.append((label, *map(_list_names, (always, some))))
    return Table("What is selected", ("robot", "in all runs", "in some"), tuple(rows))


def group_runs(records: Sequence[Mapping[str, Any]]) -> dict[str, list[Mapping[str, Any]]]:
    """Group runs by robot and variant; runs of a group differ by their seeds only."""
    found: dict[str, list[Mapping[str, Any]]] = {}
    for record in records:
        label = ", ".join(filter(None, (record["robot"], record["variant"])))
        found.setdefault(label, []).append(record)
    return found


def _format_range(values: Sequence[float | None], text: Callable[[float], str]) -> str:
    """Return median, smallest and largest of the known values as text."""
    known = [value for value in values if value is not None]
    if not known:
        return "-"
    middle, low, high = (text(f(known)) for f in (statistics.median, min, max))
    return middle if low == high else f"{middle} ({low} to {high})"


def _number(value: float) -> str:
    return f"{value:.4g}"


def _list_names(names: Sequence[str]) -> str:
    """Return the first names and the number of the others."""
    more = len(names) - _LISTED
    return " ".join(names[:_LISTED]) + (f" and {more} more" if more > 0 else "") or "-"
