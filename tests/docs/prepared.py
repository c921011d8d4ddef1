"""What the reader of a page has before anything on it is typed; and settings that make runs short."""

import gzip
import shutil
import subprocess
from pathlib import Path

import h5py
import numpy as np
import yaml

ROOT = Path(__file__).resolve().parents[2]
_LOGS = ROOT / "configs" / "logs"
_SHORT = {
    "trajectories": {
        "count": 3,
        "validation_count": 1,
        "test_count": 2,
        "starts": 1,
        "polished": 1,
    },
    "reduction": {
        "heuristics": ["forward-selection", "swap", "best-subset"],
        "stop": {"parameters": 20},
        "best_subset": {"time_limit": 3},
    },
    "validation": {"stability": False, "accept": {}},
    "terms": {"functions": ["inverse"], "rounds": 0},
    "report": {"formats": ["svg"]},
}


def _example(here, environment, *names):
    for name in names:
        words = ["paramreduce", "init", "--example", name]
        subprocess.run(words, cwd=here, env=environment, check=True, stdout=subprocess.DEVNULL)


def _arm(here, name):
    """A robot's file, and a recording of it."""
    text = (_LOGS / "ur10.urdf").read_text()
    (here / f"{name}.urdf").write_text(text.replace('"ur10"', f'"{name}"'))
    (here / "recording.csv").write_bytes(gzip.decompress((_LOGS / "ur10.csv.gz").read_bytes()))


def _matrix(here):
    """An observation matrix with torques of both sets."""
    rng = np.random.default_rng(0)
    arrays = {}
    for name in ("estimation", "validation"):
        W = rng.normal(size=(600, 20)) * 10.0 ** -np.arange(0, 5, 0.25)
        arrays |= {f"{name}/W": W, f"{name}/tau": (W @ np.ones(20)).reshape(300, 2)}
    with h5py.File(here / "my_W.h5", "w") as file:
        for name, array in arrays.items():
            file[name] = array


def paper(here, environment):
    """Both systems of the paper with results, a URDF, a recording, and an observation matrix."""
    _example(here, environment, "puma560", "hexaglide")
    shorten(here, set())
    for robot in ("puma560", "hexaglide"):
        words = ["paramreduce", "run", f"configs/{robot}.yaml", "--quiet"]
        subprocess.run(words, cwd=here, env=environment, check=True)
    (here / "results" / "reference").mkdir()
    found = here / "results" / "puma560" / "report" / "summary.json"
    shutil.copy(found, here / "results" / "reference" / "puma560.json")
    _arm(here, "my_arm")
    _matrix(here)


def robot(here, environment):
    """A robot's file."""
    _arm(here, "robot")


def recorded(here, environment):
    """A robot's file, a recording, and the config of an arm that comes along."""
    _arm(here, "robot")
    _example(here, environment, "ur10")


def matrix(here, environment):
    """An observation matrix, and what is asked of it."""
    _matrix(here)
    (here / "settings.yaml").write_text("reduction: {heuristics: [forward-selection]}\n")


def config(here, environment):
    """A config."""
    _example(here, environment, "two_link")
    (here / "configs" / "two_link.yaml").rename(here / "my_arm.yaml")


def shorten(here, done):
    """Make configs short that are not yet among those which have been."""
    for path in {*here.glob("*.yaml"), *here.glob("configs/*.yaml")} - done:
        content = yaml.safe_load(path.read_text())
        if "description" in content:
            for section in _SHORT.keys() - ({"terms"} - content.keys()):
                changes = _SHORT[section]
                content[section] = {**(content.get(section) or {}), **changes}
            path.write_text(yaml.safe_dump(content, sort_keys=False))
        done.add(path)
