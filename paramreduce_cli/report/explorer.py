"""What the page's explorer moves through: every model that was found, and one motion to see it on."""

import base64
import gzip
from typing import Any

import numpy as np

from paramreduce_cli.records import (
    SETS,
    ErrorRange,
    FloatArray,
    HeuristicValidation,
    IntArray,
    ModelChoice,
)
from paramreduce_cli.report.curves import EQUAL, gather_curves
from paramreduce_cli.report.data import ReportData

_NUMBERS = 600_000
"""Most entries of the observation matrix that the page carries; an arm of six joints has 300 per sample."""
_FINEST = np.iinfo(np.uint16).max
_FUNCTIONS = ("inverse", "direct")


def pack_explorer(data: ReportData) -> dict[str, Any]:
    """Return everything that the explorer shows as plain data with packed arrays.

    The observation matrix of one motion is embedded in single precision instead of torques: the page multiplies it with
    the parameters of the shown model.

    Args:
        data: Records that the report shows.
    """
    shown = np.flatnonzero(data.reduction.factor[:, :-1].any(axis=0))
    library = _Models(data, shown)
    selected = data.validation.selected
    return {
        "selected": {"heuristic": selected.heuristic, "n": selected.n},
        "measured": data.identification is not None,
        "counted": data.model is not None,
        "functions": data.functions,
        "joints": _list_joints(data),
        "columns": _list_columns(data, shown),
        "curves": _list_curves(data, library),
        "terms": _list_pruned(data),
        "models": library.pack(),
        "motion": _pack_motion(data, shown),
        "figure": _pack_animation(data),
    }


class _Models:
    """The distinct models, each once however many heuristics found it."""

    def __init__(self, data: ReportData, shown: IntArray) -> None:
        self._reduction = data.reduction
        self._place = {int(column): k for k, column in enumerate(shown)}
        self._numbers: dict[bytes, list[int]] = {}
        self._columns: list[np.ndarray] = []
        self._values: list[np.ndarray] = []

    def number_model(self, choice: ModelChoice) -> int:
        """Return the index of a heuristic's model, which is added if it is new; -1 if the model does not exist."""
        row = choice.find_row(self._reduction)
        if row is None:
            return -1
        found = self._reduction.heuristics[choice.heuristic]
        kept = [k for k, column in enumerate(found.subsets[row]) if int(column) in self._place]
        kept.sort(key=lambda k: found.subsets[row][k])
        columns = np.array([self._place[int(found.subsets[row][k])] for k in kept], np.uint16)
        values = found.parameters[row][kept].astype(np.float32)
        # The same parameters may have other values, fitted by another criterion.
        same = self._numbers.setdefault(columns.tobytes(), [])
        for number in same:
            if np.allclose(self._values[number], values, rtol=EQUAL, atol=0):
                return number
        same.append(len(self._columns))
        self._columns.append(columns)
        self._values.append(values)
        return same[-1]

    def pack(self) -> dict[str, Any]:
        """Return columns and values of all models, and where each model begins."""
        starts = np.cumsum([0, *(columns.size for columns in self._columns)])
        return {
            "starts": pack_array(starts.astype(np.uint32)),
            "columns": pack_array(np.concatenate(self._columns)),
            "values": pack_array(np.concatenate(self._values)),
        }


def _list_curves(data: ReportData, library: _Models) -> list[dict[str, Any]]:
    """Return errors and costs by heuristic; heuristics with the same models share a curve."""
    return [
        {
            "names": curve.names,
            "colour": curve.colour,
            "dark": curve.dark_colour,
            "n": curve.result.n.tolist(),
            "model": [
                library.number_model(ModelChoice(curve.names[0], n))
                for n in curve.result.n.tolist()
            ],
            **_list_errors(data, curve.result),
        }
        for curve in gather_curves(data)
    ]


def _list_errors(data: ReportData, result: HeuristicValidation) -> dict[str, Any]:
    """Return the errors and the operations of all models of a heuristic."""
    counted = data.model is not None
    return {
        "torque": {s: pack_array(_get_errors(result, "torque", s)) for s in SETS},
        "joints": {
            s: pack_array((result.joint_torque_error[s] * rms).astype(np.float32))
            for s, rms in data.rms_torque.items()
        },
        "acceleration": {s: pack_array(_get_errors(result, "acceleration", s)) for s in SETS},
        "operations": {
            f: _list_operations(result.operations[f]) if counted else None for f in _FUNCTIONS
        },
    }


def _get_errors(result: HeuristicValidation, what: str, which: str) -> FloatArray:
    """Return the errors on a set, (m,); medians of the motions of the test set."""
    errors: FloatArray = result.get_errors(what)[which]
    if which != "test":
        return errors
    return np.array([ErrorRange.summarise(row).median for row in errors])


def _list_operations(operations: FloatArray) -> list[int | None]:
    """Return operations of models; None of those that were not counted."""
    return [None if np.isnan(one) else int(one) for one in operations]


def _list_pruned(data: ReportData) -> dict[str, Any]:
    """Return operations and errors on the estimation set of pruned functions."""
    found = data.terms.functions if data.terms is not None else {}
    return {
        name: [one.front.operations.tolist(), one.front.torque_error.estimation.tolist()]
        for name, one in found.items()
    }


def _list_joints(data: ReportData) -> list[dict[str, Any]]:
    """Return the joints whose torques are known, with the size of these torques on every set."""
    return [
        {
            "index": j,
            "name": data.name_joint(j),
            "unit": data.find_force_unit(j),
            "rms": {s: float(rms[j]) for s, rms in data.rms_torque.items()},
        }
        for j in np.flatnonzero(np.isfinite(data.reduction.nominal_torque)).tolist()
    ]


def _list_columns(data: ReportData, shown: IntArray) -> list[dict[str, str]]:
    """Return the parameters that are selected from, with the body or drive of each."""
    columns = data.reduction.columns
    if data.model is None:
        return [{"name": columns.names[k], "symbol": columns.names[k], "owner": "", "unit": ""}
                for k in shown]  # fmt: skip
    parameters = data.model.mechanism.parameters
    result = []
    for k in shown:
        first = parameters[int(np.flatnonzero(columns.column == k)[0])]
        alone = first.name == columns.names[k]
        result.append({"name": columns.names[k], "owner": first.owner, "unit": first.unit,
                       "symbol": first.kind.symbol if alone else columns.names[k]})  # fmt: skip
    return result


def _pack_motion(data: ReportData, shown: IntArray) -> dict[str, Any]:
    """Return torques and observation matrix of the motion that is shown, downsampled to limit the size of the page."""
    motion, n_dof = data.motion, data.motion.tau.shape[1]
    step = max(1, -(-motion.time.size * n_dof * shown.size // _NUMBERS))
    W = motion.W[::step] @ data.reduction.columns.expansion[:, shown]
    return {
        "time": pack_array(motion.time[::step]),
        "tau": pack_array(motion.tau[::step].astype(np.float32)),
        "W": pack_array(W.astype(np.float32)),
    }


def _pack_animation(data: ReportData) -> dict[str, Any] | None:
    """Return the mechanism along its motions, points in the base frame and lines between them by body; None without a
    robot.

    Coordinates are embedded in 16 bits as fractions of the box that contains all motions; a step is much less than a
    pixel.
    """
    shown = data.animation
    if shown is None:
        return None
    used = np.unique([line[:2] for line in shown.lines])
    place = {int(point): k for k, point in enumerate(used)}
    points = shown.points[:, used]
    low = np.nanmin(points, axis=(0, 1))
    size = float(np.max(np.nanmax(points, axis=(0, 1)) - low)) or 1.0
    return {
        "count": used.size,
        "points": pack_array(np.round((points - low) / size * _FINEST).astype(np.uint16)),
        "low": low.tolist(),
        "step": size / _FINEST,
        "motions": [{"name": name, "frames": frames} for name, frames in shown.motions],
        "lines": [(place[start], place[end], body, kind) for start, end, body, kind in shown.lines],
        "owners": list(shown.owners),
    }


def pack_array(array: np.ndarray) -> dict[str, Any]:
    """Return an array as compressed text, with its type and shape, for a browser to read."""
    content = gzip.compress(np.ascontiguousarray(array).tobytes(), compresslevel=6, mtime=0)
    return {
        "type": array.dtype.name,
        "shape": list(array.shape),
        "data": base64.b64encode(content).decode(),
    }
