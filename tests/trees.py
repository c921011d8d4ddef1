"""Trees of all kinds."""

import numpy as np
from scipy.spatial.transform import Rotation

from paramreduce_cli.robots.closed_loop import TreeBody, mechanism_from_bodies

AXES = [(1, 0, 0), (0, 1, 0), (0, 0, 1), (0, 0, -1), (1, 2, -1)]


def random_tree(seed, n_joints=6):
    """Branches, slides, axes that are parallel, opposite, at right angles or askew."""
    rng = np.random.default_rng(seed)
    rows = []
    for k in range(n_joints):
        parent = None if k == 0 else str(rng.integers(max(0, k - 2), k))
        placement = np.eye(4)
        if rng.random() < 0.3:
            placement[:3, :3] = Rotation.random(random_state=rng).as_matrix()
        elif rng.random() < 0.5:
            placement[:3, :3] = Rotation.from_euler(
                "x", rng.integers(4) * 90, degrees=True
            ).as_matrix()
        if rng.random() < 0.1:
            tilt = 10.0 ** rng.uniform(-9, -3)
            placement[:3, :3] = Rotation.from_euler("xy", [tilt, -tilt]).as_matrix()
        placement[:3, 3] = rng.normal(size=3) * (rng.random(3) < 0.6)
        kind = "revolute" if rng.random() < 0.7 else "prismatic"
        axis = tuple(float(x) for x in AXES[rng.integers(len(AXES))])
        massless = bool(rng.random() < 0.15)
        rows.append(TreeBody(str(k), parent, kind, (axis,), placement, (f"q{k}",), massless))
    return mechanism_from_bodies(f"tree {seed}", rows, rng.normal(size=3) * 5)
