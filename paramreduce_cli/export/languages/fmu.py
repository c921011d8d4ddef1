"""Functional mock-up units of FMI 3.0, one unit per function: forward dynamics are simulated, other functions computed."""

import io
import platform
import subprocess
import sys
import tempfile
import uuid
import warnings
import zipfile
from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import prod
from pathlib import Path
from typing import Any

from paramreduce_cli.errors import ParamreduceWarning
from paramreduce_cli.export.exported_model import ExportedModel, make_harmless
from paramreduce_cli.export.languages.c import write_scalar_source
from paramreduce_cli.export.template_rendering import render_template
from paramreduce_cli.expressions.compiled import find_compiler
from paramreduce_cli.expressions.functions import Function

_FLAGS = ("-std=c99", "-O2", "-fPIC", "-shared", "-fvisibility=hidden")
_FIRST_DATE = (1980, 1, 1, 0, 0, 0)
"""Date of all files in a unit, so that equal models give equal files."""
_LONGEST_STEP = 1e-3
"""Longest step of the integration, s."""
_SYSTEMS = {"linux": ("linux", ".so"), "darwin": ("darwin", ".dylib"), "win32": ("windows", ".dll")}
_MACHINES = {"AMD64": "x86_64", "x86_64": "x86_64", "arm64": "aarch64", "aarch64": "aarch64"}

_REFERENCES = ("const fmi3ValueReference", "[]")
_SIZE = ("size_t", "")
_UNSUPPORTED = {
    "GetBinary": [_REFERENCES, _SIZE, ("size_t", "[]"), ("fmi3Binary", "[]"), _SIZE],
    "SetBinary": [_REFERENCES, _SIZE, ("const size_t", "[]"), ("const fmi3Binary", "[]"), _SIZE],
    "GetClock": [_REFERENCES, _SIZE, ("fmi3Clock", "[]")],
    "SetClock": [_REFERENCES, _SIZE, ("const fmi3Clock", "[]")],
    "GetNumberOfVariableDependencies": [("fmi3ValueReference", ""), ("size_t *", "")],
    "GetVariableDependencies": [
        ("fmi3ValueReference", ""), ("size_t", "[]"), ("fmi3ValueReference", "[]"),
        ("size_t", "[]"), ("fmi3DependencyKind", "[]"), _SIZE,
    ],
    "GetDirectionalDerivative": [
        _REFERENCES, _SIZE, _REFERENCES, _SIZE, ("const fmi3Float64", "[]"), _SIZE,
        ("fmi3Float64", "[]"), _SIZE,
    ],
    "GetAdjointDerivative": [
        _REFERENCES, _SIZE, _REFERENCES, _SIZE, ("const fmi3Float64", "[]"), _SIZE,
        ("fmi3Float64", "[]"), _SIZE,
    ],
    "GetIntervalDecimal": [
        _REFERENCES, _SIZE, ("fmi3Float64", "[]"), ("fmi3IntervalQualifier", "[]"),
    ],
    "GetIntervalFraction": [
        _REFERENCES, _SIZE, ("fmi3UInt64", "[]"), ("fmi3UInt64", "[]"),
        ("fmi3IntervalQualifier", "[]"),
    ],
    "GetShiftDecimal": [_REFERENCES, _SIZE, ("fmi3Float64", "[]")],
    "GetShiftFraction": [_REFERENCES, _SIZE, ("fmi3UInt64", "[]"), ("fmi3UInt64", "[]")],
    "SetIntervalDecimal": [_REFERENCES, _SIZE, ("const fmi3Float64", "[]")],
    "SetIntervalFraction": [
        _REFERENCES, _SIZE, ("const fmi3UInt64", "[]"), ("const fmi3UInt64", "[]"),
    ],
    "SetShiftDecimal": [_REFERENCES, _SIZE, ("const fmi3Float64", "[]")],
    "SetShiftFraction": [
        _REFERENCES, _SIZE, ("const fmi3UInt64", "[]"), ("const fmi3UInt64", "[]"),
    ],
    "GetOutputDerivatives": [
        _REFERENCES, _SIZE, ("const fmi3Int32", "[]"), ("fmi3Float64", "[]"), _SIZE,
    ],
    "ActivateModelPartition": [("fmi3ValueReference", ""), ("fmi3Float64", "")],
}  # fmt: skip
"""Functions of the standard that every unit answers with an error, with types and brackets of their arguments after the instance."""


@dataclass(frozen=True)
class _Variable:
    """A variable of a unit: time, or an array of numbers."""

    name: str
    text: str
    shape: tuple[int, ...] = ()
    causality: str = "output"
    variability: str = "continuous"
    values: tuple[float, ...] = ()
    """Values at the start; empty for what is computed."""
    derivative_of: str = ""
    """Name of the variable that this one is the derivative of."""
    state: bool = False
    """Whether it is a continuous state."""


def fmu(model: ExportedModel) -> dict[str, bytes]:
    """Write a unit of FMI 3.0 for each function, with its source and a binary for this machine; forward dynamics are
    simulated.
    """
    files = {}
    for function in model.functions:
        name = f"{model.name}_{function.name}"
        files[f"{name}.fmu"] = _write_unit(model, function, name)
    return files


def _write_unit(model: ExportedModel, function: Function, name: str) -> bytes:
    """Return the archive of a unit."""
    simulated = function.name == "forward_dynamics"
    variables = _list_variables(model, function, simulated=simulated)
    shown = _number_variables(variables)
    context: dict[str, Any] = {
        "unit": name,
        "name": model.name,
        "about": make_harmless(" ".join([*model.heading, function.text])),
        "text": function.text,
        "function": function.name,
        "variables": shown,
        "n_values": sum(v["size"] for v in shown),
        **model.list_coordinates(),
        "n_states": 2 * model.independent.size if simulated else 0,
        "state": _name_motion(model)[0],
        "loops": bool(model.closures),
        "assembly": model.start.tolist(),
        "loop_arguments": _list_loop_arguments(variables),
        "call": _list_call(model, function),
        "unsupported": _UNSUPPORTED,
    }
    _, source = write_scalar_source(replace(model, functions=(function,), single=False))
    context["token"] = str(uuid.uuid5(uuid.NAMESPACE_OID, repr(context) + source))
    source += "\n" + render_template("fmu.c", **context)
    files = {
        "modelDescription.xml": render_template("modelDescription.xml", **context).encode(),
        "sources/buildDescription.xml": render_template("buildDescription.xml", **context).encode(),
        f"sources/{name}.c": source.encode("ascii", "replace"),
    }
    return _pack(files | _build(files[f"sources/{name}.c"], name))


def _list_variables(
    model: ExportedModel, function: Function, *, simulated: bool
) -> list[_Variable]:
    """Return the variables of a unit; coordinates that loops determine are no inputs."""
    variables = [_Variable("time", "time, s", causality="independent")]
    if "phi" in {argument.name for argument in function.arguments}:
        values = tuple(p.value for p in model.parameters)
        text = f"parameters: {', '.join(p.name for p in model.parameters)}"
        variables.append(_Variable("phi", text, (len(values),), "parameter", "tunable", values))
    variables += _list_simulated(model) if simulated else _list_computed(model, function)
    if model.closures:
        text = f"all coordinates: {', '.join(model.coordinates)}"
        variables.append(_Variable("q", text, (len(model.coordinates),)))
    return variables


def _list_simulated(model: ExportedModel) -> list[_Variable]:
    """Return the variables of a simulation: states, their derivatives, torques and the longest step."""
    q, dq, ddq = _name_motion(model)
    n = model.independent.size
    start, zero = tuple(model.start[model.independent].tolist()), (0.0,) * n
    listed = ", ".join(model.coordinates[k] for k in model.independent)
    longest = "longest step of the Runge-Kutta method in a co-simulation, s"
    return [
        _Variable(q, f"coordinates, rad or m: {listed}", (n,), values=start, state=True),
        _Variable(dq, "their velocities", (n,), values=zero, derivative_of=q, state=True),
        _Variable(ddq, "their accelerations", (n,), derivative_of=dq),
        _Variable("tau", f"torques or forces, N m or N: {listed}", (n,), "input", values=zero),
        _Variable("longest_step", longest, (), "parameter", "tunable", (_LONGEST_STEP,)),
    ]


def _list_computed(model: ExportedModel, function: Function) -> list[_Variable]:
    """Return the variables of a function: the independent coordinates and what it needs of their motion, and its results."""
    q, dq, ddq = _name_motion(model)
    n = model.independent.size
    start, zero = tuple(model.start[model.independent].tolist()), (0.0,) * n
    listed = ", ".join(model.coordinates[k] for k in model.independent)
    taken = {argument.name for argument in function.arguments}
    variables = [_Variable(q, f"coordinates, rad or m: {listed}", (n,), "input", values=start)]
    if taken & {"dq", "ddq", "b"}:
        variables.append(_Variable(dq, "their velocities", (n,), "input", values=zero))
    if "ddq" in taken:
        variables.append(_Variable(ddq, "their accelerations", (n,), "input", values=zero))
    return variables + [_Variable(a.name, a.text, a.shape) for a in function.results]


def _name_motion(model: ExportedModel) -> tuple[str, str, str]:
    """Return the names of the independent coordinates, their velocities and their accelerations."""
    return ("z", "dz", "ddz") if model.closures else ("q", "dq", "ddq")


def _number_variables(variables: Sequence[_Variable]) -> list[dict[str, Any]]:
    """Return the variables as dictionaries for the templates, with value references and offsets among all values."""
    references = {v.name: k for k, v in enumerate(variables)}
    first, numbered = 0, []
    for v in variables:
        size = prod(v.shape)
        values = v.values or (0.0,) * size
        numbered.append({
            "reference": references[v.name], "name": v.name, "text": make_harmless(v.text),
            "shape": v.shape, "size": size, "first": first, "causality": v.causality,
            "variability": v.variability, "settable": v.causality in ("input", "parameter"),
            "initial": v.state, "start_values": ", ".join(map(repr, values)),
            "start": " ".join(map(repr, v.values)),
            "initial_kind": "exact" if v.state else "calculated" * (v.causality == "output"),
            "derivative": references.get(v.derivative_of),
        })  # fmt: skip
        first += size
    return numbered


def _list_loop_arguments(variables: Sequence[_Variable]) -> list[str]:
    """Return the arguments for z, dz and ddz in the call that closes the loops; those that are absent or computed are zero."""
    given = {v.name for v in variables if v.causality == "input" or v.state}
    return [f"V_{name}" if name in given else "zero" for name in ("z", "dz", "ddz")]


def _list_call(model: ExportedModel, function: Function) -> list[str]:
    """Return the arguments of the call of the function."""
    inside = {"q", "dq", "ddq", "R", "b"} if model.closures else set()
    arrays = (*function.arguments, *function.results)
    return [f"unit->{a.name}" if a.name in inside else f"V_{a.name}" for a in arrays]


def _build(source: bytes, name: str) -> dict[str, bytes]:
    """Return the binary for this machine by its path in the unit; without a compiler nothing, with a warning."""
    system, ending = _SYSTEMS.get(sys.platform, (sys.platform, ".so"))
    machine = _MACHINES.get(platform.machine(), platform.machine())
    compiler = find_compiler()
    why = "there is no C compiler"
    if compiler is not None:
        with tempfile.TemporaryDirectory() as folder:
            Path(folder, "unit.c").write_bytes(source)
            command = [*compiler, *_FLAGS, "unit.c", "-o", "unit", "-lm"]
            done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
            if done.returncode == 0:
                binary = Path(folder, "unit").read_bytes()
                return {f"binaries/{machine}-{system}/{name}{ending}": binary}
            why = f"{compiler[0]} failed ({done.stderr.strip().splitlines()[-1:]})"
    warnings.warn(
        f"{name}.fmu holds its source but no binary, as {why}; importers that compile sources can use it",
        ParamreduceWarning,
        stacklevel=2,
    )
    return {}


def _pack(files: dict[str, bytes]) -> bytes:
    """Return a zip archive of files."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in files.items():
            archive.writestr(zipfile.ZipInfo(name, _FIRST_DATE), content, zipfile.ZIP_DEFLATED)
    return buffer.getvalue()
