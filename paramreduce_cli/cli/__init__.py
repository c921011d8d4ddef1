"""The command line: the only place that prints, reads flags and sets exit codes."""

import os
import sys
import warnings

import click

from paramreduce_cli import __version__
from paramreduce_cli.cli import files
from paramreduce_cli.cli.export import export
from paramreduce_cli.cli.stages import run, stage_command
from paramreduce_cli.cli.terminal import err, interruption, say, show_errors, show_warning
from paramreduce_cli.errors import ParamreduceError, ParamreduceWarning
from paramreduce_cli.pipeline import pipeline

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
        code = cli.main(standalone_mode=False)
    except ParamreduceError as error:
        show_errors(str(error))
        code = error.exit_code
    except click.exceptions.NoArgsIsHelpError as error:
        say(error.format_message())
        code = WRONG
    except click.ClickException as error:
        error.show()
        code = WRONG
    except (KeyboardInterrupt, click.exceptions.Abort):
        err.print("\nInterrupted. What is finished is kept: the same command goes on from there.")
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
        err.print(
            f"Error: something went wrong inside paramreduce ({type(error).__name__}: {error}). "
            "This is a bug; PARAMREDUCE_DEBUG=1 shows where.",
            markup=False,
        )
        code = INTERNAL
    sys.exit(code if isinstance(code, int) else 0)


@click.group(context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, prog_name="paramreduce")
def cli() -> None:
    """Find the smallest set of dynamic parameters that still predicts a robot's forces.

    A robot is one YAML file; results go to results/ROBOT. Start with
    `paramreduce run configs/two_link.yaml`, or `paramreduce init --dh my_arm` for your own.
    """


for _stage in pipeline():
    cli.add_command(stage_command(_stage))
for _command in (
    run,
    export,
    files.schema,
    files.init,
    files.inspect,
    files.compare_command,
    files.table_command,
    files.graph,
):
    cli.add_command(_command)
