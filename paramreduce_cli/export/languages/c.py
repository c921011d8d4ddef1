"""C99, with a face for C++17: headers, a source, a self-test, an example, and what builds them."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from paramreduce_cli.export.exported_model import ExportedModel, write_header
from paramreduce_cli.export.expressions import FUNCTIONS, Language, write_float, write_signed
from paramreduce_cli.export.grouped_sines import COSINE, SINE, find_dependence, group_sines
from paramreduce_cli.export.sines import DOUBLE, SINGLE, write_polynomial
from paramreduce_cli.export.template_rendering import render_template
from paramreduce_cli.expressions.functions import Argument, Function

BLOCK = 64
"""States whose sines and cosines are kept at once in the batched functions."""


def c(model: ExportedModel) -> dict[str, bytes]:
    """Write C99 without allocation and without globals, for single states and batches of states."""
    writer = _Writer(model)
    context = writer.make_context()
    result = {}
    for template, name in (
        ("model.h", f"{model.name}.h"),
        ("model.c", f"{model.name}.c"),
        ("model.hpp", f"{model.name}.hpp"),
        ("test.c", f"{model.name}_test.c"),
        ("example.cpp", f"{model.name}_example.cpp"),
        ("Makefile", "Makefile"),
        ("CMakeLists.txt", "CMakeLists.txt"),
    ):
        text = render_template(template, **context)
        result[name] = text.encode("ascii", "replace")
    return result


def write_scalar_source(model: ExportedModel) -> tuple[str, str]:
    """Return the prefix of the names of functions, and C source without the batched ones, which take long to compile."""
    context = _Writer(model).make_context() | {"batched": False}
    header, source = (render_template(name, **context) for name in ("model.h", "model.c"))
    return model.name, header + source.replace(f'#include "{model.name}.h"', "")


def name_cpp_type(array: Argument) -> str:
    """Return the C++ type of an array."""
    kind = "Vector" if len(array.shape) == 1 else "Matrix"
    return f"{kind}<{', '.join(map(str, array.shape))}>"


def name_cpp_argument(array: Argument) -> str:
    """Return the C++ type of an array that is an argument."""
    return f"In<{array.size}>" if len(array.shape) == 1 else f"const {name_cpp_type(array)} &"


def name_result_class(function: Mapping[str, Any]) -> str:
    """Return the name of the class that holds the results of a function."""
    return str(function["name"]).title().replace("_", "")


class _Writer:
    """A writer of a model as C.

    Args:
        model: Model to write.
    """

    def __init__(self, model: ExportedModel) -> None:
        self._model = model
        self._suffix = "f" if model.single else ""

    def make_context(self) -> dict[str, object]:
        """Return what the templates use."""
        model = self._model
        return {
            "name": model.name,
            "guard": f"{model.name.upper()}_H",
            "about": write_header(model),
            "real": "float" if model.single else "double",
            "f": self._suffix,
            "bits": 32 if model.single else 64,
            "block": BLOCK,
            "batched": True,
            **model.list_coordinates(),
            "n_phi": 0 if model.constant else len(model.parameters),
            "loops": bool(model.closures),
            "values": [self.write_number(p.value) for p in model.parameters],
            "signature": self.write_signature,
            "batch_signature": self.write_batch_signature,
            "batch_arguments": self.write_block_signature,
            "shifted": self.write_block_arguments,
            "body": self.write_body,
            "type": name_cpp_type,
            "argument": name_cpp_argument,
            "class_name": name_result_class,
            "test_arguments": self.test_arguments,
            "test_batch_arguments": self.test_batch_arguments,
            "functions": [self.write_function(f) for f in model.functions],
            "closures": [self.write_function(f) for f in (*model.closures, *model.loop_problems)],
            "least_pivots": [self.write_number(value) for value in model.least_pivots.tolist()],
            "stack": self.estimate_stack(),
            "signs": any("sign" in f.program.operations for f in model.functions),
            "angles": any(
                find_dependence(f).angles
                for f in (*model.functions, *model.closures, *model.loop_problems)
            ),
            "sines": self.write_sine_constants(),
            "cases": self.list_cases(),
            "least": {name: self.write_number(size) for name, size in self._model.least.items()},
            "n_cases": (n_cases := len(next(iter(model.cases.values())))),
            "n_states": n_cases * (BLOCK // n_cases + 1),
            "tolerance": "1e-3f" if model.single else "1e-12",
        }

    def write_number(self, value: float) -> str:
        """Return a number as text, in the precision of the code."""
        return f"{write_float(value, single=self._model.single)}{self._suffix}"

    def write_function(self, function: Function) -> dict[str, object]:
        """Return the texts of a function for one state and for many."""
        return {
            "name": function.name,
            "text": function.text,
            "arguments": function.arguments,
            "results": function.results,
            "cost": function.describe_cost(),
            "unused": [
                a.name for a in function.arguments if a.name not in function.find_used_arguments()
            ],
            "statements": self.write_statements(function),
            "batched": self.write_batched(function),
        }

    def write_signature(self, f: Mapping[str, Any]) -> str:
        """Return arguments and results of a function of one state."""
        type_ = f"{self._model.name}_real"
        given = [f"const {type_} {a.name}[{a.size}]" for a in f["arguments"]]
        return ", ".join([*given, *(f"{type_} {a.name}[{a.size}]" for a in f["results"])])

    def write_batch_signature(self, f: Mapping[str, Any]) -> str:
        """Return arguments and results of a function of many states."""
        return f"size_t n, {self._write_pointers(f, '')}"

    def write_block_signature(self, f: Mapping[str, Any]) -> str:
        """Return arguments and results of a function of one block of states."""
        return self._write_pointers(f, "RESTRICT ")

    def _write_pointers(self, f: Mapping[str, Any], mark: str) -> str:
        """Return arguments and results of a batched function as pointers."""
        type_ = f"{self._model.name}_real"
        given = [
            f"const {type_} phi[{a.size}]" if a.name == "phi" else f"const {type_} *{mark}{a.name}"
            for a in f["arguments"]
        ]
        return ", ".join([*given, *(f"{type_} *{mark}{a.name}" for a in f["results"])])

    def write_block_arguments(self, f: Mapping[str, Any]) -> str:
        """Return the arguments in a call with the block that begins at ``start``."""
        names = [a.name for a in (*f["arguments"], *f["results"])]
        return ", ".join(name if name == "phi" else f"{name} + start" for name in names)

    def write_body(self, f: Mapping[str, Any]) -> str:
        """Return the body of a function of one state."""
        unused = [f"(void){name};" for name in f["unused"]]
        return "\n".join(f"  {line}" for line in [*unused, *f["statements"]])

    def test_arguments(self, f: Mapping[str, Any]) -> str:
        """Return the arguments in a call with state k of the self-test."""
        given = [f"case_{a.name}[k]" for a in f["arguments"]]
        return ", ".join([*given, *(f"{a.name}[k]" for a in f["results"])])

    def test_batch_arguments(self, f: Mapping[str, Any]) -> str:
        """Return the arguments in a call with all states of the self-test."""
        given = ["case_phi[0]" if a.name == "phi" else f"all_{a.name}" for a in f["arguments"]]
        return ", ".join([*given, *(f"all_{a.name}" for a in f["results"])])

    def write_sine_constants(self) -> dict[str, object]:
        """Return the constants of sines and cosines as text."""
        known = SINGLE if self._model.single else DOUBLE
        return {
            "one": self.write_number(1),
            "half": self.write_number(0.5),
            "magic": self.write_number(known.magic),
            "limit": self.write_number(known.limit),
            "inverse": self.write_number(2 / np.pi),
            "parts": [self.write_number(part) for part in known.parts],
            "sine": write_polynomial([self.write_number(value) for value in known.sine]),
            "cosine": write_polynomial([self.write_number(value) for value in known.cosine]),
        }

    def write_statements(self, function: Function) -> list[str]:
        """Return the body, one operation a line; sines and cosines of all angles at once."""
        body = group_sines(function, self._make_language(batched=False))

        def declare(steps: Sequence[tuple[str, str]]) -> list[str]:
            """Return the lines of operations."""
            return [f"const {self._real} {name} = {text};" for name, text in steps]

        lines = declare(body.before)
        if count := len(body.angles):
            lines.append(f"{self._real} angles[{count}] = {{{', '.join(body.angles)}}};")
            lines.append(f"{self._real} {SINE}[{count}], {COSINE}[{count}];")
            lines.append(f"sines({count}, angles, {SINE}, {COSINE});")
        positions = function.list_positions(function.results)
        results = zip(positions, body.outputs, strict=True)
        return [*lines, *declare(body.after), *(f"{a.name}[{k}] = {text};" for (a, k), text in results)]  # fmt: skip

    @property
    def _real(self) -> str:
        return "float" if self._model.single else "double"

    def _make_language(self, *, batched: bool) -> Language:
        """Return C as a language; in batches, states are stored coordinate by coordinate."""

        def write_element(array: Argument, k: int) -> str:
            """Return the text of element k of an array."""
            column = batched and array.name != "phi"
            return f"{array.name}[{k} * n + k]" if column else f"{array.name}[{k}]"

        calls = {name: f"{name}{self._suffix}" for name in FUNCTIONS} | {"sign": "sign"}
        return Language(calls, self.write_number, write_element)

    def write_batched(self, function: Function) -> dict[str, Any]:
        """Return the body of a batched function as fields of the template.

        Before the loop are lines that depend on parameters alone (``once``), and lines that compute the angles whose
        sines and cosines are computed together (``before``, ``angles``); in the loop are the lines of each state
        (``rest``).
        """
        program = function.program
        language = self._make_language(batched=True)
        names = language.write_leaves(function)
        dependence = find_dependence(function)
        rows = {angle: row for row, angle in enumerate(dependence.angles)}
        once: list[str] = []
        before: list[str] = []
        rest: list[str] = []
        for number, node in function.iterate_steps():
            if number in dependence.sine_nodes:
                names[number] = f"{node.operation}_{rows[node.operands[0] >> 1]}[k]"
                continue
            if number not in dependence.output_nodes:
                continue
            text = f"const {self._real} t{number} = {language.write_expression(names, node)};"
            names[number] = f"t{number}"
            (rest if dependence.state_dependent[number] else once).append(text)
        angle_names = language.write_leaves(function)
        for number, node in function.iterate_steps():
            if number in dependence.angle_operations:
                text = f"const {self._real} a{number} = {language.write_expression(angle_names, node)};"
                angle_names[number] = f"a{number}"
                before.append(text)
        filled = [(row, angle_names[angle]) for angle, row in rows.items()]
        outputs = list(dict.fromkeys(program.outputs))
        rest += [
            f"out[{row}][k] = {write_signed(names, value)};" for row, value in enumerate(outputs)
        ]
        positions = zip(function.list_positions(function.results), program.outputs, strict=True)
        return {
            "once": once,
            "before": before,
            "angles": filled,
            "rest": rest,
            "outputs": outputs,
            "copies": [(outputs.index(value), array.name, k) for (array, k), value in positions],
        }

    def estimate_stack(self) -> int:
        """Return the stack that batched functions need, kB: block arrays, and twice as much for wide temporaries."""
        arrays = max(
            3 * len(body["angles"]) + len(body["outputs"])
            for body in map(self.write_batched, self._model.functions)
        )
        width = 4 if self._model.single else 8
        return int(np.ceil(3 * arrays * BLOCK * width / 1024))

    def list_cases(self) -> dict[str, dict[str, object]]:
        """Return the stored vectors of the self-test."""
        return {
            name: {
                "size": int(np.prod(values.shape[1:])),
                "rows": [", ".join(self.write_number(x) for x in np.ravel(row)) for row in values],
            }
            for name, values in self._model.cases.items()
        }
