"""Commands that show an example call in their help and after errors."""

import inspect
import shlex
from collections.abc import Sequence
from pathlib import Path
from string import Formatter
from typing import Any

import click

from paramreduce_cli.cli.project_state import (
    get_results_path,
    has_report,
    list_configs,
    list_results,
)


class ExampleCommand(click.Command):
    """A command with an example.

    Args:
        arguments: Positional arguments, as click takes them.
        example: Call without ``paramreduce``; ``{config}``, ``{results}`` and ``{results_2}`` stand for what is in the
            folder.
        config: Config of the example in the help.
        options: Keyword arguments, as click takes them.
    """

    def __init__(
        self, *arguments: Any, example: str, config: str = "configs/puma560.yaml", **options: Any
    ) -> None:
        super().__init__(*arguments, **options)
        self._example, self._robot = example, Path(config).stem
        self.help = f"{inspect.cleandoc(self.help or '')}\n\nExample: {self._fill({})}"

    def _fill(self, values: dict[str, str]) -> str:
        """Return the example with these values filled in, and with the robot of the help for the rest."""
        names = {
            "config": f"configs/{self._robot}.yaml",
            "results": f"results/{self._robot}",
            "results_2": "results/my_run",
        }
        return f"paramreduce {self._example.format(**names | values)}"

    def show_example(self, words: Sequence[str]) -> str:
        """Return the example with the config or results of this folder, and with the command to run first if one is
        needed. Return an empty text if the folder has some of them, but not those that the example needs.

        Args:
            words: Words of the command line; the configs among them come first.
        """
        names = {name for _, name, _, _ in Formatter().parse(self._example) if name}
        configs, results = _list_projects(words)
        if names and not configs and not results:
            return f"{self._fill({})}\nFirst: paramreduce init --example {self._robot} writes its config."
        paths = {"config": configs[:1], "results": results[:1], "results_2": results[1:2]}
        found = {name: shlex.quote(str(path)) for name, some in paths.items() for path in some}
        if names <= found.keys():
            return self._fill(found)
        if results or "config" in names - found.keys():
            return ""
        first = shlex.quote(str(configs[0]))
        found["results"] = f"results/{configs[0].stem}"
        return f"{self._fill(found)}\nFirst: paramreduce run {first} makes results."


def _list_projects(words: Sequence[str]) -> tuple[list[Path], list[Path]]:
    """Return configs and results of this folder; those on the command line come first."""
    own = [path for path in map(Path, words) if path.suffix in (".yaml", ".yml") and path.is_file()]
    configs = list(dict.fromkeys([*own, *list_configs(Path())]))
    finished = [results for results in map(get_results_path, own) if has_report(results)]
    return configs, list(dict.fromkeys([*finished, *list_results(Path())]))
