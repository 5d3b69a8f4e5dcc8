"""Plane geometry against shapely, an independent implementation."""

import math
from itertools import combinations

import pytest
import shapely
from hypothesis import assume, given
from hypothesis import strategies as st

from lingjing.mission import geometry2d

SQUARE = ((0.0, 0.0), (10.0, 0.0), (10.0, 10.0), (0.0, 10.0))
ELL = ((0.0, 0.0), (10.0, 0.0), (10.0, 4.0), (4.0, 4.0), (4.0, 10.0), (0.0, 10.0))
COORDINATE = st.integers(-200, 200).map(lambda k: k / 4)
POINT = st.tuples(COORDINATE, COORDINATE)
RING = st.lists(POINT, min_size=3, max_size=7, unique=True).map(tuple)


@given(RING)
def test_fault_agrees_with_shapely(ring: geometry2d.Polygon) -> None:
    assert (geometry2d.fault(ring) == "") == (shapely.Polygon(ring).is_valid and shapely.Polygon(ring).area > 0)


@given(RING, POINT)
def test_measures_agree_with_shapely(ring: geometry2d.Polygon, point: geometry2d.Vector2) -> None:
    assume(not geometry2d.fault(ring))
    reference, outline = shapely.Polygon(ring), geometry2d.normalised(ring)
    assert geometry2d.signed_area(outline) == pytest.approx(reference.area)
    assert geometry2d.centroid(outline) == pytest.approx((reference.centroid.x, reference.centroid.y), abs=1e-6)
    assert geometry2d.contains(outline, *point) == reference.covers(shapely.Point(point))
    assert geometry2d.edge_distance(outline, *point) == pytest.approx(reference.exterior.distance(shapely.Point(point)))


@given(RING, POINT, POINT)
def test_clipped_area_agrees_with_shapely(
    ring: geometry2d.Polygon, corner: geometry2d.Vector2, opposite: geometry2d.Vector2
) -> None:
    assume(not geometry2d.fault(ring))
    box = geometry2d.bounds((corner, opposite))
    part = geometry2d.clipped(geometry2d.normalised(ring), box)
    expected = shapely.Polygon(ring).intersection(shapely.box(*box)).area
    assert (geometry2d.signed_area(part) if part else 0.0) == pytest.approx(expected, abs=1e-6)


def test_normalised_turns_clockwise_outlines_and_drops_repeats() -> None:
    clockwise = (*reversed(SQUARE), SQUARE[-1], SQUARE[-1])
    assert geometry2d.signed_area(geometry2d.normalised(clockwise)) == 100.0
    assert len(geometry2d.normalised(clockwise)) == 4


@pytest.mark.parametrize(
    ("ring", "words"),
    [
        ((), "0 different corners"),
        (((0.0, 0.0), (1.0, 1.0)), "2 different corners"),
        (((0.0, 0.0), (1.0, 1.0), (2.0, 2.0)), "no area"),
        (((0.0, 0.0), (10.0, 10.0), (10.0, 0.0), (0.0, 11.0)), "edge 1 meets edge 3"),
        (((0.0, 0.0), (math.nan, 1.0), (2.0, 2.0)), "not a finite number"),
    ],
)
def test_fault_names_the_reason(ring: geometry2d.Polygon, words: str) -> None:
    assert words in geometry2d.fault(ring)


def test_contains_is_true_on_the_border_and_false_in_the_notch() -> None:
    assert geometry2d.contains(ELL, 4.0, 7.0) and geometry2d.contains(ELL, 0.0, 0.0)
    assert not geometry2d.contains(ELL, 5.0, 5.0)


def test_the_polygon_of_a_circle_has_the_area_of_the_circle() -> None:
    assert geometry2d.signed_area(geometry2d.circle((3.0, 4.0), 50.0)) == pytest.approx(math.pi * 2500)


@given(RING)
def test_the_sweep_over_edges_finds_the_same_crossings_as_all_pairs(ring: geometry2d.Polygon) -> None:
    outline = geometry2d.normalised(ring)
    sides = tuple(geometry2d.edges(outline))
    assume(len(sides) >= 3)
    compared = [
        (i, j)
        for i, j in combinations(range(len(sides)), 2)
        if (geometry2d._folds_back if j - i in (1, len(sides) - 1) else geometry2d._meet)(*sides[i], *sides[j])
    ]
    assert sorted(geometry2d._crossings(sides)) == compared
    assert geometry2d._crossing(outline) == (compared[0] if compared else None)


def test_buffers_of_buffers_keep_few_corners() -> None:
    outline: geometry2d.Polygon = SQUARE
    for _ in range(30):
        outline = geometry2d.buffered(outline, 1.0, closed=True)
    assert len(outline) <= geometry2d.MOST_CORNERS and geometry2d.fault(outline) == ""
    assert math.isclose(geometry2d.signed_area(outline), 10 * 10 + 4 * 10 * 30 + math.pi * 30**2, rel_tol=0.02)
