"""The list of conditions: bounds of quantities over the episode, radii, and declassifications."""

from __future__ import annotations

from pathlib import Path

import pytest

import lingjing
from lingjing.errors import UsageError
from lingjing.mission.conditions.listing import ConditionList, list_conditions
from lingjing.mission.conditions.survey import survey_mission
from lingjing.testing import compile_text, compiled, mission_file

YARD = (Path(__file__).parents[1] / "kernel" / "data" / "locker.ljs").read_text()
NINE = ("bi", "cd", "cr", "idf", "ld", "ssr", "ufr", "upr", "vdn")


def listed(name: str, mode: str | None = None) -> ConditionList:
    return list_conditions(lingjing.compile(str(mission_file(name))), mode)


def bounds(of: ConditionList) -> dict[str, tuple[float | None, float | None]]:
    quantities = (q for c in of.conditions for leaf in c.leaves for q in leaf.quantities)
    return {q.key: (q.least, q.most) for q in quantities if (q.least, q.most) != (None, None)}


def test_time_is_bounded_by_the_budget_and_amounts_by_their_interactions() -> None:
    assert bounds(listed("cr"))["now"] == (0.0, 1200.0)
    cargo = bounds(listed("cd"))
    assert cargo["point.demand_kg"] == (0.0, 250.0), "drawn, and lowered to nothing by deliveries"
    assert cargo["van.load_kg"] == (0.0, 200.0)
    assert cargo["van.payload_kg"] == (200.0, 200.0), "a constant"


@pytest.mark.parametrize(
    ("condition", "key", "interval"),
    [
        ("now > 20 s", "now", (0.0, 300.0)),
        ("boat.heading > 9 deg", "boat.heading_deg", (0.0, 360.0)),
        ("used(words) > 2", "counter words", (0.0, 7.0)),
        ("exists r in detection: r.confidence > 0.5", "message detection.confidence", (0.0, 1.0)),
    ],
)
def test_each_kind_of_number_has_its_bounds(condition: str, key: str, interval: tuple[float, float]) -> None:
    limited = YARD.replace("CONDITION", condition).replace(
        "success when", "limit words <= 7 counts detection\n  success when"
    )
    compilation = compile_text(limited)
    assert compilation.mission is not None, compilation.diagnostics
    ticks = bounds(list_conditions(compilation.mission))
    assert ticks[key] == interval


def test_a_radius_is_a_number_at_the_default_settings() -> None:
    radii = {leaf.text: leaf.radius_m for c in listed("ld").conditions for leaf in c.leaves if leaf.radius_m}
    assert radii == {"distance_xy(van, s) <= 30 m": 30.0, "distance_xy(dog, house) <= 40 m": 40.0}


def test_declassifications_are_listed_with_the_conditions_that_leak() -> None:
    declassified = {c.at: tuple(c.declassified) for c in listed("vdn").conditions if c.declassified}
    assert declassified == {
        "success": ("end",),
        "stage/search": ("search",),
        "stage/approach": ("approach",),
        "stage/arrive": ("arrive",),
    }


@pytest.mark.parametrize("name", NINE)
def test_the_list_has_the_conditions_of_the_survey_and_a_mode_only_narrows_bounds(name: str) -> None:
    mission = lingjing.compile(str(mission_file(name)))
    whole = list_conditions(mission)
    survey = survey_mission(mission)
    assert [c.at for c in whole.conditions] == [c.at for c in survey.conditions]
    assert [len(c.leaves) for c in whole.conditions] == [len(c.leaves) for c in survey.conditions]
    for mode in mission.modes.allowed:
        for key, (least, most) in bounds(list_conditions(mission, mode)).items():
            low, high = bounds(whole).get(key, (None, None))
            assert low is None or (least is not None and least >= low)
            assert high is None or (most is not None and most <= high)


def test_the_list_of_a_mission_that_is_too_large_has_no_computed_bounds() -> None:
    large = YARD.replace("CONDITION", "now > 20 s").replace("target victim :", "target victim[1..400] :")
    assert bounds(list_conditions(compiled(large))) == {"now": (0.0, None)}


def test_an_unknown_mode_is_refused() -> None:
    with pytest.raises(UsageError, match="no mode 'mesh'"):
        listed("cr", "mesh")
