"""Run all benchmarks and print one table of ratios."""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # NumPy's own; peers choose theirs

import rich.box
import rich.console
import rich.table

from tests.benchmarks import (
    gradients,
    growth,
    lean_code,
    long_logs,
    loop_kinematics,
    memory,
    selection,
    subtrees,
)

BENCHMARKS = (
    selection, subtrees, gradients, growth, memory, long_logs, lean_code, loop_kinematics,
)  # fmt: skip


def main():
    title, look = "Ratios, all measured in this run", rich.box.SIMPLE
    table = rich.table.Table("what", "ratio", "at most", "", title=title, box=look)
    for benchmark in BENCHMARKS:
        for what, ratio, limit in benchmark.rows():
            shown = f"{ratio:.3f}" if ratio > 0.01 else f"1/{1 / ratio:.0f}"
            most = f"{limit:g}" if limit >= 1 else f"1/{1 / limit:.0f}"
            table.add_row(what, shown, most, "reached" if ratio <= limit else "MISSED")
    rich.console.Console(width=110).print(table)


if __name__ == "__main__":
    main()
