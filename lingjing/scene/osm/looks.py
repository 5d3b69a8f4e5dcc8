"""Looks of a building: facade, roof and colours, from its tags, else random by use. Colours are linear RGB."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from random import Random
from typing import Any

from lingjing.mission.appearance import LinearRgb
from lingjing.scene.osm.storeys import LOW_TOWN_M
from lingjing.scene.osm.tags import colour, linear
from lingjing.scene.osm.uses import LOW, word_of


@dataclass(frozen=True, slots=True)
class BuildingKind:
    """The facades and wall colours of a use, for random choice."""

    facades: tuple[str, ...]
    walls: tuple[LinearRgb, ...]


_PLASTER = (linear(214, 203, 184), linear(201, 186, 163), linear(222, 216, 205), linear(190, 170, 150))
_BRICK = (linear(150, 90, 72), linear(168, 108, 84), linear(184, 146, 120))
_STONE = (linear(198, 192, 180), linear(176, 170, 160), linear(160, 152, 142))
_GLASS = (linear(112, 138, 156), linear(92, 116, 136), linear(140, 156, 164), linear(78, 98, 112))
_SHEET = (linear(176, 180, 184), linear(140, 152, 164), linear(196, 190, 178))

KINDS: dict[str, BuildingKind] = {
    "residential": BuildingKind(("punched",), (*_PLASTER, *_BRICK, _STONE[0])),
    "house": BuildingKind(("punched",), (*_PLASTER, *_BRICK)),
    "commercial": BuildingKind(("ribbon", "curtain", "punched"), (*_STONE, *_PLASTER[:2])),
    "office": BuildingKind(("curtain", "ribbon", "curtain"), (*_GLASS, *_STONE[:2])),
    "industrial": BuildingKind(("industrial",), _SHEET),
    "warehouse": BuildingKind(("industrial",), _SHEET),
    "school": BuildingKind(("ribbon", "punched"), (*_PLASTER, _BRICK[1])),
    "public": BuildingKind(("punched", "ribbon"), (*_STONE, _PLASTER[2])),
}
"""Looks by use."""

_OLD_OFFICE = BuildingKind(("punched", "punched", "ribbon"), (*_STONE, *_PLASTER[:2], _BRICK[2]))
"""Looks of an office among low blocks. Glass facades are typical only of cities with towers."""

_OLD_TOP_M = 36.0
"""Greatest height of offices with `_OLD_OFFICE`, metres (chosen)."""

_MATERIALS: dict[str, LinearRgb] = {
    "glass": _GLASS[0], "mirror": _GLASS[3], "brick": _BRICK[0], "concrete": linear(170, 167, 160),
    "stone": _STONE[0], "sandstone": linear(205, 184, 150), "wood": linear(150, 112, 78), "metal": _SHEET[0],
    "steel": _SHEET[1], "plaster": _PLASTER[0], "gold": linear(207, 171, 80), "copper": linear(120, 160, 140),
    "marble": linear(225, 222, 216), "tiles": linear(160, 84, 62), "roof_tiles": linear(150, 76, 58),
    "slate": linear(84, 88, 94), "tar_paper": linear(70, 70, 70), "grass": linear(96, 128, 72),
    "timber_framing": _PLASTER[2], "cement_block": linear(160, 158, 150),
}  # fmt: skip
"""Colour by the value of `building:material` or `roof:material`."""
_TILES = (linear(158, 84, 62), linear(136, 70, 54), linear(110, 84, 74), linear(92, 92, 96))
_FLAT = (linear(150, 148, 144), linear(124, 122, 120), linear(168, 164, 156), linear(104, 106, 108))

_ROOFS = {
    "flat": "flat", "gabled": "gabled", "half-hipped": "hipped", "hipped": "hipped", "gambrel": "gabled",
    "mansard": "hipped", "pyramidal": "pyramidal", "dome": "dome", "onion": "dome", "round": "gabled",
    "cone": "pyramidal", "conical": "pyramidal", "saltbox": "gabled", "skillion": "flat", "spherical": "dome",
    "side_hipped": "hipped", "hipped-and-gabled": "hipped",
}  # fmt: skip
"""Value of `roof:shape` → roof of `Building`."""


SMALL_M2, MIDDLE_M2 = 250.0, 500.0
"""Footprints below which a dwelling is a small house, and a house of some families, square metres (chosen)."""

PITCHED, PITCHED_WARM = 0.9, 0.6
"""Share of small houses with pitched roofs without tagged ones (chosen): where it snows, and nearer to the equator,
where terraces are common."""

WARM_DEG = 33.0
"""Latitude below which `PITCHED_WARM` applies, degrees (chosen)."""

PRIOR = 20.0
"""Number of tagged roofs that count as much as the climate (chosen)."""

PITCHED_STOREYS = 4.0
"""Most storeys under a drawn pitched roof (chosen)."""

RECTANGULAR, COMPACT = 0.8, 0.9
"""Least share of the enclosing rectangle under a ridge, and of the convex hull under a pyramid (chosen): over other
footprints these shapes would stick out."""


def stream(seed: int, name: str) -> Random:
    """The random stream of one thing, independent of the rest of the map."""
    return Random(int.from_bytes(hashlib.sha256(f"{seed}/{name}".encode()).digest()[:16], "big"))


def kind_of(use: str, top_m: float, around_m: float) -> BuildingKind:
    """The looks of a building by use. A low office among buildings of at most `around_m` looks like an old one."""
    old = use == "office" and top_m <= _OLD_TOP_M and around_m <= LOW_TOWN_M
    return _OLD_OFFICE if old else KINDS[use]


def facade_of(tags: Mapping[str, str], use: str, kind: BuildingKind, height_m: float, chance: Random) -> str:
    """Return the window pattern of a building's facade, from its tags, use, kind and height; `chance` draws among
    equals."""
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
    """Colour of the walls: tagged, or that of the material, or one of the kind's."""
    pick = chance.choice(_GLASS if facade == "curtain" else kind.walls)
    tagged = colour(tags, "building:colour", "building:color", "building:facade:colour", "colour")
    return tagged or _MATERIALS.get(tags.get("building:material", ""), pick)


def roof_colour(tags: Mapping[str, str], roof: str, chance: Random) -> LinearRgb:
    """Colour of the roof: tagged, or that of the material, or one that suits its shape."""
    pick = chance.choice(_FLAT if roof == "flat" else _TILES)
    tagged = colour(tags, "roof:colour", "roof:color", "building:roof:colour")
    return tagged or _MATERIALS.get(tags.get("roof:material", ""), pick)


def pitched_share(small: Iterable[Mapping[str, str]], latitude_deg: float) -> float:
    """The share of small houses with pitched roofs at a place, 0..1.

    `small`: tags of the small buildings of the map. The tagged roofs count, and with few of them the climate.
    """
    usual = PITCHED if abs(latitude_deg) >= WARM_DEG else PITCHED_WARM
    shapes = [shape for tags in small if (shape := _tagged_roof(tags)) is not None and is_dwelling_word(tags)]
    tagged = sum(shape != "flat" for shape in shapes)
    return (tagged + usual * PRIOR) / (len(shapes) + PRIOR)


def pitched_by_size(tags: Mapping[str, str], use: str, area_m2: float, share: float) -> float:
    """The probability of a pitched roof by a building's use and footprint. `share`: that of small houses there."""
    if not is_dwelling_word(tags):
        return 0.0
    if use == "house" or (use == "residential" and area_m2 < SMALL_M2):
        return share
    if word_of(tags) in ("yes", "") and area_m2 < SMALL_M2 and use in ("commercial", "office", "public"):
        return 0.6 * share
    return 0.5 * share if use == "residential" and area_m2 < MIDDLE_M2 else 0.0


def is_dwelling_word(tags: Mapping[str, str]) -> bool:
    """True unless the tag `building` names something low that is no dwelling, such as a garage."""
    return word_of(tags) not in LOW


def roof_of(tags: Mapping[str, str], use: str, chance: Random, pitched: float) -> str:
    """Shape of the roof: tagged, that of churches and barns, or pitched with the probability `pitched`."""
    drawn = chance.random()
    tagged = _tagged_roof(tags)
    if tagged is not None:
        return tagged
    if tags.get("building") in ("church", "cathedral", "chapel", "barn", "farm_auxiliary", "stable", "cowshed"):
        return "gabled"
    if "building:part" in tags or drawn >= pitched:
        return "flat"
    return "hipped" if drawn >= 0.8 * pitched else "gabled"


def fitted_roof(tags: Mapping[str, str], roof: str, shape: Any, storeys: float) -> str:
    """The roof that a footprint can carry: a drawn one is flat on tall or ragged buildings."""
    if roof == "flat" or _tagged_roof(tags) is not None:
        return roof
    if storeys > PITCHED_STOREYS and tags.get("building") not in ("church", "cathedral", "chapel"):
        return "flat"
    whole = shape.minimum_rotated_rectangle
    if shape.area >= RECTANGULAR * whole.area:
        return roof
    return "pyramidal" if shape.area >= COMPACT * shape.convex_hull.area else "flat"


# -- private


def _tagged_roof(tags: Mapping[str, str]) -> str | None:
    return _ROOFS.get(tags.get("roof:shape", tags.get("building:roof:shape", "")))
