"""A module for PyTorch, and a self-test for it."""

from paramreduce_cli.export.array_modules import ArrayLibrary, write_module
from paramreduce_cli.export.exported_model import ExportedModel
from paramreduce_cli.export.expressions import FUNCTIONS

_TORCH = ArrayLibrary(
    prefix="torch",
    calls={name: f"torch.{name}" for name in FUNCTIONS},
    opening="torch_opening.py",
    closures="torch_closures.py",
    notes=(
        "Functions are differentiable by states and parameters; torch.compile makes them two to five times faster.",
        "Tensors may have leading axes for many states; the last axis, or the last two of a matrix, are those of one",
        "state. The results have the precision and the device of the states.",
    ),
    test_imports=("import numpy as np", "import torch"),
    test_array="torch.DoubleTensor",
    conversion="phi.to(q)",
)


def torch(model: ExportedModel) -> dict[str, bytes]:
    """Write a module for PyTorch; its functions take one state or tensors of states, and have derivatives."""
    return write_module(model, _TORCH)
