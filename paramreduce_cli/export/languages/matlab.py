"""MATLAB and Octave: one function a file, and a script that tests them."""

import numpy as np

from paramreduce_cli.export.exported_model import ExportedModel, write_header
from paramreduce_cli.export.expressions import FUNCTIONS, Language
from paramreduce_cli.export.template_rendering import render_template
from paramreduce_cli.expressions.functions import Argument, Function
from paramreduce_cli.records import FloatArray


def matlab(model: ExportedModel) -> dict[str, bytes]:
    """Write function files for MATLAB and Octave; vectors are columns."""
    name = model.name
    files = {
        f"{name}_{function.name}": _write_function(model, function)
        for function in (*model.functions, *model.closures)
    }
    files[f"{name}_parameters"] = _write_parameters(model)
    if model.closures:
        files |= _write_loop_functions(model)
    files[f"{name}_test"] = _test(model)
    return {f"{file}.m": (text + "\n").encode("ascii", "replace") for file, text in files.items()}


def _write_comment(lines: list[str]) -> list[str]:
    return [f"% {line}".rstrip() for line in lines]


def _write_function(model: ExportedModel, function: Function) -> str:
    """Return the file of a function."""
    results = ", ".join(r.name for r in function.results)
    arguments = ", ".join(a.name for a in function.arguments)
    lines = [f"function [{results}] = {model.name}_{function.name}({arguments})"]
    documented = [f"{function.text} {function.describe_cost()}"]
    documented += [
        f"{array.name}: {array.text}, {' x '.join(map(str, array.shape))}"
        for array in (*function.arguments, *function.results)
    ]
    lines += _write_comment([*documented, "", *write_header(model, 1)])
    steps, outputs = _LANGUAGE.write_body(function)
    lines += [f"{name} = {text};" for name, text in steps]
    for result in function.results:
        rows, columns = (*result.shape, 1)[:2]
        lines.append(f"{result.name} = zeros({rows}, {columns});")
    for (array, k), text in zip(function.list_positions(function.results), outputs, strict=True):
        lines.append(f"{_write_element(array, k)} = {text};")
    return "\n".join([*lines, "end"])


def _write_element(array: Argument, k: int) -> str:
    """Return the text of element k of an array, counted row by row."""
    indices = ", ".join(str(int(i) + 1) for i in np.unravel_index(k, array.shape))
    return f"{array.name}({indices})"


_LANGUAGE = Language({name: name for name in FUNCTIONS}, repr, _write_element)


def _write_parameters(model: ExportedModel) -> str:
    """Return the function that gives the values of the parameters."""
    lines = [f"function phi = {model.name}_parameters()", "% The values of the parameters."]
    lines += _write_comment(write_header(model, 1))
    values = "; ".join(repr(p.value) for p in model.parameters)
    return "\n".join([*lines, f"phi = [{values}];", "end"])


def _write_loop_functions(model: ExportedModel) -> dict[str, str]:
    """Return the functions that solve the position, velocity and acceleration problems of loops."""
    sides = model.list_coordinates(first=1)
    return {
        f"{model.name}_{problem}": render_template(f"{problem}.m", name=model.name, **sides).rstrip(
            "\n"
        )
        for problem in ("positions", "velocities", "accelerations")
    }


def _test(model: ExportedModel) -> str:
    """Return the script that compares all functions with stored results."""
    sizes = model.collect_arrays()
    count = len(next(iter(model.cases.values())))

    def write_literal(values: FloatArray) -> str:
        """Return values as a matrix of MATLAB."""
        rows = np.reshape(values, (count, -1)).tolist()
        return f"[{'; '.join(' '.join(map(repr, row)) for row in rows)}]"

    def write_case(array: str) -> str:
        """Return the text of an array of case k, in its shape."""
        row = f"cases.{array}(k, :)"
        shape = sizes[array].shape if array in sizes else (1,)
        return f"{row}'" if len(shape) == 1 else f"reshape({row}, {shape[1]}, {shape[0]})'"

    def checks(what: str, results: list[str]) -> str:
        return "\n".join(
            f"  failures = failures + differs('{what}, {r}', {r}, {write_case(r)}, cases.{r}, {model.least[r]!r});"
            for r in results
        )

    cases = {key: write_literal(values) for key, values in model.cases.items()}
    arguments = {
        f.name: ", ".join(write_case(a.name) for a in f.arguments) for f in model.functions
    }
    text = render_template(
        "test.m",
        model=model,
        cases=cases,
        count=count,
        one=write_case,
        arguments=arguments,
        checks=checks,
    )
    return text.rstrip("\n")
