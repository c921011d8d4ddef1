"""The command line: the only place that prints, reads flags and sets exit codes."""

import os
import sys
import warnings
from collections.abc import Callable
from pathlib import Path

import click

from paramreduce_cli import __version__
from paramreduce_cli.cli.commands import commands
from paramreduce_cli.cli.hints import after, after_usage, meant_command, of_usage, with_arguments
from paramreduce_cli.cli.next_step import next_steps
from paramreduce_cli.cli.terminal import (
    complain,
    interruption,
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
        code = _called()
    except ParamreduceError as error:
        message = _hint(with_arguments, str(error)) or str(error)
        show_errors(message)
        if further := _hint(after, message, _command()):
            complain(further)
        code = error.exit_code
    except click.ClickException as error:
        show_errors(of_usage(error))
        complain(_hint(after_usage, error))
        code = WRONG
    except (KeyboardInterrupt, click.exceptions.Abort):
        complain(
            "\nInterrupted. Finished stages, trajectories and proofs are kept, of other stages nothing: the same command goes "
            "on from there."
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
        complain(
            f"Error: something went wrong inside paramreduce ({type(error).__name__}: {error}). "
            "This is a bug; PARAMREDUCE_DEBUG=1 shows where."
        )
        code = INTERNAL
    sys.exit(code if isinstance(code, int) else 0)


def _hint(made: Callable[..., str], *arguments: object) -> str:
    """What is made, or nothing: what cannot be looked at here must not hide the error itself."""
    try:
        return made(*arguments)
    except Exception:
        if os.environ.get("PARAMREDUCE_DEBUG"):
            raise
        return ""


def _command() -> click.Command | None:
    """The one that was called; None where there is no such command."""
    name = next((word for word in sys.argv[1:] if not word.startswith("-")), "")
    return cli.get_command(click.Context(cli), name)


def _called() -> object:
    """What the command returns.

    Raises:
        KeyboardInterrupt: Also where it was raised into a library, which then failed with an error of its own.
    """
    try:
        return cli.main(standalone_mode=False)
    except Exception:
        interruption.check()
        raise


class _Commands(click.Group):
    """The stages and the other commands, each imported when it is called."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Names, in alphabetical order."""
        return sorted((*stages, *commands))

    def get_command(self, ctx: click.Context, name: str) -> click.Command | None:
        """The command with a name; None if there is none."""
        if name not in commands and name not in stages:
            return None
        with show_start(name):
            if name in commands:
                command: click.Command = commands[name]
                return command
            from paramreduce_cli.cli.stage_command import stage_command

            return stage_command(name)

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """The command that is asked for, or the one that was meant."""
        if args and not args[0].startswith("-") and self.get_command(ctx, args[0]) is None:
            raise click.UsageError(meant_command(args[0], self.list_commands(ctx)), ctx)
        return super().resolve_command(ctx, args)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """List them with what they do, read from their files."""
        rooms = {name: room for room in (stages, commands) for name in room}
        with formatter.section("Commands"):
            formatter.write_dl(
                [(name, rooms[name].summary(name)) for name in self.list_commands(ctx)]
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
        say("\n".join(next_steps(Path())))
