"""A table as text, CSV and LaTeX."""

import csv
import io
import unicodedata
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

from paramreduce_cli.texts import latex


@dataclass(frozen=True)
class Table:
    """Cells of text under a header."""

    title: str
    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]

    def to_text(self) -> str:
        """Aligned columns under the title."""
        lines = [self.header, *self.rows]
        widths = [max(_width(line[k]) for line in lines) for k in range(len(self.header))]

        def aligned(cells: tuple[str, ...]) -> str:
            padded = (
                cell + " " * (width - _width(cell))
                for cell, width in zip(cells, widths, strict=True)
            )
            return "  ".join(padded).rstrip()

        rule = "  ".join("-" * width for width in widths)
        body = [aligned(self.header), rule, *map(aligned, self.rows)]
        return "\n".join([self.title, "", *body]) + "\n"

    def to_csv(self) -> str:
        """Comma-separated values with a header line."""
        buffer = io.StringIO()
        writer = csv.writer(buffer, lineterminator="\n")
        writer.writerow(self.header)
        writer.writerows(self.rows)
        return buffer.getvalue()

    def to_latex(self, symbols: Mapping[str, str] = MappingProxyType({})) -> str:
        """A tabular with its caption, ready to be included; names in it as formulas."""

        def row(cells: tuple[str, ...]) -> str:
            return " & ".join(latex(cell, symbols) for cell in cells) + r" \\"

        lines = [
            r"\begin{table}[ht]",
            r"\centering",
            rf"\caption{{{latex(self.title, symbols)}}}",
            rf"\begin{{tabular}}{{{'l' * len(self.header)}}}",
            r"\hline",
            row(self.header),
            r"\hline",
            *map(row, self.rows),
            r"\hline",
            r"\end{tabular}",
            r"\end{table}",
        ]
        return "\n".join(lines) + "\n"


def _width(text: str) -> int:
    """Columns that a text takes; accents stand on the letter before them."""
    return sum(1 for character in text if not unicodedata.combining(character))
