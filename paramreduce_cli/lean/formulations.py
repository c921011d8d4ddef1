"""The formulations of a mechanism.

What is best depends on the parameters that are kept: choices are searched for all, for the base parameters and for
the few that matter most, masses, first moments and the moments of inertia about the joints' own axes; and for
given subsets where that is worth it.
"""

import heapq
import itertools
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace

import numpy as np

from paramreduce_cli.expressions.graph import Graph
from paramreduce_cli.lean.algebra import forget
from paramreduce_cli.lean.building import Build, direct_outputs, inverse_outputs
from paramreduce_cli.lean.choices import (
    JointFormulation,
    Place,
    alternatives,
    far_reaching,
    from_data,
    to_data,
)
from paramreduce_cli.lean.motion import Rates
from paramreduce_cli.lean.search import best_choices
from paramreduce_cli.lean.tree import Tree, lean_tree
from paramreduce_cli.records import (
    BoolArray,
    Formulation,
    Formulations,
    IntArray,
    Kind,
    Mechanism,
    Model,
    Progress,
)

_FIRST_MOMENTS = (Kind.M, Kind.MX, Kind.MY, Kind.MZ)
_MOMENTS = (Kind.IXX, Kind.IYY, Kind.IZZ)
_INVERSE_STARTS = (
    JointFormulation(),
    JointFormulation(aligned=True),
    JointFormulation(mass=Place.REST, axial=Place.REST),
    JointFormulation(aligned=True, radial=Place.REST, rates=Rates.DIRECT),
)
_SUITED = 2
"""Formulations from which one that suits a subset of parameters is searched: those that are leanest for it."""
_CROSSED = 0.4
"""How often a formulation is varied by what another one has at some joints."""
_VARIED = 2
"""Choices that are varied at once, at most."""
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


def formulations(
    mechanism: Mechanism,
    affecting: BoolArray,
    base: IntArray,
    progress: Callable[[Progress], None] = lambda _: None,
) -> Formulations:
    """Search the formulations of a mechanism.

    Args:
        mechanism: Its tree is what counts.
        affecting: Parameters that change the torques at all, (n_parameters,).
        base: Indices of the base parameters.
        progress: Told when one of the six searches has ended.

    Returns:
        Choices for the inverse and for the direct dynamics, each different set once.
    """
    tree = lean_tree(mechanism)
    everything = set(range(affecting.size))
    useless = everything - set(affecting.nonzero()[0].tolist())
    regrouped = everything - set(base.tolist())
    minor = useless | (everything - _main_parameters(tree))

    ended = itertools.count(1)

    def best(
        build: Build, start: list[JointFormulation], dropped: set[int]
    ) -> list[JointFormulation]:
        choices = best_choices(tree, build, start, dropped)
        progress(Progress("search for formulations", next(ended), 6))
        return choices

    def searched(build: Build, starts: tuple[JointFormulation, ...]) -> tuple[Formulation, ...]:
        same, *others = ([start] * len(tree.joints) for start in starts)
        full = best(build, same, useless)
        of_base = best(build, full, regrouped)
        of_few = best(build, same, minor)
        found = dict.fromkeys(map(tuple, [full, of_base, of_few, same, *others]))
        return tuple(tuple(map(to_data, one)) for one in found)

    found = Formulations(
        searched(inverse_outputs, _INVERSE_STARTS), searched(direct_outputs, _DIRECT_STARTS)
    )
    forget()
    return found


def formulations_for(model: Model, subsets: Iterable[IntArray], *, direct: bool) -> Formulations:
    """The formulations of a model, and more that suit some subsets of its parameters.

    Args:
        model: Of the robot, with formulations.
        subsets: Indices of the parameters that are not zero, of each.
        direct: Whether they are for the direct dynamics, not for the inverse.

    Returns:
        Those of the model first, each different set once.
    """
    tree = lean_tree(model.mechanism)
    everything = set(range(model.affecting.size))
    build = direct_outputs if direct else inverse_outputs
    known = model.formulations.direct if direct else model.formulations.inverse
    starts = [tuple(map(from_data, choices)) for choices in known]
    found = dict.fromkeys(starts)
    for kept in subsets:
        dropped = everything - set(kept.tolist())

        def count(choices: Sequence[JointFormulation], dropped: set[int] = dropped) -> int:
            graph = Graph()
            return graph.count(build(tree, choices, graph, dropped))

        for start in heapq.nsmallest(_SUITED, starts, key=count):
            found[tuple(best_choices(tree, build, start, dropped))] = None
    forget()
    data = tuple(tuple(map(to_data, choices)) for choices in found)
    return replace(model.formulations, **{"direct" if direct else "inverse": data})


def varied(
    formulation: Formulation,
    others: Sequence[Formulation],
    mechanism: Mechanism,
    rng: np.random.Generator,
) -> Formulation:
    """A formulation with one or two other choices at random, or as another one is at joints in a row.

    Args:
        formulation: Of the mechanism.
        others: Which have what goes well together.
        mechanism: Whose joints they are of.
        rng: Where chance comes from.
    """
    if rng.random() < _CROSSED:
        other = others[int(rng.integers(len(others)))]
        first, last = np.sort(rng.integers(len(formulation), size=2))
        return (*formulation[:first], *other[first : last + 1], *formulation[last + 1 :])
    tree = lean_tree(mechanism)
    choices = list(map(from_data, formulation))
    for _ in range(rng.integers(1, _VARIED, endpoint=True)):
        k = int(rng.integers(len(choices)))
        joint = tree.joints[k]
        alike = alternatives(choices[k], joint) + far_reaching(choices[k], joint)
        choices[k] = alike[int(rng.integers(len(alike)))]
    return tuple(map(to_data, choices))


def _main_parameters(tree: Tree) -> set[int]:
    """Positions of masses, first moments and the moments of inertia about the joints' axes."""
    result = set()
    for joint in tree.joints:
        for rigid in joint.rigid:
            axis = np.abs((joint.described_to_axis @ rigid.frame)[2, :3])
            kinds = (*_FIRST_MOMENTS, _MOMENTS[int(np.argmax(axis))])
            result |= {rigid.columns[kind] for kind in kinds}
    return result
