"""Types of arrays.

Written out: ``numpy.typing.NDArray`` became an opaque alias in NumPy 2.5, and artifacts are laid out by
what these types are made of.
"""

from typing import Any

import numpy as np

FloatArray = np.ndarray[tuple[Any, ...], np.dtype[np.float64]]
IntArray = np.ndarray[tuple[Any, ...], np.dtype[np.int64]]
BoolArray = np.ndarray[tuple[Any, ...], np.dtype[np.bool_]]
