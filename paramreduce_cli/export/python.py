"""A NumPy module, and a self-test for it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from paramreduce_cli.export.exported import ExportedModel, about
from paramreduce_cli.export.language import FUNCTIONS, Language
from paramreduce_cli.expressions.functions import Argument, Function
from paramreduce_cli.records import FloatArray
from paramreduce_cli.registry import exporter

_CALLS = {
    name: f"np.{name.replace('a', 'arc', 1) if name[0] == 'a' else name}" for name in FUNCTIONS
}


_CHECKED = """
def _array(name, values, shape):
    array = np.asarray(values, dtype=float)
    if array.shape[-len(shape) :] != shape:
        raise ValueError(f"{name} has shape {array.shape}; its last axes must be {shape}")
    return array
""".strip().split("\n")


@exporter("python")
def python(model: ExportedModel) -> dict[str, bytes]:
    """A module that needs NumPy alone; functions take one state or arrays of states."""
    lines = ['"""', *about(model), ""]
    lines += [
        "Arrays may have leading axes for many states; the last axis, or the last two of a matrix,",
        "are those of one state.",
        '"""',
        "",
        "import numpy as np",
        "",
        f"PHI = np.array({[p.value for p in model.parameters]})",
        '"""Values of the parameters."""',
    ]
    lines += ["", "", *_CHECKED]
    for function in (*model.functions, *model.closures):
        lines += ["", "", *_function(function, private=function in model.closures)]
    if model.closures:
        lines += ["", "", *_loops(model)]
    text = "\n".join(lines) + "\n"
    return {
        f"{model.name}.py": text.encode(),
        f"{model.name}_test.py": _test(model).encode(),
    }


def _function(function: Function, *, private: bool) -> list[str]:
    arguments = ", ".join(a.name for a in function.arguments)
    lines = [f"def {'_' * private}{function.name}({arguments}):"]
    lines += [f'    """{function.text} {function.program.n_operations} operations.', ""]
    lines += _documented("Args", function.arguments) + _documented("Returns", function.results)
    lines += ['    """']
    lines += [f"    {a.name} = _array({a.name!r}, {a.name}, {a.shape})" for a in function.arguments]
    steps, outputs = _LANGUAGE.body(function)
    lines += [f"    {name} = {text}" for name, text in steps]
    shapes = ", ".join(f"{a.name}.shape[:-{len(a.shape)}]" for a in function.arguments)
    lines.append(f"    many = np.broadcast_shapes({shapes})")
    start = 0
    for result in function.results:
        some = outputs[start : start + result.size]
        start += result.size
        shape = ", ".join(map(str, result.shape))
        lines.append(f"    {result.name} = np.empty((*many, {shape}))")
        lines += [
            f"    {result.name}[..., {_index(result, k)}] = {text}" for k, text in enumerate(some)
        ]
    returned = ", ".join(r.name for r in function.results)
    return [*lines, f"    return {returned}"]


def _documented(title: str, arrays: Sequence[Argument]) -> list[str]:
    shapes = (", ".join(map(str, a.shape)) for a in arrays)
    listed = [f"        {a.name}: {a.text}, ({s})" for a, s in zip(arrays, shapes, strict=True)]
    return [f"    {title}:", *listed]


def _index(array: Argument, k: int) -> str:
    return ", ".join(str(int(i)) for i in np.unravel_index(k, array.shape))


_LANGUAGE = Language(_CALLS, repr, lambda array, k: f"{array.name}[..., {_index(array, k)}]")


def _loops(model: ExportedModel) -> list[str]:
    d, z = list(model.dependent), model.independent.tolist()
    return f'''_DEPENDENT = {d}
_INDEPENDENT = {z}


def positions(z, guess):
    """Close the loops at independent coordinates, by Newton's method.

    Args:
        z: Independent coordinates, ({len(z)})
        guess: All coordinates near the solution, ({len(d) + len(z)})
    Returns:
        All coordinates.
    Raises:
        ValueError: The loops cannot be closed from there.

    From a guess far off, the solution may be another assembly of the mechanism.
    """
    shape = (*np.shape(z)[:-1], {len(d) + len(z)})
    q = np.array(np.broadcast_to(guess, shape), dtype=float)
    q[..., _INDEPENDENT] = z
    for _ in range(50):
        gap, jacobian = _closure(q)
        before = np.sum(gap**2, axis=-1)
        try:
            step = np.linalg.solve(jacobian, gap[..., None])[..., 0]
        except np.linalg.LinAlgError as error:
            raise ValueError("singular: the loops cannot be closed from this guess") from error
        largest = np.max(np.abs(step), axis=-1)
        near = largest < 1e-6
        share = np.minimum(1.0, 0.6 / np.maximum(largest, 1e-300))
        for _ in range(10):
            trial = q.copy()
            trial[..., _DEPENDENT] -= share[..., None] * step
            worse = (np.sum(_closure(trial)[0] ** 2, axis=-1) > before) & ~near
            if not np.any(worse):
                break
            share = np.where(worse, share / 2, share)
        q = trial
        if np.max(np.abs(step)) < 1e-12:
            return q
    raise ValueError("the loops cannot be closed from this guess")


def velocities(q, dz):
    """Solve the velocity problem.

    Args:
        q: Coordinates that close the loops, ({len(d) + len(z)})
        dz: Independent velocities, ({len(z)})
    Returns:
        R: derivatives of the dependent by the independent coordinates, ({len(d)}, {len(z)})
        dq: all velocities, ({len(d) + len(z)})
    """
    by_dependent, by_independent = _closure_jacobian(q)
    R = -np.linalg.solve(by_dependent, by_independent)
    return R, _whole(R @ np.asarray(dz)[..., None], dz)


def accelerations(q, dq, R, ddz):
    """Solve the acceleration problem.

    Args:
        q: Coordinates, ({len(d) + len(z)})
        dq: velocities, same shape
        R: from the velocity problem, ({len(d)}, {len(z)})
        ddz: independent accelerations, ({len(z)})
    Returns:
        b: accelerations of the dependent coordinates at ddz = 0, ({len(d)})
        ddq: all accelerations, ({len(d) + len(z)})
    """
    by_dependent, _ = _closure_jacobian(q)
    b = np.linalg.solve(by_dependent, _closure_bias(q, dq)[..., None])
    return b[..., 0], _whole(R @ np.asarray(ddz)[..., None] + b, ddz)


def _whole(dependent, independent):
    independent = np.asarray(independent)
    result = np.empty((*independent.shape[:-1], {len(d) + len(z)}))
    result[..., _INDEPENDENT] = independent
    result[..., _DEPENDENT] = dependent[..., 0]
    return result'''.split("\n")


def _test(model: ExportedModel) -> str:
    sizes = model.sizes()

    def literal(name: str, values: FloatArray) -> str:
        shape = sizes[name].shape if name in sizes else values.shape[1:]
        rows = np.reshape(values, (len(values), *shape))
        return f"{name} = np.array({rows.tolist()!r})"

    lines = [f'"""Self-test of {model.name}.py against an independent formulation."""', ""]
    lines += ["import numpy as np", f"import {model.name} as model", "", "failures = 0", ""]
    lines += [literal(name, values) for name, values in model.cases.items()]
    lines += [
        "",
        "",
        "def compare(what, got, expected):",
        "    global failures",
        "    off = np.max(np.abs(got - expected)) / max(np.max(np.abs(expected)), 1e-300)",
        "    good = off <= 1e-12",
        "    print('ok  ' if good else 'FAIL', what, f'off by {off:.1e}')",
        "    failures += not good",
        "",
        "",
    ]
    for function in model.functions:
        arguments = ", ".join(a.name for a in function.arguments)
        many = f"model.{function.name}({arguments})"
        one = ", ".join(f"{a.name}[0]" for a in function.arguments)
        if len(function.results) == 1:
            (r,) = function.results
            lines.append(f"compare({function.name!r}, {many}, {r.name})")
            lines.append(
                f"compare('{function.name}, one state', model.{function.name}({one}), {r.name}[0])"
            )
        else:
            lines.append(f"got = {many}")
            lines += [
                f"compare('{function.name}, {r.name}', got[{k}], {r.name})"
                for k, r in enumerate(function.results)
            ]
    if model.closures:
        lines += [
            "found = model.positions(z, guess)",
            "compare('positions, q', found, q)",
            "tangent, rates = model.velocities(q, dz)",
            "compare('velocities, R', tangent, R)",
            "compare('velocities, dq', rates, dq)",
            "drift, rates = model.accelerations(q, dq, R, ddz)",
            "compare('accelerations, b', drift, b)",
            "compare('accelerations, ddq', rates, ddq)",
        ]
    lines += ["raise SystemExit(1 if failures else 0)"]
    return "\n".join(lines) + "\n"
