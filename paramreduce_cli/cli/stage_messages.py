"""What is said of stages that have run."""

from paramreduce_cli.cli.terminal import print_error, say
from paramreduce_cli.running.runner import Outcome

NOT_ACCEPTED = 1


def say_outcome(outcome: Outcome) -> None:
    """Say how long a stage took, and where its artifact is."""
    state = "up to date" if outcome.current else f"{outcome.seconds:.1f} s"
    say(f"{outcome.stage}: {state}, {outcome.path}")


def say_verdict(accepted: bool | None, verdict: str, quiet: bool) -> int:
    """Print the verdict on the selected model, a rejection even if quiet; return the exit code, which is zero unless
    the model is rejected.
    """
    if accepted is False:
        print_error(f"Not accepted: {verdict}")
        return NOT_ACCEPTED
    if not quiet:
        say(verdict)
    return 0
