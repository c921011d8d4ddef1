"""Terms left out of arms that nothing was tuned on: what it saves beside leaving out parameters alone.

Each arm goes from its URDF, as `init` makes a config of it, to simplified functions within a torque error
of 1 % on both sets. Beside them stands the leanest model of all heuristics whose torque errors keep
to it on both sets, for [M | delta] with M positive definite on the samples. Run as a module; arguments are
seeds of the trajectories.
"""

import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

import paramreduce_cli as pr
from paramreduce_cli.config.schema import SelectedSection
from paramreduce_cli.judgement.leanest import find_leanest
from tests.benchmarks.robots import ROBOTS

ARMS = ("UR10", "TX40", "Panda")
TORQUE_ERROR = 0.01


def parameters_alone(validation, direct):
    """Operations of the leanest model within the error on both sets, infinite if there is none."""
    wanted = SelectedSection(torque_error=TORQUE_ERROR)
    found = find_leanest("direct" if direct else "inverse", wanted, validation.heuristics, None)
    return np.inf if found is None else found.operations


def told(label, seed, folder):
    """A row of the table."""
    file, options = ROBOTS[label]
    config, results = folder / f"{label}.yaml", folder / f"{label}-{seed}"
    if not config.exists():
        subprocess.run(
            [
                Path(sys.executable).with_name("paramreduce"),
                *("init", file, *options, "--output", config),
            ],
            check=True,
            capture_output=True,
        )
    settings = (
        f"trajectories.seed={seed}",
        f"terms={{torque_error: {TORQUE_ERROR}}}",
        "validation.accept={}",
        "report.formats=[svg]",
    )
    found = pr.run(config, results, settings, jobs=2)
    cells = []
    for name in ("inverse", "direct"):
        alone, term = (
            parameters_alone(found.validation, name == "direct"),
            found.terms.functions.get(name),
        )
        cells.append(
            f"{alone:.0f} → none"
            if term is None
            else f"{alone:.0f} → {term.operations} ({term.operations / alone:.2f})"
        )
    return " | ".join(cells)


def main():
    seeds = [int(argument) for argument in sys.argv[1:]] or [0]
    print("| arm, seed | d: parameters alone → terms too | [M \\| δ] |\n| --- | --- | --- |")
    with tempfile.TemporaryDirectory() as folder:
        for label in ARMS:
            for seed in seeds:
                print(f"| {label}, {seed} | {told(label, seed, Path(folder))} |", flush=True)


if __name__ == "__main__":
    main()
