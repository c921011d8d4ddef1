"""What to do next in a folder, for who calls paramreduce without a command."""

import shlex
from pathlib import Path

from paramreduce_cli.cli.project_state import configs_in, has_report, project_above, results_of
from paramreduce_cli.errors import ArtifactError
from paramreduce_cli.texts import format_percent, format_percent_range

_MOST = 8
"""Robots that are listed."""


def next_steps(folder: Path) -> list[str]:
    """Lines that say what there is and what to type.

    Args:
        folder: Where the user is.
    """
    configs = configs_in(folder)
    if not configs:
        return (
            _in_results(folder)
            or _above(folder)
            or [
                "There is no robot here yet. Begin with one of these:",
                "  paramreduce init my_robot.urdf        a robot from its URDF or MJCF",
                "  paramreduce init --dh my_arm          an arm in Denavit-Hartenberg parameters, to be filled in",
                "  paramreduce init --example puma560    one that works",
                "",
                "paramreduce --help lists all commands.",
            ]
        )
    lines = [line for path in configs[:_MOST] for line in _robot(folder, path)]
    if len(configs) > _MOST:
        lines.append(f"and {len(configs) - _MOST} more")
    return [*lines, "", "paramreduce --help lists all commands."]


def _in_results(folder: Path) -> list[str]:
    """For who is in the folder of a run."""
    if not has_report(folder):
        return []
    return [
        f"{_said_of(folder)}: what a run has left.",
        "  paramreduce open .       its report",
        "  paramreduce inspect .    the selected model",
        "",
        "paramreduce --help lists all commands.",
    ]


def _above(folder: Path) -> list[str]:
    """For who has gone down from where the configs are."""
    above = project_above(folder)
    if above is None:
        return []
    return [
        f"Robots are further up: cd {shlex.quote(str(above))}, then paramreduce says what to do next there."
    ]


def _robot(folder: Path, path: Path) -> list[str]:
    """What was made of a robot, and the next command."""
    results, shown = results_of(folder / path), shlex.quote(str(path))
    if not has_report(folder / results):
        made = sorted(file.name for file in (folder / results).glob("*.h5"))
        state = f"begun ({', '.join(made)}); go on" if made else "not run yet"
        return [f"{path}: {state}: paramreduce run {shown}"]
    return [
        f"{path}: {_said_of(folder / results)}",
        f"  paramreduce open {shlex.quote(str(results))}    its report",
        f"  paramreduce export {shown}    its code",
        f"  paramreduce run {shown}    again, if the config has changed",
    ]


def _said_of(results: Path) -> str:
    """The selected model of a finished run."""
    from paramreduce_cli.artifacts.report_files import list_newer_artifacts, load_summary  # HDF5

    try:
        newer = list_newer_artifacts(results)
        if newer:
            return f"{' and '.join(newer)} changed since its report was made; paramreduce run makes it anew"
        summary = load_summary(results)
        selected, measured = summary["selected"], summary["identification"]
        if measured is None:
            errors = {part: selected["torque_error"][part] for part in ("estimation", "validation")}
            told = ", ".join(
                f"{format_percent(e)} ({part})" for part, e in errors.items() if e is not None
            )
            if test := selected["torque_error"].get("test"):
                told += f", {format_percent_range(**test)} (test)"
        else:
            told = f"{format_percent(measured['reduced']['held_out'])} of the measured torques, held out"
    except (ArtifactError, KeyError, TypeError) as problem:
        return f"its report cannot be read ({problem})"
    return f"{selected['heuristic']} with {selected['n']} parameters, torque error {told}"
