"""A table of text cells, as aligned text or CSV."""

import csv
import io
import textwrap
import unicodedata
from dataclasses import dataclass
from itertools import zip_longest


@dataclass(frozen=True)
class Table:
    """A table of text cells under a header."""

    title: str
    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]

    def to_text(self) -> str:
        """Return the table as text, with aligned columns under the title; long headings take several lines."""
        columns = range(len(self.header))
        widths = [
            max(
                [
                    *map(_count_columns, self.header[k].split()),
                    *(_count_columns(row[k]) for row in self.rows),
                ],
                default=0,
            )
            for k in columns
        ]
        wrapped = [textwrap.wrap(self.header[k], max(widths[k], 1)) for k in columns]
        heading = [tuple(column) for column in zip_longest(*wrapped, fillvalue="")]

        def align(cells: tuple[str, ...]) -> str:
            """Return cells as a line with columns of equal width."""
            padded = (
                cell + " " * (width - _count_columns(cell))
                for cell, width in zip(cells, widths, strict=True)
            )
            return "  ".join(padded).rstrip()

        rule = "  ".join("-" * width for width in widths)
        body = [*map(align, heading), rule, *map(align, self.rows)]
        return "\n".join([self.title, "", *body]) + "\n"

    def to_csv(self) -> str:
        """Return the table as comma-separated values with a header line."""
        buffer = io.StringIO()
        writer = csv.writer(buffer, lineterminator="\n")
        writer.writerow(self.header)
        writer.writerows(self.rows)
        return buffer.getvalue()


def _count_columns(text: str) -> int:
    """Return the number of columns that a text takes on a terminal; combining accents take none."""
    return sum(1 for character in text if not unicodedata.combining(character))
