"""Whether tests search the leanest formulations of a model, as the program does."""

import contextlib


class Formulations:
    """Whether formulations are searched; conftest.py takes those that searches begin with otherwise."""

    searched = False


@contextlib.contextmanager
def searched_formulations():
    """Search the leanest formulations of models that are built meanwhile."""
    Formulations.searched = True
    yield
    Formulations.searched = False
