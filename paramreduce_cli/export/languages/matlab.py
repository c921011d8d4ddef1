"""MATLAB and Octave: one function a file, and a script that tests them."""

import numpy as np

from paramreduce_cli.export.exported import ExportedModel, about
from paramreduce_cli.export.expressions import FUNCTIONS, Language
from paramreduce_cli.export.rendering import rendered
from paramreduce_cli.expressions.functions import Argument, Function
from paramreduce_cli.records import FloatArray


def matlab(model: ExportedModel) -> dict[str, bytes]:
    """Function files for MATLAB and Octave; vectors are columns."""
    name = model.name
    files = {
        f"{name}_{function.name}": _function(model, function)
        for function in (*model.functions, *model.closures)
    }
    files[f"{name}_parameters"] = _parameters(model)
    if model.closures:
        files |= _loops(model)
    files[f"{name}_test"] = _test(model)
    return {f"{file}.m": (text + "\n").encode("ascii", "replace") for file, text in files.items()}


def _comment(lines: list[str]) -> list[str]:
    return [f"% {line}".rstrip() for line in lines]


def _function(model: ExportedModel, function: Function) -> str:
    results = ", ".join(r.name for r in function.results)
    arguments = ", ".join(a.name for a in function.arguments)
    lines = [f"function [{results}] = {model.name}_{function.name}({arguments})"]
    documented = [f"{function.text} {function.describe_cost()}"]
    documented += [
        f"{array.name}: {array.text}, {' x '.join(map(str, array.shape))}"
        for array in (*function.arguments, *function.results)
    ]
    lines += _comment([*documented, "", *about(model, 1)])
    steps, outputs = _LANGUAGE.body(function)
    lines += [f"{name} = {text};" for name, text in steps]
    for result in function.results:
        rows, columns = (*result.shape, 1)[:2]
        lines.append(f"{result.name} = zeros({rows}, {columns});")
    for (array, k), text in zip(function.list_places(function.results), outputs, strict=True):
        lines.append(f"{_element(array, k)} = {text};")
    return "\n".join([*lines, "end"])


def _element(array: Argument, k: int) -> str:
    indices = ", ".join(str(int(i) + 1) for i in np.unravel_index(k, array.shape))
    return f"{array.name}({indices})"


_LANGUAGE = Language({name: name for name in FUNCTIONS}, repr, _element)


def _parameters(model: ExportedModel) -> str:
    lines = [f"function phi = {model.name}_parameters()", "% The values of the parameters."]
    lines += _comment(about(model, 1))
    values = "; ".join(repr(p.value) for p in model.parameters)
    return "\n".join([*lines, f"phi = [{values}];", "end"])


def _loops(model: ExportedModel) -> dict[str, str]:
    sides = model.sides(first=1)
    return {
        f"{model.name}_{problem}": rendered(f"{problem}.m", name=model.name, **sides).rstrip("\n")
        for problem in ("positions", "velocities", "accelerations")
    }


def _test(model: ExportedModel) -> str:
    sizes = model.sizes()
    count = len(next(iter(model.cases.values())))

    def literal(values: FloatArray) -> str:
        rows = np.reshape(values, (count, -1)).tolist()
        return f"[{'; '.join(' '.join(map(repr, row)) for row in rows)}]"

    def one(array: str) -> str:
        row = f"cases.{array}(k, :)"
        shape = sizes[array].shape if array in sizes else (1,)
        return f"{row}'" if len(shape) == 1 else f"reshape({row}, {shape[1]}, {shape[0]})'"

    def checks(what: str, results: list[str]) -> str:
        return "\n".join(
            f"  failures = failures + differs('{what}, {r}', {r}, {one(r)}, cases.{r}, {model.least[r]!r});"
            for r in results
        )

    cases = {key: literal(values) for key, values in model.cases.items()}
    arguments = {f.name: ", ".join(one(a.name) for a in f.arguments) for f in model.functions}
    text = rendered(
        "test.m", model=model, cases=cases, count=count, one=one, arguments=arguments, checks=checks
    )
    return text.rstrip("\n")
