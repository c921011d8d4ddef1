"""The command line: the only place that prints, reads flags and sets exit codes."""

import os
import sys
import warnings
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import click

from paramreduce_cli import __version__
from paramreduce_cli.cli.commands import commands
from paramreduce_cli.cli.next_steps import describe_next_steps
from paramreduce_cli.cli.suggestions import (
    CommandLine,
    UnknownCommandError,
    describe_error,
    describe_usage_error,
    suggest_after_error,
    suggest_after_usage_error,
)
from paramreduce_cli.cli.terminal import (
    interruption,
    print_error,
    say,
    show_errors,
    show_start,
    show_warning,
)
from paramreduce_cli.errors import ParamreduceError, ParamreduceWarning
from paramreduce_cli.stages import stages

WRONG = 2
INTERNAL = 70
INTERRUPTED = 130
PIPE_CLOSED = 141


def main() -> None:
    """Run the command line; every outcome becomes a message and an exit code."""
    interruption.install()
    warnings.simplefilter("once", ParamreduceWarning)
    warnings.showwarning = show_warning
    try:
        code = _call_command()
    except ParamreduceError as error:
        show_errors(describe_error(error, read_command_line()))
        if further := _suggest(suggest_after_error, error):
            print_error(further)
        code = error.exit_code
    except click.ClickException as error:
        show_errors(describe_usage_error(error))
        print_error(_suggest(suggest_after_usage_error, error))
        code = WRONG
    except (KeyboardInterrupt, click.exceptions.Abort):
        print_error(
            "\nInterrupted. Finished stages are kept, and so are finished trajectories, samples, proofs and functions of the "
            "current stage. Run the same command again to continue."
        )
        code = INTERRUPTED
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        code = PIPE_CLOSED
    except OSError as error:
        show_errors(f"cannot go on: {error.strerror or error}.")
        code = WRONG
    except Exception as error:
        if os.environ.get("PARAMREDUCE_DEBUG"):
            raise
        print_error(
            f"Error: something went wrong inside paramreduce ({type(error).__name__}: {error}). "
            "This is a bug; PARAMREDUCE_DEBUG=1 shows where."
        )
        code = INTERNAL
    sys.exit(code if isinstance(code, int) else 0)


def _suggest(suggest: Callable[[Any, CommandLine], str], error: Exception) -> str:
    """Return a suggestion; nothing where the folder cannot be looked at."""
    try:
        return suggest(error, read_command_line())
    except OSError:
        return ""


def read_command_line() -> CommandLine:
    """Return the words of the command line, and the command that they name."""
    name = next((word for word in cli.words if not word.startswith("-")), "")
    return CommandLine(cli.words, cli.get_command(click.Context(cli), name))


def _call_command() -> object:
    """Call the command and return what it returns.

    Raises:
        KeyboardInterrupt: Also where it was raised into a library, which then failed with an error of its own.
    """
    try:
        return cli.main(standalone_mode=False)
    except Exception:
        interruption.check()
        raise


class _Commands(click.Group):
    """The group of all commands, each imported when it is called."""

    words: Sequence[str] = ()
    """Words of the command line after the name of the program."""

    def make_context(
        self,
        info_name: str | None,
        args: list[str],
        parent: click.Context | None = None,
        **extra: Any,
    ) -> click.Context:
        """Note the words of the command line before click takes them apart."""
        self.words = tuple(args)
        return super().make_context(info_name, args, parent, **extra)

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Return the names in alphabetical order."""
        return sorted((*stages, *commands))

    def get_command(self, ctx: click.Context, name: str) -> click.Command | None:
        """Return the command with a name, or None if there is none."""
        if name not in commands and name not in stages:
            return None
        with show_start(name):
            if name in commands:
                command: click.Command = commands[name]
                return command
            from paramreduce_cli.cli.stage_command import make_stage_command

            return make_stage_command(name)

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """Return the requested command as click does; the error about an unknown one suggests a similar one."""
        if args and not args[0].startswith("-") and self.get_command(ctx, args[0]) is None:
            raise UnknownCommandError(args[0], self.list_commands(ctx), ctx)
        return super().resolve_command(ctx, args)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the list of commands with their help, read from their files."""
        rooms = {name: room for room in (stages, commands) for name in room}
        with formatter.section("Commands"):
            formatter.write_dl(
                [(name, rooms[name].read_summary(name)) for name in self.list_commands(ctx)]
            )


@click.group(
    cls=_Commands,
    context_settings={"help_option_names": ["-h", "--help"]},
    invoke_without_command=True,
)
@click.version_option(__version__, prog_name="paramreduce")
@click.pass_context
def cli(context: click.Context) -> None:
    """Find the smallest set of dynamic parameters that still predicts a robot's forces.

    A robot is one YAML file; results go to results/ROBOT. Start with
    `paramreduce init --example two_link`, or `paramreduce init my_robot.urdf` for your own; without a
    command it says what to do next in this folder.
    """
    if context.invoked_subcommand is None:
        say("\n".join(describe_next_steps(Path())))
