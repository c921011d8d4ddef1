"""Comma-separated values with a header."""

import io

import numpy as np

from paramreduce_cli.motion.timed_motion import TimedMotion


def csv(motion: TimedMotion) -> dict[str, str]:
    """Write columns t, q1 ... qn, dq1 ..., ddq1 ..., in s, rad (m) and their rates."""
    n = len(motion.names)
    header = ["t", *(f"{key}{j + 1}" for key in ("q", "dq", "ddq") for j in range(n))]
    table = np.column_stack([motion.time, motion.z, motion.dz, motion.ddz])
    text = io.StringIO()
    np.savetxt(text, table, "%.9g", ",", header=",".join(header), comments="")
    return {"trajectory.csv": text.getvalue()}
