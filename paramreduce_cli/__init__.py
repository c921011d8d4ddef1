"""paramreduce: the smallest set of dynamic parameters that still predicts a robot's forces.

The functions of :mod:`paramreduce_cli.api` can be used from here::

    import paramreduce as pr

    config = pr.load_config("configs/two_link.yaml")
    model = pr.build_model(config)
"""

from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

if TYPE_CHECKING:
    from paramreduce_cli.api import *  # noqa: F403


def __getattr__(name: str) -> Any:
    """Return a name of the interface, which is loaded at the first one: the command line does without.

    Raises:
        AttributeError: The interface has no such name.
    """
    if name == "__all__" or not name.startswith("_"):
        import paramreduce_cli.api as api

        if name == "__all__" or name in api.__all__:
            return getattr(api, name)
    raise AttributeError(f"module 'paramreduce_cli' has no attribute {name!r}")


def __dir__() -> list[str]:
    """Return all public names, for completion in notebooks and for ``help``."""
    import paramreduce_cli.api as api

    return sorted([*globals(), *api.__all__])
