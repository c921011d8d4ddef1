"""What tests do without to be quick, unless they ask for it: searches for the leanest formulations, and figures."""

import contextlib


class Wanted:
    """What is not left out at present; conftest.py looks here."""

    formulations = False
    figures = False


@contextlib.contextmanager
def searched_formulations():
    """Search the leanest formulations of models that are built meanwhile, as the program does."""
    Wanted.formulations = True
    try:
        yield
    finally:
        Wanted.formulations = False


@contextlib.contextmanager
def drawn_figures():
    """Draw the figures of reports that are made meanwhile, as the program does."""
    Wanted.figures = True
    try:
        yield
    finally:
        Wanted.figures = False
