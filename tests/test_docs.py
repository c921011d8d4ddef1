"""Whether the docs name everything there is."""

import importlib.util
import inspect
import json
import re
import shlex
import shutil
import subprocess
import textwrap

import click
import h5py
import pytest
import yaml
from conftest import ROOT, model_of
from pydantic import ValidationError

from paramreduce_cli import api
from paramreduce_cli.cli import cli
from paramreduce_cli.config import load_config
from paramreduce_cli.config.loading import get_schema
from paramreduce_cli.config.term_settings import TermsSection
from paramreduce_cli.export.code_generation import make_exported_model
from paramreduce_cli.export.languages import languages
from paramreduce_cli.export.named_models import find_chosen_model
from paramreduce_cli.fields.section import Section
from paramreduce_cli.running.sweep import SweepSection

DOCS = ROOT / "docs"
ENDINGS = r"(_(joint|estimation|validation|inverse|direct|plain|paper_rule|training|held_out))+$"
"""Of names that stand once, with braces or dots, for several."""


@pytest.fixture(scope="module")
def generated():
    spec = importlib.util.spec_from_file_location("generated", DOCS / "generated.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def schema_keys(schema):
    """Every key of every section, by brute force."""
    for section in (schema, *schema["$defs"].values()):
        yield from section.get("properties", {})


def test_every_key_of_a_config_is_on_its_page(generated):
    page = generated.config_page()
    rows = [
        re.split(r"(?<!\\)\|", line)[1:-1] for line in page.splitlines() if line.startswith("| `")
    ]
    assert sorted(row[0].strip(" `") for row in rows) == sorted(schema_keys(get_schema()))
    for key, takes, about in rows:
        kind = takes.split("<br>")[0]
        text, _, example = about.partition("<br>*Example*: ")
        assert text.strip(), key
        assert example.strip(), key
        if (
            re.search(r"\b(rad|kg|Hz|N m)\b", text)
            and "one of" not in kind
            and "offset" not in text
        ):
            assert re.search(r", (rad|m|kg|s|Hz|N m|W|1/s)\b", kind), (key, text)
    assert len(generated.keys()) == len(set(generated.keys())) == len(rows)


def test_every_function_is_on_its_page_with_what_it_takes(generated):
    page = generated.python_page()
    for name in api.__all__:
        text = page.split(f"\n## {name}\n")[1].split("\n## ")[0]
        thing = getattr(api, name)
        assert inspect.cleandoc(thing.__doc__).split("\n")[0].replace("``", "`") in text
        if inspect.isfunction(thing):
            assert f"pr.{name}(" in text
            described = re.findall(r"^    (\w+):", inspect.cleandoc(thing.__doc__), re.MULTILINE)
            assert all(f"- `{one}`: " in text for one in described)


def test_the_notebook_is_a_page(generated):
    page = generated.notebook_page()
    cells = json.loads((DOCS / "tutorial.ipynb").read_text())["cells"]
    assert page.count("```python") == sum(cell["cell_type"] == "code" for cell in cells)
    assert all("".join(cell["source"]).strip() in page for cell in cells)


@pytest.mark.parametrize("path", sorted((DOCS / "keys").glob("*.yaml")), ids=lambda p: p.stem)
def test_examples_of_keys_are_configs(path):
    load_config(path)


def test_every_command_and_option_is_on_its_page(generated):
    page = generated.commands_page()
    for name in cli.list_commands(None):
        text = page.split(f"## {name}\n")[1].split("\n## ")[0]
        for parameter in cli.get_command(None, name).params:
            word = parameter.opts[0] if parameter.opts[0].startswith("-") else parameter.make_metavar(None)  # fmt: skip
            assert word.strip("[]") in text, (name, word)


def test_every_dataset_is_described(generated, two_link_results, measured_results):
    pages = ("artifacts.md", "artifacts-logs.md")
    text = "".join((DOCS / page).read_text() for page in pages) + generated.records_page()
    unknown = set()
    files = [*two_link_results.glob("*.h5"), *(measured_results / "results").glob("*.h5")]
    assert len(files) >= 10

    def look(name, item):
        leaf = re.sub(ENDINGS, "", name.rpartition("/")[2])
        if (
            isinstance(item, h5py.Dataset)
            and not leaf.isdecimal()
            and not re.search(rf"(\b|_){re.escape(leaf)}(\b|_)", text)
        ):
            unknown.add(f"{path.name}: {re.sub(ENDINGS, '', name)}")

    for path in files:
        with h5py.File(path) as file:
            file.visititems(look)
    assert "\n".join(sorted(unknown)) == ""


def test_links_lead_somewhere(generated):
    for page in DOCS.glob("*.md"):
        text = re.sub(r"```.*?```", "", page.read_text(), flags=re.DOTALL)
        for link in re.findall(r"\]\(([^)#]+)[^)]*\)", text):
            made = link in generated.PAGES
            assert made or link.startswith("http") or (page.parent / link).exists(), (
                page.name,
                link,
            )


def blocks(*kinds):
    """What is in fenced blocks of all pages, with the page's name."""
    for page in (*sorted(DOCS.glob("*.md")), ROOT / "README.md", ROOT / "CONTRIBUTING.md"):
        for kind, text in re.findall(r"```(\w*)\n(.*?)```", page.read_text(), re.DOTALL):
            if kind in kinds:
                yield page.name, textwrap.dedent(text)


def test_every_command_on_any_page_can_be_called(tmp_path, monkeypatch):
    """Name, options and arguments; make docs types them."""
    monkeypatch.chdir(tmp_path)
    found = [
        (page, line, shlex.split(words, comments=True))
        for page, text in blocks("", "sh")
        for line, words in re.findall(r"^(\S*paramreduce +(\S.*))$", text, re.MULTILINE)
    ]
    assert len(found) > 50
    for page, line, (name, *words) in found:
        command = cli.get_command(None, name)
        assert command is not None, (page, line)
        try:
            command.parse_args(click.Context(command), words)
        except click.ClickException as error:
            pytest.fail(f"{page}: {line}: {error.format_message()}")


@pytest.mark.skipif(shutil.which("gcc") is None, reason="gcc is not installed")
def test_calls_of_exported_c_compile(tmp_path):
    """Those that the docs show, of another robot with loops; whole files are compiled by the tests of their pages."""
    model = model_of("four_bar")
    chosen, title = find_chosen_model("full", model, None, None)
    for name, content in languages["c"](make_exported_model(model, chosen, title=title)).items():
        (tmp_path / name).write_bytes(content)
    shown = (text for _, text in blocks("c") if "#include" not in text)
    text = "".join(re.sub(r"\b(hexaglide|car)_", "four_bar_", text) for text in shown)
    arrays = ["phi", "z", "q", "dq", "ddq", "dz", "ddz", "R", "b", "tau", "M", "delta"]
    lines = [
        '#include "four_bar.h"',
        f"void call({', '.join(f'double *{name}' for name in arrays)}) {{",
        text,
        "}",
    ]
    (tmp_path / "call.c").write_text("\n".join(lines))
    words = ["gcc", "-std=c99", "-Wall", "-Wextra", "-Werror", "-fsyntax-only", "call.c"]
    done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def sections_below(kind):
    for one in kind.__subclasses__():
        yield one
        yield from sections_below(one)


def wrong_in(content, kind, constants):
    """What a section refuses of an example that need not be whole."""
    try:
        kind.model_validate(content, context={"constants": constants})
    except ValidationError as error:
        return [one for one in error.errors() if one["type"] != "missing"]
    return []


def without_point_names(content, key=""):
    """An example with numbers in place of the names of points, which are replaced before a config is checked."""
    if isinstance(content, dict):
        return {k: without_point_names(v, k) for k, v in content.items()}
    if isinstance(content, str) and key in ("at", "com"):
        return [[0, 0, 0], [0, 0, 1]] if content.endswith("ball") else [0, 0, 0]
    if isinstance(content, str) and key == "axes" and "to " in content:
        return "x"
    if (isinstance(content, list) and key != "bodies") or key == "closures":
        return [without_point_names(entry, key) for entry in content]
    if isinstance(content, list):
        return [without_point_names(e) if isinstance(e, dict) else e for e in content]
    return content


def test_every_example_of_a_config_is_valid():
    """Its keys and values, as a config or as a section of one; constants are its own or those of its page."""
    found = list(blocks("yaml"))
    assert len(found) > 10
    for page, text in found:
        content = yaml.safe_load(text)
        if page == "vehicles.md":
            content = without_point_names(content)
        constants = {"h": 0.3, "far": 0.4, "R": 0.5, "r": 0.2} if page == "mechanisms.md" else {}
        wrong = {kind: wrong_in(content, kind, constants) for kind in sections_below(Section)}
        assert not all(wrong.values()), (page, text, min(wrong.values(), key=len))
    assert SweepSection in wrong
    assert wrong_in({"torque_error": 2}, TermsSection, {}), "values count"
    assert wrong_in({"torque_eror": 0.01}, TermsSection, {}), "keys count"


def test_the_diagram_of_the_pipeline_shows_the_declared_stages():
    spec = importlib.util.spec_from_file_location("pipeline", DOCS / "pipeline.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    assert module.IMAGE.read_text() == module.draw_pipeline()
