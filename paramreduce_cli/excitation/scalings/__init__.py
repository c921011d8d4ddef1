"""In which scaling of the observation matrix a criterion is measured.

A scaling takes the rows-weighted W of the base columns to the matrix that is measured, and
hands back how a derivative with respect to that matrix is pulled back to W. It is given the
exponent of the smooth maxima that stand for true ones while optimising, infinite for those.
"""

from collections.abc import Callable

from paramreduce_cli.records import FloatArray
from paramreduce_cli.registry import Registry

Pullback = Callable[[FloatArray], FloatArray]
Scaling = Callable[[FloatArray, FloatArray, float], tuple[FloatArray, Pullback]]
"""(W, beta, norm) -> (scaled W, pullback); W is (n_rows, r), beta (r, n - r)."""

scalings = Registry("scaling", __name__)
