"""The approximate base parameters as equations for a paper."""

from __future__ import annotations

import re

from paramreduce_cli.export.exported import ExportedModel, plain
from paramreduce_cli.records import PARAMETER_KINDS
from paramreduce_cli.registry import exporter

_SYMBOL = re.compile(rf"\b({'|'.join(sorted(PARAMETER_KINDS, key=len, reverse=True))})_([\w.-]+)")
_POWER = re.compile(r"([0-9.]+)e([+-]?[0-9]+)")
_ESCAPED = str.maketrans(
    {c: f"\\{c}" for c in "&%$#_{}"} | {"~": r"\textasciitilde{}", "^": r"\textasciicircum{}"}
)


@exporter("latex")
def latex(model: ExportedModel) -> dict[str, bytes]:
    """A table of the parameters: symbol, value, unit and what it is made of."""
    lines = [f"% {plain(line)}".rstrip() for line in model.heading]
    lines += [
        r"\begin{tabular}{lrll}",
        r"parameter & value & unit & made of \\",
        r"\hline",
    ]
    for p in model.parameters:
        value = _POWER.sub(_power, f"{p.value:.6g}")
        unit = p.unit.replace("^2", r"\textsuperscript{2}")
        lines.append(
            f"${symbol(p.name)}'$ & ${value}$ & {unit} & ${mathematics(p.expression)}$ \\\\"
        )
    lines += [r"\end{tabular}", ""]
    return {f"{model.name}_parameters.tex": "\n".join(lines).encode()}


def symbol(name: str) -> str:
    """The symbol of a parameter."""
    found = _SYMBOL.fullmatch(name)
    return _written(found) if found else rf"\text{{{name.translate(_ESCAPED)}}}"


def mathematics(expression: str) -> str:
    """A linear expression of parameters."""
    text = _POWER.sub(_power, expression)
    return _SYMBOL.sub(_written, text).replace("*", r"\,")


def _power(found: re.Match[str]) -> str:
    return rf"{found[1]} \cdot 10^{{{int(found[2])}}}"


def _written(found: re.Match[str]) -> str:
    kind, body = found[1], found[2]
    body = rf"\mathrm{{{body.translate(_ESCAPED)}}}"
    if kind == "m":
        return f"m_{{{body}}}"
    letter, axes = (kind[0], kind[1:])
    return rf"{'I' if letter == 'I' else 'd'}_{{{axes},{body}}}"
