"""A table for papers."""

import re
from collections.abc import Iterable, Mapping, Sequence
from types import MappingProxyType

from paramreduce_cli.texts import latex
from paramreduce_cli.texts.table import Table

_FITTING = 80
"""Characters of a row beyond which it is scaled to the width of the line."""
_WIDE = 150
"""Characters beyond which it is turned, as scaled to the line it would be too small to read."""
_PAGE = 40
"""Lines beyond which a table is broken over pages."""
_LONG = 45
"""Characters from which on a cell is broken."""
_SPACE = 3
"""Characters that the space between two columns takes."""
_NUMBER = re.compile(r"-?(\d*)(?:\.(\d*))?(?:e(-?)\+?(\d+))?")


def latex_table(table: Table, symbols: Mapping[str, str] = MappingProxyType({})) -> str:
    """A tabular with its caption, or a longtable where it is more than a page; names as formulas.

    Columns of numbers are siunitx's, long texts are broken, what is wide is set small, and what is
    wider than that is turned.

    Args:
        table: What is set.
        symbols: Formulas by the names they stand for.
    """
    table = _shares_in_the_heading(table)
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
    lengths = (max(map(len, cells)) for cells in zip(table.header, *table.rows, strict=True))
    width = sum(min(length, _LONG) + _SPACE for length in lengths)
    lines = [r"\hline", head, r"\hline", *rows, r"\hline"]
    whole = _over_pages if height > _PAGE else _on_a_page
    return "\n".join(whole("".join(kinds), caption, lines, width)) + "\n"


def _over_pages(kinds: str, caption: str, lines: Sequence[str], width: int) -> list[str]:
    turned = width > _WIDE
    size = r"\tiny" if turned else r"\footnotesize"
    if width > _FITTING:
        size = rf"{size}\setlength{{\tabcolsep}}{{3pt}}"
    return [
        f"% needs array, longtable, {'pdflscape, ' if turned else ''}siunitx",
        *([r"\begin{landscape}"] if turned else []),
        rf"{{{size}\begin{{longtable}}{{{kinds}}}",
        caption + r"\\",
        *[*lines[:3], r"\endhead", *lines[3:]],
        r"\end{longtable}}",
        *([r"\end{landscape}"] if turned else []),
    ]


def _on_a_page(kinds: str, caption: str, lines: Sequence[str], width: int) -> list[str]:
    kind = "sidewaystable" if width > _WIDE else "table"
    scaled = width > _FITTING
    return [
        f"% needs array, graphicx, {'rotating, ' if kind != 'table' else ''}siunitx",
        rf"\begin{{{kind}}}" + ("[ht]" if kind == "table" else ""),
        r"\centering",
        caption,
        *([r"\resizebox{\linewidth}{!}{%"] if scaled else []),
        rf"\begin{{tabular}}{{{kinds}}}",
        *lines,
        r"\end{tabular}" + ("}" if scaled else ""),
        rf"\end{{{kind}}}",
    ]


def _shares_in_the_heading(table: Table) -> Table:
    """Where all cells of a column are shares the per cent stands in its heading, and numbers are left."""
    shares = [
        all(re.fullmatch(r"[\d.]+ %", row[k]) for row in table.rows) and bool(table.rows)
        for k in range(len(table.header))
    ]
    return Table(
        table.title,
        tuple(
            f"{cell} / %" if own else cell for cell, own in zip(table.header, shares, strict=True)
        ),
        tuple(
            tuple(
                cell.removesuffix(" %") if own else cell
                for cell, own in zip(row, shares, strict=True)
            )
            for row in table.rows
        ),
    )


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
        return r">{\raggedright\arraybackslash}p{0.5\linewidth}"
    shares = [cell.removesuffix(" %").removeprefix("> ").replace(".", "") for cell in cells]
    return "r" if cells and all(map(str.isdecimal, shares)) else "l"
