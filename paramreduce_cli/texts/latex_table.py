"""A table in LaTeX, for papers."""

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType

from paramreduce_cli.texts import to_latex
from paramreduce_cli.texts.table import Table

_FITTING = 80
"""Characters of a row beyond which the table is scaled to the width of the line."""
_WIDE = 150
"""Characters of a row beyond which the table is rotated, as its scaled text would be too small."""
_PAGE = 40
"""Lines beyond which a table is broken across pages."""
_LONG = 45
"""Characters of a cell from which on its text is broken into lines."""
_SPACE = 3
"""Characters that the gap between two columns takes."""
_SYMBOLS = {
    "torque error": "ε_τ",
    "accel. error": "ε_z̈",
    "operations inverse": "d",
    "operations direct": "[M, δ]",
}
"""Symbols that replace words of headings, as papers have them."""
_NUMBER = re.compile(r"-?(\d*)(?:\.(\d*))?(?:e(-?)\+?(\d+))?")


def format_latex_table(table: Table, symbols: Mapping[str, str] = MappingProxyType({})) -> str:
    """Return a table as a LaTeX tabular with a caption, or as a longtable if it is longer than a page.

    Columns of numbers are set by siunitx, long texts are broken into lines, wide tables are set smaller, and wider
    tables are rotated.

    Args:
        table: Table to format.
        symbols: LaTeX formulas by the name that each replaces.
    """
    table = _move_percent_signs(_abbreviate_headings(table))
    columns = [[row[k] for row in table.rows] for k in range(len(table.header))]
    kinds = [_choose_column_type(cells) for cells in columns]
    # siunitx takes what is in braces for text, and sets what is not.
    head = _format_row(
        f"{{{to_latex(cell, symbols)}}}" if kind.startswith("S") else to_latex(cell, symbols)
        for cell, kind in zip(table.header, kinds, strict=True)
    )
    rows = [
        _format_row(
            cell if kind.startswith("S") else to_latex(cell, symbols)
            for cell, kind in zip(row, kinds, strict=True)
        )
        for row in table.rows
    ]
    caption = rf"\caption{{{to_latex(table.title, symbols)}}}"
    height = sum(1 + max(map(len, cells)) // _LONG for cells in table.rows)
    lengths = (max(map(len, cells)) for cells in zip(table.header, *table.rows, strict=True))
    width = sum(min(length, _LONG) + _SPACE for length in lengths)
    lines = [r"\hline", head, r"\hline", *rows, r"\hline"]
    whole = _format_longtable if height > _PAGE else _format_tabular
    return "\n".join(whole("".join(kinds), caption, lines, width)) + "\n"


def _abbreviate_headings(table: Table) -> Table:
    """Return the table with symbols in place of words in its headings."""
    header = list(table.header)
    for words, symbol in _SYMBOLS.items():
        header = [cell.replace(words, symbol) for cell in header]
    return replace(table, header=tuple(header))


def _format_longtable(kinds: str, caption: str, lines: Sequence[str], width: int) -> list[str]:
    """Return the lines of a longtable, rotated if its rows are wide."""
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


def _format_tabular(kinds: str, caption: str, lines: Sequence[str], width: int) -> list[str]:
    """Return the lines of a table on one page, rotated if its rows are wide."""
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


def _move_percent_signs(table: Table) -> Table:
    """Return the table with per-cent signs moved to the heading of each column whose cells all have one."""
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


def _format_row(cells: Iterable[str]) -> str:
    return " & ".join(cells) + r" \\"


def _choose_column_type(cells: Sequence[str]) -> str:
    """Return the type of a column: aligned decimal points for numbers, right-aligned for percentages, with line breaks
    for long texts, else left-aligned.
    """
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
