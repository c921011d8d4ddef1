"""What the paper's systems must reach, computed anew from the committed coefficients."""

import json

import numpy as np
import pytest
from conftest import ROOT, config_and_model

from paramreduce_cli.records import Items, Recordings, Run, Trajectories, Trajectory
from paramreduce_cli.stages.reduce import reduce
from paramreduce_cli.stages.sample import sample

FULL = 1e-10
TARGETS = {
    # n of full precision: QR, FS, BE, best; n and torque error of FS and of the best; sizes at which
    # swap misses the best
    "puma560": (36, 34, 34, 34, (18, 0.012933), (18, 0.0090645), 0),
    "hexaglide": (64, 58, 61, 58, (17, 0.0082270), (15, 0.0069353), 5),
}
QUICK = [
    "reduction.heuristics=[qr, forward-selection, backward-elimination, swap, best-subset]",
    "reduction.best_subset={time_limit: 600, node_limit: 40000}",
]


@pytest.mark.parametrize("robot", list(TARGETS))
def test_selection_on_the_committed_trajectories(robot):
    summary = json.loads((ROOT / "results" / "reference" / f"{robot}.json").read_text())
    config, model = config_and_model(robot, *QUICK)

    def series(name):
        empty = ({}, *[np.zeros(0)] * 5, 0, 0, "")
        found = summary["trajectories"][name]
        return tuple(Trajectory(np.array(t["coefficients"]), 0, 0, *empty) for t in found)

    wanted = config.trajectories
    trajectories = Trajectories(
        summary["trajectories"]["period"], wanted.points, "", "", wanted.use_full_range, False, "",
        wanted.build_limits(config.n_dof), (), series("estimation"), series("validation"), (), (),
    )  # fmt: skip
    samples = sample(config.sampling, model, trajectories, Recordings(None, None, None))
    counted = config.validation.operations
    reduction = reduce(config.reduction, counted, model, samples, None, Run(jobs=2), Items())
    found = reduction.heuristics
    *full, greedy, optimal, missed = TARGETS[robot]

    def full_precision(name):
        return int(found[name].n[np.argmax(found[name].torque_error < FULL)])

    def error(name, n):
        return found[name].torque_error[found[name].find_row(n)]

    names = ("qr", "forward-selection", "backward-elimination", "best-subset")
    assert [full_precision(name) for name in names] == full
    assert error("forward-selection", greedy[0]) == pytest.approx(greedy[1], rel=1e-4)
    assert error("best-subset", optimal[0]) == pytest.approx(optimal[1], rel=1e-4)
    proofs = reduction.proofs
    assert set(proofs.status[: optimal[0]]) == {"optimal"}
    worse = [error("swap", n) > error("best-subset", n) * (1 + 1e-6) + 1e-12 for n in proofs.n]
    assert sum(worse) <= missed
