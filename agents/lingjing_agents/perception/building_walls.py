"""Buildings as pictures from above with depth show them: outlines, what colours their walls have and where doors are.

A wide picture from above sees the walls that look towards its middle. What is high and flat over a large rectangle is
a building; points between ground and roof along a side are that wall; a slab at a door's height in front of a wall is
the canopy over its entrance. The colours of a wall are compared with those of a reference picture as they are: the
same wall stands in the same light.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from lingjing.plugins.geometry import bearing_deg
from lingjing.plugins.policy import Picture
from lingjing_agents.ground_plane import GroundPoint, GroundRectangle
from lingjing_agents.perception.depth_points import heights
from lingjing_agents.perception.images import ByteImage, FloatArray, opencv

WallEnds = tuple[GroundPoint, GroundPoint]

STRIDE_PX = 2
CELL_M = 0.5
HIGH_M = 4.2
"""Whatever is higher and large is a building; below are cars, and crowns of trees are small."""

CROWN_CELLS = 11
LEAST_M, LEAST_FILL = 7.0, 0.8
"""A building's shorter side at least, and how much of its rectangle its outline fills."""

SKIRT_M, CORNICE_M, WALL_M = 1.0, 0.8, (-2.0, 0.6)
"""A wall's colours count from this high to this far below its top, between these distances outside the outline seen
from above: eaves reach beyond the wall."""

CANOPY_M, REACH_M, FLAT_M = (2.2, 4.0), (0.4, 2.4), 0.15
"""How high the slab over a door lies, between which distances from the wall, and how flat it is."""

LEAST_SAMPLES, MOSTLY = 30, 0.6
"""So many points make a slab, if they are this share of all that is seen above its place."""

AMONG = 8.0
"""So many points for each metre of its length make a wall's colours known."""

SHADES, BIN, SPAN = 4, 3.0, 81.0
"""A colour signature's steps of lightness, the width of its bins of hue and saturation, and how far these reach on both
axes (CIELAB a and b)."""

BLUR = 1.0
"""By how many bins the same wall may differ from afar."""


@dataclass(frozen=True, slots=True)
class ColourSpread:
    """How the colours of something are spread over lightness, hue and saturation; the weights' squares sum to one."""

    weights: FloatArray

    def likeness(self, other: ColourSpread) -> float:
        """1 for the same spread, 0 where nothing is shared (Bhattacharyya)."""
        return float((self.weights * other.weights).sum())


@dataclass(frozen=True, slots=True)
class BuildingWall:
    """One side of a building: its middle (east, north), the bearing it looks to (degrees), whether it is one of the
    two longer ones, its colours if enough of it was seen, and the place of its door, if one shows."""

    middle: GroundPoint
    bearing_deg: float
    long: bool
    colours: ColourSpread | None
    door: GroundPoint | None


@dataclass(frozen=True, slots=True)
class ColouredPoints:
    """The points (n, 3; east, north, metres over the ground) of one picture and their colours (n, 3; 0..255)."""

    points: FloatArray
    colours: ByteImage

    @staticmethod
    def of(picture: Picture, ground_m: float, bounds: GroundRectangle) -> ColouredPoints | None:
        """The points inside `bounds`; None for a picture without depth."""
        if picture.depth is None:
            return None
        points = heights(picture.depth, picture.pose, ground_m, STRIDE_PX)
        half = STRIDE_PX // 2
        rows = picture.rgb[half::STRIDE_PX, half::STRIDE_PX].reshape(-1, 3)
        if len(rows) != len(points):
            return None  # some depth is endless: the picture shows the horizon
        x, y = points[:, 0], points[:, 1]
        inside = (x > bounds.west) & (x < bounds.east) & (y > bounds.south) & (y < bounds.north)
        return ColouredPoints(points[inside], rows[inside])


def signature(pixels: ByteImage) -> ColourSpread:
    """The spread of colours of pixels (n, 3)."""
    cv2 = opencv()
    lab = cv2.cvtColor((pixels.astype(np.float32) / 255.0)[None], cv2.COLOR_RGB2LAB)[0]
    edges = np.linspace(-SPAN, SPAN, round(2 * SPAN / BIN) + 1)
    table, _ = np.histogramdd(lab, bins=(np.linspace(0.0, 100.0, SHADES + 1), edges, edges))
    smooth = np.stack([cv2.GaussianBlur(shade, (7, 7), BLUR) for shade in table])
    root: FloatArray = np.sqrt(smooth / max(float(smooth.sum()), 1e-9))
    return ColourSpread(root)


def reference_signature(rgb: ByteImage) -> ColourSpread:
    """The colours of what fills a reference picture's upper middle."""
    height, width = rgb.shape[:2]
    return signature(rgb[height // 4 : height * 5 // 8, width // 6 : width * 5 // 6].reshape(-1, 3))


def find_walls(views: tuple[ColouredPoints, ...], bounds: GroundRectangle) -> tuple[BuildingWall, ...]:
    """All sides of all buildings that the views show, in a fixed order."""
    found: list[BuildingWall] = []
    for corners, top in _buildings(views, bounds):
        for a, b in zip(corners, (*corners[1:], corners[0]), strict=True):
            found.append(_wall(views, (a, b), top, corners))
    return tuple(found)


def _buildings(
    views: tuple[ColouredPoints, ...], bounds: GroundRectangle
) -> list[tuple[tuple[GroundPoint, ...], float]]:
    """Corners (in turn) and height of every building."""
    cv2 = opencv()
    columns = math.ceil((bounds.east - bounds.west) / CELL_M)
    rows = math.ceil((bounds.north - bounds.south) / CELL_M)
    tops = np.zeros(rows * columns)
    for view in views:
        i = np.minimum(((view.points[:, 0] - bounds.west) / CELL_M).astype(np.int64), columns - 1)
        j = np.minimum(((view.points[:, 1] - bounds.south) / CELL_M).astype(np.int64), rows - 1)
        np.maximum.at(tops, j * columns + i, view.points[:, 2])
    high = (tops > HIGH_M).astype(np.uint8).reshape(rows, columns)
    high = cv2.morphologyEx(high, cv2.MORPH_CLOSE, np.ones((3, 3), np.uint8))
    high = cv2.morphologyEx(high, cv2.MORPH_OPEN, np.ones((CROWN_CELLS, CROWN_CELLS), np.uint8))
    count, labels = cv2.connectedComponents(high)
    found = []
    for label in range(1, count):
        cells = np.argwhere(labels == label)
        (x, y), (wide, deep), angle = cv2.minAreaRect(cells[:, ::-1].astype(np.float32))
        wide, deep = wide + 1.0, deep + 1.0  # from the middles of cells to their rims
        if min(wide, deep) * CELL_M < LEAST_M or len(cells) < LEAST_FILL * wide * deep:
            continue
        box = cv2.boxPoints(((x, y), (wide, deep), angle))
        corners = tuple((bounds.west + (u + 0.5) * CELL_M, bounds.south + (v + 0.5) * CELL_M) for u, v in box.tolist())
        found.append((corners, float(np.percentile(tops.reshape(rows, columns)[labels == label], 20))))
    return found


def _wall(
    views: tuple[ColouredPoints, ...], edge: WallEnds, top_m: float, corners: tuple[GroundPoint, ...]
) -> BuildingWall:
    (ax, ay), (bx, by) = edge
    middle = (ax + bx) / 2.0, (ay + by) / 2.0
    centre = sum(x for x, _ in corners) / 4.0, sum(y for _, y in corners) / 4.0
    length = math.dist(*edge)
    bearing = bearing_deg(centre, middle)
    out = math.sin(math.radians(bearing)), math.cos(math.radians(bearing))
    pixels: list[ByteImage] = []
    slabs: list[FloatArray] = []
    for view in views:
        x, y, z = view.points[:, 0] - middle[0], view.points[:, 1] - middle[1], view.points[:, 2]
        off, along = x * out[0] + y * out[1], x * out[1] - y * out[0]
        beside = np.abs(along) < length / 2.0 - 0.5
        wall = beside & (off > WALL_M[0]) & (off < WALL_M[1]) & (z > SKIRT_M) & (z < top_m - CORNICE_M)
        pixels.append(view.colours[wall])
        before = beside & (off > REACH_M[0]) & (off < REACH_M[1]) & (z > CANOPY_M[0])
        slabs.append(np.stack((along[before], z[before]), axis=1))
    seen = max(pixels, key=len)  # the view that shows the wall least aslant
    door = _door(np.concatenate(slabs), length)
    place = None if door is None else (middle[0] + door * out[1], middle[1] - door * out[0])
    deep = math.dist(centre, middle) * 2.0
    return BuildingWall(middle, bearing, length > deep, signature(seen) if len(seen) >= AMONG * length else None, place)


def _door(points: FloatArray, length: float) -> float | None:
    """Where along a wall a flat slab lies before it, from points (n, 2) of the place along and the height."""
    along, height = points[:, 0], points[:, 1]
    layers = round((CANOPY_M[1] - CANOPY_M[0]) / FLAT_M)
    span = (-length / 2.0, length / 2.0)
    counts, edges, _ = np.histogram2d(along, height, bins=(max(3, int(length)), layers), range=(span, CANOPY_M))
    several = counts[:-2] + counts[1:-1] + counts[2:]
    several = several[:, :-1] + several[:, 1:]  # a slab may lie on the line between two layers
    place, layer = np.unravel_index(int(np.argmax(several)), several.shape)
    beside = np.abs(along - (edges[place + 1] + edges[place + 2]) / 2.0) < 1.5
    if several[place, layer] < max(LEAST_SAMPLES, MOSTLY * int(beside.sum())):
        return None
    return float(np.median(along[beside]))
