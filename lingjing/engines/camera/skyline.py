"""A distant city: its tall and wide buildings as blocks, tile by tile, and a painted map of everything.

Beyond the full tiles a picture shows these two: blocks of the buildings that are distinguishable there, on ground with
the map (`SIZE` pixels across). One pass over all tiles makes both. They are small for a city of any size.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from PIL import Image, ImageDraw

from lingjing.engines.camera.building_meshes import FACADES
from lingjing.engines.camera.classes import CLASSES
from lingjing.engines.camera.mesh_rows import MeshPart, empty, joined, oriented, sheet, walls
from lingjing.engines.camera.road_meshes import SURFACES
from lingjing.mission.geometry2d import Extent
from lingjing.mission.instance import Vector
from lingjing.scene.city import Building, City, Tile
from lingjing.scene.tiles import Tiles

SIZE = 1024
"""Side of the map, pixels (chosen)."""

TALL_M, WIDE_M2 = 22.0, 2500.0
"""Height or area of the bounding rectangle from which a building is a block, metres and square metres (chosen)."""

TOWER_M = 45.0
"""Height from which a building is drawn at many kilometres, metres (chosen)."""
MOST_BLOCKS = 5000
"""Most blocks of a city; the lowest buildings are left out (chosen)."""

CORNERS_MOST = 12
"""Most corners of a block's outline (chosen)."""

WATER = (0.045, 0.085, 0.09)
"""Linear colour of water on the map (chosen)."""


@dataclass(frozen=True, slots=True)
class Skyline:
    """The blocks and the map of a city."""

    blocks: MeshPart
    """Blocks of all tiles in one part."""
    keys: tuple[tuple[int, int], ...]
    """Keys of the tiles."""
    boxes: npt.NDArray[np.float64]
    """Extent of each tile: west, south, low, east, north, high; metres."""
    ranges: npt.NDArray[np.int64]
    """First index and count of each tile's towers and of its other blocks, (2, n, 2)."""
    map: npt.NDArray[np.uint8]
    """The map, rows from the south."""


def build_skyline(city: City, tiles: Tiles) -> Skyline:
    """Return blocks and map of a city."""
    canvas = _GroundRaster(city)
    tops, boxes = [], []
    for tile in tiles:
        canvas.paint(tile)
        tops.append([b.top_m for b in tile.buildings if _seen_from_afar(b)])
        boxes.append(_box(tile, tiles.extent(tile.key)))
    least = _least([top for some in tops for top in some])
    tall = [key for key, some in zip(tiles.keys, tops, strict=True) if max(some, default=-1.0) >= least]
    made = {key: _blocks(tiles.load(key), least) for key in tall}  # a second pass: all tiles need much memory
    groups = [[made.get(key, (empty(), empty()))[k] for key in tiles.keys] for k in (0, 1)]
    counts = np.array([[len(part.index) for part in group] for group in groups], np.int64)
    first = np.cumsum(counts.ravel()).reshape(counts.shape) - counts
    blocks = joined(part for group in groups for part in group)
    ranges = np.stack([first, counts], axis=2)
    return Skyline(blocks, tiles.keys, np.array(boxes).reshape(-1, 6), ranges, canvas.pixels())


def with_tiles(sky: Skyline, city: City, tiles: Tiles) -> Skyline:
    """Return the skyline of a city that differs only in its props.

    A tile that is new or missing holds only props, so it has no block.
    """
    number = {key: k for k, key in enumerate(sky.keys)}
    ranges = np.zeros((2, len(tiles.keys), 2), np.int64)
    for k, key in enumerate(tiles.keys):
        if key in number:
            ranges[:, k] = sky.ranges[:, number[key]]
    boxes = np.array([_box(tile, tiles.extent(tile.key)) for tile in tiles]).reshape(-1, 6)
    return replace(sky, keys=tiles.keys, boxes=boxes, ranges=ranges)


def _box(tile: Tile, extent: Extent) -> tuple[float, ...]:
    west, south, east, north = extent
    return west, south, -3.0, east, north, _top(tile)


def _blocks(tile: Tile, least: float) -> tuple[MeshPart, MeshPart]:
    """Return a tile's towers and its other blocks."""
    some = [b for b in tile.buildings if _seen_from_afar(b) and b.top_m >= least]
    towers = joined(_block(b) for b in some if b.top_m >= TOWER_M)
    return towers, joined(_block(b) for b in some if b.top_m < TOWER_M)


def _least(tops: list[float]) -> float:
    """Return the height above which there are at most `MOST_BLOCKS` buildings, metres."""
    return sorted(tops, reverse=True)[MOST_BLOCKS] if len(tops) > MOST_BLOCKS else 0.0


def _top(tile: Tile) -> float:
    """Return the height of a tile's highest piece, metres; trees and lamps count as 15 m."""
    tops = [b.top_m for b in tile.buildings] + [s.top_m for s in tile.solids]
    tops += [p[2] + 2.0 for path in _paths(tile) for p in path]
    tops += [p.position[2] + 15.0 for p in tile.props]
    return max(tops, default=1.0)


def _paths(tile: Tile) -> list[tuple[Vector, ...]]:
    return [bridge.path for bridge in tile.bridges] + [pipe.path for pipe in tile.pipes]


def _seen_from_afar(source: Building) -> bool:
    if source.top_m >= TALL_M:
        return True
    xs, ys = [p[0] for p in source.polygon], [p[1] for p in source.polygon]
    return (max(xs) - min(xs)) * (max(ys) - min(ys)) >= WIDE_M2


def _block(source: Building) -> MeshPart:
    """Return a building's outline with fewer corners, raised to its top, in the mean colour of its facade."""
    ring = _thinned(source.polygon)
    look = FACADES.get(source.facade, FACADES["punched"])
    number = CLASSES.get("building", CLASSES["structure"])
    style = (look.bay_m, 3.5, look.across, look.up)
    top = source.top_m - (source.roof_m / 2.0 if source.roof != "flat" else 0.0)
    around = walls(ring, source.base_m, top, source.colour, number, style=style,
                   gloss=0.75 if source.facade == "curtain" else 0.25)  # fmt: skip
    cover = sheet([ring], top, source.roof_colour, number)
    cover.vertices["style"] = (8.0, 3.5, 0.0, 0.0)
    part = joined((around, cover))
    part.vertices["layer"] = source.seed % 1024
    return part


def _thinned(ring: tuple[tuple[float, float], ...]) -> npt.NDArray[np.float64]:
    points = oriented(ring)
    if len(points) <= CORNERS_MOST:
        return points
    return np.asarray(points[np.linspace(0, len(points), CORNERS_MOST, endpoint=False).astype(int)])


class _GroundRaster:
    """The map during painting; pixels are square roots of linear colours."""

    def __init__(self, city: City) -> None:
        self.west, self.south, east, north = city.bounds
        self.scale_x, self.scale_y = SIZE / (east - self.west), SIZE / (north - self.south)
        self.image = Image.new("RGB", (SIZE, SIZE), _byte(SURFACES["ground"][0]))
        self.draw = ImageDraw.Draw(self.image)
        for water in city.waters:
            self._fill(water.polygon, WATER)
            for hole in water.holes:
                self._fill(hole, SURFACES["ground"][0])
        for land in city.lands:
            self._fill(land.polygon, SURFACES.get(land.surface, SURFACES["concrete"])[0])

    def paint(self, tile: Tile) -> None:
        for area in tile.areas:
            self._fill(area.polygon, SURFACES.get(area.surface, SURFACES["concrete"])[0])
        for junction in tile.junctions:
            self._fill(junction.polygon, SURFACES["asphalt"][0])
        for road in tile.roads:
            for lane in road.lanes:
                if not road.tunnel and lane.kind != "foot":
                    wide = max(1, round(lane.width_m * self.scale_x))
                    self.draw.line([self._at(p) for p in lane.shape], _byte(SURFACES["asphalt"][0]), wide)
        for building in tile.buildings:
            self._fill(building.polygon, building.roof_colour)

    def pixels(self) -> npt.NDArray[np.uint8]:
        return np.asarray(self.image)

    def _fill(self, ring: tuple[tuple[float, float], ...], colour: tuple[float, float, float]) -> None:
        if len(ring) > 2:
            self.draw.polygon([self._at(p) for p in ring], _byte(colour))

    def _at(self, point: tuple[float, ...]) -> tuple[float, float]:
        return (point[0] - self.west) * self.scale_x, (point[1] - self.south) * self.scale_y


def _byte(colour: tuple[float, float, float]) -> tuple[int, int, int]:
    red, green, blue = (round(255.0 * min(max(c, 0.0), 1.0) ** 0.5) for c in colour)
    return red, green, blue
