"""What goes to the terminal: text, warnings, progress, and Ctrl-C coming from it."""

from __future__ import annotations

import io
import json
import os
import re
import shlex
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO

import click
import rich.console
import rich.progress
import rich.table

from paramreduce_cli.artifacts.atomic import check_is_file
from paramreduce_cli.errors import ConfigError, ParamreduceWarning

if TYPE_CHECKING:
    from paramreduce_cli.records import Progress  # NumPy takes longer to load than all else here


class _Console(rich.console.Console):
    """A console that leaves a reader gone away to :func:`main`."""

    def on_broken_pipe(self) -> None:
        """Raise instead of leaving with an exit code of its own."""
        raise BrokenPipeError


if os.environ.get("COLUMNS", "").strip("0") == "":
    os.environ.pop("COLUMNS", None)  # no terminal is that narrow, and nothing would be shown
for stream in (sys.stdout, sys.stderr):
    if isinstance(stream, io.TextIOWrapper):
        stream.reconfigure(errors="replace")  # a terminal that knows no Greek is no reason to stop

out = _Console(highlight=False, soft_wrap=True, emoji=False)
err = _Console(stderr=True, highlight=False, soft_wrap=True, emoji=False)


_OWN_LENGTH = len("2000-01-01T00:00:00 ")
_OWN_LINE = re.compile(rb"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d |$")
"""How a file of messages begins; an empty one is one, too."""


class Journal:
    """A log file of the messages, with times, and a switch for messages on every step."""

    def __init__(self) -> None:
        self._file: TextIO | None = None
        self.verbose = False

    def open(self, path: Path) -> None:
        """Append to a file from now on.

        Raises:
            ConfigError: The file cannot be written, or holds something else.
            ArtifactError: The path is no file.
        """
        check_is_file(path)
        try:
            if path.exists() and not _OWN_LINE.match(path.open("rb").read(_OWN_LENGTH)):
                raise ConfigError(
                    f"--log-file {path}: is not a file of paramreduce's messages. Name another file."
                )
            self._file = path.open("a", encoding="utf-8")
        except OSError as error:
            raise ConfigError(f"--log-file {path}: cannot be written: {error.strerror}.") from error
        self.note(f"$ {' '.join(map(shlex.quote, sys.argv))}")

    def note(self, text: str) -> None:
        """Write lines, if there is a file."""
        if self._file is not None:
            now = time.strftime("%Y-%m-%dT%H:%M:%S")
            try:
                self._file.writelines(f"{now} {line}\n" for line in text.splitlines())
                self._file.flush()
            except OSError as error:
                self._file = None  # the work matters more than its log
                warn_user(f"--log-file: cannot be written any more: {error.strerror}")


journal = Journal()


JSON = click.option("--json", "as_json", is_flag=True, help="Print JSON, for programs.")
LOG = click.option(
    "--log-file", type=click.Path(path_type=Path, dir_okay=False), metavar="FILE", expose_value=False,
    callback=lambda _, __, path: None if path is None else journal.open(path),
    help="Also write messages to FILE, with times.",
)  # fmt: skip
VERBOSE = click.option(
    "-v", "--verbose", is_flag=True, expose_value=False,
    callback=lambda _, __, wanted: setattr(journal, "verbose", wanted),
    help="Print every step of long work on its own line.",
)  # fmt: skip


def say(message: str) -> None:
    """Print to standard output, without markup and with control characters spelled out, and to the log file if there is
    one.
    """
    journal.note(message)
    out.print(escape_controls(message), markup=False)


def say_table(table: rich.table.Table, least: int = 0) -> None:
    """Print a table to standard output.

    Args:
        table: Table to print.
        least: Columns that it has at least, however narrow the terminal.
    """
    with out.capture() as captured:
        out.print(table, width=max(out.width, least))
    journal.note(re.sub(r"\x1b\[[0-9;]*m", "", captured.get()))
    out.print(table, width=max(out.width, least))


def print_error(message: str) -> None:
    """Print to standard error, without markup."""
    journal.note(message)
    err.print(escape_controls(message), markup=False)


def emit(**event: Any) -> None:
    """Print something as one line of JSON, for programs that read along."""
    text = json.dumps(event, ensure_ascii=False, allow_nan=False)
    journal.note(text)
    sys.stdout.write(text + "\n")
    sys.stdout.flush()


_STEERS = re.compile(r"[\x00-\x08\x0b-\x1f\x7f-\x9f\u200e\u200f\u202a-\u202e\u2066-\u2069]")
"""Control characters but for tabs and new lines, and those that turn the direction of text."""


def escape_controls(text: str) -> str:
    """Return a text with control sequences spelled out; names in files may hold them."""
    return _STEERS.sub(lambda found: ascii(found[0])[1:-1], text)


def show_errors(text: str) -> None:
    """Print each line of an error's message."""
    for line in text.splitlines():
        print_error(f"Error: {line}")


def warn_user(message: str) -> None:
    """Tell the user something that does not stop the work."""
    print_error(f"Warning: {message}{'' if message.endswith('?') else '.'}")


def show_warning(message: Warning | str, category: type[Warning], *_: Any, **__: Any) -> None:
    """Show this project's warnings and no others; takes the place of warnings.showwarning."""
    if issubclass(category, ParamreduceWarning):
        warn_user(str(message))


class Interruption:
    """A Ctrl-C or SIGTERM that cannot get lost.

    A library that calls back into Python may swallow a KeyboardInterrupt. The signal is therefore stored, and raised
    again at the next step of the work.
    """

    def __init__(self) -> None:
        self._met: int | None = None

    def install(self) -> None:
        """Take over the signals that ask for an end."""
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, self._note)
        sys.unraisablehook = _show_unraisable

    def _note(self, number: int, _: object) -> None:
        """Remember the signal and raise KeyboardInterrupt."""
        if self._met != signal.SIGTERM:  # after a kill nothing is a wish to go on
            self._met = number
        raise KeyboardInterrupt

    def clear(self) -> None:
        """Forget a Ctrl-C that has ended a search, not the work.

        Raises:
            KeyboardInterrupt: The signal was SIGTERM, which ends the whole run.
        """
        if self._met == signal.SIGTERM:
            raise KeyboardInterrupt
        self._met = None

    def check(self) -> None:
        """Raise an interruption that was met but did not get through."""
        if self._met is not None and threading.current_thread() is threading.main_thread():
            raise KeyboardInterrupt


def _show_unraisable(problem: sys.UnraisableHookArgs) -> None:
    """Show an exception that Python cannot raise, unless it is an interruption, which :class:`Interruption` remembers."""
    if not issubclass(problem.exc_type, KeyboardInterrupt):
        sys.__unraisablehook__(problem)


interruption = Interruption()


@contextmanager
def show_progress(
    label: str, quiet: bool = False, as_json: bool = False
) -> Iterator[Callable[[Progress], None]]:
    """Show long work: one line that moves on a terminal, a line now and then elsewhere, events as JSON, nothing if quiet.

    Args:
        label: Current work, such as "3/7 reduce".
        quiet: Whether nothing is shown.
        as_json: Whether progress is written as events for programs.

    Yields:
        The progress callback.
    """
    with _choose_progress(label, quiet, as_json) as show:

        def step(p: Progress) -> None:
            """Show a step of progress; raise an interruption that a library has swallowed."""
            show(p)
            interruption.check()

        yield step
    interruption.check()


@contextmanager
def _choose_progress(
    label: str, quiet: bool, as_json: bool
) -> Iterator[Callable[[Progress], None]]:
    """Yield the progress callback for the terminal, for files and for --json."""
    if as_json:
        yield _Lines(1.0, lambda p, left: emit(event="progress", **vars(p), left=left)).show
    elif quiet:
        yield lambda _: None
    elif journal.verbose:
        yield _Lines(0.0, lambda p, left: print_error(_format_line(p, left))).show
    elif not err.is_terminal:
        yield _PacedLines(lambda p, left: print_error(f"{label}: {_format_line(p, left)}")).show
    else:
        with _show_line(label) as show:
            yield show


@contextmanager
def _show_line(label: str) -> Iterator[Callable[[Progress], None]]:
    """Show one line on a terminal: the task at hand and the seconds that it still takes; the line vanishes at the end."""
    columns = (
        rich.progress.SpinnerColumn(),
        rich.progress.TextColumn("{task.description}"),
        rich.progress.BarColumn(24),
        rich.progress.TaskProgressColumn(),
        rich.progress.TimeRemainingColumn(),
        rich.progress.TextColumn("{task.fields[detail]}"),
    )
    with rich.progress.Progress(*columns, console=err, transient=True) as bars:
        line = bars.add_task(label, total=None, detail="")
        shown = ""

        def show(p: Progress) -> None:
            """Update the line."""
            nonlocal shown
            total = p.total if p.done or p.total > 1 else None  # of a single step nothing is known
            if p.task != shown:
                shown = p.task
                bars.reset(line, description=f"{label}: {p.task}", total=total, detail=p.detail)
            bars.update(line, completed=p.done, total=total, detail=p.detail)

        yield show


@contextmanager
def show_start(name: str) -> Iterator[None]:
    """Say on a terminal that a command starts, while the libraries that it needs are loaded."""
    with err.status(f"starting {name}"):
        yield


class _PacedLines:
    """A printer of progress with one line every ten seconds.

    Args:
        print_line: Callback with a step and the seconds that are left for its task, None where that is unknown.
    """

    _PAUSE = 10.0

    def __init__(self, print_line: Callable[[Progress, float | None], None]) -> None:
        self._tell = print_line
        self._told = time.monotonic()
        self._begun: dict[str, float] = {}

    def show(self, p: Progress) -> None:
        """Write a line, if the last one is long ago."""
        now = time.monotonic()
        start = self._begun.setdefault(p.task, now)
        if now - self._told >= self._PAUSE and p.done < p.total:
            self._told = now
            self._tell(p, _estimate_seconds_left(p, now - start))


def _estimate_seconds_left(p: Progress, passed: float) -> float | None:
    """Return the seconds that a task still takes, None where that cannot be told."""
    fraction = p.done / p.total if p.total else 1.0
    return passed * (1 - fraction) / fraction if 0 < fraction < 1 else None


_FIRST_PAUSE = 2.0
"""After which a task is told of for the first time, s."""


class _Lines:
    """A printer of progress as lines; the end of a task is printed unless the task was brief.

    Args:
        pause: Time between two lines of a task, s.
        print_line: Callback with a step and the seconds that are left, None where that is unknown.
    """

    def __init__(self, pause: float, print_line: Callable[[Progress, float | None], None]) -> None:
        self._pause, self._tell = pause, print_line
        self._begun: dict[str, float] = {}
        self._told: dict[str, float] = {}

    def show(self, p: Progress) -> None:
        """Print a step of progress if enough time has passed."""
        now = time.monotonic()
        start = self._begun.setdefault(p.task, now)
        told_before = p.task in self._told
        pause = self._pause if told_before else min(self._pause, _FIRST_PAUSE)
        # A task of one step has no other moment to be told of before its end.
        single = p.done == 0 and p.total == 1
        if p.done < p.total and not single and now - self._told.get(p.task, start) < pause:
            return
        if p.done >= p.total:
            was_shown = self._told.pop(p.task, None) is not None
            del self._begun[p.task]
            if not (was_shown or p.detail) and now - start < self._pause:
                return
        else:
            self._told[p.task] = now
        self._tell(p, _estimate_seconds_left(p, now - start))


def _format_line(p: Progress, left: float | None) -> str:
    """Return a step of progress as text."""
    fraction = (
        f"{100 * p.done / p.total:.0f} %" if p.total == 1 else f"{p.done:.4g} of {p.total:.4g}"
    )
    state = "done" if p.done >= p.total else fraction if p.done else "begun"
    rest = f", about {left:.0f} s left" if left is not None and left >= 1 else ""
    return f"{p.task}: {state}{rest}{', ' + p.detail if p.detail else ''}"
