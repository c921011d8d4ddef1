"""Loading of a YAML file as a Config, with all of its errors reported at once."""

import copy
import difflib
import operator
import warnings
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import UnionType
from typing import Any, TypeVar, Union, get_args, get_origin

import yaml
from pydantic import BaseModel, ValidationError

from paramreduce_cli.config import yaml_reading
from paramreduce_cli.config.checks import find_problems, find_warnings
from paramreduce_cli.config.coordinate_lists import cut_to_independent
from paramreduce_cli.config.former_keys import FORMER_KEYS, KEYS_ELSEWHERE
from paramreduce_cli.config.named_points import resolve_points
from paramreduce_cli.config.schema import Config, Settings
from paramreduce_cli.config.sections import find_keys
from paramreduce_cli.config.subsystems import expand_subsystems
from paramreduce_cli.config.use_groups import group_uses
from paramreduce_cli.config.yaml_reading import Document
from paramreduce_cli.errors import ConfigError, Key, ParamreduceWarning, prepend_key
from paramreduce_cli.fields.names import Problem, UnknownNameError
from paramreduce_cli.fields.numbers import read_constants
from paramreduce_cli.fields.section import Section

S = TypeVar("S", bound=Section)
_ROBOT_FILES = (".urdf", ".xml", ".xacro")
_MOST_PROBLEMS = 30
"""That are listed at once."""


def load_config(path: Path, overrides: Sequence[str] = ()) -> Config:
    """Read a robot's YAML.

    Args:
        path: The file.
        overrides: ``key.key=value`` texts that replace what the file says.

    Raises:
        ConfigError: With all that is wrong, one problem a line: file, line, key, what is wrong
            and what would be right.
    """
    document = _read_document(path)
    if not isinstance(document.data, dict):
        raise _make_no_mapping_error(path)
    for text in overrides:
        try:
            yaml_reading.apply_override(document, text)
        except ValueError as error:
            raise ConfigError(str(error)) from error
    config, problems = None, _expand(document)
    if not problems:
        config, problems = _find_all_problems(document.data)
    lines = [f"{document.source}, line {line}: {message}." for line, message in document.problems]
    lines += [
        _format_problem(document, problem)
        for problem in problems
        if problem[0] not in document.unread
    ]
    if lines or config is None:
        lines, remedy = list(dict.fromkeys(lines)), ""
        if "description" not in document.data:
            remedy = "`paramreduce init --dh NAME` writes a whole config to begin with."
        more = len(lines) - _MOST_PROBLEMS
        if more > 0:
            lines[_MOST_PROBLEMS:] = [f"{path}: and {more} more problems like these."]
        rejected, choices = _correct_setting(document, problems) if len(lines) == 1 else ("", [])
        raise ConfigError(
            "\n".join(lines),
            rejected=rejected, choices=choices, remedy=remedy,
            in_file=all(line.startswith(f"{document.source}, line ") for line in lines),
        )  # fmt: skip
    for text in find_warnings(config):
        warnings.warn(text, ParamreduceWarning, stacklevel=2)
    return _resolve_paths(_drop_unused_tests(_list_groups(_choose_use(config))), path.parent)


def load_settings(path: Path | None, overrides: Sequence[str] = ()) -> Settings:
    """Return the sections of a config that apply to samples without a robot.

    Args:
        path: A YAML without a description; None for defaults.
        overrides: ``key.key=value`` texts that replace what the file says.

    Raises:
        ConfigError: The file cannot be read, or the file or the overrides have wrong keys or values, as for
            :func:`load_config`.
    """
    document = yaml_reading.read_yaml("{}", "settings") if path is None else _read_document(path)
    try:
        for text in overrides if isinstance(document.data, dict) else ():
            yaml_reading.apply_override(document, text)
    except ValueError as error:
        raise ConfigError(str(error)) from error
    return _validate_section(document, Settings)


def load_section(path: Path, kind: type[S]) -> S:
    """Read a YAML that is no config, such as a list of runs.

    Args:
        path: The file.
        kind: Type of the section.

    Raises:
        ConfigError: The file cannot be read or has wrong keys, as for :func:`load_config`.
    """
    return _validate_section(_read_document(path), kind)


def _validate_section(document: Document, kind: type[S]) -> S:
    """Return a document as a section, or raise ConfigError with all problems."""
    if not isinstance(document.data, dict):
        raise ConfigError(
            f"{document.source}: must be a mapping of {', '.join(kind.model_fields)}."
        )
    lines = [f"{document.source}, line {line}: {message}." for line, message in document.problems]
    if lines:
        raise ConfigError("\n".join(lines))
    try:
        return kind.model_validate(document.data, context={"constants": {}})
    except ValidationError as error:
        problems = _merge_by_key(
            [_describe_entry(entry, document.data, kind) for entry in error.errors()]
        )
        lines = [_format_problem(document, problem) for problem in problems]
        raise ConfigError("\n".join(dict.fromkeys(lines))) from error


def has_robot(path: Path) -> bool:
    """Return whether a YAML file describes a robot; files that are no mapping count as a robot's."""
    data = _read_document(path).data
    return not isinstance(data, dict) or not set(data) <= set(Settings.model_fields)


@contextmanager
def locate_errors(path: Path | None, overrides: Sequence[str] = ()) -> Iterator[None]:
    """Add file and line to errors of later work that are about a key of the config.

    Args:
        path: The config's file; without one errors stay as they are.
        overrides: Settings of the command line, as for :func:`load_config`.
    """
    try:
        yield
    except ConfigError as error:
        if path is None or not error.key:
            raise
        document = _read_document(path)
        for text in overrides:
            yaml_reading.apply_override(document, text)
        _expand(document)
        error.place = document.describe_place(error.key)
        error.in_file = error.place.startswith(f"{document.source}, line ")
        raise


def get_schema() -> dict[str, Any]:
    """Return the JSON Schema of a config, for editors."""
    return Config.model_json_schema()


def _read_document(path: Path) -> Document:
    """Return the document in a file, or raise ConfigError if it cannot be read."""
    try:
        text = path.read_text(encoding="utf-8")
    except FileNotFoundError as error:
        raise _make_missing_error(path) from error
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigError(
            f"{path}: cannot be read as text ({error}).", rejected=str(path)
        ) from error
    try:
        return yaml_reading.read_yaml(text, str(path))
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        line = f", line {mark.line + 1}" if mark else ""
        raise ConfigError(
            f"{path}{line}: this is not YAML: {error.problem}.", in_file=True
        ) from error
    except yaml.YAMLError as error:
        raise ConfigError(f"{path}: this is not YAML: {error}.") from error


def _make_missing_error(path: Path) -> ConfigError:
    """Return the error that a config does not exist, with the config that is probably meant, or a command that makes
    one.
    """
    message = f"{path}: there is no such file."
    below = Path("configs") / path.with_suffix(".yaml").name
    meant = [m for m in (path.with_suffix(".yaml"), below) if m != path and m.is_file()]
    names = (
        sorted(other.name for other in path.parent.glob("*.yaml")) if path.parent.is_dir() else []
    )
    near = difflib.get_close_matches(path.name, names, n=1)
    choices = [str(m) for m in [*meant, *(path.with_name(name) for name in near)]][:1]
    remedy = ""
    if choices:
        message += f" Did you mean {choices[0]}?"
    elif names:
        message += f" {path.parent} holds {', '.join(names)}."
    else:
        remedy = f"`paramreduce init --dh {path.stem}` writes one, or `paramreduce init ROBOT.urdf` from a robot's file."
    return ConfigError(message, rejected=str(path), choices=choices, remedy=remedy)


def _make_no_mapping_error(path: Path) -> ConfigError:
    """Return the error that a file is no config at all."""
    if path.suffix in _ROBOT_FILES:
        remedy = f"`paramreduce init {path}` makes a config of it."
        return ConfigError(f"{path}: is a robot's file.", remedy=remedy)
    message = f"{path}: a config is a mapping that starts with robot: NAME."
    return ConfigError(message, remedy="`paramreduce init --dh NAME` writes one.")


def _correct_setting(document: Document, problems: list[Problem]) -> tuple[str, list[str]]:
    """Return the setting of the command line that has an unknown name, and its correction; nothing if no known name is
    similar.
    """
    if len(problems) != 1:
        return "", []
    ((path, error),) = problems
    typed = document.overrides.items()
    text = next((t for key, t in typed if all(map(operator.eq, key, path))), "")
    if not text or not isinstance(error, UnknownNameError):
        return "", []
    key, _, value = text.partition("=")
    names = key.split(".")
    if error.is_key:
        names[len(path) - 1 : len(path)] = [error.nearest] if error.nearest else []
        positions = find_keys(error.name) if len(path) == 1 and not error.nearest else []
        if error.nearest or len(positions) == 1:
            return text, [f"{'.'.join(names) or positions[0]}={value}"]
    elif error.nearest:
        depth = len(names)
        return text, [f"{key}={_replace_item(value, path[depth:], error.nearest)}"]
    return "", []


def _replace_item(value: str, place: Key, name: str) -> str:
    """Return a value as it was typed, with another name at a position in it; an empty position means the value itself."""
    if not place:
        return name
    items = yaml.safe_load(value)
    where = items
    for step in place[:-1]:
        where = where[step]
    where[place[-1]] = name
    return str(yaml.safe_dump(items, default_flow_style=True, width=10**6)).strip()


def _expand(document: Document) -> list[Problem]:
    """Write out subsystems and named points in the data of a document, and return what is wrong with them."""
    constants, _ = read_constants(document.data.get("constants"))
    return expand_subsystems(document) or resolve_points(document, constants)


def _find_all_problems(data: dict[str, Any]) -> tuple[Config | None, list[Problem]]:
    """Return the config, None if it has structural problems, and all problems: structural ones first, then those of the
    other parts.
    """
    constants, unreadable = read_constants(data.get("constants"))
    mistaken: list[Problem] = [(("constants", name), text) for name, text in unreadable.items()]
    try:
        config = cut_to_independent(_parse_config(data, constants))
        return config, mistaken + find_problems(config)
    except ValidationError as error:
        problems = mistaken + _merge_by_key(
            [_describe_entry(entry, data) for entry in error.errors()]
        )
    remainder = copy.deepcopy(data)
    for path, _ in sorted(problems, key=lambda p: len(p[0]), reverse=True):
        _remove_key(remainder, path)
    try:
        rest = find_problems(_parse_config(remainder, constants))
    except ValidationError:
        rest = []
    wrong = [path for path, _ in problems]
    return None, problems + [
        p for p in rest if not any(_is_ancestor_or_descendant(p[0], w) for w in wrong)
    ]


def _parse_config(data: dict[str, Any], constants: dict[str, float]) -> Config:
    """Return the config of YAML data, with the constants already evaluated."""
    if isinstance(data.get("constants"), dict):
        data = {**data, "constants": constants}
    return Config.model_validate(data, context={"constants": constants})


def _merge_by_key(problems: list[Problem]) -> list[Problem]:
    """Return one problem for each key; pydantic gives one for each member of a union that does not fit."""
    found: dict[Key, list[str | UnknownNameError]] = {}
    for path, message in problems:
        found.setdefault(path, []).append(message)
    return [
        (
            path,
            messages[0] if len(messages) == 1 else " Or: ".join(dict.fromkeys(map(str, messages))),
        )
        for path, messages in found.items()
    ]


def _is_ancestor_or_descendant(a: Key, b: Key) -> bool:
    """Return whether one of two keys lies within the other."""
    short = min(len(a), len(b))
    return a[:short] == b[:short]


def _remove_key(data: Any, path: Key) -> None:
    """Remove a key from nested data, if it is there."""
    for step in path[:-1]:
        try:
            data = data[step]
        except (KeyError, IndexError, TypeError):
            return
    if path and isinstance(data, dict):
        data.pop(path[-1], None)


def _describe_entry(entry: Any, data: Any, kind: type[Section] = Config) -> Problem:
    """Return the key and the message of one of pydantic's errors."""
    path = _strip_union_steps(entry["loc"], data, kind)
    owner, key = _find_section(path[:-1], kind, data), path[-1] if path else ""
    if entry["type"] == "extra_forbidden" and owner is not None:
        advice = FORMER_KEYS.get(path) or KEYS_ELSEWHERE.get((path[0], key))
        return path, advice or UnknownNameError("key", str(key), owner.model_fields)
    if entry["type"].startswith("union_tag"):
        return _describe_tag(entry, path)
    meaning = ""
    if owner is not None and isinstance(key, str) and key in owner.model_fields:
        meaning = owner.model_fields[key].description or ""
    if entry["type"] == "missing":
        return path, f"is missing. It says: {meaning}" if meaning else "is missing"
    cause = entry.get("ctx", {}).get("error")
    if isinstance(cause, UnknownNameError):
        return path, cause
    message = entry["msg"].removeprefix("Value error, ").replace(" after validation", "")
    if entry["type"] == "model_type":
        message = "input should be a section with keys of its own"
    if entry["type"] == "string_pattern_mismatch":
        message = "a name starts with a letter or digit and goes on with those, _, - or dots"
    given = entry["input"]
    if not isinstance(given, dict | list) and entry["type"] != "value_error":
        message = f"{message[0].lower()}{message[1:]}, not {given!r}"
    return path, f"{message.rstrip('.')}." + (f" It says: {meaning}" if meaning else "")


def _describe_tag(entry: Any, path: Key) -> Problem:
    """Return the key and the message where a section does not say of which type it is, or says an unknown one."""
    context = entry["ctx"]
    key = context["discriminator"].strip("'")
    if entry["type"] == "union_tag_not_found":
        return (*path, key), "is missing"
    types = [tag.strip(" '") for tag in context["expected_tags"].split(",")]
    return (*path, key), UnknownNameError(key, context["tag"], types)


def _strip_union_steps(location: Iterable[str | int], data: Any, kind: type[Section]) -> Key:
    """Return pydantic's location without the steps that name a member of a union."""
    path: list[str | int] = []
    steps, whole = list(location), data
    for k, step in enumerate(steps):
        last = k == len(steps) - 1
        if isinstance(data, dict) and (step in data or (last and isinstance(step, str))):
            is_member = data.get("type") == step or _find_section(tuple(path), kind, whole) is None
            if step not in data and is_member:
                continue
            path.append(step)
            data = data.get(str(step))
        elif isinstance(data, list) and isinstance(step, int) and step < len(data):
            path.append(step)
            data = data[step]
    return tuple(path)


def _find_section(path: Key, kind: type[Section], data: Any) -> type[BaseModel] | None:
    """Return the section of a schema that a path leads to, or None.

    Args:
        path: Keys of the path.
        kind: Section that the path begins in.
        data: Data of this section; where sections have types, the data say which one is meant.
    """
    annotation: Any = kind
    for step in path:
        if isinstance(annotation, type) and issubclass(annotation, BaseModel):
            field = annotation.model_fields.get(str(step))
            if field is None:
                return None
            data = data.get(step) if isinstance(data, dict) else None
            annotation = _unwrap(field.annotation, data)
        elif get_origin(annotation) in (list, dict):
            data = _get_item(data, step)
            annotation = _unwrap(get_args(annotation)[-1], data)
        else:
            return None
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    return None


def _get_item(data: Any, step: str | int) -> Any:
    """Return an item of a mapping or a list, None if there is no such item."""
    try:
        return data[step]
    except (KeyError, IndexError, TypeError):
        return None


def _unwrap(annotation: Any, data: Any) -> Any:
    """Return the part of an optional or annotated type that can hold keys; of sections with types that of the data."""
    if hasattr(annotation, "__metadata__"):
        return _unwrap(annotation.__origin__, data)
    if get_origin(annotation) in (Union, UnionType):
        members = [_unwrap(a, data) for a in get_args(annotation) if a is not type(None)]
        sections = [a for a in members if isinstance(a, type) and issubclass(a, BaseModel)]
        meant = [a for a in sections if _has_type(a, data)]
        return (meant or sections or members or [annotation])[0]
    return annotation


def _has_type(section: type[BaseModel], data: Any) -> bool:
    """Return whether a section is of the type that data say."""
    field = section.model_fields.get("type")
    named = data.get("type") if isinstance(data, dict) else None
    return field is not None and named in get_args(field.annotation)


def _format_problem(document: Document, problem: Problem) -> str:
    """Return a problem as a line with file, line and key."""
    path, message = problem[0], str(problem[1])
    end = "" if message.rstrip().endswith((".", "?")) else "."
    key = document.find_original(path)
    return f"{document.describe_place(path)}: {prepend_key(key, message)}{end}"


def _choose_use(config: Config) -> Config:
    """Return the config with the purpose of the selected model, simulation if samples are simulated."""
    if config.selected.use is not None:
        return config
    use = "feed-forward" if config.sampling.simulation is None else "simulation"
    return config.model_copy(update={"selected": config.selected.model_copy(update={"use": use})})


def _list_groups(config: Config) -> Config:
    """Return the config with the groups of the uses of subsystems, where it asks for them."""
    if config.reduction.groups != "auto":
        return config
    reduction = config.reduction.model_copy(update={"groups": group_uses(config)})
    return config.model_copy(update={"reduction": reduction})


def _drop_unused_tests(config: Config) -> Config:
    """Return the config without the default test trajectories if a recording is the test set."""
    defaults = {"test_count": 0, "test_point_to_point_count": 0}
    update = {k: n for k, n in defaults.items() if k not in config.trajectories.model_fields_set}
    if config.sampling.test_file is None or not update:
        return config
    trajectories = config.trajectories.model_copy(update=update)
    return config.model_copy(update={"trajectories": trajectories})


def _resolve_paths(config: Config, folder: Path) -> Config:
    """Return the config with file names resolved against the folder of the config."""

    def resolve(section: Any, *names: str) -> Any:
        """Return a section with some of its paths resolved."""
        found = {name: getattr(section, name) for name in names}
        update = {name: folder / path for name, path in found.items() if path is not None}
        return section.model_copy(update=update)

    sampling = resolve(config.sampling, "estimation_file", "validation_file", "test_file")
    if sampling.log is not None:
        log = sampling.log
        files = {"files": [[folder / path for path in parts] for parts in log.training_files]}
        if others := log.held_out_files:
            files["held_out"] = [[folder / path for path in parts] for parts in others]
        log = sampling.log.model_copy(update=files)
        sampling = sampling.model_copy(update={"log": log})
    if sampling.simulation is not None:
        simulation = sampling.simulation
        motions = {name: resolve(motion, "file") for name, motion in simulation.motions.items()}
        road = None if simulation.road is None else resolve(simulation.road, "file")
        simulation = simulation.model_copy(update={"motions": motions, "road": road})
        sampling = sampling.model_copy(update={"simulation": simulation})
    return config.model_copy(
        update={
            "trajectories": resolve(config.trajectories, "file"),
            "sampling": sampling,
            "source": None if config.source is None else resolve(config.source, "file"),
        }
    )
