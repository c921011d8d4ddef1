"""YAML with the line of every key, so that errors can name the line."""

from dataclasses import dataclass, field
from typing import Any

import yaml

from paramreduce_cli.errors import Key

_DEEPEST = 50
_MOST_TEXT = 1_000_000
"""Characters; a config of a hundred bodies has a hundred thousand."""
_MOST_VALUES = 20_000
"""Most values of a config, as often as aliases repeat them."""
_LARGEST_INTEGER = 2**53
"""Beyond it an integer is no exact number of a computer's arithmetic."""
_SHOWN = 60
"""Characters of a value in a message."""
_LOADER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
"""The one in C, ten times as fast, where PyYAML was built with it."""
_UNREADABLE = (ValueError, LookupError, AttributeError, TypeError, OverflowError)
"""What PyYAML raises where a value does not fit the tag it is given."""


@dataclass
class Document:
    """A YAML file as plain data, with the line of each part."""

    source: str
    data: Any
    lines: dict[Key, int] = field(default_factory=dict)
    problems: list[tuple[int, str]] = field(default_factory=list)
    """(line, message) of what YAML allows but a config must not hold."""
    unread: set[Key] = field(default_factory=set)
    """Keys whose values are None for one of these problems."""
    overrides: dict[Key, str] = field(default_factory=dict)
    """Keys set on the command line, with the text given there."""
    own_keys: dict[int, set[int]] = field(default_factory=dict)
    """Identities of the keys of each mapping that are not merged into it, by the identity of its node."""
    originals: dict[Key, Key] = field(default_factory=dict)
    """Keys of parts that were copied, with the keys that they were copied from."""

    def find_original(self, path: Key) -> Key:
        """Return the key that a key was copied from, or the key itself."""
        for end in range(len(path), 0, -1):
            if path[:end] in self.originals:
                return (*self.originals[path[:end]], *path[end:])
        return path

    def describe_place(self, path: Key) -> str:
        """Return file and line of a key, or of its nearest ancestor in the file; ``--set ...`` if the command line gave
        the key.
        """
        for end in range(len(path), -1, -1):
            if path[:end] in self.overrides:
                return f"--set {self.overrides[path[:end]]}"
            if path[:end] in self.lines:
                return f"{self.source}, line {self.lines[path[:end]]}"
            above = [
                text for key, text in self.overrides.items() if end and key[:end] == path[:end]
            ]
            if above:  # what is set is below, and there was nothing before
                return f"--set {above[0]}"
        return self.source


def read_yaml(text: str, source: str) -> Document:
    """Parse YAML text.

    Args:
        text: The text.
        source: Name of the source, for messages.

    Raises:
        yaml.YAMLError: It is not YAML.
    """
    if len(text) > _MOST_TEXT:
        raise yaml.YAMLError(f"it has {len(text)} characters, which is more than a config needs")
    _check_depth(text)
    loader = _LOADER(text)
    try:
        node = loader.get_single_node()
        document = Document(source, None)
        if node is not None:
            if _count_values(node, {}, 0) > _MOST_VALUES:
                raise yaml.YAMLError(
                    f"it holds more than {_MOST_VALUES} values, aliases written out"
                )
            document.data = _build_data(loader, node, (), document)
        return document
    except RecursionError as error:
        raise yaml.YAMLError(_TOO_DEEP) from error
    finally:
        loader.dispose()


_TOO_DEEP = "it refers to itself, or is nested too deep"


def _check_depth(text: str) -> None:
    """Raise an error for deeply nested YAML before it is parsed; parsing takes one stack level per nesting."""
    depth = 0
    for event in yaml.parse(text, _LOADER):
        if isinstance(event, yaml.CollectionStartEvent):
            depth += 1
        elif isinstance(event, yaml.CollectionEndEvent):
            depth -= 1
        if depth > _DEEPEST:
            raise yaml.YAMLError(_TOO_DEEP)


def _count_values(node: yaml.Node, counts: dict[int, int], depth: int) -> int:
    """Return the number of values in a YAML node, where an aliased node counts as often as it is used."""
    if depth > _DEEPEST:
        raise yaml.YAMLError(_TOO_DEEP)
    if id(node) not in counts:
        inner = node.value if isinstance(node, yaml.CollectionNode) else []
        if isinstance(node, yaml.MappingNode):
            inner = [part for pair in node.value for part in pair]
        counts[id(node)] = 1 + sum(_count_values(part, counts, depth + 1) for part in inner)
    return counts[id(node)]


def _build_data(loader: yaml.SafeLoader, node: yaml.Node, path: Key, document: Document) -> Any:
    """Return the plain data of a node, and note the lines of its keys in the document."""
    document.lines.setdefault(path, node.start_mark.line + 1)
    if isinstance(node, yaml.MappingNode):
        # An aliased mapping is read again, with the keys that were merged into it at first.
        own = document.own_keys.setdefault(id(node), {id(key) for key, _ in node.value})
        met: set[str] = set()
        loader.flatten_mapping(node)
        result: dict[str, Any] = {}
        for key_node, value_node in node.value:
            key = str(key_node.value)
            line = key_node.start_mark.line + 1
            if key in met:
                first = document.lines[(*path, key)]
                message = f"key {key} stands here again; it is already on line {first}"
                document.problems.append((line, message))
            if id(key_node) in own:
                met.add(key)
            document.lines[(*path, key)] = line
            result[key] = _build_data(loader, value_node, (*path, key), document)
        return result
    if isinstance(node, yaml.SequenceNode):
        return [
            _build_data(loader, item, (*path, k), document) for k, item in enumerate(node.value)
        ]
    line = node.start_mark.line + 1
    shown = repr(node.value if len(node.value) <= _SHOWN else f"{node.value[:_SHOWN]}...")
    try:
        value = loader.construct_object(node, deep=True)
    except _UNREADABLE as error:
        kind = node.tag.rpartition(":")[2]
        reason = error if isinstance(error, ValueError) else f"it is no {kind}"
        document.problems.append((line, f"{shown} cannot be read: {reason}"))
        document.unread.add(path)
        return None
    if isinstance(value, int) and abs(value) > _LARGEST_INTEGER:
        document.problems.append((line, f"{shown} is too large"))
        document.unread.add(path)
        return None
    return value


def apply_override(document: Document, text: str) -> None:
    """Apply ``key.key=value`` as given on the command line.

    Raises:
        ValueError: The text is not of that form, or leads through something that has no keys.
    """
    key, separator, value = text.partition("=")
    if not separator or not key.strip():
        raise ValueError(f"--set {text}: write KEY=VALUE, such as trajectories.count=3")
    try:
        given = read_yaml(value, "")
    except yaml.YAMLError as error:
        raise ValueError(f"--set {text}: the value is not YAML") from error
    if given.problems:
        raise ValueError(f"--set {text}: {given.problems[0][1]}")
    steps: list[str | int] = []
    where = document.data
    names = key.strip().split(".")
    for k, name in enumerate(names):
        step: str | int = name
        if isinstance(where, list):
            if not name.isdigit() or int(name) >= len(where):
                raise ValueError(f"--set {text}: {'.'.join(names[:k])} has no item {name}")
            step = int(name)
        elif not isinstance(where, dict):
            raise ValueError(f"--set {text}: {'.'.join(names[:k])} has no keys of its own")
        steps.append(step)
        if k == len(names) - 1:
            where[step] = given.data
        else:
            if isinstance(where, dict) and where.get(name) is None:
                where[step] = {}
            where = where[step]
    document.overrides[tuple(steps)] = text
