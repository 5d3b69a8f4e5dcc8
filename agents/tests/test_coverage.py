"""The heuristic's places for pictures: every point is covered, and all searchers compute the same assignment."""

import math

import pytest
from lingjing_agents.capability import natural, team
from lingjing_agents.heuristic.picture_lattice import footprint, lattice, partition
from lingjing_agents.heuristic.search_plan import CoverageMap, SearchPlan, off_course_deg

from agents.tests.agent_kit import EAST, NADIR, NORTH, SOUTH, WEST, brief, grid


@pytest.mark.parametrize("height", [40.0, 70.0, 100.0, 160.0])
def test_every_point_of_the_region_lies_in_a_footprint(height: float):
    plan = lattice(grid(), NADIR, height)
    for i in range(60):
        for j in range(30):
            x, y = WEST + (EAST - WEST) * i / 59, SOUTH + (NORTH - SOUTH) * j / 29
            assert any(abs(x - p.x) <= p.size[0] / 2 + 1e-6 and abs(y - p.y) <= p.size[1] / 2 + 1e-6 for p in plan)


def test_footprint_is_that_of_a_pinhole_camera():
    wide, high = footprint(NADIR, 100.0)
    assert wide == pytest.approx(2 * 100 * math.tan(math.radians(42)))
    assert high == pytest.approx(wide * 1080 / 1920)


def test_lanes_run_the_way_that_needs_fewer_pictures():
    plan = lattice(grid(), NADIR, 100.0)
    assert {p.course_deg for p in plan} == {90.0}
    assert len(plan) == 16


def test_a_lattice_without_cells_is_empty():
    assert lattice((), NADIR, 100.0) == ()


@pytest.mark.parametrize("uavs", [1, 2, 3, 5, 10])
def test_all_searchers_compute_the_same_fair_partition(uavs: int):
    plan = lattice(grid(), NADIR, 100.0)
    views = [partition(grid(), plan, team(brief(f"scout[{i}]", uavs=uavs))) for i in range(1, uavs + 1)]
    assert all(each == views[0] for each in views)
    loads = [sum(views[0][p.cell] == f"scout[{i}]" for p in plan) for i in range(1, uavs + 1)]
    assert sum(loads) == len(plan)
    if uavs <= 3:
        assert max(loads) - min(loads) <= 3


def test_natural_order_puts_ten_after_two():
    assert sorted(["uav[10]", "uav[2]", "uav[1]"], key=natural) == ["uav[1]", "uav[2]", "uav[10]"]


def test_photographed_ground_has_no_gain():
    seen = CoverageMap(grid())
    assert seen.gain(100.0, -900.0, (100.0, 100.0), 1) == 1.0
    seen.mark(((50.0, -950.0), (150.0, -950.0), (150.0, -850.0), (50.0, -850.0)))
    assert seen.gain(100.0, -900.0, (100.0, 100.0), 1) == 0.0
    assert seen.gain(100.0, -900.0, (100.0, 100.0), 2) == 1.0
    assert 0.3 < seen.gain(150.0, -900.0, (100.0, 100.0), 1) < 0.7


def test_the_second_pass_has_turned_lanes_and_the_third_flies_lower():
    sweep = SearchPlan(brief(), NADIR, 100.0, 20.0)
    first = sweep.next_waypoint((306.0, -620.0))
    assert first is not None
    assert sweep.finished_cells() == ()
    for waypoint in sweep.plan:
        if sweep.owner[waypoint.cell] == "scout[1]":
            (x, y), (wide, high) = (waypoint.x, waypoint.y), waypoint.size
            sweep.map.mark(
                (
                    (x - wide / 2, y - high / 2),
                    (x + wide / 2, y - high / 2),
                    (x + wide / 2, y + high / 2),
                    (x - wide / 2, y + high / 2),
                )
            )
            sweep.drop(waypoint)
    assert sweep.next_waypoint((306.0, -620.0)) is None
    assert sweep.claim() is not None
    assert set(sweep.finished_cells()) == {name for name, owner in sweep.owner.items() if owner == "scout[1]"}
    sweep.next_pass()
    second = sweep.next_waypoint((306.0, -620.0))
    assert second is not None
    assert (second.height_m, second.course_deg) == (first.height_m, 0.0)
    sweep.next_pass()
    third = sweep.next_waypoint((306.0, -620.0))
    assert third is not None
    assert third.height_m < first.height_m


@pytest.mark.parametrize(("heading", "off"), [(90, 0), (270, 0), (80, 10), (0, 90), (359, 89), (100, 10), (-90, 0)])
def test_the_course_error_is_the_same_in_both_directions_of_a_lane(heading: float, off: float):
    assert off_course_deg(90.0, heading) == pytest.approx(off)
