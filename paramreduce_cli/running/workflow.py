"""Stages as rules for Make and Slurm."""

import shlex
from pathlib import Path

from paramreduce_cli.artifacts.store import get_file
from paramreduce_cli.running.pipeline import Stage, list_stages
from paramreduce_cli.running.sweep import Sweep


def format_make_rules() -> str:
    """Return one pattern rule per stage for GNU Make, as in pipelines/stages.mk."""
    lines = [
        "# Written by `paramreduce graph --format make`; do not edit.",
        "# One rule per stage: `make results/ROBOT/reduction.h5` does just what is missing.",
        "PARAMREDUCE ?= paramreduce",
        "CONFIGS ?= configs",
        "RESULTS ?= results",
        "PARAMREDUCE_FLAGS ?=",
        "# What must be there before paramreduce can be called, such as an installation.",
        "PARAMREDUCE_READY ?=",
        "# Files that a run of a robot makes, asked of the program once for each robot, and those of a list among them.",
        "made = $(if $(made_$(1)),,$(eval made_$(1) := $(shell \\",
        "  $(if $(PARAMREDUCE_READY),$(MAKE) --silent $(PARAMREDUCE_READY) >&2 &&) \\",
        "  $(PARAMREDUCE) stages $(CONFIGS)/$(1).yaml $(PARAMREDUCE_FLAGS))))$(made_$(1))",
        "if_made = $(addprefix $(RESULTS)/$(1)/,$(filter $(2),$(call made,$(1))))",
        ".SECONDEXPANSION:",
    ]
    for stage in list_stages():
        target = f"$(RESULTS)/%/{get_file(stage.output)}"
        files = " ".join(get_file(entry.type) for entry in stage.artifacts)
        needs = [f"$$(call if_made,$$*,{files})"] if files else []
        lines += [
            "",
            f"{target}: {' '.join(['$(CONFIGS)/%.yaml', *needs])} | $(PARAMREDUCE_READY)",
            f"\t$(PARAMREDUCE) {stage.name} $< --results $(RESULTS)/$* $(PARAMREDUCE_FLAGS)",
        ]
    kept = " ".join(f"$(RESULTS)/%/{get_file(stage.output)}" for stage in list_stages())
    return "\n".join([*lines, "", f".PRECIOUS: {kept}", ""])


def format_outline() -> str:
    """Return the stages with the files that they read and write, for people."""
    return "\n".join(_format_stage(stage) for stage in list_stages()) + "\n"


def _format_stage(stage: Stage) -> str:
    """Return a stage with its inputs and its output as one line."""
    needs = ", ".join(get_file(entry.type) for entry in stage.artifacts)
    return f"{stage.name}: {needs or 'the config'} -> {get_file(stage.output)}"


_MOST_TASKS = 1000
"""Most tasks of one array, which Slurm's MaxArraySize allows where nothing else is set."""
_SLURM = """\
#!/usr/bin/env bash
# Written by `paramreduce graph --format slurm`: submits {count} arrays of tasks, each of which waits for the one
# before; {jobs} commands in all. Run it with bash where sbatch is. What is done is skipped, so tasks may be requeued, and the
# same script may be run again. Further options of sbatch: SBATCH_OPTIONS="--partition=... --time=...".
set -euo pipefail
cd {folder}
logs={logs}/$(date +%Y%m%dT%H%M%S)-$$   # of every submission: tasks of an earlier one may still read theirs
mkdir -p "$logs"
after=""
cat > "$logs/task" <<'TASK'
failed=0   # FILE TASKS: every so many of its commands, whatever becomes of the others
while IFS= read -r line; do eval "$line" </dev/null || failed=1; done < <(sed -n "${{SLURM_ARRAY_TASK_ID}}~$2p" "$1")
exit $failed
TASK

submit() {{  # NAME COUNT, and a command a line; of more than {most} a task does every so many
  local tasks=$(($2 < {most} ? $2 : {most}))
  cat > "$logs/$1.commands"
  after=$(sbatch --parsable --requeue --job-name="$1" --array="1-$tasks" --output="$logs/$1-%a.log" \\
    ${{after:+--dependency=afterany:$after}} ${{SBATCH_OPTIONS:-}} \\
    --wrap "exec bash $(printf %q "$logs/task") $(printf %q "$logs/$1.commands") $tasks")
  echo "$1: job $after, $tasks tasks"
}}
"""


def format_slurm_script(sweep: Sweep) -> str:
    """Return a script that submits a sweep, for sites without Snakemake.

    Args:
        sweep: Sweep to submit.
    """
    phases = sweep.list_phases("${SLURM_CPUS_PER_TASK:-1}")
    text = _SLURM.format(
        count=len(phases),
        jobs=sum(map(len, phases)),
        folder=shlex.quote(str(Path.cwd())),
        logs=shlex.quote(str(sweep.folder / ".slurm")),
        most=_MOST_TASKS,
    )
    for number, commands in enumerate(phases, 1):
        lines = "\n".join(commands)
        text += f"\nsubmit paramreduce-{number} {len(commands)} <<'COMMANDS'\n{lines}\nCOMMANDS\n"
    return text


FORMATS = {"make": format_make_rules, "text": format_outline}
