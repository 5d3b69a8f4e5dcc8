"""A plan of a city: the whole of it seen from above, as a picture for people (matplotlib)."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lingjing.scene.city import Building, City, Polygon
from lingjing.scene.tiles import Tiles

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SURFACES = {
    "park": "#cfe3b4", "grass": "#d9e8c0", "forest": "#b2cf9b", "plaza": "#e9e0d0", "sidewalk": "#dcd6cc",
    "parking": "#dcdce2", "asphalt": "#cfcfd2", "industrial": "#e4dde0", "residential": "#ebe7e0",
    "commercial": "#efe3dc", "sand": "#efe4bf", "concrete": "#dad8d4", "pitch": "#a9d3ad", "rock": "#c9c4bb",
}  # fmt: skip
GROUND, WATER, BRIDGE, SOLID = "#f1eee8", "#a9cfe0", "#b9a98f", "#8d8377"
WIDTHS = {"foot": "#d8cfc2", "bicycle": "#c9b7b0", "bus": "#a9a0a8", "car": "#b3b3b8"}
SIDE_IN = 12.0
"""The longer side of the picture, inches."""


def draw(city: City, path: Path, dpi: int = 150) -> None:
    """Write the plan to a file; its suffix says which format (`.png`, `.svg`, `.pdf`)."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    west, south, east, north = city.bounds
    wide, high = east - west, north - south
    scale = SIDE_IN / max(wide, high)
    figure = Figure(figsize=(wide * scale, high * scale + 0.5))
    FigureCanvasAgg(figure)
    share = high * scale / (high * scale + 0.5)
    axes = figure.add_axes((0.0, 1.0 - share, 1.0, share))
    axes.set(xlim=(west, east), ylim=(south, north), aspect="equal", facecolor=GROUND, xticks=[], yticks=[])
    _grounds(axes, city)
    _tiles(axes, city, points_per_m=72.0 * scale)
    bar = 10 ** len(str(int(wide / 5))) / 10.0
    axes.plot([west + wide * 0.03, west + wide * 0.03 + bar], [south + high * 0.03] * 2, color="black", lw=3, zorder=20)
    axes.text(west + wide * 0.03, south + high * 0.038, f"{bar:g} m", fontsize=9, zorder=20)
    figure.text(0.01, 0.01, f"{city.id} · {city.attribution}", fontsize=8)
    figure.savefig(path, dpi=dpi, metadata={"Date": None} if path.suffix == ".svg" else None)


# -- private


def _grounds(axes: Axes, city: City) -> None:
    _fill(axes, [(w.polygon, *w.holes) for w in city.waters], color=WATER, zorder=1)
    for land in city.lands:
        _fill(axes, [(land.polygon,)], color=SURFACES.get(land.surface, GROUND), zorder=1.5)


def _tiles(axes: Axes, city: City, points_per_m: float) -> None:
    from matplotlib.collections import LineCollection

    for tile in Tiles(city):
        for k, area in enumerate(tile.areas):
            order = 2.0 + k / (len(tile.areas) + 1.0)
            _fill(axes, [(area.polygon, *area.holes)], color=SURFACES.get(area.surface, GROUND), zorder=order)
        _fill(axes, [(junction.polygon,) for junction in tile.junctions], color=WIDTHS["car"], zorder=4)
        lanes = [lane for road in tile.roads for lane in road.lanes]
        for kind, colour in WIDTHS.items():
            chosen = [lane for lane in lanes if lane.kind == kind]
            lines = [[point[:2] for point in lane.shape] for lane in chosen]
            widths = [lane.width_m * points_per_m for lane in chosen]
            axes.add_collection(LineCollection(lines, linewidths=widths, colors=colour, zorder=4.2))
        decks = [[point[:2] for point in bridge.path] for bridge in tile.bridges]
        widths = [bridge.width_m * points_per_m for bridge in tile.bridges]
        axes.add_collection(LineCollection(decks, linewidths=widths, colors=BRIDGE, zorder=5, alpha=0.55))
        _fill(axes, [(solid.polygon,) for solid in tile.solids], color=SOLID, zorder=3.5)
        _buildings(axes, tile.buildings)
        trees = [prop.position for prop in tile.props if prop.cls == "tree"]
        size = (4.0 * points_per_m) ** 2
        axes.scatter([x for x, _, _ in trees], [y for _, y, _ in trees], s=size, c="#5d8a4a", lw=0, alpha=0.6, zorder=6)


def _buildings(axes: Axes, buildings: Iterable[Building]) -> None:
    """Footprints, the lower ones first, darker the higher they are."""
    for building in sorted(buildings, key=lambda item: (item.top_m, item.id)):
        shade = 0.82 - 0.62 * min(1.0, (building.top_m / 300.0) ** 0.5)
        colour = (shade, shade * 0.93, shade * 0.86)
        _fill(axes, [(building.polygon, *building.holes)], color=colour, zorder=7, edge="#5b5148")


def _fill(axes: Axes, shapes: Iterable[tuple[Polygon, ...]], *, color: Any, zorder: float, edge: str = "none") -> None:
    """Polygons with their holes, all in one colour."""
    from matplotlib.collections import PathCollection
    from matplotlib.path import Path as Outline

    paths = []
    for outline, *holes in shapes:
        closed = [Outline([*ring, ring[0]], closed=True) for ring in (outline, *(hole[::-1] for hole in holes))]
        paths.append(Outline.make_compound_path(*closed))
    axes.add_collection(PathCollection(paths, facecolors=[color], edgecolors=edge, linewidths=0.25, zorder=zorder))
