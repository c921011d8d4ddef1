"""Base class of the ways to describe bodies."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from typing import ClassVar, Self

from paramreduce_cli.fields.names import Problem
from paramreduce_cli.fields.section import Section
from paramreduce_cli.records import Body, Length, Loops


class BodiesDescription(Section, ABC):
    """A description of bodies with their joints; by default an open tree without named lengths."""

    ROWS: ClassVar[str]
    """Key of the list that has a row for every body."""

    @abstractmethod
    def list_body_names(self) -> list[str]:
        """Return the names of all bodies, in order."""

    @abstractmethod
    def list_parents(self) -> list[str | None]:
        """Return the names of the parents as they are given; None where the body of the row above is meant."""

    @abstractmethod
    def list_coordinates(self) -> list[str]:
        """Return the names of all generalised coordinates, body by body."""

    @abstractmethod
    def build_bodies(self) -> tuple[Body, ...]:
        """Return the bodies with their joints of one axis each."""

    @property
    @abstractmethod
    def frames(self) -> str:
        """Sentence on the frames of the bodies, for the table of the geometry."""

    @abstractmethod
    def build_table(self) -> tuple[tuple[str, ...], ...]:
        """Return the geometry as a table for people, with a header row first."""

    def list_inertial_bodies(self) -> list[str]:
        """Return the names of the bodies that have inertia."""
        return self.list_body_names()

    @property
    def closed(self) -> bool:
        """Whether there are loops."""
        return False

    def list_independent_coordinates(self) -> list[str]:
        """Return the names of the independent coordinates."""
        return self.list_coordinates()

    def list_driven_coordinates(self) -> list[str]:
        """Return the names of the independent coordinates that drives act on by default."""
        return self.list_independent_coordinates()

    def build_loops(self) -> Loops | None:
        """Return the closures of the loops, not yet assembled, or None for an open tree."""
        return None

    def list_lengths(self) -> tuple[Length, ...]:
        """Return the named lengths of the geometry that are not zero."""
        return ()

    def stretch(self, stretch: Callable[[float], float]) -> Self:
        """Return the same structure with other lengths, as far as lengths have names."""
        return self

    def find_problems(self) -> Iterator[Problem]:
        """Yield contradictions in the description, by the keys below this section."""
        yield from ()
