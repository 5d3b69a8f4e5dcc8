"""Values of tags: lengths with units, storeys, inhabitants, layers, colours. An invalid value counts as missing.

Mappers write one length in many ways (`30`, `+30`, `30 m`, `30米`, `3-5`, `100 ft`, `6'2"`). The rules of OpenStreetMap
(<https://wiki.openstreetmap.org/wiki/Map_features/Units>) are supported, and other common notations too.
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Mapping
from math import isfinite

from lingjing.mission.appearance import LinearRgb

VEHICLES = {
    f"{kind}{link}"
    for kind in ("motorway", "trunk", "primary", "secondary", "tertiary", "residential", "unclassified", "service")
    for link in ("", "_link")
} | {"living_street"}
"""Values of `highway` for vehicles: a map without any of them gets no road network."""

_NUMBER = r"-?(?:\d+(?:[.,]\d+)?|[.,]\d+)"
_UNITS = {
    0.01: ("cm",),
    0.3048: ("ft", "feet", "foot", "'"),
    1.0: ("", "m", "mt", "mts", "mtr", "mtrs", "metre", "metres", "meter", "meters", "metro", "metros", "м", "米",
          "公尺"),
    1000.0: ("km",),
}  # fmt: skip
"""Metres of a unit → its names."""
_METRES = {unit: factor for factor, units in _UNITS.items() for unit in units}
_UNIT = "|".join(sorted(filter(None, _METRES), key=len, reverse=True))
_LENGTH = re.compile(
    rf"(?P<low>{_NUMBER})\s*(?P<first>{_UNIT})?\.?(?:\s*(?:-|~|to)\s*(?P<high>{_NUMBER}))?\s*(?P<unit>{_UNIT})?\.?\+?"
)
_FEET = re.compile(
    r"(?:(?P<feet>\d+(?:\.\d+)?)\s*(?:'(?!')|ft\.?|feet|foot)\s*-?\s*)?(?P<inches>\d+(?:\.\d+)?)\s*(?:\"|''|inches|inch|in\.?|$)"
)
_THOUSANDS = re.compile(r"(\d),(\d{3})(?=\s*(?:ft|feet|foot|'))")
_QUALIFIER = re.compile(r"^(?:~|≈|±|<|>|=|\+|(?:ca|approx|circa|about|est|约|約)\.?|地上)\s*")
"""Words and signs before a number that mark an estimate or a count above the ground. They are ignored."""

_ASIDE = re.compile(r"\s*(?:\(.*\)|/\s*[\d.,]+\s*(?:ft|feet|m)\b.*|±.*|\?+|地下.*)$")
"""Additions after a number that do not change it: `12 m (39 ft)`, `12 m / 40 ft`, `12 ± 1`, `5?`."""

_STOREY_WORD = r"(?:f|fl|floors?|levels?|lvls?|stor(?:e?y|ies|eys)|etagen?|geschosse?|层|層|楼|樓|階)?"
_STOREYS = re.compile(
    rf"(?P<low>{_NUMBER})[\s-]*{_STOREY_WORD}(?:\s*(?:-|~|to)\s*(?P<high>{_NUMBER}))?\s*{_STOREY_WORD}\+?"
)
_OVER_GROUND = re.compile(r"(?:b\d*\s*\+\s*)?(?:g|gf|r|rdc|p|ground)\s*\+\s*(?P<upper>\d+)(?:\s*\+.*)?")
"""The ground floor and a number of floors above it: `G+4` (South Asia, the Gulf), `R+4` (French), `P+4` (Balkans)."""

_WITH_ROOF = re.compile(r"(?P<walls>\d+)\s*\+\s*(?:\d+|[a-z]+)")
"""Full storeys and those in the roof: `4+1` or `3+D`."""

_PEOPLE = re.compile(
    r"(?P<whole>\d{1,3}(?:[ .,']\d{3})+|\d+)(?P<part>[.,]\d{1,2})?\s*(?P<scale>万|萬|million|mio|k\b)?(?!\d)"
)
_SCALES = {None: 1.0, "k": 1e3, "万": 1e4, "萬": 1e4, "million": 1e6, "mio": 1e6}
_SIGNS = str.maketrans({"′": "'", "’": "'", "‘": "'", "´": "'", "`": "'", "″": '"', "”": '"', "“": '"', "–": "-",
                        "—": "-", "−": "-", "〜": "~", "½": ".5", "至": "-", "到": "-"})  # fmt: skip
_LONGEST = 80
"""Most characters of a value with a number (chosen); a longer one is prose."""

_HEX = re.compile(r"^#?(?P<digits>[0-9a-fA-F]{6}|[0-9a-fA-F]{3})$")


def metres(tags: Mapping[str, str], *keys: str) -> float | None:
    """The length in metres of the first key that has one: the first value of a list, the middle of a range."""
    for key in keys:
        length = _length(_plain(tags.get(key, "").split(";")[0]))
        if length is not None:
            return length
    return None


def storeys(tags: Mapping[str, str], *keys: str) -> float | None:
    """The storeys of the first key that has them, 0..200; the middle of a range.

    Lists that name each floor from the ground on (`0;1;2`, `0-4`) count the floors they name; other lists give their
    first.
    """
    for key in keys:
        count = _storeys(tags.get(key, ""))
        if count is not None and 0.0 <= count <= 200.0:
            return count
    return None


def people(tags: Mapping[str, str]) -> float | None:
    """The inhabitants in `population`: `12500`, `12 500`, `~12,500`, `12.5万`."""
    match = _PEOPLE.match(_plain(tags.get("population", "").split(";")[0]))
    if match is None or (match["part"] and not match["scale"]):
        return None
    whole = re.sub(r"\D", "", match["whole"]) + (match["part"] or "").replace(",", ".")
    count = _finite(float(whole) * _SCALES[match["scale"]])
    return count if count is not None and 1.0 <= count <= 1e8 else None


def number(tags: Mapping[str, str], key: str) -> float | None:
    """A plain number; the first of a list."""
    try:
        return _finite(float(tags.get(key, "").split(";")[0].strip().replace(",", ".")))
    except ValueError:
        return None


def layer(tags: Mapping[str, str]) -> int:
    """The layer above (positive) or below the ground; a bridge without one is on 1, a tunnel on -1."""
    stated = number(tags, "layer")
    if stated is not None and abs(stated) <= 10:
        return int(stated)
    return 1 if is_set(tags, "bridge") else -1 if is_set(tags, "tunnel") else 0


def is_set(tags: Mapping[str, str], key: str) -> bool:
    """True if a key is present and its value is not negative."""
    return tags.get(key, "no") not in ("no", "false", "0", "")


def is_below(tags: Mapping[str, str]) -> bool:
    """True if something lies under the ground or inside a building, and is invisible from outside."""
    return (
        tags.get("location") in ("underground", "indoor")
        or tags.get("indoor", "no") != "no"
        or tags.get("parking") == "underground"
        or (tags.get("tunnel", "no") not in ("no", "building_passage", "passage"))
        or (layer(tags) < 0 and "water" not in tags and tags.get("natural") != "water" and "waterway" not in tags)
    )


def colour(tags: Mapping[str, str], *keys: str) -> LinearRgb | None:
    """The colour of the first key that has one (`#rrggbb`, `#rgb` or a CSS name), as linear RGB."""
    for key in keys:
        text = tags.get(key, "").split(";")[0].strip().lower().replace(" ", "").replace("_", "")
        if text:
            digits = _HEX.match(text)
            rgb = _named(f"#{digits['digits']}" if digits else text)
            if rgb is not None:
                return rgb
    return None


def linear(red: int, green: int, blue: int) -> LinearRgb:
    """Convert sRGB bytes to linear RGB (IEC 61966-2-1)."""
    first, second, third = (_linear(value / 255.0) for value in (red, green, blue))
    return first, second, third


# -- private


def _plain(text: str) -> str:
    """A value without irrelevant differences: width of characters, typographic signs, case, words around numbers."""
    if len(text) > _LONGEST:
        return ""
    plain = unicodedata.normalize("NFKC", text.translate(_SIGNS)).strip().lower()
    return _ASIDE.sub("", _QUALIFIER.sub("", plain))


def _length(text: str) -> float | None:
    text = _THOUSANDS.sub(r"\1\2", text)
    inches = _FEET.fullmatch(text)
    if inches and (inches["feet"] or text[-1] not in "0123456789"):
        return _finite(0.3048 * float(inches["feet"] or 0.0) + 0.0254 * float(inches["inches"]))
    match = _LENGTH.fullmatch(text)
    if match is None:
        return None
    low, high = _value(match["low"]), _value(match["high"] or match["low"])
    return _finite((low + high) / 2.0 * _METRES[match["unit"] or match["first"] or ""])


def _storeys(text: str) -> float | None:
    plain = _plain(text)
    above = _OVER_GROUND.fullmatch(plain)
    if above:
        return 1.0 + float(above["upper"])
    with_roof = _WITH_ROOF.fullmatch(plain)
    if with_roof:
        return float(with_roof["walls"])
    parts = [_STOREYS.fullmatch(_plain(part)) for part in plain.split(";")]
    counts = [(_value(part["low"]), _value(part["high"] or part["low"])) for part in parts if part]
    if not counts:
        return None
    (low, high), last = counts[0], counts[-1][1]
    if low <= 0.0 < last:  # numbers of floors, with the ground floor as 0
        return last + 1.0
    if [count for count, _ in counts] == [1.0 + k for k in range(len(counts))] and len(counts) > 2:
        return last
    return (low + high) / 2.0


def _value(text: str) -> float:
    return float(text.replace(",", "."))


def _finite(value: float) -> float | None:
    """The value if it is finite. Python also parses `inf`, `nan` and numbers of four hundred digits."""
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
