"""The wheel in every other Python of this machine: the small case, against its reference, and exported code.

`python -m tests.pythons`; whatever is called python3.N, here or in pyenv, and no older than the project asks for.
"""

import glob
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import rich.console
import rich.table

ROOT = Path(__file__).resolve().parents[1]
OLDEST, NEWEST = 11, 13
"""Of Python 3, that the project says it runs with."""
CONFIG, REFERENCE = "configs/two_link.yaml", str(ROOT / "results/reference/two_link.json")
STEPS = (
    ("paramreduce", "init", "--example", "two_link"),
    ("paramreduce", "run", CONFIG, "--set", f"trajectories.file={REFERENCE}"),
    ("paramreduce", "compare", REFERENCE, "results/two_link"),
    (
        "paramreduce",
        "export",
        "--results",
        "results/two_link",
        CONFIG,
        "--set",
        f"trajectories.file={REFERENCE}",
    ),
    ("python", "-c", "import paramreduce_cli as pr; print(len(dir(pr)))"),
)


def interpreters():
    """Other Pythons by their version, one of each."""
    versions = range(OLDEST, NEWEST + 1)
    named = [shutil.which(f"python3.{minor}") for minor in versions]
    pyenv = os.environ.get("PYENV_ROOT", str(Path.home() / ".pyenv"))
    found = {}
    for path in [*filter(None, named), *sorted(glob.glob(f"{pyenv}/versions/3.*/bin/python"))]:
        asked = subprocess.run([path, "-c", "import sys; print(*sys.version_info[:2])"], capture_output=True, text=True, check=False)  # fmt: skip
        version = re.fullmatch(r"3 (\d+)\n", asked.stdout)
        if version and int(version[1]) in versions and int(version[1]) != sys.version_info.minor:
            found.setdefault(int(version[1]), path)
    return found


def fails(folder, interpreter, wheel):
    """The first step that fails with a wheel in an environment of its own; empty if none does."""
    place = folder / "venv"
    path = f"{place / 'bin'}{os.pathsep}{os.environ['PATH']}"
    environment = {**os.environ, "PATH": path, "PARAMREDUCE_CACHE": str(folder / "cache")}
    pip = ("pip", "install", "--quiet", "--disable-pip-version-check", str(wheel))
    for words in ((interpreter, "-m", "venv", str(place)), pip, *STEPS):
        done = subprocess.run(words, cwd=folder, env=environment, capture_output=True, text=True, check=False)  # fmt: skip
        if done.returncode:
            print(done.stdout[-2000:], done.stderr[-2000:])
            return " ".join(words)
    return ""


def timed(folder, interpreter, wheel):
    """The same in a folder that is made for it, and how long it took, s."""
    folder.mkdir()
    started = time.perf_counter()
    return fails(folder, interpreter, wheel), time.perf_counter() - started


def main():
    table = rich.table.Table("Python", "seconds", "fails")
    failed = False
    with tempfile.TemporaryDirectory() as name:
        wheels = Path(name)
        source = wheels / "source"
        for file in subprocess.check_output(("git", "ls-files"), cwd=ROOT, text=True).splitlines():
            (source / file).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(ROOT / file, source / file)
        words = ("pip", "wheel", "--quiet", "--disable-pip-version-check", "--no-deps", "--wheel-dir", name, str(source))  # fmt: skip
        subprocess.run((sys.executable, "-m", *words), check=True)
        (wheel,) = wheels.glob("*.whl")
        others = interpreters()
        if not others:
            print(f"No other Python from 3.{OLDEST} to 3.{NEWEST} is here: nothing was tried.")
        with ThreadPoolExecutor() as pool:
            tried = pool.map(
                lambda minor: timed(wheels / f"3.{minor}", others[minor], wheel), others
            )
            for minor, (step, seconds) in zip(others, tried, strict=True):
                failed |= bool(step)
                table.add_row(f"3.{minor}", f"{seconds:.0f}", step or "nothing")
    rich.console.Console(width=120).print(table)
    sys.exit(failed)


if __name__ == "__main__":
    main()
