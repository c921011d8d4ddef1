"""Trajectories for real controllers: how many keep to everything, what they cost, what rest costs.

`make controllers`: rest-to-rest trajectories of UR10 and Panda, checked on a grid ten times finer than the
one they were optimised on: torques by Pinocchio, distances of capsules by brute force.
"""

import dataclasses
import sys
import warnings
from pathlib import Path

import numpy as np

from paramreduce_cli.config import load_config
from paramreduce_cli.excitation.fourier import evaluate_basis, sample_times
from paramreduce_cli.excitation.workers import build_excitation, optimise_all
from paramreduce_cli.records import Items, Run
from paramreduce_cli.stages.build_model import build_model
from paramreduce_cli.stages.optimize_trajectories import make_task
from tests.oracles import capsules, pinocchio_model

ROOT = Path(__file__).resolve().parents[2]
_FINER = 10
_ROUNDING = 1e-9


def worst(config, model, task, trajectory):
    """Largest share of each limit, smallest distance beyond the gap, and what is left of rest."""
    limits = task.settings.limits
    time = sample_times(config.trajectories.period, _FINER * config.trajectories.points)
    harmonics = (trajectory.coefficients.shape[1] - 1) // 2
    basis = evaluate_basis(config.trajectories.period, harmonics, time)
    z, dz, ddz = basis.evaluate(trajectory.coefficients)
    tau = pinocchio_model.inverse_dynamics(model.mechanism, model.values, z, dz, ddz)
    clearance = config.trajectories.clearance
    pairs = [c.bodies for c in task.constraints if c.kind == "clearance"]
    planes = [c.bodies[0] for c in task.constraints if c.kind == "above-plane"]
    apart = []
    for q in z:
        apart += capsules.clearances(model.mechanism, q, clearance.radius, pairs)
        where = capsules.points(model.mechanism, q)
        apart += [where[body][:, 2].min() - clearance.radius for body in planes]
    return {
        "position": np.max(np.abs(z - limits.middle) / limits.reach),
        "velocity": np.max(np.abs(dz) / limits.velocity),
        "acceleration": np.max(np.abs(ddz) / limits.acceleration),
        "torque": np.max(np.abs(tau) / limits.torque),
        "distance": min(apart) - clearance.gap,
        "rest": max(np.abs(dz[0]).max(), np.abs(ddz[0]).max()),
    }


def log_determinant(excitation, config, trajectory):
    """Half the logarithm of det W'W per parameter, of rows over their nominal torques."""
    harmonics = (trajectory.coefficients.shape[1] - 1) // 2
    time = sample_times(config.trajectories.period, config.trajectories.points)
    z, dz, ddz = evaluate_basis(config.trajectories.period, harmonics, time).evaluate(
        trajectory.coefficients
    )
    sizes = np.linalg.svd(excitation.weigh_rows(z, dz, ddz), compute_uv=False)
    return float(np.mean(np.log(sizes)))


def main(count=100, jobs=2):
    warnings.simplefilter("ignore")
    count, jobs = int(count), int(jobs)
    for robot in ("ur10", "panda"):
        config = load_config(ROOT / "configs" / f"{robot}.yaml")
        model = build_model(config, config.model, Run())
        task = make_task(config.trajectories, model)
        keys = [f"estimation-{k:04d}" for k in range(count)]
        found = optimise_all(task, keys, Run(jobs=jobs), Items())
        measured = [worst(config, model, task, found[key]) for key in keys]
        good = [
            m["distance"] > 0
            and m["rest"] < 1e-9
            and max(m[k] for k in ("position", "velocity", "acceleration", "torque"))
            <= 1 + _ROUNDING
            for m in measured
        ]
        cpu = [found[key].cpu_seconds for key in keys]
        print(
            f"{robot}: {sum(good)} of {count} feasible; CPU s median {np.median(cpu):.1f}, most {max(cpu):.1f}"
        )
        for key in ("position", "velocity", "acceleration", "torque"):
            print(f"  largest share of {key}: {max(m[key] for m in measured):.4f}")
        print(
            f"  smallest distance beyond the gap: {min(m['distance'] for m in measured):.4f} m",
            flush=True,
        )
        some = keys[: max(4, count // 5)]
        moving = dataclasses.replace(
            task, settings=dataclasses.replace(task.settings, rest_to_rest=False)
        )
        free = optimise_all(moving, some, Run(jobs=jobs), Items())
        excitation = build_excitation(task)
        rest, other = (
            [log_determinant(excitation, config, where[key]) for key in some]
            for where in (found, free)
        )
        print(f"  log det per parameter at rest / not: best {max(rest):.4f} / {max(other):.4f}, median "
              f"{np.median(rest):.4f} / {np.median(other):.4f} ({len(some)} each)", flush=True)  # fmt: skip


if __name__ == "__main__":
    main(*sys.argv[1:])
