"""Buildings in pictures from above with depth: outlines, wall colours, and doors.

A wide picture from above shows the walls that face its centre. A high flat region that fills a large rectangle is a
building. Points between ground and roof along a side belong to that wall. A slab at door height in front of a wall is
the canopy over its entrance. Wall colours are compared with those of a reference picture without correction, since the
same wall has the same light.
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
"""The two ends of a wall."""

STRIDE_PX = 2
"""Sampling interval of pixels. Chosen."""
CELL_M = 0.5
"""Side of a grid cell in metres. Chosen."""
HIGH_M = 4.2
"""Height in metres above which large objects are buildings. Cars are lower, and crowns of trees are smaller. Chosen."""

CROWN_CELLS = 11
"""Size in cells of the opening that removes crowns of trees."""
LEAST_M, LEAST_FILL = 7.0, 0.8
"""Least length in metres of a building's shorter side, and least share of its rectangle that its outline fills. Chosen.
"""

SKIRT_M, CORNICE_M, WALL_M = 1.0, 0.8, (-2.0, 0.6)
"""Height range of a wall's colours, in metres above the ground and below the top, and their range of distances from the
outline. Eaves extend beyond the wall, so the range includes the inside.
"""

CANOPY_M, REACH_M, FLAT_M = (2.2, 4.0), (0.4, 2.4), 0.15
"""Height range of a canopy, its range of distances from the wall, and its thickness, in metres."""

LEAST_SAMPLES, MOSTLY = 30, 0.6
"""Least number of points of a canopy, and their least share of all points at its place. Chosen."""

AMONG = 8.0
"""Least number of points per metre of a wall for reliable colours. Chosen."""

SHADES, BIN, SPAN = 4, 3.0, 81.0
"""Bins of a colour signature: lightness bins, bin width and range of both colour axes (CIELAB a and b). Chosen."""

BLUR = 1.0
"""Standard deviation in bins of the smoothing of a colour signature, for differences with distance."""


@dataclass(frozen=True, slots=True)
class ColourSpread:
    """A colour signature: a histogram over lightness and both colour axes. The squares of the weights sum to one."""

    weights: FloatArray
    """(lightness, a, b), the square roots of the shares."""

    def likeness(self, other: ColourSpread) -> float:
        """Return the similarity, 1 for equal signatures and 0 for disjoint ones (Bhattacharyya coefficient)."""
        return float((self.weights * other.weights).sum())


@dataclass(frozen=True, slots=True)
class BuildingWall:
    """One side of a building."""

    middle: GroundPoint
    """East and north of its centre in metres."""
    bearing_deg: float
    """The bearing of its outer normal in degrees."""
    long: bool
    """True for the two longer sides."""
    colours: ColourSpread | None
    """Its signature; None if too little of it was visible."""
    door: GroundPoint | None
    """East and north of its door; None without a visible one."""


@dataclass(frozen=True, slots=True)
class ColouredPoints:
    """The points of one picture with their colours."""

    points: FloatArray
    """(n, 3): east, north, height above the ground, in metres."""
    colours: ByteImage
    """(n, 3): red, green, blue, 0 to 255."""
    over: GroundPoint
    """The place below the camera."""

    @staticmethod
    def of(picture: Picture, ground_m: float, bounds: GroundRectangle) -> ColouredPoints | None:
        """Return the points inside `bounds`; None for a picture without depth or with the horizon."""
        if picture.depth is None:
            return None
        points = heights(picture.depth, picture.pose, ground_m, STRIDE_PX)
        half = STRIDE_PX // 2
        rows = picture.rgb[half::STRIDE_PX, half::STRIDE_PX].reshape(-1, 3)
        if len(rows) != len(points):
            return None  # some depth is infinite: the picture shows the horizon
        x, y = points[:, 0], points[:, 1]
        inside = (x > bounds.west) & (x < bounds.east) & (y > bounds.south) & (y < bounds.north)
        return ColouredPoints(points[inside], rows[inside], picture.pose.position[:2])


def signature(pixels: ByteImage) -> ColourSpread:
    """Return the signature of pixels (n, 3)."""
    cv2 = opencv()
    lab = cv2.cvtColor((pixels.astype(np.float32) / 255.0)[None], cv2.COLOR_RGB2LAB)[0]
    edges = np.linspace(-SPAN, SPAN, round(2 * SPAN / BIN) + 1)
    table, _ = np.histogramdd(lab, bins=(np.linspace(0.0, 100.0, SHADES + 1), edges, edges))
    smooth = np.stack([cv2.GaussianBlur(shade, (7, 7), BLUR) for shade in table])
    root: FloatArray = np.sqrt(smooth / max(float(smooth.sum()), 1e-9))
    return ColourSpread(root)


def reference_signature(rgb: ByteImage) -> ColourSpread:
    """Return the signature of the object in a reference picture's upper centre."""
    height, width = rgb.shape[:2]
    return signature(rgb[height // 4 : height * 5 // 8, width // 6 : width * 5 // 6].reshape(-1, 3))


def find_walls(views: tuple[ColouredPoints, ...], bounds: GroundRectangle) -> tuple[BuildingWall, ...]:
    """Return all sides of all buildings in the views, in a fixed order."""
    walls: list[BuildingWall] = []
    for corners, top in _buildings(views, bounds):
        for a, b in zip(corners, (*corners[1:], corners[0]), strict=True):
            walls.append(_wall(views, (a, b), top, corners))
    return tuple(walls)


def _buildings(
    views: tuple[ColouredPoints, ...], bounds: GroundRectangle
) -> list[tuple[tuple[GroundPoint, ...], float]]:
    """Return the corners (in order) and the height in metres of every building."""
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
    buildings = []
    for label in range(1, count):
        cells = np.argwhere(labels == label)
        (x, y), (wide, deep), angle = cv2.minAreaRect(cells[:, ::-1].astype(np.float32))
        wide, deep = wide + 1.0, deep + 1.0  # the rectangle joins centres of cells; extend it to their edges
        if min(wide, deep) * CELL_M < LEAST_M or len(cells) < LEAST_FILL * wide * deep:
            continue
        box = cv2.boxPoints(((x, y), (wide, deep), angle))
        corners = tuple((bounds.west + (u + 0.5) * CELL_M, bounds.south + (v + 0.5) * CELL_M) for u, v in box.tolist())
        buildings.append((corners, float(np.percentile(tops.reshape(rows, columns)[labels == label], 20))))
    return buildings


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
    seen = max(pixels, key=len)  # the view with the most direct sight of the wall
    door = _door(np.concatenate(slabs), length)
    place = None if door is None else (middle[0] + door * out[1], middle[1] - door * out[0])
    deep = math.dist(centre, middle) * 2.0
    return BuildingWall(middle, bearing, length > deep, signature(seen) if len(seen) >= AMONG * length else None, place)


def _door(points: FloatArray, length: float) -> float | None:
    """Return the position of a canopy along a wall, from points (n, 2) of position along the wall and height, or
    None.
    """
    along, height = points[:, 0], points[:, 1]
    layers = round((CANOPY_M[1] - CANOPY_M[0]) / FLAT_M)
    span = (-length / 2.0, length / 2.0)
    counts, edges, _ = np.histogram2d(along, height, bins=(max(3, int(length)), layers), range=(span, CANOPY_M))
    several = counts[:-2] + counts[1:-1] + counts[2:]
    several = several[:, :-1] + several[:, 1:]  # a canopy may cross the border of two layers
    place, layer = np.unravel_index(int(np.argmax(several)), several.shape)
    beside = np.abs(along - (edges[place + 1] + edges[place + 2]) / 2.0) < 1.5
    if several[place, layer] < max(LEAST_SAMPLES, MOSTLY * int(beside.sum())):
        return None
    return float(np.median(along[beside]))
