"""Heights of a building: those that its tags state, in metres or in storeys, completed from an estimate of storeys.

Follows OpenStreetMap's Simple 3D Buildings: `height` and `building:levels` include the part below `min_height` and
`building:min_level`. `height` includes the roof, levels do not.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from lingjing.scene.osm.tags import metres, number, storeys

HEIGHT_KEYS = ("height", "building:height", "est_height")
"""Keys of a height in metres, by priority."""
LEVEL_KEYS = ("building:levels", "levels", "building:level", "building:floors")
"""Keys of a number of storeys, by priority."""
TALLEST_M = 1000.0
"""Greatest plausible height, metres (chosen)."""
LOWEST_M = 0.5
"""Least plausible height, metres (chosen). A tagged height outside of these two is ignored."""

STANDING = {"storage_tank": 12.0, "silo": 18.0, "chimney": 40.0, "tower": 20.0, "water_tower": 30.0, "gasometer": 25.0,
            "communications_tower": 100.0, "lighthouse": 20.0, "cooling_tower": 60.0}  # fmt: skip
"""Values of `man_made` that are buildings → height without a tag, metres (chosen)."""


class BuildingHeights(NamedTuple):
    """The heights of a building."""

    base_m: float
    """Elevation of the base, metres."""
    top_m: float
    """Elevation of the highest point, the roof included, metres."""
    roof_m: float
    """Height of the roof, metres."""
    levels: int
    """Number of storeys."""


def tagged_height_m(tags: Mapping[str, str]) -> float | None:
    """The tagged height in metres; None without a plausible one."""
    heights = (metres(tags, key) for key in HEIGHT_KEYS)
    return next((height for height in heights if height is not None and LOWEST_M <= height <= TALLEST_M), None)


def tagged_levels(tags: Mapping[str, str]) -> float | None:
    """The tagged storeys; 0 for a building that consists of a roof alone. None without any."""
    return storeys(tags, *LEVEL_KEYS)


def is_tagged(tags: Mapping[str, str]) -> bool:
    """True if a building's tags state its height or its storeys."""
    return tagged_height_m(tags) is not None or tagged_levels(tags) is not None


def heights(
    tags: Mapping[str, str], storey_m: float, roof: str, untagged_storeys: int, narrow_m: float
) -> BuildingHeights:
    """The heights of a building.

    `untagged_storeys`: used if the tags state neither a height nor storeys. `narrow_m`: shorter side of the footprint,
    from which the height of an untagged roof follows.
    """
    stated_m, levels = tagged_height_m(tags), tagged_levels(tags)
    roof_m = _roof_height(tags, roof, narrow_m)
    top = stated_m or _top_m(tags, levels, storey_m, roof_m, untagged_storeys)
    base = metres(tags, "min_height", "building:min_height")
    if base is None:
        lowest = number(tags, "building:min_level")
        base = 0.0 if lowest is None else _floor_height(lowest, levels, top - roof_m, storey_m)
    if tags.get("building") in ("roof", "carport") and base == 0.0 and "building:part" not in tags:
        base = max(0.0, top - roof_m - 0.5)  # a canopy is open below
    base = base if 0.0 <= base < top else 0.0
    roof_m = min(roof_m, top - base)
    count = levels if levels is not None and levels >= 1.0 else (top - base - roof_m) / storey_m
    return BuildingHeights(round(base, 2), round(top, 2), round(roof_m, 2), max(1, round(count)))


# -- private


def _top_m(tags: Mapping[str, str], levels: float | None, storey_m: float, roof_m: float, untagged: int) -> float:
    """The top of a building without a tagged height, metres."""
    if levels is not None:
        return levels * storey_m + roof_m if levels * storey_m + roof_m >= LOWEST_M else storey_m
    return STANDING.get(tags.get("man_made", ""), untagged * storey_m + roof_m)


def _floor_height(lowest: float, levels: float | None, walls_m: float, storey: float) -> float:
    """Height at which a level begins, metres; by the building's own storeys if their number is tagged."""
    return lowest * (walls_m / levels if levels and levels >= lowest else storey)


def _roof_height(tags: Mapping[str, str], roof: str, narrow_m: float) -> float:
    if roof == "flat":
        return 0.0
    stated_m = metres(tags, "roof:height", "building:roof:height")
    if stated_m is not None and stated_m >= 0.0:
        return stated_m
    levels = storeys(tags, "roof:levels")
    if levels is not None and 0.0 < levels <= 20.0:
        return 2.7 * levels
    if roof == "dome":
        return narrow_m / 2.0
    return min(0.35 * narrow_m, 6.0)
