"""The sections of the page, and where on it figures and tables stand."""

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from typing import Any, TypeVar

F = TypeVar("F", bound=Callable[..., Any])


class PageSection(Enum):
    """A heading and what is said under it, a template over the summary ``s``; in this order.

    Some tell of a mechanism, and stand on the page only where there is one.
    """

    HEURISTICS = ("All heuristics", "")
    IDENTIFICATION = (
        "What the measurements say",
        "Measured torques of the part that was held out: nothing was learned from it, nor the number of "
        "parameters chosen by it. Standard deviations are for noise as coloured as the residuals.",
    )
    LOG = (
        "The log",
        "What was recorded, and what became of it before anything was learned from it.",
    )
    SELECTED = (
        "The selected model",
        "Each parameter below stands for itself and takes over a share of those that were dropped.",
    )
    PROOFS = (
        "How good it could be",
        "No subset of n parameters has a torque error below the bound; where the bound meets a "
        "heuristic, that is the best there is.",
    )
    STABILITY = (
        "How much it depends on the data",
        "The selection repeated by torque with each trajectory left out and with fewer samples. Blue: "
        "chosen with all data; bars of the values run from the smallest to the largest that came out.",
    )
    SAVINGS = (
        "What it saves",
        "Non-repeated sums, products and function calls, parameters as run-time inputs. <b>Lean</b>: of "
        "the leanest formulation found, as <code>paramreduce export</code> writes it; all other counts "
        "on this page are of this kind. <b>Plain recursion</b>: Newton-Euler as in a textbook, with "
        "common subexpressions. <b>The paper's rule</b>: plain recursion with sign changes counted. "
        "{{ 'With loops, d and [M, δ] are those of the open tree; exported functions, which also "
        "project, say their own count.' if loops }}",
        True,
    )
    TERMS = (
        "Without small terms",
        "Addends of the lean functions were left out too, nodes that hardly differ from a multiple of others replaced by "
        "it, and the parameters that remain fitted again; each "
        "function has values of its own. Such a function holds where it was fitted: inside the ranges of the "
        "estimation set. <code>paramreduce export --model terms --what idm</code> (or <code>ddm</code>) writes it.",
        True,
    )
    TRACKING = (
        "What it is for",
        "The arm follows the full model; the controller evaluates exported code, whose torques are held "
        "for one period.",
        True,
    )
    ACCELERATIONS = ("Accelerations", "", True)
    MECHANISM = ("The mechanism", "", True)
    BASE = (
        "Base parameters",
        "Rank {{ s.model.n_base }}; the singular values drop by a factor of "
        "{{ '%.2g'|format(s.model.rank_gap) if s.model.rank_gap else '∞' }} after it.",
        True,
    )
    TRAJECTORIES = ("Exciting trajectories", "", True)
    ORDERING = ("Parameter ordering", "")

    def __init__(self, title: str, text: str, of_mechanism: bool = False) -> None:
        self.title = title
        self.text = text
        self.of_mechanism = of_mechanism


@dataclass(frozen=True)
class PagePlace:
    """A position on the page: section, order and height."""

    section: PageSection
    order: int
    """Within the section, figures and tables together."""
    tall: bool = False
    """Whether a table scrolls in a box of its own."""


def placed(section: PageSection, order: int, *, tall: bool = False) -> Callable[[F], F]:
    """Declare where a figure or a table stands on the page."""

    def declare(function: F) -> F:
        function.place = PagePlace(section, order, tall)  # type: ignore[attr-defined]
        return function

    return declare


def get_place(function: Callable[..., Any]) -> PagePlace:
    """Return where a figure or a table stands on the page.

    Raises:
        TypeError: It does not say so.
    """
    place = getattr(function, "place", None)
    if not isinstance(place, PagePlace):
        raise TypeError(f"{function.__name__} has no place on the page; decorate it with @placed")
    return place
