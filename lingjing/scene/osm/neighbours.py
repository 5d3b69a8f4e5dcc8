"""What is built near a place: how many storeys, by what the map says of them, and on what footprints.

A map's mappers tag towers first. So neighbours of another use say how low a building stays, never how high it grows;
that only neighbours of its own use do. Where nobody tags storeys the footprints tell: small ones side by side are
houses, whatever stands among them. After Biljecki et al. (2017), who infer heights from footprints, their area and
their surroundings.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from statistics import median
from typing import Any

from lingjing.scene.osm.looks import LOW, NearbyStoreys
from lingjing.scene.osm.tags import metres, number

NEAR_M = 300.0
FEWEST = 3
"""Fewer tagged buildings near a place say nothing about it."""

SMALLEST_M2 = 60.0
STOREY_M = 3.5
"""A storey where only the height is said."""


class NearbyBuildings:
    """The tagged buildings of a map: (tags, use, shape in metres) of each, parts of buildings not among them."""

    def __init__(self, buildings: Iterable[tuple[Mapping[str, str], str, Any]]) -> None:
        import numpy as np
        import shapely

        places: list[Any] = []
        self._tagged: list[tuple[str, float]] = []
        self._grounds: list[Any] = []
        for tags, use, shape in buildings:
            if shape.area >= SMALLEST_M2 and tags.get("building") not in LOW:
                self._grounds.append(shape)
            count = storeys_said(tags)
            if count is not None and shape.area >= SMALLEST_M2 and tags.get("building") not in LOW:
                self._tagged.append((use, count))
                places.append(shape.representative_point())
        self._tree = shapely.STRtree(places)
        self._around = shapely.STRtree([shape.representative_point() for shape in self._grounds])
        self._areas = np.array([shape.area for shape in self._grounds])

    def near(self, use: str, shape: Any) -> NearbyStoreys:
        """What stands within `NEAR_M` of a building of that use."""
        place = shape.representative_point()
        found = [self._tagged[int(k)] for k in self._tree.query(place, predicate="dwithin", distance=NEAR_M)]
        alike = _median([n for other, n in found if other == use])
        return NearbyStoreys(alike, _median([n for _, n in found]), self._footprint(shape, place))

    def _footprint(self, shape: Any, place: Any) -> float:
        """The median footprint around a place, square metres; a building's own where it stands all but alone."""
        near = self._around.query(place, predicate="dwithin", distance=NEAR_M)
        return median(self._areas[near].tolist()) if len(near) >= FEWEST else float(shape.area)


def storeys_said(tags: Mapping[str, str]) -> float | None:
    """The storeys a building says it has, else those its height would hold; None for neither, or for nonsense."""
    levels = number(tags, "building:levels")
    if levels is not None and 1.0 <= levels <= 200.0:
        return levels
    height = metres(tags, "height", "building:height")
    return max(1.0, height / STOREY_M) if height is not None and 2.0 <= height <= 1000.0 else None


def _median(counts: list[float]) -> float | None:
    return median(counts) if len(counts) >= FEWEST else None
