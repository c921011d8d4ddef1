"""Contents of an artifact and its provenance, as plain data."""

from pathlib import Path

import h5py
import numpy as np

from paramreduce_cli.artifacts.hdf5 import open_reader


def list_contents(path: Path) -> tuple[dict[str, str], list[tuple[str, str, str]]]:
    """Return the attributes of a file, and name, shape, and type or value of each dataset; all checksums are compared.

    Raises:
        ArtifactError: The file cannot be read.
    """
    datasets: list[tuple[str, str, str]] = []

    def visit(name: str, item: object) -> None:
        if isinstance(item, h5py.Dataset):
            datasets.append((f"/{name}", _format_shape(item), _format_content(item)))

    with open_reader(path) as reader:
        reader.verify()
        attributes = {key: str(reader.read_attribute(key)) for key in reader.file.attrs}
        reader.file.visititems(visit)
    return attributes, datasets


def _format_shape(dataset: h5py.Dataset) -> str:
    return " x ".join(str(length) for length in dataset.shape) or "scalar"


def _format_content(dataset: h5py.Dataset) -> str:
    """Return the value of a scalar dataset, or the type of an array."""
    if dataset.shape == ():
        value = dataset[()]
        text = value.decode() if isinstance(value, bytes) else str(value)
        return text if len(text) <= 60 else f"{text[:57]}..."
    kind = "text" if h5py.check_string_dtype(dataset.dtype) else str(np.dtype(dataset.dtype))
    return kind
