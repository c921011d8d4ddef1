"""What is said of long work, and which interruptions are kept in mind."""

import contextlib
import io
import signal
import sys
import warnings

import pytest

import paramreduce_cli.cli as command_line
from paramreduce_cli.cli import terminal
from paramreduce_cli.errors import ArtifactError
from paramreduce_cli.records import Progress


@pytest.fixture
def lines(monkeypatch):
    """Steps at given times, and the lines that they make."""
    now, told = [0.0], []
    monkeypatch.setattr(terminal.time, "monotonic", lambda: now[0])
    shown = terminal._Lines(10.0, lambda p, left: told.append((p.done, left)))

    def at(time, done, total=10.0, detail=""):
        now[0] = time
        shown.show(Progress("work", done, total, detail))
        return told

    return at


def test_what_is_brief_is_not_told(lines):
    lines(0, 0)
    lines(1, 5)
    assert lines(2, 10) == []


def test_what_says_something_at_its_end_is(lines):
    lines(0, 0)
    assert lines(1, 10, detail="kappa 3") == [(10, None)]


def test_long_work_is_told_with_the_time_that_is_left(lines):
    lines(0, 0)
    lines(11, 2)
    assert lines(12, 3) == [(2, 44.0)]
    assert lines(50, 10) == [(2, 44.0), (10, None)]


def test_it_is_first_told_after_two_seconds_and_then_at_leisure(lines):
    lines(0, 0)
    assert lines(1.9, 1) == []
    assert lines(2.1, 2) == [(2, pytest.approx(8.4))]
    assert len(lines(11, 3)) == 1
    assert len(lines(12.2, 4)) == 2


def test_work_of_one_step_is_told_when_it_begins(lines):
    assert lines(2, 0, total=1) == [(0, None)]


def test_the_end_of_long_work_without_steps_is_told(lines):
    lines(0, 0)
    assert lines(30, 10) == [(10, None)]


def test_a_second_task_of_a_name_begins_anew(lines):
    lines(0, 0)
    lines(30, 10)
    lines(100, 0)
    assert lines(105, 10) == [(10, None)]


def test_a_line_every_ten_seconds_where_there_is_no_terminal(monkeypatch):
    now, told = [0.0], []
    monkeypatch.setattr(terminal.time, "monotonic", lambda: now[0])
    shown = terminal._PacedLines(lambda p, left: told.append((p.task, p.done, left)))
    for time in range(26):
        now[0] = float(time)
        shown.show(Progress("first" if time < 15 else "second", time % 15, 20.0))
    assert told == [("first", 10, 10.0), ("second", 5, pytest.approx(15.0))]


def test_on_a_terminal_one_line_moves_and_vanishes(monkeypatch):
    written = io.StringIO()
    console = terminal._Console(file=written, force_terminal=True, width=100)
    monkeypatch.setattr(terminal, "err", console)
    with terminal.show_progress("2/7 reduce") as tell:
        for task in ("heuristics", "best-subset"):
            for done in range(3):
                tell(Progress(task, done, 3, "swap"))
        console.file.flush()
    assert "2/7 reduce: best-subset" in written.getvalue()
    assert written.getvalue().count("\n") == 1
    assert written.getvalue().endswith("\x1b[1A\x1b[2K"), "the line is cleared"


def test_after_a_kill_ctrl_c_is_no_wish_to_go_on():
    interruption = terminal.Interruption()
    for number in (signal.SIGTERM, signal.SIGINT):
        with pytest.raises(KeyboardInterrupt):
            interruption._note(number, None)
    with pytest.raises(KeyboardInterrupt):
        interruption.clear()


def test_after_ctrl_c_work_can_go_on():
    interruption = terminal.Interruption()
    with pytest.raises(KeyboardInterrupt):
        interruption._note(signal.SIGINT, None)
    interruption.clear()
    interruption.check()


@pytest.mark.parametrize(("interrupted", "code"), [(False, 2), (True, 130)])
def test_an_error_after_a_signal_is_an_interruption(interrupted, code, monkeypatch):
    """HDF5 fails with an error of its own when it is interrupted while it writes."""
    found = terminal.Interruption()
    monkeypatch.setattr(found, "install", lambda: None)
    monkeypatch.setattr(command_line, "interruption", found)

    def failing(**_):
        if interrupted:
            with contextlib.suppress(KeyboardInterrupt):
                found._note(signal.SIGTERM, None)
        raise ArtifactError("cannot be written")

    monkeypatch.setattr(command_line.cli, "main", failing)
    monkeypatch.setattr(warnings, "showwarning", warnings.showwarning)
    with warnings.catch_warnings(), pytest.raises(SystemExit) as ended:
        command_line.main()
    assert ended.value.code == code


def test_an_interruption_of_a_finaliser_is_not_shown(monkeypatch, capsys):
    """Python shows exceptions there with their traceback; the handler of the signal has noted it."""
    monkeypatch.setattr(sys, "unraisablehook", terminal._show_unraisable)

    class Interrupted:
        def __del__(self):
            raise KeyboardInterrupt

    class Failing:
        def __del__(self):
            raise ValueError("shown")

    Interrupted()
    assert capsys.readouterr().err == ""
    Failing()
    assert "shown" in capsys.readouterr().err
