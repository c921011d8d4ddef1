"""Names that must be known, and the nearest known one to a name that is not."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Iterator
from typing import Any

from pydantic import GetCoreSchemaHandler, GetJsonSchemaHandler
from pydantic_core import CoreSchema, core_schema

from paramreduce_cli.registry import (
    Registry,
    heuristic,
    selection_criterion,
    selects_by_torque_only,
)


def nearest(name: str, known: Iterable[str]) -> str | None:
    """The known name most like ``name``, None if none is near."""
    folded = {candidate.lower().replace("_", "-"): candidate for candidate in known}
    close = difflib.get_close_matches(name.lower().replace("_", "-"), folded, n=1, cutoff=0.55)
    return folded[close[0]] if close else None


def unknown(what: str, name: str, known: Iterable[str]) -> str:
    """A sentence that refuses a name and offers what there is."""
    names = list(known)
    guess = nearest(name, names)
    hint = f"did you mean {guess}?" if guess else f"there is {', '.join(names) or 'none'}."
    return f"{what} {name!r} is not known; {hint}"


class registered:  # noqa: N801 - reads as a type in annotations
    """Annotation for text that must be a name in a registry."""

    def __init__(self, registry: Registry | HeuristicsByCriterion) -> None:
        self._registry = registry

    def __get_pydantic_core_schema__(
        self, source: Any, handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        return core_schema.no_info_after_validator_function(self._check, handler(source))

    def __get_pydantic_json_schema__(
        self, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        return {"type": "string", "enum": list(self._registry)}

    def _check(self, name: str) -> str:
        if isinstance(self._registry, HeuristicsByCriterion):
            self._registry.refuse(name)
        if name not in self._registry:
            raise ValueError(unknown(self._registry.kind, name, self._registry))
        return name


class HeuristicsByCriterion:
    """Names of heuristics, alone (by torque) or as HEURISTIC@CRITERION."""

    kind = "heuristic"

    def __iter__(self) -> Iterator[str]:
        yield from heuristic
        for name, function in heuristic.items():
            if not selects_by_torque_only(function):
                yield from (f"{name}@{by}" for by in selection_criterion if by != "torque")

    def __contains__(self, name: object) -> bool:
        return name in list(self)

    def refuse(self, name: str) -> None:
        """Explain what is wrong with a criterion.

        Raises:
            ValueError: It is not known, or makes no sense with the heuristic.
        """
        who, at, by = name.partition("@")
        criteria = [known for known in selection_criterion if known != "torque"]
        if not at or who not in heuristic:
            return
        if by == "torque":
            raise ValueError(f"{who} selects by torque as it is; leave out @torque")
        if by not in criteria:
            raise ValueError(unknown("criterion", by, criteria))
        if selects_by_torque_only(heuristic[who]):
            raise ValueError(f"{who} takes no criterion; it is of the torques alone")
