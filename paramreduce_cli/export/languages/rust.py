"""A Rust crate, without the standard library where its functions allow: a manifest, a source and a self-test."""

from collections.abc import Mapping, Sequence
from functools import cached_property

import numpy as np

from paramreduce_cli.export.exported_model import ExportedModel, write_header
from paramreduce_cli.export.expressions import FUNCTIONS, Language, write_float
from paramreduce_cli.export.grouped_sines import COSINE, SINE, find_dependence, group_sines
from paramreduce_cli.export.sines import DOUBLE, SINGLE, write_polynomial
from paramreduce_cli.export.template_rendering import render_template
from paramreduce_cli.expressions.functions import Argument, Function


def rust(model: ExportedModel) -> dict[str, bytes]:
    """Write a crate without allocation, in f64 or f32; functions other than sin, cos and sign need std."""
    context = _Writer(model).make_context()
    templates = {
        "Cargo.toml": "Cargo.toml",
        "model.rs": f"{model.name}.rs",
        "test.rs": f"{model.name}_test.rs",
    }
    return {name: render_template(file, **context).encode() for file, name in templates.items()}


def write_type(shape: Sequence[int]) -> str:
    """Return the type of an array."""
    text = "Real"
    for size in reversed(shape):
        text = f"[{text}; {size}]"
    return text


class _Writer:
    """A writer of a model as Rust.

    Args:
        model: Model to write.
    """

    def __init__(self, model: ExportedModel) -> None:
        self._model = model
        calls = {name: f"Real::{name}" for name in FUNCTIONS} | {"sign": "sign"}
        self._language = Language(calls, self._write_number, _write_element, "1.0")

    def make_context(self) -> dict[str, object]:
        """Return what the templates use."""
        model = self._model
        private = [*model.closures, *model.loop_problems]
        return {
            "name": model.name,
            "about": write_header(model),
            "real": "f32" if model.single else "f64",
            "single": model.single,
            **model.list_coordinates(),
            "loops": bool(private),
            "std": self._needs_std,
            "values": [self._write_number(p.value) for p in model.parameters],
            "functions": [self._write_function(f, public=True) for f in model.functions],
            "problems": [self._write_function(f, public=False) for f in private],
            "least_pivots": [self._write_number(value) for value in model.least_pivots.tolist()],
            "signs": any("sign" in f.program.operations for f in self._functions),
            "angles": any(find_dependence(f).angles for f in self._functions),
            "sines": self._write_sine_constants(),
            "cases": self._list_cases(),
            "n_cases": len(next(iter(model.cases.values()))),
            "least": {name: self._write_number(size) for name, size in model.least.items()},
            "tolerance": "1e-3" if model.single else "1e-12",
        }

    @property
    def _functions(self) -> tuple[Function, ...]:
        """All functions."""
        model = self._model
        return (*model.functions, *model.closures, *model.loop_problems)

    @cached_property
    def _needs_std(self) -> bool:
        """Whether functions are called that are in Rust's standard library only."""
        within = {"sin", "cos", "sign"}
        return any(set(f.program.operations) & set(FUNCTIONS) - within for f in self._functions)

    def _write_number(self, value: float) -> str:
        """Return a number as text, in the precision of the code."""
        return write_float(value, single=self._model.single)

    def _write_function(self, function: Function, *, public: bool) -> dict[str, object]:
        """Return the texts of a function."""
        body = group_sines(function, self._language)
        used = function.find_used_arguments()
        given = [
            f"{'' if a.name in used else '_'}{a.name}: &{write_type(a.shape)}"
            for a in function.arguments
        ]
        types = [write_type(a.shape) for a in function.results]
        outputs, written = [], body.outputs
        for array in function.results:
            outputs.append(_nest(written[: array.size], array.shape))
            written = written[array.size :]
        return {
            "name": function.name,
            "public": "pub " * public,
            "text": f"{function.text} {function.describe_cost()}",
            "arguments": function.arguments,
            "results": function.results,
            "given": ", ".join(given),
            "type": types[0] if len(types) == 1 else f"({', '.join(types)})",
            "before": body.before,
            "angles": body.angles,
            "after": body.after,
            "outputs": outputs[0] if len(outputs) == 1 else f"({', '.join(outputs)})",
        }

    def _write_sine_constants(self) -> Mapping[str, object]:
        """Return the constants of sines and cosines as text."""
        known = SINGLE if self._model.single else DOUBLE
        return {
            "bits": "u32" if self._model.single else "u64",
            "shift": 30 if self._model.single else 62,
            "magic": self._write_number(known.magic),
            "limit": self._write_number(known.limit),
            "turn": self._write_number(2 * np.pi),
            "inverse": self._write_number(2 / np.pi),
            "parts": [self._write_number(part) for part in known.parts],
            "sine": write_polynomial([self._write_number(value) for value in known.sine]),
            "cosine": write_polynomial([self._write_number(value) for value in known.cosine]),
            "arrays": (SINE, COSINE),
        }

    def _list_cases(self) -> dict[str, dict[str, object]]:
        """Return the stored vectors of the self-test."""
        shapes = {name: array.shape for name, array in self._model.collect_arrays().items()}
        cases: dict[str, dict[str, object]] = {}
        for name, values in self._model.cases.items():
            shape = shapes.get(name, values.shape[1:])
            rows = [[self._write_number(x) for x in np.ravel(row)] for row in values]
            nested = [_nest(row, shape) for row in rows]
            cases[name] = {"type": write_type(shape), "shape": shape, "rows": nested}
        return cases


def _write_element(array: Argument, k: int) -> str:
    """Return the text of element k of an array, counted row by row."""
    return array.name + "".join(f"[{int(i)}]" for i in np.unravel_index(k, array.shape))


def _nest(elements: Sequence[str], shape: Sequence[int]) -> str:
    """Return an array literal of elements that are given row by row."""
    if len(shape) == 1:
        return f"[{', '.join(elements)}]"
    rows = [_nest(elements[i * shape[1] : (i + 1) * shape[1]], shape[1:]) for i in range(shape[0])]
    return f"[{', '.join(rows)}]"
