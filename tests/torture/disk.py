"""Files that cannot grow any more, as on a full disk: one message, and what was there stays."""

import resource
import subprocess
import sys
from collections import Counter

from tests.torture import CONFIG


def try_full_disks(results, sizes):
    """Make artifacts anew where no file may be larger than a size.

    Args:
        results: Folder of a finished run.
        sizes: Bytes.

    Returns:
        How often each thing happened.
    """
    found = Counter()
    before = contents(results)
    for k, size in enumerate(sizes):
        stage = ("sample", "reduce", "validate", "report")[k % 4]
        command = [sys.executable, "-m", "paramreduce_cli", stage, str(CONFIG)]

        def limit(size=size):
            resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))

        done = subprocess.run(
            [*command, "--results", str(results), "--force", "--quiet"],
            preexec_fn=limit, capture_output=True, text=True, check=False,
        )  # fmt: skip
        said = done.returncode == 2 and done.stderr.count("Error:") == 1
        if done.returncode == 0:
            before = contents(results)
        same = contents(results) == before
        found["made" if done.returncode == 0 else "one message" if said and same else "wrong"] += 1
    return found


def contents(results):
    return {path: path.read_bytes() for path in results.rglob("*.h5")}
