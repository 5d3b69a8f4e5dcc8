"""A city from above as flat shapes in painting order, for maps in figures and terminals; and a painter for matplotlib.

`ground_plan` returns the shapes. `paint` draws them with matplotlib in the colours of a `Palette`. `draw_plan` writes
the whole city as a picture file. Callers without matplotlib axes paint the shapes themselves.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Literal, get_args

from lingjing.errors import UsageError
from lingjing.mission.geometry2d import Extent, Polygon, Vector2, bounds, signed_area
from lingjing.scene.city import City, Pieces
from lingjing.scene.tiles import Tiles
from lingjing.whole_files import written_whole

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.path import Path as Outline

Layer = Literal["water", "land", "slab", "area", "path", "road", "solid", "bridge", "building", "tree", "pipe"]
"""The layers in painting order: each covers those before it."""


SLAB_M = 0.6
"""Greatest thickness of a solid that is drawn as ground to stand on, metres: a kerbed block, a deck (chosen)."""

SIDE_IN, DPI = 12.0, 150
"""Longer side of the picture that `draw_plan` writes, inches, and its pixels per inch (chosen)."""

_TREE_M = 4.0
"""Diameter of a drawn tree of scale 1, metres (chosen)."""

_ASSET, _TARGET, _HIDDEN, _REGION = "#0b4f9e", "#1a7f37", "#b00020", "#5b3fa0"
"""Colours of marked assets, targets, hidden targets and regions (chosen: apart from the plan's own colours)."""

_MARGIN, _MARGIN_M = 0.15, 60.0
"""Margin around what is marked, as a share of its larger side and at least in metres (chosen)."""

_LAYERS: tuple[Layer, ...] = get_args(Layer)


@dataclass(frozen=True, slots=True)
class PlanShape:
    """A polygon with holes; if `width_m` > 0, a line of that width, or a dot."""

    layer: Layer
    points: tuple[Vector2, ...]
    """East and north, metres: the outline of a polygon, the points of a line, or the centre of a dot."""
    holes: tuple[Polygon, ...] = ()
    """Unpainted areas inside the outline."""
    width_m: float = 0.0
    """Width of a line or diameter of a dot, metres; 0 for a polygon."""
    surface: str = ""
    """Surface of an area, the same with ` land` added for ground (`grass land`), or the kind of a road's lane."""
    top_m: float = 0.0
    """Elevation of a flat shape, or of the top of a building or solid, metres."""
    base_m: float = 0.0
    """Elevation of the base of a building or solid, metres."""
    heights_m: tuple[float, ...] = ()
    """Elevations of a line's points, metres; empty for polygons."""


@dataclass(frozen=True, slots=True)
class PlanMarker:
    """A body of a mission on a plan."""

    name: str
    east: float
    """East coordinate of the body, metres."""
    north: float
    """North coordinate of the body, metres."""
    role: Literal["asset", "target"]
    hidden: bool = False
    """True if agents do not know its place."""


@dataclass(frozen=True, slots=True)
class PlanRegion:
    """A region of a mission on a plan."""

    name: str
    outline: Polygon
    """Corners in metres."""
    hidden: bool = False
    """True if agents do not know it."""


@dataclass(frozen=True, slots=True)
class Palette:
    """Colours by surface and layer. A surface's colour has priority; a shape without either is not painted."""

    ground: str
    """Colour under all shapes."""
    layers: Mapping[Layer, str]
    """Fill by layer."""
    surfaces: Mapping[str, str] = field(default_factory=dict)
    """Fill by surface."""
    edges: Mapping[Layer, str] = field(default_factory=dict)
    """Colour of outlines by layer."""
    by_height: bool = False
    """True to darken a building's colour with its height."""

    def colour(self, shape: PlanShape) -> str | tuple[float, float, float] | None:
        """The fill of a shape: a name or RGB 0..1; None for a shape that is not painted."""
        if self.by_height and shape.layer == "building":
            shade = 0.82 - 0.62 * min(1.0, (max(shape.top_m, 0.0) / 300.0) ** 0.5)
            return shade, shade * 0.93, shade * 0.86
        return self.surfaces.get(shape.surface, self.layers.get(shape.layer))


PLAN = Palette(
    ground="#f1eee8",
    layers={
        "water": "#a9cfe0", "land": "#f1eee8", "slab": "#e2dcd2", "road": "#b3b3b8", "solid": "#8d8377",
        "bridge": "#cfc4b2", "tree": "#5d8a4a", "pipe": "#7d6f5f",
    },
    surfaces={
        "park": "#cfe3b4", "grass": "#d9e8c0", "forest": "#b2cf9b", "plaza": "#e9e0d0", "sidewalk": "#dcd6cc",
        "parking": "#dcdce2", "asphalt": "#cfcfd2", "industrial": "#e4dde0", "residential": "#ebe7e0",
        "commercial": "#efe3dc", "sand": "#efe4bf", "concrete": "#dad8d4", "pitch": "#a9d3ad",
        "grass land": "#d9e8c0", "rock land": "#c9c4bb", "concrete land": "#dad8d4", "foot": "#d8cfc2",
        "bicycle": "#c9b7b0", "bus": "#a9a0a8", "closed": "#c6c2c6",
    },
    edges={"building": "#5b5148"},
    by_height=True,
)  # fmt: skip
"""The colours of `draw_plan`."""


def ground_plan(city: City, bounds: Extent | None = None) -> tuple[PlanShape, ...]:
    """The shapes in and around `bounds` (west, south, east, north; metres), or of the whole city, in painting order.

    Raises `UsageError` if the city's folder no longer exists.
    """
    west, south, east, north = bounds or city.bounds
    middle, radius = ((west + east) / 2, (south + north) / 2), math.hypot(east - west, north - south) / 2
    tiles = Tiles(city)
    layers: dict[Layer, list[PlanShape]] = defaultdict(list)
    for shapes in (_everywhere(city), *map(_of_tile, tiles if bounds is None else tiles.near(*middle, radius))):
        for shape in shapes:
            layers[shape.layer].append(shape)
    return tuple(shape for layer in _LAYERS for shape in layers[layer])


def is_sea(shapes: Sequence[PlanShape]) -> bool:
    """True if water is the background: a rectangle of water without islands of its own contains everything else.

    A river or a lake on a map is painted as a shape instead.
    """
    boxes = [_box(shape.points) for shape in shapes if shape.layer == "water" and _fills_its_box(shape)]
    if not boxes:
        return False
    west, south, east, north = _box([point for shape in shapes if shape.layer != "water" for point in shape.points])
    return any(box[0] <= west and box[1] <= south and east <= box[2] and north <= box[3] for box in boxes)


def paint(axes: Axes, shapes: Sequence[PlanShape], palette: Palette) -> None:
    """Paint shapes within the limits of `axes`, which have an equal aspect. All z-orders are below 1."""
    from matplotlib.collections import LineCollection, PathCollection

    west, east = axes.get_xlim()
    points_per_m = axes.get_window_extent().width / axes.figure.dpi * 72.0 / (east - west)
    axes.set_facecolor(palette.layers.get("water", palette.ground) if is_sea(shapes) else palette.ground)
    for order, layer in enumerate(_LAYERS):
        z = order / len(_LAYERS)
        edge = palette.edges.get(layer)
        filled = [(shape, colour) for shape in shapes if shape.layer == layer if (colour := palette.colour(shape))]
        fills = [(_outline(shape), colour) for shape, colour in filled if not shape.width_m and len(shape.points) > 2]
        if fills:
            paths, colours = [path for path, _ in fills], [colour for _, colour in fills]
            axes.add_collection(
                PathCollection(paths, facecolors=colours, edgecolors=[edge or "none"], linewidths=0.3, zorder=z),
                autolim=False,
            )
        dots = [(shape, colour) for shape, colour in filled if len(shape.points) == 1]
        if dots:
            xs, ys = zip(*(shape.points[0] for shape, _ in dots), strict=True)
            sizes = [(shape.width_m * points_per_m) ** 2 for shape, _ in dots]
            axes.scatter(xs, ys, s=sizes, c=[colour for _, colour in dots], linewidths=0, alpha=0.7, zorder=z)
        lines = [(shape, colour) for shape, colour in filled if shape.width_m and len(shape.points) > 1]
        courses = [shape.points for shape, _ in lines]
        widths = [max(0.4, shape.width_m * points_per_m) for shape, _ in lines]
        if lines and edge:
            wider = [width + 1.0 for width in widths]
            borders = LineCollection(courses, colors=edge, linewidths=wider, capstyle="round", zorder=z)
            axes.add_collection(borders, autolim=False)
        if lines:
            colours = [colour for _, colour in lines]
            strokes = LineCollection(courses, colors=colours, linewidths=widths, capstyle="round", zorder=z)
            axes.add_collection(strokes, autolim=False)


def draw_plan(
    city: City, path: Path, *, markers: Sequence[PlanMarker] = (), regions: Sequence[PlanRegion] = (), title: str = ""
) -> None:
    """Write the whole city with a scale bar as a picture; the suffix gives the format (`.png`, `.svg`, `.pdf`).

    `markers` and `regions` are drawn over it, hidden ones dashed. With them the picture shows the part of the city
    that holds them; bodies outside of the city are left out.

    Raises `UsageError` if the file cannot be written.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    west, south, east, north = _shown(city, markers, regions)
    wide, high = east - west, north - south
    scale = SIDE_IN / max(wide, high)
    figure = Figure(figsize=(wide * scale, high * scale + 0.5))
    FigureCanvasAgg(figure)
    share = high * scale / (high * scale + 0.5)
    axes = figure.add_axes((0.0, 1.0 - share, 1.0, share))
    axes.set(xlim=(west, east), ylim=(south, north), aspect="equal", xticks=[], yticks=[])
    paint(axes, ground_plan(city, (west, south, east, north)), PLAN)
    bar = 10 ** len(str(int(wide / 5))) / 10.0
    axes.plot([west + wide * 0.03, west + wide * 0.03 + bar], [south + high * 0.03] * 2, color="black", lw=3, zorder=20)
    axes.text(west + wide * 0.03, south + high * 0.038, f"{bar:g} m", fontsize=9, zorder=20)
    mark(axes, markers, regions)
    note = f"{title} · " * bool(title) + f"{city.id} · {city.attribution}"
    figure.text(0.01, 0.01, note, fontsize=8, parse_math=False)
    written_figure(figure, path, DPI)


def written_figure(figure: Figure, path: Path, dpi: int) -> None:
    """Write a figure whole; the suffix gives the format. Raises `UsageError` if the file cannot be written."""
    kind = path.suffix[1:].lower()
    try:
        with written_whole(path) as partial:
            figure.savefig(partial, format=kind, dpi=dpi, metadata={"Date": None} if kind == "svg" else None)
    except OSError as error:
        raise UsageError(f"cannot write `{path}`: {error.strerror}", hint="choose another place with -o") from error


def mark(axes: Axes, markers: Sequence[PlanMarker], regions: Sequence[PlanRegion]) -> None:
    """Draw regions as outlines, assets as filled triangles, targets as filled circles, hidden ones dashed and empty.

    Places are in the coordinates of the axes; bodies outside of them are left out.
    """
    from matplotlib.patches import Polygon as Outlined

    for region in regions:
        colour = _HIDDEN if region.hidden else _REGION
        style = "--" if region.hidden else "-"
        axes.add_patch(Outlined(region.outline, fill=False, ec=colour, lw=1.2, ls=style, zorder=21))
        top = max(region.outline, key=lambda corner: corner[1])
        axes.text(*top, region.name, color=colour, fontsize=8, ha="center", va="bottom", parse_math=False, zorder=22)
    (west, east), (south, north) = axes.get_xlim(), axes.get_ylim()
    for number, marker in enumerate(markers):
        if not (west <= marker.east <= east and south <= marker.north <= north):
            continue
        colour = _HIDDEN if marker.hidden else _ASSET if marker.role == "asset" else _TARGET
        shape = "^" if marker.role == "asset" else "o"
        fill = "none" if marker.hidden else colour
        axes.scatter(
            marker.east, marker.north, s=60, marker=shape, facecolors=fill, edgecolors=colour, linewidths=1.4,
            linestyles="--" if marker.hidden else "-", zorder=23,
        )  # fmt: skip
        label = f"{marker.name} (hidden)" if marker.hidden else marker.name
        axes.annotate(
            label,
            (marker.east, marker.north),
            (6, 4) if number % 2 == 0 else (6, -12),
            textcoords="offset points",
            color=colour,
            fontsize=8,
            parse_math=False,
            zorder=24,
            bbox={"boxstyle": "round,pad=0.15", "fc": "white", "ec": "none", "alpha": 0.75},
        )


# -- private


def _shown(city: City, markers: Sequence[PlanMarker], regions: Sequence[PlanRegion]) -> Extent:
    """The part of the city to draw: around what is marked, or all of it."""
    west, south, east, north = city.bounds
    points = [(m.east, m.north) for m in markers if west <= m.east <= east and south <= m.north <= north]
    points += [corner for region in regions for corner in region.outline]
    if not points:
        return city.bounds
    left, bottom, right, top = bounds(points)
    margin = max(_MARGIN_M, _MARGIN * max(right - left, top - bottom))
    shown = max(west, left - margin), max(south, bottom - margin), min(east, right + margin), min(north, top + margin)
    return shown if shown[0] < shown[2] and shown[1] < shown[3] else city.bounds


def _fills_its_box(shape: PlanShape) -> bool:
    west, south, east, north = _box(shape.points)
    return not shape.holes and abs(signed_area(shape.points)) >= 0.99 * (east - west) * (north - south) > 0.0


def _box(points: Sequence[Vector2]) -> Extent:
    """West, south, east, north; for no points, an inverted box that every box contains."""
    return bounds(points) if points else (math.inf, math.inf, -math.inf, -math.inf)


def _everywhere(city: City) -> Iterator[PlanShape]:
    for water in city.waters:
        yield PlanShape("water", water.polygon, water.holes, top_m=water.level_m)
    for land in city.lands:
        surface = land.surface if land.surface == "sand" else f"{land.surface} land"
        yield PlanShape("land", land.polygon, surface=surface, top_m=land.top_m)


def _of_tile(tile: Pieces) -> Iterator[PlanShape]:
    for area in tile.areas:
        yield PlanShape("area", area.polygon, area.holes, surface=area.surface, top_m=area.top_m)
    for junction in tile.junctions:
        yield PlanShape("road", junction.polygon, top_m=junction.elevation_m)
    for road in tile.roads:
        for lane in () if road.tunnel else road.lanes:
            layer: Layer = "path" if lane.kind in ("foot", "bicycle") else "road"
            yield PlanShape(
                layer,
                _level(lane.shape),
                width_m=lane.width_m,
                surface=lane.kind,
                heights_m=_heights(lane.shape),
            )
    for solid in tile.solids:
        kind: Layer = "slab" if solid.top_m - solid.base_m <= SLAB_M else "solid"
        yield PlanShape(kind, solid.polygon, top_m=solid.top_m, base_m=solid.base_m)
    for bridge in tile.bridges:
        yield PlanShape("bridge", _level(bridge.path), width_m=bridge.width_m, heights_m=_heights(bridge.path))
    for building in sorted(tile.buildings, key=lambda building: (building.top_m, building.id)):
        yield PlanShape("building", building.polygon, building.holes, top_m=building.top_m, base_m=building.base_m)
    for prop in tile.props:
        if prop.cls == "tree":
            yield PlanShape("tree", (prop.position[:2],), width_m=_TREE_M * prop.scale, heights_m=prop.position[2:])
    for pipe in tile.pipes:
        yield PlanShape("pipe", _level(pipe.path), width_m=2 * pipe.radius_m, heights_m=_heights(pipe.path))


def _level(path: Sequence[tuple[float, ...]]) -> tuple[Vector2, ...]:
    return tuple((point[0], point[1]) for point in path)


def _heights(path: Sequence[tuple[float, ...]]) -> tuple[float, ...]:
    return tuple(point[2] for point in path)


def _outline(shape: PlanShape) -> Outline:
    from matplotlib.path import Path as Outline

    rings = (shape.points, *(hole[::-1] for hole in shape.holes))
    return Outline.make_compound_path(*(Outline([*ring, ring[0]], closed=True) for ring in rings))
