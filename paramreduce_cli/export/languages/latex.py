"""The approximate base parameters as equations for a paper."""

from paramreduce_cli.export.exported_model import ExportedModel, make_harmless
from paramreduce_cli.texts.latex_table import format_latex_table
from paramreduce_cli.texts.table import Table


def latex(model: ExportedModel) -> dict[str, bytes]:
    """Write a table of the parameters: symbol, value, unit and the standard parameters it consists of."""
    heading = "".join(f"% {make_harmless(line)}".rstrip() + "\n" for line in model.heading)
    columns: tuple[str, ...] = ("parameter", "value", "unit", "made of")
    if not any(p.expression for p in model.parameters):
        columns = columns[:-1]
    rows = tuple(
        (p.name, f"{p.value:.6g}", p.unit.replace("^2", "²"), p.expression)[: len(columns)]
        for p in model.parameters
    )
    own = ", units in parentheses" if any(p.unit.startswith("(") for p in model.parameters) else ""
    table = Table(f"{model.robot}: {len(rows)} parameters{own}", columns, rows)
    return {
        f"{model.name}_parameters.tex": (
            heading + format_latex_table(table, model.symbols)
        ).encode()
    }
