"""The storeys of a building whose tags do not state them: a range by its use, its footprint and the place it is in.

Three things limit the range of a use. *The place*: a settlement of so many people hardly has ordinary buildings of more
than so many metres (`TALLEST`); in an unknown place none of more than `UNKNOWN_M` is assumed. *The form*: among
houses (a small median footprint) a building has one to three storeys. *Its own footprint*: one too deep for daylight is
a hall, a small one is low. The land use around a building makes no tower of it; a tower's own tag does.

The numbers are chosen for cities of our day, with the reasons given beside them; they are no statistics. Where enough
buildings around have tagged heights, those count instead (`lingjing.scene.osm.neighbours`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from math import inf, log
from random import Random
from typing import NamedTuple

from lingjing.scene.osm.uses import LOW, own_use, word_of


class StoreyRange(NamedTuple):
    """The fewest, usual and most storeys to draw from."""

    fewest: float
    usual: float
    most: float


@dataclass(frozen=True, slots=True)
class BuildingSite:
    """The ground of a building and the settlement around it.

    `deep_m` is twice its area over its perimeter, `footprint_m2` the median footprint of the ordinary buildings around,
    `people` the inhabitants of the settlement, None where the map does not show them.
    """

    area_m2: float
    deep_m: float = 0.0
    footprint_m2: float = inf
    people: float | None = None


STOREY_M = {"residential": 3.0, "house": 2.9, "commercial": 4.0, "office": 3.8, "industrial": 5.0, "warehouse": 8.0,
            "school": 3.7, "public": 4.2}  # fmt: skip
"""A storey's height by use; that of a large hall for `industrial` and `warehouse`."""

LOW_STOREY_M = 3.0
CANOPY_M = 4.5
"""The heights of a garage or a shed, and of a roof on posts (a lorry needs 4 m)."""

SMALL_HALL_M2, LARGE_HALL_M2 = 80.0, 1500.0
"""Halls up to the first size are as high as a garage, those from the second on as high as their use's storey."""

RANGES = {
    "residential": StoreyRange(4, 6, 14), "house": StoreyRange(1, 2, 3), "commercial": StoreyRange(2, 4, 8),
    "office": StoreyRange(6, 14, 30), "industrial": StoreyRange(1, 2, 3), "warehouse": StoreyRange(1, 1, 1),
    "school": StoreyRange(3, 4, 5), "public": StoreyRange(2, 3, 5),
}  # fmt: skip
"""Storeys by use, among blocks in a city of millions."""

_SINGLE = LOW | {"bungalow", "cabin", "static_caravan", "allotment_house", "barn", "farm_auxiliary", "stable",
                 "cowshed", "sty", "boathouse", "supermarket"}  # fmt: skip
_WORSHIP = {"church", "cathedral", "chapel", "mosque", "temple", "shrine", "synagogue", "religious"}
_TOWERS = {"tower": StoreyRange(6, 8, 12), "tower_block": StoreyRange(8, 12, 20), "skyscraper": StoreyRange(20, 30, 45)}

TALLEST = ((1_000.0, 9.0), (10_000.0, 12.0), (50_000.0, 16.5), (200_000.0, 27.0), (1_000_000.0, 55.0),
           (5_000_000.0, 115.0))  # fmt: skip
"""Inhabitants of a settlement → metres; the walls of all but one in a hundred of its buildings stay below. Chosen."""

UNKNOWN_M = 18.0
"""The same where the map does not show the size of the place: six storeys of flats, the most without a lift."""

HOUSES_M2, BLOCKS_M2 = 200.0, 400.0
"""Median footprints of a town of houses and of one of blocks. A detached house covers 80 to 180 m², a terraced one
less, a slab or a perimeter block 400 m² and more."""

DEEP_M = 18.0
"""Twice the area over the perimeter: daylight keeps flats below (a slab 12 m deep has 10, a tower of 30 by 30 m 15), a
hall of 40 by 50 m has 22."""

TINY_M2, OUTBUILDING_M2, OUTBUILDING = 25.0, 60.0, 0.45
"""Footprints of one storey: below the first, and below the second if also below this share of the median around."""

STOREY_M2 = 40.0
"""A small footprint carries a storey, and one more for each of these."""

SMALL_M2, SMALL_INFERRED_M2 = 400.0, 160.0
"""Small footprints, where the storeys are drawn and where they are those of neighbours."""

SLENDER = 14.0
"""A building is at most so many times as high as `BuildingSite.deep_m`, which is half the side of a square tower."""

LOW_TOWN_M = 27.0
"""A town whose buildings stay below it is one of low blocks: nine storeys of flats."""

_LOW = StoreyRange(1.0, 2.0, 3.0)
_LOW_FLATS = StoreyRange(2.0, 3.0, 4.0)
"""Storeys in a town of houses: of what does not name its use, and of what names flats or offices. Five in six
residential buildings in Germany have one or two dwellings (Destatis)."""


def storey_m(tags: Mapping[str, str], use: str, area_m2: float) -> float:
    """The height of a storey: by use, and for halls by the footprint too."""
    word = tags.get("building", "")
    if word == "roof":
        return CANOPY_M
    if word in LOW:
        return LOW_STOREY_M
    if use not in ("industrial", "warehouse"):
        return STOREY_M[use]
    share = log(max(area_m2, SMALL_HALL_M2) / SMALL_HALL_M2) / log(LARGE_HALL_M2 / SMALL_HALL_M2)
    return LOW_STOREY_M + min(share, 1.0) * (STOREY_M[use] - LOW_STOREY_M)


def tallest_m(people: float | None) -> float:
    """The height that the walls of an ordinary building stay below in a settlement of so many people."""
    if people is None:
        return UNKNOWN_M
    if people <= TALLEST[0][0]:
        return TALLEST[0][1]
    for (fewer, low), (more, high) in pairwise(TALLEST):
        if people <= more:
            return low + (high - low) * log(people / fewer) / log(more / fewer)
    return TALLEST[-1][1]


def is_single(tags: Mapping[str, str], use: str, site: BuildingSite) -> bool:
    """True for a building of one storey: by its kind, or as small as an outbuilding."""
    if tags.get("building") in _SINGLE or site.area_m2 < TINY_M2:
        return True
    if use in ("industrial", "warehouse") and site.area_m2 < SMALL_HALL_M2:
        return True
    small = site.area_m2 < min(OUTBUILDING_M2, OUTBUILDING * site.footprint_m2)
    return small and site.footprint_m2 < inf and not own_use(tags)


def usual_storeys(tags: Mapping[str, str], use: str, site: BuildingSite) -> StoreyRange:
    """The storeys of a building by its use, its ground and its place."""
    word, own = word_of(tags), own_use(tags)
    if word in _TOWERS:
        return _TOWERS[word]
    most_m = tallest_m(site.people)
    most = most_m / STOREY_M[use]
    if site.deep_m > DEEP_M and _may_be_hall(own, use, most_m):
        return _LOW
    high = RANGES["commercial" if use == "office" and not own else use]
    low = _LOW_FLATS if own in ("residential", "office") else _LOW
    share = min(max((site.footprint_m2 - HOUSES_M2) / (BLOCKS_M2 - HOUSES_M2), 0.0), 1.0)
    formed = (min(a, b) + share * (b - min(a, b)) for a, b in zip(low, high, strict=True))
    most = min(most, 3.0) if word in _WORSHIP else most
    fewest, usual, top = (min(storeys, part * most) for storeys, part in zip(formed, (0.5, 0.65, 1.0), strict=True))
    return StoreyRange(max(1.0, fewest), max(1.0, usual), max(1.0, top))


def draw(around: StoreyRange, chance: Random) -> int:
    """Storeys out of a range."""
    return max(1, round(chance.triangular(around.fewest, around.most, around.usual)))


def carried(storeys: int, site: BuildingSite, floor_m: float, small_m2: float) -> int:
    """As many of the storeys as a footprint carries: few below `small_m2`, and none of a needle."""
    if site.area_m2 < small_m2:
        storeys = min(storeys, 1 + int(site.area_m2 / STOREY_M2))
    return min(storeys, max(1, int(SLENDER * site.deep_m / floor_m)))


# -- private


def _may_be_hall(own: str, use: str, most_m: float) -> bool:
    """True for a deep building that does not name its use, and for a shop where no malls in towers are."""
    return (not own and use in ("residential", "office", "commercial")) or (own == "commercial" and most_m < LOW_TOWN_M)
