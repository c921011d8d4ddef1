"""Recorded motion before and after it was made ready."""

from matplotlib.figure import Figure

from paramreduce_cli.report.data import ReportData
from paramreduce_cli.report.recorded import signals_figure
from paramreduce_cli.report.sections import PageSection, placed


@placed(PageSection.LOG, 2)
def log_motion(data: ReportData) -> Figure | None:
    """Positions, speeds and accelerations of the longest motion as recorded (grey) and as they are used; what is held out on blue, what only serves filters on grey; ticks above where outliers were replaced."""
    if data.log is None:
        return None
    shown = data.log.shown
    columns = (
        ("z  (rad, m)", shown.raw_z, shown.z, 0),
        ("ż  (rad/s, m/s)", shown.raw_dz, shown.dz, None),
        ("z̈  (rad/s², m/s²)", None, shown.ddz, None),
    )
    return signals_figure(data, shown, columns)
