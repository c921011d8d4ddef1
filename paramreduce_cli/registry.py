"""Registries: functions that a config or a command chooses by name.

A subpackage offers the files in its folder: ``forward_selection.py`` holds the function
``forward_selection`` and is called forward-selection. So a new file is all it takes to add one,
and names can be listed without importing what they stand for.
"""

import ast
import importlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

_PACKAGE = Path(__file__).parent


def list_names(folder: str) -> tuple[str, ...]:
    """Return the public names of a folder of the package, such as ``reduction/heuristics``, without importing anything.

    Raises:
        ValueError: There is no such folder.
    """
    files = _find_files(_PACKAGE / folder)
    if not files:
        raise ValueError(f"{folder} offers nothing")
    return tuple(files)


def _find_files(folder: Path) -> dict[str, Path]:
    """Return the files of a folder and its subfolders by public name."""
    found = sorted(path for path in folder.rglob("*.py") if not path.stem.startswith("_"))
    return {path.stem.replace("_", "-"): path for path in found}


class Registry:
    """The functions of a subpackage by public name, each imported when it is first asked for.

    A subpackage makes its registry in its ``__init__``, so that it imports no other files.

    Args:
        kind: Kind of the entries, for messages.
        package: Name of the subpackage whose ``__init__`` makes the registry.
    """

    def __init__(self, kind: str, package: str) -> None:
        self.kind = kind
        self._files = _find_files(_PACKAGE.joinpath(*package.split(".")[1:]))

    def __getitem__(self, name: str) -> Any:
        if name not in self._files:
            raise KeyError(f"unknown {self.kind} {name!r}. Choose from: {', '.join(self._files)}")
        path = self._files[name].relative_to(_PACKAGE.parent).with_suffix("")
        return getattr(importlib.import_module(".".join(path.parts)), path.stem)

    def __iter__(self) -> Iterator[str]:
        return iter(self._files)

    def __contains__(self, name: object) -> bool:
        return name in self._files

    def __len__(self) -> int:
        return len(self._files)

    def read_summary(self, name: str) -> str:
        """Return the first line of a function's docstring, read from its file without an import."""
        path = self._files[name]
        functions = (
            node
            for node in ast.parse(path.read_text(encoding="utf-8")).body
            if isinstance(node, ast.FunctionDef) and node.name == path.stem
        )
        return (ast.get_docstring(next(functions)) or "").partition("\n")[0]

    def items(self) -> list[tuple[str, Any]]:
        """Return all names with their functions."""
        return [(name, self[name]) for name in self]
