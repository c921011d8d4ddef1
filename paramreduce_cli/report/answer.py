"""What the page says first: which parameters, how wrong, at what cost, and how to have the code."""

from dataclasses import dataclass

import numpy as np

from paramreduce_cli.records import ReducedModel
from paramreduce_cli.report.data import ReportData
from paramreduce_cli.texts import share


@dataclass(frozen=True)
class ShownParameter:
    """A selected parameter as it is shown."""

    name: str
    value: str
    unit: str
    deviation: str
    """Standard deviation where torques were measured; empty elsewhere."""


@dataclass(frozen=True)
class Answer:
    """What a reader has come for."""

    parameters: tuple[ShownParameter, ...]
    worst_joint: str
    """The largest error of a joint's torque, in its unit; empty where nothing is known of units."""
    nanoseconds: str
    """Of an evaluation, beside that of the full model; empty where it was not measured."""
    command: str
    """That writes the model as code."""


def answer(data: ReportData, asked: str) -> Answer:
    """What the page begins with.

    Args:
        data: What the report is made from.
        asked: The config and options that name the run at the shell.
    """
    export = "paramreduce export" + (f" {asked}" if asked else "")
    return Answer(
        parameters=_parameters(data, data.validation.selected.model),
        worst_joint=_worst_joint(data),
        nanoseconds=_nanoseconds(data),
        command=export if data.known_model is not None else f"{export} --format values",
    )


def _parameters(data: ReportData, model: ReducedModel) -> tuple[ShownParameter, ...]:
    estimate = data.identification and data.identification.reduced
    deviations = dict(zip(estimate.names, estimate.deviations, strict=True)) if estimate else {}
    return tuple(
        ShownParameter(
            name,
            f"{value:.6g}",
            data.unit(int(np.flatnonzero(model.position == k)[0])).replace("^2", "²"),
            f"{deviations[name]:.2g}" if name in deviations else "",
        )
        for k, (name, value) in enumerate(zip(model.names, model.values, strict=True))
    )


def _worst_joint(data: ReportData) -> str:
    """On the validation set where there is one."""
    if data.known_model is None:
        return ""
    name, rms = list(data.rms_torque.items())[-1]
    selected = data.validation.selected
    result = data.validation.heuristics[selected.heuristic]
    row = result.row(selected.n)
    assert row is not None  # it is among what was validated
    shares = getattr(result, f"torque_error_joint_{name}")[row]
    errors = np.where(np.isfinite(shares), shares * rms, -np.inf)
    j = int(errors.argmax())
    label = data.known_model.mechanism.coordinate_names[j]
    return f"{errors[j]:.2g} of {rms[j]:.2g} {data.force_unit(j)} at most, {label} ({share(float(shares[j]))})"


def _nanoseconds(data: ReportData) -> str:
    if data.tracking is None:
        return ""
    full, reduced = (1e9 * seconds for seconds in data.tracking.seconds.values())
    return f"{reduced:.3g} ns instead of {full:.3g} ns in {data.tracking.language}"
