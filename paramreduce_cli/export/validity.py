"""Where a model holds, and what it is worth there, as lines of text."""

import numpy as np

from paramreduce_cli.records import ErrorRange, FloatArray, Mechanism, TermModel
from paramreduce_cli.texts import format_percent, format_percent_range


def describe_ranges(mechanism: Mechanism, lower: FloatArray, upper: FloatArray) -> list[str]:
    """Describe ranges of states, (3, n_dof) each, in one line for every joint."""
    lines = []
    for j, name in enumerate(mechanism.coordinate_names):
        extremes = zip(lower[:, j], upper[:, j], strict=True)
        lines.append(
            _describe_state(
                mechanism, j, name, [f"{low:.4g} to {high:.4g}" for low, high in extremes]
            )
        )
    return lines


def _describe_state(mechanism: Mechanism, j: int, name: str, values: list[str]) -> str:
    """Describe position, velocity and acceleration of a joint."""
    unit = mechanism.bodies[mechanism.independent[j]].unit
    position, velocity, acceleration = values
    return (
        f"  {name}: position {position} {unit}, velocity {velocity} {unit}/s, "
        f"acceleration {acceleration} {unit}/s^2"
    )


def describe_validity(mechanism: Mechanism, term: TermModel) -> list[str]:
    """Describe where a function with pruned terms holds, how far it deviates elsewhere, and where most."""
    lines = [
        "NEGLIGIBLE TERMS WERE PRUNED. The function holds only inside the ranges that it was fitted to:",
        *describe_ranges(mechanism, term.lower, term.upper),
    ]
    errors = (term.acceleration_error.estimation, term.acceleration_error.validation)
    if known := " / ".join(format_percent(error) for error in errors if np.isfinite(error)):
        lines.append(f"Error of the accelerations (estimation / validation): {known}.")
    test = ErrorRange.summarise(term.acceleration_error.test)
    if np.isfinite(test.median):
        lines.append(
            f"Error of the accelerations on the test motions: {format_percent_range(*test)}."
        )
    where = "both sets"
    if term.random_states or term.mass_states:
        lines.append("It was also evaluated on random states inside the limits, with these ranges:")
        lines += describe_ranges(mechanism, *term.drawn)
    if term.random_states:
        where = "the random states"
        lines.append(
            f"Torque error on {term.random_states} random states: {format_percent(term.random_torque_error)}."
        )
        if not np.isnan(term.random_acceleration_error):
            error = format_percent(term.random_acceleration_error)
            lines.append(f"Error of the accelerations on the random states: {error}.")
    lines.append(f"Largest differences of torques, N m or N, on {where}:")
    differences = zip(mechanism.coordinate_names, term.largest_difference.tolist(), strict=True)
    lines += [f"  {name}: {value:.3g}" for name, value in differences if not np.isnan(value)]
    worst = mechanism.coordinate_names[term.worst_joint]
    lines.append(f"Relative to the nominal torque the largest difference is that of {worst}, at")
    lines += [
        _describe_state(mechanism, j, name, [f"{value:.4g}" for value in term.worst_state[:, j]])
        for j, name in enumerate(mechanism.coordinate_names)
    ]
    if np.isfinite(term.smallest_eigenvalue):
        besides = f" and on {term.mass_states} random states" if term.mass_states else ""
        lines.append(
            f"Smallest eigenvalue of M on both sets{besides}: {term.smallest_eigenvalue:.3g}."
        )
    return lines
