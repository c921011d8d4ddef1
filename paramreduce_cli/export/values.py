"""A model's values alone, for programs that have functions of their own."""

import json

from paramreduce_cli import __version__
from paramreduce_cli.export.validity import describe_validity
from paramreduce_cli.records import Mechanism, ReducedModel, TermModel

VALUES = "values"
"""Name of the format, beside languages and robots' files."""


def write_values(
    chosen: ReducedModel,
    title: str,
    origin: str,
    mechanism: Mechanism | None = None,
    simplified: TermModel | None = None,
) -> dict[str, bytes]:
    """Return the parameters that a model keeps as JSON: names, values and expressions, in their order.

    Args:
        chosen: Reduced model with expressions.
        title: Title of the model.
        origin: Artifact that the model is from, and its digest.
        mechanism: Mechanism, which gives units, coordinates and frames; None where there is none.
        simplified: Function with pruned terms whose parameters these are.
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
        holds = {"holds": describe_validity(mechanism, simplified)}
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
