"""The approximate base parameters as equations for a paper."""

from paramreduce_cli.export.exported import ExportedModel, plain
from paramreduce_cli.texts import latex as typeset


def latex(model: ExportedModel) -> dict[str, bytes]:
    """A table of the parameters: symbol, value, unit and what it is made of."""
    lines = [f"% {plain(line)}".rstrip() for line in model.heading]
    lines += [r"\begin{tabular}{lrll}", r"parameter & value & unit & made of \\", r"\hline"]
    for p in model.parameters:
        cells = (p.name, f"{p.value:.6g}", p.unit.replace("^2", "²"), p.expression)
        lines.append(" & ".join(typeset(cell, model.symbols) for cell in cells) + r" \\")
    lines += [r"\end{tabular}", ""]
    return {f"{model.name}_parameters.tex": "\n".join(lines).encode()}
