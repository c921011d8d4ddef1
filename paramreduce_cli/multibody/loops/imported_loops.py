"""Closed configurations and independent coordinates of imported robots with loops."""

from dataclasses import replace

from paramreduce_cli.errors import ConfigError, NumericalError
from paramreduce_cli.importing.simplification import SimplifiedRobot
from paramreduce_cli.multibody.loops.assembly import find_assembly
from paramreduce_cli.records import Mechanism

_DIGITS = 6
"""Decimals of the guess, which leads back to the assembly."""


def close_loops(robot: SimplifiedRobot, mechanism: Mechanism, *, required: bool) -> SimplifiedRobot:
    """Close the loops from the pose of the file, and choose independent coordinates; coordinates that are named as
    independent are preferred.

    Args:
        robot: A robot with loops.
        mechanism: The same robot as a mechanism with any independent coordinates.
        required: Whether the user named the independent coordinates, not the file.

    Returns:
        The robot with a guess and independent coordinates; without a guess where its loops do not close.

    Raises:
        ConfigError: A named coordinate depends on the others, or nothing moves.
    """
    names = mechanism.generalised_names
    named = [names.index(name) for name in robot.independent]
    driven = named or _find_driven(robot, names)
    try:
        q, independent = find_assembly(mechanism, driven)
    except NumericalError as error:
        warning = f"TODO description.tree.guess: {str(error).rstrip('.')}"
        chosen = robot.independent or tuple(names[k] for k in driven or [0])
        return replace(robot, independent=chosen, warnings=(*robot.warnings, warning))
    if not independent:
        raise ConfigError(
            f"{robot.source}: the loops leave nothing that moves. Close fewer, let more joints move, or close them "
            "with more freedom: fixed, revolute, spherical."
        )
    own = tuple(names[k] for k in independent)
    lost = [names[k] for k in named if k not in independent]
    if lost and required:
        raise ConfigError(
            f"--independent: the loops tie {', '.join(lost)} to the other coordinates that are named. "
            f"{', '.join(own)} determine all others; name some of these."
        )
    guess = {name: round(float(value), _DIGITS) for name, value in zip(names, q, strict=True)}
    guess = {name: value for name, value in guess.items() if value}
    warnings = robot.warnings
    if guess:
        shown = ", ".join(f"{name} = {value:.4g}" for name, value in guess.items())
        warnings = (*warnings, f"the loops are closed at {shown}, which is the guess")
    passed_over = [names[k] for k in driven if k not in independent]
    if passed_over:
        warnings = (
            *warnings,
            f"the loops tie {', '.join(passed_over)} to other coordinates, although the joints are driven: do the closures "
            "take more freedom than those of the robot? `spherical` takes the least",
        )
    if set(named) != set(independent):
        text = f"independent coordinates, which determine all others: {', '.join(own)}"
        warnings = (*warnings, f"{text}; --independent JOINT chooses others")
    closed = replace(robot, independent=own, guess=guess)
    outside = [
        f"{name} ({joint.lower:.4g} to {joint.upper:.4g})"
        for name, joint in closed.find_dependent_limits().items()
        if not joint.is_within_limits(guess.get(name, 0.0))
    ]
    if outside:
        warnings = (
            *warnings,
            f"the guess lies outside the limits that the file gives {', '.join(outside)}; trajectories do not keep to "
            "these limits. Give another guess, or add constraints by hand",
        )
    return replace(closed, warnings=warnings)


def _find_driven(robot: SimplifiedRobot, names: tuple[str, ...]) -> list[int]:
    """Return positions of the coordinates whose joints have an effort limit in the file, in the order of the file."""
    return [
        names.index(name)
        for body in robot.bodies
        if body.limits is not None and body.limits.effort
        for name in body.list_coordinates()
    ]
