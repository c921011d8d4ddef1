"""Bodies of functions of one state, in which the sines and cosines of all angles are taken at once."""

from dataclasses import dataclass

from paramreduce_cli.export.expressions import Language, write_signed
from paramreduce_cli.expressions.functions import Function

SINE, COSINE = "sine", "cosine"
"""Names of the arrays of sines and cosines."""


@dataclass(frozen=True)
class GroupedBody:
    """The operations of a function, as names and texts, in their order."""

    before: list[tuple[str, str]]
    """Operations that angles consist of."""
    angles: list[str]
    """Angles whose sines and cosines are taken."""
    after: list[tuple[str, str]]
    """All other operations."""
    outputs: list[str]
    """Texts of the results, one after the other."""


def group_sines(function: Function, language: Language) -> GroupedBody:
    """Return the body of a function, whose sines and cosines are elements of the arrays ``sine`` and ``cosine``."""
    names = language.write_leaves(function)
    dependence = find_dependence(function)
    rows = {angle: row for row, angle in enumerate(dependence.angles)}
    before: list[tuple[str, str]] = []
    after: list[tuple[str, str]] = []
    for number, node in function.iterate_steps():
        if number in dependence.sine_nodes:
            row = rows[node.operands[0] >> 1]
            names[number] = f"{SINE if node.operation == 'sin' else COSINE}[{row}]"
            continue
        text = language.write_expression(names, node)
        names[number] = f"t{number}"
        (before if number in dependence.angle_operations else after).append((names[number], text))
    outputs = [write_signed(names, value) for value in function.program.outputs]
    return GroupedBody(before, [names[angle] for angle in rows], after, outputs)


@dataclass(frozen=True)
class Dependence:
    """A record of which nodes of a function depend on parameters alone, and which on states."""

    state_dependent: list[bool]
    """Whether each node depends on the state, and not on parameters alone."""
    sine_nodes: set[int]
    """Sines and cosines of what depends on the state, taken all at once."""
    angles: list[int]
    """Nodes whose sines or cosines are taken, each once."""
    angle_operations: set[int]
    """Operations that the angles are made of."""
    output_nodes: set[int]
    """Nodes that the results consist of, besides sines and cosines."""


def find_dependence(function: Function) -> Dependence:
    """Find which nodes the sines need, and which nodes depend on parameters alone."""
    nodes, state_dependent = function.program.nodes, function.find_state_dependent()
    sine_nodes: set[int] = set()
    of_angles: set[int] = set()
    of_outputs = {value >> 1 for value in function.program.outputs}
    for number in range(len(nodes) - 1, -1, -1):
        operands = {value >> 1 for value in nodes[number].operands}
        is_sine = nodes[number].operation in ("sin", "cos") and state_dependent[number]
        if is_sine and number not in of_angles:
            sine_nodes.add(number)
        if is_sine or number in of_angles:
            of_angles |= operands
        if number in of_outputs and number not in sine_nodes:
            of_outputs |= operands
    operations = {number for number, _ in function.iterate_steps()}
    sine_nodes &= operations
    angles = dict.fromkeys(nodes[number].operands[0] >> 1 for number in sorted(sine_nodes))
    return Dependence(state_dependent, sine_nodes, list(angles), of_angles & operations, of_outputs)
