"""Colours, sizes and the placement of labels, for all panels. Colours are chosen."""

from __future__ import annotations

import colorsys
from collections.abc import Iterable, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, field

from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg, RendererAgg
from matplotlib.text import Annotation, Text

from lingjing.analysis.fonts import families
from lingjing.scene.plan import Palette

INK = "#1c2733"
FAINT = "#7b8794"
RULE = "#d5dce3"
PAPER = "#ffffff"
PANEL = "#f6f8fa"
CITY = Palette(
    ground="#f4f2ed",
    layers={
        "water": "#d6e8f2", "land": "#f4f2ed", "slab": "#eae6df", "path": "#efece6", "road": "#ffffff",
        "solid": "#c9c2b8", "bridge": "#ffffff", "building": "#d3ccc1", "pipe": "#9c8f7d",
    },
    surfaces={
        "sand": "#f0e8d0", **dict.fromkeys(("park", "grass", "forest", "pitch"), "#e1ecd3"),
        **dict.fromkeys(("plaza", "sidewalk", "parking", "asphalt", "concrete"), "#e6e3de"),
    },
    edges={"building": "#c5bdb1", "bridge": "#b5aa99"},
)  # fmt: skip
"""The city under the map, faint enough for tracks and labels to stand out."""

REGION = "#2f7f9e"
VISITED = "#bfe0d2"
FATES = {"completed": "#1a8f4b", "found": "#e08a00", "missed": "#d1344b", "aside": "#52606d"}
CATEGORIES = {"report": "#8a3ffc", "assignment": "#0f62fe", "target_status": "#009d9a", "other": "#6f7b87"}
TRUTH = "#18c56b"
CLAIM = "#ff2fa0"
INCIDENT = "#111111"
CROWD = 8
"""Number of targets above which labels show only their index and legends leave them out. Chosen."""
_ASSETS = ("#1f6fd1", "#c2410c", "#6d28d9", "#0f766e", "#a16207", "#be185d", "#4d7c0f", "#334155")
_LANE_PT = 8.0
"""Height of the name of a lane, points."""
_SHADES = (1.0, 0.75, 0.5)
"""Shares of the colours of `_ASSETS` for the first 24 assets. Then the colours repeat, because a track in a lighter
shade would be invisible."""


def literal_text(text: str) -> AbstractContextManager[None]:
    """Return a context with settings of matplotlib for plain text.

    A dollar sign then begins no formula, and letters of `text` that the usual font lacks are drawn in another font.
    """
    return rc_context({"text.parse_math": False, "font.family": families(text)})


def asset_colours(names: Iterable[str]) -> dict[str, str]:
    """Return one colour for each asset, in declaration order."""
    colours = {}
    for place, name in enumerate(names):
        lap, index = divmod(place, len(_ASSETS))
        colours[name] = lighten(_ASSETS[index], _SHADES[lap % len(_SHADES)])
    return colours


def lighten(colour: str, share: float) -> str:
    """Return `colour` mixed with white. `share` is the share of the colour, 0 to 1."""
    share = min(1.0, max(0.0, share))
    channels = [int(colour[at : at + 2], 16) for at in (1, 3, 5)]
    return "#" + "".join(f"{round(255 + (channel - 255) * share):02x}" for channel in channels)


def target_colour(place: int) -> str:
    """Return a colour for the target number `place` in the timeline, with hues in golden-ratio steps."""
    red, green, blue = colorsys.hls_to_rgb((0.02 + place * 0.381966) % 1.0, 0.42, 0.62)
    return f"#{round(red * 255):02x}{round(green * 255):02x}{round(blue * 255):02x}"


_SPOTS = tuple(
    (dx * reach, dy * reach)
    for reach in (9, 16, 26, 38, 52, 70)
    for dx, dy in ((1, 0.6), (-1, 0.6), (1, -0.8), (-1, -0.8), (0, 1.2), (0, -1.4), (1.4, 0), (-1.4, 0))
)
"""Offsets of a label from its point, in points, in the order of preference. Chosen."""


@dataclass
class Labels:
    """Placement of labels beside their points so that they cover neither each other nor obstacles.

    A label without a free spot is placed at the last spot.
    """

    axes: Axes
    occupied: list[tuple[float, float, float, float]] = field(default_factory=list)
    """Rectangles in pixels: left, bottom, right, top."""

    def block(self, point: tuple[float, float], pixels: float) -> None:
        """Add a marker at `point` (data coordinates) as an obstacle of radius `pixels`."""
        x, y = self.axes.transData.transform(point)
        self.occupied.append((x - pixels, y - pixels, x + pixels, y + pixels))

    def add(self, text: str, point: tuple[float, float], colour: str, size: float = 9.0, weight: str = "bold") -> None:
        """Draw `text` next to `point` (data coordinates)."""
        figure, canvas = self.axes.figure, self.axes.figure.canvas
        assert isinstance(canvas, FigureCanvasAgg)
        note = self.axes.annotate(
            text,
            point,
            xytext=_SPOTS[0],
            textcoords="offset points",
            color=colour,
            fontsize=size,
            fontweight=weight,
            ha="center",
            va="center",
            zorder=9,
            bbox={"boxstyle": "round,pad=0.15", "facecolor": "white", "alpha": 0.8, "edgecolor": "none"},
            arrowprops={"arrowstyle": "-", "color": colour, "linewidth": 0.6, "alpha": 0.7, "shrinkA": 0, "shrinkB": 2},
        )
        renderer: RendererAgg = canvas.get_renderer()  # type: ignore[no-untyped-call]
        for dx, dy in _SPOTS:
            half = note.get_window_extent(renderer).width / 2 * 72 / figure.dpi if dx else 0.0
            note.set_position((dx + (half if dx > 0 else -half if dx < 0 else 0.0), dy))
            box = _extent(note, renderer)
            if self._free(box):
                break
        self.occupied.append(_extent(note, renderer))

    def _free(self, box: tuple[float, float, float, float]) -> bool:
        frame = self.axes.get_window_extent()
        if box[0] < frame.x0 or box[1] < frame.y0 or box[2] > frame.x1 or box[3] > frame.y1:
            return False
        return all(
            box[2] <= other[0] or box[0] >= other[2] or box[3] <= other[1] or box[1] >= other[3]
            for other in self.occupied
        )


def _extent(note: Annotation, renderer: RendererAgg) -> tuple[float, float, float, float]:
    """Return the label's rectangle in pixels, without its leader line."""
    box = Text.get_window_extent(note, renderer)
    return box.x0 - 2, box.y0 - 2, box.x1 + 2, box.y1 + 2


def panel_shape(axes: Axes) -> float:
    """Return width over height of a panel."""
    size = axes.get_window_extent()
    return float(size.width / size.height)


def bare(axes: Axes, title: str = "") -> None:
    """Remove the ticks of a panel, and set its title."""
    axes.set_xticks([])
    axes.set_yticks([])
    for side in axes.spines.values():
        side.set_color(RULE)
    if title:
        heading(axes, title)


def lanes(axes: Axes, names: Sequence[str]) -> None:
    """Set the names of the lanes 0, 1, 2, … of a panel. If there is not room for all, only every n-th name is set."""
    room = max(1, int(axes.get_window_extent().height / axes.figure.dpi * 72 / _LANE_PT))
    step = -(-len(names) // room) or 1
    axes.set_yticks(range(0, len(names), step), names[::step])


def heading(axes: Axes, title: str) -> None:
    """Set a panel's title, flush left."""
    axes.set_title(title, loc="left", fontsize=10, color=INK, fontweight="bold", pad=5)
