"""The settlement around a building and its inhabitants: from `place` and `population`, else from a metro.

The radius of a settlement follows from its inhabitants and `DENSITY`; its influence extends a little beyond. The
smallest settlement around a building counts (a village beside a metropolis stays a village), else the nearest in
relation to its size. Districts of a city (`suburb`, `quarter`) state no size of the city, so they count only where no
settlement reaches. On a map without any of these the size is unknown.
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
"""Inhabitants of a settlement without a `population`, within the ranges of
<https://wiki.openstreetmap.org/wiki/Key:place> (a city has over 100,000, a town over 10,000)."""

DISTRICT_PEOPLE = {"borough": 200_000.0, "suburb": 30_000.0, "quarter": 30_000.0, "neighbourhood": 30_000.0}
"""Least inhabitants of a settlement with such a district (chosen)."""

METRO_PEOPLE = 2_000_000.0
"""Inhabitants of a city with a metro, if the map names no settlement (chosen: few smaller cities have a metro)."""

DENSITY = 2_000.0
"""Inhabitants per square kilometre of settled ground (chosen, between a town of houses and one of blocks)."""

FARTHEST = 3.0
"""Radii of a settlement to which its influence extends (chosen)."""


@dataclass(frozen=True, slots=True)
class _Place:
    """A settlement or a district of one."""

    people: float
    """Inhabitants."""
    shape: Any
    """A point, or an area; inside the area the distance is 0."""
    radius_m: float
    """Radius of the settled ground, metres."""


class Places:
    """The settlements of a map."""

    def __init__(self, named: Iterable[Feature], *, metro: bool) -> None:
        """`named`: points and areas with a `place`. `metro`: True for a map with an underground railway."""
        named = tuple(named)
        self._settlements = _Reaches(_place(feature) for feature in named if _kind(feature) in USUAL_PEOPLE)
        self._districts = _Reaches(_place(feature) for feature in named if _kind(feature) in DISTRICT_PEOPLE)
        self._elsewhere = METRO_PEOPLE if metro else None

    def people_at(self, spot: Any) -> float | None:
        """The inhabitants of the settlement around a point; None if the map does not show its size."""
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
    """Places and the areas of their influence."""

    def __init__(self, places: Iterable[_Place]) -> None:
        import shapely

        self._places = tuple(places)
        self._tree = shapely.STRtree([place.shape.buffer(FARTHEST * place.radius_m) for place in self._places])

    def nearest(self, spot: Any) -> _Place | None:
        """The smallest place around a point, else the nearest in units of its radius; None if no influence reaches the
        point.
        """
        reaching = sorted(int(k) for k in self._tree.query(spot, predicate="intersects"))
        in_radii = [(self._places[k].shape.distance(spot) / self._places[k].radius_m, k) for k in reaching]
        around = min(((self._places[k].people, k) for radii, k in in_radii if radii <= 1.0), default=None)
        _, nearest = around or min(in_radii, default=(0.0, None))
        return None if nearest is None else self._places[nearest]
