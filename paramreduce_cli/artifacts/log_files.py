"""Log files of users: tables of text, arrays and ROS bags, all read as columns by name."""

from collections.abc import Callable, Sequence
from pathlib import Path

from paramreduce_cli.artifacts.array_files import load_hdf5, load_matlab, load_npy, load_npz
from paramreduce_cli.artifacts.bag_files import load_bag
from paramreduce_cli.artifacts.csv_files import read_csv
from paramreduce_cli.errors import ArtifactError
from paramreduce_cli.identification.log_joining import join_logs
from paramreduce_cli.records import RawLog

_LOADERS: dict[str, Callable[[Path], RawLog]] = {
    ".bag": load_bag,
    ".db3": load_bag,
    ".mcap": load_bag,
    ".h5": load_hdf5,
    ".hdf5": load_hdf5,
    ".mat": load_matlab,
    ".npy": load_npy,
    ".npz": load_npz,
}
_CONVERTED = {
    **dict.fromkeys((".xlsx", ".xls", ".xlsm", ".ods"), "Save the sheet with the numbers as CSV"),
    **dict.fromkeys(
        (".parquet", ".feather", ".pkl", ".pickle"),
        "Save the table as CSV, such as by `pandas.read_parquet(FILE).to_csv('log.csv', index=False)`",
    ),
    ".tdms": "Save the channels as CSV",
    ".ulg": "Convert the log by `ulog2csv`",
}
"""What to do with files that are not read, by their endings."""


def load_recorded(paths: Sequence[Path], time: str) -> RawLog:
    """Read the files of one recording, and join them by their times.

    Args:
        paths: Files, at least one.
        time: Name of the column of times.
    """
    return join_logs([load_log(path) for path in paths], time)


def load_log(path: Path) -> RawLog:
    """Read a log.

    Args:
        path: Text table (also .gz), whose columns have the numbers from 1 as names if it has no headings; HDF5, NPZ or
            MATLAB file with a dataset for each column, or matrices, whose columns are numbered from 1; NPY file with one
            matrix; ROS bag, as a folder or a file.

    Raises:
        ArtifactError: The file cannot be read.
        DataError: The log holds no columns of numbers.
    """
    if path.is_dir():
        return load_bag(path)
    ending = path.suffix.lower()
    if ending in _CONVERTED and path.exists():
        raise ArtifactError(f"{path}: such files are not read.", remedy=f"{_CONVERTED[ending]}.")
    if ending in _LOADERS:
        return _LOADERS[ending](path)
    table = read_csv(path, leave_out_text=True)
    columns = dict(zip(table.header, table.numbers.T, strict=True))
    others = dict.fromkeys(table.left_out, "text")
    return RawLog(str(path), columns, first_line=table.first_line, others=others)
