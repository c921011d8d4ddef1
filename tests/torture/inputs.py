"""Configs and recordings with parts taken out, doubled or exchanged: used as they are, or one clear message.

Hypothesis draws what is changed.
"""

import copy
from collections import Counter

import hypothesis
import yaml
from hypothesis import strategies as st

from paramreduce_cli.artifacts.log_files import load_log
from paramreduce_cli.artifacts.user_files import load_recording
from paramreduce_cli.config import load_config
from paramreduce_cli.config.log_settings import LogSection
from paramreduce_cli.errors import ParamreduceError
from paramreduce_cli.identification.processing import process_logs
from paramreduce_cli.records import RawLogs
from tests.simulated_logs import two_link_log, write_log
from tests.torture import CONFIG

_JOINTS = ["upper", "fore"]
_LONGEST_MESSAGE = 20_000
_VALUES = (
    None, True, 0, -1, 1e308, 1e-308, float("nan"), float("inf"), 10**30, "", "x", "pi/0", "2*pi", [],
    [[]], {}, {"x": 1}, [1, 2, 3], "=", "!!bool x", "\x00", "a" * 1000, [None] * 100,
)  # fmt: skip
_TEXTS = (
    "", "\t", "- ", ": ", "&a ", "*a", "[", "}", "'", "\n", "#", "!!int ", "<<: ", "\u2028", "9e999",
)  # fmt: skip
_CELLS = (
    "", " ", "nan", "inf", "-inf", "1e308", "-1e308", "1e400", "1e-320", "0", "1_0", "0x1p3", "x", "t", '"',
    "1;2", "\x00", "\u2212" + "1", "\u0663", "1" * 400, "\ufeff",
)  # fmt: skip
_ANYTHING = st.recursive(
    st.sampled_from(_VALUES) | st.floats() | st.integers() | st.text(max_size=20),
    lambda inner: (
        st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=8), inner, max_size=3)
    ),
    max_leaves=6,
)


def places(data, path=()):
    """All paths into a config."""
    yield path
    if isinstance(data, dict | list):
        for key in data if isinstance(data, dict) else range(len(data)):
            yield from places(data[key], (*path, key))


@st.composite
def configs(draw, text):
    """The text of a config with values exchanged or left out, or with text put in."""
    if draw(st.booleans()):
        return draw(patched(text, _TEXTS))
    data = yaml.safe_load(text)
    for _ in range(draw(st.integers(1, 3))):
        *path, last = draw(st.sampled_from([p for p in places(data) if p]))
        inner = data
        for key in path:
            inner = inner[key]
        if draw(st.integers(0, 4)) == 0:
            del inner[last]
        else:
            inner[last] = copy.deepcopy(draw(_ANYTHING))
        if not data:
            break
    return yaml.safe_dump(data, allow_unicode=True)


@st.composite
def patched(draw, text, texts):
    """A text with another put in somewhere, or in place of a few letters."""
    place = draw(st.integers(0, len(text)))
    length = draw(st.sampled_from((0, 0, 1, 5)))
    return (
        text[:place] + draw(st.sampled_from(texts) | st.text(max_size=4)) + text[place + length :]
    )


@st.composite
def tables(draw, text):
    """A CSV with cells, rows and columns exchanged, doubled or left out, or with text put in."""
    if draw(st.integers(0, 3)) == 0:
        return draw(patched(text, _CELLS))
    rows = [line.split(",") for line in text.splitlines()]
    for _ in range(draw(st.integers(1, 3))):
        row, column = draw(st.integers(0, len(rows) - 1)), draw(st.integers(0, len(rows[0]) - 1))
        match draw(st.sampled_from(("cell", "column", "row", "twice", "order", "cut", "value"))):
            case "cell":
                rows[row][column : column + 1] = [
                    draw(st.sampled_from(_CELLS) | st.floats().map(str))
                ]
            case "column":
                rows = [cells[:column] + cells[column + 1 :] for cells in rows]
            case "row":
                del rows[row]
            case "twice":
                rows.insert(row, rows[row])
            case "order":
                rows[row:] = rows[row:][::-1]
            case "cut":
                rows = rows[: row + 1]
            case "value":
                cell = draw(st.sampled_from(_CELLS) | st.floats().map(str))
                rows[1:] = [[*cells[:column], cell, *cells[column + 1 :]] for cells in rows[1:]]
        if not rows or not rows[0]:
            break
    return "\n".join(map(",".join, rows)) + "\n"


def outcomes(texts, used, count, seed):
    """What becomes of texts when they are used.

    Args:
        texts: Strategy for them.
        used: Uses one; says what came of it.
        count: How many.
        seed: For Hypothesis.

    Returns:
        How often each thing happened.
    """
    found = Counter()

    @hypothesis.seed(seed)
    @hypothesis.settings(
        max_examples=count, database=None, deadline=None, phases=[hypothesis.Phase.generate],
        suppress_health_check=list(hypothesis.HealthCheck),
    )  # fmt: skip
    @hypothesis.given(texts)
    def tried(text):
        try:
            found[used(text)] += 1
        except ParamreduceError as error:
            bounded = len(str(error)) < _LONGEST_MESSAGE
            found["one message" if bounded else "a message without end"] += 1
        except Exception as error:
            found[f"not caught: {type(error).__name__}: {error}"[:100]] += 1

    tried()
    return found


def try_configs(folder, count, seed=0):
    """Read configs that were tampered with; how often each thing happened."""
    path = folder / "config.yaml"

    def used(text):
        path.write_bytes(text.encode("utf-8", "surrogatepass"))
        load_config(path)
        return "a config"

    return outcomes(configs(CONFIG.read_text()), used, count, seed)


def try_data(folder, count, seed=0):
    """Use logs and recorded states that were tampered with; how often each thing happened."""
    log, states = folder / "log.csv", folder / "states.csv"
    columns = two_link_log(seconds=3.0, rate=20.0)
    write_log(log, columns)
    write_log(states, {"t": columns["t"]} | {
        f"{name}{j + 1}": columns[f"{source}{j + 1}"]
        for name, source in (("z", "q"), ("dz", "dq"), ("ddz", "dq"), ("tau", "tau")) for j in range(2)
    })  # fmt: skip
    section = LogSection(files=[log], torque_cutoff=4)

    def processed_log(text):
        log.write_bytes(text.encode("utf-8", "surrogatepass"))
        process_logs(RawLogs((load_log(log),), ()), section, _JOINTS)
        return "a log"

    def recorded(text):
        states.write_bytes(text.encode("utf-8", "surrogatepass"))
        load_recording(states, len(_JOINTS))
        return "a recording"

    first = outcomes(tables(log.read_text()), processed_log, (count + 1) // 2, seed)
    return first + outcomes(tables(states.read_text()), recorded, count // 2 or 1, seed)
