"""Matching of a recording's columns to the joints of a robot by their names."""

import itertools
import re
from collections.abc import Collection, Mapping, Sequence

from paramreduce_cli.config.column_headings import CURRENTS, read_units, split_unit
from paramreduce_cli.config.log_settings import NUMBER
from paramreduce_cli.errors import ConfigError

_WORDS = {
    "position": ("q", "pos", "position", "positions", "z", "theta", "actual_q", "joint_position", "qm"),
    "velocity": ("dq", "qd", "qdot", "v", "vel", "velocity", "velocities", "dz", "actual_qd", "omega"),
    "acceleration": ("ddq", "qdd", "qddot", "acc", "acceleration", "accelerations", "ddz"),
    "torque": (
        "tau", "torque", "torques", "effort", "efforts", "eff", "moment", "taum", "tau_j", "trq", "actual_current", "current",
        "currents", "i",
    ),
}  # fmt: skip
_CURRENTS = ("actual_current", "current", "currents", "i")
"""Words of torques that were recorded as currents."""
_TIMES = ("t", "time", "timestamp", "stamp", "time_s", "seconds")
_BEFORE_NUMBER = ("joint", "j", "axis", "motor", "m", "actuator", "link")
"""Words before the number of a joint, where the quantity comes after it."""
_WANTED_ONLY = ("command", "desired", "target", "ref", "setpoint")
"""Parts of names of what was asked of the machine, not measured."""
_NEEDED = ("position", "torque")
_MOST_JOINTS = _MOST_SHOWN = 12
"""Joints, and columns, that a message names."""
_SHORT = 2
"""Letters of a word that counts only where it stands alone."""
_BY_HAND = "Take a config without --log, and write sampling.log with lists of columns into it."


def guess_columns(names: Sequence[str], joints: Sequence[str]) -> dict[str, str | list[str]]:
    """Choose the columns of time, positions, speeds, accelerations and torques.

    Args:
        names: Names of all columns, perhaps with units in brackets.
        joints: Names of the coordinates.

    Returns:
        By quantity a pattern such as ``q{}``, or a list with a column for each joint.

    Raises:
        ConfigError: Time, positions or torques have no usual name, several columns fit one joint, or there are columns
            of more joints.
    """
    found = match_columns(names, joints)
    missing = [key for key in (*_NEEDED, "time") if key not in found]
    if missing:
        raise ConfigError(
            f"no columns for {' and '.join(missing)} of {len(joints)} joints ({', '.join(joints[:_MOST_JOINTS])}) by a usual name among {', '.join(names[:30])}. {suggest_locking(names, joints)}"
        )
    return found


def match_columns(names: Sequence[str], joints: Sequence[str]) -> dict[str, str | list[str]]:
    """Return the columns of those quantities that are recognised, like :func:`guess_columns`.

    Joints are numbered from 0 or 1, or their names are part of the columns' names. A robot of one joint may have columns
    without a number.

    Args:
        names: Names of all columns, perhaps with units in brackets.
        joints: Names of the coordinates.

    Raises:
        ConfigError: Several columns fit one joint, or there are columns of more joints.
    """
    originals = {split_unit(name)[0]: name for name in reversed(names)}
    plain = [split_unit(name)[0] for name in names]
    found: dict[str, str | list[str]] = {}
    for key, words in _WORDS.items():
        columns = _match_numbered(plain, words, len(joints)) or match_joint_names(
            plain, words, joints
        )
        if columns is None and len(joints) == 1:
            columns = (
                _keep_likeliest([n for n in plain if _normalise(n) in words], words)[:1] or None
            )
        if columns is not None:
            found[key] = columns
    more = _count_surplus_joints(plain, len(joints))
    if more and not match_joint_names(plain, _WORDS["position"], joints):
        raise ConfigError(
            f"the log has {more} joints by its columns, the robot {len(joints)} ({', '.join(joints[:_MOST_JOINTS])}). If it is a log of this robot: {_BY_HAND[0].lower()}{_BY_HAND[1:]}"
        )
    times = [name for name in plain if _normalise(name) in _TIMES]
    times += [name for name in plain if _normalise(name.rpartition("/")[2]) in _TIMES]
    if times:
        positions = found.get("position", times[0])
        found = {"time": _choose_time(times, positions), **found}
    return {key: _restore_units(value, originals, len(joints)) for key, value in found.items()}


def _restore_units(
    columns: str | list[str], originals: Mapping[str, str], n: int
) -> str | list[str]:
    """Return columns by their headings with units: a pattern if all of them have the same unit, else a list."""
    if isinstance(columns, list):
        return [originals[name] for name in columns]
    if NUMBER not in columns:
        return originals[columns]
    listed = [originals[columns.replace(NUMBER, str(j + 1))] for j in range(n)]
    ends = {name[len(split_unit(name)[0]) :] for name in listed}
    return f"{columns}{ends.pop()}" if len(ends) == 1 else listed


def hold_currents(columns: str | Sequence[str]) -> bool:
    """Return whether columns of torques are currents by their names or units."""
    if read_units({"torque": columns}).get("torque") in CURRENTS:
        return True
    listed = [columns] if isinstance(columns, str) else columns
    return all(
        any(_is_word(part, _CURRENTS) for part in _split_at_number(split_unit(name)[0]))
        for name in listed
    )


def list_named_joints(names: Sequence[str]) -> list[str]:
    """Return the joints whose positions are in columns of their names, such as ``/joint_states/position/elbow``."""
    words = _WORDS["position"]
    found: dict[str, None] = {}
    for name in names:
        parts = _split_name(name)
        others = [part for part in parts if part.lower() not in words]
        before, _, last = name.rpartition("_")
        if others and len(others) < len(parts):
            found.setdefault(others[-1])
        elif before and last.lower() in words:
            found.setdefault(before)
    return list(found)


def _count_surplus_joints(names: Sequence[str], n: int) -> int:
    """Return the number of joints that the numbered columns are for, all of them counted, if it exceeds n; else zero."""
    most = n
    while all(_match_numbered(names, _WORDS[key], most + 1) is not None for key in _NEEDED):
        most += 1
    return most if most > n else 0


def suggest_locking(names: Sequence[str], joints: Sequence[str]) -> str:
    """Return what to do about joints without columns: lock those beyond the joints that the log has."""
    by_hand = "Write sampling.log.columns by hand"
    most = [_count_joints(names, _WORDS[key], len(joints)) for key in _NEEDED]
    if 0 < min(most) == max(most) < len(joints):
        locks = " ".join(f"--lock {joint}=0" for joint in joints[most[0] :][:_MOST_JOINTS])
        return f"The log has {most[0]} joints: if the others stood still, try {locks}. Or: {by_hand[0].lower()}{by_hand[1:]}."
    return f"{by_hand}; joints that the log does not have are locked by init's --lock JOINT=VALUE."


def _count_joints(names: Sequence[str], words: Sequence[str], n: int) -> int:
    """Return the number of joints that the numbered columns have, n at most."""
    return next((k for k in range(n, 0, -1) if _match_numbered(names, words, k) is not None), 0)


def _choose_time(times: Sequence[str], positions: str | list[str]) -> str:
    """Return the time column of the same topic or group as the positions."""
    name = positions if isinstance(positions, str) else positions[0]
    return max(times, key=lambda time: _count_common_characters(time, name))


def _count_common_characters(first: str, other: str) -> int:
    """Return the number of leading characters that two names share."""
    pairs = zip(first, other, strict=False)
    return sum(1 for _ in itertools.takewhile(lambda pair: pair[0] == pair[1], pairs))


def _normalise(name: str) -> str:
    return name.strip().strip("/_").lower()


def _match_numbered(names: Sequence[str], words: Sequence[str], n: int) -> str | list[str] | None:
    """Return the columns of n numbered joints: a pattern if numbers begin at 1, a list if they begin at 0, None if no
    columns fit.
    """
    known = set(names)
    forms = {
        f"{name[: match.start()]}{NUMBER}{name[match.end() :]}"
        for name in names
        for match in re.finditer(r"\d+", name)
    }
    for form in sorted(forms, key=lambda form: (_rank_form(form, words), form)):
        if _rank_form(form, words) == _UNLIKE:
            continue
        if all(form.replace(NUMBER, str(j + 1)) in known for j in range(n)):
            return form
        listed = [form.replace(NUMBER, str(j)) for j in range(n)]
        if all(name in known for name in listed):
            return listed
    return None


_UNLIKE = 1000


def _rank_form(form: str, words: Sequence[str]) -> int:
    """Return how likely a form such as ``q{}`` or ``joint{}_pos`` is of a quantity: earlier words are likelier, and
    commanded values come last.
    """
    stem, end = form.split(NUMBER)
    if end.strip("]") == "":
        return _rank_stem(stem.removesuffix("["), words)
    if not _is_word(stem, _BEFORE_NUMBER):
        return _UNLIKE
    return _rank_stem(end.lstrip("]_./ "), words)


def _split_at_number(name: str) -> list[str]:
    """Return the parts of a name before and after the number of its joint, or the placeholder of the number."""
    return [part for part in re.split(r"\{\}|\d+", name) if part.strip("[]_./ ")]


def _is_word(text: str, words: Sequence[str]) -> bool:
    """Return whether the last part of a name, without marks at its ends, is one of the words."""
    return _rank_stem(text.strip("[]_./ "), words) != _UNLIKE


def _rank_stem(stem: str, words: Sequence[str]) -> int:
    """Return how likely a stem is one of the words: earlier words are likelier, and commanded values come last."""
    word = _normalise(re.split(r"[/.]", stem.rstrip("_./"))[-1])
    for k, known in enumerate(words):
        if word == known or (len(known) > 2 and word.endswith(f"_{known}")):
            return k + len(words) * any(part in word for part in _WANTED_ONLY)
    return _UNLIKE


def match_joint_names(
    names: Sequence[str], words: Sequence[str], joints: Sequence[str]
) -> list[str] | None:
    """Find the column of one quantity for each joint, by the names of the joints.

    A joint's whole name between slashes or dots, or joined to the word by an underscore, counts
    first; then a name that contains the joint's, such as ``robot1_elbow``. No column is used twice.

    Args:
        names: Names of all columns.
        words: Usual names of the quantity, the likeliest first.
        joints: Names of the coordinates.

    Returns:
        A column for each joint; None where a joint has none.

    Raises:
        ConfigError: Several columns fit one joint equally well.
    """
    exact = {joint: _keep_likeliest(_match_exactly(names, words, joint), words) for joint in joints}
    used = {name for found in exact.values() for name in found}
    partial = {
        joint: exact[joint] or _keep_likeliest(_match_partly(names, words, joint, used), words)
        for joint in joints
    }
    if not all(partial.values()):
        return None
    _check_unambiguous(partial)
    return [found[0] for found in partial.values()]


def _check_unambiguous(matches: Mapping[str, Sequence[str]]) -> None:
    """Raise ConfigError where several columns fit a joint, or one column several joints."""
    for joint, candidates in matches.items():
        rivals = [other for other in matches if other != joint and matches[other] == candidates]
        if len(candidates) > 1:
            raise ConfigError(
                f"several columns may be of the joint {joint}: {', '.join(candidates[:_MOST_SHOWN])}. {_BY_HAND}"
            )
        if rivals:
            raise ConfigError(
                f"the column {candidates[0]} may be of the joints {joint} and {', '.join(rivals)}. {_BY_HAND}"
            )


def _match_exactly(names: Sequence[str], words: Collection[str], joint: str) -> list[str]:
    """Return the columns with a joint's whole name beside a word of the quantity."""
    joined = {text for word in words for text in (f"{joint}_{word}", f"{word}_{joint}")}
    found = []
    for name in names:
        segments = _split_name(name)
        others = {segment.lower().strip("_") for segment in segments if segment != joint}
        whole = joint in segments and not others.isdisjoint(words)
        if whole or any(segment in joined for segment in segments):
            found.append(name)
    return found


def _match_partly(
    names: Sequence[str], words: Collection[str], joint: str, taken: Collection[str]
) -> list[str]:
    """Return the columns with a joint's name as part of a longer name, beside a word of the quantity."""
    pattern = re.compile(rf"(?<![A-Za-z0-9]){re.escape(joint)}(?![A-Za-z0-9])")
    found = []
    for name in names:
        if name in taken or not pattern.search(name):
            continue
        rest = [part.lower() for part in _split_name(pattern.sub("", name))]
        tokens = {token for part in rest for token in part.split("_") if len(token) > _SHORT}
        if not (tokens | {part.strip("_") for part in rest}).isdisjoint(words):
            found.append(name)
    return found


def _keep_likeliest(matches: Sequence[str], words: Sequence[str]) -> list[str]:
    """Keep the columns with the likeliest word; commanded values count if nothing was measured."""

    def rank(name: str) -> int:
        """Return how unlikely a name is: measured before commanded, then by the order of the words."""
        tokens = {part.lower() for part in re.split(r"[/._]", name)}
        whole = {part.lower().strip("_") for part in _split_name(name)} | tokens
        first = min((k for k, word in enumerate(words) if word in whole), default=len(words))
        return first + len(words) * (not tokens.isdisjoint(_WANTED_ONLY))

    ranks = [rank(name) for name in matches]
    return [name for name, place in zip(matches, ranks, strict=True) if place == min(ranks)]


def _split_name(name: str) -> list[str]:
    return [part for part in re.split(r"[/.]", name) if part]
