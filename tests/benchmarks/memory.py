"""Peak memory of sample and reduce as the rows of W grow from 1e4 to 2e6.

W grows from 5 MB to 960 MB.
"""

import subprocess
import sys
import tempfile

from tests.conftest import CONFIGS, ROOT

COEFFICIENTS = f"trajectories.file={ROOT / 'results' / 'reference' / 'puma560.json'}"
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
        config = str(CONFIGS / "puma560.yaml")
        common = [config, "--results", folder, "--quiet", "--set", COEFFICIENTS]
        for stage in ("build-model", "optimize-trajectories"):
            peak(stage, *common)
        for total in (10_000, 2_000_000):
            grown = [*common, "--set", f"sampling.points={total // (10 * 6)}"]
            for stage in ("sample", "reduce"):
                peaks[stage, total] = peak(stage, *grown)
    for stage in ("sample", "reduce"):
        least, most = peaks[stage, 10_000], peaks[stage, 2_000_000]
        yield f"{stage}, peak memory: 2e6 rows / 1e4 rows ({least:.0f} MiB)", most / least, 1.1
