"""Drawings as SVG, in a page or as files of their own. Texts are escaped; nothing is loaded and nothing runs.

Each mark carries its colour on white paper and a class of its tone, by which the style of a page may show it dark.
"""

from __future__ import annotations

import base64
import html
from collections.abc import Iterator, Sequence

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

FONT = "'DejaVu Sans', Verdana, system-ui, sans-serif"


def inline_svg(drawing: Drawing, name: str) -> str:
    """The drawing as an element of a page, in which `name` is its own."""
    widths = f"max-width:{round(1.2 * drawing.width)}px"
    if drawing.wide:
        widths += f";min-width:{round(0.92 * drawing.width)}px"
    size = f"viewBox='0 0 {_number(drawing.width)} {_number(drawing.height)}'"
    head = (
        f"<svg {size} role='img' aria-labelledby='{name}-t {name}-d' style='{widths}'>"
        f"<title id='{name}-t'>{_text(drawing.title)}</title><desc id='{name}-d'>{_text(drawing.description)}</desc>"
    )
    return f"{head}{''.join(map(_mark, drawing.marks))}</svg>"


def svg_file(drawing: Drawing) -> str:
    """The drawing as a file, on white."""
    wide, high = _number(drawing.width), _number(drawing.height)
    return (
        "<?xml version='1.0' encoding='UTF-8'?>\n"
        f"<svg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 {wide} {high}' width='{wide}' height='{high}' "
        f"role='img' font-family=\"{FONT}\">\n"
        f"<title>{_text(drawing.title)}</title>\n<desc>{_text(drawing.description)}</desc>\n"
        f"<rect width='{wide}' height='{high}' fill='{LIGHT['paper']}'/>\n"
        + "\n".join(map(_mark, drawing.marks))
        + "\n</svg>\n"
    )


def _mark(mark: DrawnMark) -> str:
    match mark:
        case PaneMark():
            place = _attributes(x=mark.x, y=mark.y, width=mark.width, height=mark.height)
            return _told(f"rect {place}{_fill(mark.tone)}{_opacity(mark.opacity)}", "rect", mark.told)
        case StrokeMark():
            return _stroke(mark)
        case SpotMark(shape="circle"):
            place = _attributes(cx=mark.x, cy=mark.y, r=mark.radius)
            return _told(f"circle {place}{_fill(mark.tone)}", "circle", mark.told)
        case SpotMark():
            return _told(f"polygon points='{_points(mark.corners())}'{_fill(mark.tone)}", "polygon", mark.told)
        case WordsMark():
            place = _attributes(x=mark.x, y=mark.y)
            anchor = "" if mark.anchor == "start" else f" text-anchor='{mark.anchor}'"
            weight = " font-weight='700'" if mark.bold else ""
            size = f" font-size='{_number(mark.size)}'"
            return f"<text {place}{size}{anchor}{weight}{_fill(mark.tone)}>{_text(mark.text)}</text>"
        case PictureMark():
            place = _attributes(x=mark.x, y=mark.y, width=mark.width, height=mark.height)
            data = base64.b64encode(mark.data).decode()
            return f"<image {place} preserveAspectRatio='none' href='data:{mark.media_type};base64,{data}'/>"


def _stroke(mark: StrokeMark) -> str:
    if mark.filled:
        return f"<polygon points='{_points(mark.points)}'{_fill(mark.tone)}{_opacity(mark.opacity)}/>"
    dashes = " stroke-dasharray='5 3'" if mark.dashed else ""
    line = f"stroke='{LIGHT[mark.tone]}' class='l-{mark.tone}' stroke-width='{_number(mark.width)}'{dashes}"
    return (
        f"<polyline points='{_points(mark.points)}' fill='none' {line} stroke-linejoin='round'"
        f"{_opacity(mark.opacity)}/>"
    )


def _told(opened: str, name: str, told: str) -> str:
    return f"<{opened}><title>{_text(told)}</title></{name}>" if told else f"<{opened}/>"


def _fill(tone: str) -> str:
    return f" fill='{LIGHT[tone]}' class='f-{tone}'"


def _opacity(opacity: float) -> str:
    return "" if opacity == 1.0 else f" opacity='{_number(opacity)}'"


def _attributes(**numbers: float) -> str:
    return " ".join(f"{name}='{_number(value)}'" for name, value in numbers.items())


def _points(points: Sequence[FlatPoint]) -> str:
    return " ".join(_pairs(points))


def _pairs(points: Sequence[FlatPoint]) -> Iterator[str]:
    for x, y in points:
        yield f"{_number(x)},{_number(y)}"


def _number(value: float) -> str:
    """To a hundredth, as short as it can be: the same on every machine."""
    text = f"{value:.2f}".rstrip("0").rstrip(".")
    return "0" if text in ("-0", "") else text


def _text(text: str) -> str:
    return html.escape(visible(text))


__all__ = ["FONT", "inline_svg", "svg_file"]
