"""Tables of numbers as CSV."""

import array
import csv
import gzip
import zlib
from pathlib import Path

import numpy as np

from paramreduce_cli.artifacts.atomic import check_is_file
from paramreduce_cli.errors import ArtifactError, DataError
from paramreduce_cli.records import FloatArray


def read_csv(path: Path) -> tuple[list[str], FloatArray]:
    """Headings and numbers of a CSV, also gzipped, (n_rows, n_columns); held as numbers from the start.

    Raises:
        DataError: It is no table of numbers under headings that differ.
        ArtifactError: The file cannot be read.
    """
    numbers = array.array("d")
    check_is_file(path)
    try:
        opener = gzip.open if path.suffix == ".gz" else open
        with opener(path, "rt", encoding="utf-8-sig", newline="") as file:
            rows = csv.reader(file)
            header = [name.strip() for name in next(rows, [])]
            if len(header) == 1 and ";" in header[0]:
                raise DataError(f"{path}, line 1: columns must be separated by commas, not by ;.")
            twice = sorted({name for name in header if header.count(name) > 1})
            if twice:
                raise DataError(f"{path}, line 1: the heading {twice[0]} stands there twice.")
            if not header:
                raise DataError(f"{path}, line 1: the file is empty.")
            for row in rows:
                if row and len(row) != len(header):
                    raise DataError(
                        f"{path}, line {rows.line_num}: {len(row)} values under {len(header)} "
                        "headings."
                    )
                numbers.extend(_number(path, rows.line_num, cell) for cell in row)
    except FileNotFoundError as error:
        raise ArtifactError(f"{path}: there is no such file.") from error
    except (OSError, EOFError, zlib.error, UnicodeDecodeError, csv.Error) as error:
        raise ArtifactError(f"{path}: cannot be read as CSV ({error}).") from error
    return header, np.frombuffer(numbers, dtype=float).reshape(-1, len(header))


def _number(path: Path, line: int, cell: str) -> float:
    try:
        return float(cell)
    except ValueError as error:
        raise DataError(f"{path}, line {line}: {cell!r} is not a number.") from error
