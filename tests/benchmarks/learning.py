"""Exported JAX and PyTorch modules beside MuJoCo MJX and adam-robotics: torques of many states of UR10 and Panda.

`make learning`. All compute the torques of the same states from the same URDF on this machine's cores, and must agree.
MJX and adam have one state at a time in JAX, so jax.vmap makes the batches. Every peer is also run in blocks of states,
which may use the caches better, and its best time counts. adam's PyTorch computes in single precision, and so do both sides
of that comparison.
"""

import importlib.util
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import rich.box
import rich.console
import rich.table

from paramreduce_cli.export.code_generation import Exported
from tests.benchmarks.arms import ARMS, build_arm, write_code, write_plain_urdf

STATES = 100_000
BLOCKS = (500, 5000)
"""States at once where a peer is run in blocks."""
REPETITIONS = 5
GRAVITY = 9.80665
"""adam's, and so everyone's here."""


def load_module(model, language, folder, robot, **options):
    """Return an exported module of the inverse dynamics with the values of the parameters as constants."""
    write_code(model, language, Exported.IDM, folder, constant=True, **options)
    path = next(p for p in folder.glob("*.py") if not p.stem.endswith("_test"))
    spec = importlib.util.spec_from_file_location(f"{language}_{robot}", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def measure(function, *states):
    """Return the shortest time of some calls, s, and the result as an array; the first call compiles."""
    result = np.asarray(function(*states))
    times = []
    for _ in range(REPETITIONS):
        started = time.perf_counter()
        done = function(*states)
        getattr(done, "block_until_ready", lambda: None)()
        times.append(time.perf_counter() - started)
    return min(times), result


def measure_best(function, split, *states):
    """Return the shortest time of a peer, whole or in blocks, and its result."""
    found = [measure(function, *states)]
    found += [measure(split(function, block), *states) for block in BLOCKS]
    return min(seconds for seconds, _ in found), found[0][1]


def split_jax(function, block):
    """Return a function that JAX evaluates block by block."""
    import jax

    def blocked(*states):
        parts = [x.reshape(-1, block, x.shape[-1]) for x in states]
        return jax.lax.map(lambda part: function(*part), parts).reshape(len(states[0]), -1)

    return jax.jit(blocked)


def split_torch(function, block):
    """Return a function that PyTorch evaluates block by block."""
    import torch

    def blocked(*states):
        return torch.cat([function(*part) for part in zip(*(x.split(block) for x in states), strict=True)])  # fmt: skip

    return blocked


def make_mjx(path):
    """Return MJX's inverse dynamics of one state, without contacts and limits."""
    import mujoco
    from mujoco import mjx

    compiled = mujoco.MjModel.from_xml_path(str(path))
    compiled.opt.gravity[2] = -GRAVITY
    off = mujoco.mjtDisableBit
    compiled.opt.disableflags |= off.mjDSBL_CONTACT | off.mjDSBL_LIMIT
    compiled.dof_damping[:] = compiled.dof_frictionloss[:] = compiled.dof_armature[:] = 0
    model = mjx.put_model(compiled)
    data = mjx.make_data(model)

    def inverse(q, dq, ddq):
        return mjx.inverse(model, data.replace(qpos=q, qvel=dq, qacc=ddq)).qfrc_inverse

    return inverse


def make_adam(computations, identity, zero):
    """Return adam's inverse dynamics with a base at rest: M ddq + bias, as it has no inverse dynamics."""

    def inverse(q, dq, ddq):
        nothing = 0 * q[..., :1]
        base, rest = identity + nothing[..., None], zero + nothing
        M = computations.mass_matrix(base, q)[..., 6:, 6:]
        return (M @ ddq[..., None])[..., 0] + computations.bias_force(base, q, rest, dq)[..., 6:]

    return inverse


def compare(what, expected, got, tolerance):
    """Stop if results are not the same."""
    off = np.abs(got - expected).max() / np.abs(expected).max()
    if not off < tolerance:
        raise SystemExit(f"{what}: the torques differ by {off:.1e} of the largest")


def compare_jax(label, model, folder, states):
    """Yield rows of JAX's comparisons for an arm: what, our time and that of the peer, s."""
    import jax
    import jax.numpy as jnp
    from adam.jax import KinDynComputations

    jax.config.update("jax_enable_x64", True)
    module = load_module(model, "jax", folder / "jax", label)
    given = [jnp.asarray(x) for x in states]
    ours, expected = measure(module.inverse_dynamics, *given)
    path, joints = write_plain_urdf(label, folder)
    mjx = jax.jit(jax.vmap(make_mjx(path)))
    theirs, got = measure_best(mjx, split_jax, *given)
    compare("MJX", expected, got, 1e-3)  # MuJoCo balances inertias
    yield f"{label}: JAX / MJX", ours, theirs
    adam = make_adam(KinDynComputations(str(path), joints), jnp.eye(4), jnp.zeros(6))
    theirs, got = measure_best(jax.jit(jax.vmap(adam)), split_jax, *given)
    compare("adam", expected, got, 1e-6)
    yield f"{label}: JAX / adam", ours, theirs


def compare_torch(label, model, folder, states):
    """Yield rows of PyTorch's comparisons for an arm, as it is and compiled: what, our time and that of the peer, s."""
    import torch
    from adam.pytorch import KinDynComputationsBatch

    module = load_module(model, "torch", folder / "torch", label)
    given = [torch.tensor(x, dtype=torch.float32) for x in states]
    ours, expected = measure(module.inverse_dynamics, *given)
    path, joints = write_plain_urdf(label, folder)
    adam = make_adam(KinDynComputationsBatch(str(path), joints), torch.eye(4), torch.zeros(6))
    theirs, got = measure_best(adam, split_torch, *given)
    compare("adam", expected, got, 1e-3)
    yield f"{label}: PyTorch / adam", ours, theirs
    compiled, _ = measure(torch.compile(module.inverse_dynamics), *given)
    yield f"{label}: PyTorch, compiled / adam", compiled, theirs


def main():
    table = rich.table.Table("what", "ours, ms", "peer, ms", "ratio", box=rich.box.SIMPLE)
    rng = np.random.default_rng(0)
    with tempfile.TemporaryDirectory() as name:
        for label in ARMS:
            folder = Path(name) / label
            folder.mkdir()
            model = build_arm(label, folder, gravity=GRAVITY)
            states = rng.uniform(-2, 2, (3, STATES, model.mechanism.n_q))
            for comparison in (compare_jax, compare_torch):
                for what, ours, theirs in comparison(label, model, folder, states):
                    table.add_row(what, f"{1e3 * ours:.1f}", f"{1e3 * theirs:.0f}", f"1/{theirs / ours:.0f}")  # fmt: skip
    rich.console.Console(width=100).print(table)


if __name__ == "__main__":
    sys.exit(main())
