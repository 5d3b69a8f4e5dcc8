"""Confusable names: Cyrillic or Greek letters that look like Latin ones, mixed with Latin letters or instead of them.

After Unicode TR39 (mixed-script and whole-script confusables), limited to names that a reader takes for another name:
`vісtim` with a Cyrillic `і` gives a warning; `α_max`, `Δt` and `海_east` do not.
"""

from __future__ import annotations

import re
from collections.abc import Container, Mapping, Sequence
from unicodedata import name as name_of

from lingjing.dsl.source.reporter import Reporter

LATIN_DOUBLES = {
    **dict(zip("аеѕіјорсухһԁԛԝӏѵ", "aesijopcyxhdqwlv", strict=True)),
    **dict(zip("АВСЕНІЈКМОРЅТХҮԌԜ", "ABCEHIJKMOPSTXYGW", strict=True)),
    **dict(zip("ΑΒΕΖΗΙΚΜΝΟΡΤΥΧ", "ABEZHIKMNOPTYX", strict=True)),
    **dict(zip("αγινορυϲϳ", "ayivopucj", strict=True)),
}
"""Cyrillic and Greek letters → the Latin letters that they resemble (a selection of Unicode's `confusables.txt`)."""

_PARTS = re.compile(r"[\d_]+")


def look_alikes(names: Mapping[str, Sequence[tuple[int, int]]], known: Container[str], report: Reporter) -> None:
    """Warn of each name that mixes scripts, or resembles another name of the text (`known`).

    `names`: names with letters outside ASCII → the offsets of their occurrences. The first occurrence is shown.
    """
    for name, places in names.items():
        latin = "".join(LATIN_DOUBLES.get(letter, letter) for letter in name)
        if latin == name:
            continue
        odd = next(letter for letter in name if letter in LATIN_DOUBLES)
        shown = f"`{odd}` (U+{ord(odd):04X}) is {name_of(odd).split()[0].capitalize()}"
        replace = latin if latin.isascii() else None
        if any(_is_mixed(part) for part in _PARTS.split(name)):
            message = f"`{name}` mixes letters that look alike: {shown}, not Latin"
        elif latin in known:
            message = f"`{name}` looks like `{latin}` and is another name: {shown}, not Latin"
        else:
            continue
        hint = f"write `{latin}`" if replace else "write it in letters of one script"
        (start, end), *others = places
        report("LJ0013", start, end, message, hint, severity="warning", replace=replace, also=others)


def _is_mixed(part: str) -> bool:
    latin = any(letter.isascii() for letter in part)
    return latin and any(letter in LATIN_DOUBLES for letter in part)
