"""Pages in a browser: `python -m tests.benchmarks.page RESULTS ...`.

The size of a page, the time until it can be used, what every step of the explorer's slider takes, layout
included, and how many models it shows otherwise than the summary. Times are of this machine and of software rendering.
"""

import json
import sys
from pathlib import Path

import numpy as np
import rich.box
import rich.console
import rich.table
from browser import complaints, opened
from explored import explored

_STEPS = """
const slider = document.querySelector("[data-part=n]"), taken = [];
for (let n = 0; n <= +slider.max; n++) {
  const begun = performance.now();
  slider.value = n;
  slider.dispatchEvent(new Event("input"));
  document.body.getBoundingClientRect();
  await new Promise((shown) => requestAnimationFrame(() => setTimeout(shown)));
  taken.push(performance.now() - begun);
}
return taken;
"""


def measured(page):
    """Seconds until the page is ready, at most; milliseconds until every step is shown; models, those that are
    shown wrongly, and complaints of the console.

    Args:
        page: Its file.
    """
    with opened(page) as driver:
        opening = driver.execute_script("return performance.now()") / 1e3  # since it was asked for
        steps = driver.execute_async_script(
            f"const done = arguments[0]; (async () => {{ {_STEPS} }})().then(done);"
        )
        summary = json.loads((page.parent / "summary.json").read_text())
        return opening, np.array(steps), *explored(driver, summary), complaints(driver)


def main():
    header = (
        "page",
        "MB",
        "ready, s",
        "steps",
        "median, ms",
        "worst, ms",
        "models",
        "wrong",
        "complaints",
    )
    table = rich.table.Table(*header, box=rich.box.SIMPLE)
    for results in map(Path, sys.argv[1:]):
        page = (results / "report" / "index.html").resolve()
        opening, steps, models, wrong, complained = measured(page)
        size = page.stat().st_size / 1e6
        times = (steps.size, np.median(steps), steps.max())
        numbers = (size, opening, *times, models, len(wrong), len(complained))
        table.add_row(str(results), *(f"{number:.3g}" for number in numbers))
    rich.console.Console(width=110).print(table)


if __name__ == "__main__":
    main()
