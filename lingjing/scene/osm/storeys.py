"""Storeys of a building without tagged height: a range from its use, its footprint and its place.

Three things limit the range of a use:

- *The place*: almost all ordinary buildings of a settlement with so many inhabitants are below a height (`TALLEST`). In
  an unknown place none is assumed above `UNKNOWN_M`.
- *The neighbourhood*: among houses (a small median footprint) a building has one to three storeys.
- *Its own footprint*: one too deep for daylight is a hall; a small one is low.

The land use around a building does not make it a tower; its own tag does. The numbers are chosen for present-day
cities, with the reasons beside them; they are no statistics. If enough buildings around it have tagged heights, those
decide instead (`lingjing.scene.osm.neighbours`).
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
    """A range of storeys with its mode, for a triangular distribution."""

    fewest: float
    """Least number of storeys."""
    usual: float
    """Most frequent number of storeys."""
    most: float
    """Greatest number of storeys."""


@dataclass(frozen=True, slots=True)
class BuildingSite:
    """The ground of a building and the settlement around it."""

    area_m2: float
    """Footprint, square metres."""
    deep_m: float = 0.0
    """Twice its area over its perimeter, metres: half the side of a square."""
    footprint_m2: float = inf
    """Median footprint of the ordinary buildings around, square metres."""
    people: float | None = None
    """Inhabitants of the settlement; None if the map does not show them."""


STOREY_M = {"residential": 3.0, "house": 2.9, "commercial": 4.0, "office": 3.8, "industrial": 5.0, "warehouse": 8.0,
            "school": 3.7, "public": 4.2}  # fmt: skip
"""Height of a storey by use, metres; for `industrial` and `warehouse` that of a large hall."""

LOW_STOREY_M = 3.0
"""Height of a garage or a shed, metres (chosen)."""
CANOPY_M = 4.5
"""Height of a roof on posts, metres (chosen: a lorry needs 4 m)."""

SMALL_HALL_M2 = 80.0
"""Footprint up to which a hall is as high as a garage, square metres (chosen)."""
LARGE_HALL_M2 = 1500.0
"""Footprint from which a hall has the full storey height of its use, square metres (chosen)."""

RANGES = {
    "residential": StoreyRange(4, 6, 14), "house": StoreyRange(1, 2, 3), "commercial": StoreyRange(2, 4, 8),
    "office": StoreyRange(6, 14, 30), "industrial": StoreyRange(1, 2, 3), "warehouse": StoreyRange(1, 1, 1),
    "school": StoreyRange(3, 4, 5), "public": StoreyRange(2, 3, 5),
}  # fmt: skip
"""Storeys by use, among large blocks in a city of millions (chosen)."""

_SINGLE = LOW | {"bungalow", "cabin", "static_caravan", "allotment_house", "barn", "farm_auxiliary", "stable",
                 "cowshed", "sty", "boathouse", "supermarket"}  # fmt: skip
"""Values of `building` with one storey."""
_WORSHIP = {"church", "cathedral", "chapel", "mosque", "temple", "shrine", "synagogue", "religious"}
"""Values of `building` for places of worship."""
_TOWERS = {"tower": StoreyRange(6, 8, 12), "tower_block": StoreyRange(8, 12, 20), "skyscraper": StoreyRange(20, 30, 45)}
"""Storeys by values of `building` that name a tower (chosen)."""

TALLEST = ((1_000.0, 9.0), (10_000.0, 12.0), (50_000.0, 16.5), (200_000.0, 27.0), (1_000_000.0, 55.0),
           (5_000_000.0, 115.0))  # fmt: skip
"""Inhabitants of a settlement → metres; the walls of 99 % of its buildings are lower (chosen)."""

UNKNOWN_M = 18.0
"""Height of the walls of ordinary buildings in a place of unknown size, metres: six storeys of flats, the most
without a lift (chosen)."""

HOUSES_M2 = 200.0
"""Median footprint up to which a town consists of houses, square metres (chosen: a detached house
covers 80 to 180 m²)."""
BLOCKS_M2 = 400.0
"""Median footprint from which a town consists of blocks, square metres (chosen: slabs and perimeter
blocks cover more)."""

DEEP_M = 18.0
"""Twice the area over the perimeter from which a building is a hall, metres (chosen). Daylight keeps flats below: a
slab 12 m deep has 10, a tower of 30 by 30 m 15, a hall of 40 by 50 m 22."""

TINY_M2 = 25.0
"""Footprint below which a building has one storey, square metres (chosen)."""
OUTBUILDING_M2 = 60.0
"""Footprint below which a building may be an outbuilding of one storey, square metres (chosen)."""
OUTBUILDING = 0.45
"""Share of the median footprint around below which such a building is an outbuilding (chosen)."""

STOREY_M2 = 40.0
"""Square metres of a small footprint for each storey above the first (chosen)."""

SMALL_M2 = 400.0
"""Footprint below which drawn storeys are limited by `STOREY_M2`, square metres (chosen)."""
SMALL_INFERRED_M2 = 160.0
"""Footprint below which storeys inferred from neighbours are limited by `STOREY_M2`, square metres (chosen)."""

SLENDER = 14.0
"""Greatest height of a building over `BuildingSite.deep_m` (chosen): 7 for a square tower's side."""

LOW_TOWN_M = 27.0
"""Height of ordinary buildings up to which a town consists of low blocks, metres (chosen: nine storeys of flats)."""

_LOW = StoreyRange(1.0, 2.0, 3.0)
"""Storeys of a building without stated use in a town of houses."""
_LOW_FLATS = StoreyRange(2.0, 3.0, 4.0)
"""Storeys of stated flats or offices in a town of houses. Five in six residential buildings in Germany have one or two
dwellings (Destatis)."""


def storey_m(tags: Mapping[str, str], use: str, area_m2: float) -> float:
    """Height of a storey by use, metres; for halls by the footprint too."""
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
    """Height that the walls of an ordinary building do not exceed in a settlement of so many inhabitants, metres."""
    if people is None:
        return UNKNOWN_M
    if people <= TALLEST[0][0]:
        return TALLEST[0][1]
    for (fewer, low), (more, high) in pairwise(TALLEST):
        if people <= more:
            return low + (high - low) * log(people / fewer) / log(more / fewer)
    return TALLEST[-1][1]


def is_single(tags: Mapping[str, str], use: str, site: BuildingSite) -> bool:
    """True for a building of one storey: by its kind, or because it is as small as an outbuilding."""
    if tags.get("building") in _SINGLE or site.area_m2 < TINY_M2:
        return True
    if use in ("industrial", "warehouse") and site.area_m2 < SMALL_HALL_M2:
        return True
    small = site.area_m2 < min(OUTBUILDING_M2, OUTBUILDING * site.footprint_m2)
    return small and site.footprint_m2 < inf and not own_use(tags)


def usual_storeys(tags: Mapping[str, str], use: str, site: BuildingSite) -> StoreyRange:
    """The range of a building's storeys by its use, its ground and its place."""
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
    """Draw a number of storeys from a range."""
    return max(1, round(chance.triangular(around.fewest, around.most, around.usual)))


def limit_storeys(storeys: int, site: BuildingSite, floor_m: float, small_m2: float) -> int:
    """The storeys, limited by the footprint: few below `small_m2`, and no needle (`SLENDER`)."""
    if site.area_m2 < small_m2:
        storeys = min(storeys, 1 + int(site.area_m2 / STOREY_M2))
    return min(storeys, max(1, int(SLENDER * site.deep_m / floor_m)))


# -- private


def _may_be_hall(own: str, use: str, most_m: float) -> bool:
    """True for a deep building without stated use, and for a shop in a town without towers."""
    return (not own and use in ("residential", "office", "commercial")) or (own == "commercial" and most_m < LOW_TOWN_M)
