"""A table for papers."""

import re
from collections.abc import Iterable, Mapping, Sequence
from types import MappingProxyType

from paramreduce_cli.report.table import Table
from paramreduce_cli.texts import latex

_FITTING = 80
"""Characters of a row beyond which it is scaled to the width of the line."""
_PAGE = 40
"""Lines beyond which a table is broken over pages."""
_LONG = 45
"""Characters from which on a cell is broken."""
_SPACE = 3
"""Characters that the space between two columns takes."""
_NUMBER = re.compile(r"-?(\d*)(?:\.(\d*))?(?:e(-?)\+?(\d+))?")


def latex_table(table: Table, symbols: Mapping[str, str] = MappingProxyType({})) -> str:
    """A tabular with its caption, or a longtable where it is more than a page; names as formulas.

    Columns of numbers are siunitx's, long texts are broken, and what is wide is set small.

    Args:
        table: What is set.
        symbols: Formulas by the names they stand for.
    """
    columns = [[row[k] for row in table.rows] for k in range(len(table.header))]
    kinds = [_kind(cells) for cells in columns]
    # siunitx takes what is in braces for text, and sets what is not.
    head = _row(
        f"{{{latex(cell, symbols)}}}" if kind.startswith("S") else latex(cell, symbols)
        for cell, kind in zip(table.header, kinds, strict=True)
    )
    rows = [
        _row(
            cell if kind.startswith("S") else latex(cell, symbols)
            for cell, kind in zip(row, kinds, strict=True)
        )
        for row in table.rows
    ]
    caption = rf"\caption{{{latex(table.title, symbols)}}}"
    height = sum(1 + max(map(len, cells)) // _LONG for cells in table.rows)
    if height > _PAGE:
        lines = [
            "% needs array, longtable, siunitx",
            rf"{{\footnotesize\begin{{longtable}}{{{''.join(kinds)}}}",
            caption + r"\\",
            *[r"\hline", head, r"\hline", r"\endhead", *rows, r"\hline"],
            r"\end{longtable}}",
        ]
        return "\n".join(lines) + "\n"
    lengths = (max(map(len, cells)) for cells in zip(table.header, *table.rows, strict=True))
    wide = sum(min(length, _LONG) + _SPACE for length in lengths) > _FITTING
    lines = [
        "% needs array, graphicx, siunitx",
        r"\begin{table}[ht]",
        r"\centering",
        caption,
        *([r"\resizebox{\linewidth}{!}{%"] if wide else []),
        rf"\begin{{tabular}}{{{''.join(kinds)}}}",
        *[r"\hline", head, r"\hline", *rows, r"\hline"],
        r"\end{tabular}" + ("}" if wide else ""),
        r"\end{table}",
    ]
    return "\n".join(lines) + "\n"


def _row(cells: Iterable[str]) -> str:
    return " & ".join(cells) + r" \\"


def _kind(cells: Sequence[str]) -> str:
    """How LaTeX sets a column: decimal points under each other, long texts broken."""
    found = [_NUMBER.fullmatch(cell) for cell in cells]
    if cells and all(match is not None and match[0].strip("-") for match in found):
        parts = [match.groups(default="") for match in found if match is not None]
        before, after, power = (max(len(part[k]) for part in parts) for k in (0, 1, 3))
        sign = "-" if any(cell.startswith("-") for cell in cells) else ""
        minus = "-" if any(part[2] for part in parts) else ""
        point = f".{after}" if after else ""
        return f"S[table-format={sign}{before}{point}{f'e{minus}{power}' if power else ''}]"
    if max(map(len, cells), default=0) > _LONG:
        return r">{\raggedright\arraybackslash}p{0.56\linewidth}"
    shares = [cell.removesuffix(" %").removeprefix("> ").replace(".", "") for cell in cells]
    return "r" if cells and all(map(str.isdecimal, shares)) else "l"
