"""A ROS JointTrajectory message as YAML."""

from paramreduce_cli.motion.timed_motion import TimedMotion


def ros(motion: TimedMotion) -> dict[str, str]:
    """Write trajectory_msgs/JointTrajectory, as `ros2 topic pub` and controllers' tools take it."""
    lines = ["joint_names:", *(f"- {_quote(name)}" for name in motion.names), "points:"]
    for k, time in enumerate(motion.time.tolist()):
        nanoseconds = round(1e9 * time)
        second, rest = divmod(nanoseconds, 10**9)
        lines += [
            f"- positions: {_write_list(motion.z[k])}",
            f"  velocities: {_write_list(motion.dz[k])}",
            f"  accelerations: {_write_list(motion.ddz[k])}",
            f"  time_from_start: {{sec: {second}, nanosec: {rest}}}",
        ]
    return {"joint_trajectory.yaml": "\n".join(lines) + "\n"}


def _write_list(values: object) -> str:
    return "[" + ", ".join(f"{value:.9f}" for value in values) + "]"  # type: ignore[attr-defined]


def _quote(name: str) -> str:
    return '"' + name.replace("\\", "\\\\").replace('"', '\\"') + '"'
