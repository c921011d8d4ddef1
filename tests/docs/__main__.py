"""What the docs tell to type, typed, from a wheel."""

import argparse
import os
import re
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import rich.console
import rich.table

from tests.docs import prepared
from tests.docs.prepared import ROOT
from tests.pythons import interpreters

LONG = ("tutorial.md", "how-to.md", "controllers.md", "tools.md", "python.md")
"""Pages that are typed as they stand, each in an empty folder of its own."""
SHORT = {
    prepared.paper: ("README.md", "stages.md", "lean.md", "terms.md"),
    prepared.matrix: ("own-data.md",),
    prepared.config: ("cluster.md",),
    prepared.robot: ("robots.md",),
    prepared.recorded: ("logs.md", "record.md"),
}
"""Pages that are typed with short configs, by what their readers have in their folder."""
CONTROLLER = "hold_controller.cpp"
SYNTAX = ["g++", "-std=c++17", "-Wall", "-Wextra", "-fsyntax-only", "-I", str(ROOT / "tests/docs/stand_ins"), "-I", "two_link_c", CONTROLLER]  # fmt: skip
"""ROS is not there where docs are tested."""
NOTEBOOK = "tutorial.ipynb"
_BLOCK = re.compile(
    r"(?:`(?P<file>[\w.]+\.(?:py|[ch]pp|m))`:\n\n)?```(?P<kind>\w*)\n(?P<text>.*?)```", re.DOTALL
)
_COMMAND = re.compile(r"paramreduce |for |cp |python |make -C |cc |g\+\+ |octave-cli |cargo |\./")
"""Lines that are typed; other targets of Make are those of the repository, and CI's."""


def steps(text):
    """What is typed on a page, in order: shell commands, and scripts of neighbouring Python blocks."""
    found = []
    for block in _BLOCK.finditer(text):
        kind, content = block["kind"], block["text"]
        if block["file"]:
            found.append(("file", block["file"], content))
        elif kind in ("sh", ""):
            lines = content.replace(".venv/bin/", "").splitlines()
            found += [("sh", line, line) for line in lines if _COMMAND.match(line)]
        elif kind != "python":
            continue
        elif found and found[-1][0] == "python":
            found[-1] = ("python", found[-1][1], found[-1][2] + content)
        else:
            found.append(("python", "snippet", content))
    return found


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "--python", default=sys.executable, help="Interpreter to install the wheel for."
    )
    parser.add_argument(
        "--newest",
        action="store_true",
        help="Take the newest other Python of this machine instead, if there is one.",
    )
    parser.add_argument("--page", choices=LONG, help="Type one page alone.")
    given = parser.parse_args()
    if given.newest:
        others = interpreters()
        given.python = others[max(others)] if others else given.python
    table = rich.table.Table("page", "what is typed", "seconds", "exit code")
    failed = False
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        environment = installed(folder, given.python)
        for page in [given.page] if given.page else LONG:
            here = folder / page.removesuffix(".md")
            here.mkdir()
            failed |= all_typed(table, page, here, environment)
        if given.page:
            end(table, failed)
        failed |= typed(
            table, "controllers.md", CONTROLLER, SYNTAX, folder / "controllers", environment
        )
        for prepare, pages in SHORT.items():
            here = folder / prepare.__name__
            here.mkdir()
            prepare(here, environment)
            for page in pages:
                failed |= all_typed(table, page, here, environment, short=set())
        here = folder / "notebook"
        here.mkdir()
        subprocess.run(["paramreduce", "init", "--example", "two_link"], cwd=here, env=environment, check=True, stdout=subprocess.DEVNULL)  # fmt: skip
        run = "import nbformat, nbclient; nbclient.NotebookClient(nbformat.read({!r}, 4), timeout=300).execute()"
        words = ["python", "-c", run.format(str(ROOT / "docs" / NOTEBOOK))]
        failed |= typed(table, NOTEBOOK, "all cells", words, here, environment)
        end(table, failed)


def end(table, failed):
    """Print what was typed; exit with 1 if anything failed."""
    rich.console.Console(width=120).print(table)
    sys.exit(failed)


def all_typed(table, page, folder, environment, short=None):
    """Type everything on a page; True if anything fails.

    Args:
        short: Configs that are short already, where all are to be.
    """
    path = ROOT / page if page == "README.md" else ROOT / "docs" / page
    failed = False
    for kind, shown, content in steps(path.read_text()):
        if kind == "file":
            (folder / shown).write_text(content)
            continue
        if short is not None:
            prepared.shorten(folder, short)
        words = ["bash", "-c", content] if kind == "sh" else ["python", "-c", content]
        failed |= typed(table, page, shown, words, folder, environment)
    return failed


def installed(folder, interpreter):
    """A wheel, made of the source distribution, in an environment of its own; what is set to run its programs."""
    python = folder / "venv" / "bin" / "python"
    kept = {key: value for key, value in os.environ.items() if key != "PYTHONPATH"}

    def call(*words):
        subprocess.run([*map(str, words)], check=True, env=kept, stdout=subprocess.DEVNULL)

    pip = (python, "-m", "pip", "--quiet", "--disable-pip-version-check")
    call(interpreter, "-m", "venv", folder / "venv")
    call(*pip, "install", "build>=1,<2")
    call(python, "-m", "build", "--sdist", "--outdir", folder / "source", ROOT)
    (source,) = (folder / "source").glob("*.tar.gz")
    call(*pip, "wheel", "--no-deps", "--wheel-dir", folder / "wheel", source)
    (wheel,) = (folder / "wheel").glob("*.whl")
    extra = ("nbclient>=0.10,<1", "ipykernel>=6.29,<8", "fmpy>=0.3.20,<0.4")
    call(*pip, "install", f"{wheel}[pandas,identify]", *extra)
    path = f"{python.parent}:{os.environ['PATH']}"
    return {**kept, "PATH": path, "MPLBACKEND": "agg", "BROWSER": "true %s"}


def typed(table, page, shown, words, folder, environment):
    """Type something; True if it fails."""
    started = time.monotonic()
    done = subprocess.run(words, cwd=folder, env=environment, capture_output=True, text=True, check=False)  # fmt: skip
    table.add_row(page, shown, f"{time.monotonic() - started:.1f}", str(done.returncode))
    if done.returncode:
        print(f"{page}: {shown}\n{done.stdout[-2000:]}\n{done.stderr[-2000:]}", file=sys.stderr)
    return done.returncode != 0


if __name__ == "__main__":
    main()
