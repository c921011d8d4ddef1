"""Checks of the parts of a config against each other."""

from collections.abc import Callable, Iterator

import numpy as np

from paramreduce_cli.config.coordinate_lists import PER_JOINT, read_per_joint
from paramreduce_cli.config.plausibility import (
    find_implausible_bodies,
    find_implausible_gravity,
    find_implausible_speeds,
)
from paramreduce_cli.config.schema import Config
from paramreduce_cli.config.use_groups import group_uses
from paramreduce_cli.errors import Key
from paramreduce_cli.fields.names import Problem, UnknownNameError
from paramreduce_cli.fields.numbers import RATHER_DEGREES
from paramreduce_cli.fields.section import expand_per_joint
from paramreduce_cli.records import SIGN_FRICTION, Parameter
from paramreduce_cli.robots import drives, payloads
from paramreduce_cli.robots.inertia import compute_pseudo_inertia, is_positive_semidefinite

_FEWEST_STEPS, _MOST_STEPS = 10, 1_000_000
Check = Callable[[Config], Iterator[Problem]]


def find_problems(config: Config) -> list[Problem]:
    """Return all contradictions between the parts of a config, each part of which is valid by itself."""
    tree = [*_check_bodies(config), *_check_payloads_and_drives(config)]
    if tree:
        return tree
    return [problem for one in _CHECKS for problem in one(config)]


def find_warnings(config: Config) -> list[str]:
    """Return sentences on odd values of a usable config: impossible bodies, unknown values, likely wrong units."""
    kinds = (
        _warn_of_bodies,
        find_implausible_bodies,
        find_implausible_gravity,
        _warn_of_drives,
        _warn_of_limits,
        find_implausible_speeds,
        _warn_of_terms,
    )
    return [f"{text}; going on" for one in kinds for text in one(config)]


def _check_bodies(config: Config) -> Iterator[Problem]:
    """Yield problems of names and parents of bodies."""
    bodies = config.description.bodies
    path: Key = ("description", config.description.kind, bodies.ROWS)
    names = bodies.list_body_names()
    seen: set[str] = set()
    for k, (name, parent) in enumerate(zip(names, bodies.list_parents(), strict=True)):
        if name in seen or name == "base":
            yield (*path, k, "name"), f"{name!r} is used twice; every body needs its own name"
        if parent is not None and parent not in {"base", *seen}:
            if parent in names:
                message: str | UnknownNameError = (
                    f"{parent!r} is not above {name!r}; put parents above children"
                )
            else:
                message = UnknownNameError("body", parent, ["base", *seen])
            yield (*path, k, "parent"), message
        seen.add(name)


def _check_payloads_and_drives(config: Config) -> Iterator[Problem]:
    """Yield problems of payloads and drives."""
    bodies = config.description.bodies
    for key, message in payloads.find_payload_problems(config.payloads, bodies.list_body_names()):
        yield ("payloads", *key), message
    for k, name in enumerate(config.identification.payloads):
        if name not in config.payloads:
            error = UnknownNameError("payload", name, list(config.payloads))
            yield ("identification", "payloads", k), error
    for key, message in drives.find_drive_problems(
        config.drives, bodies.list_coordinates(), closed=bodies.closed
    ):
        yield ("drives", *key), message
    coordinates = bodies.list_coordinates()
    owners = [*bodies.list_body_names(), *config.payloads, *config.list_drives()]
    for name, section in config.forces.items():
        if name in owners:
            yield (
                ("forces", name),
                f"{name!r} is taken by a body, payload or drive; use another name",
            )
        problems = list(section.find_problems(["base", *bodies.list_body_names()], coordinates))
        for key, message in problems:
            yield ("forces", name, *key), message
        parts = [] if problems else section.build_forces(name, config.make_names())
        for part in (force.drive.name for force in parts):
            if part != name and part in {*owners, *config.forces}:
                yield ("forces", name), f"makes {part!r}, a name that is taken; use another name"
            owners.append(part)
    for name, drive in config.drives.items():
        if drive.friction == "auto" and config.sampling.log is None:
            yield (
                ("drives", name, "friction"),
                "is auto, but there is no sampling.log to decide; give values or unknown",
            )


def _check_loads(config: Config) -> Iterator[Problem]:
    """Yield problems of friction that depends on the load, if the log does not tell the masses."""
    if config.automatic_friction or config.parameters not in (None, *config.parameter_sets):
        return
    massless = not config.has_masses()
    for name, drive in config.drives.items():
        if drive.load is not None and massless:
            yield (
                ("drives", name, "load"),
                "needs the torques of gravity, and no body has a mass; give values of the bodies, or friction: auto",
            )
        elif drive.load is not None and config.identification.payloads:
            yield (
                ("drives", name, "load"),
                "leaves out the weight of the payloads that identification.payloads asks for; give friction: auto, or remove it",
            )


def _check_tracking(config: Config) -> Iterator[Problem]:
    """Yield problems of the simulated control, which needs the torques of all joints and an open tree."""
    if config.report.tracking is not None and config.unmeasured:
        yield ("report", "tracking"), "needs the torques of all joints; remove it"
    if config.report.tracking is not None and config.description.bodies.closed:
        yield (
            ("report", "tracking"),
            "works for open trees only, and this mechanism has loops; remove it",
        )


def _check_description(config: Config) -> Iterator[Problem]:
    for key, message in config.description.bodies.find_problems():
        yield ("description", config.description.kind, *key), message


def _check_constraints(config: Config) -> Iterator[Problem]:
    """Yield problems of constraints on trajectories."""
    description = config.description
    bodies = ["base", *description.bodies.list_body_names()]
    coordinates = description.bodies.list_coordinates()
    seen: set[str] = set()
    for k, entry in enumerate(config.trajectories.constraints):
        path: Key = ("trajectories", "constraints", k)
        if entry.name in seen:
            yield (
                (*path, "name"),
                f"{entry.name!r} is used twice; every constraint needs its own name",
            )
        seen.add(entry.name)
        if entry.coordinate is not None and entry.coordinate not in coordinates:
            yield (
                (*path, "coordinate"),
                UnknownNameError("coordinate", entry.coordinate, coordinates),
            )
        for key in ("body", "axis_body"):
            name = getattr(entry, key)
            if name is not None and name not in bodies:
                yield (*path, key), UnknownNameError("body", name, bodies)
        for j, name in enumerate(entry.bodies or []):
            if name not in bodies:
                yield (*path, "bodies", j), UnknownNameError("body", name, bodies)
        if entry.quantity == "singularity" and not description.bodies.closed:
            yield (*path, "quantity"), "singularity needs closed loops, and there is no closure"


def _list_parameters(config: Config) -> list[str]:
    return [parameter.name for parameter in config.list_parameters()]


def _check_groups(config: Config) -> Iterator[Problem]:
    """Yield problems of groups of parameters."""
    if config.reduction.groups == "auto":
        if not group_uses(config):
            text = "is auto, but no subsystem is used twice. Give groups, or leave it out."
            yield ("reduction", "groups"), text
        return
    known = _list_parameters(config)
    owner: dict[str, str] = {}
    for k, entry in enumerate(config.reduction.groups):
        path: Key = ("reduction", "groups", k)
        for j, body in enumerate(entry.bodies or []):
            if body not in config.description.bodies.list_inertial_bodies():
                yield (
                    (*path, "bodies", j),
                    UnknownNameError(
                        "body", body, config.description.bodies.list_inertial_bodies()
                    ),
                )
        for j, name in enumerate(entry.parameters or []):
            if name not in known:
                yield (*path, "parameters", j), UnknownNameError("parameter", name, known)
        for group, members in entry.list_groups().items():
            if group in known or group in owner.values():
                yield (*path, "name"), f"the name {group!r} is taken"
            for j, name in enumerate(members):
                if name in members[:j]:
                    yield path, f"{name} is listed twice"
                elif name in owner:
                    yield path, f"{name} is in the group {owner[name]} already"
            owner |= dict.fromkeys(members, group)


def _check_symmetries(config: Config) -> Iterator[Problem]:
    """Yield problems of symmetries."""
    names = config.description.bodies.list_independent_coordinates()
    for k, images in enumerate(config.sampling.symmetries):
        if sorted(name.removeprefix("-") for name in images) != sorted(names):
            yield (
                ("sampling", "symmetries", k),
                f"must name each independent coordinate once: {', '.join(names)}",
            )
    if config.sampling.symmetries and config.sampling.estimation_file is not None:
        yield ("sampling", "symmetries"), "complete trajectories, not recordings; leave them out"


def _check_simulation(config: Config) -> Iterator[Problem]:
    """Yield problems of the simulation."""
    section = config.sampling.simulation
    if section is None:
        return
    path: Key = ("sampling", "simulation")
    names = config.description.bodies.list_independent_coordinates()
    for key in ("inputs", "motions", "start", "speed"):
        given = getattr(section, key)
        for name in given:
            if name not in names:
                yield (*path, key, name), UnknownNameError("independent coordinate", name, names)
    for name, (lower, upper) in section.start.items():
        if lower > upper:
            yield (*path, "start", name), f"the range crosses: {lower:g} is above {upper:g}"
    if section.step * _FEWEST_STEPS > section.duration:
        yield (*path, "step"), f"{section.step:g} s is too long for {section.duration:g} s"
    if section.duration / section.step > _MOST_STEPS:
        yield (*path, "step"), f"makes more than {_MOST_STEPS} samples of {section.duration:g} s"
    signs = [
        *(("drives", n, {*d.get_values()}, d.smoothing) for n, d in config.list_drives().items()),
        *(("forces", f.drive.name, {*f.values}, f.drive.smoothing) for f in config.list_forces()),
    ]
    for key, name, values, smoothing in signs:
        if set(SIGN_FRICTION) & values and not smoothing:
            yield (key,), f"{name} needs a smoothing: a sign that jumps cannot be simulated"
    sampling = config.sampling
    if any(sampling.list_recordings().values()) or sampling.symmetries:
        yield path, "makes all sets; leave out files and symmetries"
    for k, track in enumerate([] if section.road is None else section.road.tracks):
        for j, name in enumerate(track):
            if name not in names:
                error = UnknownNameError("independent coordinate", name, names)
                yield (*path, "road", "tracks", k, j), error
    if not section.inputs and not section.prescribed:
        yield path, "has no input; give inputs, motions or a road"
    for name in section.prescribed:
        if section.prescribed.count(name) > 1:
            yield path, f"prescribes the motion of {name} twice"
        if name in section.inputs:
            yield (
                (*path, "inputs", name),
                f"is a force on {name}, whose motion is prescribed; remove one of them",
            )
        for key in ("start", "speed"):
            if name in getattr(section, key):
                yield (*path, key, name), f"is of {name}, whose motion is prescribed; remove it"
    if section.prescribed and set(names) <= set(section.prescribed):
        yield path, "prescribes the motion of all coordinates, so that nothing is simulated"
    moved = {*section.inputs, *section.prescribed, *config.unmeasured}
    still = [name for name in names if name not in moved]
    if still and config.nominal_torque == "standard-deviation":
        yield (
            ("nominal_torque",),
            f"is missing: without an input there is no torque, whose standard deviation is no scale, on {', '.join(still)}. Give "
            f"one value, or one for each of {', '.join(names)}, in this order, N m (N)",
        )


def _check_inertia(config: Config) -> Iterator[Problem]:
    if not config.description.bodies.list_inertial_bodies():
        yield ("description", "tree", "bodies"), "are all massless, so there is no parameter"


def _check_parameter_sets(config: Config) -> Iterator[Problem]:
    """Yield problems of sets of parameters."""
    names = config.description.bodies.list_inertial_bodies()
    for label, bodies in config.parameter_sets.items():
        for body in bodies:
            if body not in names:
                yield ("parameter_sets", label, body), UnknownNameError("body", body, names)
        for name in names:
            if name not in bodies:
                yield (
                    ("parameter_sets", label),
                    f"has no body {name}; write `{name}: {{}}` if it has no mass",
                )
    if config.parameters is not None and config.parameters not in config.parameter_sets:
        yield (
            ("parameters",),
            UnknownNameError("parameter set", config.parameters, config.parameter_sets),
        )


def _check_per_joint(config: Config) -> Iterator[Problem]:
    """Yield problems of lists with one value per joint."""
    n = config.n_dof
    for path, unit in PER_JOINT.items():
        values = read_per_joint(config, path)
        if isinstance(values, list) and len(values) not in (1, n):
            yield (
                path,
                f"has {len(values)} values, but {config.robot} has {n} {_name_coordinates(config)}. Give "
                f"one for each, or one for all, in {unit}",
            )
    for k, pose in enumerate(config.report.poses or []):
        if len(pose) not in (1, n):
            yield ("report", "poses", k), f"has {len(pose)} values, but there are {n} joints"


def _name_coordinates(config: Config) -> str:
    return "independent coordinates" if config.description.bodies.closed else "joints"


def _check_limits(config: Config) -> Iterator[Problem]:
    """Yield problems of position limits, and of numbers of points, harmonics and starts that do not fit each other."""
    given = config.trajectories.position_limits or []
    for k, (lower, upper) in enumerate(given):
        path: Key = ("trajectories", "position_limits")
        if len(given) > 1:
            path = (*path, k)
        if not np.isfinite([lower, upper]).all():
            yield path, f"[{lower:g}, {upper:g}] must be finite"
        elif lower == upper:
            yield path, f"the joint never moves between {lower:g} and {upper:g}; fix it or free it"
        elif lower > upper:
            yield path, f"the limits cross: {lower:g} is above {upper:g}; write [lower, upper]"
    t = config.trajectories
    if t.points <= 2 * t.harmonics:
        yield (
            ("trajectories", "points"),
            f"{t.points} points cannot hold {t.harmonics} harmonics within their limits; use at "
            f"least {2 * t.harmonics + 1}, better {20 * t.harmonics}",
        )
    if t.rest_to_rest and t.harmonics < 2:
        yield (
            ("trajectories", "harmonics"),
            "is 1, but motions from rest to rest need 2 or more, better 4",
        )
    if t.polished > t.starts:
        yield ("trajectories", "polished"), f"is {t.polished}, but there are {t.starts} starts"


def _check_limits_given(config: Config) -> Iterator[Problem]:
    """Yield problems of limits that are missing, where motions or states are looked for within them."""
    purpose = ""
    if config.sampling.needs_trajectories and config.trajectories.file is None:
        purpose = "trajectories are looked for within them. Give them, or samples by sampling.simulation or sampling.log"
    elif config.terms is not None:
        purpose = "terms are pruned for all states within them"
    for key in ("position_limits", "velocity_limits"):
        path = ("trajectories", key)
        if purpose and read_per_joint(config, path) is None:
            yield path, f"is missing, in {PER_JOINT[path]}: {purpose}"


def _check_acceptance(config: Config) -> Iterator[Problem]:
    """Yield problems of limits of errors on a test set, if the config leads to no test set."""
    sampling, motions = config.sampling, config.trajectories
    if sampling.test_file is not None:
        return
    if not sampling.needs_trajectories and sampling.simulation is None:
        instead = "torque_error_validation is on what was held out"
    elif sampling.simulation is not None and not sampling.simulation.test_runs:
        instead = "give sampling.simulation.test_runs"
    elif sampling.simulation is None and not (
        motions.file or motions.test_count or motions.test_point_to_point_count
    ):
        instead = "give trajectories.test_count"
    else:
        return
    for name in config.validation.accept.model_dump(exclude_none=True):
        if "_test" in name:
            yield ("validation", "accept", name), f"is on a test set, but there is none; {instead}"


def _check_unmeasured(config: Config) -> Iterator[Problem]:
    """Yield problems of joints whose torque is not measured."""
    names = config.description.bodies.list_independent_coordinates()
    for k, name in enumerate(config.unmeasured):
        if name not in names:
            yield ("unmeasured", k), UnknownNameError("independent coordinate", name, names)
    for key in ("torque_limits", "power_limits"):
        given = getattr(config.trajectories, key) or [np.inf]
        if len(given) in (1, len(names)):
            limits = dict(zip(names, expand_per_joint(given, len(names)), strict=True))
            for name in set(config.unmeasured) & set(names):
                if np.isfinite(limits[name]):
                    yield (
                        ("trajectories", key),
                        f"limits {name}, whose torque is unmeasured; write inf for it",
                    )
    if not config.find_measured().any():
        yield ("unmeasured",), "leaves no measured torque; remove the joints that are measured"


def _check_base_columns(config: Config) -> Iterator[Problem]:
    """Yield problems of the columns that are chosen as base parameters."""
    known = _list_parameters(config)
    for k, name in enumerate(config.model.base_columns or []):
        if name not in known:
            yield ("model", "base_columns", k), UnknownNameError("parameter", name, known)
        elif name in (config.model.base_columns or [])[:k]:
            yield ("model", "base_columns", k), f"{name} is listed twice"


def _check_selection(config: Config) -> Iterator[Problem]:
    """Yield problems of heuristics and of the selected model."""
    total = len(config.list_parameters())
    for k, name in enumerate(config.reduction.heuristics):
        if name in config.reduction.heuristics[:k]:
            yield ("reduction", "heuristics", k), f"{name} is listed twice"
    if config.selected.heuristic not in (None, *config.reduction.heuristics):
        yield (
            ("selected", "heuristic"),
            f"{config.selected.heuristic} does not run; it must be one of reduction.heuristics: "
            f"{', '.join(config.reduction.heuristics)}",
        )
    for path, n in (
        (("selected", "n"), config.selected.n),
        (("reduction", "stop", "parameters"), config.reduction.stop.parameters),
    ):
        if n is not None and n > total:
            yield path, f"is {n}, but {config.robot} has {total} parameters"
    most, size = config.reduction.stop.parameters, config.selected.n
    if most is not None and size is not None and size > most:
        yield (
            ("selected", "n"),
            f"is {size}, but reduction.stop.parameters stops at {most}; raise that, or lower this",
        )


_CHECKS: tuple[Check, ...] = (
    _check_description,
    _check_tracking,
    _check_constraints,
    _check_groups,
    _check_symmetries,
    _check_simulation,
    _check_inertia,
    _check_parameter_sets,
    _check_loads,
    _check_per_joint,
    _check_limits,
    _check_limits_given,
    _check_acceptance,
    _check_unmeasured,
    _check_base_columns,
    _check_selection,
)


def _warn_of_bodies(config: Config) -> Iterator[str]:
    """Yield bodies that cannot exist; reduced sets are not physical either, so this is no error."""
    for name, body in config.get_body_parameters().items():
        if body.m < 0:
            yield f"body {name} has the negative mass {body.m:g} kg"
            continue
        moments = compute_pseudo_inertia(body.get_values())
        if not is_positive_semidefinite(moments):
            yield (
                f"the inertia of body {name} is not physical: no distribution of mass has it (its "
                f"pseudo-inertia matrix has the eigenvalue {np.linalg.eigvalsh(moments)[0]:.3g})"
            )


def _warn_of_limits(config: Config) -> Iterator[str]:
    """Yield positions that hardly any joint reaches."""
    for lower, upper in config.trajectories.position_limits or []:
        if max(abs(lower), abs(upper)) > RATHER_DEGREES:
            yield f"trajectories.position_limits of [{lower:g}, {upper:g}] are in rad (m), not degrees"
            return


def _warn_of_terms(config: Config) -> Iterator[str]:
    """Yield a warning if there is a budget of acceleration errors, but the direct dynamics are not pruned."""
    terms = config.terms
    if (
        terms is not None
        and terms.acceleration_error is not None
        and "direct" not in terms.functions
    ):
        yield "terms.acceleration_error is of the direct dynamics, which is not under terms.functions"


def _warn_of_drives(config: Config) -> Iterator[str]:
    """Yield warnings about drives: unknown values that the model takes as zero, and negative values of what cannot be
    negative.
    """
    sampling = config.sampling
    elements = {**config.list_drives(), **config.forces}
    missing = {name: element.list_unknown() for name, element in elements.items()}
    found = [f"{' and '.join(keys)} of {name}" for name, keys in missing.items() if keys]
    if found and not sampling.measured:
        yield f"unknown, and so zero in the torques of the model: {', '.join(found)}"
    for name, drive in config.list_drives().items():
        for kind, value in drive.get_values().items():
            if value < 0 and not kind.is_signed:
                yield f"drive {name} has the negative {Parameter(kind, name).name} {value:g}"
    for force in config.list_forces():
        for kind, value in force.values.items():
            if value < 0 and not kind.is_signed:
                yield f"the negative {Parameter(kind, force.drive.name).name} {value:g}"
