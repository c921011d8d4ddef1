"""A log whose observation matrix has 1e7 rows: CPU time of sample over that of the QR alone, and memory.

The arm of puma560_friction.yaml at 1 kHz: 1.7e6 samples of six joints, 84 columns.
"""

import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from paramreduce_cli.config import load_config
from paramreduce_cli.excitation.fourier import evaluate_basis
from paramreduce_cli.multibody.dynamics import Dynamics
from tests.conftest import CONFIGS

ROBOT = CONFIGS / "puma560_friction.yaml"
ROWS, SHORT = 10_000_000, 100_000
LOG = """
sampling:
  log:
    files: [log.npz]
    columns: {time: t, position: "q{}", velocity: "dq{}", acceleration: "ddq{}", torque: "tau{}"}
    state_cutoff: none
    torque_cutoff: none
    standstill: keep
"""
_MEASURE = """
import resource, subprocess, sys, time
process = subprocess.Popen(sys.argv[1:])
peak = 0
while process.poll() is None:
    try:
        lines = open(f"/proc/{process.pid}/status").read().splitlines()
    except OSError:
        continue
    peak = max([peak, *(int(line.split()[1]) for line in lines if line.startswith("RssAnon"))])
    time.sleep(0.02)
used = resource.getrusage(resource.RUSAGE_CHILDREN)
print(process.returncode, peak, used.ru_utime + used.ru_stime)
"""
_QR = """
import sys
import numpy as np
rows, columns = int(sys.argv[1]), int(sys.argv[2])
block = np.random.default_rng(0).normal(size=(900, columns))
factor = np.zeros((0, columns))
for _ in range(rows // len(block)):
    factor = np.linalg.qr(np.vstack([factor, block]), mode="r")
"""


def measured(*command):
    """Largest memory of a process, MiB, without mapped files, and the CPU seconds that it took."""
    command = [sys.executable, "-c", _MEASURE, sys.executable, *command]
    done = subprocess.run(command, check=True, capture_output=True, text=True)
    code, memory, seconds = done.stdout.split()[-3:]
    assert code == "0", done.stderr
    return int(memory) / 1024, float(seconds)


def write_log(folder, n_samples):
    """A config with a log of a smooth motion, torques with noise."""
    config = load_config(ROBOT)
    mechanism, phi = config.build_mechanism(), config.get_values()
    dynamics, rng = Dynamics(mechanism), np.random.default_rng(0)
    time = np.arange(n_samples) / 1000
    series = 0.5 * rng.normal(size=(mechanism.n_dof, 11))
    parts = []
    for start in range(0, n_samples, 10_000):
        states = evaluate_basis(11.3, 5, time[start : start + 10_000]).evaluate(series)
        parts.append((*states, dynamics.compute_regressor(*states) @ phi))
    z, dz, ddz, tau = (np.concatenate(part) for part in zip(*parts, strict=True))
    tau += rng.normal(size=tau.shape)
    np.savez(folder / "log.npz", t=time, q=z, dq=dz, ddq=ddz, tau=tau)
    (folder / "robot.yaml").write_text(ROBOT.read_text() + LOG)
    return mechanism.n_dof, mechanism.n_parameters


def rows():
    peaks, seconds, size = {}, {}, (0, 0)
    for total in (SHORT, ROWS):
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            size = write_log(folder, total // 6)
            for stage in ("build-model", "process-log", "sample"):
                arguments = (stage, str(folder / "robot.yaml"), "--results", name, "--quiet")
                peaks[stage, total], seconds[stage, total] = measured(
                    "-m", "paramreduce_cli", *arguments
                )
    _, alone = measured("-c", _QR, str(ROWS), str(size[1] + 1))
    yield (
        "sample, CPU time at 1e7 rows of a log: all of it / QR alone",
        seconds["sample", ROWS] / alone,
        2,
    )
    for stage in ("process-log", "sample"):
        grown = (peaks[stage, ROWS] - peaks[stage, SHORT]) / (ROWS - SHORT) * size[0] * 2**20
        signals = 8 * (4 * size[0] + 1)
        what = f"{stage}, memory per sample of a log / the log's own {signals} bytes"
        yield what, grown / signals, 0.5


if __name__ == "__main__":
    for what, ratio, limit in rows():
        print(f"{what}: {ratio:.2f} (at most {limit})")
