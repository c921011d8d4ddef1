"""What recorded signals are made of, by frequency."""

import numpy as np
from matplotlib.figure import Figure

from paramreduce_cli.report.data import ReportData
from paramreduce_cli.report.page_sections import PageSection, placed
from paramreduce_cli.report.style import choose_joint_style, make_two_plots, place_legend_beside


@placed(PageSection.LOG, 4)
def log_spectra(data: ReportData) -> Figure | None:
    """Power spectral densities of speeds and torques as recorded, with the cut-off frequencies of the low-pass filters."""
    if data.log is None:
        return None
    spectra = data.log.spectra
    drawn, *pair = make_two_plots(shared=False)
    for axes, density, cutoff, label in (
        (pair[0], spectra.velocity, data.log.state_cutoff, "speed"),
        (pair[1], spectra.torque, data.log.torque_cutoff, "torque"),
    ):
        for j in range(density.shape[1]):
            colour, line = choose_joint_style(j)
            axes.loglog(
                spectra.frequency, np.maximum(density[:, j], 1e-300), line, color=colour, linewidth=0.9,
                label=data.name_joint(j),
            )  # fmt: skip
        top = float(density.max()) or 1.0
        axes.set_ylim(top * 1e-12, top * 10)
        if np.isfinite(cutoff):
            axes.axvline(cutoff, color="#111", linewidth=0.9, linestyle=":")
            axes.annotate(f" {cutoff:.3g} Hz", (cutoff, 0.97), xycoords=("data", "axes fraction"),
                          va="top", fontsize="small")  # fmt: skip
        axes.set_title(label, fontsize="medium")
        axes.set_xlabel("Hz")
    place_legend_beside(pair[1])
    return drawn
