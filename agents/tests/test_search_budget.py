"""The bound on repeated searches as an area, where agents receive the share of each cell that was seen."""

from __future__ import annotations

import pytest
from lingjing_agents.react.search_budget import SearchBudget

from agents.tests.agent_kit import brief, grid, observe, view
from lingjing.plugins.policy import Action
from lingjing.trace.records import CellView

CELLS = grid(3, 3)
LOOK = Action(verb="takePhoto", arguments={"camera": "nadir"}, resource="uav[1]")
OVER_THE_MIDDLE = view("uav[1]", (*CELLS[4].centre, 96.5))
FOOTPRINT_M2 = 180.1 * 101.3
"""84 degrees wide at 100 m above the water."""


def seen(share: float) -> tuple[CellView, ...]:
    """All cells, visited and seen to this share."""
    return tuple(CellView(name=cell.name, visited_tick=1, visited_by="uav[1]", seen=share) for cell in CELLS)


def test_new_ground_costs_nothing_and_ground_seen_before_costs_its_area() -> None:
    budget = SearchBudget(brief(), 1)
    whole = budget.left_m2
    assert whole == pytest.approx(sum(_area(cell.polygon) for cell in CELLS))
    assert budget.withheld(LOOK, observe("scout[1]", 1, OVER_THE_MIDDLE, cells=seen(0.0))) == ""
    assert budget.left_m2 == whole
    assert budget.withheld(LOOK, observe("scout[1]", 2, OVER_THE_MIDDLE, cells=seen(0.25))) == ""
    assert whole - budget.left_m2 == pytest.approx(0.25 * FOOTPRINT_M2, rel=0.01)


def test_the_search_goes_on_after_all_cells_are_visited_while_ground_is_unseen() -> None:
    """Nine pictures visit all cells and show two thirds of the people. Regression: a full count ended the search."""
    budget = SearchBudget(brief(), 0)
    assert not budget.over(observe("scout[1]", 30, OVER_THE_MIDDLE, cells=seen(0.6)))
    assert budget.over(observe("scout[1]", 50, OVER_THE_MIDDLE, cells=seen(0.97)))
    counted = tuple(CellView(name=cell.name, visited_tick=1, visited_by="uav[1]") for cell in CELLS)
    assert budget.over(observe("scout[1]", 30, OVER_THE_MIDDLE, cells=counted))


def test_a_picture_of_mostly_seen_ground_is_withheld_once_the_area_is_used() -> None:
    budget = SearchBudget(brief(), 0)
    assert "was seen" in budget.withheld(LOOK, observe("scout[1]", 9, OVER_THE_MIDDLE, cells=seen(0.9)))
    assert budget.withheld(LOOK, observe("scout[1]", 9, OVER_THE_MIDDLE, cells=seen(0.4))) == ""


def test_the_remaining_budget_is_stated_in_the_unit_of_its_limit() -> None:
    budget = SearchBudget(brief(), 2)
    shares = observe("scout[1]", 9, OVER_THE_MIDDLE, cells=seen(0.9))
    assert budget.members(shares) == {"ground_that_may_be_seen_again_m2": round(budget.left_m2)}
    counted = tuple(CellView(name=cell.name, visited_tick=1, visited_by="uav[1]") for cell in CELLS)
    assert budget.members(observe("scout[1]", 9, OVER_THE_MIDDLE, cells=counted)) == {
        "pictures_of_searched_cells_left": 18
    }


def _area(polygon: tuple[tuple[float, float], ...]) -> float:
    (west, south), (east, north) = (tuple(map(edge, zip(*polygon, strict=True))) for edge in (min, max))
    return (east - west) * (north - south)
