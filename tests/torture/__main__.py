"""Try everything, and print what was tried and what survived."""

import argparse
import sys
import tempfile
import warnings
from pathlib import Path

import rich.console
import rich.table

from paramreduce_cli.errors import ParamreduceWarning
from tests.simulated_logs import log_config, two_link_log, write_log
from tests.torture.damage import try_cache, try_damage
from tests.torture.disk import try_full_disks
from tests.torture.inputs import try_configs, try_data
from tests.torture.kills import start, try_kills

_TERMS = "\nterms: {torque_error: 0.1, functions: [inverse], rounds: 0}\n"
GOOD = {"noticed", "harmless", "equal", "one message", "a config", "a log", "a recording", "made"}


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--share", type=float, default=1.0, help="Of all there is to try.")
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    warnings.simplefilter("ignore", ParamreduceWarning)

    def of(count):
        return max(1, round(count * given.share))

    table = rich.table.Table("what", "tried", "survived", "otherwise")
    lost = 0

    def tell(what, found):
        nonlocal lost
        bad = {outcome: n for outcome, n in found.items() if outcome not in GOOD}
        lost += sum(bad.values())
        good = sum(found.values()) - sum(bad.values())
        table.add_row(what, str(sum(found.values())), str(good), str(bad or ""))

    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        assert start(folder / "run").wait() == 0
        write_log(folder / "log.csv", two_link_log())
        assert start(folder / "measured", log_config(folder, _TERMS)).wait() == 0
        for run in ("run", "measured"):
            for file, found in try_damage(folder / run, of(167), given.seed).items():
                tell(f"bytes of {file} flipped or cut off", found)
        tell("bytes of compiled code flipped or cut off", try_cache(folder, of(100), given.seed))
        tell("recordings tampered with", try_data(folder, of(10_000), given.seed))
        tell("configs tampered with", try_configs(folder, of(10_000), given.seed))
        tell(
            "disk full", try_full_disks(folder / "run", [int(500 * 1.6**k) for k in range(of(20))])
        )
        tell("runs killed and run again", try_kills(folder, of(200), given.seed))
    rich.console.Console(width=110).print(table)
    sys.exit(lost > 0)


if __name__ == "__main__":
    main()
