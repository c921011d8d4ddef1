"""Whether lean models compute what the straightforward ones do."""

import dataclasses

import numpy as np

from paramreduce_cli.errors import FormulationError
from paramreduce_cli.expressions.factoring import Values
from paramreduce_cli.expressions.graph import Graph
from paramreduce_cli.expressions.programs import Program
from paramreduce_cli.lean.joint_formulations import from_data
from paramreduce_cli.lean.joint_frames import choose_frames
from paramreduce_cli.lean.lean_outputs import build_direct_outputs, build_inverse_outputs
from paramreduce_cli.multibody.dynamics import Dynamics
from paramreduce_cli.records import FloatArray, Formulations, IntArray, Mechanism

TOLERANCE = 1e-10
"""Tolerance of the largest value of each output; rounding leaves 1e-14."""


def check_formulations(
    mechanism: Mechanism,
    formulations: Formulations,
    kept: IntArray,
    states: tuple[FloatArray, FloatArray, FloatArray],
    rng: np.random.Generator,
) -> None:
    """Compare every formulation with textbook recursion on the open tree; raise FormulationError if one differs.

    Args:
        mechanism: The mechanism.
        formulations: Formulations to be checked.
        kept: Indices of parameters that are not zero; they get random values.
        states: q, dq, ddq, each (n_samples, n_q).
        rng: Random generator.

    Raises:
        FormulationError: A formulation computes something else.
    """
    q, dq, ddq = states
    phi = np.zeros(mechanism.n_parameters)
    phi[kept] = rng.normal(size=kept.size)
    plain = Dynamics(dataclasses.replace(mechanism, loops=None))
    M, delta = plain.compute_mass_matrix_and_bias(q, dq, phi)
    rows, columns = np.tril_indices(mechanism.n_q)
    expected = {
        "inverse": plain.compute_torques(q, dq, ddq, phi),
        "direct": np.hstack([M[:, rows, columns], delta]),
    }
    inputs = [*np.broadcast_to(phi, (q.shape[0], phi.size)).T, *q.T, *dq.T, *ddq.T]
    tree = choose_frames(mechanism)
    dropped = np.setdiff1d(np.arange(phi.size), kept).tolist()
    builds = {"inverse": build_inverse_outputs, "direct": build_direct_outputs}
    for kind, torques in expected.items():
        for choices in getattr(formulations, kind):
            graph = Graph()
            outputs = builds[kind](tree, [from_data(data) for data in choices], graph, dropped)
            program = Program.from_graph(*Values(graph, outputs).simplify())
            values = program.evaluate(inputs)
            got = np.column_stack([np.broadcast_to(value, q.shape[0]) for value in values])
            reject_if_wrong(f"a lean formulation of the {kind} dynamics", got - torques, torques)


def reject_if_wrong(
    what: str, off: FloatArray, against: FloatArray, tolerance: float = TOLERANCE
) -> None:
    """Raise FormulationError if results are too far from those of textbook recursion.

    Args:
        what: Source of the results, for the message.
        off: Differences from textbook recursion.
        against: Reference values; the largest difference is divided by the largest magnitude of these values.
        tolerance: Largest ratio that is allowed.

    Raises:
        FormulationError: The ratio exceeds the tolerance, or is not a number.
    """
    error = np.max(np.abs(off), initial=0.0) / np.max(np.abs(against), initial=1e-300)
    if not error <= tolerance:
        raise FormulationError(
            f"{what} is off by {error:.1e} of the largest value against textbook recursion. This is a "
            "defect of paramreduce: please report it with the config."
        )
