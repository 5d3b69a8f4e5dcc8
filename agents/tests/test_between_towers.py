"""Flights between towers: straight where they may be, around walls, and to free places."""

from __future__ import annotations

import math
import random

import numpy as np
import pytest
from lingjing_agents.paths import between_towers
from lingjing_agents.paths.between_towers import MARGIN_M, TowerPaths
from lingjing_agents.paths.grid_search import NEIGHBOURS, cheapest_path

WALL = ((-10.0, -200.0), (10.0, -200.0), (10.0, 50.0), (-10.0, 50.0))
"""A wall across the straight way, open in the north."""
COURT = ((300.0, 0.0), (340.0, 0.0), (340.0, 40.0), (300.0, 40.0))
RING = [((-60.0, -60.0), (60.0, -60.0), (60.0, -50.0), (-60.0, -50.0)),
        ((-60.0, 50.0), (60.0, 50.0), (60.0, 60.0), (-60.0, 60.0)),
        ((-60.0, -60.0), (-50.0, -60.0), (-50.0, 60.0), (-60.0, 60.0)),
        ((50.0, -60.0), (60.0, -60.0), (60.0, 60.0), (50.0, 60.0))]  # fmt: skip
"""Four walls around a court."""


@pytest.fixture
def towers() -> TowerPaths:
    return TowerPaths([(WALL, 100.0), (COURT, 30.0)])


def flown(towers: TowerPaths, here: tuple[float, float], goal: tuple[float, float], z_m: float):
    """The corners of a flight to its end."""
    places = [here]
    while math.dist(places[-1], goal) > 1.0:
        places.append(towers.next_place(places[-1], goal, z_m))
        assert len(places) < 12, places
    return places


def test_a_flight_above_the_roofs_is_straight(towers: TowerPaths) -> None:
    assert towers.next_place((-100.0, 0.0), (100.0, 0.0), 106.0) == (100.0, 0.0)
    assert towers.next_place((-100.0, 100.0), (100.0, 100.0), 40.0) == (100.0, 100.0)


def test_a_flight_below_a_roof_leads_around_the_building_with_a_margin(towers: TowerPaths) -> None:
    import shapely

    line = shapely.LineString(flown(towers, (-100.0, 0.0), (100.0, 0.0), 40.0))
    assert line.distance(shapely.Polygon(WALL)) >= MARGIN_M - 0.5
    assert 220.0 < line.length < 300.0


def test_a_place_in_a_building_is_replaced_by_the_nearest_free_one(towers: TowerPaths) -> None:
    assert towers.free((0.0, 0.0), 120.0) == (0.0, 0.0)
    x, y = towers.free((2.0, 0.0), 40.0)
    assert 10.0 + MARGIN_M < x < 11.0 + MARGIN_M and y == pytest.approx(0.0)
    assert towers.free((320.0, 20.0), 40.0) == (320.0, 20.0)


def test_an_aircraft_beside_a_wall_moves_away_and_an_enclosed_aircraft_flies_straight(towers: TowerPaths) -> None:
    beside = flown(towers, (-12.0, 0.0), (100.0, 0.0), 40.0)
    assert math.dist(beside[1], (-22.5, 0.0)) < 1e-6 and len(beside) < 8
    assert towers.next_place((-20.0, 0.0), (100.0, 0.0), 40.0)[1] > 50.0
    closed = TowerPaths((side, 90.0) for side in RING)
    assert closed.next_place((0.0, 0.0), (200.0, 0.0), 40.0) == (200.0, 0.0)


def test_the_highest_roof_is_that_of_the_buildings_near_the_line(towers: TowerPaths) -> None:
    assert towers.highest_m((-100.0, 0.0), (100.0, 0.0), 60.0) == 100.0
    assert towers.highest_m((200.0, 100.0), (400.0, 100.0), 70.0) == 30.0
    assert towers.highest_m((200.0, 100.0), (400.0, 100.0), 50.0) == -math.inf


def test_a_distant_enclosed_goal_needs_no_search(monkeypatch: pytest.MonkeyPatch) -> None:
    """The search would visit half a million cells, for each command."""
    closed = TowerPaths((side, 90.0) for side in RING)
    monkeypatch.setattr(between_towers, "cheapest_path", None)
    assert closed.next_place((-2000.0, -2000.0), (0.0, 0.0), 40.0) == (0.0, 0.0)


def test_cells_are_connected_exactly_if_a_path_exists() -> None:
    chance, connected = random.Random(5), 0
    for _ in range(400):
        rows, columns = chance.randint(3, 12), chance.randint(3, 12)
        closed = np.array([[chance.random() < 0.55 for _ in range(columns)] for _ in range(rows)])
        start, *ends = ((chance.randrange(rows), chance.randrange(columns)) for _ in range(chance.randint(2, 4)))

        def steps(cell: tuple[int, int]):
            for row, column, length in NEIGHBOURS:
                other = cell[0] + row, cell[1] + column
                if 0 <= other[0] < rows and 0 <= other[1] < columns and not closed[other]:  # noqa: B023
                    yield other, length

        path = cheapest_path(start, steps, lambda _: 0.0, ends.__contains__)
        if start not in ends:
            assert between_towers._connects(closed, start, ends) is bool(path)
            connected += bool(path)
    assert 100 < connected < 300
