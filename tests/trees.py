"""Trees of all kinds."""

import numpy as np
from conftest import mechanism_of
from scipy.spatial.transform import Rotation

AXES = [(1, 0, 0), (0, 1, 0), (0, 0, 1), (0, 0, -1), (1, 2, -1)]


def random_tree(seed, n_joints=6):
    """Branches, slides, axes that are parallel, opposite, at right angles or askew."""
    rng = np.random.default_rng(seed)
    rows = []
    for k in range(n_joints):
        parent = None if k == 0 else str(rng.integers(max(0, k - 2), k))
        rotation = Rotation.identity()
        if rng.random() < 0.3:
            rotation = Rotation.random(random_state=rng)
        elif rng.random() < 0.5:
            rotation = Rotation.from_euler("x", rng.integers(4) * 90, degrees=True)
        if rng.random() < 0.1:
            tilt = 10.0 ** rng.uniform(-9, -3)
            rotation = Rotation.from_euler("xy", [tilt, -tilt])
        shift = rng.normal(size=3) * (rng.random(3) < 0.6)
        kind = "revolute" if rng.random() < 0.7 else "prismatic"
        axis = [float(x) for x in AXES[rng.integers(len(AXES))]]
        massless = bool(rng.random() < 0.15)
        rows.append(
            {"name": str(k), "parent": parent or "base", "joint": kind, "axes": [axis],
             "at": [{"xyz": shift.tolist()}, *turns(rotation)], "coordinates": [f"q{k}"],
             "massless": massless}
        )  # fmt: skip
    return mechanism_of({"tree": {"bodies": rows}}, rng.normal(size=3) * 5, f"tree_{seed}")


def turns(rotation):
    """A rotation as steps about z, y and x, one after the other."""
    angles = rotation.as_euler("ZYX")
    return [{f"r{axis}": float(a)} for axis, a in zip("zyx", angles, strict=True)]
