"""The settlement around a building and how many people live in it: from `place` and `population`, else from a metro.

A settlement is as wide as its people need room at `DENSITY`, and reaches a little beyond. The smallest one around a
building counts (a village beside a metropolis stays a village), else the nearest in relation to its size. Districts of
a city (`suburb`, `quarter`) give no size of their own, so they count only where no settlement reaches. A map without
any of this leaves the size unknown.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from math import pi, sqrt
from typing import Any

from lingjing.scene.osm.features import Feature
from lingjing.scene.osm.tags import people

USUAL_PEOPLE = {"city": 300_000.0, "town": 20_000.0, "village": 1_000.0, "hamlet": 100.0, "isolated_dwelling": 10.0,
                "farm": 10.0}  # fmt: skip
"""Inhabitants of a settlement that does not count them; within the ranges of
<https://wiki.openstreetmap.org/wiki/Key:place> (a city has over 100,000, a town over 10,000)."""

DISTRICT_PEOPLE = {"borough": 200_000.0, "suburb": 30_000.0, "quarter": 30_000.0, "neighbourhood": 30_000.0}
"""Inhabitants that a settlement with such a district has at least; chosen."""

METRO_PEOPLE = 2_000_000.0
"""Inhabitants of a city with a metro where the map names no settlement: few smaller ones have one."""

DENSITY = 2_000.0
"""Inhabitants per square kilometre of settled ground; chosen, between a town of houses and one of blocks."""

FARTHEST = 3.0
"""A settlement reaches so many of its radii."""


@dataclass(frozen=True, slots=True)
class _Place:
    """`people` live around `shape` (a point, or an area within which the distance is 0), within `radius_m`."""

    people: float
    shape: Any
    radius_m: float


class Places:
    """The settlements of a map."""

    def __init__(self, named: Iterable[Feature], *, metro: bool) -> None:
        """`named` are the points and areas with a `place`; `metro` is true for a map with an underground railway."""
        named = tuple(named)
        self._settlements = _Reaches(_place(feature) for feature in named if _kind(feature) in USUAL_PEOPLE)
        self._districts = _Reaches(_place(feature) for feature in named if _kind(feature) in DISTRICT_PEOPLE)
        self._elsewhere = METRO_PEOPLE if metro else None

    def people_at(self, spot: Any) -> float | None:
        """The inhabitants of the settlement that a point belongs to; None where the map does not show its size."""
        own = self._settlements.nearest(spot)
        if own is not None:
            return own.people
        district = self._districts.nearest(spot)
        if district is not None:
            return max(district.people, self._elsewhere or 0.0)
        return self._elsewhere


# -- private


def _kind(feature: Feature) -> str:
    return feature.tags.get("place", "")


def _place(feature: Feature) -> _Place:
    kind, counted = _kind(feature), people(feature.tags)
    least = DISTRICT_PEOPLE.get(kind)
    count = max(counted or 0.0, least) if least is not None else counted or USUAL_PEOPLE[kind]
    return _Place(count, feature.shape, 1000.0 * sqrt(count / (DENSITY * pi)))


class _Reaches:
    """Places and the areas that they reach."""

    def __init__(self, places: Iterable[_Place]) -> None:
        import shapely

        self._places = tuple(places)
        self._tree = shapely.STRtree([place.shape.buffer(FARTHEST * place.radius_m) for place in self._places])

    def nearest(self, spot: Any) -> _Place | None:
        """The smallest place around a point, else the nearest in its own radii; None where none reaches."""
        reaching = sorted(int(k) for k in self._tree.query(spot, predicate="intersects"))
        in_radii = [(self._places[k].shape.distance(spot) / self._places[k].radius_m, k) for k in reaching]
        around = min(((self._places[k].people, k) for radii, k in in_radii if radii <= 1.0), default=None)
        _, nearest = around or min(in_radii, default=(0.0, None))
        return None if nearest is None else self._places[nearest]
