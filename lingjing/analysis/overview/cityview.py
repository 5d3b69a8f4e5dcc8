"""The city under the map, faint enough for tracks and labels to stand out."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby

from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PathCollection
from matplotlib.path import Path

from lingjing.analysis.groundplan import Kind, Shape, ground_plan, is_sea
from lingjing.scene.city import City

LAND, WATER = "#f4f2ed", "#d6e8f2"
FILLS: dict[Kind, str] = {
    "water": WATER, "land": LAND, "sand": "#f0e8d0", "slab": "#eae6df", "green": "#e1ecd3", "paved": "#e6e3de",
    "path": "#efece6", "road": "#ffffff", "solid": "#c9c2b8", "bridge": "#ffffff", "building": "#d3ccc1",
    "pipe": "#9c8f7d",
}  # fmt: skip
_EDGES: dict[Kind, str] = {"building": "#c5bdb1", "bridge": "#b5aa99"}
_THINNEST_PT = 0.4


def draw_city(axes: Axes, city: City) -> None:
    """Paint what lies within the limits of `axes`, whose aspect is equal, under everything else (z-order below 1)."""
    west, east = axes.get_xlim()
    south, north = axes.get_ylim()
    shapes = ground_plan(city, (west, south, east, north))
    axes.set_facecolor(WATER if is_sea(shapes) else LAND)
    points_per_m = axes.get_window_extent().width / axes.figure.dpi * 72.0 / (east - west)
    for order, (kind, group) in enumerate(groupby(shapes, key=lambda shape: shape.kind)):
        _paint(axes, kind, tuple(group), points_per_m, 0.02 * order)


def _paint(axes: Axes, kind: Kind, shapes: Sequence[Shape], points_per_m: float, order: float) -> None:
    lines = [shape for shape in shapes if shape.width_m > 0]
    paths = [_outline(shape) for shape in shapes if shape.width_m == 0 and len(shape.points) > 2]
    edge = _EDGES.get(kind)
    if paths:
        fills = PathCollection(paths, facecolors=[FILLS[kind]], edgecolors=[edge or "none"], linewidths=0.4)
        fills.set_zorder(order)
        axes.add_collection(fills, autolim=False)
    if lines:
        widths = [max(_THINNEST_PT, shape.width_m * points_per_m) for shape in lines]
        courses = [shape.points for shape in lines]
        for colour, grown in ((edge, 1.0), (FILLS[kind], 0.0)):  # the edge is a wider line below
            if colour is not None:
                wide = [width + grown for width in widths]
                strokes = LineCollection(courses, colors=colour, linewidths=wide, capstyle="round", zorder=order)
                axes.add_collection(strokes, autolim=False)


def _outline(shape: Shape) -> Path:
    rings = (shape.points, *(hole[::-1] for hole in shape.holes))
    return Path.make_compound_path(*(Path([*ring, ring[0]], closed=True) for ring in rings))
