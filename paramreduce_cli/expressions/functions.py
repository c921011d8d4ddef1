"""Named functions with array arguments, ready to be written in a language."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from math import prod

from paramreduce_cli.expressions.graph import Node
from paramreduce_cli.expressions.programs import Program


@dataclass(frozen=True)
class Argument:
    """An array that a function takes or gives."""

    name: str
    """An identifier in every language."""
    shape: tuple[int, ...]
    """One or two lengths; matrices are stored row by row."""
    text: str
    """Meaning of the array, with its unit."""

    @property
    def size(self) -> int:
        """Number of its elements."""
        return prod(self.shape)


@dataclass(frozen=True)
class Function:
    """A straight-line function.

    The program's inputs are the arguments one after the other; its outputs are the results one after the other.
    """

    name: str
    text: str
    """Sentence on what the function computes."""
    arguments: tuple[Argument, ...]
    results: tuple[Argument, ...]
    program: Program

    def list_positions(self, arrays: Sequence[Argument]) -> list[tuple[Argument, int]]:
        """Return for every input or output its array and the position in it."""
        return [(array, k) for array in arrays for k in range(array.size)]

    def find_used_arguments(self) -> set[str]:
        """Return the names of the arguments that the results depend on."""
        positions = self.list_positions(self.arguments)
        numbers = (int(n.number) for n in self.program.nodes if n.operation == "input")
        return {positions[number][0].name for number in numbers}

    def restrict_arguments(self, names: Collection[str]) -> Function:
        """Return the function with only the named arguments, which must include all that it uses."""
        positions = enumerate(self.list_positions(self.arguments))
        kept = [position for position, (argument, _) in positions if argument.name in names]
        arguments = tuple(a for a in self.arguments if a.name in names)
        return replace(self, arguments=arguments, program=self.program.renumber(kept.index))

    def find_state_dependent(self) -> list[bool]:
        """Return which nodes of the program depend on more than the parameters ``phi``."""
        positions = self.list_positions(self.arguments)
        found: list[bool] = []
        for node in self.program.nodes:
            if node.operation == "input":
                found.append(positions[int(node.number)][0].name != "phi")
            else:
                found.append(any(found[value >> 1] for value in node.operands))
        return found

    def describe_cost(self) -> str:
        """Return a sentence on the number of operations, and how many are the same for all states."""
        of_state = self.find_state_dependent()
        once = sum(not of_state[number] for number, _ in self.iterate_steps())
        total = f"{self.program.n_operations} operations"
        return f"{total}, {once} of them on parameters alone." if once else f"{total}."

    def iterate_steps(self) -> Iterator[tuple[int, Node]]:
        """Yield index and node of each operation, in an order in which they can be computed."""
        for number, node in enumerate(self.program.nodes):
            if node.operation not in ("constant", "input"):
                yield number, node
