"""The ground of a city: one sheet around its waters, the sheets of the waters, and the quay walls between them.

The ground has elevation 0, and lands of about that height are painted on it. Water that reaches the city's bounds
continues to the horizon, and so does the ground. A city that is all water (its land is `City.lands`) has no sheet: its
sea is a plane without an end.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import numpy.typing as npt
import shapely

from lingjing.engines.camera.classes import CLASSES
from lingjing.engines.camera.ground import is_flat
from lingjing.engines.camera.mesh_rows import MeshPart, joined, polygons, sheet, walls
from lingjing.engines.camera.road_meshes import SURFACES, surface_id
from lingjing.mission.geometry2d import Extent
from lingjing.scene.city import City, Water

REACH_M = 30_000.0
"""Distance to which ground and waters continue, metres (chosen)."""

CELL_M, MOST_CELLS = 60.0, 40
"""Least side (m) of the cells of ground and lands, and most cells along a side (chosen).

The depth of large triangles is not exact near the eye.
"""
BED_M = 2.0
"""Depth of quay walls below the water, metres (chosen)."""

RIVER_SHARE, RIVER_GOES = 0.5, 0.7
"""Two numbers for the continuation of a river beyond the bounds (chosen).

A water is a river if its length along the bounds is less than the first share of their side. It ends beyond them at the
second multiple of the vector from the centre to the middle of that length.
"""
QUAY = (0.27, 0.265, 0.25)
"""Linear colour of quay walls (chosen)."""

DividedGround = tuple[MeshPart, npt.NDArray[np.int64], npt.NDArray[np.float64]]
"""A part, the range of indices (first, count) of each cell, (n, 2), and the boxes of the cells, (n, 6) metres."""


@dataclass(frozen=True, slots=True)
class TownGround:
    """The ground and the waters of a town."""

    ground: MeshPart
    """The flat ground."""
    ranges: npt.NDArray[np.int64]
    """First index and count of each cell of the ground, (n, 2)."""
    boxes: npt.NDArray[np.float64]
    """Boxes of these cells, (n, 6) metres."""
    lands: MeshPart
    """Lands that are painted on the ground."""
    land_ranges: npt.NDArray[np.int64]
    """First index and count of each cell of the lands."""
    land_boxes: npt.NDArray[np.float64]
    """Boxes of these cells."""
    quays: MeshPart
    """Quay walls."""
    waters: tuple[tuple[float, MeshPart], ...]
    """Sheets of the waters, by level (m)."""
    sea: float | None
    """Level of a water that covers the whole city, metres; None without one."""


def build_town_ground(city: City) -> TownGround:
    """Return the ground and the waters of a city."""
    bounds = shapely.box(*city.bounds)
    shapes = [shape_of(water) for water in city.waters]
    for water, shape in zip(city.waters, shapes, strict=True):
        if bounds.difference(shape).area < 1.0:
            return TownGround(*_cells([]), *_lands(city), _edges(city, water.level_m), (), water.level_m)
    wet = shapely.union_all(shapes).intersection(bounds)
    ground = bounds.difference(wet)
    pieces = _pieces(ground, _grid(city.bounds))
    beyond = [outwards(city, shape) for shape in shapes]
    level = city.waters[0].level_m if city.waters else 0.0
    around = shapely.box(-REACH_M, -REACH_M, REACH_M, REACH_M).difference(bounds)
    outside = _pieces(around.difference(shapely.union_all(beyond)) if shapes else around, _sides(city.bounds))
    quays = [walls(ring, level - BED_M, 0.0, QUAY, CLASSES["concrete"], inwards=k > 0)
             for rings in polygons(ground) for k, ring in enumerate(rings)] if shapes else []  # fmt: skip
    return TownGround(*_cells([*pieces, *outside]), *_lands(city), joined(quays), _waters(city, shapes, beyond), None)


def _grid(bounds: Extent) -> list[Extent]:
    """Return cells over the bounds; neighbours have exactly equal borders."""
    west, south, east, north = bounds
    side = max(CELL_M, max(east - west, north - south) / MOST_CELLS)
    xs = np.linspace(west, east, max(round((east - west) / side), 1) + 1).tolist()
    ys = np.linspace(south, north, max(round((north - south) / side), 1) + 1).tolist()
    return [(x, y, x2, y2) for y, y2 in pairwise(ys) for x, x2 in pairwise(xs)]


def _sides(bounds: Extent) -> list[Extent]:
    """Return the surroundings of the bounds as a strip on each side."""
    west, south, east, north = bounds
    return [
        (-REACH_M, -REACH_M, REACH_M, south),
        (-REACH_M, south, west, north),
        (east, south, REACH_M, north),
        (-REACH_M, north, REACH_M, REACH_M),
    ]


def _cells(shapes: list[shapely.Geometry]) -> DividedGround:
    """Return the ground of several shapes."""
    colour, style = SURFACES["ground"]
    number = surface_id("ground")
    wanted = [shape for shape in shapes if not shape.is_empty]
    return _divided(
        [joined(sheet(rings, 0.0, colour, number, style=style) for rings in polygons(shape)) for shape in wanted]
    )


def _divided(parts: list[MeshPart]) -> DividedGround:
    """Return several parts as one, with the ranges and boxes of each."""
    some = [part for part in parts if len(part.index)]
    counts = np.array([len(part.index) for part in some], np.int64)
    points = [part.vertices["position"] for part in some]
    boxes = np.array([(*p.min(axis=0), *p.max(axis=0)) for p in points], np.float64).reshape(-1, 6)
    return joined(some), np.stack([np.cumsum(counts) - counts, counts], axis=1), boxes


def _pieces(shape: shapely.Geometry, cells: list[Extent]) -> list[shapely.Geometry]:
    """Return a shape cut along the cells' borders, with the rest beyond all cells."""
    inside = [shapely.clip_by_rect(shape, *cell) for cell in cells]
    beyond = shape.difference(shapely.box(*cells[0][:2], *cells[-1][2:]))
    return [piece for piece in (*inside, beyond) if not piece.is_empty]


def _lands(city: City) -> DividedGround:
    """Return the even lands, the last one on top."""
    parts = []
    for number, land in enumerate(reversed([land for land in city.lands if is_flat(land)])):
        colour, style = SURFACES.get(land.surface, SURFACES["concrete"])
        shape = shapely.make_valid(shapely.Polygon(land.polygon))
        layer = max(0.9 - 0.1 * number, 0.1)
        parts += [sheet(rings, land.top_m, colour, surface_id(land.surface), style=style, layer=layer)
                  for piece in _pieces(shape, _grid(city.bounds)) for rings in polygons(piece)]  # fmt: skip
    return _divided(parts)


def _edges(city: City, level: float) -> MeshPart:
    """Return the walls of even lands down into the sea around them."""
    even = [land for land in city.lands if is_flat(land)]
    return joined(walls(land.polygon, level - BED_M, land.top_m, QUAY, CLASSES["concrete"]) for land in even)


def shape_of(water: Water) -> shapely.Geometry:
    """Return a water with its holes."""
    return shapely.make_valid(shapely.Polygon(water.polygon, water.holes))


def outwards(city: City, water: shapely.Geometry, reach_m: float = REACH_M) -> shapely.Geometry:
    """Return the continuation of a water beyond the bounds, at least to `reach_m`, where it touches them."""
    west, south, east, north = city.bounds
    centre = np.array([(west + east) / 2.0, (south + north) / 2.0])
    border = shapely.box(*city.bounds).exterior.intersection(water.buffer(0.5))
    stretches = []
    for line in shapely.get_parts(shapely.line_merge(border) if border.geom_type == "MultiLineString" else border):
        if line.geom_type != "LineString" or line.length < 5.0:
            continue
        points = np.asarray(line.coords)
        side = max(east - west, north - south)
        far = centre + (points - centre) * (4.0 * reach_m / side)
        if line.length < RIVER_SHARE * side:  # a river: a wedge would be a sea at the horizon
            far = points.mean(axis=0) + (points - points.mean(axis=0)) * 0.3
            far += (points.mean(axis=0) - centre) * RIVER_GOES
        stretches.append(shapely.make_valid(shapely.Polygon(np.concatenate([points, far[::-1]]))))
    return shapely.union_all(stretches) if stretches else shapely.Polygon()


def _waters(
    city: City, shapes: list[shapely.Geometry], beyond: list[shapely.Geometry]
) -> tuple[tuple[float, MeshPart], ...]:
    levels: dict[float, list[MeshPart]] = {}
    for water, shape, far in zip(city.waters, shapes, beyond, strict=True):
        parts = levels.setdefault(water.level_m, [])
        for surface in (shape, far):
            parts += [sheet(rings, water.level_m, (0.0, 0.0, 0.0), CLASSES["water"]) for rings in polygons(surface)]
    return tuple((level, joined(parts)) for level, parts in sorted(levels.items()))
