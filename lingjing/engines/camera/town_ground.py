"""The ground under a city: one sheet around its waters, the waters' own sheets, the quay walls between them.

Ground lies at elevation 0; lands of about that height are painted on it, and where a water is all over they are the
ground. Where water reaches the city's bounds it goes on to the horizon, and so does the ground. A
city that is water all over (its land is `City.lands`) has no sheet: its sea is a plane without an end.
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
CELL_M, MOST_CELLS = 60.0, 40
"""Least side of the cells that ground and lands are cut into, and how many there are at most along a side: the depth of
large triangles is not exact close to the eye."""
BED_M = 2.0
RIVER_SHARE, RIVER_GOES = 0.5, 0.7
"""A stretch of water at the bounds that is shorter than this share of their side ends beyond them, so many times the
way from their middle on."""
QUAY = (0.27, 0.265, 0.25)


"""West, south, east, north."""


DividedGround = tuple[MeshPart, npt.NDArray[np.int64], npt.NDArray[np.float64]]
"""A part, the range of indices (first, count) of each of its cells and their boxes (west, south, low, east, …)."""


@dataclass(frozen=True, slots=True)
class TownGround:
    """`ground` (flat) in cells of `ranges` (n, 2), first index and count, that `boxes` (n, 6) hold; so are `lands`,
    painted on it; `quays` (walls), `waters` by level; `sea`: the level of a water that is everywhere, or None."""

    ground: MeshPart
    ranges: npt.NDArray[np.int64]
    boxes: npt.NDArray[np.float64]
    lands: MeshPart
    land_ranges: npt.NDArray[np.int64]
    land_boxes: npt.NDArray[np.float64]
    quays: MeshPart
    waters: tuple[tuple[float, MeshPart], ...]
    sea: float | None


def build_town_ground(city: City) -> TownGround:
    """The ground and the waters of a city."""
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
    """Cells over the bounds; their common borders are the same numbers."""
    west, south, east, north = bounds
    side = max(CELL_M, max(east - west, north - south) / MOST_CELLS)
    xs = np.linspace(west, east, max(round((east - west) / side), 1) + 1).tolist()
    ys = np.linspace(south, north, max(round((north - south) / side), 1) + 1).tolist()
    return [(x, y, x2, y2) for y, y2 in pairwise(ys) for x, x2 in pairwise(xs)]


def _sides(bounds: Extent) -> list[Extent]:
    """What lies around the bounds: a strip on each side."""
    west, south, east, north = bounds
    return [
        (-REACH_M, -REACH_M, REACH_M, south),
        (-REACH_M, south, west, north),
        (east, south, REACH_M, north),
        (-REACH_M, north, REACH_M, REACH_M),
    ]


def _cells(shapes: list[shapely.Geometry]) -> DividedGround:
    """Ground of several shapes."""
    colour, style = SURFACES["ground"]
    number = surface_id("ground")
    wanted = [shape for shape in shapes if not shape.is_empty]
    return _divided(
        [joined(sheet(rings, 0.0, colour, number, style=style) for rings in polygons(shape)) for shape in wanted]
    )


def _divided(parts: list[MeshPart]) -> DividedGround:
    """Several parts as one."""
    some = [part for part in parts if len(part.index)]
    counts = np.array([len(part.index) for part in some], np.int64)
    points = [part.vertices["position"] for part in some]
    boxes = np.array([(*p.min(axis=0), *p.max(axis=0)) for p in points], np.float64).reshape(-1, 6)
    return joined(some), np.stack([np.cumsum(counts) - counts, counts], axis=1), boxes


def _pieces(shape: shapely.Geometry, cells: list[Extent]) -> list[shapely.Geometry]:
    """A shape cut along the cells' borders, and what of it lies beyond them all."""
    found = [shapely.clip_by_rect(shape, *cell) for cell in cells]
    beyond = shape.difference(shapely.box(*cells[0][:2], *cells[-1][2:]))
    return [piece for piece in (*found, beyond) if not piece.is_empty]


def _lands(city: City) -> DividedGround:
    """Even lands, the last one on top."""
    parts = []
    for number, land in enumerate(reversed([land for land in city.lands if is_flat(land)])):
        colour, style = SURFACES.get(land.surface, SURFACES["concrete"])
        shape = shapely.make_valid(shapely.Polygon(land.polygon))
        layer = max(0.9 - 0.1 * number, 0.1)
        parts += [sheet(rings, land.top_m, colour, surface_id(land.surface), style=style, layer=layer)
                  for piece in _pieces(shape, _grid(city.bounds)) for rings in polygons(piece)]  # fmt: skip
    return _divided(parts)


def _edges(city: City, level: float) -> MeshPart:
    """The walls of even lands down into a sea that is all around them."""
    even = [land for land in city.lands if is_flat(land)]
    return joined(walls(land.polygon, level - BED_M, land.top_m, QUAY, CLASSES["concrete"]) for land in even)


def shape_of(water: Water) -> shapely.Geometry:
    """A water with its holes."""
    return shapely.make_valid(shapely.Polygon(water.polygon, water.holes))


def outwards(city: City, water: shapely.Geometry, reach_m: float = REACH_M) -> shapely.Geometry:
    """What lies beyond the bounds, as far as `reach_m` at least, behind the stretches of them that a water covers."""
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
        if line.length < RIVER_SHARE * side:  # a river; as a wedge it would be a sea at the horizon
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
        for one in (shape, far):
            parts += [sheet(rings, water.level_m, (0.0, 0.0, 0.0), CLASSES["water"]) for rings in polygons(one)]
    return tuple((level, joined(parts)) for level, parts in sorted(levels.items()))
