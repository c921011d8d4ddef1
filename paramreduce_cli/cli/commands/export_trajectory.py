"""The command that writes an exciting trajectory for a controller."""

from collections.abc import Callable
from pathlib import Path

import click
import numpy as np

from paramreduce_cli.artifacts.report_files import save_files
from paramreduce_cli.artifacts.store import Store
from paramreduce_cli.cli.example_command import ExampleCommand
from paramreduce_cli.cli.exporting import load_current
from paramreduce_cli.cli.options import CONFIG, RESULTS, SET
from paramreduce_cli.cli.terminal import LOG, say
from paramreduce_cli.config import load_config
from paramreduce_cli.errors import ConfigError, DataError
from paramreduce_cli.export.trajectory_formats import trajectory_formats
from paramreduce_cli.fields.section import expand_per_joint
from paramreduce_cli.motion.approach import PathPlanner
from paramreduce_cli.motion.timed_motion import TimedMotion, sample_motion
from paramreduce_cli.records import SETS, Model, Trajectories, Trajectory

_RUN = ("ros", "urscript")
"""Formats that a controller runs as they are."""


@click.command(
    "export-trajectory",
    cls=ExampleCommand,
    example="export-trajectory {config} --format urscript --rate 500",
    config="configs/ur10.yaml",
)
@CONFIG
@RESULTS
@SET
@click.option(
    "--format", "kind", type=click.Choice(sorted(trajectory_formats)), default="csv", show_default=True,
    help="ros: a JointTrajectory message as YAML; urscript: for Universal Robots.",
)  # fmt: skip
@click.option(
    "--which", metavar="SET:K",
    help="Number K of the estimation or of the validation set.  [default: the first of the former with a way there and back]",
)  # fmt: skip
@click.option("--rate", type=click.FloatRange(1, 1e5), default=125.0, show_default=True,
              help="Samples per second.")  # fmt: skip
@click.option("--allow-moving-start", "moving", is_flag=True,
              help="Also write code for a controller that begins in motion.")  # fmt: skip
@click.option(
    "-o", "--output", type=click.Path(path_type=Path, file_okay=False), metavar="DIR",
    help="[default: RESULTS/export/trajectory-FORMAT]",
)  # fmt: skip
@LOG
def export_trajectory(
    config: Path,
    results: Path | None,
    overrides: tuple[str, ...],
    kind: str,
    which: str | None,
    rate: float,
    moving: bool,
    output: Path | None,
) -> None:
    """Write an exciting trajectory in a form that a controller can run.

    With trajectories.start_pose in the config, the motion begins and ends at that pose. The moves to the trajectory and
    back keep half of the limits of speed and acceleration, and the limits of torque and distance.
    """
    loaded = load_config(config, overrides)
    store = Store(results or Path("results") / loaded.robot)
    model, trajectories = (load_current(loaded, store, record) for record in (Model, Trajectories))
    pose = loaded.trajectories.start_pose
    start = None if pose is None else expand_per_joint(pose, loaded.n_dof)
    planner = PathPlanner(model, trajectories)

    def make_motion(which: str) -> TimedMotion:
        """Return a trajectory at the rate of the controller."""
        chosen, title = _find_chosen(trajectories, which), f"{loaded.robot} {which}"
        return sample_motion(
            model.mechanism, trajectories, chosen, rate=rate, title=title, start_pose=start, planner=planner
        )  # fmt: skip

    which, motion = (which, make_motion(which)) if which else _find_first(trajectories, make_motion)
    speed = float(np.abs(motion.dz[0]).max())
    at_rest = trajectories.rest_to_rest or pose is not None
    if not at_rest and kind in _RUN and not moving:
        raise ConfigError(
            f"{which} begins in motion, at up to {speed:.2g} rad/s (m/s), and a controller would jump to that. Set "
            "trajectories.start_pose or trajectories.rest_to_rest in the config; or add --allow-moving-start."
        )
    files = trajectory_formats[kind](motion)
    folder = output or store.folder / "export" / f"trajectory-{kind}"
    save_files(folder, {name: text.encode() for name, text in files.items()})
    rests = "" if at_rest else f", which begins in motion at up to {speed:.2g} rad/s (m/s)"
    say(f"{which}{rests}, {motion.time[-1]:.4g} s: {', '.join(files)} in {folder}")


def _find_first(
    trajectories: Trajectories, timed: Callable[[str], TimedMotion]
) -> tuple[str, TimedMotion]:
    """Return the first trajectory of the estimation set with a move to its start and back.

    Raises:
        DataError: No trajectory allows a move to its start and back; the message says why the first does not.
    """
    refused: list[DataError] = []
    for k in range(1, len(trajectories.estimation) + 1):
        try:
            return f"estimation:{k}", timed(f"estimation:{k}")
        except DataError as error:
            refused.append(error)
    raise refused[0]


def _find_chosen(trajectories: Trajectories, which: str) -> Trajectory:
    """Return the trajectory that SET:NUMBER names.

    Raises:
        ConfigError: There is no such trajectory; the message lists the existing ones.
    """
    name, _, number = which.partition(":")
    sets = {name: getattr(trajectories, name) for name in SETS}
    found = sets.get(name, ())
    if not number.isdecimal() or not 1 <= int(number) <= len(found):
        there = [f"{key}:1...{len(own)}" for key, own in sets.items() if own]
        raise ConfigError(
            f"--which {which}: there is {', '.join(there)}.", rejected=which, choices=there
        )
    return found[int(number) - 1]
