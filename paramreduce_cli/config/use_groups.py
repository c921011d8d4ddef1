"""Groups of the parameters that have the same role in several uses of a subsystem."""

from collections.abc import Iterable

from paramreduce_cli.config.schema import Config, GroupSection
from paramreduce_cli.records import Parameter


def group_uses(config: Config) -> list[GroupSection]:
    """Return a group for each parameter of a subsystem that is used several times, such as a mass left and right.

    Args:
        config: Config with subsystems and their uses.
    """
    roles = {
        f"{name}{use.suffix}": (use.subsystem, name)
        for use in config.uses
        for name in _list_owners(config, use.subsystem)
    }
    members: dict[tuple[str, str, str], list[Parameter]] = {}
    for parameter in config.list_parameters():
        # Force elements of several components add the component to their name.
        element, _, component = parameter.owner.rpartition("_")
        owner = roles.get(parameter.owner)
        if owner is None and element in roles:
            owner = roles[element][0], f"{roles[element][1]}_{component}"
        if owner is not None:
            members.setdefault((*owner, parameter.kind.symbol), []).append(parameter)
    return [
        GroupSection(name=f"{symbol}_{subsystem}_{owner}", parameters=[p.name for p in parameters])
        for (subsystem, owner, symbol), parameters in members.items()
        if len(parameters) > 1
    ]


def _list_owners(config: Config, subsystem: str) -> Iterable[str]:
    """Return the names of the subsystem's bodies, drives and forces, which its parameters are named after."""
    section = config.subsystems[subsystem]
    bodies = (str(body.get("name")) for body in section.bodies)
    return [*bodies, *section.drives, *section.forces]
