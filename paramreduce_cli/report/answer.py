"""What the page says first: which parameters, how wrong, at what cost, and how to have the code."""

from dataclasses import dataclass

import numpy as np

from paramreduce_cli.records import About, ErrorRange, ReducedModel, Speed, Validation
from paramreduce_cli.reduction.models import find_carriers
from paramreduce_cli.report.data import NO_TORQUE, ReportData
from paramreduce_cli.texts import format_percent
from paramreduce_cli.texts.measured_values import format_measured

_WEIGHTED = {
    "nominal-torque": "each joint weighted by its nominal torque",
    "noise": "each joint weighted by its noise",
    "none": "",
}


@dataclass(frozen=True)
class ShownParameter:
    """A selected parameter as it is shown."""

    name: str
    value: str
    unit: str
    deviation: str
    """Standard deviation where torques were measured; empty elsewhere."""
    relation: str
    """Sum of standard parameters that the value is of; empty for a parameter alone."""
    carrier: str
    """Other parameter that makes up most of the value; empty if there is none."""


@dataclass(frozen=True)
class Answer:
    """The result that the page begins with: parameters, errors, cost and code."""

    parameters: tuple[ShownParameter, ...]
    kinds: tuple[tuple[str, str], ...]
    """Meanings of the letters in the parameters' names; empty without a robot."""
    worst_joint: str
    """The largest error of a joint's torque, in its unit; empty where nothing is known of units."""
    functions: tuple[str, str]
    """Symbols of the functions whose operations are counted."""
    nanoseconds: tuple[str, str]
    """Times of one evaluation of both functions, beside the full model; empty if they were not measured."""
    manoeuvre: str
    """Deviations of the selected model in a simulated manoeuvre; empty if there is none."""
    loops: str
    """Operations and time of the whole evaluation of closed loops; empty without loops."""
    as_identified: bool
    """Whether the values are those of identification, to which held-out errors and deviations belong."""
    weighted: str
    """Weighting of the joints in errors elsewhere on the page; empty without one."""
    command: str
    """Command that writes the model as code."""
    kind: str
    """Class of the verdict's box: empty if the model is accepted, mixed with warnings, no if not, open if not judged."""
    headline: str
    """Advice in a few words; empty where the verdict is enough."""
    neighbours: str
    """Errors with one parameter more and less; empty where there are no such models."""


def gather_answer(data: ReportData, options: str) -> Answer:
    """Gather what the page begins with.

    Args:
        data: Records that the report shows.
        options: Config and options that name the run at the shell.
    """
    export = "paramreduce export" + (f" {options}" if options else "")
    return Answer(
        parameters=_list_parameters(data, data.validation.selected.model),
        kinds=_list_kinds(data),
        worst_joint=_find_worst_joint(data),
        functions=data.functions,
        nanoseconds=(
            _describe_speed(data, data.speed, "d_z with R"),
            _describe_speed(data, data.speed_direct, "[M_zz | δ_z] with R and b"),
        ),
        manoeuvre=_describe_manoeuvre(data),
        loops=_describe_loops(data),
        as_identified=_has_identified_values(data),
        weighted=_WEIGHTED[data.weighting],
        command=export if data.model is not None else f"{export} --format values",
        kind=_choose_kind(data.validation),
        headline=_choose_headline(data),
        neighbours=_describe_neighbours(data.validation),
    )


def _choose_kind(validation: Validation) -> str:
    """Return the class of the verdict's box."""
    if validation.accepted is False:
        return "no"
    if any(warning.about is About.SELECTED for warning in validation.warnings):
        return "mixed"
    return "open" if validation.accepted is None else ""


def _choose_headline(data: ReportData) -> str:
    """Return what the selected model is good for, if it is good for one function only."""
    if data.validation.accepted is False:
        return "Not accepted."
    return "Good for feed-forward; do not simulate with it." if data.unsafe else ""


def _describe_neighbours(validation: Validation) -> str:
    """Return the errors of the selected heuristic with one parameter less and one more."""
    n, result = validation.selected.n, validation.heuristics[validation.selected.heuristic]
    errors, part = result.torque_error.validation, "validation"
    if result.torque_error.test.size:
        errors = np.array([ErrorRange.summarise(row).median for row in result.torque_error.test])
        part = "test"
    elif np.isnan(errors).all():
        errors, part = result.torque_error.estimation, "estimation"
    known = [
        f"with {size} {'parameter' if size == 1 else 'parameters'} {format_percent(float(errors[row]))}"
        for size in (n - 1, n + 1)
        if (row := result.find_row(size)) is not None
    ]
    return f"Torque error on the {part} set: {', '.join(known)}." if known else ""


def _list_parameters(data: ReportData, model: ReducedModel) -> tuple[ShownParameter, ...]:
    """Return the parameters of the selected model as the page shows them."""
    found = None if data.identification is None else data.identification.reduced
    deviations = {} if found is None else found.find_deviations(model)
    carriers = _find_carriers(data)
    expressions = model.expressions or model.names
    return tuple(
        ShownParameter(
            name,
            format_measured(value, deviations.get(name))[0],
            data.find_unit(parameter).replace("^2", "²"),
            format_measured(value, deviations.get(name))[1],
            relation if relation != name else "",
            carriers.get(name, ""),
        )
        for parameter, name, value, relation in zip(
            model.first, model.names, model.values, expressions, strict=True
        )
    )


def _find_carriers(data: ReportData) -> dict[str, str]:
    """Return the parameters that make up most of a selected value of another name; none without a robot."""
    if data.model is None:
        return {}
    selected, reduction = data.validation.selected, data.reduction
    row = reduction.heuristics[selected.heuristic].find_row(selected.n)
    if row is None:
        return {}
    return find_carriers(reduction, selected.heuristic, row, data.model.values)


_KINDS = {
    "m": "mass",
    "mx my mz": "first moments",
    "Ixx … Izz": "inertia about the body's frame",
    "Ia": "rotor inertia",
    "fv": "viscous friction",
    "fc": "Coulomb friction",
    "off": "constant torque",
    "k": "stiffness",
    "fs": "Stribeck friction",
    "fa": "asymmetric viscous friction",
    "fq": "quadratic friction",
    "fl": "load-dependent friction",
    "ks": "factor of a spring's table",
    "fd": "factor of a damper's table",
    "C": "force per creepage or slip",
}
"""What letters stand for, by those that are explained together."""


def _list_kinds(data: ReportData) -> tuple[tuple[str, str], ...]:
    """Return the symbols of the parameters that are shown, with their meanings."""
    if data.model is None:
        return ()
    parameters = data.model.mechanism.parameters
    symbols = {parameters[k].kind.symbol for k in data.validation.selected.model.first}
    both = {f"I{a}{b}" for a in "xyz" for b in "xyz"}
    return tuple(
        (name, meaning)
        for name, meaning in _KINDS.items()
        if symbols & ({*name.split(" ")} | (both if name.startswith("Ixx") else set()))
    )


def _has_identified_values(data: ReportData) -> bool:
    """Return whether the selected model has identified values."""
    found = data.identification
    return found is not None and bool(found.reduced.find_deviations(data.validation.selected.model))


def _find_worst_joint(data: ReportData) -> str:
    """Return the joint with the largest error relative to its rating or torque, on the validation set if there is one."""
    if data.model is None:
        return ""
    name, rms = list(data.rms_torque.items())[-1]
    selected = data.validation.selected
    result = data.validation.heuristics[selected.heuristic]
    row = result.find_row(selected.n)
    errors = result.joint_torque_error[name][row] * rms
    rated = data.model.nominal_torque_given
    sizes = data.model.nominal_torque if rated else np.maximum(rms, NO_TORQUE)
    shares = np.where(np.isfinite(errors), errors / sizes, -np.inf)
    j = int(shares.argmax())
    label = data.model.mechanism.coordinate_names[j]
    whole = _format_two_digits(rms[j]) if rms[j] > NO_TORQUE else "no"
    unit = data.find_force_unit(j)
    rating = f" (rated {_format_two_digits(sizes[j])} {unit})" if rated else ""
    return f"RMS of the worst joint, {label}: {errors[j]:.2g} of {whole}\N{NO-BREAK SPACE}{unit}{rating}"


def _format_two_digits(value: float) -> str:
    """Return a number with two digits and without an exponent, like the rating of a motor."""
    return np.format_float_positional(value, precision=2, fractional=False, trim="-")


def _describe_manoeuvre(data: ReportData) -> str:
    """Return a sentence on the deviation of the selected model in a simulated manoeuvre."""
    result = data.manoeuvre
    if result is None:
        return ""
    deviations = result.compute_deviations("position")
    worst = int(deviations.argmax())
    return (
        f"deviation of the positions from the full model in a simulated manoeuvre of the {result.set_name} set, rms over time; "
        f"at most {format_percent(float(deviations[worst]))}, of {result.names[worst]}; accelerations "
        f"{format_percent(result.compute_error('acceleration'))}"
    )


def _describe_loops(data: ReportData) -> str:
    """Return a sentence on the operations and the time of the whole evaluation of closed loops."""
    loops = data.loops
    if loops is None:
        return ""
    full, selected = loops.whole.values()
    timed = ""
    if loops.seconds is not None and data.speed is not None:
        whole = [1e9 * (loops.seconds + seconds) for seconds in data.speed.seconds.values()]
        timed = f"; {whole[1]:.3g} ns instead of {whole[0]:.3g} ns in {data.speed.language}"
    return (
        f"operations of the whole evaluation, of {full}: {loops.newton} for one of Newton's corrections, {loops.rates} "
        f"for all velocities and accelerations with R and b, {selected - loops.newton - loops.rates} for d_z{timed}"
    )


def _describe_speed(data: ReportData, speed: Speed | None, of_loops: str) -> str:
    """Return the times of one evaluation of the full and of the selected model, in ns."""
    if speed is None:
        return ""
    full, reduced = (1e9 * seconds for seconds in speed.seconds.values())
    assert data.model is not None
    given = "" if data.model.mechanism.loops is None else f"{of_loops} handed in: "
    return f"{given}{reduced:.3g} ns instead of {full:.3g} ns in {speed.language}"
