"""Names that must be known, and the nearest known one to a name that is not."""

import difflib
from collections.abc import Iterable
from typing import Any

from pydantic import GetCoreSchemaHandler, GetJsonSchemaHandler
from pydantic_core import CoreSchema, core_schema

from paramreduce_cli.errors import Key
from paramreduce_cli.records import SelectionMethod
from paramreduce_cli.registry import offered

_HEURISTICS = "reduction/heuristics"
_TORQUE_ONLY = "reduction/heuristics/torque_only"
_NEAR = 0.72
"""Likeness from which on a name is a slip of another, and not a word of its own."""
_CRITERIA = "reduction/criteria"


def nearest(name: str, known: Iterable[str]) -> str | None:
    """The known name most like ``name``, None if none is near."""
    folded = {candidate.lower().replace("_", "-"): candidate for candidate in known}
    close = difflib.get_close_matches(name.lower().replace("_", "-"), folded, n=1, cutoff=_NEAR)
    return folded[close[0]] if close else None


class UnknownNameError(ValueError):
    """A name that is not known.

    Args:
        what: Kind of thing that the name is of.
        name: The name.
        known: Names that there are.
    """

    def __init__(self, what: str, name: str, known: Iterable[str]) -> None:
        names = list(known)
        self.name, self.is_key = name, what == "key"
        self.nearest = nearest(name, names)
        hint = f"there is {', '.join(names) or 'none'}."
        if self.nearest:
            hint = f"did you mean {self.nearest}?"
        super().__init__(f"{what} {name!r} is not known; {hint}")


Problem = tuple[Key, str | UnknownNameError]
"""What is wrong with a value of a config, and its key."""


class OneOf:
    """Annotation for text that must be one of the names that a room offers.

    Args:
        kind: What they are names of, for messages.
        folder: The room, as for :func:`paramreduce_cli.registry.offered`.
    """

    def __init__(self, kind: str, folder: str) -> None:
        self._kind, self._folder = kind, folder

    def names(self) -> list[str]:
        """All that is known."""
        return list(offered(self._folder))

    def __get_pydantic_core_schema__(
        self, source: Any, handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        return core_schema.no_info_after_validator_function(self.check, handler(source))

    def __get_pydantic_json_schema__(
        self, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        return {"type": "string", "enum": self.names()}

    def check(self, name: str) -> str:
        """The name itself.

        Raises:
            ValueError: It is not known.
        """
        if name not in self.names():
            raise UnknownNameError(self._kind, name, self.names())
        return name


class OneMethod(OneOf):
    """Annotation for the text of a :class:`SelectionMethod`."""

    def __init__(self) -> None:
        super().__init__("heuristic", _HEURISTICS)

    def names(self) -> list[str]:
        """Heuristics alone, then with every criterion that they can select by."""
        heuristics, alone = offered(_HEURISTICS), offered(_TORQUE_ONLY)
        methods = [
            SelectionMethod(heuristic, criterion)
            for heuristic in heuristics
            if heuristic not in alone
            for criterion in offered(_CRITERIA)
        ]
        return [*heuristics, *(str(method) for method in methods if not method.by_torque)]

    def check(self, name: str) -> str:
        """The name itself.

        Raises:
            ValueError: Heuristic or criterion is not known, or makes no sense with the other.
        """
        method = SelectionMethod.parse(name)
        if method.heuristic in offered(_HEURISTICS) and "@" in name:
            if method.by_torque:
                raise ValueError(
                    f"{method.heuristic} selects by torque as it is; leave out @torque"
                )
            criteria = [known for known in offered(_CRITERIA) if known != "torque"]
            if method.criterion not in criteria:
                raise UnknownNameError("criterion", method.criterion, criteria)
            if method.heuristic in offered(_TORQUE_ONLY):
                raise ValueError(
                    f"{method.heuristic} takes no criterion; it is of the torques alone"
                )
        return super().check(name)
