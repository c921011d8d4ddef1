"""Parameters written back into the MJCF file of a robot; everything else in the file stays."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from paramreduce_cli.errors import ConfigError
from paramreduce_cli.importing.imported_robot import Inertial
from paramreduce_cli.importing.inertia_checks import is_physical
from paramreduce_cli.importing.mjcf_files import compile_mjcf
from paramreduce_cli.importing.simplification import SimplifiedRobot
from paramreduce_cli.records import FloatArray

_DRIVE = {
    "armature": "inertia",
    "frictionloss": "coulomb",
    "damping": "viscous",
    "stiffness": "stiffness",
}
"""Attributes of joints and the keys of drives in configs."""


def write_mjcf(
    path: Path,
    robot: SimplifiedRobot,
    inertials: Mapping[str, Inertial | None],
    drives: Mapping[str, Mapping[str, float]],
) -> bytes:
    """Return an MJCF file with other parameters; everything else stays.

    Bodies that are fixed to another body keep their inertia, which is subtracted from the inertia of that body.

    Args:
        path: File, which was read before.
        robot: Robot that was made of the file.
        inertials: Inertias of the bodies by name, in their frames; None for none.
        drives: Values by the keys of a drive in a config, by body.

    Raises:
        ConfigError: A body or joint has no name in the file or is in an included one, or inertias
            are made from geoms whatever is written.
    """
    import mujoco
    from lxml import etree

    reader = compile_mjcf(path)
    parser = etree.XMLParser(resolve_entities=False, no_network=True)
    root = etree.fromstring(path.read_bytes(), parser)
    radian = any(c.get("angle") == "radian" for c in root.findall("compiler"))
    if any(c.get("inertiafromgeom") == "true" for c in root.findall("compiler")):
        raise ConfigError(f"{path}: makes inertias from geoms alone; take inertiafromgeom out.")

    def find_element(tag: str, name: str) -> Any:
        """Return the only element of a tag and a name in the world's bodies; raise ConfigError otherwise."""
        found = [
            e for part in root.findall("worldbody") for e in part.iter(tag) if e.get("name") == name
        ]
        if len(found) != 1:
            raise ConfigError(
                f"{path}: the {tag} {name} cannot be written, as it has no name of its own in this file "
                "or is in an included one."
            )
        return found[0]

    for body in robot.bodies:
        if body.link is not None and not body.massless:
            own = reader.separate_inertia(body, robot, inertials[body.name])
            if own.mass <= 0 or not is_physical(own.tensor):
                raise ConfigError(
                    f"{path}: MuJoCo takes physical bodies alone, and without the links that move with "
                    f"it {body.link} would have {own.mass:.3g} kg, or an inertia that no body has."
                )
            _write_inertia(mujoco, find_element("body", body.link), own)
        if body.limits is not None:
            drive = drives.get(body.name, {})
            joint = find_element("joint", body.limits.name)
            for name, key in _DRIVE.items():
                joint.set(name, repr(drive.get(key, 0.0)))
            if "stiffness" in drive:
                slack = drive["rest"] + reader.get_reference(body.limits.name)
                turns = body.joint == "revolute" and not radian
                joint.set("springref", repr(float(np.degrees(slack) if turns else slack)))
    return bytes(etree.tostring(root.getroottree(), encoding="UTF-8")) + b"\n"


def _write_inertia(mujoco: Any, body: Any, inertial: Inertial) -> None:
    """Replace the ``inertial`` element of a body's XML element by one with principal moments and axes."""
    sizes, axes = np.linalg.eigh(inertial.tensor)
    if np.linalg.det(axes) < 0:
        axes[:, 0] = -axes[:, 0]
    quaternion = np.zeros(4)
    mujoco.mju_mat2Quat(quaternion, axes.ravel())
    old = body.find("inertial")
    if old is not None:
        body.remove(old)
    values = {"pos": inertial.com, "quat": quaternion, "diaginertia": sizes}
    new = body.makeelement(
        "inertial", {key: _format_numbers(value) for key, value in values.items()}
    )
    new.set("mass", repr(float(inertial.mass)))
    new.tail = body.text
    body.insert(0, new)


def _format_numbers(values: FloatArray) -> str:
    return " ".join(repr(float(value)) for value in values)
