"""The outputs of a lean model in a graph, for given choices at the joints."""

from collections.abc import Callable, Collection, Sequence

from paramreduce_cli.expressions.graph import Graph
from paramreduce_cli.lean.algebra import Scalar
from paramreduce_cli.lean.direct import build_mass_matrix
from paramreduce_cli.lean.drive_torques import add_drives, add_rotors
from paramreduce_cli.lean.inverse import build_torques
from paramreduce_cli.lean.joint_formulations import JointFormulation
from paramreduce_cli.lean.joint_frames import Tree
from paramreduce_cli.lean.joint_states import Kinematics, RestSymbols, Symbols
from paramreduce_cli.records import Kind

Build = Callable[[Tree, Sequence[JointFormulation], Graph, Collection[int]], list[int]]
"""Makes the outputs of a model in a graph: tree, choices, graph, dropped parameters."""


def build_inverse_outputs(
    tree: Tree, choices: Sequence[JointFormulation], graph: Graph, dropped: Collection[int] = ()
) -> list[int]:
    """Return the torques of all joints as outputs of a graph, (n_q,)."""
    kinematics = Kinematics(tree, choices, Symbols(graph, tree, dropped))
    gravity = _build_nominal_gravity(tree, choices, graph, dropped)
    found = add_drives(tree, kinematics.symbols, build_torques(kinematics), gravity, moving=True)
    return [torque.value for torque in found]


def build_direct_outputs(
    tree: Tree, choices: Sequence[JointFormulation], graph: Graph, dropped: Collection[int] = ()
) -> list[int]:
    """Return the lower triangle of M, row by row, then delta, as outputs of a graph."""
    kinematics = Kinematics(tree, choices, Symbols(graph, tree, dropped), moving=False)
    symbols = kinematics.symbols
    M = add_rotors(tree, symbols, build_mass_matrix(kinematics))
    gravity = _build_nominal_gravity(tree, choices, graph, dropped)
    bias = add_drives(tree, symbols, build_torques(kinematics), gravity, moving=False)
    return [entry.value for row in [*M, bias] for entry in row]


def _build_nominal_gravity(
    tree: Tree, choices: Sequence[JointFormulation], graph: Graph, dropped: Collection[int]
) -> list[Scalar]:
    """Return the nominal torques of gravity, (n_q,); an empty list if no parameter that is kept needs them."""
    loads = [drive.columns[Kind.LOAD] for drive in tree.drives if Kind.LOAD in drive.columns]
    if tree.nominal is None or all(position in dropped for position in loads):
        return []
    symbols = RestSymbols(graph, tree, tree.nominal)
    return build_torques(Kinematics(tree, choices, symbols, moving=False))
