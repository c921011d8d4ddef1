"""Exported models of the PUMA 560 against Pinocchio's algorithms, called from C++.

The driver takes minutes to compile, so it is kept in the user's cache under a digest of all that
goes into it. Eigen and Pinocchio's headers come with their wheels.
"""

import dataclasses
import hashlib
import os
import shutil
import subprocess
import sys
import warnings
from pathlib import Path

import numpy as np

from paramreduce_cli.artifacts.store import Store, load_file
from paramreduce_cli.errors import ParamreduceWarning
from paramreduce_cli.export.code_generation import Exported, make_exported_model
from paramreduce_cli.export.languages import languages
from paramreduce_cli.export.named_models import find_chosen_model, find_pruned_model
from paramreduce_cli.records import Kind, TermReduction
from tests.conftest import ROOT, model_of, whole

DRIVER = Path(__file__).with_suffix(".cpp")
FLAGS = ["-O3", "-march=native", "-DNDEBUG"]
DEFINITIONS = ["BOOST_MPL_LIMIT_LIST_SIZE=30", "BOOST_MPL_LIMIT_VECTOR_SIZE=30",
               "BOOST_MPL_CFG_NO_PREPROCESSED_HEADERS", "BOOST_FUSION_INVOKE_MAX_ARITY=12"]  # fmt: skip
"""Of Pinocchio's headers, as its CMake targets say."""
PINNED = "import os, sys; os.sched_setaffinity(0, {int(sys.argv[1])}); os.execv(sys.argv[2], sys.argv[2:])"
FS_18 = "m_3 Izz_5 Izz_3 my_6 mx_6 my_5 mx_2 my_4 Izz_4 my_3 Izz_6 Ixx_3 Ixz_2 mx_4 Ixx_4 mx_5 Iyy_3 my_2"
DYNAMIC = [Kind.parse(s) for s in ["m", "mx", "my", "mz", "Ixx", "Ixy", "Iyy", "Ixz", "Iyz", "Izz"]]
"""Pinocchio's order."""


def cache():
    """Where what takes long is kept."""
    base = Path(os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache"))
    return base / "paramreduce" / "benchmark"


def without_small_terms():
    """The functions that `reduce-terms` makes of the committed trajectories."""
    folder = cache() / "puma560"
    trajectories = f"trajectories.file={ROOT / 'results' / 'reference' / 'puma560.json'}"
    command = ["run", ROOT / "configs" / "puma560.yaml", "--set", trajectories, "--quiet"]
    command = [sys.executable, "-m", "paramreduce_cli", *command, "--results", folder]
    subprocess.run(command, check=True)
    return load_file(Store(folder).get_path(TermReduction), TermReduction, None, "run")[0]


def sources():
    """All files of the driver, by name."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ParamreduceWarning)
        model = model_of("puma560")
    names = model.mechanism.parameter_names
    kept = [names.index(name) for name in FS_18.split()]
    chosen = {name: find_chosen_model(name, model, None, None)[0] for name in ("full", "base")}
    chosen["fs18"] = whole(model.mechanism, kept, model.values[kept])
    files = {"lean_code.cpp": DRIVER.read_bytes(), "arm.h": arm(model).encode()}
    for name, one in chosen.items():
        for what, robot in ((Exported.BOTH, name), (Exported.REGRESSOR, f"{name}_K")):
            mechanism = dataclasses.replace(model.mechanism, robot=robot)
            named = dataclasses.replace(model, mechanism=mechanism)
            made = languages["c"](make_exported_model(named, one, title=name, what=what))
            files |= {f"{robot}.{end}": made[f"{robot}.{end}"] for end in ("c", "h")}
    found = without_small_terms()
    for function, what, ending in (("inverse", Exported.IDM, "d"), ("direct", Exported.DDM, "M")):
        one, term, title = find_pruned_model(found, function)
        for kind in ("terms", "single"):
            robot = f"{kind}_{ending}"
            mechanism = dataclasses.replace(model.mechanism, robot=robot)
            named = dataclasses.replace(model, mechanism=mechanism)
            made = languages["c"](make_exported_model(
                named, one, title=title, what=what, single=kind == "single",
                simplified=term,
            ))  # fmt: skip
            files |= {f"{robot}.{end}": made[f"{robot}.{end}"] for end in ("c", "h")}
    return files


def arm(model):
    """The arm's numbers for Pinocchio's model."""

    def listed(values):
        if isinstance(values, list):
            return "{" + ", ".join(map(listed, values)) + "}"
        return repr(float(values))

    bodies = model.mechanism.bodies
    places = [body.parent_to_joint[:3].tolist() for body in bodies]
    columns = [rigid.columns for rigid in model.mechanism.rigid]
    inertias = [[model.values[own[kind]] for kind in DYNAMIC] for own in columns]
    return (
        f"static const double gravity[3] = {listed(model.mechanism.gravity.tolist())};\n"
        f"static const double places[6][3][4] = {listed(places)};\n"
        f"static const double inertias[6][10] = {listed(inertias)};\n"
    )


def headers():
    """Folders of Pinocchio's and Eigen's headers."""
    import pinocchio

    prefix = next(p for p in Path(pinocchio.__file__).parents if p.name == "cmeel.prefix")
    # Newer wheels bring no Eigen; a package of the system does.
    return [prefix / "include", prefix / "include" / "eigen3", Path("/usr/include/eigen3")]


CONTRACTED, APART = "-ffp-contract=fast", "-ffp-contract=off"
"""Whether a * b + c is one instruction."""


def driver(contraction):
    """The compiled driver with exported code compiled one way or the other."""
    files = sources()
    digest = hashlib.sha256()
    for name, content in sorted(files.items()):
        digest.update(name.encode() + content)
    folder = cache() / digest.hexdigest()[:16]
    program = folder / f"lean_code{contraction}"
    if program.exists():
        return program
    folder.mkdir(parents=True, exist_ok=True)
    for name, content in files.items():
        (folder / name).write_bytes(content)
    if not (folder / "lean_code.o").exists():
        includes = [f"-I{path}" for path in headers()]
        defined = [f"-D{one}" for one in DEFINITIONS]
        command = ["g++", "-std=c++17", "-w", *FLAGS, *defined, *includes, "-c", "lean_code.cpp"]
        subprocess.run([*command, "-o", "building.o"], cwd=folder, check=True)
        (folder / "building.o").rename(folder / "lean_code.o")
    c_files = sorted(name for name in files if name.endswith(".c"))
    subprocess.run(
        ["gcc", "-std=gnu99", *FLAGS, contraction, "-c", *c_files], cwd=folder, check=True
    )
    objects = [name.replace(".c", ".o") for name in c_files]
    subprocess.run(
        ["g++", "lean_code.o", *objects, "-o", "building", "-lm"], cwd=folder, check=True
    )
    (folder / "building").rename(program)
    return program


def measured(contraction=CONTRACTED):
    """Nanoseconds a state by name, of all rounds; on one core, which it keeps."""
    program, core = driver(contraction), max(os.sched_getaffinity(0))
    command = [sys.executable, "-c", PINNED, str(core), program]
    lines = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    return {name: np.array(times, float) for name, *times in map(str.split, lines.splitlines())}


def compared(what, ours, theirs, limit):
    """The ratio of the least times, and how far it spreads over the rounds."""
    low, high = np.percentile(ours / theirs, [10, 90])
    return f"{what} ({low:.3f} to {high:.3f})", ours.min() / theirs.min(), limit


def rows():
    if shutil.which("gcc") is None or shutil.which("g++") is None:
        print("lean code: left out, gcc and g++ are not installed")
        return
    t = measured()
    if not t["difference"][0] < 1e-9:
        raise SystemExit(f"Pinocchio and the exported model differ by {t['difference'][0]}")
    for name, inverse, direct in (("full", 4, 6), ("base", 4, 6), ("fs18", 6, 8)):
        d, direct_d, K = (t[f"{name}_{what}"] for what in ("idm", "ddm", "regressor"))
        yield compared(f"{name} d / rnea", d, t["rnea"], 1 / inverse)
        yield compared(f"{name} [M, delta] / crba + bias", direct_d, t["crba_bias"], 1 / direct)
        yield compared(f"{name} [M, delta] / aba", direct_d, t["aba"], 1.0)
        yield compared(f"{name} regressor / Pinocchio's", K, t["regressor"], 1.0)
        yield compared(f"{name} d, batched / single", t[f"{name}_idm_batch"], d, 1 / 3)
        batched = t[f"{name}_ddm_batch"]
        yield compared(f"{name} [M, delta], batched / single", batched, direct_d, 1 / 3)
    what = "d with pruned terms"
    yield compared(f"{what} / rnea", t["terms_d_idm"], t["rnea"], 1 / 14)
    yield compared(f"{what}, batched / rnea", t["terms_d_idm_batch"], t["rnea"], 1 / 60)
    single = t["single_d_idm_batch"]
    yield compared(f"{what}, batched, single precision / rnea", single, t["rnea"], 1 / 60)
    what = "[M, delta] with pruned terms"
    yield compared(f"{what} / crba + bias", t["terms_M_ddm"], t["crba_bias"], 1 / 14)
    yield compared(f"{what}, batched / crba + bias", t["terms_M_ddm_batch"], t["crba_bias"], 1 / 60)

    apart = measured(APART)
    for name in ("full", "fs18"):
        for what in ("idm", "idm_batch", "ddm_batch"):
            key = f"{name}_{what}"
            # Over rnea in the same run, as the two are programs of their own.
            shares = [times[key] / times["rnea"] for times in (t, apart)]
            yield compared(f"{name} {what}, a * b + c contracted / not", *shares, 1.0)


if __name__ == "__main__":
    for key, times in measured().items():
        print(key, times.min())
