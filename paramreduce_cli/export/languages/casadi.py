"""Serialised CasADi functions."""

from pathlib import Path
from tempfile import TemporaryDirectory

import casadi as ca
import numpy as np

from paramreduce_cli.export.exported_model import ExportedModel, write_header
from paramreduce_cli.expressions.functions import Argument, Function

_CALLS = {
    "sin": ca.sin,
    "cos": ca.cos,
    "tan": ca.tan,
    "asin": ca.asin,
    "acos": ca.acos,
    "atan": ca.atan,
    "sqrt": ca.sqrt,
    "atan2": ca.atan2,
    "tanh": ca.tanh,
    "sign": ca.sign,
    "inv": lambda x: 1 / x,
    "/": lambda x, y: x / y,
    "+": lambda x, y: x + y,
    "*": lambda x, y: x * y,
}


def casadi(model: ExportedModel) -> dict[str, bytes]:
    """Write one file a function, for casadi.Function.load in Python, MATLAB and C++, and a text about them.

    The function ``parameters`` returns the values, if they are not constants of the code.
    """
    functions = {f.name: _make_function(f) for f in (*model.functions, *model.closures)}
    if model.closures:
        functions |= _make_loop_functions(model, functions)
    if not model.constant:
        values = ca.DM([p.value for p in model.parameters])
        functions["parameters"] = ca.Function("parameters", [], [values], [], ["phi"])
    files = {f"{model.name}_{name}.casadi": _serialise(f) for name, f in functions.items()}
    lines = [*write_header(model), "", *(str(function) for function in functions.values())]
    return files | {f"{model.name}.txt": ("\n".join(lines) + "\n").encode()}


def _serialise(function: ca.Function) -> bytes:
    """Return the bytes that Function.load reads; CasADi writes them to files only."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "function.casadi"
        function.save(str(path))
        return path.read_bytes()


def _make_function(function: Function) -> ca.Function:
    """Return a function as a CasADi function of its arguments."""
    symbols = [ca.SX.sym(a.name, *a.shape) for a in function.arguments]
    flat = [_list_elements(symbol) for symbol in symbols]
    inputs = [element for elements in flat for element in elements]
    values: list[ca.SX] = []
    for node in function.program.nodes:
        if node.operation == "constant":
            values.append(ca.SX(node.number))
        elif node.operation == "input":
            values.append(inputs[int(node.number)])
        else:
            operands = [_resolve_signed(values, value) for value in node.operands]
            values.append(_CALLS[node.operation](*operands))
    outputs = [_resolve_signed(values, value) for value in function.program.outputs]
    results = []
    for array in function.results:
        own, outputs = outputs[: array.size], outputs[array.size :]
        results.append(_shape_matrix(own, array))
    names = [a.name for a in function.arguments], [r.name for r in function.results]
    return ca.Function(function.name, symbols, results, *names)


def _list_elements(symbol: ca.SX) -> list[ca.SX]:
    """Return the elements of a matrix row by row."""
    return [symbol[i, j] for i in range(symbol.shape[0]) for j in range(symbol.shape[1])]


def _resolve_signed(values: list[ca.SX], value: int) -> ca.SX:
    return -values[value >> 1] if value & 1 else values[value >> 1]


def _shape_matrix(elements: list[ca.SX], array: Argument) -> ca.SX:
    """Return elements as a dense matrix of the shape of an array."""
    rows, columns = (*array.shape, 1)[:2]
    return ca.densify(ca.reshape(ca.vertcat(*elements), columns, rows).T)


def _make_loop_functions(
    model: ExportedModel, functions: dict[str, ca.Function]
) -> dict[str, ca.Function]:
    """Return the functions that solve the position, velocity and acceleration problems of loops."""
    d, z = list(model.dependent), model.independent.tolist()
    order = np.argsort([*d, *z]).tolist()
    n, n_z = len(order), len(z)

    def whole(dependent: ca.MX, independent: ca.MX) -> ca.MX:
        return ca.vertcat(dependent, independent)[order]

    position, guess = ca.MX.sym("z", n_z), ca.MX.sym("guess", n)
    unknown = ca.MX.sym("x", len(d))
    gap = functions["closure"](whole(unknown, position))[0]
    solver = ca.rootfinder(
        "closed", "newton", {"x": unknown, "p": position, "g": gap}, {"abstol": 1e-12}
    )
    q = whole(solver(x0=guess[d], p=position)["x"], position)
    positions = ca.Function("positions", [position, guess], [q], ["z", "guess"], ["q"])

    q, dz = ca.MX.sym("q", n), ca.MX.sym("dz", n_z)
    by_d, by_z = functions["closure_jacobian"](q)
    R = -ca.solve(by_d, by_z, "qr")
    velocities = ca.Function(
        "velocities", [q, dz], [R, whole(R @ dz, dz)], ["q", "dz"], ["R", "dq"]
    )

    dq, ddz, tangent = ca.MX.sym("dq", n), ca.MX.sym("ddz", n_z), ca.MX.sym("R", len(d), n_z)
    b = ca.solve(by_d, functions["closure_bias"](q, dq), "qr")
    accelerations = ca.Function(
        "accelerations",
        [q, dq, tangent, ddz],
        [b, whole(tangent @ ddz + b, ddz)],
        ["q", "dq", "R", "ddz"],
        ["b", "ddq"],
    )
    return {"positions": positions, "velocities": velocities, "accelerations": accelerations}
