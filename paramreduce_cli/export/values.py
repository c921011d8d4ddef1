"""A model's values alone, for programs that have functions of their own."""

import json

from paramreduce_cli import __version__
from paramreduce_cli.export.validity import validity
from paramreduce_cli.records import Mechanism, ReducedModel, TermModel

VALUES = "values"
"""Name of the format, beside languages and robots' files."""


def values_file(
    chosen: ReducedModel,
    title: str,
    origin: str,
    mechanism: Mechanism | None = None,
    simplified: TermModel | None = None,
) -> dict[str, bytes]:
    """The parameters that a model keeps, as JSON: in their order what they are called, worth, and stand for.

    Args:
        chosen: The model, with expressions.
        title: What it is called.
        origin: The artifact it is from, and its digest.
        mechanism: Says units, coordinates and frames; None where there is none.
        simplified: The function that they are of with terms left out; where it holds is said of a mechanism.
    """
    found = zip(chosen.names, chosen.values.tolist(), chosen.expressions, strict=True)
    units = [] if mechanism is None else chosen.list_units(mechanism.parameters)
    sizes = chosen.unit_sizes.tolist() if chosen.units is not None else []
    known = {} if mechanism is None else {
        "coordinates": mechanism.generalised_names,
        "frames": mechanism.frames,
        "geometry": mechanism.table,
    }  # fmt: skip
    holds = {}
    if mechanism is not None and simplified is not None:
        holds = {"holds": validity(mechanism, simplified)}
    data = {
        "title": title,
        "from": origin,
        "paramreduce": __version__,
        "parameters": [
            {"name": name, "value": value}
            | ({"unit": units[k]} if units else {})
            | ({"unit_size": sizes[k]} if sizes else {})
            | ({"stands_for": expression} if expression else {})
            for k, (name, value, expression) in enumerate(found)
        ],
        **holds,
        **known,
    }
    return {"parameters.json": (json.dumps(data, indent=1) + "\n").encode()}
