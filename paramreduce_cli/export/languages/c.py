"""C99, with a face for C++17: headers, a source, a self-test, an example, and what builds them."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from paramreduce_cli.export.exported import ExportedModel, about
from paramreduce_cli.export.expressions import FUNCTIONS, Language, signed
from paramreduce_cli.export.rendering import rendered
from paramreduce_cli.export.sines import DOUBLE, SINGLE, polynomial
from paramreduce_cli.expressions.functions import Argument, Function

BLOCK = 64
"""States whose sines and cosines are kept at once in the batched functions."""


def c(model: ExportedModel) -> dict[str, bytes]:
    """C99 without allocation and without globals; single states and batches of them."""
    writer = _Writer(model)
    context = writer.context()
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
        text = rendered(template, **context)
        result[name] = text.encode("ascii", "replace")
    return result


def cpp_type(array: Argument) -> str:
    """Of an array in C++."""
    kind = "Vector" if len(array.shape) == 1 else "Matrix"
    return f"{kind}<{', '.join(map(str, array.shape))}>"


def cpp_argument(array: Argument) -> str:
    """Of an array that is handed in."""
    return f"In<{array.size}>" if len(array.shape) == 1 else f"const {cpp_type(array)} &"


def class_name(function: Mapping[str, Any]) -> str:
    """What a function of several results returns."""
    return str(function["name"]).title().replace("_", "")


class _Writer:
    """Texts of a model in C.

    Args:
        model: The model.
    """

    def __init__(self, model: ExportedModel) -> None:
        self._model = model
        self._suffix = "f" if model.single else ""

    def context(self) -> dict[str, object]:
        """What the templates use."""
        model = self._model
        return {
            "name": model.name,
            "guard": f"{model.name.upper()}_H",
            "about": about(model),
            "real": "float" if model.single else "double",
            "f": self._suffix,
            "bits": 32 if model.single else 64,
            "block": BLOCK,
            **model.sides(),
            "n_phi": 0 if model.constant else len(model.parameters),
            "loops": bool(model.closures),
            "values": [self.number(p.value) for p in model.parameters],
            "signature": self.signature,
            "batch_signature": self.batch_signature,
            "batch_arguments": self.batch_arguments,
            "shifted": self.shifted,
            "body": self.body,
            "type": cpp_type,
            "argument": cpp_argument,
            "class_name": class_name,
            "test_arguments": self.test_arguments,
            "test_batch_arguments": self.test_batch_arguments,
            "functions": [self.function(f) for f in model.functions],
            "closures": [self.function(f) for f in model.closures],
            "stack": self.stack(),
            "signs": any("sign" in f.program.operations for f in model.functions),
            "angles": any(_dependence(f).angles for f in (*model.functions, *model.closures)),
            "sines": self.sines(),
            "cases": self.cases(),
            "least": {name: self.number(size) for name, size in self._model.least.items()},
            "n_cases": (n_cases := len(next(iter(model.cases.values())))),
            "n_states": n_cases * (BLOCK // n_cases + 1),
            "tolerance": "1e-3f" if model.single else "1e-12",
        }

    def number(self, value: float) -> str:
        """How a number is written, in the precision of the code."""
        if self._model.single and np.float32(value) == 0:
            value = 0.0  # compilers warn of numbers that single precision is too coarse for
        text = repr(float(value))
        text = text if any(mark in text for mark in ".en") else f"{text}.0"
        return f"{text}{self._suffix}"

    def function(self, function: Function) -> dict[str, object]:
        """Texts of a function for one state and for many."""
        return {
            "name": function.name,
            "text": function.text,
            "arguments": function.arguments,
            "results": function.results,
            "cost": function.describe_cost(),
            "unused": [
                a.name for a in function.arguments if a.name not in function.find_used_arguments()
            ],
            "statements": self.statements(function),
            "batched": self.batched(function),
        }

    def signature(self, f: Mapping[str, Any]) -> str:
        """Arguments and results of a function of one state."""
        type_ = f"{self._model.name}_real"
        given = [f"const {type_} {a.name}[{a.size}]" for a in f["arguments"]]
        return ", ".join([*given, *(f"{type_} {a.name}[{a.size}]" for a in f["results"])])

    def batch_signature(self, f: Mapping[str, Any]) -> str:
        """Of a function of many states."""
        return f"size_t n, {self._pointers(f, '')}"

    def batch_arguments(self, f: Mapping[str, Any]) -> str:
        """Of a function of one block of them."""
        return self._pointers(f, "RESTRICT ")

    def _pointers(self, f: Mapping[str, Any], mark: str) -> str:
        type_ = f"{self._model.name}_real"
        given = [
            f"const {type_} phi[{a.size}]" if a.name == "phi" else f"const {type_} *{mark}{a.name}"
            for a in f["arguments"]
        ]
        return ", ".join([*given, *(f"{type_} *{mark}{a.name}" for a in f["results"])])

    def shifted(self, f: Mapping[str, Any]) -> str:
        """Arguments of the function of a block that begins at ``start``."""
        names = [a.name for a in (*f["arguments"], *f["results"])]
        return ", ".join(name if name == "phi" else f"{name} + start" for name in names)

    def body(self, f: Mapping[str, Any]) -> str:
        """Of a function of one state."""
        unused = [f"(void){name};" for name in f["unused"]]
        return "\n".join(f"  {line}" for line in [*unused, *f["statements"]])

    def test_arguments(self, f: Mapping[str, Any]) -> str:
        """For state k of the self-test."""
        given = [f"case_{a.name}[k]" for a in f["arguments"]]
        return ", ".join([*given, *(f"{a.name}[k]" for a in f["results"])])

    def test_batch_arguments(self, f: Mapping[str, Any]) -> str:
        """For all states of the self-test."""
        given = ["case_phi[0]" if a.name == "phi" else f"all_{a.name}" for a in f["arguments"]]
        return ", ".join([*given, *(f"all_{a.name}" for a in f["results"])])

    def sines(self) -> dict[str, object]:
        """Constants of sines and cosines, as they are written."""
        known = SINGLE if self._model.single else DOUBLE
        return {
            "one": self.number(1),
            "half": self.number(0.5),
            "magic": self.number(known.magic),
            "limit": self.number(known.limit),
            "inverse": self.number(2 / np.pi),
            "parts": [self.number(part) for part in known.parts],
            "sine": polynomial([self.number(value) for value in known.sine]),
            "cosine": polynomial([self.number(value) for value in known.cosine]),
        }

    def statements(self, function: Function) -> list[str]:
        """The body, one operation a line; sines and cosines of all angles at once."""
        language = self._language(batched=False)
        names = language.leaves(function)
        found = _dependence(function)
        rows = {angle: row for row, angle in enumerate(found.angles)}
        before: list[str] = []
        rest: list[str] = []
        for number, node in function.iterate_steps():
            if number in found.waves:
                row = rows[node.operands[0] >> 1]
                names[number] = f"{'sine' if node.operation == 'sin' else 'cosine'}[{row}]"
                continue
            text = f"const {self._real} t{number} = {language.expression(names, node)};"
            names[number] = f"t{number}"
            (before if number in found.before else rest).append(text)
        if rows:
            count = len(rows)
            angles = ", ".join(names[angle] for angle in rows)
            before.append(f"{self._real} angles[{count}] = {{{angles}}};")
            before.append(f"{self._real} sine[{count}], cosine[{count}];")
            before.append(f"sines({count}, angles, sine, cosine);")
        places = zip(function.list_places(function.results), function.program.outputs, strict=True)
        outputs = [f"{array.name}[{k}] = {signed(names, value)};" for (array, k), value in places]
        return [*before, *rest, *outputs]

    @property
    def _real(self) -> str:
        return "float" if self._model.single else "double"

    def _language(self, *, batched: bool) -> Language:
        """In batches, states are stored coordinate by coordinate."""

        def element(array: Argument, k: int) -> str:
            column = batched and array.name != "phi"
            return f"{array.name}[{k} * n + k]" if column else f"{array.name}[{k}]"

        calls = {name: f"{name}{self._suffix}" for name in FUNCTIONS} | {"sign": "sign"}
        return Language(calls, self.number, element)

    def batched(self, function: Function) -> dict[str, Any]:
        """The body in parts: what depends on parameters alone, angles, and all the rest."""
        program = function.program
        language = self._language(batched=True)
        names = language.leaves(function)
        found = _dependence(function)
        rows = {angle: row for row, angle in enumerate(found.angles)}
        once: list[str] = []
        before: list[str] = []
        rest: list[str] = []
        for number, node in function.iterate_steps():
            if number in found.waves:
                names[number] = f"{node.operation}_{rows[node.operands[0] >> 1]}[k]"
                continue
            if number not in found.rest:
                continue
            text = f"const {self._real} t{number} = {language.expression(names, node)};"
            names[number] = f"t{number}"
            (rest if found.states[number] else once).append(text)
        again = language.leaves(function)
        for number, node in function.iterate_steps():
            if number in found.before:
                text = f"const {self._real} a{number} = {language.expression(again, node)};"
                again[number] = f"a{number}"
                before.append(text)
        filled = [(row, again[angle]) for angle, row in rows.items()]
        outputs = list(dict.fromkeys(program.outputs))
        rest += [f"out[{row}][k] = {signed(names, value)};" for row, value in enumerate(outputs)]
        places = zip(function.list_places(function.results), program.outputs, strict=True)
        return {
            "once": once,
            "before": before,
            "angles": filled,
            "rest": rest,
            "outputs": outputs,
            "copies": [(outputs.index(value), array.name, k) for (array, k), value in places],
        }

    def stack(self) -> int:
        """Of the batched functions, kB: block arrays, and twice as much for temporaries, of which wide vectors take most."""
        arrays = max(
            3 * len(body["angles"]) + len(body["outputs"])
            for body in map(self.batched, self._model.functions)
        )
        width = 4 if self._model.single else 8
        return int(np.ceil(3 * arrays * BLOCK * width / 1024))

    def cases(self) -> dict[str, dict[str, object]]:
        """Stored vectors of the self-test."""
        return {
            name: {
                "size": int(np.prod(values.shape[1:])),
                "rows": [", ".join(self.number(x) for x in np.ravel(row)) for row in values],
            }
            for name, values in self._model.cases.items()
        }


@dataclass(frozen=True)
class _Dependence:
    """What of a function's nodes depends on what."""

    states: list[bool]
    """Which ones depend on the state, and not on parameters alone."""
    waves: set[int]
    """Sines and cosines of what depends on the state, taken all at once."""
    angles: list[int]
    """Of which nodes these are taken, each once."""
    before: set[int]
    """Operations that the angles are made of."""
    rest: set[int]
    """What the results are made of."""


def _dependence(function: Function) -> _Dependence:
    nodes, states = function.program.nodes, function.find_state_dependent()
    waves: set[int] = set()
    before: set[int] = set()
    rest = {value >> 1 for value in function.program.outputs}
    for number in range(len(nodes) - 1, -1, -1):
        below = {value >> 1 for value in nodes[number].operands}
        wave = nodes[number].operation in ("sin", "cos") and states[number]
        if wave and number not in before:
            waves.add(number)
        if wave or number in before:
            before |= below
        if number in rest and number not in waves:
            rest |= below
    operations = {number for number, _ in function.iterate_steps()}
    waves &= operations
    angles = dict.fromkeys(nodes[number].operands[0] >> 1 for number in sorted(waves))
    return _Dependence(states, waves, list(angles), before & operations, rest)
