"""The permitted speed of a street for cars, from the many notations of it.

`maxspeed` holds numbers in km/h and other units, lists, words, and names of zones (`DE:urban`, `AT:zone:30`). The
lowest value of a list counts, because it is permitted on the whole street. Values that apply only at times (`80 @
(wet)`) are not read. Words without a speed (`sign`, `signals`, `variable`) leave the street the speed of its kind.

Source: the wiki of OpenStreetMap, pages `Key:maxspeed`, `Key:source:maxspeed` and `Default speed limits`.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

WALK_KMH = 7.0
"""Speed of `walk`, km/h: German courts take 4 to 7 km/h for a walking pace."""

NONE_KMH = 130.0
"""Speed of `none`, km/h: the recommended speed in Germany where no limit applies."""

FASTEST_KMH = 400.0
"""Greatest plausible limit, km/h (chosen): no public road permits more."""

_MPH = 1.609344
"""Kilometres of a mile."""
_KEYS = ("maxspeed:motorcar", "maxspeed:motor_vehicle", "maxspeed")
"""Keys of a speed, by priority."""
_IMPLIED = ("maxspeed:type", "source:maxspeed", "zone:maxspeed", "zone:traffic")
"""Keys that name a kind of limit, by priority."""
_UNITS = {"": 1.0, "kmh": 1.0, "kph": 1.0, "kmph": 1.0, "mph": _MPH, "knots": 1.852, "kn": 1.852}
_WORDS = {"walk": WALK_KMH, "walking_pace": WALK_KMH, "none": NONE_KMH, "unlimited": NONE_KMH, "no": NONE_KMH}

_AT_TIMES = re.compile(r"[^;|]*@\s*(?:\([^)]*\)?|[^;|]*)")
_SEPARATORS = re.compile(r"[;|/&]|,(?!\d(?!\d))|\bor\b|(?<=[\da-z])\s*[-–]\s*(?=\d)")
_NUMBER = re.compile(r"[~<≤=]*\s*(\d{1,4}(?:[.,]\d+)?)\s*([a-z]*)")
_WITHIN = re.compile(r"(?<![\w.,+:-])(\d{1,3})\s*(?:km|(kmh|kph|mph))?(?!\w|[.,]\d)")
"""A speed among other words: `50 (30)`, `ca. 50`, `50?`."""

_COUNTRY = r"(?:([a-z]{2})(?:-[a-z]{2,3})?:)?"
_ZONE_NUMBER = re.compile(_COUNTRY + r"(?:zone)?:?\s*(\d{1,3})\s*(mph)?")
_ZONE_NAME = re.compile(_COUNTRY + r"([a-z_]+)")

_ZONES = {
    "urban": 50.0, "rural": 90.0, "trunk": 100.0, "motorway": 120.0, "living_street": 20.0, "bicycle_road": 30.0,
    "cyclestreet": 30.0, "school": 30.0, "zone": 30.0, "pedestrian_zone": WALK_KMH,
    "nsl_restricted": 30 * _MPH, "nsl_single": 60 * _MPH, "nsl_dual": 70 * _MPH,
}  # fmt: skip
"""Limits by kind of zone in most countries, km/h."""

_NATIONAL = {
    "urban": {
        "ru": 60.0, "by": 60.0, "kz": 60.0, "uz": 70.0, "jp": 60.0, "gb": 30 * _MPH, "uk": 30 * _MPH, "us": 25 * _MPH,
    },
    "rural": {
        "de": 100.0, "at": 100.0, "uz": 100.0, "fr": 80.0, "ch": 80.0, "nl": 80.0, "dk": 80.0, "no": 80.0, "fi": 80.0,
        "rs": 80.0, "ie": 80.0, "se": 70.0, "cn": 70.0, "us": 55 * _MPH, "gb": 60 * _MPH, "uk": 60 * _MPH,
    },
    "trunk": {"de": NONE_KMH, "cz": 110.0, "hu": 110.0, "it": 110.0, "pl": 120.0},
    "motorway": {
        "de": NONE_KMH, "at": 130.0, "cz": 130.0, "dk": 130.0, "fr": 130.0, "hu": 130.0, "it": 130.0, "ro": 130.0,
        "rs": 130.0, "sk": 130.0, "si": 130.0, "hr": 130.0, "pl": 140.0, "bg": 140.0, "nl": 100.0, "ru": 110.0,
        "no": 110.0, "se": 110.0, "uz": 110.0, "us": 65 * _MPH, "gb": 70 * _MPH, "uk": 70 * _MPH,
    },
    "living_street": {"de": WALK_KMH, "at": WALK_KMH, "nl": 15.0, "rs": 10.0, "uz": 30.0},
}  # fmt: skip
"""Limits that differ from `_ZONES`, km/h, by the country that a value names."""


def limits(tags: Mapping[str, str]) -> tuple[float | None, float | None]:
    """The permitted speeds along and against a street, km/h; None if no tag states one."""
    both = _first(tags, _KEYS) or next(filter(None, (_implied_kmh(tags.get(key, "")) for key in _IMPLIED)), None)
    forward, backward = (
        _first(tags, [f"{key}:{direction}" for key in _KEYS]) or both for direction in ("forward", "backward")
    )
    return forward, backward


def limit_kmh(text: str) -> float | None:
    """The lowest speed that a value states, km/h; None if it states none."""
    plain = text.casefold().replace("km/h", "kmh")
    always = _AT_TIMES.sub("", plain) if "@" in plain else plain
    values = [_single(part) for part in _with_units([part.strip() for part in _SEPARATORS.split(always)])]
    if all(value is None for value in values):
        values = [_single("".join(match.groups(""))) for match in _WITHIN.finditer(always)]
    return min((value for value in values if value is not None), default=None)


# -- private


def _first(tags: Mapping[str, str], keys: Sequence[str]) -> float | None:
    speeds = (limit_kmh(tags[key]) for key in keys if key in tags)
    return next((value for value in speeds if value is not None), None)


def _with_units(parts: list[str]) -> list[str]:
    """The parts of a list. Numbers get the unit of the last part if it is the only one with a unit (`20-30 mph`)."""
    if len(parts) > 1 and parts[-1].endswith("mph") and "mph" not in "".join(parts[:-1]):
        return [f"{part} mph" if part.isdecimal() else part for part in parts]
    return parts


def _implied_kmh(text: str) -> float | None:
    """The speed of the zone that a value names; these keys also contain free texts (`survey 2020-05-30`)."""
    zones = (_of_zone(part.strip()) for part in text.casefold().split(";"))
    return min((zone for zone in zones if zone is not None), default=None)


def _single(text: str) -> float | None:
    number = _NUMBER.fullmatch(text)
    if number and number[2] in _UNITS:
        value = float(number[1].replace(",", ".")) * _UNITS[number[2]]
        return value if 0.0 < value <= FASTEST_KMH else None
    return _WORDS.get(text) or _of_zone(text)


def _of_zone(text: str) -> float | None:
    number = _ZONE_NUMBER.fullmatch(text)
    if number:
        unit = _MPH if number[3] or number[1] in ("gb", "uk", "us") else 1.0
        return int(number[2]) * unit or None
    name = _ZONE_NAME.fullmatch(text)
    if not name:
        return None
    return _NATIONAL.get(name[2], {}).get(name[1], _ZONES.get(name[2]))
