"""Plain JSON."""

from json import dumps

from paramreduce_cli.motion.timed_motion import TimedMotion


def json(motion: TimedMotion) -> dict[str, str]:
    """Write one object: names of the joints, rate, times, positions, velocities and accelerations by sample."""
    data = {
        "title": motion.title,
        "joints": list(motion.names),
        "rate": motion.rate,
        "lead": motion.lead,
        "period": motion.period,
        "time": motion.time.round(9).tolist(),
        "positions": motion.z.round(9).tolist(),
        "velocities": motion.dz.round(9).tolist(),
        "accelerations": motion.ddz.round(9).tolist(),
    }
    return {"trajectory.json": dumps(data) + "\n"}
