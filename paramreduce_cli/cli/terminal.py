"""What goes to the terminal: text, warnings, progress, and Ctrl-C coming from it."""

from __future__ import annotations

import io
import os
import re
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import rich.console
import rich.progress

from paramreduce_cli.errors import ParamreduceWarning

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


def say(message: str) -> None:
    """Print to standard output, without markup."""
    out.print(harmless(message), markup=False)


def complain(message: str) -> None:
    """Print to standard error, without markup."""
    err.print(harmless(message), markup=False)


def harmless(text: str) -> str:
    """A text in which what would steer a terminal is spelled out; names in files may hold it."""
    return re.sub(r"[\x00-\x08\x0b-\x1f\x7f-\x9f]", lambda found: ascii(found[0])[1:-1], text)


def show_errors(text: str) -> None:
    """Print each line of an error's message."""
    for line in text.splitlines():
        complain(f"Error: {line}")


def remark(message: str) -> None:
    """Tell the user something that does not stop the work."""
    complain(f"Warning: {message}.")


def show_warning(message: Warning | str, category: type[Warning], *_: Any, **__: Any) -> None:
    """Show this project's warnings and no others; takes the place of warnings.showwarning."""
    if issubclass(category, ParamreduceWarning):
        remark(str(message))


class Interruption:
    """Ctrl-C, or a polite kill, that cannot get lost.

    A KeyboardInterrupt raised while a library calls back into Python may be swallowed there;
    it is remembered and raised again at the next step of the work.
    """

    def __init__(self) -> None:
        self._met = False

    def install(self) -> None:
        """Take over the signals that ask for an end."""
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, self._note)

    def _note(self, *_: object) -> None:
        self._met = True
        raise KeyboardInterrupt

    def heeded(self) -> None:
        """Go on after an interruption that has ended a search, not the work."""
        self._met = False

    def check(self) -> None:
        """Raise an interruption that was met but did not get through."""
        if self._met and threading.current_thread() is threading.main_thread():
            raise KeyboardInterrupt


interruption = Interruption()


@contextmanager
def progress_bars(quiet: bool) -> Iterator[Callable[[Progress], None]]:
    """Show long work: bars on a terminal, plain lines elsewhere, nothing if quiet."""
    with _shown_progress(quiet) as show:

        def step(p: Progress) -> None:
            show(p)
            interruption.check()

        yield step
    interruption.check()


@contextmanager
def _shown_progress(quiet: bool) -> Iterator[Callable[[Progress], None]]:
    if quiet:
        yield lambda _: None
    elif not err.is_terminal:
        yield _plain_line
    else:
        columns = (
            rich.progress.TextColumn("{task.description}"),
            rich.progress.BarColumn(),
            rich.progress.TaskProgressColumn(),
            rich.progress.TimeElapsedColumn(),
            rich.progress.TextColumn("{task.fields[remark]}"),
        )
        with rich.progress.Progress(*columns, console=err) as bars:
            tasks: dict[str, rich.progress.TaskID] = {}

            def advance(p: Progress) -> None:
                if p.task not in tasks:
                    tasks[p.task] = bars.add_task(p.task, total=p.total, remark="")
                bars.update(tasks[p.task], completed=p.done, remark=p.remark)

            yield advance


def _plain_line(p: Progress) -> None:
    if p.done >= p.total:
        complain(f"{p.task}: done{', ' + p.remark if p.remark else ''}")
