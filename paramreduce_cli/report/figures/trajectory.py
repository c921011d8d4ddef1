"""The states along the first trajectory of the validation set."""

from matplotlib.figure import Figure

from paramreduce_cli.report.data import ReportData
from paramreduce_cli.report.page_sections import PageSection, placed
from paramreduce_cli.report.style import choose_joint_style, make_figure, place_legend_above


@placed(PageSection.TRAJECTORIES, 1)
def trajectory(data: ReportData) -> Figure:
    """Positions, velocities and accelerations along a trajectory of the validation set."""
    drawn = make_figure(1.5)
    motion = data.motion
    rows = (
        (motion.z, "z  (rad, m)"),
        (motion.dz, "ż  (rad/s, m/s)"),
        (motion.ddz, "z̈  (rad/s², m/s²)"),
    )
    all_axes = drawn.subplots(3, 1, sharex=True)
    for axes, (values, title) in zip(all_axes, rows, strict=True):
        for j in range(values.shape[1]):
            colour, style = choose_joint_style(j)
            label = data.name_joint(j)
            axes.plot(motion.time, values[:, j], color=colour, linestyle=style, label=label)
        axes.set_ylabel(title)
    place_legend_above(all_axes[0], min(values.shape[1], 7))
    all_axes[-1].set_xlabel("t (s)")
    return drawn
