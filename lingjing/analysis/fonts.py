"""Fonts for drawn text: the font that ships with matplotlib, and a font of this machine for letters that it lacks.

fontconfig (`fc-list`) finds the machine's font, where it is installed. Letters that no font has are drawn as boxes.
`letters_without_a_font` and `note_of_boxes` report them.
"""

from __future__ import annotations

import subprocess
from functools import lru_cache
from pathlib import Path

from PIL import ImageFont

_OWN = "DejaVu Sans"

MOST_LETTERS = 40
"""Most letters in one query of fontconfig. Chosen: the first ones of a text suffice to find a font of its script."""


@lru_cache(maxsize=256)
def font(size: int, letters: str = "", *, bold: bool = False) -> ImageFont.FreeTypeFont:
    """Return a font of `size` pixels that has `letters`, which the font of matplotlib lacks (see `missing_letters`).

    Without letters, or if no font has them, it is the sans-serif font of matplotlib.
    """
    face = _font_with(letters) if letters else None
    path, index = face or (_own_font(bold=bold), 0)
    return ImageFont.truetype(path, size, index=index)


def missing_letters(text: str) -> str:
    """Return the letters of a text that the font of matplotlib lacks, each once, sorted, at most `MOST_LETTERS`."""
    known = _known()
    missing = dict.fromkeys(letter for letter in text if ord(letter) not in known and letter.isprintable())
    return "".join(sorted(missing))[:MOST_LETTERS]


def letters_without_a_font(text: str) -> str:
    """Return the letters of a text that are drawn as boxes. A text is drawn in at most two fonts."""
    letters = missing_letters(text)
    face = _font_with(letters) if letters else None
    if face is None or face in _fonts(letters):
        return "" if face else letters
    return "".join(letter for letter in letters if face not in _fonts(letter))


def note_of_boxes(text: str) -> tuple[str, ...]:
    """Return a note for the user if letters of a text are drawn as boxes, else an empty tuple."""
    letters = letters_without_a_font(text)
    if not letters:
        return ()
    return (f"no font here has {letters[:8]!r}: they are drawn as boxes (fonts-noto-cjk has Chinese, for example)",)


def families(text: str) -> list[str]:
    """Return the names of the fonts of a text for matplotlib.

    A font that is missing in matplotlib's cached list of fonts is added to it.
    """
    from matplotlib.font_manager import fontManager

    letters = missing_letters(text)
    face = _font_with(letters) if letters else None
    if face is None:
        return [_OWN]
    name = str(ImageFont.truetype(face[0], index=face[1]).getname()[0])
    if name not in fontManager.get_font_names():
        fontManager.addfont(face[0])
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
    """Return file and face index of a font that has all the letters, or else of the one that has most of them."""
    complete = _fonts(letters)
    if complete or len(letters) < 2:
        return complete[0] if complete else None
    faces = [face for letter in letters for face in _fonts(letter)]
    return max(faces, key=faces.count, default=None)


@lru_cache(maxsize=256)
def _fonts(letters: str) -> tuple[tuple[str, int], ...]:
    """Return file and face index of each font that has all the letters, regular sans-serif fonts first."""
    codes = " ".join(f"{ord(letter):x}" for letter in letters)
    command = ["fc-list", "-f", "%{file}\t%{index}\t%{style}\t%{family}\n", f":charset={codes}:scalable=true"]
    try:
        output = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False).stdout
    except (OSError, subprocess.TimeoutExpired, UnicodeDecodeError):
        return ()
    rows = [line.split("\t") for line in output.splitlines()]
    # an index of 2^16 or more denotes an instance of a variable font, which Pillow cannot open by index
    usable = [row for row in rows if len(row) == 4 and row[1].isdigit() and int(row[1]) < 1 << 16]
    usable.sort(key=lambda row: ("Sans" not in row[3], "Mono" in row[3], "Regular" not in row[2], row[0], int(row[1])))
    return tuple((row[0], int(row[1])) for row in usable)
