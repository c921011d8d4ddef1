"""Peak memory of sample and reduce as the rows of W grow from 1e4 to 2e6.

W grows from 5 MB to 960 MB.
"""

import subprocess
import sys
import tempfile
from pathlib import Path

CONFIG = Path(__file__).resolve().parents[2] / "configs" / "puma560.yaml"
REFERENCE = Path(__file__).resolve().parents[2] / "results" / "reference" / "puma560.json"
_MEASURE = """
import resource, subprocess, sys
subprocess.run(sys.argv[1:], check=True)
print(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss)
"""


def peak(*arguments):
    """Largest resident memory of one call of the command line, MiB."""
    command = [sys.executable, "-c", _MEASURE, sys.executable, "-m", "paramreduce_cli", *arguments]
    done = subprocess.run(command, check=True, capture_output=True, text=True)
    return int(done.stdout.split()[-1]) / 1024


def rows():
    peaks = {}
    with tempfile.TemporaryDirectory() as folder:
        common = [
            str(CONFIG),
            "--results",
            folder,
            "--quiet",
            "--set",
            f"trajectories.file={REFERENCE}",
        ]
        for stage in ("build-model", "optimize-trajectories"):
            peak(stage, *common)
        for total in (10_000, 2_000_000):
            points = total // (10 * 6)
            grown = [*common, "--set", f"sampling.points={points}"]
            for stage in ("sample", "reduce"):
                peaks[stage, total] = peak(stage, *grown)
    for stage in ("sample", "reduce"):
        ratio = peaks[stage, 2_000_000] / peaks[stage, 10_000]
        yield (
            f"{stage}, peak memory: 2e6 rows / 1e4 rows ({peaks[stage, 10_000]:.0f} MiB)",
            ratio,
            1.1,
        )
