"""Whether the docs name everything there is."""

import importlib.util
import re

import h5py
import pytest
from conftest import ROOT

from paramreduce_cli.cli import cli
from paramreduce_cli.config.loading import config_schema

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
    rows = re.findall(r"^\| `(\w+)` \|(.*)\|(.*)\|(.*)\|(.*)\|$", page, re.MULTILINE)
    assert sorted(row[0] for row in rows) == sorted(schema_keys(config_schema()))
    assert all(row[3].strip() for row in rows)
    assert len(generated.keys()) == len(set(generated.keys())) == len(rows)


def test_every_command_and_option_is_on_its_page(generated):
    page = generated.commands_page()
    for name in cli.list_commands(None):
        text = page.split(f"## {name}\n")[1].split("\n## ")[0]
        for parameter in cli.get_command(None, name).params:
            word = parameter.opts[0] if parameter.opts[0].startswith("-") else parameter.make_metavar(None)  # fmt: skip
            assert word.strip("[]") in text, (name, word)


def test_every_dataset_is_described(generated, two_link_results, measured_results):
    text = (DOCS / "artifacts.md").read_text() + generated.records_page()
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
