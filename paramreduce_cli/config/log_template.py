"""Template of the section for logs."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path

from paramreduce_cli.config.column_matching import hold_currents
from paramreduce_cli.config.log_settings import TODO

LOG_DRIVES = """\
drives:
  # Friction and rotors, whose values the log tells: a number, or unknown if yet to be found. `friction: auto` makes viscous
  # and Coulomb friction and an offset unknown, and chooses their shape. Leave out what your sensors do
  # not see: torque sensors behind the gears see no rotors.
  all: {inertia: unknown, friction: auto}
"""

LOG_JUDGEMENT = """\
reduction:
  weighting: noise              # each joint by the noise that a fit of all parameters leaves
  heuristics: [forward-selection, essential, swap, best-subset]
  best_subset: {time_limit: 10} # s

selected:
  heuristic: swap
  cross_validation: true        # the smallest model that is hardly worse than the best one
"""


def format_log_section(
    files: Sequence[Path | Sequence[Path]],
    columns: Mapping[str, str | list[str]],
    units: Mapping[str, str],
    recorded: Sequence[str],
) -> str:
    """Return the section ``sampling`` of a config for logs; what is missing is marked TODO.

    Args:
        files: Log files, as the config names them; a list among these are the files of one recording.
        columns: Names of columns by quantity.
        units: Units by quantity, as far as the headings name them.
        recorded: Names of all columns.
    """
    listed = json.dumps([str(e) if isinstance(e, Path) else [str(p) for p in e] for e in files])
    missing = [key for key in ("position", "torque") if key not in columns]
    rate = ""
    if "time" not in columns:
        rate = "    recorded_rate: TODO         # rows per second, as the log has no times\n"
    shown = "".join(f"      {key}: {json.dumps(value)}\n" for key, value in columns.items())
    if missing:
        names = ", ".join(json.dumps(name) for name in recorded)
        shown += "".join(
            f'      {key}: "{TODO}"  # TODO a list of columns, or a pattern\n' for key in missing
        )
        shown += f"      # The log has the columns {names}.\n"
    if units:
        shown += f"    units: {json.dumps(dict(units))}\n"
    if "torque" in columns and hold_currents(columns["torque"]):
        shown += f"    torque_constants: {TODO}      # N m per A (mA with its unit above), one for each joint, before gears\n"
    return (
        "sampling:\n"
        "  log:\n"
        "    # As recorded; rad, rad/s, rad/s^2, N m, s unless `units` says otherwise. Motors instead of joints: `transmission`,\n"
        "    # `torque_constants`, `signs`, `offsets`.\n"
        f"    files: {listed}\n"
        "    held_out: 0.4               # the last share of every file, which nothing is learned from\n"
        f"{rate}"
        f"    columns:\n{shown}"
        "    state_cutoff: auto          # Hz, of positions and speeds; auto is chosen by cross-validation\n"
        "    torque_cutoff: auto         # Hz, of torques and model alike; none leaves torques as recorded\n"
    )
