"""Free lines of sight: the exact test agrees with samples along the line."""

from __future__ import annotations

import math
from collections.abc import Sequence

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from lingjing.scene.city import Bridge, Building, City, Land, Slope
from lingjing.scene.sight import SightLines

SQUARE = ((0.0, 0.0), (40.0, 0.0), (40.0, 40.0), (0.0, 40.0))
YARD = ((10.0, 10.0), (30.0, 10.0), (30.0, 30.0), (10.0, 30.0))
QUAY = ((-200.0, -200.0), (200.0, -200.0), (200.0, -60.0), (-200.0, -60.0))
RAMP = ((60.0, 0.0, 0.0), (100.0, 0.0, 10.0), (100.0, 20.0, 10.0), (60.0, 20.0, 0.0))
DECK = ((-150.0, 50.0, 8.0), (-50.0, 50.0, 8.0))
CITY = City(
    id="t",
    origin=(31.0, 121.0),
    bounds=(-200.0, -200.0, 200.0, 200.0),
    datum_m=-3.0,
    tile_m=60.0,
    lands=(Land(polygon=QUAY, top_m=2.0),),
    buildings=(Building(id="house", polygon=SQUARE, holes=(YARD,), base_m=-3.0, top_m=12.0, use="office"),),
    slopes=(Slope(id="ramp", top=RAMP, thickness_m=1.0),),
    bridges=(Bridge(id="bridge", path=DECK, width_m=8.0, thickness_m=1.0, pier_spacing_m=0.0),),
)
SIGHT = SightLines(lambda: CITY)
Point = tuple[float, float, float]
POINTS = st.tuples(st.floats(-150, 150), st.floats(-150, 150), st.floats(-2, 20)).map(
    lambda point: (point[0] + 0.0371, point[1] + 0.0617, point[2])
)
"""Points beside the whole metres at which the outlines lie: a line along a wall may be free or not."""


def depth_m(point: Point) -> float:
    """The depth of a point inside of the city; negative in free space. All outlines here are upright rectangles."""
    x, y, z = point
    ramp = (x - 60.0) / 4.0
    prisms = [(QUAY, -math.inf, 2.0), (SQUARE, -3.0, 12.0), (RAMP, ramp - 1.0, ramp)]
    prisms.append((((-150.0, 46.0), (-50.0, 54.0)), 7.0, 8.0))
    holds = [(low, high) for outline, low, high in prisms if is_over(outline, x, y)]
    if is_over(SQUARE, x, y) and is_over(YARD, x, y):
        holds.remove((-3.0, 12.0))
    return max([-math.inf, *(min(high - z, z - low) for low, high in holds)])


def is_over(outline: Sequence[tuple[float, ...]], x: float, y: float) -> bool:
    xs, ys = [corner[0] for corner in outline], [corner[1] for corner in outline]
    return min(xs) <= x <= max(xs) and min(ys) <= y <= max(ys)


@given(POINTS, POINTS)
@example((20.0, 20.0, 1.0), (25.0, 25.0, 1.0))
@example((-10.0, 20.0, 5.0), (60.0, 20.0, 5.0))
def test_a_line_is_free_if_no_sample_on_it_lies_inside_a_solid(first: Point, second: Point) -> None:
    samples = (tuple(a + k / 400 * (b - a) for a, b in zip(first, second, strict=True)) for k in range(401))
    deepest = max(depth_m((x, y, z)) for x, y, z in samples)
    free = SIGHT.is_free(first, second)
    if deepest > 0.01:
        assert free is False
    if free is False:
        assert deepest > -0.6  # samples lie at most 1 m apart, so that they may pass a corner by


@pytest.mark.parametrize(
    ("first", "second", "free"),
    [
        ((-10.0, 20.0, 5.0), (60.0, 20.0, 5.0), False),  # through the house
        ((-10.0, 20.0, 13.0), (60.0, 20.0, 13.0), True),  # over it
        ((12.0, 20.0, 5.0), (28.0, 20.0, 5.0), True),  # within its courtyard
        ((-100.0, 20.0, 5.0), (-100.0, 80.0, 5.0), True),  # under the bridge
        ((-100.0, 50.0, 5.0), (-100.0, 50.0, 12.0), False),  # up through its deck
        ((80.0, -20.0, 3.0), (80.0, 40.0, 3.0), True),  # under the ramp
        ((80.0, -20.0, 4.5), (80.0, 40.0, 4.5), False),  # through it
        ((0.0, -40.0, -2.0), (0.0, -100.0, 3.0), False),  # from the water through the edge of the quay
        ((0.0, -40.0, -2.0), (0.0, -100.0, 12.0), True),
    ],
)
def test_solids_block_lines_of_sight(first: Point, second: Point, free: bool) -> None:
    assert SIGHT.is_free(first, second) is free
    assert SIGHT.is_free(second, first) is free


def test_sight_is_unknown_without_a_city() -> None:
    assert SightLines(lambda: None).is_free((0.0, 0.0, 1.0), (1.0, 0.0, 1.0)) is None
