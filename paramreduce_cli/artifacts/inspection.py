"""What is in an artifact and where it came from, as plain data."""

from pathlib import Path

import h5py
import numpy as np

from paramreduce_cli.artifacts.hdf5 import reading


def contents(path: Path) -> tuple[dict[str, str], list[tuple[str, str, str]]]:
    """Attributes of a file, and (name, shape, type or value) of its datasets; all of it is checked.

    Raises:
        ArtifactError: It cannot be read.
    """
    datasets: list[tuple[str, str, str]] = []

    def visit(name: str, item: object) -> None:
        if isinstance(item, h5py.Dataset):
            datasets.append((f"/{name}", _shape(item), _content(item)))

    with reading(path) as reader:
        reader.verify()
        attributes = {key: str(reader.attribute(key)) for key in reader.file.attrs}
        reader.file.visititems(visit)
    return attributes, datasets


def _shape(dataset: h5py.Dataset) -> str:
    return " x ".join(str(length) for length in dataset.shape) or "scalar"


def _content(dataset: h5py.Dataset) -> str:
    if dataset.shape == ():
        value = dataset[()]
        text = value.decode() if isinstance(value, bytes) else str(value)
        return text if len(text) <= 60 else f"{text[:57]}..."
    kind = "text" if h5py.check_string_dtype(dataset.dtype) else str(np.dtype(dataset.dtype))
    return kind
