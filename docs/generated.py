"""The pages that are made from the program itself: every key of a config, every command, every record.

mkdocs runs this when the site is built; `python docs/generated.py FOLDER` writes the pages too.
"""

import ast
import inspect
import json
import re
import sys
from collections.abc import Iterator, Mapping
from functools import cached_property
from pathlib import Path
from typing import Any

import click
import yaml

from paramreduce_cli import api
from paramreduce_cli.cli import cli
from paramreduce_cli.config.loading import get_schema

CONFIGS = Path(__file__).resolve().parents[1] / "configs"
KEYS = Path(__file__).resolve().parent / "keys"
"""Configs that use what the others do not need."""
NOTEBOOK = Path(__file__).resolve().parent / "tutorial.ipynb"
_LONGEST = 120
"""Characters of an example."""
RECORDS = Path(__file__).resolve().parents[1] / "paramreduce_cli" / "records"
Schema = Mapping[str, Any]


def config_page() -> str:
    """Every key of a config: kind, default, what it is, and where a config that comes along uses it."""
    schema = get_schema()
    lines = [
        "# Keys of a config",
        "",
        "Made from the schema that the program checks configs with; `paramreduce schema` prints it for editors.",
        "Numbers may be written as `pi/2`, `90deg` or with names under `constants`. Where a key has no",
        "default it must be given. *Example* is from a config that comes along, or from `docs/keys/`; a `share` is",
        "1 for all of it.",
    ]
    examples = _examples()
    for path, section, about in _sections(schema):
        lines += ["", f"## `{path}`" if path else "## At the top", "", about, ""]
        lines += ["| key | what it takes | what it is |", "| --- | --- | --- |"]
        for key, entry in section.get("properties", {}).items():
            full = f"{path}.{key}" if path else key
            needed = key in section.get("required", ())
            default = "**must be given**" if needed else f"default: {_default(entry)}"
            text, kind = _text(entry.get("description", "")), _kind(entry, schema)
            takes = ", ".join(filter(None, (kind, _unit(text))))
            example = examples.get(full, "see below" if "section" in kind else "")
            about = _cell(text) + (f"<br>*Example*: {_cell(example)}" if example else "")
            lines.append(f"| `{key}` | {takes}<br>{default} | {about} |")
    return "\n".join(lines) + "\n"


def keys() -> list[str]:
    """Every key with its place, such as ``trajectories.count``."""
    return [
        f"{path}.{key}" if path else key
        for path, section, _ in _sections(get_schema())
        for key in section.get("properties", {})
    ]


def commands_page() -> str:
    """The help of every command."""
    context = click.Context(cli, info_name="paramreduce")
    lines = ["# Commands", "", "What `paramreduce COMMAND --help` prints. `paramreduce` alone says what to do next in a folder.", "Exit codes: 0, all is well; 1, the model is not accepted, or two runs differ; 2, something was wrong with the input;", "70, a bug; 130, interrupted.", ""]  # fmt: skip
    for name in cli.list_commands(context):
        command = cli.get_command(context, name)
        assert command is not None
        text = command.get_help(click.Context(command, info_name=name, parent=context))
        lines += [f"## {name}", "", "```text", text.rstrip(), "```", ""]
    return "\n".join(lines)


def records_page() -> str:
    """Every record with its fields, which are what datasets are named after."""
    lines = ["# Records and datasets", "", "What stages hand each other, in memory and, under the same names, as datasets of the [files](../artifacts.md): a field that is", "a record itself is a group, a mapping a group with a member for every name, and `shown` of a log `/shown/...`. Made from", "`paramreduce_cli/records/`."]  # fmt: skip
    for path in sorted(RECORDS.glob("*.py")):
        for node in ast.parse(path.read_text(encoding="utf-8")).body:
            if isinstance(node, ast.ClassDef) and (fields := list(_fields(node))):
                lines += ["", f"## {node.name}", "", _text(ast.get_docstring(node) or ""), ""]
                lines += ["| field | kind | what it is |", "| --- | --- | --- |"]
                lines += [f"| `{name}` | `{kind}` | {_cell(about)} |" for name, kind, about in fields]  # fmt: skip
    return "\n".join(lines) + "\n"


def python_page() -> str:
    """Everything that ``paramreduce_cli`` offers, from its docstrings."""
    lines = ["# Functions", "", "What `import paramreduce_cli as pr` offers, from its docstrings; [From Python](../python.md) shows it at work. Records", "are [here](records.md)."]  # fmt: skip
    for name in api.__all__:
        lines += ["", f"## {name}", "", *_documented(name, getattr(api, name))]
        if isinstance(getattr(api, name), type):
            for own, member in vars(getattr(api, name)).items():
                if not own.startswith("_") and isinstance(member, property | cached_property) and member.__doc__:  # fmt: skip
                    lines += [f"- `.{own}`: {_roles(_text(member.__doc__))}"]
    return "\n".join(lines) + "\n"


def notebook_page() -> str:
    """The tutorial in Python, cell by cell; `make docs` runs the notebook itself."""
    cells = json.loads(NOTEBOOK.read_text(encoding="utf-8"))["cells"]
    blocks = []
    for cell in cells:
        text = "".join(cell["source"]).rstrip()
        blocks.append(text if cell["cell_type"] == "markdown" else f"```python\n{text}\n```")
    blocks.append(f"This page is [{NOTEBOOK.name}]({NOTEBOOK.name}), cell by cell.")
    return "\n\n".join(blocks) + "\n"


def _documented(name: str, thing: Any) -> Iterator[str]:
    """Signature and docstring: sections of arguments and errors as lists."""
    if inspect.isfunction(thing):
        text = re.sub(r"(: |-> )'([^']+)'", r"\1\2", str(inspect.signature(thing)))
        text = re.sub(r"paramreduce_cli\.[\w.]*\.", "", text)
        yield from ("```text", f"pr.{name}{text}", "```", "")
    for paragraph in inspect.cleandoc(thing.__doc__ or "").split("\n\n"):
        title, _, body = paragraph.partition("\n")
        if title not in ("Args:", "Raises:", "Returns:", "Attributes:"):
            yield from (_roles(_text(paragraph)), "")
            continue
        yield from (f"**{title[:-1]}**", "")
        if title == "Returns:":
            yield _roles(_text(body))
        else:
            for entry in re.split(
                r"\n(?=    \S)", f"\n{inspect.cleandoc(body)}".replace("\n", "\n    ")
            )[1:]:
                key, _, about = entry.strip().partition(":")
                yield f"- `{key}`: {_roles(_text(about))}"
        yield ""


def _roles(text: str) -> str:
    """References and literals of docstrings as Markdown."""
    text = re.sub(r":\w+:`~?(?:[\w.]*\.)?(\w+)`", r"`\1`", text)
    return text.replace("``", "`")


def _fields(node: ast.ClassDef) -> Iterator[tuple[str, str, str]]:
    """Fields of a class with their kinds and the texts under them."""
    for entry, after in zip(node.body, [*node.body[1:], None], strict=True):
        if isinstance(entry, ast.AnnAssign) and isinstance(entry.target, ast.Name):
            value = after.value if isinstance(after, ast.Expr) else None
            about = value.value if isinstance(value, ast.Constant) else ""
            yield entry.target.id, ast.unparse(entry.annotation).replace("|", "or"), str(about)


def _sections(schema: Schema) -> Iterator[tuple[str, Schema, str]]:
    """Sections by the place where they first stand, with what they are."""
    waiting: list[tuple[str, Schema]] = [("", schema)]
    seen = set()
    while waiting:
        path, section = waiting.pop(0)
        yield path, section, _text(section.get("description", ""))
        for key, entry in section.get("properties", {}).items():
            for name, many in _references(entry):
                if name not in seen:
                    seen.add(name)
                    place, section_below = f"{path}.{key}" if path else key, schema["$defs"][name]
                    kind = section_below.get("properties", {}).get("type", {}).get("const")
                    waiting.append((place + many + (f"[{kind}]" if kind else ""), section_below))


def _references(entry: Any, many: str = "") -> Iterator[tuple[str, str]]:
    """Names of sections in an entry, and how one gets there: ``[]`` of a list, ``.NAME`` of a mapping."""
    if isinstance(entry, list):
        for one in entry:
            yield from _references(one, many)
    elif isinstance(entry, dict):
        if "$ref" in entry:
            yield entry["$ref"].rpartition("/")[2], many
        for key, below in entry.items():
            step = {"items": "[]", "additionalProperties": ".NAME"}.get(key, "")
            if isinstance(below, dict | list) and key != "discriminator":
                yield from _references(below, many + step)


def _kind(entry: Schema, schema: Schema) -> str:
    """What a key takes, in words."""
    if "$ref" in entry:
        name = entry["$ref"].rpartition("/")[2]
        target = schema["$defs"][name]
        return "one of " + ", ".join(f"`{v}`" for v in target["enum"]) if "enum" in target else "a section"  # fmt: skip
    if "enum" in entry:
        return "one of " + ", ".join(f"`{value}`" for value in entry["enum"])
    if "const" in entry:
        return f"`{entry['const']}`"
    if "oneOf" in entry:
        return "a section"
    if "anyOf" in entry:
        kinds = [_kind(one, schema) for one in entry["anyOf"] if one.get("type") != "null"]
        numeric = {"a number", "a whole number"} & set(kinds)
        if numeric and "text" in kinds and not any("pattern" in one for one in entry["anyOf"]):
            kinds.remove("text")  # arithmetic is written as text
        return " or ".join(dict.fromkeys(kinds))
    if entry.get("type") == "array":
        return f"a list of {_plural(_kind(entry.get('items', {}), schema))}"
    if entry.get("type") == "object":
        below = entry.get("additionalProperties")
        return (
            f"names with {_plural(_kind(below, schema))}"
            if isinstance(below, dict)
            else "a section"
        )
    words = {"integer": "a whole number", "number": "a number", "string": "text", "boolean": "true or false"}  # fmt: skip
    return words.get(str(entry.get("type")), "anything")


_UNITS = ("rad/s^2", "rad/s", "rad", "kg m^2", "kg m", "kg", "m/s^2", "m/s", "m", "N m s^2/rad^2", "N m s/rad", "N m/rad", "N m", "N", "Hz", "W", "s", "share")  # fmt: skip


def _unit(text: str) -> str:
    """The unit that a description names; with that of sliding joints where it differs."""
    one = "|".join(map(re.escape, _UNITS))
    other = r"(?: or m| \((?:[a-zA-Z/^2 ]+?)(?: if (?:prismatic|it slides))?\))?"
    found = re.search(
        rf"(?:^|[,;:] |; a |, a )((?:{one}){other})(?=[.;,:]|$| \(0|, times| per its unit)", text
    )
    return (
        found[1].replace(" if prismatic", "").replace(" if it slides", "").replace("^2", "²")
        if found
        else ""
    )


def _plural(kind: str) -> str:
    return {"a number": "numbers", "a section": "sections", "text": "texts", "a whole number": "whole numbers"}.get(kind, kind)  # fmt: skip


def _default(entry: Schema) -> str:
    value = entry.get("default")
    return "as below" if isinstance(value, dict) and value else _code(value)


def _code(value: Any, most: int = 60) -> str:
    if value is None:
        return "none"
    text = yaml.safe_dump(value, default_flow_style=True, width=1000).strip().removesuffix("...").strip()  # fmt: skip
    return f"`{text}`" if len(text) <= most else "see the text"


def _examples() -> dict[str, str]:
    """Values of keys in the configs that come along, by place; names and positions stand as in `_sections`."""
    found: dict[str, str] = {}

    def walk(value: Any, places: set[str]) -> None:
        if isinstance(value, dict):
            if isinstance(value.get("type"), str):
                places = places | {f"{place}[{value['type']}]" for place in places}
            for key, below in value.items():
                walk(below, {f"{p}.{k}".lstrip(".") for p in places for k in (key, "NAME")})
        elif isinstance(value, list) and value and isinstance(value[0], dict):
            for below in value:
                walk(below, {f"{place}[]" for place in places})
            value = value[:1]
        text = _code(value, _LONGEST)
        for place in places if text != "see the text" else ():
            found.setdefault(place, text)

    for path in (*sorted(CONFIGS.glob("*.yaml")), *sorted(KEYS.glob("*.yaml"))):
        walk(yaml.safe_load(path.read_text(encoding="utf-8")), {""})
    return found


def _text(text: str) -> str:
    return re.sub(r"\s+", " ", text).strip()


def _cell(text: str) -> str:
    return _text(text).replace("|", "\\|")


PAGES = {
    "reference/config.md": config_page,
    "reference/commands.md": commands_page,
    "reference/records.md": records_page,
    "reference/python.md": python_page,
    "notebook.md": notebook_page,
}

if __name__ == "<run_path>" or "mkdocs_gen_files" in sys.modules:
    import mkdocs_gen_files

    for page_name, make in PAGES.items():
        with mkdocs_gen_files.open(page_name, "w") as page:
            page.write(make())
elif __name__ == "__main__":
    for page_name, make in PAGES.items():
        target = Path(sys.argv[1]) / page_name
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_text(make(), encoding="utf-8")
