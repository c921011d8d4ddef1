"""The sections of the page, and where on it figures and tables stand."""

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from typing import Any, TypeVar

F = TypeVar("F", bound=Callable[..., Any])


class PageSection(Enum):
    """A section of the page, in order: title, text (a template over the summary ``s``), and two flags.

    The flags are whether the section needs a mechanism, and whether it is unfolded at first.
    """

    HEURISTICS = ("Heuristics at the selected size", "", False, True)
    IDENTIFICATION = (
        "Identified parameters",
        "Errors are on the held-out part of the log, which was used neither for training nor to choose n. "
        "Standard deviations hold for noise as coloured as the residuals.",
        False,
        True,
    )
    LOG = ("Log", "The recorded signals and their processing.")
    SELECTED = (
        "Parameters of the selected model",
        "Each parameter is lumped: it also stands for a part of the removed parameters.",
    )
    PROOFS = (
        "Proven bounds",
        "No subset of n parameters has a torque error below the bound. Where the bound meets a heuristic, its subset is "
        "optimal.",
    )
    STABILITY = (
        "Sensitivity to the data",
        "The selection is repeated with each trajectory left out, and with fewer samples. Blue: selected with all data. "
        "Bars range from the smallest to the largest value.",
    )
    SAVINGS = (
        "Operations",
        "Counted are distinct sums, products and function calls, with parameters as run-time inputs. <b>Lean</b>: the "
        "leanest formulation found, as <code>paramreduce export</code> writes it; all other counts on this page are lean. "
        "<b>Textbook recursion</b>: Newton-Euler with common subexpressions. <b>The paper's rule</b>: textbook recursion, "
        "sign changes counted too. {{ 'With loops, d and [M, δ] are those of the open tree; exported functions include "
        "the projection and state their own count.' if loops }}",
        True,
        True,
    )
    TERMS = (
        "Pruned terms",
        "Negligible terms of the lean functions are removed, nodes close to a multiple of another node are replaced, and "
        "the remaining parameters are fitted again. Each function has its own values, and holds only inside the ranges "
        "of the estimation set. <code>paramreduce export --model terms --what idm</code> (or <code>ddm</code>) writes it.",
        True,
    )
    TRACKING = (
        "Control with the reduced model",
        "The simulated arm follows the full model. The controller evaluates exported code, and its torques are held for "
        "one period.",
        True,
    )
    MANOEUVRE = (
        "Simulated manoeuvre",
        "The first manoeuvre of the test set (validation set without one), simulated with all and with the selected "
        "parameters, under the same inputs and on the same road; a motion that begins in static equilibrium begins in that of "
        "its own model. Deviations are root mean squares over time, relative to that of the full model's motion; steady "
        "travel counts as motion.",
        True,
        True,
    )
    ACCELERATIONS = ("Accelerations and mass matrix", "", True)
    MECHANISM = ("Mechanism", "", True)
    BASE = (
        "Base parameters",
        "The rank is {{ s.model.n_base }}. The singular values drop by a factor of "
        "{{ '%.2g'|format(s.model.rank_gap) if s.model.rank_gap else '∞' }} after it.",
        True,
    )
    TRAJECTORIES = ("Exciting trajectories", "", True)
    ORDERING = ("Order of the parameters", "")
    PAPER = ("For a paper", "Text, citations, and figures without interaction.")

    def __init__(
        self, title: str, text: str, of_mechanism: bool = False, unfolded: bool = False
    ) -> None:
        self.title = title
        self.text = text
        self.of_mechanism = of_mechanism
        self.unfolded = unfolded


@dataclass(frozen=True)
class PagePlace:
    """A position on the page: section, order and height."""

    section: PageSection
    order: int
    """Within the section, figures and tables together."""
    tall: bool = False
    """Whether a table scrolls in a box of its own."""
    of_mechanism: bool = False
    """Whether there is nothing to show without a mechanism."""


def placed(
    section: PageSection, order: int, *, tall: bool = False, of_mechanism: bool = False
) -> Callable[[F], F]:
    """Declare where a figure or a table stands on the page, and whether it needs a mechanism, as its section may."""

    def declare(function: F) -> F:
        """Set the place of a function, and return the function."""
        place = PagePlace(section, order, tall, of_mechanism or section.of_mechanism)
        function.place = place  # type: ignore[attr-defined]
        return function

    return declare


def get_place(function: Callable[..., Any]) -> PagePlace:
    """Return the place on the page that ``placed`` has given a figure or a table.

    Raises:
        TypeError: The function is not decorated with ``placed``.
    """
    place = getattr(function, "place", None)
    if not isinstance(place, PagePlace):
        raise TypeError(f"{function.__name__} has no place on the page; decorate it with @placed")
    return place
