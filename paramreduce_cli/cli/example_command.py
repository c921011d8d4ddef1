"""Commands that show how they are called."""

import inspect
import shlex
from collections.abc import Sequence
from pathlib import Path
from string import Formatter
from typing import Any

import click

from paramreduce_cli.cli.project_state import configs_in, has_report, results_in, results_of


class ExampleCommand(click.Command):
    """A command with an example.

    Args:
        arguments: As for click.
        example: Call without ``paramreduce``; ``{config}``, ``{results}`` and ``{results_2}`` stand for what is in the
            folder.
        robot: Robot of the example in the help.
        options: As for click.
    """

    def __init__(
        self, *arguments: Any, example: str, robot: str = "puma560", **options: Any
    ) -> None:
        super().__init__(*arguments, **options)
        self._example, self._robot = example, robot
        shown = self._filled(
            {
                "config": f"configs/{robot}.yaml",
                "results": f"results/{robot}",
                "results_2": "results/my_run",
            }
        )
        self.help = f"{inspect.cleandoc(self.help or '')}\n\nExample: {shown}"

    def _filled(self, names: dict[str, str]) -> str:
        return f"paramreduce {self._example.format(**names)}"

    def show_example(self, words: Sequence[str]) -> str:
        """Return the example with what is in this folder, or with what to do first; empty where too little is here."""
        names = {name for _, name, _, _ in Formatter().parse(self._example) if name}
        if not names:
            return self._filled({})
        configs, results = _here(words)
        if not configs and not results:
            shown = self._filled(
                {
                    "config": f"configs/{self._robot}.yaml",
                    "results": f"results/{self._robot}",
                    "results_2": "results/my_run",
                }
            )
            first = f"paramreduce init --example {self._robot} writes its config."
            return f"{shown}\nFirst: {first}"
        known = {"config": configs[:1], "results": results[:1], "results_2": results[1:2]}
        found = {name: shlex.quote(str(path)) for name, paths in known.items() for path in paths}
        if names <= found.keys():
            return self._filled(found)
        if results or "config" in names - found.keys():
            return ""
        shown = self._filled(
            {**found, "results": f"results/{configs[0].stem}", "results_2": "results/my_run"}
        )
        return f"{shown}\nFirst: paramreduce run {shlex.quote(str(configs[0]))} makes results."


def _here(words: Sequence[str]) -> tuple[list[Path], list[Path]]:
    """Return configs and results of this folder, those of the call first."""
    own = [path for path in map(Path, words) if path.suffix in (".yaml", ".yml") and path.is_file()]
    configs = list(dict.fromkeys([*own, *configs_in(Path())]))
    finished = [results for results in map(results_of, own) if has_report(results)]
    return configs, list(dict.fromkeys([*finished, *results_in(Path())]))
