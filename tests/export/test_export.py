"""Exported code is run by its own language against textbook recursion."""

import dataclasses
import re
import shutil
import subprocess
import sys
import warnings
from pathlib import Path

import casadi as ca
import numpy as np
import pytest
from conftest import TWO_LINK, model_of

from paramreduce_cli.errors import ParamreduceWarning
from paramreduce_cli.export.code_generation import Exported, make_exported_model, make_functions
from paramreduce_cli.export.code_verification import check, make_random_cases
from paramreduce_cli.export.exported_model import make_harmless, make_identifier, wrap_line
from paramreduce_cli.export.languages import languages
from paramreduce_cli.export.named_models import find_chosen_model
from paramreduce_cli.export.term_sizes import estimate_term_sizes
from paramreduce_cli.expressions.graph import Graph
from paramreduce_cli.expressions.programs import Program
from paramreduce_cli.records import ModelErrors, TermModel

OF_OPEN_TREES = {Exported.CORIOLIS_MATRIX, Exported.MOMENTUM, Exported.DERIVATIVES}
"""Functions that mechanisms with loops are refused with a message; `test_parts.py` sees to that."""
needs_gcc = pytest.mark.skipif(shutil.which("gcc") is None, reason="gcc is not installed")
needs_octave = pytest.mark.skipif(shutil.which("octave-cli") is None, reason="needs Octave")
STRICT = ["-std=c99", "-O2", "-Wall", "-Wextra", "-pedantic", "-Werror"]


@pytest.fixture(scope="module", params=["two_link", "four_bar"])
def model(request):
    return model_of(request.param)


def skip_if_refused(model, what):
    """Skip what a mechanism with loops does not have."""
    if model.mechanism.loops is not None and what in OF_OPEN_TREES:
        pytest.skip("loops have no such function")


def files_of(model, kind, what="both", text="full", **options):
    chosen, title = find_chosen_model(text, model, None, None)
    return languages[kind](
        make_exported_model(model, chosen, title=title, what=Exported(what), **options)
    )


def write(model, folder, *what, **options):
    for name, content in files_of(model, *what, **options).items():
        (folder / name).write_bytes(content)


def run(command, folder, code=0):
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == code, done.stdout + done.stderr
    return done.stdout


def run_c(folder, *sources, code=0):
    run(["gcc", *STRICT, "-o", "t", *sources, "-lm"], folder)
    return run(["./t"], folder, code)


def c_test(name, folder, code=0):
    return run_c(folder, f"{name}.c", f"{name}_test.c", code=code)


WARNINGS = ["-Wall", "-Wextra", "-Wconversion", "-pedantic", "-Werror"]
COMPILERS = {
    "gcc": ["gcc", "-std=c99"], "clang": ["clang", "-std=c99"],
    "g++": ["g++", "-x", "c++", "-std=c++17"], "clang++": ["clang++", "-x", "c++", "-std=c++17"],
}  # fmt: skip


@pytest.mark.parametrize("single", [False, True])
@pytest.mark.parametrize("compiler", list(COMPILERS))
def test_c_is_clean_at_every_level_of_optimisation(model, tmp_path, compiler, single):
    if shutil.which(compiler) is None:
        pytest.skip(f"there is no {compiler}")
    write(model, tmp_path, "c", single=single)
    sources = [path.name for path in tmp_path.glob("*.c")]
    for level in range(4) if compiler == "gcc" else (0, 3):
        run([*COMPILERS[compiler], f"-O{level}", *WARNINGS, "-o", "t", *sources, "-lm"], tmp_path)


EIGEN = next(Path(sys.prefix).rglob("cmeel.prefix/include/eigen3"), None)
needs_eigen = pytest.mark.skipif(
    EIGEN is None, reason="needs Eigen, which Pinocchio's wheel brings"
)
CPP = ["-std=c++17", *WARNINGS]


def printed(text):
    """Arrays that the example prints, by name."""
    rows = (line.split(" = ") for line in text.splitlines())
    return {name: np.array(values.split(), dtype=float) for name, values in rows}


@needs_eigen
@pytest.mark.parametrize("what", ["both", "regressor", "gravity"])
@pytest.mark.parametrize("compiler", ["g++", "clang++"])
def test_the_face_for_cpp_gives_what_the_self_test_expects(model, tmp_path, compiler, what):
    if shutil.which(compiler) is None:
        pytest.skip(f"there is no {compiler}")
    write(model, tmp_path, "c", what)
    name = model.mechanism.robot
    run(["gcc", "-O1", "-c", f"{name}.c"], tmp_path)
    sources = [f"{name}_example.cpp", f"{name}.o"]
    run([compiler, *CPP, "-isystem", EIGEN, "-o", "t", *sources, "-lm"], tmp_path)
    found = printed(run(["./t"], tmp_path))
    chosen, _ = find_chosen_model("full", model, None, None)
    rng = np.random.default_rng(0)
    make_random_cases(
        model.mechanism, chosen, 200, rng
    )  # those that are checked before it is written
    cases = make_random_cases(model.mechanism, chosen, 16, rng)
    results = {"both": {"tau", "M", "delta"}, "regressor": {"K"}, "gravity": {"g"}}
    assert set(found) == results[what]
    for key, values in found.items():
        assert values == pytest.approx(np.ravel(cases[key][0]), rel=1e-9, abs=1e-9)


@needs_eigen
@pytest.mark.skipif(shutil.which("cmake") is None, reason="needs CMake")
def test_cmake_installs_a_package_that_is_found(tmp_path):
    model = model_of("two_link")
    made, used = tmp_path / "made", tmp_path / "used"
    made.mkdir(), used.mkdir()
    write(model, made, "c")
    (used / "main.cpp").write_bytes((made / "two_link_example.cpp").read_bytes())
    (used / "CMakeLists.txt").write_text(
        "cmake_minimum_required(VERSION 3.15)\nproject(used CXX)\nfind_package(two_link REQUIRED)\n"
        "add_executable(used main.cpp)\ntarget_compile_features(used PRIVATE cxx_std_17)\n"
        f"target_include_directories(used PRIVATE {EIGEN})\n"
        "target_link_libraries(used two_link::two_link)\n"
    )
    place = f"-DCMAKE_INSTALL_PREFIX={tmp_path / 'installed'}"
    run(["cmake", "-B", "build", place], made)
    run(["cmake", "--build", "build", "--target", "install"], made)
    run(["ctest", "--test-dir", "build"], made)
    run(["cmake", "-B", "build", f"-DCMAKE_PREFIX_PATH={tmp_path / 'installed'}"], used)
    run(["cmake", "--build", "build"], used)
    assert set(printed(run(["./build/used"], used))) == {"tau", "M", "delta"}


@needs_gcc
def test_c_is_clean_with_sanitizers(model, tmp_path):
    write(model, tmp_path, "c")
    sanitize = ["-fsanitize=address,undefined", "-fno-sanitize-recover=all"]
    sources = [path.name for path in tmp_path.glob("*.c")]
    run(["gcc", "-g", *sanitize, "-o", "t", *sources, "-lm"], tmp_path)
    run(["./t"], tmp_path)


@needs_gcc
@pytest.mark.parametrize("what", list(Exported))
@pytest.mark.parametrize("text", ["full", "base"])
def test_c_passes_its_self_test(model, tmp_path, what, text):
    skip_if_refused(model, what)
    write(model, tmp_path, "c", what, text)
    out = c_test(model.mechanism.robot, tmp_path)
    assert "FAIL" not in out
    assert "_batch" in out


@needs_gcc
@pytest.mark.parametrize("options", [{"constant": True}, {"single": True}])
def test_c_with_constants_and_in_single_precision(model, tmp_path, options):
    write(model, tmp_path, "c", **options)
    c_test(model.mechanism.robot, tmp_path)


def test_the_header_says_what_depends_on_parameters_alone(puma, tmp_path):
    """Counted again by hand: what the batched functions compute before any state."""
    write(puma, tmp_path, "c")
    header = (tmp_path / "puma560.h").read_text()
    source = (tmp_path / "puma560.c").read_text()
    for name in ("inverse", "direct"):
        comment = header[: header.index(f"void puma560_{name}_dynamics(")].rsplit("/*", 1)[1]
        said = re.search(r"operations, (\d+) of them", " ".join(comment.replace("*", "").split()))
        block = source[source.index(f"{name}_dynamics_block(") :]
        before = block[: block.index("for (size_t k")]
        assert int(said.group(1)) == before.count("const double t") > 0


def test_lines_of_headers_fit_a_window_and_terms_are_whole():
    terms = " + ".join(f"{k / 7:.6g} Izz_{k}" for k in range(2, 40))
    first, *others = wrap_line(f"  0: Izz_1 = 1 kg m^2, Izz_1 - {terms} and 3 smaller terms")
    assert len(others) > 4
    assert max(map(len, [first, *others])) <= 100
    assert all(re.match(r" {6}[+] [0-9.]+ Izz_\d+", line) for line in others[:-1])
    assert wrap_line("short - as it is") == ["short - as it is"]


def test_the_header_says_what_single_precision_costs(model, tmp_path):
    write(model, tmp_path, "c", single=True)
    header = (tmp_path / f"{model.mechanism.robot}.h").read_text()
    text = " ".join(header.replace(" *", "").split())
    said = re.search(r"off by about .*: tau (\S+), M (\S+), delta (\S+)\.", text)
    assert all(1e-8 < float(error) < 1e-4 for error in said.groups())


@needs_gcc
def test_c_of_closed_loops_solves_them(hexaglide, tmp_path):
    write(hexaglide, tmp_path, "c")
    assert "positions, q" in c_test("hexaglide", tmp_path)


@pytest.mark.parametrize("name", ["puma", "hexaglide"])
def test_functions_are_the_reference_on_a_thousand_states(name, request):
    model = request.getfixturevalue(name)
    chosen, _ = find_chosen_model("full", model, None, None)
    functions = make_functions(model, chosen, Exported.BOTH)
    stored = make_random_cases(model.mechanism, chosen, 1000, np.random.default_rng(11))
    check(functions, stored, estimate_term_sizes(model.mechanism, chosen, stored), 1e-12)


@needs_gcc
def test_a_wrong_result_fails_the_self_test(model, tmp_path):
    write(model, tmp_path, "c", "idm")
    name = model.mechanism.robot
    source = tmp_path / f"{name}.c"
    changed = re.sub(r"(tau\[0\] = .*);", r"\1 + 1e-9;", source.read_text(), count=1)
    source.write_text(changed)
    assert "FAIL inverse_dynamics, tau" in c_test(name, tmp_path, code=1)


@needs_gcc
def test_the_makefile_builds_and_tests(model, tmp_path):
    write(model, tmp_path, "c")
    run(["make", "test"], tmp_path)


@needs_gcc
@pytest.mark.parametrize("flags", [["-ffast-math"], ["-O3", "-funsafe-math-optimizations"]])
def test_flags_that_break_the_sines_are_refused(tmp_path, flags):
    write(model_of("two_link"), tmp_path, "c", "idm")
    run(["gcc", "-std=c99", *flags, "-c", "two_link.c"], tmp_path, code=1)


@needs_eigen
@pytest.mark.parametrize("name", ["abs", "index", "linux", "print", "class", "y1"])
def test_any_name_of_a_robot_is_one_in_cpp(tmp_path, name):
    if shutil.which("g++") is None:
        pytest.skip("there is no g++")
    model = model_of("two_link")
    named = dataclasses.replace(model.mechanism, robot=name)
    write(dataclasses.replace(model, mechanism=named), tmp_path, "c", "idm")
    command = ["g++", "-std=gnu++17", "-fsyntax-only", "-isystem", EIGEN]
    run([*command, f"{make_identifier(name)}_example.cpp"], tmp_path)


def function_without_terms(chosen, graph, outputs, n, **more):
    """As reduce-terms leaves one, of the parameters of a model."""
    exact = ModelErrors(0.0, 0.0, np.zeros(0))
    known = {
        "torque_error": exact, "acceleration_error": exact, "random_torque_error": 0.0,
        "random_acceleration_error": np.nan, "random_states": 1, "largest_difference": np.zeros(n),
        "worst_joint": 0, "worst_state": np.zeros((3, n)), "smallest_eigenvalue": np.nan, "mass_states": 0,
        "lower": -np.ones((3, n)), "upper": np.ones((3, n)), "drawn": np.zeros((2, 3, n)), "projected": False,
    }  # fmt: skip
    program = Program.from_graph(graph, outputs)
    return TermModel(
        heuristic="swap", n_start=chosen.n, names=chosen.names, values=chosen.values, units=np.ones(chosen.n),
        position=chosen.position, program=program.to_stored(), operations=program.n_operations,
        operations_start=program.n_operations, front=None, **(known | more),
    )  # fmt: skip


@needs_gcc
def test_an_angle_that_results_use_too(tmp_path):
    """A sum of coordinates in a sine and in a spring, whose parts only the angle is made of."""
    model = model_of("two_link")
    chosen, title = find_chosen_model("full", model, None, None)
    g = Graph()
    phi, q1, q2, dq1 = (g.input(chosen.n * (k > 0) + max(k - 1, 0)) for k in range(4))
    angle = g.add(g.add(q1, q2), dq1)
    outputs = [g.add(g.call("sin", angle), g.multiply(phi, angle)), g.call("cos", angle)]
    function = function_without_terms(chosen, g, outputs, model.mechanism.n_dof)
    files = languages["c"](
        make_exported_model(model, chosen, title=title, what=Exported.IDM, simplified=function)
    )
    for name, content in files.items():
        (tmp_path / name).write_bytes(content)
    assert "FAIL" not in c_test("two_link", tmp_path)


@needs_gcc
@pytest.mark.parametrize("count", [0, 1, 63, 64, 65, 300])
def test_batches_of_any_length_and_any_angle(tmp_path, count):
    write(model_of("two_link"), tmp_path, "c", "idm")
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
    run_c(tmp_path, "many.c", "two_link.c")


@pytest.mark.parametrize("what", list(Exported))
def test_python_passes_its_self_test(model, tmp_path, what):
    skip_if_refused(model, what)
    write(model, tmp_path, "python", what)
    assert "FAIL" not in run([sys.executable, f"{model.mechanism.robot}_test.py"], tmp_path)


@needs_octave
def test_matlab_passes_its_self_test_in_octave(model, tmp_path):
    loops = model.mechanism.loops is not None
    for what in (one for one in Exported if not loops or one not in OF_OPEN_TREES):
        write(model, tmp_path, "matlab", what)
        out = run(["octave-cli", "--eval", f"{model.mechanism.robot}_test"], tmp_path)
        assert "ok" in out
        assert "FAIL" not in out


def test_casadi_functions_load_and_agree(model, tmp_path):
    write(model, tmp_path, "casadi")
    chosen, _ = find_chosen_model("full", model, None, None)
    stored = make_random_cases(model.mechanism, chosen, 3, np.random.default_rng(5))

    def loaded(name):
        return ca.Function.load(str(tmp_path / f"{model.mechanism.robot}_{name}.casadi"))

    for name in ("inverse_dynamics", "direct_dynamics"):
        function = loaded(name)
        for k in range(3):
            given = {key: stored[key][k] for key in function.name_in()}
            for key, value in function(**given).items():
                found = np.array(value).reshape(stored[key][k].shape)
                np.testing.assert_allclose(found, stored[key][k], rtol=1e-9, atol=1e-9)
    if model.mechanism.loops is not None:
        q = loaded("positions")(stored["z"][0], stored["guess"][0])
        np.testing.assert_allclose(np.array(q).ravel(), stored["q"][0], atol=1e-9)
        R, dq = loaded("velocities")(stored["q"][0], stored["dz"][0])
        np.testing.assert_allclose(np.array(R), stored["R"][0], atol=1e-9)
        b, ddq = loaded("accelerations")(stored["q"][0], dq, R, stored["ddz"][0])
        np.testing.assert_allclose(np.array(ddq).ravel(), stored["ddq"][0], atol=1e-7)
        np.testing.assert_allclose(np.array(b).ravel(), stored["b"][0], atol=1e-7)


def test_latex_is_a_table_of_all_parameters(model):
    (content,) = files_of(model, "latex", text="base").values()
    text, names = content.decode(), find_chosen_model("base", model, None, None)[0].names
    assert text.count(r" \\") == 1 + len(names)
    assert "{lS[table-format=" in text  # values stand under each other by their points
    for name in names:
        assert text.count(f"${model.mechanism.symbols[name]}$") >= 2  # by itself and made of itself
    assert text.count("$") % 2 == 0


def test_names_cannot_reach_the_code():
    assert make_identifier("m") == "robot_m"  # a library that exported code links
    assert make_identifier("6-axis.arm") == "robot_6_axis_arm"
    assert make_identifier("puma560") == "puma560"
    for taken in ("match", "core", "torch", "jax", "class", "math"):
        assert make_identifier(taken) == f"robot_{taken}"
    assert make_harmless('a */ int x; /* "\\" \n') == "a * / int x; / * '/'  "


@pytest.mark.parametrize("kind", list(languages))
def test_every_exporter_gives_files(model, kind):
    files = files_of(model, kind, "idm", "base")
    assert files
    assert all(
        name.startswith((model.mechanism.robot, "Makefile", "CMake", "Cargo")) for name in files
    )


def test_the_command_exports_the_selected_model(invoke, two_link_results, tmp_path):
    command = ("export", TWO_LINK, "--results", two_link_results, "--format", "python")
    done = invoke(*command, "--output", tmp_path / "code")
    assert "parameters, torque error" in done.out
    assert (tmp_path / "code" / "two_link.py").exists()


def test_several_functions_come_in_one_file_under_a_name(invoke, two_link_results, tmp_path):
    command = ("export", TWO_LINK, "--results", two_link_results, "--format", "c")
    functions = ("--what", "gravity", "--what", "both", "--what", "idm", "--what", "mass-matrix")
    invoke(*command, *functions, "--name", "my arm", "--output", tmp_path)
    header = (tmp_path / "my_arm.h").read_text()
    declared = re.findall(r"^void my_arm_(\w+)\(", header, re.MULTILINE)
    functions = [name for name in declared if not name.endswith("_batch")]
    assert functions == [
        "parameters",
        "gravity",
        "inverse_dynamics",
        "direct_dynamics",
        "mass_matrix",
    ]
    subprocess.run(["make", "test"], cwd=tmp_path, check=True, capture_output=True)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--model", "swap:99"], "--model swap:99: there is full, base, "),
        (["--model", "nobody"], "--model nobody: there is full"),
        (["--name", "a" * 61], "--name is too long. Give at most 60 characters"),
        (["--single", "--format", "python"], "--single needs --format c or --format rust"),
        (["--results", "nowhere"], "nowhere/model.h5"),
        (["--set", "description.gravity=[0,0,-1]"], "was made with another description section"),
    ],
)
def test_what_cannot_be_exported(invoke, two_link_results, tmp_path, options, message):
    command = ("export", TWO_LINK, "--results", two_link_results, "--output", tmp_path / "x")
    refused = invoke(*command, *options, code=2)
    assert message in refused.err.replace("\n", " ")
    assert not (tmp_path / "x").exists()


def test_a_later_export_leaves_nothing_of_the_former(invoke, two_link_results, tmp_path):
    (tmp_path / "mine.m").write_text("% mine")
    command = ("export", TWO_LINK, "--results", two_link_results, "--format", "matlab")
    for what in ("both", "idm"):
        invoke(*command, "--what", what, "--output", tmp_path)
    names = {path.name for path in tmp_path.iterdir()}
    assert "two_link_inverse_dynamics.m" in names
    assert "two_link_direct_dynamics.m" not in names
    assert "mine.m" in names


def test_models_that_are_unsafe_for_direct_dynamics_say_so(tmp_path):
    model = model_of("two_link")
    chosen, title = find_chosen_model("base", model, None, None)
    wrong = dataclasses.replace(chosen, values=-np.asarray(chosen.values))
    with pytest.warns(ParamreduceWarning, match="not positive definite on 200 of 200"):
        files = languages["c"](make_exported_model(model, wrong, title=title, what=Exported.DDM))
    assert b"NOT SAFE FOR DIRECT DYNAMICS" in files["two_link.h"]
    files = languages["c"](make_exported_model(model, wrong, title=title, what=Exported.IDM))
    assert b"NOT SAFE" not in files["two_link.h"]


def test_a_mass_matrix_without_terms_need_not_be_positive_where_it_does_not_hold():
    """States of loops are reached from the assembly, wherever that leads."""
    model = model_of("four_bar")
    chosen, title = find_chosen_model("full", model, None, None)
    (crank,) = model.mechanism.independent
    g = Graph()
    outputs = [g.call("cos", g.input(chosen.n + crank)), g.input(0)]
    function = function_without_terms(
        chosen, g, outputs, 1, projected=True, smallest_eigenvalue=np.cos(1), mass_states=100
    )
    cases = make_random_cases(model.mechanism, chosen, 200, np.random.default_rng(0), function)
    assert cases["M"].min() < 0
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        files = languages["c"](
            make_exported_model(model, chosen, title=title, what=Exported.DDM, simplified=function)
        )
    header = files["four_bar.h"]
    assert b"NOT SAFE" not in header
    assert b"Smallest eigenvalue of M on both sets and on 100 random states: 0.54." in header


def test_the_header_lists_orders_and_units(hexaglide):
    text = files_of(hexaglide, "c", "idm")["hexaglide.h"].decode()
    independent = text[text.index("Independent coordinates") : text.index("Dependent coordinates")]
    assert [f"{k}: s_{k + 1}, m" in independent for k in range(6)] == [True] * 6
    assert "Gravity in the base frame, m/s^2: 0 0 -9.8" in text
    assert "each placed in the frame of the body it is on" in text


@pytest.mark.parametrize("kind", ["c", "python", "matlab"])
def test_the_header_says_in_which_frames_the_parameters_are(puma, kind):
    text = b"".join(files_of(puma, kind, "idm").values()).decode()
    assert "modified Denavit-Hartenberg, z of frame i along the axis of joint i; m and rad" in text
    (row,) = set(re.findall(r" 3 +2 +revolute .*", text))
    assert row.split() == ["3", "2", "revolute", "0.4318", "0", "-0.1491", "z_3"]


@needs_gcc
def test_a_guess_survives_loops_that_cannot_be_closed(tmp_path):
    model = model_of("five_bar")
    write(model, tmp_path, "c", "idm")
    n, n_z = len(model.mechanism.generalised_names), model.mechanism.n_dof
    assembly = ", ".join(repr(float(x)) for x in model.mechanism.loops.assembly)
    (tmp_path / "far.c").write_text(
        f"""#include "five_bar.h"
#include <math.h>
int main(void) {{
  const double guess[{n}] = {{{assembly}}};
  double q[{n}] = {{{assembly}}}, z[{n_z}] = {{3.1, 0.1}};
  if (five_bar_positions(z, q) != -1) return 1;
  z[0] = NAN;
  if (five_bar_positions(z, q) != -1) return 3;
  for (int i = 0; i < {n}; ++i) if (q[i] != guess[i]) return 2;
  return 0;
}}
"""
    )
    run_c(tmp_path, "far.c", "five_bar.c")


def test_python_closes_the_loops_of_no_states(tmp_path):
    model = model_of("five_bar")
    write(model, tmp_path, "python", "idm")
    n, n_z = len(model.mechanism.generalised_names), model.mechanism.n_dof
    script = (
        "import numpy as np, five_bar as m\n"
        f"print(m.positions(np.empty((0, {n_z})), np.empty((0, {n}))).shape)\n"
    )
    assert f"(0, {n})" in run([sys.executable, "-c", script], tmp_path)


def test_python_refuses_arrays_of_another_size(tmp_path):
    write(model_of("two_link"), tmp_path, "python", "idm")
    script = (
        "import two_link as m\n"
        "try:\n    m.inverse_dynamics(m.PHI, [0, 0, 0], [0, 0], [0, 0])\n"
        "except ValueError as error:\n    print(error)\n"
        "print(m.inverse_dynamics(m.PHI, [0, 0], [[0, 0]] * 3, [0, 0]).shape)\n"
    )
    out = run([sys.executable, "-c", script], tmp_path)
    assert "q has shape (3,); its last axes must be (2,)" in out
    assert "(3, 2)" in out
