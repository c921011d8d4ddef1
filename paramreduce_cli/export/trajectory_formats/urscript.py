"""URScript for arms of Universal Robots."""

from paramreduce_cli.errors import ConfigError
from paramreduce_cli.motion.timed_motion import TimedMotion

_JOINTS = 6


def urscript(motion: TimedMotion) -> dict[str, str]:
    """Write a program: movej to the start, then servoj at the rate of the motion.

    Raises:
        ConfigError: The arm has not six joints.
    """
    if len(motion.names) != _JOINTS:
        raise ConfigError(
            f"--format urscript is for arms of {_JOINTS} joints, this robot has {len(motion.names)}."
        )
    step = 1 / motion.rate
    lines = ["def exciting_trajectory():", f"  movej({_write_list(motion.z[0])}, a=0.5, v=0.5)"]
    lines += [
        f"  servoj({_write_list(z)}, t={step:.6f}, lookahead_time=0.05, gain=500)"
        for z in motion.z[1:]
    ]
    lines += ["  stopj(2.0)", "end", "exciting_trajectory()"]
    return {"trajectory.script": "\n".join(lines) + "\n"}


def _write_list(values: object) -> str:
    return "[" + ", ".join(f"{value:.7f}" for value in values) + "]"  # type: ignore[attr-defined]
