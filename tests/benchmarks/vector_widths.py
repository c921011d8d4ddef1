"""Nanoseconds of a state of the exported C: one state at a time and in batches, by width of the vectors and precision.

`make widths`: UR10, Panda and PUMA 560, inverse dynamics of the full model with constant parameters. Each width is a set of
options of the same compiler; widths that this machine's processor lacks are left out.
"""

import dataclasses
import subprocess
import tempfile
import warnings
from pathlib import Path

import rich.box
import rich.console
import rich.table

from paramreduce_cli.errors import ParamreduceWarning
from paramreduce_cli.export.code_generation import Exported, make_exported_model
from paramreduce_cli.export.languages import languages
from paramreduce_cli.reduction.models import make_full_model
from tests.benchmarks.arms import ARMS, build_arm
from tests.conftest import model_of

WIDTHS = {
    "SSE2": ([], ""),
    "AVX2": (["-mavx2", "-mfma"], "avx2"),
    "AVX-512": (["-mavx512f", "-mavx512dq", "-mfma", "-mprefer-vector-width=512"], "avx512dq"),
}
"""Options of the compiler, and the processor's flag, by width."""

DRIVER = """
#include "{name}.h"
#include <stdio.h>
#include <time.h>
enum {{ N = {n}, STATES = 4096 }};
static {name}_real q[N * STATES], dq[N * STATES], ddq[N * STATES], tau[N * STATES];
static double now(void) {{
  struct timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  return 1e9 * t.tv_sec + t.tv_nsec;
}}
int main(void) {{
  double single = 1e9, batched = 1e9;
  unsigned seed = 1;
  for (int i = 0; i < N * STATES; ++i) {{
    q[i] = ({name}_real)((seed = 1664525u * seed + 1013904223u) / 1073741824.0 - 2);
    dq[i] = ({name}_real)((seed = 1664525u * seed + 1013904223u) / 1073741824.0 - 2);
    ddq[i] = ({name}_real)((seed = 1664525u * seed + 1013904223u) / 1073741824.0 - 2);
  }}
  for (int round = 0; round < 200; ++round) {{
    double start = now();
    for (int k = 0; k < STATES; ++k) {name}_inverse_dynamics(q + N * k, dq + N * k, ddq + N * k, tau + N * k);
    double spent = (now() - start) / STATES;
    single = spent < single ? spent : single;
    start = now();
    {name}_inverse_dynamics_batch(STATES, q, dq, ddq, tau);
    spent = (now() - start) / STATES;
    batched = spent < batched ? spent : batched;
  }}
  printf("%.2f %.2f\\n", single, batched);
  return 0;
}}
"""


def has_flag(flag):
    """Whether this machine's processor has a set of instructions."""
    return not flag or flag in Path("/proc/cpuinfo").read_text().split()


def time_code(folder, name, n, options):
    """Return nanoseconds of a state, single and batched, of inverse dynamics with constant parameters in a folder."""
    (folder / "time.c").write_text(DRIVER.format(name=name, n=n))
    flags = ["-std=gnu99", "-O3", "-ffp-contract=fast", *options]
    subprocess.run(["gcc", *flags, "-o", "t", "time.c", f"{name}.c", "-lm"], cwd=folder, check=True)
    done = subprocess.run(["./t"], cwd=folder, capture_output=True, text=True, check=True)
    single, batched = map(float, done.stdout.split())
    return single, batched


def measure(exported, options, folder):
    """Return nanoseconds of a state, single and batched, of an exported inverse dynamics."""
    for name, content in languages["c"](exported).items():
        (folder / name).write_bytes(content)
    return time_code(folder, exported.name, len(exported.coordinates), options)


def build_models(folder):
    """Yield label and model of each arm."""
    for label in ARMS:
        yield label, build_arm(label, folder)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ParamreduceWarning)
        yield "PUMA 560", model_of("puma560")


def main():
    table = rich.table.Table("arm", "vectors", "f64, one", "f64, batch", "f32, one", "f32, batch", title="ns of a state", box=rich.box.SIMPLE)  # fmt: skip
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for label, model in build_models(folder):
            for width, (options, flag) in WIDTHS.items():
                if not has_flag(flag):
                    continue
                cells = []
                for single in (False, True):
                    exported = make_exported_model(
                        model, make_full_model(model), title="full", what=Exported.IDM,
                        constant=True, single=single,
                    )  # fmt: skip
                    exported = dataclasses.replace(exported, robot="arm")
                    cells += [f"{ns:.1f}" for ns in measure(exported, options, folder)]
                table.add_row(label, width, *cells)
    rich.console.Console(width=100).print(table)


if __name__ == "__main__":
    main()
