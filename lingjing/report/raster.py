"""Drawings as PNG, drawn with Pillow at twice the final size and then made smaller. Letters that DejaVu Sans lacks
are written in a font of this machine, and show as boxes where none has them."""

from __future__ import annotations

import io
from itertools import pairwise

from PIL import Image, ImageColor, ImageDraw

from lingjing.analysis.fonts import font, lacking, letters_without_a_font
from lingjing.report.drawing import (
    LIGHT,
    Drawing,
    DrawnMark,
    FlatPoint,
    PaneMark,
    PictureMark,
    SpotMark,
    StrokeMark,
    WordsMark,
)
from lingjing.terminal import visible

SCALE = 2
"""Pixels of the file for each unit."""

_FINE = 2
_ANCHORS = {"start": "ls", "middle": "ms", "end": "rs"}
_DASH, _GAP = 5.0, 3.0


def png_file(drawing: Drawing) -> bytes:
    """The drawing as a PNG of `SCALE` times its size, on white."""
    scale = SCALE * _FINE
    size = round(drawing.width * scale), round(drawing.height * scale)
    image = Image.new("RGB", size, LIGHT["paper"])
    for mark in drawing.marks:
        _draw(image, mark, scale)
    whole = image.resize((size[0] // _FINE, size[1] // _FINE), Image.Resampling.LANCZOS)
    out = io.BytesIO()
    whole.save(out, "PNG", optimize=True)
    return out.getvalue()


def boxed_letters(drawing: Drawing) -> str:
    """The letters of a drawing that no font here has."""
    texts = [visible(mark.text) for mark in drawing.marks if isinstance(mark, WordsMark)]
    return letters_without_a_font("".join(texts))


def _draw(image: Image.Image, mark: DrawnMark, scale: int) -> None:
    pen = ImageDraw.Draw(image, "RGBA")
    match mark:
        case PaneMark():
            if mark.width > 0 and mark.height > 0:
                low = (mark.x * scale, mark.y * scale)
                high = ((mark.x + mark.width) * scale - 1, (mark.y + mark.height) * scale - 1)
                pen.rectangle((low, (max(low[0], high[0]), max(low[1], high[1]))), fill=_ink(mark.tone, mark.opacity))
        case StrokeMark():
            _stroke(pen, mark, scale)
        case SpotMark(shape="circle"):
            left, top, right, bottom = (mark.x - mark.radius, mark.y - mark.radius, mark.x + mark.radius,
                                        mark.y + mark.radius)  # fmt: skip
            pen.ellipse((left * scale, top * scale, right * scale, bottom * scale), fill=_ink(mark.tone))
        case SpotMark():
            pen.polygon([(x * scale, y * scale) for x, y in mark.corners()], fill=_ink(mark.tone))
        case WordsMark():
            text = visible(mark.text)
            face = font(round(mark.size * scale), lacking(text), bold=mark.bold)
            place = mark.x * scale, mark.y * scale
            pen.text(place, text, font=face, fill=_ink(mark.tone), anchor=_ANCHORS[mark.anchor])
        case PictureMark():
            with Image.open(io.BytesIO(mark.data)) as stored:
                size = round(mark.width * scale), round(mark.height * scale)
                picture = stored.convert("RGB").resize(size, Image.Resampling.LANCZOS)
            image.paste(picture, (round(mark.x * scale), round(mark.y * scale)))


def _stroke(pen: ImageDraw.ImageDraw, mark: StrokeMark, scale: int) -> None:
    points = [(x * scale, y * scale) for x, y in mark.points]
    ink = _ink(mark.tone, mark.opacity)
    if mark.filled:
        pen.polygon(points, fill=ink)
        return
    width = max(1, round(mark.width * scale))
    if not mark.dashed:
        pen.line(points, fill=ink, width=width, joint="curve")
        return
    for first, second in pairwise(points):
        _dashes(pen, first, second, (_DASH * scale, _GAP * scale), width, ink)


def _dashes(
    pen: ImageDraw.ImageDraw,
    first: FlatPoint,
    second: FlatPoint,
    lengths: tuple[float, float],
    width: int,
    ink: tuple[int, int, int, int],
) -> None:
    dx, dy = second[0] - first[0], second[1] - first[1]
    whole = (dx * dx + dy * dy) ** 0.5
    at = 0.0
    while at < whole:
        ends = at / whole, min(1.0, (at + lengths[0]) / whole)
        pen.line([(first[0] + dx * end, first[1] + dy * end) for end in ends], fill=ink, width=width)
        at += sum(lengths)


def _ink(tone: str, opacity: float = 1.0) -> tuple[int, int, int, int]:
    red, green, blue = ImageColor.getrgb(LIGHT[tone])[:3]
    return red, green, blue, round(255 * opacity)


__all__ = ["SCALE", "boxed_letters", "png_file"]
