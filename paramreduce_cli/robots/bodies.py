"""What every way of describing bodies says of them."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from typing import ClassVar, Self

from paramreduce_cli.fields.names import Problem
from paramreduce_cli.fields.section import Section
from paramreduce_cli.records import Body, Length, Loops


class BodiesDescription(Section, ABC):
    """Bodies with their joints; an open tree without named lengths where a way says no more."""

    ROWS: ClassVar[str]
    """Key of the list that has a row for every body."""

    @abstractmethod
    def body_names(self) -> list[str]:
        """Names of all bodies, in order."""

    @abstractmethod
    def parents(self) -> list[str | None]:
        """Names of the parents as they are given, None where the row above is meant."""

    @abstractmethod
    def generalised_names(self) -> list[str]:
        """Names of all coordinates, body by body."""

    @abstractmethod
    def rigid_bodies(self) -> tuple[Body, ...]:
        """The bodies with their joints of one axis each."""

    @property
    @abstractmethod
    def frames(self) -> str:
        """Where the table says that the frames of the bodies are, for people."""

    @abstractmethod
    def table(self) -> tuple[tuple[str, ...], ...]:
        """The geometry for people, a header row first."""

    def inertial_names(self) -> list[str]:
        """Names of the bodies that have inertia."""
        return self.body_names()

    @property
    def closed(self) -> bool:
        """Whether there are loops."""
        return False

    def independent_names(self) -> list[str]:
        """Names of the independent coordinates."""
        return self.generalised_names()

    def driven_names(self) -> list[str]:
        """Names of the independent coordinates of joints, which drives act on as a rule."""
        return self.independent_names()

    def loops(self) -> Loops | None:
        """How the loops are closed, not yet assembled; None for an open tree."""
        return None

    def lengths(self) -> tuple[Length, ...]:
        """Named lengths of the geometry that are not zero."""
        return ()

    def stretched(self, stretch: Callable[[float], float]) -> Self:
        """The same structure with other lengths, as far as these have names."""
        return self

    def problems(self) -> Iterator[Problem]:
        """What does not fit together, by the keys below this section."""
        yield from ()
