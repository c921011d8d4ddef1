"""Next steps in a folder, for calls of paramreduce without a command."""

import shlex
from pathlib import Path

from paramreduce_cli.cli.project_state import (
    find_project_above,
    get_results_path,
    has_report,
    list_configs,
)
from paramreduce_cli.errors import ArtifactError
from paramreduce_cli.texts import format_percent, format_percent_range

_MOST = 8
"""Robots that are listed."""


def describe_next_steps(folder: Path) -> list[str]:
    """Return lines that say what the folder holds and what to type next.

    Args:
        folder: Folder in which the command is called.
    """
    configs = list_configs(folder)
    if not configs:
        return (
            _describe_results(folder)
            or _describe_parent(folder)
            or [
                "There is no robot here yet. Begin with one of these:",
                "  paramreduce init my_robot.urdf        a robot from its URDF or MJCF",
                "  paramreduce init --dh my_arm          an arm in Denavit-Hartenberg parameters, to be filled in",
                "  paramreduce init --example puma560    one that works",
                "",
                "paramreduce --help lists all commands.",
            ]
        )
    lines = [line for path in configs[:_MOST] for line in _describe_robot(folder, path)]
    if len(configs) > _MOST:
        lines.append(f"and {len(configs) - _MOST} more")
    return [*lines, "", "paramreduce --help lists all commands."]


def _describe_results(folder: Path) -> list[str]:
    """Return lines that list results and say what to type next, for a folder of results."""
    if not has_report(folder):
        return []
    return [
        f"{_describe_selected(folder)}: what a run has left.",
        "  paramreduce open .       its report",
        "  paramreduce inspect .    the selected model",
        "",
        "paramreduce --help lists all commands.",
    ]


def _describe_parent(folder: Path) -> list[str]:
    """Return lines that say how to change to the folder with the configs, if this folder is below it."""
    above = find_project_above(folder)
    if above is None:
        return []
    return [
        f"Robots are further up: cd {shlex.quote(str(above))}, then paramreduce says what to do next there."
    ]


def _describe_robot(folder: Path, path: Path) -> list[str]:
    """Return the state of a robot's results, and the next command."""
    results, shown = get_results_path(folder / path), shlex.quote(str(path))
    if not has_report(folder / results):
        made = sorted(file.name for file in (folder / results).glob("*.h5"))
        state = f"begun ({', '.join(made)}); go on" if made else "not run yet"
        return [f"{path}: {state}: paramreduce run {shown}"]
    return [
        f"{path}: {_describe_selected(folder / results)}",
        f"  paramreduce open {shlex.quote(str(results))}    its report",
        f"  paramreduce export {shown}    its code",
        f"  paramreduce run {shown}    again, if the config has changed",
    ]


def _describe_selected(results: Path) -> str:
    """Return a line on the selected model of a finished run."""
    from paramreduce_cli.artifacts.report_files import list_newer_artifacts, load_summary  # HDF5

    try:
        newer = list_newer_artifacts(results)
        if newer:
            return f"{' and '.join(newer)} changed since its report was made; paramreduce run makes it anew"
        summary = load_summary(results)
        selected, measured = summary["selected"], summary["identification"]
        if measured is None:
            errors = {part: selected["torque_error"][part] for part in ("estimation", "validation")}
            error_text = ", ".join(
                f"{format_percent(e)} ({part})" for part, e in errors.items() if e is not None
            )
            if test := selected["torque_error"].get("test"):
                error_text += f", {format_percent_range(**test)} (test)"
        else:
            error_text = f"{format_percent(measured['reduced']['held_out'])} of the measured torques, held out"
    except (ArtifactError, KeyError, TypeError) as problem:
        return f"its report cannot be read ({problem})"
    return f"{selected['heuristic']} with {selected['n']} parameters, torque error {error_text}"
