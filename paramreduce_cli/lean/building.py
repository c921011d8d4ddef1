"""The outputs of a lean model in a graph, for given choices at the joints."""

from collections.abc import Callable, Collection, Sequence

from paramreduce_cli.expressions.graph import Graph
from paramreduce_cli.lean.choices import JointFormulation
from paramreduce_cli.lean.direct import mass_matrix
from paramreduce_cli.lean.drives import with_drives, with_rotors
from paramreduce_cli.lean.inverse import torques
from paramreduce_cli.lean.kinematics import Kinematics
from paramreduce_cli.lean.tree import Tree

Build = Callable[[Tree, Sequence[JointFormulation], Graph, Collection[int]], list[int]]
"""Makes the outputs of a model in a graph: tree, choices, graph, dropped parameters."""


def inverse_outputs(
    tree: Tree, choices: Sequence[JointFormulation], graph: Graph, dropped: Collection[int] = ()
) -> list[int]:
    """Torques, (n_q,)."""
    kinematics = Kinematics(tree, choices, graph, dropped=dropped)
    found = with_drives(tree, kinematics.symbols, torques(kinematics), moving=True)
    return [torque.value for torque in found]


def direct_outputs(
    tree: Tree, choices: Sequence[JointFormulation], graph: Graph, dropped: Collection[int] = ()
) -> list[int]:
    """The lower triangle of M, row by row, then delta."""
    kinematics = Kinematics(tree, choices, graph, moving=False, dropped=dropped)
    symbols = kinematics.symbols
    M = with_rotors(tree, symbols, mass_matrix(kinematics))
    bias = with_drives(tree, symbols, torques(kinematics), moving=False)
    return [entry.value for row in [*M, bias] for entry in row]
