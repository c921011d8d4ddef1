"""What bodies carry, as a YAML gives it."""

from collections.abc import Iterator, Mapping, Sequence

from paramreduce_cli.fields.names import Problem, UnknownNameError
from paramreduce_cli.fields.section import Name
from paramreduce_cli.records import Payload
from paramreduce_cli.robots.inertia import BodyParameters
from paramreduce_cli.robots.placement import Placement, transform


class PayloadSection(BodyParameters):
    """A rigid body fixed to one of the mechanism's, with standard parameters of its own in a frame of its own; zero for those yet to be found."""

    body: Name
    """Body that carries it."""
    at: Placement = []
    """Its frame in that of the body: a point, or steps; the body's own frame if left out."""

    def payload(self, name: str, bodies: Mapping[str, int]) -> Payload:
        """The payload as a record.

        Args:
            name: Of the payload.
            bodies: Indices of the bodies by name.
        """
        return Payload(name, bodies[self.body], transform(self.at))


def problems(sections: Mapping[str, PayloadSection], bodies: Sequence[str]) -> Iterator[Problem]:
    """What does not fit the mechanism, by the keys below ``payloads``."""
    for name, section in sections.items():
        if name in bodies:
            yield (name,), f"{name!r} is taken by a body; give the payload a name of its own"
        if section.body not in bodies:
            yield (name, "body"), UnknownNameError("body", section.body, bodies)
