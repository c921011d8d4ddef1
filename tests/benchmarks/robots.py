"""Robots that people have, from their files to code: how small and how fast models of them are.

Run as a module it writes results/robots/robots.md: for each arm the full model, the smallest with a
torque error of at most 1 % and 0.1 % on both sets, the first also with negligible terms removed, their operations and
nanoseconds a state in C with constant parameters, and those of Pinocchio's recursion on the same arm.
"""

import hashlib
import os
import shutil
import subprocess
import sys
import time
from functools import cache
from pathlib import Path

import h5py
import numpy as np
import pinocchio as pin

from paramreduce_cli.config import load_config
from tests.benchmarks import lean_code
from tests.benchmarks.vector_widths import time_code

ROOT = Path(__file__).parents[2]
WHEEL = next(Path(sys.prefix).rglob("share/example-robot-data/robots"), Path())
DATA = ROOT.parent / "shared" / "data"
ROBOTS = {
    "TX40": (DATA / "tx40" / "tx40.urdf", ()),
    "UR5": (WHEEL / "ur_description/urdf/ur5_robot.urdf", ()),
    "UR10": (WHEEL / "ur_description/urdf/ur10_robot.urdf", ()),
    "Jaco": (WHEEL / "kinova_description/robots/kinova.urdf", ()),
    "Panda": (WHEEL / "panda_description/urdf/panda.urdf", ("--tip", "panda_hand")),
}
"""Files, and what else `init` is asked."""
FOLDER = ROOT / "results" / "robots"
TOLERANCES = (0.01, 0.001)
FLAGS = ("-O3", "-march=native", "-ffp-contract=fast", "-std=gnu99")


def paramreduce(*arguments):
    command = [sys.executable, "-m", "paramreduce_cli", *map(str, arguments)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    if done.returncode not in (0, 1):
        raise RuntimeError(done.stdout + done.stderr)
    return done.stdout


@cache
def peer():
    """Pinocchio's algorithms as a program, compiled as lean_code.py compiles them, and kept in the user's cache."""
    source = Path(__file__).with_suffix(".cpp")
    version = pin.__version__.encode()
    digest = hashlib.sha256(source.read_bytes() + version).hexdigest()
    program = lean_code.cache() / f"pinocchio-{digest[:16]}"
    if program.exists():
        return program
    program.parent.mkdir(parents=True, exist_ok=True)
    includes = [f"-I{path}" for path in lean_code.headers()]
    defined = [f"-D{one}" for one in lean_code.DEFINITIONS]
    command = ["g++", "-std=c++17", "-w", "-DNDEBUG", *FLAGS[:2], *defined, *includes, str(source)]
    building = program.with_suffix(".building")
    subprocess.run([*command, "-o", str(building)], check=True)
    building.rename(program)
    return program


def time_pinocchio(mechanism, phi):
    """Nanoseconds of one evaluation by name of Pinocchio's function, the least of many; all joints turn about z."""
    lines = [str(mechanism.n_q)]
    for rigid in mechanism.rigid:
        body = mechanism.bodies[rigid.body]
        above = np.eye(4) if body.parent < 0 else mechanism.bodies[body.parent].joint_to_body
        placed = above @ body.parent_to_joint
        own = pin.Inertia.FromDynamicParameters(
            phi[[rigid.columns[kind] for kind in lean_code.DYNAMIC]]
        )
        inertia = own.se3Action(pin.SE3(body.joint_to_body)).toDynamicParameters()
        numbers = [*placed[:3, :3].ravel(), *placed[:3, 3], *inertia]
        lines.append(f"{body.parent + 1} z {' '.join(repr(float(x)) for x in numbers)}")
    done = subprocess.run(
        [peer()], input="\n".join(lines), capture_output=True, text=True, check=True
    )
    rows = (line.split(maxsplit=1) for line in done.stdout.splitlines())
    return {name: float(nanoseconds) for nanoseconds, name in rows}


def cells(label, file, options):
    """Return the minutes of the run, what is said of the full model and of each tolerance, and Pinocchio's nanoseconds."""
    config, results = FOLDER / f"{label}.yaml", FOLDER / label
    config.unlink(missing_ok=True)
    shutil.rmtree(results, ignore_errors=True)
    paramreduce("init", file, *options, "--output", config)
    here = (config, "--results", results, "--set", "validation.accept={}")
    started = time.perf_counter()
    paramreduce("run", *here)
    minutes = (time.perf_counter() - started) / 60
    with h5py.File(results / "model.h5") as model_file:
        n, base = len(model_file["coordinates/names"]), model_file["base/columns"].size
        affecting = int(model_file["parameters/affecting"][()].sum())

    def export_and_time(name, *more):
        """Return the operations of an exported function, and its nanoseconds for one state and in batches."""
        code = FOLDER / f"{label}-{name}"
        paramreduce("export", *here, "--what", "idm", "--constants", "--output", code, *more)
        stem = next(path.stem for path in code.glob("*.hpp"))
        text = "Torques of the independent coordinates for a motion. "
        operations = int((code / f"{stem}.h").read_text().split(text)[1].split()[0])
        return operations, *time_code(code, stem, n, ["-march=native"])

    rows = [("full", affecting, base, "", *export_and_time("full", "--model", "full"))]
    for tolerance in TOLERANCES:
        asked = ("--set", f"selected.torque_error={tolerance}")
        paramreduce("validate", *here, *asked)
        with h5py.File(results / "validation.h5") as file_:
            kept = int(file_["selected/n"][()])
            heuristic = file_["selected/heuristic"][()].decode()
            errors = " / ".join(
                f"{100 * file_[f'{heuristic}/torque_error_{name}'][kept - 1]:.2g} %"
                for name in ("estimation", "validation")
            )
            test = 100 * file_[f"{heuristic}/torque_error_test"][kept - 1]
            errors += f" / {np.median(test):.2g} % ({test.min():.2g} to {test.max():.2g})"
        shown = f"≤ {100 * tolerance:g} %"
        rows.append((shown, kept, base, errors, *export_and_time(tolerance, *asked)))
        if tolerance == TOLERANCES[0]:
            asked += ("--set", f"terms.torque_error={tolerance}")
            paramreduce("reduce-terms", *here, *asked)
            terms = export_and_time("terms", *asked, "--model", "terms")
            rows.append((f"{shown}, terms removed", kept, base, "", *terms))
    robot = load_config(config)
    theirs = time_pinocchio(robot.build_mechanism(), robot.get_values())["rnea"]
    return minutes, rows, theirs


def main():
    FOLDER.mkdir(parents=True, exist_ok=True)
    lines = [
        "| robot | model | parameters | ε_τ, estimation / validation / test, median (range) | operations of d | ns, one state | ns, batches | Pinocchio, ns |",
        "| --- | --- | --- | --- | --- | --- | --- | --- |",
    ]
    for label, (file, options) in ROBOTS.items():
        if not file.is_file():
            lines.append(f"| {label} | its file is not here | | | | | | |")
            continue
        minutes, rows, theirs = cells(label, file, options)
        for what, kept, base, errors, operations, single, batched in rows:
            first, beside = "", ""
            if what == "full":
                first, beside = (
                    f"{label}, {base} base parameters, {minutes:.1f} min",
                    f"{theirs:.0f}",
                )
            lines.append(
                f"| {first} | {what} | {kept} | {errors} | {operations} | {single:.0f} | {batched:.0f} | {beside} |"
            )
        print(*lines[-len(rows) :], sep="\n", flush=True)
    (FOLDER / "robots.md").write_text("\n".join(lines) + "\n", encoding="utf-8")
    print(f"Wrote {os.path.relpath(FOLDER / 'robots.md', ROOT)}.")


if __name__ == "__main__":
    main()
