"""Recorded motion before and after it was made ready."""

from matplotlib.figure import Figure

from paramreduce_cli.report.data import ReportData
from paramreduce_cli.report.page_sections import PageSection, placed
from paramreduce_cli.report.signal_figures import draw_signals


@placed(PageSection.LOG, 2)
def log_motion(data: ReportData) -> Figure | None:
    """Positions, speeds and accelerations of the longest motion: as recorded (grey) and after processing.

    Blue background: held out; grey background: used by filters only; ticks: replaced outliers.
    """
    if data.log is None:
        return None
    shown = data.log.shown
    columns = (
        ("z  (rad, m)", shown.raw_z, shown.z, 0),
        ("ż  (rad/s, m/s)", shown.raw_dz, shown.dz, None),
        ("z̈  (rad/s², m/s²)", None, shown.ddz, None),
    )
    return draw_signals(data, shown, columns)
