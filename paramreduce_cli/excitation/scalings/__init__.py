"""In which scaling of the observation matrix a criterion is measured.

A scaling takes the rows-weighted W of the base columns to the matrix S that is measured, and
hands back how a derivative is pulled back to W. What is measured are the eigenvalues of S'S, so
that a derivative by S is S C with a small matrix C, and most scalings can be pulled back through C
before that long product. It is given the exponent of the smooth maxima that stand for true ones
while optimising, infinite for those.
"""

from collections.abc import Callable

from paramreduce_cli.records import FloatArray
from paramreduce_cli.registry import Registry

Pullback = Callable[[FloatArray, FloatArray], FloatArray]
"""(S'S, C) -> derivative by W, (n_rows, r), where that by S is S C."""
Scaling = Callable[[FloatArray, FloatArray, float], tuple[FloatArray, Pullback]]
"""(W, beta, norm) -> (S, pullback); W is (n_rows, r), beta (r, n - r)."""

scalings = Registry("scaling", __name__)
