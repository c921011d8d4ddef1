"""A module for JAX, and a self-test for it."""

from paramreduce_cli.export.array_modules import ArrayLibrary, write_module
from paramreduce_cli.export.exported_model import ExportedModel
from paramreduce_cli.export.expressions import FUNCTIONS

_JAX = ArrayLibrary(
    prefix="jnp",
    calls={name: f"jnp.{name}" for name in FUNCTIONS},
    opening="jax_opening.py",
    closures="jax_closures.py",
    notes=(
        "Functions are compiled by jax.jit at the first call for arrays of a shape, and differentiable by states and",
        "parameters. Arrays may have leading axes for many states; the last axis, or the last two of a matrix, are",
        "those of one state. The results have the precision of the states, which is single unless jax_enable_x64 is set.",
    ),
    test_imports=(
        "import jax",
        "",
        'jax.config.update("jax_enable_x64", True)',
        "import jax.numpy as jnp",
        "import numpy as np",
    ),
    test_array="jnp.array",
    decorator="@jax.jit",
    conversion="phi.astype(q.dtype)",
)


def jax(model: ExportedModel) -> dict[str, bytes]:
    """Write a module for JAX; its functions take one state or arrays of states, and have derivatives."""
    return write_module(model, _JAX)
