"""Names that must be known, and suggestions for names that are not."""

import difflib
from collections.abc import Iterable
from typing import Any

from pydantic import GetCoreSchemaHandler, GetJsonSchemaHandler
from pydantic_core import CoreSchema, core_schema

from paramreduce_cli.errors import Key
from paramreduce_cli.records import SelectionMethod
from paramreduce_cli.registry import list_names

_HEURISTICS = "reduction/heuristics"
_TORQUE_ONLY = "reduction/heuristics/torque_only"
_NEAR = 0.72
"""Similarity from which on an unknown name counts as a misspelling of a known name."""
_CRITERIA = "reduction/criteria"


def find_nearest_name(name: str, names: Iterable[str]) -> str | None:
    """Return the known name most similar to ``name``, or None if no name is similar."""
    folded = {candidate.lower().replace("_", "-"): candidate for candidate in names}
    close = difflib.get_close_matches(name.lower().replace("_", "-"), folded, n=1, cutoff=_NEAR)
    return folded[close[0]] if close else None


class UnknownNameError(ValueError):
    """An unknown name.

    Args:
        what: Kind of thing that has such names.
        name: The unknown name.
        choices: All known names.
    """

    def __init__(self, what: str, name: str, choices: Iterable[str]) -> None:
        names = list(choices)
        self.name, self.is_key = name, what == "key"
        self.nearest = find_nearest_name(name, names)
        hint = f"Choose from: {', '.join(names)}." if names else "There is none."
        if self.nearest:
            hint = f"Did you mean {self.nearest}?"
        super().__init__(f"unknown {what} {name!r}. {hint}")


Problem = tuple[Key, str | UnknownNameError]
"""Path of a wrong value in a config, and what is wrong with the value."""


class OneOf:
    """An annotation for text that must be one of the public names in a folder of the package.

    Args:
        kind: Kind of the names, for messages.
        folder: Folder, as for :func:`paramreduce_cli.registry.list_names`.
    """

    def __init__(self, kind: str, folder: str) -> None:
        self._kind, self._folder = kind, folder

    def list_names(self) -> list[str]:
        """Return all known names."""
        return list(list_names(self._folder))

    def __get_pydantic_core_schema__(
        self, source: Any, handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        return core_schema.no_info_after_validator_function(self.check, handler(source))

    def __get_pydantic_json_schema__(
        self, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        return {"type": "string", "enum": self.list_names()}

    def check(self, name: str) -> str:
        """Return the name if it is known.

        Raises:
            ValueError: The name is unknown.
        """
        if name not in self.list_names():
            raise UnknownNameError(self._kind, name, self.list_names())
        return name


class OneMethod(OneOf):
    """An annotation for the text of a :class:`SelectionMethod`."""

    def __init__(self) -> None:
        super().__init__("heuristic", _HEURISTICS)

    def list_names(self) -> list[str]:
        """Return heuristics alone, then with every criterion that they can select by."""
        heuristics, alone = list_names(_HEURISTICS), list_names(_TORQUE_ONLY)
        methods = [
            SelectionMethod(heuristic, criterion)
            for heuristic in heuristics
            if heuristic not in alone
            for criterion in list_names(_CRITERIA)
        ]
        return [*heuristics, *(str(method) for method in methods if not method.by_torque)]

    def check(self, name: str) -> str:
        """Return the name if both its heuristic and its criterion are known and fit.

        Raises:
            ValueError: Heuristic or criterion is not known, or makes no sense with the other.
        """
        method = SelectionMethod.parse(name)
        if method.heuristic in list_names(_HEURISTICS) and "@" in name:
            if method.by_torque:
                raise ValueError(
                    f"{method.heuristic} selects by torque as it is; leave out @torque"
                )
            criteria = [known for known in list_names(_CRITERIA) if known != "torque"]
            if method.criterion not in criteria:
                raise UnknownNameError("criterion", method.criterion, criteria)
            if method.heuristic in list_names(_TORQUE_ONLY):
                raise ValueError(
                    f"{method.heuristic} takes no criterion; it is of the torques alone"
                )
        return super().check(name)
