"""Recorded torques before and after they were made ready."""

from matplotlib.figure import Figure

from paramreduce_cli.report.data import ReportData
from paramreduce_cli.report.page_sections import PageSection, placed
from paramreduce_cli.report.signal_figures import draw_signals


@placed(PageSection.LOG, 3)
def log_torques(data: ReportData) -> Figure | None:
    """Torques of the same motion: as recorded (grey) and after the low-pass filter, which the model passes too.

    Ticks: replaced outliers.
    """
    if data.log is None:
        return None
    shown = data.log.shown
    return draw_signals(data, shown, (("τ  (N m, N)", shown.raw_tau, shown.tau, 1),))
