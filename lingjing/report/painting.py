"""Drawings painted with matplotlib, and rendered as an SVG element of a page, an SVG file or a PNG file.

matplotlib writes the SVG; `_Svg` then makes it fit for a page: it adds the title, the description and the tooltips,
removes what a browser does not need, and lets the page choose the colours. The same drawing gives the same bytes.
"""

from __future__ import annotations

import base64
import io
import re
import warnings
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Literal, NamedTuple

import numpy as np
from matplotlib import style
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.text import Text
from PIL import Image

from lingjing.analysis.fonts import families, letters_without_a_font
from lingjing.report.drawing import LIGHT, Drawing
from lingjing.report.text_layout import SMALL, USUAL
from lingjing.terminal import visible

FONT = "'DejaVu Sans', Verdana, system-ui, sans-serif"
"""Fonts of an SVG file: the one that widths are computed for, then those of systems that lack it."""

SCALE = 2
"""Pixels of a PNG file for each unit, for slides and screens of high resolution."""

_POINTS_PER_INCH = 72
_SVG = "{http://www.w3.org/2000/svg}"
_LINK = "{http://www.w3.org/1999/xlink}href"
_REFERENCE = re.compile(r"#([\w-]+)\)?$")
_COLOUR = re.compile(r"#[0-9a-f]{6}")
_TONES = {colour: f"var(--{tone})" for tone, colour in LIGHT.items()}

_STYLE: dict[str, object] = {
    "axes.axisbelow": True, "axes.facecolor": "none", "axes.labelcolor": LIGHT["faint"], "axes.labelsize": SMALL,
    "axes.prop_cycle": f"cycler('color', ['{LIGHT['ink']}'])", "axes.spines.bottom": False, "axes.spines.left": False,
    "axes.spines.right": False, "axes.spines.top": False, "errorbar.capsize": 3.0, "font.family": ["DejaVu Sans"],
    "grid.color": LIGHT["rule"], "grid.linewidth": 1.0, "lines.markeredgewidth": 0.0, "svg.fonttype": "none",
    "svg.hashsalt": "lingjing", "text.color": LIGHT["ink"], "text.parse_math": False, "xtick.color": LIGHT["faint"],
    "xtick.labelsize": SMALL, "xtick.major.size": 0.0, "ytick.color": LIGHT["faint"], "ytick.labelsize": SMALL,
    "ytick.major.size": 0.0,
}  # fmt: skip
"""Settings of matplotlib over its defaults. Text stays text in an SVG, a `$` begins no formula, and the ids of an SVG
are the same in each run."""


class _PlacedPicture(NamedTuple):
    """A picture on a painting, stretched over a box."""

    left: float
    """Left edge in units."""

    top: float
    """Upper edge in units from the top of the painting."""

    width: float
    """Width in units."""

    height: float
    """Height in units."""

    data: bytes
    """A PNG or JPEG file."""


class Canvas:
    """A part of a painting with an origin of its own, in which one drawing is painted; y points downwards."""

    def __init__(self, painting: Painting, left: float = 0.0, top: float = 0.0) -> None:
        self._painting = painting
        self._left, self._top = left, top

    def part(self, left: float, top: float) -> Canvas:
        """Return the canvas with its origin at that place of this one."""
        return Canvas(self._painting, self._left + left, self._top + top)

    def axes(self, left: float, top: float, width: float, height: float) -> Axes:
        """Add axes without frame and ticks over a box. Their coordinates are units from the box's upper left corner."""
        painting = self._painting
        bottom = painting.height - self._top - top - height
        box = ((self._left + left) / painting.width, bottom / painting.height,
               width / painting.width, height / painting.height)  # fmt: skip
        axes = painting.figure.add_axes(box, xlim=(0.0, width), ylim=(height, 0.0), xticks=[], yticks=[])
        axes.patch.set_visible(False)
        return axes

    def text(
        self,
        x: float,
        y: float,
        text: str,
        *,
        size: float = USUAL,
        tone: str = "ink",
        anchor: Literal["left", "center", "right"] = "left",
        bold: bool = False,
    ) -> None:
        """Write a line of text with its base line at y; `anchor` is the part of it that stands at x."""
        painting = self._painting
        place = (self._left + x) / painting.width, 1.0 - (self._top + y) / painting.height
        weight = "bold" if bold else "normal"
        painting.figure.text(*place, visible(text), fontsize=size, color=LIGHT[tone], ha=anchor, va="baseline",
                             fontweight=weight)  # fmt: skip

    def picture(self, left: float, top: float, width: float, height: float, data: bytes) -> None:
        """Place a PNG or JPEG file over a box."""
        self._painting.pictures.append(_PlacedPicture(self._left + left, self._top + top, width, height, data))

    def tooltip(self, artist: Artist, text: str) -> None:
        """Show the text while a pointer is over the artist, in an SVG."""
        name = f"tooltip-{len(self._painting.tooltips)}"
        artist.set_gid(name)
        self._painting.tooltips[name] = visible(text)


class Painting:
    """A matplotlib figure with one drawing on it."""

    def __init__(self, drawing: Drawing) -> None:
        self.width, self.height = drawing.width, drawing.height
        self.figure = Figure(figsize=(self.width / _POINTS_PER_INCH, self.height / _POINTS_PER_INCH))
        self.figure.patch.set_visible(False)
        self.tooltips: dict[str, str] = {}
        """Tooltips by the group ids of their artists."""
        self.pictures: list[_PlacedPicture] = []
        """Pictures, which are no artists: an SVG file holds their bytes as they are."""
        drawing.paint(Canvas(self))

    def lines(self) -> list[str]:
        """Return all lines of text on it."""
        self.figure.draw_without_rendering()  # since labels of ticks are made when an axis is drawn
        return [line for text in self.texts() if (line := text.get_text())]

    def texts(self) -> list[Text]:
        """Return the artists of all visible text on it."""
        return [text for text in self.figure.findobj(Text) if text.get_visible()]


@contextmanager
def painted(drawing: Drawing) -> Iterator[Painting]:
    """Paint a drawing; while the context lasts, matplotlib has the settings to render it."""
    with style.context(["default", _STYLE]), warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Glyph .* missing from font")  # `boxed_letters` reports them once
        yield Painting(drawing)


# -- PNG


def png_file(drawing: Drawing) -> bytes:
    """Return the drawing as a PNG file of `SCALE` times its size, on white."""
    with painted(drawing) as painting:
        figure = painting.figure
        for picture in painting.pictures:
            _show(Canvas(painting), picture)
        fonts = families("".join(painting.lines()))
        for text in painting.texts():
            text.set_fontfamily(fonts)
        figure.patch.set(visible=True, facecolor=LIGHT["paper"])
        out = io.BytesIO()
        figure.savefig(out, format="png", dpi=SCALE * _POINTS_PER_INCH, metadata={"Software": "lingjing"})
    return out.getvalue()


def boxed_letters(drawing: Drawing) -> str:
    """Return the letters of a drawing that no font of this machine has: a PNG file shows them as boxes."""
    with painted(drawing) as painting:
        return letters_without_a_font("".join(painting.lines()))


def _show(canvas: Canvas, picture: _PlacedPicture) -> None:
    size = round(picture.width * SCALE), round(picture.height * SCALE)
    with Image.open(io.BytesIO(picture.data)) as stored:
        pixels = np.asarray(stored.convert("RGB").resize(size, Image.Resampling.LANCZOS))
    axes = canvas.axes(*picture[:4])
    axes.imshow(pixels, extent=(0.0, picture.width, picture.height, 0.0), aspect="auto", interpolation="nearest")


# -- SVG


def inline_svg(drawing: Drawing, name: str) -> str:
    """Return the drawing as an element of a page. `name` is unique on the page and begins each of its ids."""
    svg = _Svg(drawing, name)
    root = svg.root
    size = f"max-width:{round(1.2 * drawing.width)}px"
    root.set("style", f"{size};min-width:{round(0.92 * drawing.width)}px" if drawing.wide else size)
    root.set("aria-labelledby", f"{name}-t {name}-d")
    for part, suffix in zip(root, ("t", "d"), strict=False):
        part.set("id", f"{name}-{suffix}")
    for element in root.iter():
        if element is not root and "style" in element.attrib:
            element.set("style", _COLOUR.sub(lambda colour: _TONES.get(colour[0], colour[0]), element.attrib["style"]))
    return ET.tostring(root, encoding="unicode")


def svg_file(drawing: Drawing) -> str:
    """Return the drawing as an SVG file, on white."""
    root = _Svg(drawing, "part").root
    root.set("xmlns", _SVG.strip("{}"))
    root.set("font-family", FONT)
    size = {name: _number(value) for name, value in (("width", drawing.width), ("height", drawing.height))}
    root.attrib.update(size)
    root.set("xmlns:xlink", _LINK.removeprefix("{").removesuffix("}href"))
    for element in root.iter():
        if "href" in element.attrib:  # viewers of SVG 1.1 know no other form; on a page it would need the namespace
            element.set("xlink:href", element.attrib.pop("href"))
    root.insert(2, ET.Element("rect", {**size, "fill": LIGHT["paper"]}))
    return f"<?xml version='1.0' encoding='UTF-8'?>\n{ET.tostring(root, encoding='unicode')}\n"


class _Svg:
    """The SVG tree of a drawing: `<title>`, `<desc>`, matplotlib's groups without their clutter, and the pictures."""

    def __init__(self, drawing: Drawing, name: str) -> None:
        out = io.StringIO()
        nothing = dict.fromkeys(("Creator", "Date", "Format", "Type"))
        with painted(drawing) as painting:
            painting.figure.savefig(out, format="svg", metadata=nothing)
        made = ET.fromstring(out.getvalue())  # noqa: S314 - matplotlib wrote it just now
        self.root = ET.Element("svg", {"viewBox": f"0 0 {_number(drawing.width)} {_number(drawing.height)}",
                                       "role": "img", "stroke-linejoin": "round"})  # fmt: skip
        for kind, text in (("title", drawing.title), ("desc", drawing.description)):
            ET.SubElement(self.root, kind).text = visible(text)
        self.root.extend(part for part in made if part.find(f"{_SVG}style") is None)
        self._clean(name, painting.tooltips)
        self.root.extend(map(_image, painting.pictures))

    def _clean(self, name: str, tooltips: dict[str, str]) -> None:
        """Name the elements as HTML does, keep the ids that are referred to, and add the tooltips."""
        for element in list(self.root.iter()):
            element.tag = element.tag.removeprefix(_SVG)
            element.tail = None
            if element.tag not in ("title", "desc", "text"):
                element.text = None
            if _LINK in element.attrib:
                element.set("href", element.attrib.pop(_LINK))
            own = element.attrib.pop("id", "")
            if own in tooltips:
                tooltip = ET.Element("title")
                tooltip.text = tooltips[own]
                element.insert(0, tooltip)
            elif own and element.tag in ("path", "clipPath"):
                element.set("id", f"{name}-{own}")
            for attribute in ("href", "clip-path"):
                if attribute in element.attrib:
                    element.set(attribute, element.attrib[attribute].replace("#", f"#{name}-"))
            if element.tag == "text":
                _without_clutter(element)


def _without_clutter(text: ET.Element) -> None:
    """Remove the font families, which the page or the file sets for all texts, and rotations by zero degrees."""
    declarations = text.attrib.get("style", "").split("; ")
    text.set("style", "; ".join(each for each in declarations if not each.startswith("font-family")))
    if text.attrib.get("transform", "").startswith("rotate(-0 "):
        del text.attrib["transform"]


def _image(picture: _PlacedPicture) -> ET.Element:
    kind = "png" if picture.data.startswith(b"\x89PNG") else "jpeg"
    data = base64.b64encode(picture.data).decode()
    box = dict(zip(("x", "y", "width", "height"), map(_number, picture[:4]), strict=True))
    return ET.Element("image", {**box, "preserveAspectRatio": "none", "href": f"data:image/{kind};base64,{data}"})


def _number(value: float) -> str:
    """Return a length to a hundredth, without zeros at its end."""
    text = f"{value:.2f}".rstrip("0").rstrip(".")
    return "0" if text in ("-0", "") else text


__all__ = ["FONT", "SCALE", "Canvas", "Painting", "boxed_letters", "inline_svg", "painted", "png_file", "svg_file"]
