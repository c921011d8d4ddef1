"""What the selected models of many runs cost, how wrong they are, and how well their trajectories excite."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator, PercentFormatter

from paramreduce_cli.report.curves import COLOURS, MARKERS
from paramreduce_cli.report.spread import group_runs
from paramreduce_cli.report.style import make_two_plots, place_legend_beside

Record = Mapping[str, Any]


def draw_runs(records: Sequence[Record]) -> Figure:
    """Return torque error on the validation set against operations, and condition numbers, with a mark for every run."""
    drawn, errors, kappas = make_two_plots(shared=False)
    for k, (label, own) in enumerate(group_runs(records).items()):
        look = {
            "color": COLOURS[k % len(COLOURS)], "marker": MARKERS[k % len(MARKERS)],
            "linestyle": "none", "markersize": 5, "alpha": 0.75,
        }  # fmt: skip
        cost, error, kappa = (
            np.array([one[key] for one in own], dtype=float)  # NaN where it is not known
            for key in ("operations_inverse", "torque_error_validation", "kappa_best")
        )
        errors.plot(cost, error, label=label, **look)
        kappas.semilogy(np.full(kappa.shape, k), kappa, label=label, **look)
    errors.set(xlabel="operations of d", ylabel=r"$\varepsilon_\tau$, validation", ylim=(0, None))
    errors.xaxis.set_major_locator(MaxNLocator(integer=True))
    errors.yaxis.set_major_formatter(PercentFormatter(1))
    kappas.yaxis.set_major_formatter("{x:g}")
    kappas.yaxis.set_minor_formatter("{x:g}")
    kappas.set(ylabel=r"$\kappa$, best trajectory", xticks=[])
    place_legend_beside(kappas)
    return drawn
