"""Template of the section for logs."""

import json
from collections.abc import Iterable
from pathlib import Path

LOG_DRIVES = """\
drives:
  # Friction and rotors, whose values the log tells: a number, or unknown if yet to be found. Coulomb friction goes as
  # tanh(speed / smoothing), rad/s (m/s); without smoothing as the sign. Leave out what your sensors do not see: torque
  # sensors behind the gears see no rotors.
  all: {inertia: unknown, viscous: unknown, coulomb: unknown, offset: unknown, smoothing: 0.05}
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


def format_log_section(files: Iterable[Path], columns: dict[str, str | list[str]]) -> str:
    """Return the section ``sampling`` of a config for logs.

    Args:
        files: Log files, as the config names them.
        columns: Names of columns by quantity.
    """
    listed = ", ".join(json.dumps(str(path)) for path in files)
    shown = "".join(f"      {key}: {json.dumps(value)}\n" for key, value in columns.items())
    return (
        "sampling:\n"
        "  log:\n"
        "    # As recorded; rad, rad/s, rad/s^2, N m, s unless `units` says otherwise. Motors instead of joints: `transmission`,\n"
        "    # `torque_constants`, `signs`, `offsets`.\n"
        f"    files: [{listed}]\n"
        "    held_out: 0.4               # the last share of every file, which nothing is learned from\n"
        f"    columns:\n{shown}"
        "    state_cutoff: auto          # Hz, of positions and speeds; auto is from the spectrum\n"
        "    torque_cutoff: auto         # Hz, of torques and model alike; none leaves torques as recorded\n"
    )
