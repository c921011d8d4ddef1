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
    {"cli", "__main__", "api"},
    {"running"},
    {"stages"},
    {"judgement", "artifacts", "export", "report"},
    {"motion", "terms"},
    {"excitation", "identification", "reduction", "lean"},
    {"multibody"},
    {"expressions"},
    {"importing"},
    {"config"},
    {"robots"},
    {"fields", "resources"},
    {"records"},
    {"registry", "texts"},
    {"errors"},
]
LEVEL = {name: k for k, names in enumerate(LAYERS) for name in names}
SAME_LAYER = {("__main__", "cli")}
FILES = sorted(p for p in PACKAGE.rglob("*.py") if p.parent != PACKAGE or p.stem != "__init__")
TREES = {path: ast.parse(path.read_text()) for path in FILES}
each_file = pytest.mark.parametrize("path", FILES, ids=lambda p: str(p.relative_to(PACKAGE)))
MODULE = r"paramreduce_cli(\.\w+)+"
LIGHT = ("casadi", "numba", "matplotlib", "scipy", "h5py")
"""Libraries that reading a config does without."""


def room(path):
    return path.relative_to(PACKAGE).parts[0].removesuffix(".py")


def imports(path):
    """Modules that a file imports, early or late, with the names it takes from them."""
    for node in ast.walk(TREES[path]):
        if isinstance(node, ast.ImportFrom) and node.module:
            yield from (f"{node.module}.{alias.name}" for alias in node.names)
        elif isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)


@each_file
def test_imports_point_down(path):
    """Imports, and texts such as import_module takes."""
    own = room(path)
    texts = (n.value for n in ast.walk(TREES[path]) if isinstance(n, ast.Constant))
    named = (text for text in map(str, texts) if re.fullmatch(MODULE, text))
    for package, other, *_ in (name.split(".") for name in (*imports(path), *named) if "." in name):
        if package == "paramreduce_cli" and other != "__version__":
            allowed = other == own or LEVEL[other] > LEVEL[own] or (own, other) in SAME_LAYER
            assert allowed, f"{own} imports {other}"


def calls(path, name):
    nodes = [n for n in ast.walk(TREES[path]) if isinstance(n, ast.Call)]
    return [n for n in nodes if getattr(n.func, "id", getattr(n.func, "attr", "")) == name]


@each_file
def test_what_is_imported_by_name_is_of_the_own_room(path):
    """Rooms alone make registries; nothing else imports by name, and nothing prints."""
    for call in calls(path, "Registry"):
        assert path.name == "__init__.py"
        assert getattr(call.args[1], "id", None) == "__name__"
    assert not calls(path, "import_module") or path.name == "registry.py"
    assert not calls(path, "__import__")
    assert not [call for call in calls(path, "print") if isinstance(call.func, ast.Name)]


def modules_after(script):
    script = f"import json, sys\n{script}\nprint(json.dumps(sorted(sys.modules)), file=sys.stderr)"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, check=True)
    return set(json.loads(done.stderr.splitlines()[-1]))


@pytest.mark.parametrize(
    ("arguments", "heavy"),
    [
        (["--version"], {*LIGHT, "numpy"}),
        (["--help"], {*LIGHT, "numpy"}),
        (["init", "--help"], LIGHT),
        (["inspect", "{file}"], set(LIGHT) - {"h5py"}),
    ],
)
def test_what_needs_no_numerics_loads_none(two_link_results, arguments, heavy):
    arguments = [text.format(file=two_link_results / "model.h5") for text in arguments]
    script = f"""
from paramreduce_cli.cli import main
sys.argv[1:] = {arguments}
try:
    main()
except SystemExit as stopped:
    assert stopped.code == 0
"""
    assert not modules_after(script) & set(heavy)


def test_what_stages_need_seldom_is_loaded_when_they_do():
    """Half of the time until a stage begins was that of loading these."""
    loaded = modules_after(
        "from paramreduce_cli.running.pipeline import list_stages; list_stages()"
    )
    assert not loaded & {"scipy.signal", "scipy.stats", "matplotlib", "jinja2"}


def test_reading_a_config_loads_no_numerics():
    """Names on offer are listed without importing what they stand for."""
    loaded = modules_after("from paramreduce_cli.config import get_schema; get_schema()")
    assert not loaded & set(LIGHT)
    ours = {name.split(".")[1] for name in loaded if name.startswith("paramreduce_cli.")}
    assert min(LEVEL[name] for name in ours) == LEVEL["config"]


@pytest.mark.parametrize(
    ("library", "owner"), [("h5py", "artifacts"), ("yaml", "config"), ("click", "cli")]
)
def test_each_kind_of_input_and_output_has_one_place(library, owner):
    importing = {path for path in FILES for name in imports(path) if name.split(".")[0] == library}
    assert set(map(room, importing)) == {owner}


def test_no_robot_has_a_name_in_the_package():
    allowed = (
        r"--example puma560|configs/puma560\.yaml|results/(puma560|hexaglide)|reference/puma560"
    )
    for path in [*FILES, *PACKAGE.rglob("*.html")]:
        code = re.sub(allowed, "", path.read_text().lower())
        assert not re.search("puma|hexaglide", code), path
