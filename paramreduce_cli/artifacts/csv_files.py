"""Tables of numbers as text: CSV, and its relatives with tabs, semicolons or blanks."""

import codecs
import csv
import gzip
import itertools
import math
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from paramreduce_cli.artifacts.atomic import check_is_file, make_missing_error
from paramreduce_cli.errors import ArtifactError, DataError
from paramreduce_cli.records import FloatArray
from paramreduce_cli.resources.scratch import LargeTable

_UTF_16 = (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)
"""First bytes of what spreadsheets call Unicode text."""


class NumberTable(NamedTuple):
    """A table of numbers under headings."""

    header: list[str]
    numbers: FloatArray
    """(n_rows, n_columns)"""
    left_out: list[str]
    """Headings of columns that hold text."""
    first_line: int
    """Line of the first row in the file: 1 without headings."""


def read_csv(path: Path, *, leave_out_text: bool = False) -> NumberTable:
    """Read the headings and numbers of a table, also gzipped.

    Columns are separated by commas, tabs, semicolons or blanks, like the headings. Cells are converted to numbers while
    they are read.

    Args:
        path: The file.
        leave_out_text: Whether columns that hold text in the first row are left out; empty cells are not a number
            then, and columns without headings have their numbers from 1 as names. Otherwise all of this is an error.

    Raises:
        DataError: The file is no table of numbers, or two headings are equal.
        ArtifactError: The file cannot be read.
    """
    check_is_file(path)
    try:
        opener = gzip.open if path.suffix == ".gz" else open
        with opener(path, "rb") as file:
            encoding = "utf-16" if file.read(2) in _UTF_16 else "utf-8-sig"
        with opener(path, "rt", encoding=encoding, newline="") as file, LargeTable() as table:
            first = next(file, "")
            delimiter = _find_delimiter(first)
            lines: Iterator[str] = itertools.chain([first.lstrip("# ")], file)
            if delimiter == " ":
                lines = (line.strip() + "\n" for line in lines)
            reader = csv.reader(lines, delimiter=delimiter, skipinitialspace=delimiter == " ")
            rows: Iterator[list[str]] = reader
            header = [name.strip().strip('"').strip() for name in next(rows, [])]
            first_line = 2
            if leave_out_text and len(header) > 1 and all(map(_is_number, header)):
                rows = itertools.chain([header], reader)
                header = [str(k) for k in range(1, len(header) + 1)]
                first_line = 1
            else:
                _check_header(path, header)
            kept = list(range(len(header)))
            begun_empty: set[int] = set()
            blank = None
            for row in rows:
                if not row:
                    blank = blank or reader.line_num
                    continue
                if (
                    blank is not None
                ):  # at the end they do no harm; inside, lines would be miscounted
                    raise DataError(f"{path}, line {blank}: is empty. Remove it.")
                if leave_out_text and not table:
                    begun_empty = {k for k, cell in enumerate(row) if not cell.strip()}
                    kept = [k for k, c in enumerate(row) if k in begun_empty or _is_like_number(c)]
                    kept = [k for k in kept if header[k]]
                if len(row) != len(header):
                    raise DataError(
                        f"{path}, line {reader.line_num}: {len(row)} values under {len(header)} "
                        "headings."
                    )
                table.extend(
                    _number(
                        path, reader.line_num, header[k], row[k],
                        empty=leave_out_text, text=k in begun_empty,
                    )
                    for k in kept
                )  # fmt: skip
            left_out = [name for k, name in enumerate(header) if name and k not in kept]
            numbers = table.to_matrix(len(kept))
            return NumberTable([header[k] for k in kept], numbers, left_out, first_line)
    except FileNotFoundError as error:
        raise make_missing_error(path) from error
    except (OSError, EOFError, zlib.error, UnicodeDecodeError, csv.Error) as error:
        raise ArtifactError(f"{path}: cannot be read as CSV ({error}).") from error


def _find_delimiter(header: str) -> str:
    """Return the character that separates the headings."""
    found = next((mark for mark in ",\t;" if mark in header), None)
    return found or (" " if len(header.split()) > 1 else ",")


def _check_header(path: Path, header: list[str]) -> None:
    """Raise DataError unless a line holds headings that are all different."""
    if not header:
        raise DataError(f"{path}, line 1: the file is empty.")
    if all(map(_is_number, header)):
        raise DataError(
            f"{path}, line 1: holds numbers where headings should be. Write a first line with a name for each of the "
            f"{len(header)} columns, such as t,q1,q2,tau1,tau2."
        )
    twice = sorted({name for name in header if name and header.count(name) > 1})
    if twice:
        raise DataError(f"{path}, line 1: the heading {twice[0]} is listed twice.")


def _is_number(cell: str) -> bool:
    """Return whether a cell is a number."""
    try:
        float(cell)
    except ValueError:
        return False
    return True


def _is_like_number(cell: str) -> bool:
    """Return whether a cell is a number, perhaps with a decimal comma."""
    return _is_number(cell.replace(",", "."))


def _number(path: Path, line: int, heading: str, cell: str, *, empty: bool, text: bool) -> float:
    """Return the number in a cell; an empty cell or text gives NaN where that is allowed, and an error elsewhere."""
    try:
        return float(cell)
    except ValueError as error:
        if text or (empty and not cell.strip()):
            return math.nan
        raise DataError(
            f"{path}, line {line}, column {heading}: {cell!r} is not a number.{_suggest_decimal_points(cell)}"
        ) from error


def _suggest_decimal_points(cell: str) -> str:
    return " Write decimal points." if _is_like_number(cell) else ""
