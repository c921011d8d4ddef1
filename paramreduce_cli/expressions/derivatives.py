"""Derivatives of values in a graph, by forward and by reverse accumulation."""

from collections.abc import Callable, Sequence

from paramreduce_cli.expressions.graph import ZERO, Graph

Rule = Callable[[Graph, int, int], int]
"""Returns the derivative of a function of one value, given the reference to the value and to the function's result."""


def differentiate(graph: Graph, outputs: Sequence[int], position: int) -> list[int]:
    """Return the references to the derivatives of outputs by one input; derivatives of jumps are zero.

    Args:
        graph: Graph of the outputs, which derivatives are added to.
        outputs: References to the outputs.
        position: Position of the input.

    Raises:
        NotImplementedError: An output depends on the input through a function without a rule.
    """
    derivatives: dict[int, int] = {}

    def get_derivative(value: int) -> int:
        """Return the derivative of a reference."""
        found = derivatives.get(value >> 1, ZERO)
        return graph.negate(found) if value & 1 else found

    for number in graph.find_reached(list(outputs)):
        operation, operands, size = graph.nodes[number]
        if operation == "input" and size == position:
            derivatives[number] = graph.constant(1.0)
            continue
        moved = [get_derivative(value) for value in operands]
        if any(value != ZERO for value in moved):
            result = _differentiate_node(graph, operation, operands, moved, 2 * number)
            derivatives[number] = result
    return [get_derivative(value) for value in outputs]


def find_gradient(graph: Graph, output: int) -> dict[int, int]:
    """Return the references to the derivatives of one output by all inputs, by the inputs' positions; derivatives of jumps
    are zero.

    Args:
        graph: Graph of the output, which derivatives are added to.
        output: Reference to the output.

    Returns:
        Only inputs with a derivative that is not zero throughout.

    Raises:
        NotImplementedError: The output depends on an input through a function without a rule.
    """
    adjoints = {output >> 1: graph.constant(-1.0 if output & 1 else 1.0)}
    gradient: dict[int, int] = {}
    for number in reversed(list(graph.find_reached([output]))):
        adjoint = adjoints.pop(number, ZERO)
        operation, operands, size = graph.nodes[number]
        if adjoint == ZERO or operation == "constant":
            continue
        if operation == "input":
            gradient[int(size)] = adjoint
            continue
        for k, value in enumerate(operands):
            slope = _find_slope(graph, operation, operands, k, 2 * number)
            part = graph.multiply(adjoint, slope)
            part = graph.negate(part) if value & 1 else part
            adjoints[value >> 1] = graph.add(adjoints.get(value >> 1, ZERO), part)
    return gradient


def _find_slope(graph: Graph, operation: str, operands: Sequence[int], k: int, result: int) -> int:
    """Return the derivative of a node by its operand k."""
    if operation == "+":
        return graph.constant(1.0)
    if operation == "neg":
        return graph.constant(-1.0)
    if operation == "*":
        return operands[1 - k]
    if operation == "/":
        inverse = graph.call("inv", operands[1])
        return inverse if k == 0 else graph.negate(graph.multiply(result, inverse))
    return _get_rule(operation)(graph, operands[0], result)


def _differentiate_node(
    graph: Graph, operation: str, operands: Sequence[int], moved: Sequence[int], result: int
) -> int:
    """Return the derivative of a node from those of its operands."""
    if operation == "+":
        return graph.add(*moved)
    if operation == "neg":
        return graph.negate(moved[0])
    if operation == "*":
        (a, b), (da, db) = operands, moved
        return graph.add(graph.multiply(da, b), graph.multiply(a, db))
    if operation == "/":
        (_, b), (da, db) = operands, moved
        return graph.call("/", graph.subtract(da, graph.multiply(result, db)), b)
    return graph.multiply(_get_rule(operation)(graph, operands[0], result), moved[0])


def _get_rule(operation: str) -> Rule:
    """Return the rule for a function of one value.

    Raises:
        NotImplementedError: There is no rule.
    """
    if operation not in _SLOPES:
        raise NotImplementedError(f"there is no derivative of {operation}")
    return _SLOPES[operation]


def _subtract_square(graph: Graph, value: int) -> int:
    """Return one minus the square of a value."""
    return graph.subtract(graph.constant(1.0), graph.multiply(value, value))


_SLOPES: dict[str, Rule] = {
    "sin": lambda graph, value, result: graph.call("cos", value),
    "cos": lambda graph, value, result: graph.negate(graph.call("sin", value)),
    "inv": lambda graph, value, result: graph.negate(graph.multiply(result, result)),
    "sqrt": lambda graph, value, result: graph.multiply(
        graph.constant(0.5), graph.call("inv", result)
    ),
    "tanh": lambda graph, value, result: _subtract_square(graph, result),
    "sign": lambda graph, value, result: ZERO,
}
"""Slopes of functions of one value."""
