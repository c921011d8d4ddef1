"""Ranks of the vehicles that ship, against the singular values of an oracle's observation matrix."""

import dataclasses

import numpy as np
import pytest
from conftest import model_of
from oracles import force_elements, pinocchio_model

from paramreduce_cli.multibody.random_states import draw_states
from paramreduce_cli.records import INERTIAL, Kind

STEP = 1e-6


def measure_gaps(mechanism, q):
    """How far the closures are open, from Pinocchio's frames: points, and rods between two points."""
    frames = force_elements.Kinematics(mechanism, q, np.zeros_like(q))
    gaps = []
    for closure in mechanism.loops.closures:
        pairs = zip(closure.bodies, closure.frames, strict=True)
        first, second = (frames.frame(*pair) for pair in pairs)
        gap = second[:3, 3] - first[:3, 3]
        gaps += {
            "point": lambda gap=gap: list(gap),
            "planar": lambda gap=gap, turn=first[:3, :3]: list(turn[:, :2].T @ gap),
            "distance": lambda gap=gap, length=closure.length: [np.linalg.norm(gap) - length],
        }[closure.kind]()
    return np.array(gaps)


def find_tangent(mechanism, q):
    """Motions of all coordinates for unit speeds of the independent ones, by central differences."""
    if mechanism.loops is None:
        return np.eye(mechanism.n_q)
    moves = STEP * np.eye(mechanism.n_q)
    J = np.column_stack(
        [
            (measure_gaps(mechanism, q + m) - measure_gaps(mechanism, q - m)) / (2 * STEP)
            for m in moves
        ]
    )
    d, z = list(mechanism.dependent), list(mechanism.independent)
    R = np.zeros((mechanism.n_q, len(z)))
    R[z] = np.eye(len(z))
    R[d] = -np.linalg.solve(J[:, d], J[:, z])
    return R


def compute_force_columns(mechanism, q, dq):
    """Torques of unit values of the parameters of drives and force elements, (n_q, n)."""
    columns = []
    for drive in mechanism.drives:
        needed, position, speed = drive.weights, drive.weights @ q, drive.weights @ dq
        creepage = 0.0 if drive.creepage is None else np.sum(drive.creepage * [q, dq])
        if drive.between is not None and drive.between.kind in ("slip", "sideslip"):
            found = force_elements.wheel(mechanism, q, dq, drive.between)
            creepage, needed = found[::2] if drive.between.kind == "slip" else found[1::2]
        elif drive.between is not None:
            measure = {"distance": force_elements.line, "shift": force_elements.shift}
            position, speed, needed = measure[drive.between.kind](mechanism, q, dq, drive.between)
        for kind in mechanism.find_drive_columns(drive):
            force = {
                Kind.VISCOUS: speed,
                Kind.COULOMB: np.sign(speed),
                Kind.STIFFNESS: position - drive.rest,
                Kind.CREEP: creepage,
            }.get(kind)
            if kind is Kind.SPRING_TABLE:
                x, y = drive.spring_table.T
                force = np.interp(position - drive.rest, x, y)
            columns.append(force * needed)
    return np.array(columns).T


@pytest.mark.parametrize("robot", ["wishbone", "bogie", "car", "wagon", "excavator"])
def test_rank_is_that_of_an_oracle(robot):
    model = model_of(robot)
    mechanism = model.mechanism
    count = 4 + 2 * mechanism.n_parameters // mechanism.n_dof
    states = draw_states(mechanism, count, np.random.default_rng(11))
    trees = pinocchio_model.regressor(dataclasses.replace(mechanism, loops=None), *states)
    massive = [k for k, body in enumerate(mechanism.bodies) if _has_inertia(mechanism, body.name)]
    chosen = [10 * k + i for k in massive for i in range(len(INERTIAL))]
    rows = []
    for tree, q, dq in zip(trees, states[0], states[1], strict=True):
        K = np.hstack([tree[:, chosen], compute_force_columns(mechanism, q, dq)])
        rows.append(find_tangent(mechanism, q).T @ K)
    W = np.vstack(rows)
    lengths = np.linalg.norm(W, axis=0)
    live = lengths > 1e-7 * np.median(lengths)
    singular = np.linalg.svd(W[:, live] / lengths[live], compute_uv=False)
    assert int(np.sum(singular > 1e-8 * singular[0])) == model.base.columns.size


def _has_inertia(mechanism, name):
    return any(p.owner == name and p.kind is Kind.M for p in mechanism.parameters)
