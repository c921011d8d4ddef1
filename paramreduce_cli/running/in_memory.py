"""Runs stages on records in memory, without files."""

from collections.abc import Mapping
from typing import Any

from paramreduce_cli.config import Config
from paramreduce_cli.config.schema import Settings
from paramreduce_cli.config.sections import get_section, is_section
from paramreduce_cli.records import Items, ProgressCallback, Run
from paramreduce_cli.running.pipeline import Stage, find_maker
from paramreduce_cli.running.stage_inputs import OUTSIDE, Inputs, call_stage


def run_in_memory(
    stage: Stage, config: Config | Settings, records: Mapping[type, Any], run: Run
) -> Any:
    """Run a stage on records.

    Args:
        stage: Stage to run.
        config: Config with the sections of the stage.
        records: Records of other stages by type.
        run: Worker processes and callbacks.

    Raises:
        ParamreduceError: A stage fails.
        TypeError: A record that it needs is not among them.
    """
    inputs = Inputs(config if isinstance(config, Config) else None)
    lent: dict[Any, Any] = {Run: run, ProgressCallback: run.progress, Items: Items(), **records}
    arguments: dict[str, Any] = {}
    for entry in stage.inputs:
        if is_section(entry.type):
            arguments[entry.name] = get_section(config, entry.type)
        elif entry.type in OUTSIDE:
            arguments[entry.name] = OUTSIDE[entry.type](inputs)
        elif lent.get(entry.type) is not None or entry.optional:
            arguments[entry.name] = lent.get(entry.type)
        else:
            name = entry.type.__name__
            maker = find_maker(entry.type).name.replace("-", "_")
            raise TypeError(f"{stage.function.__name__} needs a {name}, which {maker} makes")
    return call_stage(stage, arguments)
