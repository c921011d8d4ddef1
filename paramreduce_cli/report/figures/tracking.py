"""Control with the exported models."""

import numpy as np
from matplotlib.figure import Figure

from paramreduce_cli.report.data import ReportData
from paramreduce_cli.report.page_sections import PageSection, placed
from paramreduce_cli.report.style import (
    break_lines,
    choose_joint_style,
    make_figure,
    place_legend_beside,
)


@placed(PageSection.TRACKING, 1)
def tracking(data: ReportData) -> Figure | None:
    """Computed-torque control on paths that are in no set: tracking errors of each joint on the first path, with the
    full and with the selected model in the controller; errors over all paths, and the time of one evaluation.
    """
    result, speed = data.tracking, data.speed
    if result is None or speed is None:
        return None
    drawn = make_figure(1.5)
    top, *below = drawn.subplots(
        1 + len(result.errors), 1, sharex=True, height_ratios=[1.2] + [1] * len(result.errors)
    )
    count = int(result.paths.samples[0])
    time = result.paths.time[:count]
    for j in range(result.paths.z.shape[2]):
        colour, style = choose_joint_style(j)
        label = data.name_joint(j)
        top.plot(time, result.paths.z[:count, 0, j], color=colour, linestyle=style, label=label)
        for axes, errors in zip(below, result.errors.values(), strict=True):
            off = 1e3 * errors[:count, 0, j]
            axes.plot(time, off, color=colour, linestyle=style, linewidth=1.0)
    top.set_ylabel("path, rad or m")
    place_legend_beside(top)
    for axes, (name, errors) in zip(below, result.errors.items(), strict=True):
        rms = 1e3 * result.compute_rms(name)
        axes.set_ylabel("off, mrad or mm")
        caption = (
            f"{name}: {np.median(rms):.2g} mrad rms ({rms.min():.2g} to {rms.max():.2g} over {rms.size} "
            f"paths), at most {1e3 * float(np.abs(errors).max()):.2g}; "
            f"{1e9 * speed.seconds[name]:.3g} ns a step in {speed.language}"
        )
        axes.set_title(break_lines(caption), fontsize="small", loc="left")
    below[-1].set_xlabel("time, s")
    return drawn
