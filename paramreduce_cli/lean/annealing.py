"""Better choices than those from which no single change saves anything, by simulated annealing [Kirkpatrick1983].

What is counted is what is left when sums and products have been rewritten, so that a formulation with more operations
as it is built may win. Changes at several joints at once are tried, and for a while those that cost a little are taken.
"""

import math
import random
from collections.abc import Collection, Iterator, Sequence

from paramreduce_cli.expressions.factoring import Written
from paramreduce_cli.expressions.graph import Graph
from paramreduce_cli.lean.algebra import forget
from paramreduce_cli.lean.building import Build
from paramreduce_cli.lean.choices import JointFormulation, alternatives, far_reaching
from paramreduce_cli.lean.tree import Tree

_WARM, _COLD = 4.0, 0.3
"""Operations more that are taken every third time, in the beginning and in the end."""
_AT_ONCE = (1, 1, 2, 3)
"""Joints at which something is changed, each as likely as the others."""
_FAR = 25
"""Operations by which a formulation may exceed the first as it is built, to be rewritten at all."""
_QUICK, _THOROUGH = 600, 4000
"""Rewritings that are tried for every formulation, and for those that come out close to the best."""
_CLOSE = 4
"""Operations that close means."""
_REMEMBERED = 50
"""Formulations that are built before what they share is forgotten, for it grows."""


def annealed(
    tree: Tree,
    build: Build,
    start: Sequence[JointFormulation],
    dropped: Collection[int],
    looks: int,
    seed: int,
) -> Iterator[list[JointFormulation]]:
    """The best choices so far, after each look.

    Args:
        tree: The tree.
        build: The model.
        start: One choice per joint.
        dropped: Positions of parameters that are zero.
        looks: How many formulations are looked at.
        seed: Of the changes.
    """
    rng = random.Random(seed)
    first = _built(tree, build, start, dropped)
    most = first.n_operations + _FAR
    choices, count = list(start), first.rewritten_count(_QUICK)
    best, least = choices, first.rewritten_count(_THOROUGH)
    known: dict[tuple[JointFormulation, ...], int] = {}
    for look in range(looks):
        if look % _REMEMBERED == 0:
            forget()
        changed = _changed(choices, tree, rng)
        key = tuple(changed)
        if key not in known:
            way = _built(tree, build, changed, dropped)
            known[key] = way.n_operations
            if known[key] <= most:
                known[key] = way.rewritten_count(_QUICK)
            if known[key] <= least + _CLOSE:
                known[key] = way.rewritten_count(_THOROUGH)
        if known[key] < least:
            best, least = changed, known[key]
        warmth = _WARM + (_COLD - _WARM) * look / looks
        if rng.random() < math.exp(min(0.0, (count - known[key]) / warmth)):
            choices, count = changed, known[key]
        yield best


def _built(
    tree: Tree, build: Build, choices: Sequence[JointFormulation], dropped: Collection[int]
) -> Written:
    graph = Graph()
    return Written(graph, build(tree, choices, graph, dropped))


def _changed(
    choices: Sequence[JointFormulation], tree: Tree, rng: random.Random
) -> list[JointFormulation]:
    result = list(choices)
    for _ in range(rng.choice(_AT_ONCE)):
        i = rng.randrange(len(result))
        joint = tree.joints[i]
        options = alternatives(result[i], joint) + far_reaching(result[i], joint)
        result[i] = rng.choice(options)
    return result
