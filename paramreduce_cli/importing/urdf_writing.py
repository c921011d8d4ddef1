"""Parameters written back into the URDF file of a robot; everything else in the file stays."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from lxml import etree

from paramreduce_cli.importing.imported_robot import Inertial
from paramreduce_cli.importing.simplification import BASE, SimplifiedRobot

_TENSOR = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")


def write_urdf(
    path: Path,
    robot: SimplifiedRobot,
    inertials: Mapping[str, Inertial | None],
    drives: Mapping[str, Mapping[str, float]],
) -> bytes:
    """Return a URDF file with other parameters.

    The inertia of links that are fixed to another link is moved to that link, as in the config; links fixed to the base
    keep theirs.

    Args:
        path: File, which was read before.
        robot: Robot that was made of the file.
        inertials: Inertias of the bodies by name, in their frames; None for none.
        drives: Values by the keys of a drive in a config, by body.
    """
    parser = etree.XMLParser(resolve_entities=False, no_network=True)
    content = path.read_bytes()
    root = etree.fromstring(content, parser)
    links = {element.get("name"): element for element in root.findall("link")}
    joints = {element.get("name"): element for element in root.findall("joint")}
    for link, carrier in robot.merged.items():
        if carrier != BASE:
            _write_inertia(links[link], None)
    for body in robot.bodies:
        if body.link is not None and not body.massless:
            _write_inertia(links[body.link], inertials[body.name])
        drive = drives.get(body.name, {})
        if body.limits is None:
            continue
        joint = joints[body.limits.name]
        if drive or joint.find("dynamics") is not None:
            dynamics = _find_or_add_child(joint, "dynamics")
            for name, key in (("damping", "viscous"), ("friction", "coulomb")):
                dynamics.set(name, _format_number(drive.get(key, 0.0)))
    tree = root.getroottree()
    encoding = tree.docinfo.encoding or "UTF-8"
    declared = content.lstrip().startswith(b"<?xml")
    return bytes(etree.tostring(tree, encoding=encoding, xml_declaration=declared)) + b"\n"


def _write_inertia(link: Any, inertial: Inertial | None) -> None:
    """Replace or remove the inertia of a link."""
    old = link.find("inertial")
    if inertial is None:
        if old is not None:
            link.remove(old)
        return
    element = _find_or_add_child(link, "inertial")
    origin = _find_or_add_child(element, "origin")
    origin.set("xyz", " ".join(map(_format_number, inertial.com)))
    origin.set("rpy", "0 0 0")
    _find_or_add_child(element, "mass").set("value", _format_number(inertial.mass))
    tensor = _find_or_add_child(element, "inertia")
    for key, value in zip(_TENSOR, inertial.tensor[np.triu_indices(3)], strict=True):
        tensor.set(key, _format_number(value))


def _find_or_add_child(element: Any, tag: str) -> Any:
    """Return the child element of a tag, added if it is missing."""
    found = element.find(tag)
    return etree.SubElement(element, tag) if found is None else found


def _format_number(value: float) -> str:
    return repr(float(value))
