"""Named functions with array arguments, ready to be written in some language."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from paramreduce_cli.expressions.graph import Graph, Node
from paramreduce_cli.expressions.operations import Program


@dataclass(frozen=True)
class Argument:
    """An array that a function takes or gives."""

    name: str
    """An identifier in every language."""
    shape: tuple[int, ...]
    """One or two lengths; matrices are stored row by row."""
    text: str
    """What it is, with its unit."""

    @property
    def size(self) -> int:
        """Number of its elements."""
        result = 1
        for length in self.shape:
            result *= length
        return result


@dataclass(frozen=True)
class Function:
    """A straight-line function.

    The inputs of its program count on through the arguments, its outputs through the results.
    """

    name: str
    text: str
    """What it computes, in one sentence."""
    arguments: tuple[Argument, ...]
    results: tuple[Argument, ...]
    program: Program

    def places(self, arrays: Sequence[Argument]) -> list[tuple[Argument, int]]:
        """For every input or output, its array and the position in it."""
        return [(array, k) for array in arrays for k in range(array.size)]

    def used(self) -> set[str]:
        """Names of the arguments that the results depend on."""
        places = self.places(self.arguments)
        numbers = (int(n.number) for n in self.program.nodes if n.operation == "input")
        return {places[number][0].name for number in numbers}

    def without(self, name: str) -> Function:
        """The same without an argument that is not used."""
        kept: list[int] = []
        start = 0
        for argument in self.arguments:
            if argument.name != name:
                kept += range(start, start + argument.size)
            start += argument.size
        place = {old: new for new, old in enumerate(kept)}
        graph = Graph()
        outputs = self.program.rebuilt(graph, lambda position: graph.input(place[position]))
        arguments = tuple(a for a in self.arguments if a.name != name)
        program = Program.of_graph(graph, outputs)
        return Function(self.name, self.text, arguments, self.results, program)

    def steps(self) -> Iterator[tuple[int, Node]]:
        """Numbers and nodes of the operations, in an order in which they can be done."""
        for number, node in enumerate(self.program.nodes):
            if node.operation not in ("constant", "input"):
                yield number, node
