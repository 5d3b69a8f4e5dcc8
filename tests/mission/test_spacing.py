"""`Spacing` answers as comparing with every place does, and looks at few of them."""

from __future__ import annotations

import math
from types import SimpleNamespace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lingjing.mission import spacing
from lingjing.mission.draws import sites
from lingjing.mission.evaluate import Place, further_place
from lingjing.mission.spacing import Spacing

SQUARE = ((0.0, 0.0), (1000.0, 0.0), (1000.0, 1000.0), (0.0, 1000.0))
METRES = st.floats(-3.0, 3.0) | st.integers(-3, 3).map(float)


@settings(derandomize=True, deadline=None)
@given(st.lists(st.tuples(METRES, METRES), max_size=25), st.sampled_from([0.0, 0.1, 0.7, 1.0, 4.0, -1.0]))
@pytest.mark.parametrize("offset", [0.0, 1e6, -1e14])
def test_answers_equal_those_of_comparing_with_every_place(
    offset: float, points: list[tuple[float, float]], apart: float
) -> None:
    kept = Spacing(apart, abs(offset) + 3.0)
    places: list[tuple[float, float]] = []
    for x, y in points:
        place = offset + x, y - offset
        free = all(math.hypot(place[0] - a, place[1] - b) >= apart for a, b in places)
        assert kept.is_free(*place) == free
        if free:
            kept.add(*place)
            places.append(place)


@pytest.fixture
def compared(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """One entry for each distance that was measured."""
    counted: list[int] = []

    def hypot(x: float, y: float) -> float:
        counted.append(1)
        return math.hypot(x, y)

    monkeypatch.setattr(spacing, "math", SimpleNamespace(hypot=hypot, floor=math.floor))
    return counted


@pytest.mark.parametrize("apart", [0.0, 5.0])
def test_thousands_of_sites_are_compared_with_their_neighbours_alone(apart: float, compared: list[int]) -> None:
    assert len(set(sites(SQUARE, apart, seed=3, path="x", count=3000)[0])) == 3000
    assert len(compared) < 10 * 3000


def test_further_members_are_compared_with_their_neighbours_alone(compared: list[int]) -> None:
    assert further_place((Place(1.0, 2.0, 3.0),), 8.125, 3000).elevation == 3.0
    assert len(compared) < 20 * 3000
