"""What every entry of a registry must be, so that a new file is all it takes to add one."""

import inspect
import subprocess
import sys

import pytest

from paramreduce_cli.config import get_schema
from paramreduce_cli.excitation.criteria import criteria as excitation_criteria
from paramreduce_cli.excitation.scalings import scalings
from paramreduce_cli.export.languages import languages
from paramreduce_cli.reduction.criteria import criteria
from paramreduce_cli.reduction.heuristics import heuristics
from paramreduce_cli.registry import Registry, list_names
from paramreduce_cli.report.figures import figures
from paramreduce_cli.report.page_sections import get_place
from paramreduce_cli.report.tables import tables
from paramreduce_cli.stages import stages

ROOMS = {  # with how many arguments their functions take
    "stages": (stages, None),
    "excitation/criteria": (excitation_criteria, 2),
    "excitation/scalings": (scalings, 3),
    "reduction/criteria": (criteria, 2),
    "reduction/heuristics": (heuristics, 1),
    "export/languages": (languages, 1),
    "report/figures": (figures, 1),
    "report/tables": (tables, 1),
}


@pytest.mark.parametrize(("room", "name"), [(room, n) for room in ROOMS for n in ROOMS[room][0]])
def test_a_file_holds_the_function_of_its_name_and_says_what_it_does(room, name):
    registry, arguments = ROOMS[room]
    function = registry[name]
    assert function.__name__ == name.replace("-", "_")
    assert inspect.getdoc(function)
    assert arguments in (None, len(inspect.signature(function).parameters))


@pytest.mark.parametrize("room", list(ROOMS))
def test_names_are_listed_without_importing(room):
    script = f"import sys; from paramreduce_cli.registry import list_names; print(len(list_names({room!r})), *sys.modules)"
    count, *modules = subprocess.check_output([sys.executable, "-c", script], text=True).split()
    assert int(count) == len(ROOMS[room][0]) >= 2
    assert not [m for m in modules if m.startswith(f"paramreduce_cli.{room.replace('/', '.')}.")]


@pytest.mark.parametrize("name", [*figures, *tables])
def test_figures_and_tables_have_places_of_their_own(name):
    place = get_place(figures[name] if name in figures else tables[name])
    others = [get_place(f) for r in (figures, tables) for _, f in r.items()]
    assert [(p.section, p.order) for p in others].count((place.section, place.order)) == 1


def test_the_schema_offers_them():
    definitions = get_schema()["$defs"]
    trajectories = definitions["TrajectoriesSection"]["properties"]
    assert set(trajectories["criterion"]["enum"]) == {"condition-number", "d-optimality"}
    assert {"weighted", "full"} < set(trajectories["scaling"]["enum"])
    selected = definitions["SelectedSection"]["properties"]["heuristic"]["anyOf"][0]
    reduction = definitions["ReductionSection"]["properties"]["heuristics"]["items"]
    crossed = {f"{n}@{c}" for n in ("swap", "floating") for c in ("acceleration", "operations")}
    wrong = {"qr@acceleration", "qr@operations", "best-subset@operations", "swap@torque"}
    for names in (set(selected["enum"]), set(reduction["enum"])):
        assert names >= {"qr", "best-subset", "swap"} | crossed
        assert not names & wrong


def test_rooms_that_offer_nothing_are_a_mistake():
    with pytest.raises(ValueError, match="nowhere offers nothing"):
        list_names("nowhere")


def test_unknown_names_are_key_errors():
    with pytest.raises(KeyError):
        heuristics["guessing"]
    assert "guessing" not in Registry("heuristic", "paramreduce_cli.reduction.heuristics")
