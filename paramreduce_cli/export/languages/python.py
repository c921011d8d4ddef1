"""A NumPy module, and a self-test for it."""

from collections.abc import Sequence

import numpy as np

from paramreduce_cli.export.exported_model import ExportedModel, write_header
from paramreduce_cli.export.expressions import FUNCTIONS, Language
from paramreduce_cli.export.template_rendering import render_template
from paramreduce_cli.expressions.functions import Argument, Function
from paramreduce_cli.records import FloatArray

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


def python(model: ExportedModel) -> dict[str, bytes]:
    """Write a module that needs NumPy alone; its functions take one state or arrays of states."""
    lines = ['"""', *write_header(model), ""]
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
        lines += ["", "", *_write_function(function, private=function in model.closures)]
    text = "\n".join(lines) + "\n"
    if model.closures:
        text += "\n\n" + render_template("closures.py", **model.list_coordinates())
    return {f"{model.name}.py": text.encode(), f"{model.name}_test.py": _test(model).encode()}


def _write_function(function: Function, *, private: bool) -> list[str]:
    """Return the lines of a function."""
    arguments = ", ".join(a.name for a in function.arguments)
    lines = [f"def {'_' * private}{function.name}({arguments}):"]
    lines += [f'    """{function.text} {function.describe_cost()}', ""]
    lines += _write_section("Args", function.arguments) + _write_section(
        "Returns", function.results
    )
    lines += ['    """']
    lines += [f"    {a.name} = _array({a.name!r}, {a.name}, {a.shape})" for a in function.arguments]
    steps, outputs = _LANGUAGE.write_body(function)
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


def _write_section(title: str, arrays: Sequence[Argument]) -> list[str]:
    """Return the lines of a docstring's section about arrays."""
    shapes = (", ".join(map(str, a.shape)) for a in arrays)
    listed = [f"        {a.name}: {a.text}, ({s})" for a, s in zip(arrays, shapes, strict=True)]
    return [f"    {title}:", *listed]


def _index(array: Argument, k: int) -> str:
    return ", ".join(str(int(i)) for i in np.unravel_index(k, array.shape))


_LANGUAGE = Language(_CALLS, repr, lambda array, k: f"{array.name}[..., {_index(array, k)}]")


def _test(model: ExportedModel) -> str:
    """Return the self-test of the module."""
    sizes = model.collect_arrays()

    def write_literal(name: str, values: FloatArray) -> str:
        """Return the assignment of values to a name."""
        shape = sizes[name].shape if name in sizes else values.shape[1:]
        rows = np.reshape(values, (len(values), *shape))
        return f"{name} = np.array({rows.tolist()!r})"

    cases = [write_literal(name, values) for name, values in model.cases.items()]
    return render_template("test.py", model=model, cases=cases)
