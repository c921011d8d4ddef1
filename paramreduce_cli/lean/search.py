"""Find the choices that take the fewest operations.

One joint after the other, from the tips inwards, the best alternative is taken until none saves
anything. Subtrees on the base share nothing, so each is searched by itself, and equal ones once.
What is best depends on the parameters that are kept; :func:`formulations` searches for all, for
the base parameters and for the few that matter most: masses, first moments and the moments of
inertia about the joints' own axes.
"""

from collections.abc import Callable, Collection, Sequence
from dataclasses import replace

import numpy as np

from paramreduce_cli.expressions.graph import Graph
from paramreduce_cli.lean.algebra import forget
from paramreduce_cli.lean.choices import JointFormulation, Place, alternatives, to_data
from paramreduce_cli.lean.direct import mass_matrix
from paramreduce_cli.lean.inverse import torques
from paramreduce_cli.lean.kinematics import Kinematics
from paramreduce_cli.lean.motion import Rates
from paramreduce_cli.lean.tree import Joint, Tree, lean_tree
from paramreduce_cli.records import BASE, BoolArray, Formulations, IntArray, Kind, Mechanism

Build = Callable[[Tree, Sequence[JointFormulation], Graph, Collection[int]], list[int]]
"""Makes the outputs of a model in a graph: tree, choices, graph, dropped parameters."""

_FIRST_MOMENTS = (Kind.M, Kind.MX, Kind.MY, Kind.MZ)
_MOMENTS = (Kind.IXX, Kind.IYY, Kind.IZZ)
_INVERSE_STARTS = (
    JointFormulation(),
    JointFormulation(aligned=True),
    JointFormulation(mass=Place.REST, axial=Place.REST),
    JointFormulation(aligned=True, radial=Place.REST, rates=Rates.DIRECT),
)
_AT_REST = JointFormulation(
    aligned=True, rates=Rates.DIRECT, radial=Place.REST, polar=Place.REST, tilt=Place.REST,
    plane=Place.REST,
)  # fmt: skip
_COMPOSITE = JointFormulation(
    radial=Place.BEFORE, polar=Place.BEFORE, tilt=Place.BEFORE, plane=Place.BEFORE
)
"""The bias from the composite bodies that the mass matrix is made of."""
_DIRECT_STARTS = (_COMPOSITE, replace(_COMPOSITE, aligned=True), _AT_REST, *_INVERSE_STARTS)
"""The same at all joints: the search starts from the first, and all stay beside what it finds, as
they suit odd sets of few parameters."""


def inverse_outputs(
    tree: Tree, choices: Sequence[JointFormulation], graph: Graph, dropped: Collection[int] = ()
) -> list[int]:
    """Torques, (n_q,)."""
    kinematics = Kinematics(tree, choices, graph, dropped=dropped)
    return [torque.value for torque in torques(kinematics)]


def direct_outputs(
    tree: Tree, choices: Sequence[JointFormulation], graph: Graph, dropped: Collection[int] = ()
) -> list[int]:
    """The lower triangle of M, row by row, then delta."""
    kinematics = Kinematics(tree, choices, graph, moving=False, dropped=dropped)
    M = [entry.value for row in mass_matrix(kinematics) for entry in row]
    return M + [torque.value for torque in torques(kinematics)]


_found: dict[tuple, list[JointFormulation]] = {}
"""What was searched in this process already: equal branches of one mechanism, or of several."""


def formulations(mechanism: Mechanism, affecting: BoolArray, base: IntArray) -> Formulations:
    """Search the formulations of a mechanism.

    Args:
        mechanism: Its tree is what counts.
        affecting: Parameters that change the torques at all, (n_parameters,).
        base: Indices of the base parameters.

    Returns:
        Choices for the inverse and for the direct dynamics, each different set once.
    """
    tree = lean_tree(mechanism)
    everything = set(range(affecting.size))
    useless = everything - set(affecting.nonzero()[0].tolist())
    regrouped = everything - set(base.tolist())
    minor = useless | (everything - _main_parameters(tree))

    def searched(
        build: Build, starts: tuple[JointFormulation, ...]
    ) -> tuple[tuple[dict[str, str | bool], ...], ...]:
        same, *others = ([start] * len(tree.joints) for start in starts)
        full = best_choices(tree, build, same, useless)
        of_base = best_choices(tree, build, full, regrouped)
        of_few = best_choices(tree, build, same, minor)
        found = dict.fromkeys(map(tuple, [full, of_base, of_few, same, *others]))
        return tuple(tuple(map(to_data, one)) for one in found)

    found = Formulations(
        searched(inverse_outputs, _INVERSE_STARTS), searched(direct_outputs, _DIRECT_STARTS)
    )
    forget()
    return found


def _main_parameters(tree: Tree) -> set[int]:
    """Positions of masses, first moments and the moments of inertia about the joints' axes."""
    result = set()
    for joint in tree.joints:
        axis = np.abs(joint.described_to_axis[2, :3])
        kinds = (*_FIRST_MOMENTS, _MOMENTS[int(np.argmax(axis))])
        result |= {joint.columns[kind] for kind in kinds if kind in joint.columns}
    return result


def best_choices(
    tree: Tree, build: Build, start: Sequence[JointFormulation], dropped: Collection[int]
) -> list[JointFormulation]:
    """Choices from which no single change saves an operation.

    Args:
        tree: The tree.
        build: The model.
        start: One choice per joint.
        dropped: Positions of parameters that are zero.
    """
    result = list(start)
    for branch in _branches(tree):
        part, some = _restricted(tree, branch, dropped)
        begin = [result[i] for i in branch]
        key = (build, _signature(part), frozenset(some), tuple(begin))
        if key not in _found:
            _found[key] = _descended(part, build, begin, some)
        for i, choice in zip(branch, _found[key], strict=True):
            result[i] = choice
    return result


def _descended(
    tree: Tree, build: Build, start: Sequence[JointFormulation], dropped: Collection[int]
) -> list[JointFormulation]:
    choices, graph = list(start), Graph()

    def count(candidate: Sequence[JointFormulation]) -> int:
        return graph.count(build(tree, candidate, graph, dropped))

    best = count(choices)
    waiting = len(choices)
    i = len(choices) - 1
    while waiting:
        changed = False
        while True:
            options = alternatives(choices[i], tree.joints[i])
            counts = [count([*choices[:i], option, *choices[i + 1 :]]) for option in options]
            if min(counts, default=best) >= best:
                break
            best = min(counts)
            choices[i] = options[counts.index(best)]
            changed = True
        waiting = len(choices) - 1 if changed else waiting - 1
        i = (i - 1) % len(choices)
    return choices


def _branches(tree: Tree) -> list[list[int]]:
    """Joints of every subtree on the base."""
    roots: list[int] = []
    for i, joint in enumerate(tree.joints):
        roots.append(i if joint.parent == BASE else roots[joint.parent])
    return [[i for i, root in enumerate(roots) if root == first] for first in sorted(set(roots))]


def _restricted(
    tree: Tree, branch: list[int], dropped: Collection[int]
) -> tuple[Tree, frozenset[int]]:
    """A subtree as a tree of its own, in the base turned as its first joint is."""
    place = {i: k for k, i in enumerate(branch)}
    positions = [p for i in branch for p in tree.joints[i].columns.values()]
    renumbered = {position: k for k, position in enumerate(positions)}
    joints = [
        replace(
            joint,
            parent=place.get(joint.parent, BASE),
            columns={kind: renumbered[position] for kind, position in joint.columns.items()},
        )
        for joint in (tree.joints[i] for i in branch)
    ]
    some = frozenset(renumbered[position] for position in positions if position in dropped)
    return Tree(tuple(joints), tree.gravity, len(positions)), some


def _signature(tree: Tree) -> tuple:
    """Equal for trees with equal counts."""

    def of(joint: Joint) -> tuple:
        placed = (joint.place.tobytes(), joint.turn.tobytes())
        if joint.parent == BASE:
            placed = ((joint.turn.T @ tree.gravity).round(12).tobytes(), b"")
        moving = (joint.parent, joint.revolute, joint.sign, joint.offset, joint.parallel)
        return (*moving, placed, joint.described_to_axis.tobytes(), tuple(joint.columns.items()))

    return tuple(map(of, tree.joints))
