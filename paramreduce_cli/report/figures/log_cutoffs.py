"""Why the cut-off frequencies of a log are what they are."""

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter

from paramreduce_cli.report.data import ReportData
from paramreduce_cli.report.page_sections import PageSection, placed
from paramreduce_cli.report.style import make_two_plots

_OVER_BEST = 3.0
"""Largest error shown, times the smallest."""


@placed(PageSection.LOG, 5)
def log_cutoffs(data: ReportData) -> Figure | None:
    """Left: error on left-out parts of the training data against the cut-off frequencies, on torques in one band. Right:
    share of the torques' power that the model leaves, by frequency; the band ends where the model leaves most of it.
    """
    search = None if data.log is None else data.log.search
    if search is None:
        return None
    drawn, errors, shares = make_two_plots(shared=False)
    for cutoffs, values, colour, label, chosen in (
        (search.states, search.state_errors, "#0b62c4", "state cut-off", search.state),
        (search.bands, search.torque_errors, "#d9730d", "torque cut-off", search.torque),
    ):
        finite = np.isfinite(cutoffs)
        errors.semilogx(cutoffs[finite], 100 * values[finite], "o-", color=colour, markersize=3, label=label)  # fmt: skip
        for cutoff, value in zip(cutoffs, values, strict=True):
            if cutoff == chosen and np.isfinite(cutoff):
                errors.plot(cutoff, 100 * value, "o", color=colour, markersize=8, fillstyle="none")
    errors.set_title(f"error of torques up to {search.scored:.3g} Hz, %", fontsize="medium")
    shares.semilogx(search.bands, 100 * np.minimum(search.unexplained, 1.2), "o-", color="#57606a", markersize=3)  # fmt: skip
    shares.axvline(search.scored, color="#111", linewidth=0.9, linestyle=":")
    shares.set_ylim(0, 125)
    shares.set_title("unexplained power, %", fontsize="medium")
    best = 100 * float(min(search.state_errors.min(), search.torque_errors.min()))
    errors.set_ylim(0, _OVER_BEST * best)
    for axes in (errors, shares):
        axes.set_xlabel("Hz")
        axes.xaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
        axes.xaxis.set_major_formatter("{x:g}")
        axes.xaxis.set_minor_formatter(NullFormatter())
    errors.legend(fontsize="x-small")
    return drawn
