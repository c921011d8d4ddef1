"""Entry of the command line, also as ``python -m paramreduce_cli``.

The libraries take a moment to load; Ctrl-C must not show their insides meanwhile. Linear algebra
keeps to one thread unless the user says otherwise: the matrices here are narrow, and what takes long
runs in workers. Figures go to files, whatever windows are asked for elsewhere.
"""

import os
import signal


def main() -> None:
    """Load the command line and run it.

    Linear algebra gets one thread unless the user sets a number, figures go to files, and Ctrl-C ends the process also
    while libraries load.
    """
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    os.environ["MPLBACKEND"] = "agg"
    signal.signal(signal.SIGINT, lambda *_: os._exit(130))
    from paramreduce_cli.cli import main as run

    run()


if __name__ == "__main__":
    main()
