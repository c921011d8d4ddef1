"""Exported parts of the dynamics beside urdf2casadi's and Pinocchio's: operations, and nanoseconds of a state.

`make parts`. The parameters are constants of the code, as they are in urdf2casadi's, which CasADi writes as C; both are
compiled by the same compiler with the same options, run in the same process by turns, and must agree. Pinocchio's
algorithms are called from C++ on the same arm. Operations are all sums, products, quotients and calls of sines and
cosines; changes of sign are free in ours and counted apart in theirs, where CasADi has them.
"""

import dataclasses
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import casadi as ca
import rich.box
import rich.console
import rich.table

from paramreduce_cli.export.code_generation import Exported, make_exported_model
from paramreduce_cli.export.languages.c import write_scalar_source
from paramreduce_cli.reduction.models import make_full_model
from tests.benchmarks.arms import ARMS, build_arm, write_plain_urdf
from tests.benchmarks.robots import FLAGS, time_pinocchio

GRAVITY = [0, 0, -9.81]
PARTS = {
    Exported.IDM: ("rnea", lambda u, *links: u.get_inverse_dynamics_rnea(*links, gravity=GRAVITY)),
    Exported.GRAVITY: ("computeGeneralizedGravity", lambda u, *links: u.get_gravity_rnea(*links, GRAVITY)),
    Exported.CORIOLIS: ("", lambda u, *links: u.get_coriolis_rnea(*links)),
    Exported.NONLINEAR: ("nonLinearEffects", None),
    Exported.MASS_MATRIX: ("crba", lambda u, *links: u.get_inertia_matrix_crba(*links)),
    Exported.DDM: ("crba + nonLinearEffects", None),
    Exported.CORIOLIS_MATRIX: ("computeCoriolisMatrix", None),
    Exported.MOMENTUM: ("", None),
    Exported.DERIVATIVES: ("computeRNEADerivatives", None),
    Exported.FORWARD_DYNAMICS: ("aba", lambda u, *links: u.get_forward_dynamics_crba(*links, gravity=GRAVITY)),
    Exported.REGRESSOR: ("computeJointTorqueRegressor", None),
}  # fmt: skip
"""Pinocchio's function, and urdf2casadi's."""

DRIVER = """
#include <math.h>
#include <stdio.h>
#include <time.h>
enum {{ N = {n}, STATES = 256, REPEATS = 8, ROUNDS = 60, LARGEST = 4096 }};
{declarations}
static double q[STATES][N], dq[STATES][N], ddq[STATES][N], ours[LARGEST], theirs[LARGEST], work[{work}];
static double now(void) {{
  struct timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  return 1e9 * t.tv_sec + t.tv_nsec;
}}
static unsigned seed = 1;
static double uniform(void) {{ seed = 1664525u * seed + 1013904223u; return seed / 1073741824.0 - 2; }}
{functions}
typedef void (*Work)(int k);
static const Work works[] = {{{works}}};
enum {{ WORKS = sizeof works / sizeof *works }};
int main(void) {{
  double least[WORKS];
  for (int k = 0; k < STATES; ++k)
    for (int i = 0; i < N; ++i) q[k][i] = uniform(), dq[k][i] = uniform(), ddq[k][i] = uniform();
  for (int w = 0; w < WORKS; ++w) least[w] = 1e9;
  for (int round = 0; round < ROUNDS; ++round)
    for (int w = 0; w < WORKS; ++w) {{
      const double start = now();
      for (int turn = 0; turn < REPEATS; ++turn)
        for (int k = 0; k < STATES; ++k) works[w](k);
      least[w] = fmin(least[w], (now() - start) / REPEATS / STATES);
    }}
  for (int w = 0; w < WORKS; ++w) printf("%.2f\\n", least[w]);
  {comparisons}
  return 0;
}}
"""
COMPARISON = """
  {{
    double off = 0, largest = 0;
    for (int k = 0; k < STATES; ++k) {{
      works[{first}](k), works[{second}](k);
      for (int i = 0; i < {size}; ++i) {{
        off = fmax(off, fabs(ours[i] - theirs[i]));
        largest = fmax(largest, fabs(theirs[i]));
      }}
    }}
    printf("%.2e\\n", off / largest);
  }}
"""


def write_ours(model, what, folder):
    """Write our function as C; return its name in C, its arguments, the size of its results, and its operations."""
    exported = make_exported_model(
        model, make_full_model(model), title="full", what=what, constant=True
    )
    name, source = write_scalar_source(
        dataclasses.replace(exported, robot=f"ours_{what}".replace("-", "_"))
    )
    (folder / f"{name}.c").write_text(source)
    (function,) = exported.functions
    sizes = [result.size for result in function.results]
    arguments = [argument.name for argument in function.arguments]
    return f"{name}_{function.name}", arguments, sizes, function.program.n_operations


def count_operations(function):
    """Return the operations of a CasADi function, without inputs, outputs, constants and changes of sign."""
    free = (ca.OP_INPUT, ca.OP_OUTPUT, ca.OP_CONST, ca.OP_NEG)
    return sum(function.instruction_id(k) not in free for k in range(function.n_instructions()))


def write_theirs(made, name, folder):
    """Write a function of urdf2casadi as C under a name; return the size of its work array and its operations."""
    inputs = [ca.SX.sym(f"x{k}", *made.size_in(k)) for k in range(made.n_in())]
    function = ca.Function(name, inputs, ca.cse(made.call(inputs)))
    generator = ca.CodeGenerator(f"{name}.c", {"with_header": False})
    generator.add(function)
    generator.generate(f"{folder}/")
    return function.sz_w(), count_operations(function)


def measure(label, folder):
    """Yield the rows of an arm: part, our operations and urdf2casadi's, our nanoseconds, urdf2casadi's and Pinocchio's."""
    from urdf2casadi.urdfparser import URDFparser

    model = build_arm(label, folder)
    path, _ = write_plain_urdf(label, folder)
    parser = URDFparser(func_opts={})
    parser.from_file(str(path))
    links = ARMS[label][1:]
    declarations, functions, works, comparisons, rows = [], [], [], [], []
    work = 1
    for what, (peer, make) in PARTS.items():
        name, arguments, sizes, ours = write_ours(model, what, folder)
        given = [*(f"const double {a}[]" for a in arguments), *(f"double r{k}[]" for k in range(len(sizes)))]  # fmt: skip
        results = [f"ours + {sum(sizes[:k])}" for k in range(len(sizes))]
        passed = [*(("ddq" if a == "tau" else a) + "[k]" for a in arguments), *results]
        declarations.append(f"void {name}({', '.join(given)});")
        functions.append(f"static void run_{name}(int k) {{ {name}({', '.join(passed)}); }}")
        works.append(f"run_{name}")
        row = [what, peer, len(works) - 1, None, ours, None]
        if make is not None:
            theirs = f"theirs_{what}".replace("-", "_")
            made = make(parser, *links)
            needed, operations = write_theirs(made, theirs, folder)
            work = max(work, needed)
            states = ["q", "dq", "ddq"][: made.n_in()]
            listed = ", ".join(f"{x}[k]" for x in states)
            declarations.append(f"int {theirs}(const double **, double **, long long *, double *, int);")  # fmt: skip
            functions.append(
                f"static void run_{theirs}(int k) {{ const double *arg[] = {{{listed}}}; double *res[] = {{theirs}}; "
                f"{theirs}(arg, res, 0, work, 0); }}"
            )
            works.append(f"run_{theirs}")
            row[3], row[5] = len(works) - 1, operations
            comparisons.append(COMPARISON.format(first=row[2], second=row[3], size=sum(sizes)))
        rows.append(row)
    (folder / "main.c").write_text(DRIVER.format(
        n=model.mechanism.n_q, declarations="\n".join(declarations), work=work,
        functions="\n".join(functions), works=", ".join(works), comparisons="".join(comparisons),
    ))  # fmt: skip
    sources = [p.name for p in folder.glob("*.c")]
    subprocess.run(["gcc", *FLAGS, "-w", "-o", "run", *sources, "-lm"], cwd=folder, check=True)
    out = subprocess.run([folder / "run"], capture_output=True, text=True, check=True).stdout
    numbers = [float(line) for line in out.split()]
    if max(numbers[len(works) :]) > 1e-9:
        raise SystemExit(f"{label}: ours and urdf2casadi's differ by {max(numbers[len(works) :])}")
    pinocchio = time_pinocchio(model.mechanism, model.values)
    for what, peer, first, second, ours, theirs in rows:
        beside = None if second is None else numbers[second]
        yield what, ours, theirs, numbers[first], beside, peer, pinocchio.get(peer)


def main():
    if shutil.which("gcc") is None or shutil.which("g++") is None:
        sys.exit("gcc and g++ are needed")
    titles = ("part", "operations", "urdf2casadi", "ratio", "ns", "urdf2casadi", "ratio", "Pinocchio", "ns", "ratio")  # fmt: skip
    for label in ARMS:
        table = rich.table.Table(*titles, title=label, box=rich.box.SIMPLE)
        with tempfile.TemporaryDirectory() as name:
            for what, ours, theirs, ns, beside, peer, pinocchio in measure(label, Path(name)):
                table.add_row(
                    what, str(ours), str(theirs or ""), f"{ours / theirs:.2f}" if theirs else "",
                    f"{ns:.0f}", f"{beside:.0f}" if beside else "", f"{ns / beside:.2f}" if beside else "",
                    peer, f"{pinocchio:.0f}" if pinocchio else "", f"{ns / pinocchio:.2f}" if pinocchio else "",
                )  # fmt: skip
        rich.console.Console(width=150).print(table)


if __name__ == "__main__":
    main()
