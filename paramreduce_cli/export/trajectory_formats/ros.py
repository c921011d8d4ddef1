"""A ROS JointTrajectory message as YAML."""

from paramreduce_cli.motion.timed_motion import TimedMotion


def ros(motion: TimedMotion) -> dict[str, str]:
    """trajectory_msgs/JointTrajectory, as `ros2 topic pub` and controllers' tools take it."""
    lines = ["joint_names:", *(f"- {_quoted(name)}" for name in motion.names), "points:"]
    for k, time in enumerate(motion.time.tolist()):
        nanoseconds = round(1e9 * time)
        second, rest = divmod(nanoseconds, 10**9)
        lines += [
            f"- positions: {_listed(motion.z[k])}",
            f"  velocities: {_listed(motion.dz[k])}",
            f"  accelerations: {_listed(motion.ddz[k])}",
            f"  time_from_start: {{sec: {second}, nanosec: {rest}}}",
        ]
    return {"joint_trajectory.yaml": "\n".join(lines) + "\n"}


def _listed(values: object) -> str:
    return "[" + ", ".join(f"{value:.9f}" for value in values) + "]"  # type: ignore[attr-defined]


def _quoted(name: str) -> str:
    return '"' + name.replace("\\", "\\\\").replace('"', '\\"') + '"'
