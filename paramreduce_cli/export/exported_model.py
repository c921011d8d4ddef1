"""What every exporter is given, and what texts of all languages share."""

import keyword
import re
import sys
import textwrap
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from paramreduce_cli.expressions.functions import Argument, Function
from paramreduce_cli.records import FloatArray, IntArray


@dataclass(frozen=True)
class ParameterValue:
    """A value that the model keeps."""

    name: str
    value: float
    unit: str
    expression: str
    """Sum of standard parameters that the value is of."""


@dataclass(frozen=True)
class ExportedModel:
    """A reduced model with all information that its code and comments contain."""

    robot: str
    heading: tuple[str, ...]
    """Origin and accuracy of the model, line by line."""
    frames: tuple[str, ...]
    """Frames that the parameters refer to, line by line."""
    coordinates: tuple[str, ...]
    units: tuple[str, ...]
    """Unit of each coordinate, rad or m."""
    independent: IntArray
    """Positions of the independent coordinates, (n_dof,)."""
    start: FloatArray
    """Coordinates from which loops are closed; zero in open trees, (n_q,)."""
    parameters: tuple[ParameterValue, ...]
    symbols: Mapping[str, str]
    """Formulas of names in the expressions, for LaTeX."""
    constant: bool
    """Whether the values of the parameters are in the code."""
    functions: tuple[Function, ...]
    closures: tuple[Function, ...]
    """Closures of a mechanism with loops; empty for a tree."""
    loop_problems: tuple[Function, ...]
    """Newton's correction, and the velocity and acceleration problems of loops, solved with pivots in a fixed order."""
    least_pivots: FloatArray
    """Magnitudes of the pivots below which these solutions are not trusted, (n_d,)."""
    single: bool
    """Whether numbers have single precision, where the language has a choice."""
    cases: Mapping[str, FloatArray]
    """Arguments and results by the straightforward model for the self-test, (n_cases, ...); what has
    the name of an argument is handed in, what has that of a result is compared."""
    least: Mapping[str, float]
    """Smallest sizes that results are judged by in the self-test, by their names: results that are zero but for rounding
    have no size of their own."""

    @property
    def dependent(self) -> tuple[int, ...]:
        """Positions of the dependent coordinates."""
        known = set(self.independent.tolist())
        return tuple(k for k in range(len(self.coordinates)) if k not in known)

    def list_coordinates(self, first: int = 0) -> dict[str, object]:
        """Return the positions of dependent and independent coordinates, counted from ``first``, for templates."""
        sides = {"dependent": list(self.dependent), "independent": self.independent.tolist()}
        numbers = {"n_d": len(self.dependent), "n_z": self.independent.size}
        shifted = {key: [k + first for k in some] for key, some in sides.items()}
        return {**shifted, **numbers, "n_q": len(self.coordinates)}

    @property
    def name(self) -> str:
        """Name of the robot as an identifier."""
        return make_identifier(self.robot)

    def collect_arrays(self) -> dict[str, Argument]:
        """Return all arguments and results of all functions, by name."""
        arrays = (a for f in (*self.functions, *self.closures) for a in (*f.arguments, *f.results))
        return {array.name: array for array in arrays}


_TAKEN = {
    "fsspec",
    "jax",
    "jaxlib",
    "jinja2",
    "ml_dtypes",
    "mpmath",
    "networkx",
    "numpy",
    "opt_einsum",
    "scipy",
    "sympy",
    "torch",
    "typing_extensions",
    "ALL",
    "INTERFACE",
    "PRIVATE",
    "PUBLIC",
    "all",
    "clean",
    "edit_cache",
    "help",
    "install",
    "m",
    "package",
    "rebuild_cache",
    "test",
}
"""Names of modules, files and targets that exported code itself uses, and words of CMake."""

_RUST = {
    "Self",
    "abstract", "alloc", "as", "async", "await", "become", "box", "break", "const", "continue",
    "core", "crate", "do", "dyn", "else", "enum", "extern", "false", "final", "fn", "for", "gen",
    "if", "impl", "in", "let", "loop", "macro", "match", "mod", "move", "mut", "override", "priv",
    "proc_macro", "pub", "ref", "return", "self", "static", "std", "struct", "super", "test",
    "trait", "true", "try", "type", "typeof", "union", "unsafe", "unsized", "use", "virtual",
    "where", "while", "yield",
}  # fmt: skip
"""Words that no crate may be called."""
_WIDTH = 100
"""Characters of a line of a header, at most, where its words allow."""
_FIXED = "\N{NO-BREAK SPACE}"
_MADE_OF = (
    "Parameters, {}; each is followed by the sum of standard parameters that it is,",
    "ordered by the values in the config, without parameters that are zero there:",
)
_FITTED = (
    "Parameters, {}; they were fitted to this pruned function, so they are no sums of",
    "standard parameters; units in parentheses save products:",
)


def make_identifier(name: str) -> str:
    """Return a name for files, for Python's module and as the prefix of names in code."""
    word = re.sub(r"[^A-Za-z0-9_]", "_", name)
    reserved = keyword.iskeyword(word) or word in _TAKEN | _RUST | sys.stdlib_module_names
    return word if re.match(r"[A-Za-z]", word) and not reserved else f"robot_{word}"


def make_harmless(text: str) -> str:
    """Return text that cannot end a comment or a string in double quotes.

    Double quotes become apostrophes, backslashes slashes, unprintable characters blanks; */, /* and ??? are split by
    blanks.
    """
    kept = "".join(c if c.isprintable() else " " for c in text)
    for bad, good in (("\\", "/"), ('"', "'"), ("*/", "* /"), ("/*", "/ *"), ("???", "? ? ?")):
        kept = kept.replace(bad, good)
    return kept


def write_header(model: ExportedModel, first: int = 0) -> list[str]:
    """Return the lines that open every file.

    Args:
        model: Model that is exported.
        first: Number that the language counts from, 0 or 1.
    """
    lines = [make_harmless(line) for line in model.heading]
    lines += [
        "",
        "Coordinates, in this order; forces are in N m where they are in rad, in N where in m:",
    ]
    lines += _list_coordinates(model, range(len(model.coordinates)), first)
    if model.closures:
        lines += ["", "Independent coordinates, in the order of z, dz, ddz, tau, M, delta and K:"]
        lines += _list_coordinates(model, model.independent.tolist(), first)
        lines += ["", "Dependent coordinates, in the order of the rows of R and b:"]
        lines += _list_coordinates(model, model.dependent, first)
    kind = "constants of the code" if model.constant else "in this order"
    explained = any(p.expression for p in model.parameters)
    lines += [
        "",
        "First moments and inertias are about the origin of their body's frame, in its axes. Frames:",
        *(make_harmless(line) for line in model.frames),
        "",
        *(line.format(kind) for line in (_MADE_OF if explained else _FITTED)),
    ]
    for k, p in enumerate(model.parameters, first):
        made_of = f", {make_harmless(p.expression)}" if p.expression else ""
        lines.append(
            f"  {k}: {make_harmless(p.name)} = {p.value:.9g}{f' {p.unit}' if p.unit else ''}{made_of}"
        )
    return [part for line in lines for part in wrap_line(line)]


def wrap_line(line: str) -> list[str]:
    """Split a line into parts of a readable width, all but the first indented; signs and factors stay with their terms."""
    if len(line) <= _WIDTH:
        return [line]
    together = re.sub(
        r"(?<= [+-]) ([0-9.e+-]+ )?", lambda found: found[0].replace(" ", _FIXED), line
    )
    indent = " " * (len(line) - len(line.lstrip()) + 4)
    parts = textwrap.wrap(
        together, _WIDTH, subsequent_indent=indent, break_long_words=False, break_on_hyphens=False
    )
    return [part.replace(_FIXED, " ") for part in parts]


def _list_coordinates(model: ExportedModel, positions: Iterable[int], first: int) -> list[str]:
    return [
        f"  {k}: {make_harmless(model.coordinates[i])}, {model.units[i]}"
        for k, i in enumerate(positions, first)
    ]
