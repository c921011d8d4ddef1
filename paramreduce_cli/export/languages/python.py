"""A NumPy module, and a self-test for it."""

from paramreduce_cli.export.array_modules import ArrayLibrary, write_module
from paramreduce_cli.export.exported_model import ExportedModel
from paramreduce_cli.export.expressions import FUNCTIONS

_NUMPY = ArrayLibrary(
    prefix="np",
    calls={
        name: f"np.{name.replace('a', 'arc', 1) if name[0] == 'a' else name}" for name in FUNCTIONS
    },
    opening="numpy_opening.py",
    closures="closures.py",
    notes=(
        "Arrays may have leading axes for many states; the last axis, or the last two of a matrix,",
        "are those of one state.",
    ),
    test_imports=("import numpy as np",),
    test_array="np.array",
)


def python(model: ExportedModel) -> dict[str, bytes]:
    """Write a module that needs NumPy alone; its functions take one state or arrays of states."""
    return write_module(model, _NUMPY)
