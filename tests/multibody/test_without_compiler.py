"""Loops in CasADi's virtual machine: the same results, and singular systems are no crash."""

import json
import os
import subprocess
import sys

import numpy as np
import pytest
from conftest import CONFIGS, ROOT

SCRIPT = """
import sys, warnings
import numpy as np
from pathlib import Path
from paramreduce_cli.config import load_config
from paramreduce_cli.errors import DataError, ParamreduceWarning
from paramreduce_cli.multibody.loops.assembly import assemble
from paramreduce_cli.multibody.loops.coordinates import Coordinates
from paramreduce_cli.multibody.dynamics import Dynamics
from paramreduce_cli.multibody.random_states import draw_states
warnings.simplefilter("ignore", ParamreduceWarning)
mechanism = assemble(load_config(Path(sys.argv[1])).build_mechanism())
q, dq, ddq = draw_states(mechanism, 5, np.random.default_rng(0))
print(repr(Dynamics(mechanism).compute_regressor(q, dq, ddq).ravel().tolist()))
lined_up = np.zeros((3, mechanism.n_q))  # both far links along one line
half = np.arccos((0.45 - 0.15) / 0.35)
lined_up[1] = np.pi - half, half - np.pi, half, -half
lined_up[[0, 2]] = mechanism.loops.assembly
print(repr(Coordinates(mechanism).compute_distance(lined_up).tolist()))
"""


def values(compiler, cache):
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT, str(CONFIGS / "five_bar.yaml")],
        env={"CC": compiler, "PARAMREDUCE_CACHE": str(cache), "PATH": os.environ["PATH"]},
        cwd=ROOT, capture_output=True, text=True, check=True,
    )  # fmt: skip
    return [np.array(json.loads(line)) for line in done.stdout.splitlines()]


def test_singular_configurations_are_told_apart_with_and_without(tmp_path):
    compiled, interpreted = values("gcc", tmp_path), values("/nonexistent/cc", tmp_path)
    assert interpreted[0] == pytest.approx(compiled[0], rel=1e-9, abs=1e-9)
    for _, distance in (compiled, interpreted):
        assert distance[1] < 1e-8
        assert (distance[[0, 2]] > 0.2).all()
