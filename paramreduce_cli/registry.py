"""Names to functions: everything that is chosen by name in a config or at the shell.

A registry knows the package its functions live in and imports that package's modules when it
is first asked, so that a new file with a decorated function is all it takes to add one.
"""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Callable, Iterator
from typing import Any, TypeVar

F = TypeVar("F", bound=Callable[..., Any])


class Registry:
    """Functions by their public names, in the order of registration.

    Args:
        kind: What its entries are, for messages.
        package: Where they are defined.
    """

    def __init__(self, kind: str, package: str) -> None:
        self.kind = kind
        self._package = package
        self._loaded = False
        self._entries: dict[str, Callable[..., Any]] = {}

    def __call__(self, name: str) -> Callable[[F], F]:
        """Decorate a function to enter it under ``name``."""

        def enter(function: F) -> F:
            if name in self._entries:
                raise ValueError(f"{self.kind} {name} is registered twice")
            self._entries[name] = function
            return function

        return enter

    def _all(self) -> dict[str, Callable[..., Any]]:
        if not self._loaded:
            package = importlib.import_module(self._package)
            for module in pkgutil.iter_modules(package.__path__):
                importlib.import_module(f"{self._package}.{module.name}")
            self._loaded = True
        return self._entries

    def __getitem__(self, name: str) -> Callable[..., Any]:
        return self._all()[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._all())

    def __contains__(self, name: object) -> bool:
        return name in self._all()

    def __len__(self) -> int:
        return len(self._all())

    def items(self) -> list[tuple[str, Callable[..., Any]]]:
        """Names with their functions."""
        return list(self._all().items())


heuristic = Registry("heuristic", "paramreduce_cli.reduction")
criterion = Registry("criterion", "paramreduce_cli.excitation")
selection_criterion = Registry("criterion", "paramreduce_cli.reduction")
scaling = Registry("scaling", "paramreduce_cli.excitation")
exporter = Registry("exporter", "paramreduce_cli.export")
figure = Registry("figure", "paramreduce_cli.report")
table = Registry("table", "paramreduce_cli.report")
_stages = Registry("stage", "paramreduce_cli.stages")


def torque_only(function: F) -> F:
    """Declare a heuristic that makes sense for the torque error alone."""
    function.torque_only = True  # type: ignore[attr-defined]
    return function


def selects_by_torque_only(function: Callable[..., Any]) -> bool:
    """Whether a heuristic was declared so."""
    return getattr(function, "torque_only", False)


def stage(function: F) -> F:
    """Declare a stage: its signature says what it reads and writes, its name what it is called."""
    return _stages(function.__name__.replace("_", "-"))(function)


def stages() -> dict[str, Callable[..., Any]]:
    """The declared stages by command name."""
    return dict(_stages.items())
