"""Tables of numbers as CSV."""

import csv
import gzip
import zlib
from pathlib import Path

from paramreduce_cli.artifacts.atomic import check_is_file, missing
from paramreduce_cli.errors import ArtifactError, DataError
from paramreduce_cli.records import FloatArray
from paramreduce_cli.scratch import LargeTable


def read_csv(path: Path, *, leave_out_text: bool = False) -> tuple[list[str], FloatArray]:
    """Headings and numbers of a CSV, also gzipped, (n_rows, n_columns); held as numbers from the start.

    Args:
        path: The file.
        leave_out_text: Whether columns that hold text in the first row are left out, and no error.

    Raises:
        DataError: It is no table of numbers under headings that differ.
        ArtifactError: The file cannot be read.
    """
    check_is_file(path)
    try:
        opener = gzip.open if path.suffix == ".gz" else open
        with opener(path, "rt", encoding="utf-8-sig", newline="") as file, LargeTable() as table:
            rows = csv.reader(file)
            header = [name.strip() for name in next(rows, [])]
            if len(header) == 1 and ";" in header[0]:
                raise DataError(f"{path}, line 1: columns must be separated by commas, not by ;.")
            twice = sorted({name for name in header if header.count(name) > 1})
            if twice:
                raise DataError(f"{path}, line 1: the heading {twice[0]} stands there twice.")
            if not header:
                raise DataError(f"{path}, line 1: the file is empty.")
            kept = list(range(len(header)))
            blank = None
            for row in rows:
                if not row:
                    blank = blank or rows.line_num
                    continue
                if (
                    blank is not None
                ):  # at the end they do no harm; inside, lines would be miscounted
                    raise DataError(f"{path}, line {blank}: is empty. Remove it.")
                if leave_out_text and not table:
                    kept = [k for k, cell in enumerate(row) if _is_number(cell)]
                if len(row) != len(header):
                    raise DataError(
                        f"{path}, line {rows.line_num}: {len(row)} values under {len(header)} "
                        "headings."
                    )
                table.extend(_number(path, rows.line_num, header[k], row[k]) for k in kept)
            return [header[k] for k in kept], table.matrix(len(kept))
    except FileNotFoundError as error:
        raise missing(path) from error
    except (OSError, EOFError, zlib.error, UnicodeDecodeError, csv.Error) as error:
        raise ArtifactError(f"{path}: cannot be read as CSV ({error}).") from error


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True


def _number(path: Path, line: int, heading: str, cell: str) -> float:
    try:
        return float(cell)
    except ValueError as error:
        raise DataError(
            f"{path}, line {line}, column {heading}: {cell!r} is not a number."
        ) from error
