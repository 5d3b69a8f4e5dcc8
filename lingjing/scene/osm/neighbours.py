"""The storeys of a building whose tags do not state them, from those of the buildings around it.

Each building near it votes with its tagged storeys: the more, the nearer it is, the more alike its footprint, and three
times as much on the same land (a housing estate is built in one go). Buildings without a tag vote too, a little, for
the range that use and place give (`lingjing.scene.osm.storeys`): mappers tag the tall ones first, so three towers among
a hundred untagged houses make no town of towers. The weighted median wins. Neighbours of another use show how low a
building stays, never how high it grows; that only three of its own use do. Landmarks (a church, a silo) do not vote.

After Biljecki et al. (2017), who infer heights from footprints, their area and their surroundings. The weights are
those with a small median error in Lujiazui with half of the tags hidden (ADR 0022).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from math import ceil, inf
from statistics import median
from typing import Any

from lingjing.scene.osm.features import AROUND_M
from lingjing.scene.osm.heights import tagged_height_m, tagged_levels
from lingjing.scene.osm.storeys import DEEP_M, HOUSES_M2, StoreyRange
from lingjing.scene.osm.uses import LOW, is_landmark

NEAR_M = 300.0
"""The buildings within it give the median footprint and the usual storeys of a neighbourhood."""

FEWEST = 3
"""Fewer buildings show nothing of their neighbourhood."""

SMALLEST_M2 = 60.0
STOREY_M = 3.5
"""A storey of a building whose tags state the height alone."""

HALF_M = 100.0
"""A vote counts half at this distance."""

SIMILAR = 1.2
"""A vote counts 1/e where the footprints differ by a factor of e to this power, 3.3."""

SAME_LAND, OTHER_USE, UNTAGGED = 3.0, 0.1, 0.05
"""Weights of votes from the same land, from another use, and of buildings without a tag."""

RECORD = 8
"""One in so many votes, at least one, is a record that no building without a tag repeats."""

SPREAD = StoreyRange(0.85, 1.0, 1.2)
"""Storeys drawn around the winning vote."""


@dataclass(frozen=True, slots=True)
class NearbyBuilding:
    """A building as its neighbours see it: tags, use, number of the land it is on (-1 for none), shape in metres."""

    tags: Mapping[str, str]
    use: str
    land: int
    shape: Any


@dataclass(frozen=True, slots=True)
class Neighbourhood:
    """The buildings around one.

    `footprint_m2` is the median footprint of the ordinary ones, tagged or not, `storeys` the median of tagged ones,
    None where too few are. `votes` are (storeys, weight) of those with a tag, `others` of those of another use,
    `untagged` is the weight of those without.
    """

    footprint_m2: float = inf
    storeys: float | None = None
    votes: tuple[tuple[float, float], ...] = ()
    others: tuple[tuple[float, float], ...] = ()
    untagged: float = 0.0

    def expected(self, usual: StoreyRange, *, rises: bool) -> tuple[StoreyRange, bool]:
        """The storeys to draw from where `usual` is the range of the use in its place; true if neighbours decide it.

        Only a building that `rises` may be higher than that range, and only as high as most of its use around it.
        """
        most = self._most(usual, rises=rises)
        ballot = [(min(storeys, most), weight) for storeys, weight in self.votes]
        ballot += [(min(storeys, usual.usual), weight) for storeys, weight in self.others]
        if not ballot:
            return usual, False
        storeys = _weighted_median([*ballot, (usual.usual, self.untagged)])
        if storeys == usual.usual:
            return usual, False
        fewest, middle, top = (storeys * part for part in SPREAD)
        return StoreyRange(fewest, middle, top if rises else min(top, usual.most)), True

    def _most(self, usual: StoreyRange, *, rises: bool) -> float:
        """The storeys that a vote counts at most; an eighth of the use may surpass them: record towers come once."""
        if len(self.votes) < FEWEST:
            return usual.usual
        if not rises:
            return usual.most
        return sorted(storeys for storeys, _ in self.votes)[-1 - ceil(len(self.votes) / RECORD)]


class NearbyBuildings:
    """The buildings of a map, parts of buildings not among them."""

    def __init__(self, buildings: Iterable[NearbyBuilding]) -> None:
        import numpy as np
        import shapely

        ordinary = [one for one in buildings if _is_ordinary(one)]
        self._tree = shapely.STRtree([one.shape.representative_point() for one in ordinary])
        self._places = np.array([one.shape.representative_point().coords[0] for one in ordinary]).reshape(-1, 2)
        self._areas = np.array([one.shape.area for one in ordinary])
        self._halls = np.array([_is_hall(one.shape) for one in ordinary], dtype=bool)
        self._storeys = np.array([tagged_storeys(one.tags) or np.nan for one in ordinary])
        self._uses = np.array([one.use for one in ordinary], dtype=object)
        self._lands = np.array([one.land for one in ordinary], dtype=int)

    def around(self, building: NearbyBuilding) -> Neighbourhood:
        """What stands within `AROUND_M` of a building."""
        import numpy as np

        place = building.shape.representative_point()
        found = np.sort(self._tree.query(place, predicate="dwithin", distance=AROUND_M))
        apart = np.hypot(*(self._places[found] - place.coords[0]).T)
        storeys, alike = self._storeys[found], self._uses[found] == building.use
        tagged = ~np.isnan(storeys)
        weights = self._weights(found, apart, building)
        near = apart <= NEAR_M
        return Neighbourhood(
            self._footprint(found[near], building.shape),
            _median(storeys[near & tagged].tolist()),
            tuple(zip(storeys[alike & tagged].tolist(), weights[alike & tagged].tolist(), strict=True)),
            tuple(zip(storeys[~alike & tagged].tolist(), (OTHER_USE * weights[~alike & tagged]).tolist(), strict=True)),
            UNTAGGED * float(weights[alike & ~tagged].sum()),
        )

    def _weights(self, found: Any, apart: Any, building: NearbyBuilding) -> Any:
        import numpy as np

        unlike = np.abs(np.log(self._areas[found] / building.shape.area))
        same = (self._lands[found] == building.land) & (building.land >= 0)
        return np.where(same, SAME_LAND, 1.0) * np.exp(-unlike / SIMILAR) / (1.0 + (apart / HALF_M) ** 2)

    def _footprint(self, near: Any, shape: Any) -> float:
        """The median footprint of what is no hall; a building's own where it stands all but alone, and then that of a
        house at most: out there no town makes it a block."""
        areas = self._areas[near][~self._halls[near]].tolist()
        return median(areas) if len(areas) >= FEWEST else min(float(shape.area), HOUSES_M2)


def tagged_storeys(tags: Mapping[str, str]) -> float | None:
    """The storeys that a building's tags state, else those its tagged height would hold; None for neither."""
    levels = tagged_levels(tags)
    if levels is not None:
        return max(1.0, levels)
    height = tagged_height_m(tags)
    return max(1.0, height / STOREY_M) if height is not None and height >= 2.0 else None


# -- private


def _is_ordinary(building: NearbyBuilding) -> bool:
    low = building.tags.get("building") in LOW
    return building.shape.area >= SMALLEST_M2 and not low and not is_landmark(building.tags)


def _is_hall(shape: Any) -> bool:
    return bool(2.0 * shape.area / shape.length > DEEP_M)


def _weighted_median(ballot: list[tuple[float, float]]) -> float:
    half, total = sum(weight for _, weight in ballot) / 2.0, 0.0
    for storeys, weight in sorted(ballot):
        total += weight
        if total >= half:
            return storeys
    return max(storeys for storeys, _ in ballot)


def _median(counts: list[float]) -> float | None:
    return median(counts) if len(counts) >= FEWEST else None
