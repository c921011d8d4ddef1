"""Payloads in a YAML file."""

from collections.abc import Iterator, Mapping, Sequence

from paramreduce_cli.fields.names import Problem, UnknownNameError
from paramreduce_cli.fields.section import Name
from paramreduce_cli.records import Payload
from paramreduce_cli.robots.inertia import BodyParameters
from paramreduce_cli.robots.placement import Placement, compose_steps


class PayloadSection(BodyParameters):
    """A rigid body fixed to one of the mechanism's, with standard parameters of its own in a frame of its own; zero for those yet to be found."""

    body: Name
    """Body that carries it."""
    at: Placement = []
    """Frame of the payload in that of the body: a point, or steps; default: the body's own frame."""

    def build_payload(self, name: str, bodies: Mapping[str, int]) -> Payload:
        """Return the payload as a record.

        Args:
            name: Name of the payload.
            bodies: Indices of the bodies by name.
        """
        return Payload(name, bodies[self.body], compose_steps(self.at))


def find_payload_problems(
    sections: Mapping[str, PayloadSection], bodies: Sequence[str]
) -> Iterator[Problem]:
    """Yield contradictions with the mechanism, by the keys below ``payloads``."""
    for name, section in sections.items():
        if name in bodies:
            yield (name,), f"{name!r} is taken by a body; give the payload a name of its own"
        if section.body not in bodies:
            yield (name, "body"), UnknownNameError("body", section.body, bodies)
