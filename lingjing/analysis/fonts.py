"""Fonts for pictures of text: the one that ships with matplotlib, and for letters that it lacks one of this machine's.

Which of the machine's fonts has the letters is asked of fontconfig (`fc-list`), where that is installed. Letters that
no font has are drawn as boxes; `letters_without_a_font` and `note_of_boxes` tell them.
"""

from __future__ import annotations

import subprocess
from functools import lru_cache
from pathlib import Path

from PIL import ImageFont

_OWN = "DejaVu Sans"

ASKED = 40
"""Letters that a font is asked for at a time; of a longer text the first ones."""


@lru_cache(maxsize=256)
def font(size: int, letters: str = "", *, bold: bool = False) -> ImageFont.FreeTypeFont:
    """The sans-serif font that ships with matplotlib; if it lacks some of these `letters` (`lacking` says which), one
    that has them, if there is one."""
    found = _font_with(letters) if letters else None
    path, index = found or (_own_font(bold=bold), 0)
    return ImageFont.truetype(path, size, index=index)


def lacking(text: str) -> str:
    """The letters of a text that the own font lacks, each once, in order."""
    known = _known()
    missing = dict.fromkeys(letter for letter in text if ord(letter) not in known and letter.isprintable())
    return "".join(sorted(missing))[:ASKED]


def letters_without_a_font(text: str) -> str:
    """The letters of a text that are drawn as boxes: all texts are written in two fonts at most."""
    letters = lacking(text)
    found = _font_with(letters) if letters else None
    if found is None or found in _fonts(letters):
        return "" if found else letters
    return "".join(letter for letter in letters if found not in _fonts(letter))


def note_of_boxes(text: str) -> tuple[str, ...]:
    """What is said once of a text of which letters are drawn as boxes."""
    letters = letters_without_a_font(text)
    if not letters:
        return ()
    return (f"no font here has {letters[:8]!r}: they are drawn as boxes (fonts-noto-cjk has Chinese, for example)",)


def families(text: str) -> list[str]:
    """The fonts of a text by the names under which matplotlib finds them, however old its list of fonts is."""
    from matplotlib.font_manager import fontManager

    letters = lacking(text)
    found = _font_with(letters) if letters else None
    if found is None:
        return [_OWN]
    name = str(ImageFont.truetype(found[0], index=found[1]).getname()[0])
    if name not in fontManager.get_font_names():
        fontManager.addfont(found[0])
    return [_OWN, name]


@lru_cache(maxsize=2)
def _own_font(*, bold: bool = False) -> str:
    import matplotlib as mpl

    return str(Path(mpl.get_data_path()) / "fonts/ttf" / ("DejaVuSans-Bold.ttf" if bold else "DejaVuSans.ttf"))


@lru_cache(maxsize=1)
def _known() -> frozenset[int]:
    from matplotlib.ft2font import FT2Font

    return frozenset(FT2Font(_own_font()).get_charmap())


@lru_cache(maxsize=64)
def _font_with(letters: str) -> tuple[str, int] | None:
    """File and face of a font that has all the letters, or else most of them."""
    whole = _fonts(letters)
    if whole or len(letters) < 2:
        return whole[0] if whole else None
    having = [_fonts(letter) for letter in letters]
    every = [one for some in having for one in some]
    return max(every, key=every.count, default=None)


@lru_cache(maxsize=256)
def _fonts(letters: str) -> tuple[tuple[str, int], ...]:
    """File and face of each font that has all the letters, regular sans-serif ones first."""
    wanted = " ".join(f"{ord(letter):x}" for letter in letters)
    command = ["fc-list", "-f", "%{file}\t%{index}\t%{style}\t%{family}\n", f":charset={wanted}:scalable=true"]
    try:
        told = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False).stdout
    except (OSError, subprocess.TimeoutExpired, UnicodeDecodeError):
        return ()
    fonts = [line.split("\t") for line in told.splitlines()]
    usable = [one for one in fonts if len(one) == 4 and one[1].isdigit() and int(one[1]) < 1 << 16]
    usable.sort(key=lambda one: ("Sans" not in one[3], "Mono" in one[3], "Regular" not in one[2], one[0], int(one[1])))
    return tuple((one[0], int(one[1])) for one in usable)
