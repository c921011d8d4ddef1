"""A model's values alone, for programs that have functions of their own."""

import json

from paramreduce_cli import __version__
from paramreduce_cli.records import ReducedModel

VALUES = "values"
"""Name of the format, beside languages and robots' files."""


def values_file(chosen: ReducedModel, title: str, origin: str) -> dict[str, bytes]:
    """The parameters that a model keeps, as JSON: in their order what they are called, worth, and stand for.

    Args:
        chosen: The model, with expressions.
        title: What it is called.
        origin: The artifact it is from, and its digest.
    """
    found = zip(chosen.names, chosen.values.tolist(), chosen.expressions, strict=True)
    data = {
        "title": title,
        "from": origin,
        "paramreduce": __version__,
        "parameters": [
            {"name": name, "value": value, "stands_for": expression}
            for name, value, expression in found
        ],
    }
    return {"parameters.json": (json.dumps(data, indent=1) + "\n").encode()}
