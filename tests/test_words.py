"""Names and docstrings keep to the rules of ../shared/words.md, as far as `ast` can tell."""

import ast
import re
from collections import Counter
from pathlib import Path

import pytest

import paramreduce_cli

PACKAGE = Path(paramreduce_cli.__file__).parent
TREES = {p.relative_to(PACKAGE): ast.parse(p.read_text()) for p in sorted(PACKAGE.rglob("*.py"))}
NOT_A_VERB = re.compile("What|How|Where|Which|Of|By|In|As|With|The|Those|That|It")
PRIVATE_WORD = re.compile(
    "told|tell|audience|brought|doubts|suspicions|concerns|begun|anew|dice|hands|shares|sharing|dealt|laws|useless|"
    "sheet|looked|judged|strayed|refuse|mend|followers|pulled|exchange"
)
PRIVATE_ALONE = re.compile("wanted|found|known|asked|needed|own|one")
"""Words that need a noun after them."""
PARTICIPLE = re.compile(
    r"[a-z]+ed|made|shown|drawn|taken|given|kept|left|held|said|seen|chosen|built"
)
ALLOWED = {
    "chosen": "a function of the Python interface that scripts call",
    "placed": "a decorator: the function below it is placed",
    "column_normalised": "the name of a scaling in configs",
    "equilibrated": "the name of a scaling in configs",
    "weighted": "the name of a scaling in configs",
    "remarks": "the name of a table's file, and of a key in summary.json",
    "PatientFile.tell": "the name that every file of Python has",
}
REGISTERED = (
    "commands",
    "criteria",
    "figures",
    "formats",
    "heuristics",
    "languages",
    "scalings",
    "stages",
    "tables",
)
"""Folders whose files are named after what they add, such as a command or a figure."""


def functions():
    """Yield file, qualified name and node of every function, also of those inside another one."""
    for path, tree in TREES.items():
        stack = [("", node) for node in tree.body]
        while stack:
            prefix, node = stack.pop()
            if isinstance(node, ast.ClassDef):
                stack += [(f"{prefix}{node.name}.", child) for child in node.body]
            elif isinstance(node, ast.FunctionDef):
                yield path, prefix + node.name, node
                stack += [
                    (f"{prefix}{node.name}.", child)
                    for child in ast.walk(node)
                    if child is not node
                ]


def decorators(node):
    return " ".join(ast.unparse(decorator) for decorator in node.decorator_list)


FUNCTIONS = [f for f in functions() if f[1] not in ALLOWED and f[2].name not in ALLOWED]


def test_functions_of_more_than_a_statement_have_docstrings():
    bare = [
        f"{path}:{name}"
        for path, name, node in FUNCTIONS
        if len(node.body) > 1 and not ast.get_docstring(node)
        and not re.fullmatch("__.*__|_", node.name)
    ]  # fmt: skip
    assert not bare


def test_docstrings_of_functions_begin_with_a_verb():
    """Properties and what is shown with a figure or a table are noun phrases."""
    wrong = [
        f"{path}:{name}: {text}"
        for path, name, node in FUNCTIONS
        if not re.search("property|placed", decorators(node))
        and (text := ast.get_docstring(node)) and NOT_A_VERB.fullmatch(text.split()[0].rstrip(",."))
    ]  # fmt: skip
    assert not wrong


def test_no_function_is_named_by_a_participle_alone():
    wrong = [
        f"{path}:{name}"
        for path, name, node in FUNCTIONS
        if PARTICIPLE.fullmatch(node.name.strip("_")) and "property" not in decorators(node)
    ]
    assert not wrong


@pytest.mark.parametrize("part", ["functions", "arguments", "modules"])
def test_names_are_without_private_words(part):
    names = {
        "functions": [name.rpartition(".")[2] for _, name, _ in FUNCTIONS],
        "arguments": [arg.arg for _, _, node in FUNCTIONS for arg in ast.walk(node.args) if isinstance(arg, ast.arg)],
        "modules": [path.stem for path in TREES if path.stem not in ALLOWED],
    }  # fmt: skip
    private = {
        name
        for name in names[part]
        if any(map(PRIVATE_WORD.fullmatch, name.split("_"))) or PRIVATE_ALONE.fullmatch(name)
    }
    assert not private


def test_modules_have_names_of_their_own():
    names = Counter(
        path.stem
        for path in TREES
        if path.stem != "__init__" and not set(path.parts[:-1]) & set(REGISTERED)
    )
    assert [name for name, count in names.items() if count > 1] == []
