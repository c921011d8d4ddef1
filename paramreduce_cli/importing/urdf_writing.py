"""Parameters written back into the URDF file that a robot came from; everything else stays."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from lxml import etree

from paramreduce_cli.importing.imported import Inertial
from paramreduce_cli.importing.simplified import BASE, SimplifiedRobot

_TENSOR = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")


def with_parameters(
    path: Path,
    robot: SimplifiedRobot,
    inertials: Mapping[str, Inertial | None],
    drives: Mapping[str, Mapping[str, float]],
) -> bytes:
    """A URDF file with other parameters.

    Links that move with another one lose their inertia to it, as in the config; those that do not
    move keep it.

    Args:
        path: The file, which was read before.
        robot: What was made of it.
        inertials: Of the bodies by name, in their frames; None for none.
        drives: Values by the keys of a drive in a config, by body.
    """
    parser = etree.XMLParser(resolve_entities=False, no_network=True)
    content = path.read_bytes()
    root = etree.fromstring(content, parser)
    links = {element.get("name"): element for element in root.findall("link")}
    joints = {element.get("name"): element for element in root.findall("joint")}
    for link, carrier in robot.merged.items():
        if carrier != BASE:
            _write_inertial(links[link], None)
    for body in robot.bodies:
        if body.link is not None and not body.massless:
            _write_inertial(links[body.link], inertials[body.name])
        drive = drives.get(body.name, {})
        if body.limits is None:
            continue
        joint = joints[body.limits.name]
        if drive or joint.find("dynamics") is not None:
            dynamics = _child(joint, "dynamics")
            for name, key in (("damping", "viscous"), ("friction", "coulomb")):
                dynamics.set(name, _text(drive.get(key, 0.0)))
    tree = root.getroottree()
    encoding = tree.docinfo.encoding or "UTF-8"
    declared = content.lstrip().startswith(b"<?xml")
    return bytes(etree.tostring(tree, encoding=encoding, xml_declaration=declared)) + b"\n"


def _write_inertial(link: Any, inertial: Inertial | None) -> None:
    old = link.find("inertial")
    if inertial is None:
        if old is not None:
            link.remove(old)
        return
    element = _child(link, "inertial")
    origin = _child(element, "origin")
    origin.set("xyz", " ".join(map(_text, inertial.com)))
    origin.set("rpy", "0 0 0")
    _child(element, "mass").set("value", _text(inertial.mass))
    tensor = _child(element, "inertia")
    for key, value in zip(_TENSOR, inertial.tensor[np.triu_indices(3)], strict=True):
        tensor.set(key, _text(value))


def _child(element: Any, tag: str) -> Any:
    found = element.find(tag)
    return etree.SubElement(element, tag) if found is None else found


def _text(value: float) -> str:
    return repr(float(value))
