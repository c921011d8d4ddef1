"""Positions, velocities and accelerations of loops: pivots in a fixed order against elimination with row exchanges."""

import ctypes
import time

import numpy as np

from paramreduce_cli.export.code_generation import Exported
from paramreduce_cli.export.languages.c import write_scalar_source
from paramreduce_cli.export.running import compile_model
from paramreduce_cli.expressions.compiled import load
from paramreduce_cli.multibody.loops.coordinates import Coordinates
from paramreduce_cli.reduction.models import make_full_model
from tests.conftest import model_of

STATES, TURNS = 2000, 9

PROGRAM = """
void follow_{kind}(long n, const double *z, const double *dz, const double *ddz, const double *start) {{
  const int dependent[] = DEPENDENT, independent[] = INDEPENDENT;
  double q[{n_q}], R[{n_d} * {n_z}] = {{0}}, b[{n_d}], dq[{n_q}], ddq[{n_q}], J[{n_d} * {n_d}], unused[{n_d} * {n_z}];
  (void)dependent; (void)independent; (void)J; (void)unused;
  for (int i = 0; i < {n_q}; ++i) q[i] = start[i];
  for (long k = 0; k < n; ++k, z += {n_z}, dz += {n_z}, ddz += {n_z}) {{
    {body}
  }}
}}
"""
LEAN = "{name}_states(z, dz, ddz, 1e-9, q, R, b, dq, ddq);"
EXCHANGES = """close_loops(z, q);
    closure_jacobian(q, J, R);
    solve(J, {n_z}, R);
    for (int i = 0; i < {n_z}; ++i) dq[independent[i]] = dz[i];
    for (int i = 0; i < {n_d}; ++i) {{
      dq[dependent[i]] = 0;
      for (int j = 0; j < {n_z}; ++j) dq[dependent[i]] -= R[i * {n_z} + j] * dz[j];
    }}
    closure_jacobian(q, J, unused);
    closure_bias(q, dq, b);
    solve(J, 1, b);
    (void)ddq;"""


def measure(robot):
    """Time of the kinematics of a motion at 1 kHz, lean over with row exchanges."""
    model = model_of(robot)
    mechanism = model.mechanism
    compiled = compile_model(model, make_full_model(model), Exported.IDM)
    name, source = write_scalar_source(compiled.exported)
    n_q, n_z = mechanism.n_q, mechanism.n_dof
    sizes = {"n_q": n_q, "n_z": n_z, "n_d": n_q - n_z}
    for kind, body in (("lean", LEAN.format(name=name)), ("exchanges", EXCHANGES.format(**sizes))):
        source += PROGRAM.format(kind=kind, body=body, **sizes)
    library = load(source)
    t = 1e-3 * np.arange(STATES)
    w = 3 + np.arange(n_z)
    assembly = mechanism.loops.assembly
    z = assembly[list(mechanism.independent)] + 0.02 * np.sin(np.outer(t, w))
    dz, ddz = 0.02 * w * np.cos(np.outer(t, w)), -0.02 * w**2 * np.sin(np.outer(t, w))
    start = Coordinates(mechanism, once=True).compute_positions(z[:1], None)[0]
    arrays = [np.ascontiguousarray(x) for x in (z, dz, ddz, start)]
    pointers = [ctypes.c_void_p(x.ctypes.data) for x in arrays]
    times = {"lean": [], "exchanges": []}
    for _ in range(TURNS):
        for kind, found in times.items():
            started = time.perf_counter()
            getattr(library, f"follow_{kind}")(ctypes.c_long(STATES), *pointers)
            found.append(time.perf_counter() - started)
    return min(times["lean"]) / min(times["exchanges"])


def rows():
    for robot in ("hexaglide", "car"):
        yield f"kinematics of loops, {robot}: fixed pivots / row exchanges", measure(robot), 1 / 4
