"""Subsystems of a config, which are written once and used several times, also mirrored.

Uses are written out in the plain data before it is checked: bodies, closures, drives and forces of a subsystem get names
with the suffix of the use. The lines of the file stay known, so that messages name the subsystem.
"""

import copy
import re
from collections.abc import Callable, Mapping
from typing import Any

from paramreduce_cli.config.yaml_reading import Document
from paramreduce_cli.errors import Key
from paramreduce_cli.fields.names import Problem, UnknownNameError

_TREE: Key = ("description", "tree")
_LISTS: dict[str, Key] = {
    "bodies": (*_TREE, "bodies"),
    "closures": (*_TREE, "closures"),
    "independent": (*_TREE, "independent"),
}
"""Parts of a subsystem that are lists, and the lists of the config that they are appended to."""
_MAPPINGS: dict[str, Key] = {
    "points": (*_TREE, "points"),
    "guess": (*_TREE, "guess"),
    "drives": ("drives",),
    "forces": ("forces",),
}
"""Parts of a subsystem that are mappings, and the mappings of the config that they are merged into."""
_PARAMETERS = "parameters"
_PRODUCTS = ("Ixx", "Ixy", "Ixz", "Iyy", "Iyz", "Izz")
_USUAL_AXES = {"revolute": "z", "prismatic": "z", "universal": ["x", "y"]}
"""Axes of joints where none are given, by the kind of the joint."""
_NAMED = re.compile(r"^(-?)(to )?(\S+)$")
"""A named direction: x, -y, or to a point."""


def expand_subsystems(document: Document) -> list[Problem]:
    """Write out the uses of all subsystems in the data of a document, and return what is wrong with them.

    Args:
        document: Document, whose data and lines change.
    """
    data = document.data
    subsystems, uses = data.get("subsystems"), data.get("uses")
    if uses and not subsystems:
        return [(("uses",), "need subsystems, of which there are none")]
    if subsystems and not uses:
        return [(("subsystems",), "are not used; give uses, one entry for every use")]
    if not isinstance(subsystems, dict) or not isinstance(uses, list):
        return []
    problems: list[Problem] = []
    for k, use in enumerate(uses):
        if not isinstance(use, dict) or "subsystem" not in use:
            continue
        name, place = str(use["subsystem"]), ("uses", k)
        if name not in subsystems:
            error = UnknownNameError("subsystem", name, list(subsystems))
            problems.append(((*place, "subsystem"), error))
        elif isinstance(subsystems[name], dict):
            copied = _Copy(subsystems[name], use)
            # Where one name clashes, so do all.
            problems += _merge(document, ("subsystems", name), copied.write(), place)[:1]
            problems += [
                ((*place, "names", other), f"subsystem {name!r} refers to no {other!r} outside")
                for other in copied.list_unused_names()
            ]
    return problems


def _merge(document: Document, source: Key, parts: Mapping[str, Any], use: Key) -> list[Problem]:
    """Add the parts of one use to the data of a document, and return the names that clash."""
    problems: list[Problem] = []
    for part, target in _LISTS.items():
        entries = _find_container(document.data, target, [])
        for k, entry in enumerate(parts.get(part, [])):
            entries.append(entry)
            _copy_lines(document, (*source, part, k), (*target, len(entries) - 1))
    for part, target in _MAPPINGS.items():
        given = parts.get(part, {})
        if given:
            entries = _find_container(document.data, target, {})
            problems += _merge_mapping(document, entries, given, (*source, part), target, use)
    sets = _find_container(document.data, ("parameter_sets",), {})
    if parts.get(_PARAMETERS):
        for name in list(sets) or ["nominal"]:
            entries = sets.setdefault(name, {})
            where = ("parameter_sets", name)
            given = copy.deepcopy(parts[_PARAMETERS])
            if isinstance(entries, dict):
                problems += _merge_mapping(
                    document, entries, given, (*source, _PARAMETERS), where, use
                )
    return problems


def _merge_mapping(
    document: Document, entries: dict[str, Any], given: Mapping[str, tuple[str, Any]], source: Key,
    target: Key, use: Key,
) -> list[Problem]:  # fmt: skip
    """Merge a mapping of a use into one of the config, and return the names that clash."""
    problems: list[Problem] = []
    for name, (original, value) in given.items():
        place = (*target, name)
        if (
            name in entries
            and place not in document.overrides
            and not _is_set_below(document, place)
        ):
            text = f"makes {name!r} of {original!r}, which {'.'.join(map(str, target))} has already; use another suffix"
            problems.append((use, text))
        elif isinstance(entries.get(name), dict) and isinstance(value, dict):
            entries[name] = value | entries[name]
        else:
            entries.setdefault(name, value)
        _copy_lines(document, (*source, original), place)
    return problems


def _is_set_below(document: Document, place: Key) -> bool:
    """Return whether the command line set a key below a place."""
    return any(key[: len(place)] == place for key in document.overrides)


def _find_container(data: Any, path: Key, empty: Any) -> Any:
    """Return the list or mapping at a key, which is made if it is missing."""
    for step in path[:-1]:
        data = data.setdefault(step, {}) if isinstance(data, dict) else {}
    if not isinstance(data, dict):
        return empty
    if data.get(path[-1]) is None:
        data[path[-1]] = empty
    found = data[path[-1]]
    return found if isinstance(found, type(empty)) else empty


def _copy_lines(document: Document, source: Key, target: Key) -> None:
    """Give a copied part the lines and names of the part that it is a copy of."""
    for key, line in list(document.lines.items()):
        if key[: len(source)] == source:
            document.lines.setdefault((*target, *key[len(source) :]), line)
    document.originals[target] = source


class _Copy:
    """A copy of a subsystem with other names, perhaps moved and mirrored.

    Args:
        subsystem: Subsystem as it is written.
        use: Suffix of the names, names for bodies and coordinates outside, shift of the points, and mirrored axis.
    """

    def __init__(self, subsystem: Mapping[str, Any], use: Mapping[str, Any]) -> None:
        self._subsystem, self._suffix = subsystem, str(use.get("suffix", ""))
        outside, shift, mirror = use.get("names"), use.get("shift"), use.get("mirror")
        self._outside: dict[Any, Any] = outside if isinstance(outside, dict) else {}
        self._replaced: set[Any] = set()
        """Names outside that this use has replaced."""
        self._shift = shift if isinstance(shift, list) and len(shift) == 3 else None
        self._flipped = "xyz".find(mirror) if isinstance(mirror, str) and mirror else -1
        self._defaults: dict[str, str] = {}
        """New default names of the coordinates of joints of several axes."""
        self._own = self._list_own_names()

    def write(self) -> dict[str, Any]:
        """Return the parts of the copy; entries of mappings come with the names that they are written under."""
        parts = copy.deepcopy(dict(self._subsystem))
        result: dict[str, Any] = {
            "bodies": [self._write_body(body) for body in _list_dicts(parts.get("bodies"))],
            "closures": [self._write_element(one) for one in _list_dicts(parts.get("closures"))],
            "independent": [self._rename(name) for name in _wrap_in_list(parts.get("independent"))],
        }
        writers: dict[str, Callable[[Any], Any]] = {
            "points": self._write_point,
            "guess": lambda value: value,
            "drives": self._write_element,
            "forces": self._write_element,
            _PARAMETERS: self._write_parameters,
        }
        for part, write in writers.items():
            given = parts.get(part)
            entries = given.items() if isinstance(given, dict) else ()
            result[part] = {self._rename(name): (name, write(value)) for name, value in entries}
        return result

    def _list_own_names(self) -> set[str]:
        """Return the names that are of the subsystem, and not of the rest of the config; fill in new default names."""
        own: set[str] = set()
        for part in ("points", "drives", "forces"):
            given = self._subsystem.get(part)
            own |= set(given) if isinstance(given, dict) else set()
        for body in _list_dicts(self._subsystem.get("bodies")):
            name, coordinates = str(body.get("name")), body.get("coordinates") or []
            own |= {name, f"q_{name}"}
            defaults = range(1, 7) if not coordinates else ()
            self._defaults |= {f"q_{name}_{k}": f"q_{name}{self._suffix}_{k}" for k in defaults}
            own |= set(map(str, coordinates if isinstance(coordinates, list) else [coordinates]))
        own |= {str(one.get("name")) for one in _list_dicts(self._subsystem.get("closures"))}
        return own

    def _rename(self, name: Any) -> Any:
        """Return a name with the suffix if it is one of the subsystem, and the name in this use if it is none."""
        if str(name) in self._defaults:
            return self._defaults[str(name)]
        if str(name) in self._own:
            return f"{name}{self._suffix}"
        if name in self._outside:
            self._replaced.add(name)
            return self._outside[name]
        return name

    def list_unused_names(self) -> list[Any]:
        """Return the names outside that the subsystem, once it is written, does not refer to."""
        return [name for name in self._outside if name not in self._replaced]

    def _write_body(self, body: dict[str, Any]) -> dict[str, Any]:
        """Return a body of the copy."""
        renamed: dict[str, Any] = {
            key: self._rename(body[key]) for key in ("name", "parent") if key in body
        }
        if "coordinates" in body:
            given = body["coordinates"]
            names = given if isinstance(given, list) else [given]
            renamed["coordinates"] = [self._rename(name) for name in names]
        if "at" in body:
            renamed["at"] = self._write_placement(body["at"])
        joint = body.get("joint", "revolute")
        axes = body.get("axes", _USUAL_AXES.get(str(joint)) if self._flipped >= 0 else None)
        if axes is not None:
            renamed["axes"] = self._write_axes(axes, joint == "prismatic")
        return body | renamed

    def _write_element(self, element: Any) -> Any:
        """Return a closure, drive or force element of the copy: with other names, and mirrored places."""
        if not isinstance(element, dict):
            return element
        result = dict(element)
        if "name" in element:
            result["name"] = self._rename(element["name"])
        if isinstance(element.get("bodies"), list):
            result["bodies"] = [self._rename(name) for name in element["bodies"]]
        for key in ("motion", "positions", "speeds"):
            if isinstance(element.get(key), dict):
                result[key] = {self._rename(name): w for name, w in element[key].items()}
        if "spin" in element:
            result["spin"] = self._rename(element["spin"])
        at = element.get("at")
        if isinstance(at, list):
            result["at"] = [self._write_placement(one) for one in at]
        elif at is not None:
            result["at"] = self._rename(at)
        return result

    def _write_placement(self, at: Any) -> Any:
        """Return a point, a named point or a list of steps, mirrored."""
        if isinstance(at, list) and any(isinstance(step, dict) for step in at):
            return [self._write_step(step) for step in at]
        if isinstance(at, list):
            return self._mirror_vector(at)
        return self._write_step(at)

    def _write_step(self, step: Any) -> Any:
        """Return a step of a placement, mirrored; rotations about the mirrored axis stay, others reverse."""
        if not isinstance(step, dict):
            return self._rename(step)
        result = {}
        for key, value in step.items():
            if key == "xyz":
                result[key] = self._mirror_vector(value)
            else:
                axis = "xyz".find(str(key)[1:]) if str(key).startswith("r") else -1
                turned = self._flipped >= 0 and axis >= 0 and axis != self._flipped
                result[key] = _negate(value) if turned else value
        return result

    def _write_axes(self, axes: Any, slides: bool) -> Any:
        """Return the axes of a joint, mirrored: of a slide as directions, of a turn as those of a mirrored turn."""
        if isinstance(axes, list) and axes and all(_is_number(x) for x in axes) and len(axes) == 3:
            return self._write_axis(axes, slides)
        many = axes if isinstance(axes, list) else [axes]
        return [self._write_axis(axis, slides) for axis in many]

    def _write_axis(self, axis: Any, slides: bool) -> Any:
        """Return one axis of a joint, mirrored."""
        if isinstance(axis, list):
            mirrored = self._mirror_vector(axis)
            reversed_ = self._flipped >= 0 and not slides
            return [_negate(x) for x in mirrored] if reversed_ else mirrored
        found = _NAMED.match(str(axis))
        if found is None or self._flipped < 0:
            return (
                axis if found is None or not found[2] else f"{found[1]}to {self._rename(found[3])}"
            )
        sign, to, name = found.groups()
        # A mirrored turn is about the opposite of the mirrored axis; points are mirrored themselves.
        change = not slides if to else ("xyz".find(name) == self._flipped) == slides
        sign = ("" if sign else "-") if change else sign
        return f"{sign}to {self._rename(name)}" if to else f"{sign}{name}"

    def _write_point(self, point: Any) -> Any:
        """Return a named point, shifted and then mirrored."""
        if self._shift is not None and isinstance(point, list) and len(point) == 3:
            point = [f"({x}) + ({by})" for x, by in zip(point, self._shift, strict=True)]
        return self._mirror_vector(point)

    def _write_parameters(self, body: Any) -> Any:
        """Return the parameters of a body of the copy."""
        if not isinstance(body, dict) or self._flipped < 0:
            return (
                {**body, "com": self._rename(body["com"])}
                if isinstance(body, dict) and isinstance(body.get("com"), str)
                else body
            )
        axis = "xyz"[self._flipped]
        result = dict(body)
        for key in (f"m{axis}", *(p for p in _PRODUCTS if p.count(axis) == 1)):
            if key in body:
                result[key] = _negate(body[key])
        if "com" in body:
            com = body["com"]
            result["com"] = self._rename(com) if isinstance(com, str) else self._mirror_vector(com)
        tensor = body.get("inertia_com")
        if isinstance(tensor, list) and len(tensor) == 6:
            pairs = zip(_PRODUCTS, tensor, strict=True)
            result["inertia_com"] = [_negate(x) if p.count(axis) == 1 else x for p, x in pairs]
        elif isinstance(tensor, list) and all(
            isinstance(row, list) and len(row) == 3 for row in tensor
        ):
            flip = self._flipped
            result["inertia_com"] = [
                [_negate(x) if (i == flip) != (j == flip) else x for j, x in enumerate(row)]
                for i, row in enumerate(tensor)
            ]
        return result

    def _mirror_vector(self, vector: Any) -> Any:
        """Return a vector with its component along the mirrored axis reversed."""
        if not isinstance(vector, list) or self._flipped < 0:
            return vector
        return [_negate(x) if k == self._flipped else x for k, x in enumerate(vector)]


def _list_dicts(value: Any) -> list[dict[str, Any]]:
    """Return the mappings in a list, none if the value is no list."""
    return [one for one in value if isinstance(one, dict)] if isinstance(value, list) else []


def _wrap_in_list(value: Any) -> list[Any]:
    """Return a list, or a single value as one; an empty list if there is nothing."""
    return value if isinstance(value, list) else [] if value is None else [value]


def _is_number(value: Any) -> bool:
    """Return whether a value is a number or arithmetic, and not a name."""
    if isinstance(value, int | float):
        return True
    return isinstance(value, str) and bool(re.match(r"^[-+(.\d]", value))


def _negate(value: Any) -> Any:
    """Return the negative of a number or of arithmetic."""
    if isinstance(value, int | float) and not isinstance(value, bool):
        return -value
    return f"-({value})" if isinstance(value, str) else value
