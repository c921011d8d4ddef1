"""Completion of a stage's items: each is computed once and kept until all are combined."""

from collections.abc import Callable, Sequence
from typing import Any, TypeVar

from paramreduce_cli.records import Items, PartFinished, Progress, Run
from paramreduce_cli.resources.processes import State, start_workers

Record = TypeVar("Record")


def complete_items(
    run: Run,
    items: Items,
    keys: Sequence[str],
    state: Callable[[], State],
    work: Callable[[State, str], Record],
    *,
    task: str,
    jobs: int = 1,
    describe: Callable[[Any], str] = lambda _: "",
    prepare: Callable[[], None] = lambda: None,
) -> dict[str, Record]:
    """Compute the items that are missing, and store each as soon as it is computed.

    Args:
        run: Run that owns the progress callback.
        items: Kept items, and the part of them that this job computes.
        keys: Keys of all items, in their order.
        state: Function that returns the state that the work on every item needs; picklable if there are several
            processes.
        work: Computes the item of a key from the state; picklable if there are several processes.
        task: Name of the work for the progress.
        jobs: Number of processes.
        describe: Function that returns a detail of a finished item for the progress.
        prepare: Called in this process before worker processes start, if an item is missing.

    Returns:
        Records of all items by key.

    Raises:
        PartFinished: This job does only a part of the items, and that is done.
        KeyboardInterrupt: After all processes have been stopped; finished items are kept.
    """
    own = items.part.select(keys)
    found: dict[str, Record] = {key: items.kept[key] for key in own if key in items.kept}
    missing = [key for key in own if key not in found]
    kept = f"{len(found)} kept from before" if found else ""
    run.progress(Progress(task, len(found), len(own), kept))
    if missing:
        if jobs > 1:
            prepare()
        with start_workers(min(jobs, len(missing)), state) as pool:
            for key, record in pool.map_unordered(work, missing):
                items.kept[key] = record
                found[key] = items.kept[key]  # a large one is read from where it is kept
                detail = f"{key}{describe(record)}"
                run.progress(Progress(task, len(found), len(own), detail))
    if not items.part.is_whole:
        raise PartFinished
    return {key: found[key] for key in keys}
