"""What a building is for, how high it is where nobody says, and what it looks like: from tags, else by use and chance.

Untagged buildings get about as many storeys as the tagged ones near them (`lingjing.scene.osm.neighbours`); where too
few are tagged, round numbers for cities of our day, by use, which are no statistics. Colours are linear RGB.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Mapping
from dataclasses import dataclass
from random import Random

from lingjing.mission.appearance import LinearRgb
from lingjing.scene.osm.tags import colour, linear, metres, number


@dataclass(frozen=True, slots=True)
class BuildingKind:
    """A use: a storey's height, (fewest, usual, most) storeys where untagged, facades and wall colours to draw from."""

    storey_m: float
    storeys: tuple[int, int, int]
    facades: tuple[str, ...]
    walls: tuple[LinearRgb, ...]


@dataclass(frozen=True, slots=True)
class NearbyStoreys:
    """Median storeys of tagged buildings near a place: those of the same use, and all. None where too few are.

    `footprint_m2` is the median footprint of all buildings there, tagged or not.
    """

    alike: float | None = None
    all: float | None = None
    footprint_m2: float = math.inf


_PLASTER = (linear(214, 203, 184), linear(201, 186, 163), linear(222, 216, 205), linear(190, 170, 150))
_BRICK = (linear(150, 90, 72), linear(168, 108, 84), linear(184, 146, 120))
_STONE = (linear(198, 192, 180), linear(176, 170, 160), linear(160, 152, 142))
_GLASS = (linear(112, 138, 156), linear(92, 116, 136), linear(140, 156, 164), linear(78, 98, 112))
_SHEET = (linear(176, 180, 184), linear(140, 152, 164), linear(196, 190, 178))

KINDS: dict[str, BuildingKind] = {
    "residential": BuildingKind(3.0, (4, 6, 14), ("punched",), (*_PLASTER, *_BRICK, _STONE[0])),
    "house": BuildingKind(2.9, (1, 2, 3), ("punched",), (*_PLASTER, *_BRICK)),
    "commercial": BuildingKind(4.0, (2, 4, 8), ("ribbon", "curtain", "punched"), (*_STONE, *_PLASTER[:2])),
    "office": BuildingKind(3.8, (6, 14, 30), ("curtain", "ribbon", "curtain"), (*_GLASS, *_STONE[:2])),
    "industrial": BuildingKind(5.0, (1, 2, 3), ("industrial",), _SHEET),
    "warehouse": BuildingKind(8.0, (1, 1, 1), ("industrial",), _SHEET),
    "school": BuildingKind(3.7, (3, 4, 5), ("ribbon", "punched"), (*_PLASTER, _BRICK[1])),
    "public": BuildingKind(4.2, (2, 3, 5), ("punched", "ribbon"), (*_STONE, _PLASTER[2])),
}

_OLD_OFFICE = BuildingKind(3.8, (3, 5, 7), ("punched", "punched", "ribbon"), (*_STONE, *_PLASTER[:2], _BRICK[2]))
"""How an office looks among low blocks: cities of towers clad theirs in glass, old towns do not."""

HOUSES_M2, BLOCKS_M2 = 200.0, 400.0
"""Median footprints of a town of houses and of one of blocks. A detached house covers 80 to 180 m², a terraced one
less, a slab or a perimeter block 400 m² and more."""

DEEP_M = 18.0
"""Twice the area over the perimeter: daylight keeps flats below (a slab 12 m deep has 10, a tower of 30 by 30 m 15), a
hall of 40 by 50 m has 22."""

_LOW = (1.0, 2.0, 3.0)
_LOW_FLATS = (2.0, 3.0, 4.0)
"""(Fewest, usual, most) storeys in a town of houses: of what does not say what it is, and of what says flats, offices.
Five in six residential buildings in Germany have one or two dwellings (Destatis)."""

_TOWERS = {"tower", "skyscraper", "tower_block"}

_LOW_TOWN = 9.0
_OLD_TOP_M = 36.0
"""Median storeys of a town of low blocks, and how high its offices are that look like it."""

_USES = {
    "house": "house detached semidetached_house terrace bungalow cabin farm hut villa static_caravan allotment_house",
    "residential": "residential apartments dormitory block tower_block",
    "commercial": "commercial retail shop supermarket kiosk mall store hotel restaurant pavilion market",
    "office": "office skyscraper tower bank government",
    "industrial": "industrial factory manufacture works power substation transformer_tower service boiler_house",
    "warehouse": "warehouse hangar storage_tank silo barn farm_auxiliary shed garage garages carport depot",
    "school": "school university college kindergarten",
    "public": (
        "public civic hospital museum church cathedral chapel mosque temple shrine synagogue train_station station "
        "transportation stadium sports_hall sports_centre library theatre townhall fire_station grandstand monastery"
    ),
}
_USE_OF = {word: use for use, words in _USES.items() for word in words.split()}
_AMENITIES = {
    "school": ("school", "university", "college", "kindergarten"),
    "public": ("hospital", "library", "theatre", "townhall", "place_of_worship", "police", "arts_centre", "museum",
               "conference_centre", "fire_station", "courthouse", "community_centre"),
    "commercial": ("restaurant", "cafe", "fast_food", "bar", "marketplace", "cinema", "fuel", "pub"),
    "office": ("bank",),
}  # fmt: skip
LOW = {"garage", "garages", "carport", "shed", "kiosk", "hut", "service", "roof", "tent", "toilets", "pavilion"}
"""Values of `building` that are one low storey."""

_MATERIALS: dict[str, LinearRgb] = {
    "glass": _GLASS[0], "mirror": _GLASS[3], "brick": _BRICK[0], "concrete": linear(170, 167, 160),
    "stone": _STONE[0], "sandstone": linear(205, 184, 150), "wood": linear(150, 112, 78), "metal": _SHEET[0],
    "steel": _SHEET[1], "plaster": _PLASTER[0], "gold": linear(207, 171, 80), "copper": linear(120, 160, 140),
    "marble": linear(225, 222, 216), "tiles": linear(160, 84, 62), "roof_tiles": linear(150, 76, 58),
    "slate": linear(84, 88, 94), "tar_paper": linear(70, 70, 70), "grass": linear(96, 128, 72),
    "timber_framing": _PLASTER[2], "cement_block": linear(160, 158, 150),
}  # fmt: skip
_TILES = (linear(158, 84, 62), linear(136, 70, 54), linear(110, 84, 74), linear(92, 92, 96))
_FLAT = (linear(150, 148, 144), linear(124, 122, 120), linear(168, 164, 156), linear(104, 106, 108))

_ROOFS = {
    "flat": "flat", "gabled": "gabled", "half-hipped": "hipped", "hipped": "hipped", "gambrel": "gabled",
    "mansard": "hipped", "pyramidal": "pyramidal", "dome": "dome", "onion": "dome", "round": "gabled",
    "cone": "pyramidal", "conical": "pyramidal", "saltbox": "gabled", "skillion": "flat", "spherical": "dome",
    "side_hipped": "hipped", "hipped-and-gabled": "hipped",
}  # fmt: skip


def stream(seed: int, name: str) -> Random:
    """The chance of one thing, whatever else the map holds."""
    return Random(int.from_bytes(hashlib.sha256(f"{seed}/{name}".encode()).digest()[:16], "big"))


def use_of(tags: Mapping[str, str], around: str) -> str:
    """What a building is used for: its own tags, else the land use `around` it, else by its height."""
    said = tags.get("building", tags.get("building:part", ""))
    if said in _USE_OF:
        return _USE_OF[said]
    amenity = tags.get("amenity", "")
    for use, values in _AMENITIES.items():
        if amenity in values:
            return use
    if "office" in tags or "skyscraper" in tags:
        return "office"
    if "shop" in tags or tags.get("tourism") in ("hotel", "hostel"):
        return "commercial"
    if "tourism" in tags or "historic" in tags:
        return "public"
    height = metres(tags, "height", "building:height") or 3.5 * (number(tags, "building:levels") or 0.0)
    if height >= 60.0 and around != "residential":
        return "office"
    return around or "residential"


def storeys_of(
    tags: Mapping[str, str], use: str, area_m2: float, chance: Random, near: NearbyStoreys, deep_m: float = 0.0
) -> int:
    """Storeys of a building that does not say: like those near it, else by its use; fewer on a small footprint.

    `deep_m` is twice its area over its perimeter. What says nothing and is too deep for flats is a hall.
    """
    if tags.get("building") in LOW or area_m2 < 25.0:
        return 1
    said = tags.get("building", "")
    hall = use == "residential" and said not in _USE_OF and deep_m > DEEP_M
    fewest, usual, most = _LOW if hall else _spread(use, said, near)
    drawn = max(1, round(chance.triangular(fewest, most, usual)))
    return min(drawn, 1 + int(area_m2 / 40.0)) if area_m2 < 160.0 else drawn


def _spread(use: str, said: str, near: NearbyStoreys) -> tuple[float, float, float]:
    """(Fewest, usual, most) storeys to draw from."""
    fewest, usual, most = _by_form(use, said, near)
    middle = min(near.alike, most) if near.alike is not None else near.all
    if middle is None or (near.alike is None and middle >= usual):
        return fewest, usual, most
    return 0.75 * middle, middle, 1.3 * middle


def _by_form(use: str, said: str, near: NearbyStoreys) -> tuple[float, float, float]:
    """The storeys of a use among blocks, those of a town of houses among houses, and between the two in between."""
    high = KINDS[use].storeys
    if said in _TOWERS:
        return high
    low = _LOW_FLATS if _USE_OF.get(said) in ("residential", "office") else _LOW
    share = min(max((near.footprint_m2 - HOUSES_M2) / (BLOCKS_M2 - HOUSES_M2), 0.0), 1.0)
    fewest, usual, most = (min(a, b) + share * (b - min(a, b)) for a, b in zip(low, high, strict=True))
    return fewest, usual, most


def kind_of(use: str, top_m: float, near: NearbyStoreys) -> BuildingKind:
    """What a building of a use is drawn like: its kind, but that of an old office for a low one among low blocks."""
    old = use == "office" and top_m <= _OLD_TOP_M and near.all is not None and near.all <= _LOW_TOWN
    return _OLD_OFFICE if old else KINDS[use]


def facade_of(tags: Mapping[str, str], use: str, kind: BuildingKind, height_m: float, chance: Random) -> str:
    """The pattern of windows."""
    material = tags.get("building:material", tags.get("building:facade:material", ""))
    pick = chance.choice(kind.facades)
    if material in ("glass", "mirror"):
        return "curtain"
    if tags.get("building") in LOW or tags.get("man_made") or height_m < 2.5:
        return "blank"
    if use == "office" and height_m < 30.0 and pick == "curtain":
        return "ribbon"
    return pick


def wall_colour(tags: Mapping[str, str], kind: BuildingKind, facade: str, chance: Random) -> LinearRgb:
    """The walls' colour: said, or the material's, or one that suits the use."""
    pick = chance.choice(_GLASS if facade == "curtain" else kind.walls)
    said = colour(tags, "building:colour", "building:color", "building:facade:colour", "colour")
    return said or _MATERIALS.get(tags.get("building:material", ""), pick)


def roof_colour(tags: Mapping[str, str], roof: str, chance: Random) -> LinearRgb:
    """The roof's colour: said, or the material's, or one that suits its shape."""
    pick = chance.choice(_FLAT if roof == "flat" else _TILES)
    said = colour(tags, "roof:colour", "roof:color", "building:roof:colour")
    return said or _MATERIALS.get(tags.get("roof:material", ""), pick)


def roof_of(tags: Mapping[str, str], use: str, chance: Random) -> str:
    """The roof's shape; houses without one are often gabled."""
    drawn = chance.random()
    said = _ROOFS.get(tags.get("roof:shape", tags.get("building:roof:shape", "")))
    if said is not None:
        return said
    if tags.get("building") in ("church", "cathedral", "chapel", "barn"):
        return "gabled"
    return "gabled" if use == "house" and "building:part" not in tags and drawn < 0.7 else "flat"
