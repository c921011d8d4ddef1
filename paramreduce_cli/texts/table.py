"""A table as text and CSV."""

import csv
import io
import unicodedata
from dataclasses import dataclass


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


def _width(text: str) -> int:
    """Columns that a text takes; accents stand on the letter before them."""
    return sum(1 for character in text if not unicodedata.combining(character))
