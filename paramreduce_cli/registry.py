"""Names to functions: everything that is chosen by name in a config or at the shell.

What a room offers are the files in its folder: ``forward_selection.py`` holds the function
``forward_selection`` and is called forward-selection. So a new file is all it takes to add one,
and names can be listed without importing what they stand for.
"""

import ast
import importlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

_PACKAGE = Path(__file__).parent


def offered(folder: str) -> tuple[str, ...]:
    """Public names in a folder of the package, such as ``reduction/heuristics``; nothing is imported.

    Raises:
        ValueError: There is no such folder.
    """
    files = _files(_PACKAGE / folder)
    if not files:
        raise ValueError(f"{folder} offers nothing")
    return tuple(files)


def _files(folder: Path) -> dict[str, Path]:
    """Files by the names they offer; folders inside belong to it."""
    found = sorted(path for path in folder.rglob("*.py") if not path.stem.startswith("_"))
    return {path.stem.replace("_", "-"): path for path in found}


class Registry:
    """The functions that a room offers, by their public names.

    A room makes it in its ``__init__``, so that it imports no files but its own.

    Args:
        kind: What its entries are, for messages.
        room: Name of the package whose ``__init__`` makes it.
    """

    def __init__(self, kind: str, room: str) -> None:
        self.kind = kind
        self._files = _files(_PACKAGE.joinpath(*room.split(".")[1:]))

    def __getitem__(self, name: str) -> Any:
        path = self._files[name].relative_to(_PACKAGE.parent).with_suffix("")
        return getattr(importlib.import_module(".".join(path.parts)), path.stem)

    def __iter__(self) -> Iterator[str]:
        return iter(self._files)

    def __contains__(self, name: object) -> bool:
        return name in self._files

    def __len__(self) -> int:
        return len(self._files)

    def summary(self, name: str) -> str:
        """First line of a function's docstring; its file is read, not imported."""
        path = self._files[name]
        functions = (
            node
            for node in ast.parse(path.read_text(encoding="utf-8")).body
            if isinstance(node, ast.FunctionDef) and node.name == path.stem
        )
        return (ast.get_docstring(next(functions)) or "").partition("\n")[0]

    def items(self) -> list[tuple[str, Any]]:
        """Names with their functions."""
        return [(name, self[name]) for name in self]
