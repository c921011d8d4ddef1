"""Compare two summaries: what differs, by how much, and whether that is tolerable."""

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import product
from typing import Any


@dataclass(frozen=True)
class Tolerance:
    """A tolerance for two numbers: relative, and absolute near zero."""

    relative: float
    absolute: float = 0.0

    def holds(self, a: float | None, b: float | None) -> bool:
        """Whether two numbers are near enough; None stands for an infinite one."""
        if a is None or b is None:
            return a is b
        return math.isclose(a, b, rel_tol=self.relative, abs_tol=self.absolute)


TOLERANCES: dict[str, Tolerance] = {
    "kappa": Tolerance(0.05),
    "torque_error": Tolerance(1e-4, 1e-9),
    "acceleration_error": Tolerance(1e-3, 1e-6),
    "operations": Tolerance(0.0),
    "mass_matrix": Tolerance(1e-4, 1e-9),
    "parameters": Tolerance(1e-5, 1e-9),
    "terms": Tolerance(0.05),
}
_TIE = Tolerance(1e-7, 1e-9)


@dataclass(frozen=True)
class Difference:
    """One quantity that is not the same in both summaries."""

    what: str
    first: str
    second: str
    tolerated: bool
    quantity: str = ""
    """Key of :data:`QUANTITIES` that the difference belongs to."""

    @property
    def size(self) -> float:
        """Relative difference of two numbers; infinite if one is infinite or no number."""
        try:
            first, second = float(self.first), float(self.second)
        except ValueError:
            return math.inf
        return abs(second - first) / (max(abs(first), abs(second)) or 1.0)


Summary = Mapping[str, Any]
Quantity = Callable[[Summary, Summary, Mapping[str, Tolerance]], Iterator[Difference]]


def compare(
    first: Summary,
    second: Summary,
    tolerances: Mapping[str, Tolerance] = TOLERANCES,
    only: tuple[str, ...] = (),
) -> list[Difference]:
    """Return all differences between two summaries, tolerable ones included.

    Args:
        first: Expected summary.
        second: Summary that is compared.
        tolerances: Tolerances by quantity.
        only: Quantities to compare; all if empty.
    """
    names = only or tuple(QUANTITIES)
    return [
        replace(difference, quantity=name)
        for name in names
        for difference in QUANTITIES[name](first, second, tolerances)
    ]


def _compare_models(
    a: Summary, b: Summary, tolerances: Mapping[str, Tolerance]
) -> Iterator[Difference]:
    for key in ("n_dof", "n_parameters", "n_affecting", "n_base", "names"):
        yield from _compare_exactly(f"model.{key}", a["model"][key], b["model"][key])


def _compare_exactly(what: str, a: Any, b: Any) -> Iterator[Difference]:
    if a != b:
        yield Difference(what, str(a), str(b), tolerated=False)


def _compare_kappa(
    a: Summary, b: Summary, tolerances: Mapping[str, Tolerance]
) -> Iterator[Difference]:
    """Compare the best and the median condition number; only larger ones are differences, as the optimiser is random."""
    if a["trajectories"] is None or b["trajectories"] is None:
        yield from _compare_exactly("trajectories", a["trajectories"], b["trajectories"])
        return
    limit = 1 + tolerances["kappa"].relative
    for label, pick in (("best", min), ("median", _find_median)):
        x, y = (pick(_list_kappas(s)) for s in (a, b))
        if x != y:
            yield Difference(f"kappa, {label}", f"{x:.5g}", f"{y:.5g}", tolerated=y <= x * limit)


def _list_kappas(summary: Summary) -> list[float]:
    """Return the condition numbers of the estimation trajectories; unknown ones are infinite."""
    found = [t["kappa"] for t in summary["trajectories"]["estimation"]]
    return [math.inf if kappa is None else kappa for kappa in found] or [math.inf]


def _find_median(values: list[float]) -> float:
    """Return the median."""
    ordered = sorted(values)
    middle = len(ordered) // 2
    return (ordered[middle] + ordered[~middle]) / 2


def _compare_numbers(part: str) -> Quantity:
    """Return the comparison of one quantity of all validated models."""

    def quantity(
        a: Summary, b: Summary, tolerances: Mapping[str, Tolerance]
    ) -> Iterator[Difference]:
        for name, rows in a["validation"].items():
            others = {row["n"]: row for row in b["validation"].get(name, [])}
            yield from _compare_exactly(
                f"sizes of {part}, {name}", [r["n"] for r in rows], [*others]
            )
            left_out = _find_open_sizes(a, b, name)
            if part != "torque_error":
                left_out |= _find_tied_sizes(a, b, name)
            for x in (row for row in rows if row["n"] not in left_out):
                y = others.get(x["n"], x)
                if part == "operations" and None in {*x[part].values(), *y[part].values()}:
                    continue  # counted in one run at most, as only what is shown is counted
                yield from _compare_rows(
                    f"{name}, n = {x['n']}", part, x[part], y[part], tolerances[part]
                )

    return quantity


def _compare_rows(
    where: str, part: str, x: Mapping[str, Any], y: Mapping[str, Any], tolerance: Tolerance
) -> Iterator[Difference]:
    """Yield every difference between the entries of one quantity of one model, also tolerable ones, which are marked."""
    yield from _compare_exactly(f"{part}, {where}", sorted(x), sorted(y))
    for key in x.keys() & y.keys():
        one, two = _list_values(x[key]), _list_values(y[key])
        yield from _compare_exactly(f"entries of {part}.{key}, {where}", len(one), len(two))
        for k, (p, q) in enumerate(zip(one, two, strict=False)):
            if p != q:
                joint = f", joint {k + 1}" if isinstance(x[key], list) else ""
                if isinstance(x[key], dict):
                    joint = f", {list(x[key])[k]}"
                what = f"{part}.{key}, {where}{joint}"
                yield Difference(what, _format_number(p), _format_number(q), tolerance.holds(p, q))


def _list_values(value: Any) -> list[Any]:
    """Return the entries of a mapping or a list; of a number the number alone."""
    if isinstance(value, dict):
        return list(value.values())
    return value if isinstance(value, list) else [value]


def _format_number(value: float | None) -> str:
    return "infinite" if value is None else f"{value:.6g}"


def _compare_subsets(
    a: Summary, b: Summary, tolerances: Mapping[str, Tolerance]
) -> Iterator[Difference]:
    """Compare the subsets; another subset with the same error is no difference."""
    names = [sorted(k for k, v in s["reduction"].items() if "n" in v) for s in (a, b)]
    yield from _compare_exactly("heuristics", *names)
    for name in a["validation"].keys() & b["validation"].keys() & {*names[0]} & {*names[1]}:
        first, second = (dict(_iterate_subsets(s["reduction"][name])) for s in (a, b))
        errors = [
            {row["n"]: row["torque_error"]["estimation"] for row in s["validation"][name]}
            for s in (a, b)
        ]
        yield from _compare_exactly(f"sizes of subsets, {name}", list(first), list(second))
        open_sizes = _find_open_sizes(a, b, name)
        for n in first.keys() & second.keys():
            x, y = set(first[n]), set(second[n])
            if len(x) != len(y):
                yield from _compare_exactly(
                    f"parameters of the subset, {name}, n = {n}", len(x), len(y)
                )
            elif x != y:
                holds = n in open_sizes or _TIE.holds(errors[0].get(n), errors[1].get(n))
                yield Difference(
                    f"subset, {name}, n = {n}",
                    " ".join(sorted(x - y)),
                    " ".join(sorted(y - x)),
                    holds,
                )


def _find_tied_sizes(a: Summary, b: Summary, name: str) -> set[int]:
    """Return the sizes at which a heuristic took different subsets with the same error."""
    found = [dict(_iterate_subsets(s["reduction"][name])) for s in (a, b) if name in s["reduction"]]
    rows = [
        {row["n"]: row["torque_error"]["estimation"] for row in s["validation"].get(name, [])}
        for s in (a, b)
    ]
    if len(found) < 2:
        return set()
    return {
        n
        for n in found[0].keys() & found[1].keys() & rows[0].keys() & rows[1].keys()
        if set(found[0][n]) != set(found[1][n]) and _TIE.holds(rows[0][n], rows[1][n])
    }


def _find_open_sizes(a: Summary, b: Summary, name: str) -> set[int]:
    """Return the sizes whose proof ended in one run alone; their subsets are left to chance.

    Contradictions between the two are found when proofs are compared.
    """
    if name != "best-subset":
        return set()
    first, second = ({p["n"]: p["status"] for p in s["reduction"]["proofs"]} for s in (a, b))
    return {n for n, status in first.items() if second.get(n, status) != status}


def _iterate_subsets(heuristic: Mapping[str, Any]) -> Iterator[tuple[int, list[str]]]:
    """Yield each size of a heuristic with the names of its parameters."""
    for k, n in enumerate(heuristic["n"]):
        yield n, heuristic["subsets"][k] if heuristic["order"] is None else heuristic["order"][:n]


def _compare_loops(
    a: Summary, b: Summary, tolerances: Mapping[str, Tolerance]
) -> Iterator[Difference]:
    """Compare the operations of the kinematics of closed loops, which older summaries lack."""
    x, y = a.get("loops"), b.get("loops")
    if x and y:
        yield from _compare_rows("closed loops", "operations", x, y, tolerances["operations"])


def _compare_proofs(
    a: Summary, b: Summary, tolerances: Mapping[str, Tolerance]
) -> Iterator[Difference]:
    """Compare proofs: an error below a proven one, or a lower bound above it, is a contradiction."""
    others = {proof["n"]: proof for proof in b["reduction"]["proofs"]}
    for x in a["reduction"]["proofs"]:
        y = others.get(x["n"])
        if y is None or x["status"] != "optimal":
            continue
        p, q = x["torque_error"], y["torque_error"]
        what = f"proven error, n = {x['n']}"
        equal = tolerances["torque_error"].holds
        if y["status"] != "optimal":
            possible = (q > p or equal(p, q)) and (
                y["lower_bound"] < p or equal(y["lower_bound"], p)
            )
            yield Difference(
                what, _format_number(p), f"{_format_number(q)}, {y['status']}", possible
            )
        elif p != q:
            yield Difference(what, _format_number(p), _format_number(q), equal(p, q))


def _compare_selected(
    a: Summary, b: Summary, tolerances: Mapping[str, Tolerance]
) -> Iterator[Difference]:
    """Compare the selected models."""
    for key in ("heuristic", "n", "accepted"):
        yield from _compare_exactly(f"selected.{key}", a["selected"][key], b["selected"][key])
    x, y = a["selected"]["parameters"], b["selected"]["parameters"]
    yield from _compare_exactly("selected.parameters", sorted(x), sorted(y))
    for name in x.keys() & y.keys():
        if x[name] != y[name]:
            holds = tolerances["parameters"].holds(x[name], y[name])
            yield Difference(
                f"selected.parameters.{name}",
                _format_number(x[name]),
                _format_number(y[name]),
                holds,
            )


def _compare_terms(
    a: Summary, b: Summary, tolerances: Mapping[str, Tolerance]
) -> Iterator[Difference]:
    """Compare pruned functions by their operations, upwards only, and by whether they keep to the budget."""
    first, second = ({one["function"]: one for one in s.get("terms", [])} for s in (a, b))
    yield from _compare_exactly("pruned functions", sorted(first), sorted(second))
    for name in first.keys() & second.keys():
        x, y = first[name], second[name]
        most = x["operations"] * (1 + tolerances["terms"].relative)
        if x["operations"] != y["operations"]:
            yield Difference(
                f"operations of the pruned function, {name}",
                str(x["operations"]),
                str(y["operations"]),
                y["operations"] <= most,
            )
        yield from _compare_exactly(f"budget of terms, {name}", x["budget"], y["budget"])
        yield from _check_budget(name, x, y)


def _check_budget(name: str, x: Summary, y: Summary) -> Iterator[Difference]:
    """Check that a function keeps to its budgets where the first one did."""
    parts = ("estimation",) if x.get("held_out") else ("estimation", "validation", "test")
    for kind, part in product(("torque", "acceleration"), parts):
        allowed = x["budget"][kind]
        before, now = (one[f"{kind}_error"].get(part) for one in (x, y))
        if part == "test":
            before, now = (one and one["median"] for one in (before, now))
        if before is None or allowed is None or before > allowed:
            continue
        if now is None or now > allowed:
            what = f"{kind} error of the pruned function, {name}, {part}"
            yield Difference(what, f"{before:.6g} of {allowed:.6g}", _format_number(now), False)
    before, now = x["smallest_eigenvalue"], y["smallest_eigenvalue"]
    if before is not None and (now is None or now <= 0 < before):
        what = f"smallest eigenvalue of the pruned function, {name}"
        yield Difference(what, _format_number(before), _format_number(now), False)


QUANTITIES: dict[str, Quantity] = {
    "model": _compare_models,
    "kappa": _compare_kappa,
    "order": _compare_subsets,
    "proofs": _compare_proofs,
    "torque_error": _compare_numbers("torque_error"),
    "acceleration_error": _compare_numbers("acceleration_error"),
    "operations": _compare_numbers("operations"),
    "loops": _compare_loops,
    "mass_matrix": _compare_numbers("mass_matrix"),
    "selected": _compare_selected,
    "terms": _compare_terms,
}
