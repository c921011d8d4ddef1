"""The part of a config that is for logs, with a guess of what is where in them."""

import itertools
import json
import re
from collections.abc import Iterable, Sequence
from pathlib import Path

from paramreduce_cli.config.logs import NUMBER
from paramreduce_cli.errors import ConfigError

_WORDS = {
    "position": ("q", "pos", "position", "positions", "z", "theta", "actual_q", "joint_position", "qm"),
    "velocity": ("dq", "qd", "qdot", "v", "vel", "velocity", "velocities", "dz", "actual_qd", "omega"),
    "acceleration": ("ddq", "qdd", "qddot", "acc", "acceleration", "accelerations", "ddz"),
    "torque": (
        "tau", "torque", "torques", "effort", "efforts", "moment", "taum", "actual_current", "current", "i",
    ),
}  # fmt: skip
_TIMES = ("t", "time", "timestamp", "stamp", "time_s", "seconds")
_WANTED_ONLY = ("command", "desired", "target", "ref", "setpoint")
"""Parts of names of what was asked of the machine, not measured."""
_NEEDED = ("position", "torque")
_MOST_JOINTS = 12
"""Joints that a message names."""


def guessed_columns(names: Sequence[str], joints: Sequence[str]) -> dict[str, str | list[str]]:
    """Names of the columns of time, positions, speeds, accelerations and torques, as far as there are.

    Joints are numbered from 0 or 1, or stand in the names of columns themselves.

    Args:
        names: Of all columns.
        joints: Names of the coordinates.

    Raises:
        ConfigError: Time, positions or torques are not among them by any usual name.
    """
    found: dict[str, str | list[str]] = {}
    times = [name for name in names if _plain(name) in _TIMES]
    times += [name for name in names if _plain(name.rpartition("/")[2]) in _TIMES]
    for key, words in _WORDS.items():
        columns = _numbered(names, words, len(joints)) or _by_joint(names, words, joints)
        if columns is not None:
            found[key] = columns
    more = _more_joints(names, len(joints))
    if more and not _by_joint(names, _WORDS["position"], joints):
        raise ConfigError(
            f"the log has {more} joints by its columns, the robot {len(joints)} ({', '.join(joints[:_MOST_JOINTS])}): is "
            "it of this robot? If it is, take a config without --log, and write sampling.log with lists of columns into it."
        )
    missing = [key for key in _NEEDED if key not in found] + ([] if times else ["time"])
    if missing:
        raise ConfigError(
            f"no columns for {' and '.join(missing)} of {len(joints)} joints ({', '.join(joints[:_MOST_JOINTS])}) by "
            f"any usual name among {', '.join(names[:30])}. {_remedy(names, joints)}"
        )
    return {"time": _time_of(times, found["position"]), **found}


def joints_by_name(names: Sequence[str]) -> list[str]:
    """Joints whose positions stand in columns of their names, such as ``/joint_states/position/elbow``."""
    words = _WORDS["position"]
    found: dict[str, None] = {}
    for name in names:
        parts = [part for part in re.split(r"[/.]", name) if part]
        others = [part for part in parts if part.lower() not in words]
        before, _, last = name.rpartition("_")
        if others and len(others) < len(parts):
            found.setdefault(others[-1])
        elif before and last.lower() in words:
            found.setdefault(before)
    return list(found)


def _more_joints(names: Sequence[str], n: int) -> int:
    """How many joints the numbered columns are of, if more than n; else zero."""
    most = n
    while all(_numbered(names, _WORDS[key], most + 1) is not None for key in _NEEDED):
        most += 1
    return most if most > n else 0


def _remedy(names: Sequence[str], joints: Sequence[str]) -> str:
    """What to do about joints without columns: to lock those after the ones that the log has, if it has any."""
    by_hand = "Write sampling.log.columns by hand"
    most = [_joints_counted(names, _WORDS[key], len(joints)) for key in _NEEDED]
    if 0 < min(most) == max(most) < len(joints):
        locks = " ".join(f"--lock {joint}=0" for joint in joints[most[0] :][:_MOST_JOINTS])
        return f"The log has {most[0]} joints: if the others stood still, try {locks}. Or: {by_hand[0].lower()}{by_hand[1:]}."
    return f"{by_hand}; joints that the log does not have are locked by init's --lock JOINT=VALUE."


def _joints_counted(names: Sequence[str], words: Sequence[str], n: int) -> int:
    """How many joints the numbered columns are of, n at most."""
    return next((k for k in range(n, 0, -1) if _numbered(names, words, k) is not None), 0)


def _time_of(times: Sequence[str], positions: str | list[str]) -> str:
    """The time that stands with the positions: of the same topic or group."""
    name = positions if isinstance(positions, str) else positions[0]
    return max(times, key=lambda time: _alike(time, name))


def _alike(one: str, other: str) -> int:
    """Characters with which both begin."""
    pairs = zip(one, other, strict=False)
    return sum(1 for _ in itertools.takewhile(lambda pair: pair[0] == pair[1], pairs))


def _plain(name: str) -> str:
    return name.strip().strip("/").lower()


def _numbered(names: Sequence[str], words: Sequence[str], n: int) -> str | list[str] | None:
    """A pattern where joints count from 1, a list where from 0; None if there are none."""
    known = set(names)
    stems = {match[1] for name in names if (match := re.fullmatch(r"(.*?)\[?(\d+)\]?", name))}
    for stem in sorted(stems, key=lambda stem: (_rank(stem, words), stem)):
        if _rank(stem, words) == _UNLIKE:
            continue
        for form in (f"{stem}{NUMBER}", f"{stem}[{NUMBER}]"):
            if all(form.replace(NUMBER, str(j + 1)) in known for j in range(n)):
                return form
            listed = [form.replace(NUMBER, str(j)) for j in range(n)]
            if all(name in known for name in listed):
                return listed
    return None


_UNLIKE = 1000


def _rank(stem: str, words: Sequence[str]) -> int:
    """How likely a stem is one of the words: the earlier the word, the likelier; what was asked for comes last."""
    word = _plain(re.split(r"[/.]", stem.rstrip("_./"))[-1])
    for k, known in enumerate(words):
        if word == known or (len(known) > 2 and word.endswith(f"_{known}")):
            return k + len(words) * any(part in word for part in _WANTED_ONLY)
    return _UNLIKE


def _by_joint(
    names: Sequence[str], words: Iterable[str], joints: Sequence[str]
) -> list[str] | None:
    found = []
    for joint in joints:
        for name in names:
            rest = [part.lower() for part in re.split(r"[/.]", name.replace(joint, "")) if part]
            if joint in name and any(part.strip("_") in words for part in rest):
                found.append(name)
                break
    return found if len(found) == len(joints) else None


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
  cross_validation: true        # the smallest model that the training data cannot tell from the best
"""


def log_text(files: Iterable[Path], columns: dict[str, str | list[str]]) -> str:
    """The section ``sampling`` of a config for logs.

    Args:
        files: As the config names them.
        columns: What is where in them.
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
