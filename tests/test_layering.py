"""Imports point down; the walk is over the source, nothing is run."""

import ast
from pathlib import Path

import pytest

import paramreduce_cli

PACKAGE = Path(paramreduce_cli.__file__).parent
LAYERS = [
    {"cli", "__main__"},
    {"workflow", "runner"},
    {"pipeline"},
    {"stages", "artifacts"},
    {"config", "robots", "excitation", "reduction", "lean", "export", "report"},
    {"multibody"},
    {"expressions"},
    {"records"},
    {"registry"},
    {"errors"},
]
LEVEL = {name: k for k, names in enumerate(LAYERS) for name in names}
SAME_LAYER = {("__main__", "cli")}
FILES = sorted(p for p in PACKAGE.rglob("*.py") if p.parent != PACKAGE or p.stem != "__init__")


def room(path):
    return path.relative_to(PACKAGE).parts[0].removesuffix(".py")


def imported_rooms(path):
    for node in ast.walk(ast.parse(path.read_text())):
        names = []
        if isinstance(node, ast.ImportFrom) and node.module:
            names = [node.module]
            if node.module == "paramreduce_cli":
                names = [f"paramreduce_cli.{alias.name}" for alias in node.names]
        elif isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        for name in names:
            parts = name.split(".")
            if parts[0] == "paramreduce_cli" and len(parts) > 1 and parts[1] != "__version__":
                yield parts[1]


@pytest.mark.parametrize("path", FILES, ids=lambda p: str(p.relative_to(PACKAGE)))
def test_imports_point_down(path):
    own = room(path)
    for other in imported_rooms(path):
        allowed = other == own or LEVEL[other] > LEVEL[own] or (own, other) in SAME_LAYER
        assert allowed, f"{own} imports {other}"


def modules_importing(name):
    return {
        room(path)
        for path in FILES
        for node in ast.walk(ast.parse(path.read_text()))
        if (isinstance(node, ast.Import) and any(a.name.split(".")[0] == name for a in node.names))
        or (isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == name)
    }


@pytest.mark.parametrize(
    ("library", "owner"), [("h5py", "artifacts"), ("yaml", "config"), ("click", "cli")]
)
def test_each_kind_of_input_and_output_has_one_place(library, owner):
    assert modules_importing(library) == {owner}


def test_nothing_but_the_command_line_prints():
    for path in FILES:
        calls = [n for n in ast.walk(ast.parse(path.read_text())) if isinstance(n, ast.Call)]
        printing = [c for c in calls if isinstance(c.func, ast.Name) and c.func.id == "print"]
        assert not printing, path


def test_no_robot_has_a_name_in_the_package():
    for path in [*FILES, *PACKAGE.rglob("*.html")]:
        text = path.read_text().lower()
        code = text.replace("configs/puma560.yaml", "").replace("results/puma560", "")
        code = code.replace("results/hexaglide", "")
        code = code.replace("reference/puma560", "")
        assert "puma" not in code, path
        assert "hexaglide" not in code, path
