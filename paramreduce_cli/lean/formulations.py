"""The formulations of a mechanism.

What is best depends on the parameters that are kept: choices are searched for all, for the base parameters and for
the few that matter most, masses, first moments and the moments of inertia about the joints' own axes; and for
given subsets where that is worth it.
"""

import heapq
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np

from paramreduce_cli.expressions.graph import Graph
from paramreduce_cli.lean.algebra import forget
from paramreduce_cli.lean.formulation_search import search_choices
from paramreduce_cli.lean.frame_motion import AngularAcceleration
from paramreduce_cli.lean.joint_formulations import (
    InertiaPlace,
    JointFormulation,
    from_data,
    list_alternatives,
    list_distant_alternatives,
    to_data,
)
from paramreduce_cli.lean.joint_frames import Tree, choose_frames
from paramreduce_cli.lean.lean_outputs import Build, build_direct_outputs, build_inverse_outputs
from paramreduce_cli.records import (
    BoolArray,
    Formulation,
    Formulations,
    IntArray,
    Kind,
    Mechanism,
    Model,
    Progress,
    Run,
)
from paramreduce_cli.resources.processes import start_workers

_FIRST_MOMENTS = (Kind.M, Kind.MX, Kind.MY, Kind.MZ)
_MOMENTS = (Kind.IXX, Kind.IYY, Kind.IZZ)
_INVERSE_STARTS = (
    JointFormulation(),
    JointFormulation(aligned=True),
    JointFormulation(mass=InertiaPlace.REST, axial=InertiaPlace.REST),
    JointFormulation(aligned=True, radial=InertiaPlace.REST, rates=AngularAcceleration.DIRECT),
)
_SUITED = 2
"""Formulations from which one that suits a subset of parameters is searched: those that are leanest for it."""
_CROSSED = 0.4
"""How often a formulation is varied by what another one has at some joints."""
_VARIED = 2
"""Choices that are varied at once, at most."""
_AT_REST = JointFormulation(
    aligned=True, rates=AngularAcceleration.DIRECT, radial=InertiaPlace.REST, polar=InertiaPlace.REST, tilt=InertiaPlace.REST,
    plane=InertiaPlace.REST,
)  # fmt: skip
_COMPOSITE = JointFormulation(
    radial=InertiaPlace.BEFORE,
    polar=InertiaPlace.BEFORE,
    tilt=InertiaPlace.BEFORE,
    plane=InertiaPlace.BEFORE,
)
"""The bias from the composite bodies that the mass matrix is made of."""
_DIRECT_STARTS = (_COMPOSITE, replace(_COMPOSITE, aligned=True), _AT_REST, *_INVERSE_STARTS)
"""The same at all joints: the search starts from the first, and all stay beside what it finds, as
they suit odd sets of few parameters."""
_MANY = 5
"""Joints from which on the start of processes pays."""

_Choices = tuple[JointFormulation, ...]
"""One for each joint."""


class _SearchChain(NamedTuple):
    """A chain of searches, each of which begins where the previous one has ended."""

    direct: bool
    """Whether the direct dynamics are searched, not the inverse."""
    start: _Choices
    """Choices that the first search begins with."""
    dropped: tuple[frozenset[int], ...]
    """Parameters that are zero in each."""


def find_formulations(
    mechanism: Mechanism, affecting: BoolArray, base: IntArray, run: Run | None = None
) -> Formulations:
    """Search the leanest formulations of a mechanism for several sets of parameters.

    Args:
        mechanism: Mechanism whose tree is formulated.
        affecting: Parameters that change the torques at all, (n_parameters,).
        base: Indices of the base parameters.
        run: Worker processes, and a progress callback that counts the searches that have ended.

    Returns:
        Choices for the inverse and for the direct dynamics, each different set once.

    Raises:
        DataError: A process died.
    """
    run = run or Run()
    tree = choose_frames(mechanism)
    everything = set(range(affecting.size))
    useless = everything - set(affecting.nonzero()[0].tolist())
    regrouped = everything - set(base.tolist())
    minor = useless | (everything - _find_main_parameters(tree))
    chains = [
        _SearchChain(direct, (_starts(direct)[0],) * len(tree.joints), dropped)
        for direct in (False, True)
        for dropped in ((frozenset(useless), frozenset(regrouped)), (frozenset(minor),))
    ]
    found: dict[_SearchChain, list[_Choices]] = {}
    total = sum(len(one.dropped) for one in chains)
    for one, best in _run_searches(mechanism, chains, run.jobs):
        found[one] = best
        run.progress(Progress("search for formulations", sum(map(len, found.values())), total))

    def collect_formulations(direct: bool) -> tuple[Formulation, ...]:
        """Return the different formulations found for one function."""
        best = [choices for one in chains if one.direct == direct for choices in found[one]]
        same = [(start,) * len(tree.joints) for start in _starts(direct)]
        return tuple(tuple(map(to_data, choices)) for choices in dict.fromkeys(best + same))

    return Formulations(collect_formulations(False), collect_formulations(True))


def _starts(direct: bool) -> tuple[JointFormulation, ...]:
    return _DIRECT_STARTS if direct else _INVERSE_STARTS


def _run_searches(
    mechanism: Mechanism, chains: Sequence[_SearchChain], jobs: int
) -> Iterator[tuple[_SearchChain, list[_Choices]]]:
    """Run the chains of searches in processes; yield each with the formulations it has found, in the order in which
    they end.
    """
    pays = len(choose_frames(mechanism).joints) >= _MANY
    with start_workers(
        min(jobs, len(chains)) if pays else 1, partial(_return_mechanism, mechanism)
    ) as pool:
        yield from pool.map_unordered(_work, chains)
    forget()


def _return_mechanism(mechanism: Mechanism) -> Mechanism:
    return mechanism


def _work(mechanism: Mechanism, chain: _SearchChain) -> list[_Choices]:
    return _run_chain(mechanism, chain)


def _run_chain(mechanism: Mechanism, chain: _SearchChain) -> list[_Choices]:
    """Return the formulations that each search of a chain ends with."""
    tree, build = choose_frames(mechanism), _build(chain.direct)
    choices, found = list(chain.start), []
    for dropped in chain.dropped:
        choices = search_choices(tree, build, choices, dropped)
        found.append(tuple(choices))
    return found


def _build(direct: bool) -> Build:
    return build_direct_outputs if direct else build_inverse_outputs


def add_formulations(
    model: Model, subsets: Iterable[IntArray], *, direct: bool, jobs: int = 1
) -> Formulations:
    """Return the formulations of a model, and additional ones that are lean for some subsets of its parameters.

    Args:
        model: Model of the robot, with formulations.
        subsets: Indices, for each subset, of the parameters that are not zero.
        direct: Whether formulations of the direct dynamics are meant, not of the inverse.
        jobs: Number of processes.

    Returns:
        Those of the model first, each different set once.

    Raises:
        DataError: A process died.
    """
    tree, build = choose_frames(model.mechanism), _build(direct)
    everything = frozenset(range(model.affecting.size))
    known = model.formulations.direct if direct else model.formulations.inverse
    starts = [tuple(map(from_data, choices)) for choices in known]
    chains = []
    for kept in subsets:
        dropped = everything - frozenset(kept.tolist())

        def count(choices: _Choices, dropped: frozenset[int] = dropped) -> int:
            """Return the number of operations of a formulation without the dropped parameters."""
            graph = Graph()
            return graph.count_operations(build(tree, choices, graph, dropped))

        suited = heapq.nsmallest(_SUITED, starts, key=count)
        chains += [_SearchChain(direct, start, (dropped,)) for start in suited]
    forget()
    found = dict(_run_searches(model.mechanism, chains, jobs))
    different = dict.fromkeys([*starts, *(best for one in chains for best in found[one])])
    data = tuple(tuple(map(to_data, choices)) for choices in different)
    return replace(model.formulations, **{"direct" if direct else "inverse": data})


def vary_formulation(
    formulation: Formulation,
    others: Sequence[Formulation],
    mechanism: Mechanism,
    rng: np.random.Generator,
) -> Formulation:
    """Return a formulation with one or two random changes, or with the choices of another formulation at several joints
    in a row.

    Args:
        formulation: Formulation of the mechanism.
        others: Formulations to copy choices from.
        mechanism: Mechanism with the joints.
        rng: Random generator.
    """
    if rng.random() < _CROSSED:
        other = others[int(rng.integers(len(others)))]
        first, last = np.sort(rng.integers(len(formulation), size=2))
        return (*formulation[:first], *other[first : last + 1], *formulation[last + 1 :])
    tree = choose_frames(mechanism)
    choices = list(map(from_data, formulation))
    for _ in range(rng.integers(1, _VARIED, endpoint=True)):
        k = int(rng.integers(len(choices)))
        joint = tree.joints[k]
        alike = list_alternatives(choices[k], joint) + list_distant_alternatives(choices[k], joint)
        choices[k] = alike[int(rng.integers(len(alike)))]
    return tuple(map(to_data, choices))


def _find_main_parameters(tree: Tree) -> set[int]:
    """Return the positions of masses, first moments and the moments of inertia about the joints' axes."""
    result = set()
    for joint in tree.joints:
        for rigid in joint.rigid:
            axis = np.abs((joint.described_to_axis @ rigid.frame)[2, :3])
            kinds = (*_FIRST_MOMENTS, _MOMENTS[int(np.argmax(axis))])
            result |= {rigid.columns[kind] for kind in kinds}
    return result
