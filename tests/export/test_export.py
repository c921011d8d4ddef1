"""Exported code is run by its own language against plain recursion."""

import dataclasses
import re
import shutil
import subprocess
import sys

import casadi as ca
import numpy as np
import pytest
from conftest import CONFIGS, model_of

from paramreduce_cli.errors import ParamreduceWarning
from paramreduce_cli.export.check import check, random_cases
from paramreduce_cli.export.choice import chosen_model
from paramreduce_cli.export.exported import identifier, plain
from paramreduce_cli.export.languages import languages
from paramreduce_cli.export.writing import Exported, export, exported_functions

needs_gcc = pytest.mark.skipif(shutil.which("gcc") is None, reason="gcc is not installed")
needs_octave = pytest.mark.skipif(
    shutil.which("octave-cli") is None, reason="Octave is not installed"
)
STRICT = ["-std=c99", "-O2", "-Wall", "-Wextra", "-pedantic", "-Werror"]


@pytest.fixture(scope="module", params=["two_link", "four_bar"])
def model(request):
    return model_of(request.param)


@pytest.fixture(scope="module")
def hexaglide():
    return model_of("hexaglide")


def written(model, folder, kind, what="both", text="full", *, constant=False, single=False):
    chosen, title = chosen_model(text, model, None, None)
    files = export(
        model, chosen, title=title, language=kind, what=Exported(what), constant=constant,
        single=single,
    )  # fmt: skip
    for name, content in files.items():
        (folder / name).write_bytes(content)
    return chosen


def run(command, folder):
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)


def c_test(name, folder, *flags):
    built = run(["gcc", *STRICT, *flags, "-o", "t", f"{name}.c", f"{name}_test.c", "-lm"], folder)
    assert built.returncode == 0, built.stderr
    return run(["./t"], folder)


@needs_gcc
@pytest.mark.parametrize("what", list(Exported))
@pytest.mark.parametrize("text", ["full", "base"])
def test_c_passes_its_self_test(model, tmp_path, what, text):
    written(model, tmp_path, "c", what, text)
    done = c_test(model.mechanism.robot, tmp_path)
    assert done.returncode == 0, done.stdout
    assert "FAIL" not in done.stdout
    assert "_batch" in done.stdout


@needs_gcc
@pytest.mark.parametrize("options", [{"constant": True}, {"single": True}])
def test_c_with_constants_and_in_single_precision(model, tmp_path, options):
    written(model, tmp_path, "c", **options)
    done = c_test(model.mechanism.robot, tmp_path)
    assert done.returncode == 0, done.stdout


@needs_gcc
def test_c_of_closed_loops_solves_them(hexaglide, tmp_path):
    written(hexaglide, tmp_path, "c")
    done = c_test("hexaglide", tmp_path)
    assert done.returncode == 0, done.stdout
    assert "positions, q" in done.stdout


@pytest.mark.parametrize("name", ["puma560", "hexaglide"])
def test_functions_are_the_reference_on_a_thousand_states(name, hexaglide):
    model = hexaglide if name == "hexaglide" else model_of(name)
    chosen, _ = chosen_model("full", model, None, None)
    functions = exported_functions(model, chosen, Exported.BOTH)
    stored = random_cases(model.mechanism, chosen, 1000, np.random.default_rng(11))
    check(functions, stored, 1e-12)


@needs_gcc
def test_a_wrong_result_fails_the_self_test(model, tmp_path):
    written(model, tmp_path, "c", "idm")
    name = model.mechanism.robot
    source = tmp_path / f"{name}.c"
    changed = re.sub(r"(tau\[0\] = .*);", r"\1 + 1e-9;", source.read_text(), count=1)
    source.write_text(changed)
    done = c_test(name, tmp_path)
    assert done.returncode == 1
    assert "FAIL inverse_dynamics, tau" in done.stdout


@needs_gcc
def test_the_makefile_builds_and_tests(model, tmp_path):
    written(model, tmp_path, "c")
    assert run(["make", "test"], tmp_path).returncode == 0


@needs_gcc
@pytest.mark.parametrize("count", [0, 1, 63, 64, 65, 300])
def test_batches_of_any_length_and_any_angle(tmp_path, count):
    model = model_of("two_link")
    written(model, tmp_path, "c", "idm")
    (tmp_path / "many.c").write_text(
        f"""#include "two_link.h"
#include <math.h>
#include <stdio.h>
int main(void) {{
  static double q[2 * {count} + 2], d[2 * {count} + 2], tau[2 * {count} + 2];
  double phi[two_link_n_parameters], worst = 0;
  two_link_parameters(phi);
  for (int i = 0; i < 2 * {count}; ++i) {{
    q[i] = pow(-1.7, i % 30) * 0.01;
    d[i] = sin(i);
  }}
  tau[2 * {count}] = 42;
  two_link_inverse_dynamics_batch({count}, phi, q, d, d, tau);
  for (int k = 0; k < {count}; ++k) {{
    const double one[2] = {{q[k], q[{count} + k]}}, rate[2] = {{d[k], d[{count} + k]}};
    double expected[2];
    two_link_inverse_dynamics(phi, one, rate, rate, expected);
    for (int i = 0; i < 2; ++i) worst = fmax(worst, fabs(tau[i * {count} + k] - expected[i]));
  }}
  printf("%g\\n", worst);
  return worst > 1e-12 || tau[2 * {count}] != 42;
}}
"""
    )
    built = run(["gcc", *STRICT, "-o", "m", "many.c", "two_link.c", "-lm"], tmp_path)
    assert built.returncode == 0, built.stderr
    done = run(["./m"], tmp_path)
    assert done.returncode == 0, done.stdout


@pytest.mark.parametrize("what", list(Exported))
def test_python_passes_its_self_test(model, tmp_path, what):
    written(model, tmp_path, "python", what)
    done = run([sys.executable, f"{model.mechanism.robot}_test.py"], tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "FAIL" not in done.stdout


@needs_octave
def test_matlab_passes_its_self_test_in_octave(model, tmp_path):
    for what in Exported:
        written(model, tmp_path, "matlab", what)
        done = run(["octave-cli", "--eval", f"{model.mechanism.robot}_test"], tmp_path)
        assert done.returncode == 0, done.stdout + done.stderr
        assert "ok" in done.stdout
        assert "FAIL" not in done.stdout


def test_casadi_functions_load_and_agree(model, tmp_path):
    chosen = written(model, tmp_path, "casadi")
    stored = random_cases(model.mechanism, chosen, 3, np.random.default_rng(5))

    def loaded(name):
        return ca.Function.load(str(tmp_path / f"{model.mechanism.robot}_{name}.casadi"))

    for name in ("inverse_dynamics", "direct_dynamics"):
        function = loaded(name)
        for k in range(3):
            given = {key: stored[key][k] for key in function.name_in()}
            for key, value in function(**given).items():
                expected = stored[key][k]
                np.testing.assert_allclose(
                    np.array(value).reshape(expected.shape), expected, rtol=1e-9, atol=1e-9
                )
    if model.mechanism.loops is not None:
        q = loaded("positions")(stored["z"][0], stored["guess"][0])
        np.testing.assert_allclose(np.array(q).ravel(), stored["q"][0], atol=1e-9)
        R, dq = loaded("velocities")(stored["q"][0], stored["dz"][0])
        np.testing.assert_allclose(np.array(R), stored["R"][0], atol=1e-9)
        b, ddq = loaded("accelerations")(stored["q"][0], dq, R, stored["ddz"][0])
        np.testing.assert_allclose(np.array(ddq).ravel(), stored["ddq"][0], atol=1e-7)
        np.testing.assert_allclose(np.array(b).ravel(), stored["b"][0], atol=1e-7)


def test_latex_is_a_table_of_all_parameters(model, tmp_path):
    chosen = written(model, tmp_path, "latex", text="base")
    (file,) = tmp_path.iterdir()
    text = file.read_text()
    assert text.count(r"\\") == 1 + len(chosen.names)
    for name in chosen.names:
        assert text.count(f"${model.mechanism.symbols[name]}$") >= 2  # by itself and made of itself
    assert text.count("$") % 2 == 0


def test_names_cannot_reach_the_code():
    assert identifier("6-axis.arm") == "robot_6_axis_arm"
    assert identifier("puma560") == "puma560"
    assert plain('a */ int x; /* "\\" \n') == "a * / int x; / * '/'  "


@pytest.mark.parametrize("kind", list(languages))
def test_every_exporter_gives_files(model, kind):
    chosen, title = chosen_model("base", model, None, None)
    files = export(model, chosen, title=title, language=kind, what=Exported.IDM)
    assert files
    assert all(name.startswith((model.mechanism.robot, "Makefile", "CMake")) for name in files)


def test_the_command_exports_the_selected_model(invoke, two_link_results, tmp_path):
    code, out, _ = invoke(
        "export", CONFIGS / "two_link.yaml", "--results", two_link_results, "--format", "python",
        "--output", tmp_path / "code",
    )  # fmt: skip
    assert code == 0
    assert "parameters, torque error" in out
    assert (tmp_path / "code" / "two_link.py").exists()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--model", "swap:99"], "--model swap:99: there is full, base, "),
        (["--model", "nobody"], "--model nobody: there is full"),
        (["--single", "--format", "python"], "--single goes with --format c"),
        (["--results", "nowhere"], "nowhere/model.h5"),
    ],
)
def test_what_cannot_be_exported(invoke, two_link_results, tmp_path, options, message):
    results = [] if "--results" in options else ["--results", two_link_results]
    code, _, err = invoke(
        "export", CONFIGS / "two_link.yaml", *results, *options, "--output", tmp_path / "x"
    )
    assert code == 2
    assert message in err.replace("\n", " ")
    assert not (tmp_path / "x").exists()


def test_stale_results_are_refused(invoke, two_link_copy, tmp_path):
    code, _, err = invoke(
        "export", CONFIGS / "two_link.yaml", "--results", two_link_copy,
        "--set", "description.gravity=[0,0,-1]", "--output", tmp_path / "x",
    )  # fmt: skip
    assert code == 2
    assert "was made with another description section" in err.replace("\n", " ")
    assert not (tmp_path / "x").exists()


def test_a_later_export_leaves_nothing_of_the_former(invoke, two_link_results, tmp_path):
    folder = tmp_path / "code"
    (tmp_path / "code").mkdir()
    (folder / "mine.m").write_text("% mine")
    for what in ("both", "idm"):
        code, *_ = invoke(
            "export", CONFIGS / "two_link.yaml", "--results", two_link_results,
            "--format", "matlab", "--what", what, "--output", folder,
        )  # fmt: skip
        assert code == 0
    names = {path.name for path in folder.iterdir()}
    assert "two_link_inverse_dynamics.m" in names
    assert "two_link_direct_dynamics.m" not in names
    assert "mine.m" in names


def test_models_that_are_unsafe_for_direct_dynamics_say_so(tmp_path):
    model = model_of("two_link")
    chosen, title = chosen_model("base", model, None, None)
    wrong = dataclasses.replace(chosen, values=-np.asarray(chosen.values))
    with pytest.warns(ParamreduceWarning, match="not positive definite on 200 of 200"):
        files = export(model, wrong, title=title, language="c", what=Exported.DDM)
    assert b"NOT SAFE FOR DIRECT DYNAMICS" in files["two_link.h"]
    files = export(model, wrong, title=title, language="c", what=Exported.IDM)
    assert b"NOT SAFE" not in files["two_link.h"]


def test_the_header_lists_orders_and_units(hexaglide):
    chosen, title = chosen_model("full", hexaglide, None, None)
    files = export(hexaglide, chosen, title=title, language="c", what=Exported.IDM)
    text = files["hexaglide.h"].decode()
    independent = text[text.index("Independent coordinates") : text.index("Dependent coordinates")]
    assert [f"{k}: s_{k + 1}, m" in independent for k in range(6)] == [True] * 6
    assert "Gravity in the base frame, m/s^2: 0 0 -9.8" in text


@needs_gcc
def test_a_guess_survives_loops_that_cannot_be_closed(tmp_path):
    model = model_of("five_bar")
    written(model, tmp_path, "c", "idm")
    n, n_z = len(model.mechanism.generalised_names), model.mechanism.n_dof
    assembly = ", ".join(repr(float(x)) for x in model.mechanism.loops.assembly)
    (tmp_path / "far.c").write_text(
        f"""#include "five_bar.h"
int main(void) {{
  const double guess[{n}] = {{{assembly}}};
  double q[{n}] = {{{assembly}}}, z[{n_z}] = {{3.1, 0.1}};
  if (five_bar_positions(z, q) != -1) return 1;
  for (int i = 0; i < {n}; ++i) if (q[i] != guess[i]) return 2;
  return 0;
}}
"""
    )
    built = run(["gcc", *STRICT, "-o", "f", "far.c", "five_bar.c", "-lm"], tmp_path)
    assert built.returncode == 0, built.stderr
    assert run(["./f"], tmp_path).returncode == 0


def test_python_refuses_arrays_of_another_size(tmp_path):
    model = model_of("two_link")
    written(model, tmp_path, "python", "idm")
    script = (
        "import two_link as m\n"
        "try:\n    m.inverse_dynamics(m.PHI, [0, 0, 0], [0, 0], [0, 0])\n"
        "except ValueError as error:\n    print(error)\n"
        "print(m.inverse_dynamics(m.PHI, [0, 0], [[0, 0]] * 3, [0, 0]).shape)\n"
    )
    done = run([sys.executable, "-c", script], tmp_path)
    assert "q has shape (3,); its last axes must be (2,)" in done.stdout
    assert "(3, 2)" in done.stdout
