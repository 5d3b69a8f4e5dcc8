"""A city from afar: its tall and its wide buildings as blocks, tile by tile, and a painted map of everything.

What lies beyond the full geometry of tiles is drawn from these two: blocks of the buildings that can be told apart
there, on ground that wears the map (`SIZE` pixels across). Both are made in one walk over all tiles and are small,
however large the city is.
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
TALL_M, WIDE_M2 = 22.0, 2500.0
TOWER_M = 45.0
"""From here on a building is seen for many kilometres."""
MOST_BLOCKS = 5000
CORNERS_MOST = 12
"""Of a block's outline."""
WATER = (0.045, 0.085, 0.09)


@dataclass(frozen=True, slots=True)
class Skyline:
    """Blocks of all tiles in one part; `boxes`, what each tile in `keys` covers (west, south, low, east, north, high);
    `ranges` (2, n, 2), first index and count of each tile's towers and of its other blocks; the map, from the south."""

    blocks: MeshPart
    keys: tuple[tuple[int, int], ...]
    boxes: npt.NDArray[np.float64]
    ranges: npt.NDArray[np.int64]
    map: npt.NDArray[np.uint8]


def build_skyline(city: City, tiles: Tiles) -> Skyline:
    """Blocks and map of a city."""
    canvas = _GroundRaster(city)
    tops, boxes = [], []
    for tile in tiles:
        canvas.paint(tile)
        tops.append([b.top_m for b in tile.buildings if _seen_from_afar(b)])
        boxes.append(_box(tile, tiles.extent(tile.key)))
    least = _least([top for some in tops for top in some])
    tall = [key for key, some in zip(tiles.keys, tops, strict=True) if max(some, default=-1.0) >= least]
    made = {key: _blocks(tiles.load(key), least) for key in tall}  # read again: all at once they take much room
    groups = [[made.get(key, (empty(), empty()))[k] for key in tiles.keys] for k in (0, 1)]
    counts = np.array([[len(part.index) for part in group] for group in groups], np.int64)
    first = np.cumsum(counts.ravel()).reshape(counts.shape) - counts
    blocks = joined(part for group in groups for part in group)
    ranges = np.stack([first, counts], axis=2)
    return Skyline(blocks, tiles.keys, np.array(boxes).reshape(-1, 6), ranges, canvas.pixels())


def with_tiles(sky: Skyline, city: City, tiles: Tiles) -> Skyline:
    """The skyline of a city that differs in its props alone: a tile that is new or gone holds nothing else, so has no
    block."""
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
    """A tile's towers and its other blocks."""
    some = [b for b in tile.buildings if _seen_from_afar(b) and b.top_m >= least]
    towers = joined(_block(b) for b in some if b.top_m >= TOWER_M)
    return towers, joined(_block(b) for b in some if b.top_m < TOWER_M)


def _least(tops: list[float]) -> float:
    """The height from which on there are no more than `MOST_BLOCKS` buildings."""
    return sorted(tops, reverse=True)[MOST_BLOCKS] if len(tops) > MOST_BLOCKS else 0.0


def _top(tile: Tile) -> float:
    """The height of a tile's highest piece; trees and lamps count as 15 m."""
    tops = [b.top_m for b in tile.buildings] + [s.top_m for s in tile.solids]
    tops += [p[2] + 2.0 for path in _paths(tile) for p in path]
    tops += [p.position[2] + 15.0 for p in tile.props]
    return max(tops, default=1.0)


def _paths(tile: Tile) -> list[tuple[Vector, ...]]:
    return [bridge.path for bridge in tile.bridges] + [pipe.path for pipe in tile.pipes]


def _seen_from_afar(given: Building) -> bool:
    if given.top_m >= TALL_M:
        return True
    xs, ys = [p[0] for p in given.polygon], [p[1] for p in given.polygon]
    return (max(xs) - min(xs)) * (max(ys) - min(ys)) >= WIDE_M2


def _block(given: Building) -> MeshPart:
    """The outline thinned to what counts from afar, raised to the top; its colour is the facade's mean."""
    ring = _thinned(given.polygon)
    look = FACADES.get(given.facade, FACADES["punched"])
    number = CLASSES.get("building", CLASSES["structure"])
    style = (look.bay_m, 3.5, look.across, look.up)
    top = given.top_m - (given.roof_m / 2.0 if given.roof != "flat" else 0.0)
    around = walls(ring, given.base_m, top, given.colour, number, style=style,
                   gloss=0.75 if given.facade == "curtain" else 0.25)  # fmt: skip
    cover = sheet([ring], top, given.roof_colour, number)
    cover.vertices["style"] = (8.0, 3.5, 0.0, 0.0)
    part = joined((around, cover))
    part.vertices["layer"] = given.seed % 1024
    return part


def _thinned(ring: tuple[tuple[float, float], ...]) -> npt.NDArray[np.float64]:
    points = oriented(ring)
    if len(points) <= CORNERS_MOST:
        return points
    return np.asarray(points[np.linspace(0, len(points), CORNERS_MOST, endpoint=False).astype(int)])


class _GroundRaster:
    """The map while it is painted: square roots of linear colours."""

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
