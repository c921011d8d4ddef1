"""MJCF files, read and compiled by MuJoCo itself: defaults, includes and inertias of geoms are its own.

A link's frame is on the anchor of the body's last joint, in the directions of the body. Contacts,
actuators and sensors are no part of the robot's dynamics; what else is left out is told.
"""

from __future__ import annotations

import importlib.util
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from paramreduce_cli.errors import ConfigError
from paramreduce_cli.importing.imported_robot import (
    ImportedClosure,
    ImportedJoint,
    ImportedRobot,
    Inertial,
    JointKind,
    Mimic,
    decompose_transform,
    merge_inertias,
)
from paramreduce_cli.importing.simplification import ImportedBody, SimplifiedRobot
from paramreduce_cli.records import FloatArray

_WORLD = 0
_UNNAMED = "MuJoCo Model"
"""What MuJoCo calls a model that has no name."""
_FLAGS = ("EQUALITY", "PASSIVE", "SPRING", "DAMPER", "FRICTIONLOSS")
"""Parts of the dynamics that a file can switch off."""
_RANK = 1e-8
"""Share of the largest singular value up to which equations follow from others."""


def read_mjcf(path: Path) -> ImportedRobot:
    """Read an MJCF file.

    Raises:
        ConfigError: MuJoCo is not installed, the file cannot be read or compiled, or it holds what
            has no rigid-body meaning.
    """
    if importlib.util.find_spec("mujoco") is None:
        raise ConfigError(
            f"{path}: is an MJCF, which takes MuJoCo to read.",
            remedy="Install it with `pip install 'paramreduce[mjcf]'`.",
        )
    reader = compile_mjcf(path)
    warnings = [*reader.found.warnings, *(f"MuJoCo says: {text}" for text in reader.said)]
    return replace(reader.found, warnings=tuple(warnings))


def compile_mjcf(path: Path) -> MjcfReader:
    """Compile a file with MuJoCo, and return its reader; MuJoCo's warnings go to no log file.

    Raises:
        ConfigError: MuJoCo cannot compile the file, or the file has elements without rigid-body meaning.
    """
    import mujoco

    messages: list[str] = []
    before = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(messages.append)  # which it writes to a file otherwise
    try:
        return MjcfReader(path, mujoco, mujoco.MjModel.from_xml_path(str(path)), messages)
    except (ValueError, mujoco.FatalError) as error:
        text = " ".join(str(error).split()).rstrip(".")
        raise ConfigError(f"{path}: MuJoCo cannot compile it: {text}.") from error
    finally:
        mujoco.set_mju_user_warning(before)


class MjcfReader:
    """A reader of a compiled model.

    Args:
        path: Path of the file, for messages.
        mujoco: MuJoCo's module.
        model: The compiled model.
        said: Warnings of MuJoCo.
    """

    def __init__(self, path: Path, mujoco: Any, model: Any, said: list[str]) -> None:
        self.said = said
        self._path, self._mujoco, self._model = path, mujoco, model
        self._warnings: list[str] = []
        self._massless: set[str] = set()
        self._anchors = np.zeros((model.nbody, 3))
        """Of the last joints, in the bodies' frames."""
        self._bodies = self._list_names("BODY", model.nbody)
        self._links: dict[str, Inertial | None] = {self._bodies[_WORLD]: None}
        self._joints = self._list_names("JOINT", model.njnt)
        self.found = self._read_robot()

    def _get_name(self, kind: str, index: int) -> str | None:
        """Return the name of an object of the file, or None if it has none."""
        number = getattr(self._mujoco.mjtObj, f"mjOBJ_{kind}")
        found = self._mujoco.mj_id2name(self._model, number, index)
        return str(found) if found else None

    def _list_names(self, kind: str, count: int) -> list[str]:
        """Return the names of all objects of a kind, with made-up names for those without."""
        given = [self._get_name(kind, k) for k in range(count)]
        result = []
        for k, name in enumerate(given):
            own = name or f"{kind.lower()}_{k}"
            while name is None and own in given:
                own += "_"
            result.append(own)
        return result

    def _read_robot(self) -> ImportedRobot:
        """Return the robot with its links, joints and closures.

        Raises:
            ConfigError: The file has bodies that bend.
        """
        model = self._model
        if model.nflex:
            raise ConfigError(
                f"{self._path}: has <flex>, bodies that bend: no rigid-body dynamics."
            )
        joints = tuple(joint for body in range(1, model.nbody) for joint in self._read_joints(body))
        mimics, closures = self._read_equalities()
        joints = tuple(_add_mimic(joint, mimics.get(joint.name)) for joint in joints)
        self._warn_of_losses()
        name = bytes(model.names).split(b"\0")[0].decode(errors="replace")
        weightless = model.opt.disableflags & int(self._mujoco.mjtDisableBit.mjDSBL_GRAVITY)
        return ImportedRobot(
            name if name not in ("", _UNNAMED) else self._path.stem,
            str(self._path),
            self._links,
            joints,
            massless=frozenset(self._massless),
            gravity=(0.0, 0.0, 0.0) if weightless else tuple(model.opt.gravity.tolist()),
            closures=closures,
            independent=self._choose_independent() if closures else (),
            warnings=tuple(self._warnings),
        )

    def _read_joints(self, body: int) -> Iterator[ImportedJoint]:
        """Yield the joints of a body, one after the other, with massless links between; a fixed joint if there is none."""
        model = self._model
        start, count = int(model.body_jntadr[body]), int(model.body_jntnum[body])
        parent = int(model.body_parentid[body])
        placed = self._to_transform(model.body_pos[body], model.body_quat[body])
        placed[:3, 3] -= self._anchors[parent]
        before, anchor = self._bodies[parent], np.zeros(3)
        for k in range(start, start + count):
            free = self._read_kind(k) == "floating"
            own_anchor = np.zeros(3) if free else model.jnt_pos[k]
            shift = np.eye(4)
            shift[:3, 3] = own_anchor - anchor
            last = k == start + count - 1
            link = self._bodies[body] if last else self._add_massless_link(body, k)
            yield self._read_joint(k, before, link, placed @ shift)
            before, anchor, placed = link, own_anchor, np.eye(4)
        if count == 0:
            yield ImportedJoint(
                f"{self._bodies[body]}_fixed", "fixed", before, self._bodies[body], decompose_transform(placed),
                (0.0, 0.0, 1.0),
            )  # fmt: skip
        self._anchors[body] = anchor
        self._links[self._bodies[body]] = self._read_inertia(body)

    def _add_massless_link(self, body: int, joint: int) -> str:
        """Add a massless link between two joints of a body, and return its name."""
        name = f"{self._bodies[body]}_{self._joints[joint]}"
        while name in self._bodies:
            name += "_"
        self._links[name] = None
        self._massless.add(name)
        return name

    def _to_transform(self, position: FloatArray, quaternion: FloatArray) -> FloatArray:
        """Return the homogeneous transform, (4, 4), of a position and a quaternion."""
        R = np.zeros(9)
        self._mujoco.mju_quat2Mat(R, quaternion)
        result = np.eye(4)
        result[:3, :3], result[:3, 3] = R.reshape(3, 3), position
        return result

    def _read_inertia(self, body: int) -> Inertial | None:
        """Return the inertia of a body in the frame of its link, or None if it has none."""
        model = self._model
        mass, inertia = float(model.body_mass[body]), model.body_inertia[body]
        if not mass and not inertia.any():
            return None
        about_com = Inertial(mass, np.zeros(3), np.diag(inertia))
        frame = self._to_transform(
            model.body_ipos[body] - self._anchors[body], model.body_iquat[body]
        )
        return about_com.transform(frame)

    def _read_kind(self, joint: int) -> JointKind:
        """Return the kind of a joint."""
        kinds: dict[Any, JointKind] = {
            self._mujoco.mjtJoint.mjJNT_FREE: "floating",
            self._mujoco.mjtJoint.mjJNT_BALL: "ball",
            self._mujoco.mjtJoint.mjJNT_SLIDE: "prismatic",
            self._mujoco.mjtJoint.mjJNT_HINGE: "revolute",
        }
        return kinds[self._mujoco.mjtJoint(int(self._model.jnt_type[joint]))]

    def _read_joint(self, k: int, parent: str, child: str, frame: FloatArray) -> ImportedJoint:
        """Return a joint with its limits and its drive."""
        model, kind, name = self._model, self._read_kind(k), self._joints[k]
        first = int(model.jnt_dofadr[k])
        drive = {
            "inertia": float(model.dof_armature[first]),
            "viscous": float(model.dof_damping[first]),
            "coulomb": float(model.dof_frictionloss[first]),
            "stiffness": float(model.jnt_stiffness[k]),
        }
        single = kind in ("prismatic", "revolute")
        if not single:
            if any(drive.values()):
                self._warnings.append(f"rotor, friction and spring of {name} are left out")
            return ImportedJoint(
                name, kind, parent, child, decompose_transform(frame), (0.0, 0.0, 1.0)
            )
        at = int(model.jnt_qposadr[k])
        reference = float(model.qpos0[at])
        if reference:
            self._warnings.append(
                f"{name} counts from the pose of the file, where MuJoCo has it at {reference:g}"
            )
        if drive["stiffness"]:
            drive["rest"] = float(model.qpos_spring[at]) - reference
        limited = bool(model.jnt_limited[k])
        lower, upper = ((model.jnt_range[k] - reference).tolist()) if limited else (None, None)
        return ImportedJoint(
            name=name,
            kind="continuous" if kind == "revolute" and not limited else kind,
            parent=parent,
            child=child,
            origin=decompose_transform(frame),
            axis=tuple(model.jnt_axis[k].tolist()),
            lower=lower,
            upper=upper,
            effort=self._read_effort(k),
            drive={key: value for key, value in drive.items() if value},
        )

    def _read_effort(self, joint: int) -> float | None:
        """Return the largest force of the joint's actuators, N m or N, or None if it is not limited."""
        model = self._model
        if model.jnt_actfrclimited[joint]:
            return float(np.abs(model.jnt_actfrcrange[joint]).max())
        total = 0.0
        for k in self._find_actuators(joint):
            if not model.actuator_forcelimited[k]:
                return None
            gear = abs(float(model.actuator_gear[k, 0]))
            total += gear * float(np.abs(model.actuator_forcerange[k]).max())
        return total or None

    def _find_actuators(self, joint: int) -> list[int]:
        """Return the indices of the actuators that act on a joint."""
        on_joint = int(self._mujoco.mjtTrn.mjTRN_JOINT)
        model = self._model
        return [
            k
            for k in range(model.nu)
            if model.actuator_trntype[k] == on_joint and model.actuator_trnid[k, 0] == joint
        ]

    def _read_equalities(self) -> tuple[dict[str, Mimic], tuple[ImportedClosure, ...]]:
        """Return the joints that follow others, and the closures.

        Raises:
            ConfigError: An equality has no rigid-body meaning.
        """
        model, kinds = self._model, self._mujoco.mjtEq
        mimics: dict[str, Mimic] = {}
        closures = []
        for k in range(model.neq):
            name, kind = (
                self._get_name("EQUALITY", k) or f"closure_{k}",
                kinds(int(model.eq_type[k])),
            )
            if not model.eq_active0[k]:
                self._warnings.append(f"the equality {name} is not active in the file, so left out")
            elif kind == kinds.mjEQ_JOINT:
                follower, mimic = self._read_coupling(k, name)
                mimics[follower] = mimic
            elif kind in (kinds.mjEQ_CONNECT, kinds.mjEQ_WELD) and self._is_moved_from_outside(k):
                self._warnings.append(
                    f"the equality {name} leads a body by hand, so it is left out"
                )
            elif kind in (kinds.mjEQ_CONNECT, kinds.mjEQ_WELD):
                closures.append(self._read_closure(k, name, welded=kind == kinds.mjEQ_WELD))
            else:
                text = kind.name.removeprefix("mjEQ_").lower()
                raise ConfigError(
                    f"{self._path}: the equality {name} of type {text} has no rigid-body meaning here; "
                    "connect, weld and joint have."
                )
        self._check_mimics(mimics)
        return mimics, tuple(closures)

    def _is_moved_from_outside(self, k: int) -> bool:
        """Return whether an equality ties a body to a body that is moved from outside."""
        model = self._model
        on_bodies = model.eq_objtype[k] == int(self._mujoco.mjtObj.mjOBJ_BODY)
        ids = [int(model.eq_obj1id[k]), int(model.eq_obj2id[k])]
        return bool(on_bodies and any(model.body_mocapid[i] >= 0 for i in ids))

    def _read_coupling(self, k: int, name: str) -> tuple[str, Mimic]:
        """Return the follower of an equality of joints, and how it follows.

        Raises:
            ConfigError: The coupling is not linear, or fixes a joint alone.
        """
        model = self._model
        follower, leader = int(model.eq_obj1id[k]), int(model.eq_obj2id[k])
        offset, ratio, *higher = model.eq_data[k, :5].tolist()
        if any(higher) or leader < 0:
            form = "a polynomial" if leader >= 0 else "a joint held at a value"
            raise ConfigError(
                f"{self._path}: the equality {name} is {form}; only offset and ratio are understood. "
                f"--lock {self._joints[follower]}=VALUE holds a joint; take the equality out."
            )
        return self._joints[follower], Mimic(self._joints[leader], ratio, offset)

    def _check_mimics(self, mimics: dict[str, Mimic]) -> None:
        for name in mimics:
            seen, joint = {name}, mimics[name].joint
            while joint in mimics:
                if joint in seen:
                    raise ConfigError(
                        f"{self._path}: joint {joint} mimics itself through equalities."
                    )
                seen.add(joint)
                joint = mimics[joint].joint

    def _read_closure(self, k: int, name: str, *, welded: bool) -> ImportedClosure:
        """Return the closure of an equality of bodies or sites."""
        model = self._model
        ids = (int(model.eq_obj1id[k]), int(model.eq_obj2id[k]))
        one, other = np.eye(4), np.eye(4)
        if model.eq_objtype[k] == int(self._mujoco.mjtObj.mjOBJ_SITE):
            one, other = (self._to_transform(model.site_pos[i], model.site_quat[i]) for i in ids)
            ids = (int(model.site_bodyid[ids[0]]), int(model.site_bodyid[ids[1]]))
        elif welded:
            one = self._to_transform(model.eq_data[k, 3:6], model.eq_data[k, 6:10])
        else:
            one[:3, 3], other[:3, 3] = model.eq_data[k, :3], model.eq_data[k, 3:6]
        for frame, body in zip((one, other), ids, strict=True):
            frame[:3, 3] -= self._anchors[body]
        links = (self._bodies[ids[0]], self._bodies[ids[1]])
        return ImportedClosure(name, "fixed" if welded else "point", links, (one, other))

    def _choose_independent(self) -> tuple[tuple[str, int], ...]:
        """Return the coordinates that the equalities leave free, actuated ones first."""
        mujoco, model = self._mujoco, self._model
        off = mujoco.mjtDisableBit
        model.opt.disableflags |= int(
            off.mjDSBL_CONTACT | off.mjDSBL_LIMIT | off.mjDSBL_FRICTIONLOSS
        )
        model.opt.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
        data = mujoco.MjData(model)
        mujoco.mj_forward(model, data)
        J = np.reshape(data.efc_J, (-1, model.nv)) if data.nefc else np.zeros((0, model.nv))
        scale = np.linalg.norm(J, 2) if J.size else 0.0
        actuated = [bool(self._find_actuators(int(joint))) for joint in model.dof_jntid]
        dependent: list[int] = []
        for k in sorted(range(model.nv), key=lambda k: (actuated[k], -k)):
            some = J[:, [*dependent, k]]
            if np.linalg.matrix_rank(some, tol=_RANK * scale) > len(dependent):
                dependent.append(k)
        return tuple(
            (self._joints[int(model.dof_jntid[k])], k - int(model.jnt_dofadr[model.dof_jntid[k]]))
            for k in range(model.nv)
            if k not in dependent
        )

    def separate_inertia(
        self, body: ImportedBody, robot: SimplifiedRobot, whole: Inertial | None
    ) -> Inertial:
        """Return the inertia of a body's own link, in the frame of that link in the file, without the links that are
        fixed to the body.
        """
        parts = [whole or Inertial()]
        for link, carrier in robot.merged.items():
            inertial = self._links[link]
            if carrier == body.name and inertial is not None:
                parts.append(inertial.transform(robot.frames[link]).negate())
        anchored = np.eye(4)
        anchored[:3, 3] = self._anchors[self._bodies.index(str(body.link))]
        return merge_inertias(parts).transform(anchored)

    def get_reference(self, joint: str) -> float:
        """Return the coordinate, rad or m, that MuJoCo gives a joint in the pose of the file."""
        k = self._joints.index(joint)
        return float(self._model.qpos0[self._model.jnt_qposadr[k]])

    def _warn_of_losses(self) -> None:
        """Add warnings about features of the file that a config cannot express."""
        model = self._model
        left = {
            "tendons": model.ntendon,
            "forces of a fluid": model.opt.density or model.opt.viscosity,
            "compensation of gravity": model.body_gravcomp.any(),
            "springs and friction that are not linear": _has_nonzero(model, "dof_dampingpoly")
            or _has_nonzero(model, "jnt_stiffnesspoly"),
            "rotors and friction of actuators": _has_nonzero(model, "actuator_armature")
            or _has_nonzero(model, "actuator_damping"),
        }
        bits = self._mujoco.mjtDisableBit
        flags = (getattr(bits, f"mjDSBL_{flag}", None) for flag in _FLAGS)
        off = [bit.name.removeprefix("mjDSBL_").lower() for bit in flags
               if bit is not None and model.opt.disableflags & int(bit)]  # fmt: skip
        if off:
            self._warnings.append(f"switched off in the file, and yet taken over: {', '.join(off)}")
        self._warnings += [f"{what} are left out" for what, there in left.items() if there]


def _has_nonzero(model: Any, name: str) -> bool:
    """Return whether an attribute exists in this version of MuJoCo and is not zero."""
    return bool(np.any(getattr(model, name, 0)))


def _add_mimic(joint: ImportedJoint, mimic: Mimic | None) -> ImportedJoint:
    return joint if mimic is None else replace(joint, mimic=mimic)
