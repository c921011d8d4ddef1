"""Find the choices that take the fewest operations.

One joint after the other, from the tips inwards, the best alternative is taken until none saves
anything. What is counted is the part of the tree around the joint, carried by whatever is before it,
so that the work grows with the number of joints; only what wrenches meet that are handed on from far
beyond is decided on the whole. Subtrees on the base share nothing, so each is searched by itself, and equal ones once.
"""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace

from paramreduce_cli.expressions.graph import Graph
from paramreduce_cli.lean.algebra import forget
from paramreduce_cli.lean.joint_formulations import (
    JointFormulation,
    list_alternatives,
    list_distant_alternatives,
)
from paramreduce_cli.lean.joint_frames import Joint, Tree
from paramreduce_cli.lean.lean_outputs import Build
from paramreduce_cli.records import BASE, Rigid

Options = Callable[[JointFormulation, Joint], list[JointFormulation]]
"""Gives the alternatives to a choice at a joint."""

_BEFORE = 3
"""Joints before one that are looked at for most of its choices, and those just beyond: what these
change further away is the same for all alternatives, or nearly."""
_LOOKS = 4
"""Looks at a joint, at most: what is best here and what is best there may take turns."""
_found: dict[tuple, list[JointFormulation]] = {}
"""What was searched in this process already: equal branches of one mechanism, or of several."""


def search_choices(
    tree: Tree, build: Build, start: Sequence[JointFormulation], dropped: Collection[int]
) -> list[JointFormulation]:
    """Search choices from which no single change saves an operation.

    Args:
        tree: Tree to formulate.
        build: Function that builds the model.
        start: Formulations to start from, one per joint.
        dropped: Positions of parameters that are zero.
    """
    result = list(start)
    for branch in _split_branches(tree):
        part, some = _extract_subtree(tree, branch, dropped)
        begin = [result[i] for i in branch]
        key = (build, _make_signature(part), frozenset(some), tuple(begin))
        if key not in _found:
            _found[key] = _search_pieces(part, build, begin, some)
        for i, choice in zip(branch, _found[key], strict=True):
            result[i] = choice
    return result


@dataclass(frozen=True)
class _Piece:
    """A part of the tree that is counted to compare the alternatives at a joint."""

    joints: list[int]
    tree: Tree
    """Tree of these joints alone."""
    dropped: Collection[int]


def _search_pieces(
    tree: Tree, build: Build, start: Sequence[JointFormulation], dropped: Collection[int]
) -> list[JointFormulation]:
    """Improve the choices of a tree that is small or a single branch: first near each joint, then as a whole."""
    pieces = []
    for i in range(len(start)):
        joints = _find_near_joints(tree, i)
        pieces.append(_Piece(joints, *_extract_subtree(tree, joints, dropped)))
    whole = _Piece(list(range(len(start))), tree, dropped)
    choices = _improve_choices(tree, start, build, pieces, list_alternatives)
    return _improve_choices(tree, choices, build, [whole] * len(start), list_distant_alternatives)


def _improve_choices(
    tree: Tree,
    start: Sequence[JointFormulation],
    build: Build,
    pieces: Sequence[_Piece],
    options: Options,
) -> list[JointFormulation]:
    """Take better choices, from the tips inwards, until there are none.

    Args:
        tree: Tree to formulate.
        start: Formulations to start from, one per joint.
        build: Function that builds the model.
        pieces: Part of the tree that is counted, per joint.
        options: Function that lists the alternatives at a joint.
    """
    choices = list(start)
    waiting = set(range(len(choices)))
    tries = [0] * len(choices)
    i, piece, graph = 0, None, Graph()
    while waiting:
        i = max((k for k in waiting if k < i), default=max(waiting))
        waiting.remove(i)
        tries[i] += 1
        if pieces[i] is not piece:
            piece, graph = pieces[i], Graph()
            forget()
        found = _improve_joint(i, choices, build, pieces[i], graph, options)
        if found != choices[i]:
            choices[i] = found
            waiting |= {k for k in _find_neighbours(tree, i) if tries[k] < _LOOKS}
    return choices


def _find_neighbours(tree: Tree, i: int) -> set[int]:
    """Return the parent and the children of a joint."""
    beyond = {k for k, joint in enumerate(tree.joints) if joint.parent == i}
    return beyond | ({tree.joints[i].parent} - {BASE})


def _improve_joint(
    i: int,
    choices: Sequence[JointFormulation],
    build: Build,
    piece: _Piece,
    graph: Graph,
    options: Options,
) -> JointFormulation:
    """Return the choice at joint i from which no single change saves an operation."""

    def count(choice: JointFormulation) -> int:
        """Return the number of operations with another choice at the joint."""
        some = [choice if k == i else choices[k] for k in piece.joints]
        return graph.count_operations(build(piece.tree, some, graph, piece.dropped))

    found = choices[i]
    best = count(found)
    joint = piece.tree.joints[piece.joints.index(i)]
    while True:
        others = options(found, joint)
        counts = [count(other) for other in others]
        if min(counts, default=best) >= best:
            return found
        best = min(counts)
        found = others[counts.index(best)]


def _find_near_joints(tree: Tree, i: int) -> list[int]:
    """Return a joint, its closest ancestors and its children."""
    before = [i]
    while len(before) <= _BEFORE and (parent := tree.joints[before[-1]].parent) != BASE:
        before.append(parent)
    return sorted({*before, *_find_neighbours(tree, i)})


def _split_branches(tree: Tree) -> list[list[int]]:
    """Return the joints of every subtree on the base."""
    roots: list[int] = []
    for i, joint in enumerate(tree.joints):
        roots.append(i if joint.parent == BASE else roots[joint.parent])
    return [[i for i, root in enumerate(roots) if root == first] for first in sorted(set(roots))]


def _extract_subtree(
    tree: Tree, branch: list[int], dropped: Collection[int]
) -> tuple[Tree, frozenset[int]]:
    """Return a subtree as a tree on its own base, and the positions of its dropped parameters."""
    place = {i: k for k, i in enumerate(branch)}
    positions = [p for i in branch for p in tree.joints[i].columns]
    renumbered = {position: k for k, position in enumerate(positions)}
    joints = [
        replace(
            joint,
            parent=place.get(joint.parent, BASE),
            rigid=tuple(_renumber_columns(rigid, renumbered) for rigid in joint.rigid),
        )
        for joint in (tree.joints[i] for i in branch)
    ]
    # What is beyond the tips of a part is of no less kinds than a whole body.
    beyond = {joint.parent for k, joint in enumerate(tree.joints) if k not in place}
    full = {p for i in branch if i in beyond for p in tree.joints[i].columns}
    some = frozenset(renumbered[p] for p in positions if p in dropped and p not in full)
    carried = tree.carried or tree.joints[branch[0]].parent != BASE
    return Tree(tuple(joints), tree.gravity, len(positions), carried), some


def _renumber_columns(rigid: Rigid, positions: Mapping[int, int]) -> Rigid:
    return replace(rigid, columns={kind: positions[p] for kind, p in rigid.columns.items()})


def _make_signature(tree: Tree) -> tuple:
    """Return a key for the cache; trees with the same key need the same number of operations."""

    def describe_joint(joint: Joint) -> tuple:
        """Return what operations at a joint depend on."""
        placed = (joint.place.tobytes(), joint.rotation.tobytes())
        if joint.parent == BASE:
            placed = ((joint.rotation.T @ tree.gravity).round(12).tobytes(), b"")
        moving = (joint.parent, joint.revolute, joint.sign, joint.offset, joint.parallel)
        rigid = [(each.frame.tobytes(), tuple(each.columns.items())) for each in joint.rigid]
        return (*moving, placed, joint.described_to_axis.tobytes(), tuple(rigid))

    return tuple(map(describe_joint, tree.joints))
