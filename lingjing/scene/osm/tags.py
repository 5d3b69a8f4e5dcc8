"""What tags say in numbers and colours: lengths with units, storeys, layers, colours. Nonsense reads as not said."""

from __future__ import annotations

import re
from collections.abc import Mapping
from math import isfinite

from lingjing.mission.appearance import LinearRgb

VEHICLES = {
    f"{kind}{link}"
    for kind in ("motorway", "trunk", "primary", "secondary", "tertiary", "residential", "unclassified", "service")
    for link in ("", "_link")
} | {"living_street"}
"""Values of `highway` that make a road network worth a try."""

_LENGTH = re.compile(r"^\s*~?\s*(?P<value>-?\d+(?:[.,]\d+)?)\s*(?P<unit>m|metres?|meters?|ft|feet|'|km)?\s*$")
_FEET = re.compile(r"^\s*(?P<feet>\d+)\s*'\s*(?P<inches>\d+(?:\.\d+)?)\s*(?:\"|'')\s*$")
_METRES = {"": 1.0, "m": 1.0, "ft": 0.3048, "feet": 0.3048, "'": 0.3048, "km": 1000.0}
_HEX = re.compile(r"^#?(?P<digits>[0-9a-fA-F]{6}|[0-9a-fA-F]{3})$")


def metres(tags: Mapping[str, str], *keys: str) -> float | None:
    """The first of some keys that gives a length, in metres: `12`, `12 m`, `40 ft`, `6'2"`."""
    for key in keys:
        text = tags.get(key, "").split(";")[0].lower()
        inches = _FEET.match(text)
        if inches:
            return 0.3048 * int(inches["feet"]) + 0.0254 * float(inches["inches"])
        match = _LENGTH.match(text)
        if match:
            unit = match["unit"] or ""
            return _finite(float(match["value"].replace(",", ".")) * _METRES.get(unit, 1.0))
    return None


def number(tags: Mapping[str, str], key: str) -> float | None:
    """A plain number, the first of a list."""
    try:
        return _finite(float(tags.get(key, "").split(";")[0].strip().replace(",", ".")))
    except ValueError:
        return None


def layer(tags: Mapping[str, str]) -> int:
    """The layer above (positive) or below the ground; a bridge without one is on 1, a tunnel on -1."""
    said = number(tags, "layer")
    if said is not None and abs(said) <= 10:
        return int(said)
    return 1 if is_set(tags, "bridge") else -1 if is_set(tags, "tunnel") else 0


def is_set(tags: Mapping[str, str], key: str) -> bool:
    """Whether a key is there and does not say no."""
    return tags.get(key, "no") not in ("no", "false", "0", "")


def is_below(tags: Mapping[str, str]) -> bool:
    """Whether something lies under the ground or inside a building and is not seen from outside."""
    return (
        tags.get("location") in ("underground", "indoor")
        or tags.get("indoor", "no") != "no"
        or tags.get("parking") == "underground"
        or (tags.get("tunnel", "no") not in ("no", "building_passage", "passage"))
        or (layer(tags) < 0 and "water" not in tags and tags.get("natural") != "water" and "waterway" not in tags)
    )


def colour(tags: Mapping[str, str], *keys: str) -> LinearRgb | None:
    """The first of some keys that names a colour (`#rrggbb`, `#rgb` or a CSS name)."""
    for key in keys:
        text = tags.get(key, "").split(";")[0].strip().lower().replace(" ", "").replace("_", "")
        if text:
            found = _HEX.match(text)
            rgb = _named(f"#{found['digits']}" if found else text)
            if rgb is not None:
                return rgb
    return None


def linear(red: int, green: int, blue: int) -> LinearRgb:
    """Bytes of sRGB as linear RGB (IEC 61966-2-1)."""
    first, second, third = (_linear(value / 255.0) for value in (red, green, blue))
    return first, second, third


# -- private


def _finite(value: float) -> float | None:
    """Python reads `inf`, `nan` and numbers of four hundred digits; nothing is built from them."""
    return value if isfinite(value) else None


def _linear(value: float) -> float:
    return round(value / 12.92 if value <= 0.04045 else ((value + 0.055) / 1.055) ** 2.4, 4)


def _named(text: str) -> LinearRgb | None:
    from PIL import ImageColor

    try:
        rgb = ImageColor.getrgb(text)
    except ValueError:
        return None
    return linear(*rgb[:3])
