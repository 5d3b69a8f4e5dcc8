"""Filling of blocks: drawn by the weights of the district's kind."""

from __future__ import annotations

from collections.abc import Callable
from random import Random

from lingjing.scene.districts import dwellings, industry, offices
from lingjing.scene.districts.draft import KERB_M, Draft
from lingjing.scene.districts.dwellings import Heights
from lingjing.scene.districts.rectangles import Rect

Filling = Callable[[Draft, Rect, Heights, Random], None]
"""A function that builds a filling into a lot."""


def _park(draft: Draft, lot: Rect, heights: Heights, chance: Random) -> None:
    offices.park(draft, lot, chance)


def _shops(draft: Draft, lot: Rect, heights: Heights, chance: Random) -> None:
    dwellings.ring(draft, lot, heights, chance, "commercial")


_FILLINGS: dict[str, tuple[Filling, str]] = {
    "slabs": (dwellings.slabs, "grass"),
    "houses": (dwellings.houses, "grass"),
    "homes": (dwellings.homes, "grass"),
    "home_towers": (dwellings.towers, "grass"),
    "ring": (dwellings.ring, "residential"),
    "shops": (_shops, "commercial"),
    "towers": (offices.towers, "commercial"),
    "park": (_park, "park"),
    "campus": (offices.campus, "grass"),
    "dormitories": (offices.dormitories, "grass"),
    "sports": (offices.sports, "grass"),
    "halls": (industry.halls, "industrial"),
    "warehouse": (industry.warehouse, "asphalt"),
    "yard": (industry.yard, "asphalt"),
}
"""Name → function that builds it, and the surface under it."""

WEIGHTS: dict[str, tuple[tuple[str, int], ...]] = {
    "residential": (("slabs", 9), ("houses", 6), ("home_towers", 3), ("ring", 3), ("park", 2)),
    "commercial": (("towers", 13), ("shops", 4), ("park", 2)),
    "industrial": (("halls", 6), ("warehouse", 2), ("yard", 1)),
    "campus": (("campus", 7), ("dormitories", 4), ("sports", 2), ("park", 2)),
    "logistics": (("warehouse", 7), ("yard", 3), ("shops", 5), ("slabs", 4), ("halls", 3), ("park", 1)),
    "coastal": (("ring", 5), ("slabs", 4), ("towers", 3), ("houses", 4), ("park", 2)),
}
"""Kind of district → fillings with their weights (chosen)."""

_SHARES = {
    "residential": (0.0, 0.35), "industrial": (0.0, 0.1), "commercial": (0.15, 1.0), "campus": (0.0, 0.25),
    "logistics": (0.0, 0.12), "coastal": (0.0, 0.5),
}  # fmt: skip
"""Kind of district → part of a whole city's range of building heights that it uses (chosen)."""

LOT_MOST_M = 215.0
"""Greatest side of a lot, metres (chosen). A larger block is divided into lots by ways of its own."""

LOT_GAP_M = 9.0
"""Width of the ways between lots, metres (chosen)."""


def fill(draft: Draft, kind: str, lot: Rect, heights: Heights, chance: Random, first: str = "") -> None:
    """Fill the interior of a block, divided into lots if it is large. `first`: filling of the first lot."""
    columns, rows = -(-int(lot.width) // int(LOT_MOST_M)), -(-int(lot.depth) // int(LOT_MOST_M))
    for part in lot.cells(max(1, columns), max(1, rows), LOT_GAP_M):
        name = first or _drawn(kind, part, chance)
        first = ""
        filling, surface = _FILLINGS[name]
        draft.area(part, surface, KERB_M + 0.011)
        filling(draft, part, heights, chance)


def surface(kind: str) -> str:
    """The surface between a block's lots."""
    return "asphalt" if kind in ("industrial", "logistics") else "plaza"


def heights(kind: str, of_city: Heights) -> Heights:
    """The building heights of a district that is part of a city."""
    low, high = _SHARES[kind]
    span = of_city[1] - of_city[0]
    return of_city[0] + low * span, of_city[0] + high * span


def zone(x: float, y: float, half_m: float) -> str:
    """The kind of district at a place in a city that extends `half_m` from its origin.

    Offices are in the middle, the sea in the east, industry in the west, and dwellings between them.
    """
    east, north = x / half_m, y / half_m
    if east > 0.5:
        return "coastal"
    if max(abs(east), abs(north)) < 0.34:
        return "commercial"
    if east < -0.5:
        return "industrial" if north > -0.1 else "logistics"
    if north > 0.45 and east > -0.15:
        return "campus"
    return "residential"


# -- private


def _drawn(kind: str, lot: Rect, chance: Random) -> str:
    """Return a random filling of a lot, by the weights of its kind. Most narrow lots become a park or houses."""
    if min(lot.width, lot.depth) < 34.0:
        return (
            "park"
            if kind in ("campus", "commercial") or chance.random() < 0.4
            else "slabs"
            if lot.width > 40
            else "park"
        )
    options = WEIGHTS[kind]
    at = chance.randrange(sum(weight for _, weight in options))
    for name, weight in options:
        at -= weight
        if at < 0:
            return name
    raise AssertionError("weights are positive")
