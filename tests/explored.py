"""Every model that the explorer of a page shows, against the summary beside the page."""

import math

_WALK = """
const chosen = document.querySelector("[data-part=heuristic]"), slider = document.querySelector("[data-part=n]");
const part = (name) => document.querySelector(`[data-part=${name}]`).textContent;
const errors = document.querySelector("#table-errors-by-joint");
const seen = [];
for (const option of chosen.options) {
  chosen.value = option.value;
  chosen.dispatchEvent(new Event("change"));
  for (let row = 0; row <= +slider.max; row++) {
    slider.value = row;
    slider.dispatchEvent(new Event("input"));
    const parts = ["count", "torque", "acceleration", "inverse", "direct", "values"].map(part);
    seen.push([option.textContent, errors.scrollWidth <= errors.clientWidth, ...parts]);
  }
}
return seen;
"""
_SETS = ("estimation", "validation")


def explored(driver, summary):
    """How many models there are, and those that are missing, shown with other numbers, or cut off.

    Args:
        driver: Of a window with the page.
        summary: Of the run.
    """
    rows = {(name, row["n"]): row for name, found in summary["validation"].items() for row in found}
    wrong = dict.fromkeys(rows, "missing")
    for names, fits, n, *shown in driver.execute_script(_WALK):
        for name in names.split(", "):
            key = (name, int(n))
            wrong[key] = _difference(rows.get(key), int(n), fits, *shown)
    return len(rows), {key: what for key, what in wrong.items() if what}


def _difference(row, n, fits, torque, acceleration, inverse, direct, values):
    if row is None:
        return "not in the summary"
    for text, kind in ((torque, "torque_error"), (acceleration, "acceleration_error")):
        errors = [row[kind][s] for s in _SETS]
        if row[kind]["test"] is not None:
            errors.append(row[kind]["test"]["median"])
        if not _same(text, errors):
            return f"{kind}: {text}"
    if (inverse, direct) != tuple(str(row["operations"][f]) for f in ("inverse", "direct")):
        return f"operations: {inverse}, {direct}"
    if values.count(" = ") != n:
        return f"values: {values}"
    return "" if fits else "errors by joint are cut off"


def _same(text, errors):
    """Whether shares are written as they are, to three digits."""
    for told, error in zip(text.replace(" %", "").split(" / "), errors, strict=True):
        if error is None or error >= 10:
            if told not in ("∞", "> 1000"):
                return False
        elif not math.isclose(float(told) / 100, error, rel_tol=6e-3, abs_tol=1e-10):
            return False
    return True
