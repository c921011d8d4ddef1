"""YAML with the line of every key, so that errors can point at them."""

from dataclasses import dataclass, field
from typing import Any

import yaml

from paramreduce_cli.errors import Key

_DEEPEST = 50


@dataclass
class Document:
    """Plain data with where each part of it stands."""

    source: str
    data: Any
    lines: dict[Key, int] = field(default_factory=dict)
    problems: list[tuple[int, str]] = field(default_factory=list)
    """(line, message) of what YAML allows but a config must not hold."""
    overrides: dict[Key, str] = field(default_factory=dict)
    """Keys set on the command line, with the text given there."""

    def place(self, path: Key) -> str:
        """Where a key stands, or its nearest ancestor that is written down."""
        for end in range(len(path), -1, -1):
            if path[:end] in self.overrides:
                return f"--set {self.overrides[path[:end]]}"
            if path[:end] in self.lines:
                return f"{self.source}, line {self.lines[path[:end]]}"
        return self.source


def read_yaml(text: str, source: str) -> Document:
    """Parse YAML text.

    Args:
        text: The text.
        source: Its name in messages.

    Raises:
        yaml.YAMLError: It is not YAML.
    """
    loader = yaml.SafeLoader(text)
    try:
        node = loader.get_single_node()
        document = Document(source, None)
        if node is not None:
            document.data = _build(loader, node, (), document)
        return document
    finally:
        loader.dispose()


def _build(loader: yaml.SafeLoader, node: yaml.Node, path: Key, document: Document) -> Any:
    if len(path) > _DEEPEST:
        raise yaml.YAMLError("it refers to itself, or is nested too deep")
    document.lines.setdefault(path, node.start_mark.line + 1)
    if isinstance(node, yaml.MappingNode):
        own = {id(key) for key, _ in node.value}
        loader.flatten_mapping(node)
        result: dict[str, Any] = {}
        for key_node, value_node in node.value:
            key = str(key_node.value)
            line = key_node.start_mark.line + 1
            if key in result and id(key_node) in own:
                first = document.lines[(*path, key)]
                if first != line:
                    message = f"key {key} stands here again; it is already on line {first}"
                    document.problems.append((line, message))
            document.lines[(*path, key)] = line
            result[key] = _build(loader, value_node, (*path, key), document)
        return result
    if isinstance(node, yaml.SequenceNode):
        return [_build(loader, item, (*path, k), document) for k, item in enumerate(node.value)]
    try:
        return loader.construct_object(node, deep=True)
    except ValueError as error:
        line = node.start_mark.line + 1
        document.problems.append((line, f"{node.value!r} cannot be read: {error}"))
        return None


def apply_override(document: Document, text: str) -> None:
    """Apply ``key.key=value`` as given on the command line.

    Raises:
        ValueError: The text is not of that form, or leads through something that has no keys.
    """
    key, separator, value = text.partition("=")
    if not separator or not key.strip():
        raise ValueError(f"--set {text}: write KEY=VALUE, such as trajectories.count=3")
    try:
        parsed = yaml.safe_load(value)
    except yaml.YAMLError as error:
        raise ValueError(f"--set {text}: the value is not YAML") from error
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
            where[step] = parsed
        else:
            if isinstance(where, dict) and where.get(name) is None:
                where[step] = {}
            where = where[step]
    document.overrides[tuple(steps)] = text
