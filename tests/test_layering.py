"""Imports point down; the walk is over the source, nothing is run."""

import ast
import json
import re
import subprocess
import sys
from pathlib import Path

import pytest

import paramreduce_cli

PACKAGE = Path(paramreduce_cli.__file__).parent
LAYERS = [
    {"cli", "__main__"},
    {"workflow", "runner"},
    {"pipeline"},
    {"stages"},
    {"judgement", "artifacts", "tracking", "export", "report"},
    {"excitation", "reduction", "lean"},
    {"multibody"},
    {"expressions"},
    {"config"},
    {"robots"},
    {"fields"},
    {"records"},
    {"registry", "texts"},
    {"errors"},
]
LEVEL = {name: k for k, names in enumerate(LAYERS) for name in names}
SAME_LAYER = {("__main__", "cli")}
FILES = sorted(p for p in PACKAGE.rglob("*.py") if p.parent != PACKAGE or p.stem != "__init__")
LIGHT = ("casadi", "numba", "matplotlib", "scipy", "h5py")
"""Libraries that reading a config does without."""


def room(path):
    return path.relative_to(PACKAGE).parts[0].removesuffix(".py")


def imported_rooms(path):
    """Rooms that a file names in imports, early or late, or in a text such as import_module takes."""
    for node in ast.walk(ast.parse(path.read_text())):
        names = []
        if isinstance(node, ast.ImportFrom) and node.module:
            names = [node.module]
            if node.module == "paramreduce_cli":
                names = [f"paramreduce_cli.{alias.name}" for alias in node.names]
        elif isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.Constant) and re.fullmatch(MODULE, str(node.value)):
            names = [node.value]
        for name in names:
            parts = name.split(".")
            if parts[0] == "paramreduce_cli" and len(parts) > 1 and parts[1] != "__version__":
                yield parts[1]


MODULE = r"paramreduce_cli(\.\w+)+"


@pytest.mark.parametrize("path", FILES, ids=lambda p: str(p.relative_to(PACKAGE)))
def test_imports_point_down(path):
    own = room(path)
    for other in imported_rooms(path):
        allowed = other == own or LEVEL[other] > LEVEL[own] or (own, other) in SAME_LAYER
        assert allowed, f"{own} imports {other}"


def calls(path, name):
    nodes = [n for n in ast.walk(ast.parse(path.read_text())) if isinstance(n, ast.Call)]
    return [n for n in nodes if getattr(n.func, "id", getattr(n.func, "attr", "")) == name]


@pytest.mark.parametrize("path", FILES, ids=lambda p: str(p.relative_to(PACKAGE)))
def test_what_is_imported_by_name_is_of_the_own_room(path):
    """Registries are made by their rooms alone, and nothing else imports by name."""
    for call in calls(path, "Registry"):
        assert path.name == "__init__.py"
        assert getattr(call.args[1], "id", None) == "__name__"
    assert not calls(path, "import_module") or path.name == "registry.py"
    assert not calls(path, "__import__")


def test_reading_a_config_loads_no_numerics():
    """Names on offer are listed without importing what they stand for."""
    script = (
        "import json, sys; from paramreduce_cli.config import config_schema; config_schema(); "
        "print(json.dumps(sorted(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, check=True)
    loaded = set(json.loads(done.stdout))
    assert not loaded & set(LIGHT)
    ours = {name.split(".")[1] for name in loaded if name.startswith("paramreduce_cli.")}
    assert min(LEVEL[name] for name in ours) == LEVEL["config"]


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
