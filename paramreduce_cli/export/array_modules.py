"""Python modules of functions of arrays, which NumPy, JAX and PyTorch share but for a few lines."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from paramreduce_cli.export.exported_model import ExportedModel, write_header
from paramreduce_cli.export.expressions import Language
from paramreduce_cli.export.template_rendering import render_template
from paramreduce_cli.expressions.functions import Argument, Function
from paramreduce_cli.records import FloatArray


@dataclass(frozen=True)
class ArrayLibrary:
    """The settings of one array library for exported modules."""

    prefix: str
    """Name that the library is imported as."""
    calls: Mapping[str, str]
    """Names of :data:`paramreduce_cli.export.expressions.FUNCTIONS` in the library."""
    opening: str
    """Template of imports, values of the parameters and helpers."""
    closures: str
    """Template of the functions that solve loops."""
    notes: tuple[str, ...]
    """Lines on how to call the functions, for the docstring of the module."""
    test_imports: tuple[str, ...]
    """Lines that open the self-test."""
    test_array: str
    """Function that makes the arrays of the self-test from lists."""
    decorator: str = ""
    """Decorator of the functions."""
    conversion: str = ""
    """Expression of the parameters in the precision of the states; empty if there is one precision."""


def write_module(model: ExportedModel, library: ArrayLibrary) -> dict[str, bytes]:
    """Return a module, and a self-test for it; the functions take one state or arrays of states."""
    values = [p.value for p in model.parameters]
    lines = ['"""', *write_header(model), "", *library.notes, '"""', ""]
    lines += render_template(library.opening, values=values).rstrip("\n").split("\n")
    for function in (*model.functions, *model.closures):
        lines += ["", ""]
        lines += _write_function(function, library, private=function in model.closures)
    text = "\n".join(lines) + "\n"
    if model.closures:
        text += "\n\n" + render_template(library.closures, **model.list_coordinates())
    test = _write_test(model, library)
    return {f"{model.name}.py": text.encode(), f"{model.name}_test.py": test.encode()}


def _write_function(function: Function, library: ArrayLibrary, *, private: bool) -> list[str]:
    """Return the lines of a function."""
    arguments = ", ".join(a.name for a in function.arguments)
    lines = [library.decorator] * bool(library.decorator)
    lines += [f"def {'_' * private}{function.name}({arguments}):"]
    lines += [f'    """{function.text} {function.describe_cost()}', ""]
    lines += _write_section("Args", function.arguments)
    lines += _write_section("Returns", function.results)
    lines += ['    """']
    lines += [f"    {a.name} = _array({a.name!r}, {a.name}, {a.shape})" for a in function.arguments]
    if library.conversion and "phi" in {a.name for a in function.arguments}:
        lines.append(f"    phi = {library.conversion}")
    language = Language(library.calls, repr, lambda array, k: f"{array.name}[..., {_index(array, k)}]")  # fmt: skip
    steps, outputs = language.write_body(function)
    lines += [f"    {name} = {text}" for name, text in steps]
    shapes = ", ".join(f"{a.name}.shape[:-{len(a.shape)}]" for a in function.arguments)
    lines.append(f"    many = {library.prefix}.broadcast_shapes({shapes})")
    for result in function.results:
        elements, outputs = outputs[: result.size], outputs[result.size :]
        lines.append(f"    {result.name} = _gather([{', '.join(elements)}], many, {result.shape})")
    returned = ", ".join(r.name for r in function.results)
    return [*lines, f"    return {returned}"]


def _write_section(title: str, arrays: Sequence[Argument]) -> list[str]:
    """Return the lines of a docstring's section about arrays."""
    shapes = (", ".join(map(str, a.shape)) for a in arrays)
    listed = [f"        {a.name}: {a.text}, ({s})" for a, s in zip(arrays, shapes, strict=True)]
    return [f"    {title}:", *listed]


def _index(array: Argument, k: int) -> str:
    """Return the index of element k of an array, counted row by row."""
    return ", ".join(str(int(i)) for i in np.unravel_index(k, array.shape))


def _write_test(model: ExportedModel, library: ArrayLibrary) -> str:
    """Return the self-test of the module."""
    sizes = model.collect_arrays()

    def write_literal(name: str, values: FloatArray) -> str:
        """Return the assignment of values to a name."""
        shape = sizes[name].shape if name in sizes else values.shape[1:]
        rows = np.reshape(values, (len(values), *shape))
        return f"{name} = {library.test_array}({rows.tolist()!r})"

    cases = [write_literal(name, values) for name, values in model.cases.items()]
    return render_template("test.py", model=model, cases=cases, imports=library.test_imports)
