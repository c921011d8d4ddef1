"""Entry of the command line, also as ``python -m paramreduce_cli``.

The libraries take a moment to load; Ctrl-C must not show their insides meanwhile.
"""

import os
import signal


def main() -> None:
    """Load the command line and run it."""
    signal.signal(signal.SIGINT, lambda *_: os._exit(130))
    from paramreduce_cli.cli import main as run

    run()


if __name__ == "__main__":
    main()
