"""A lattice of places for pictures that covers the cells, equal for every agent that computes it.

A multirotor points its nose where it flies, and the picture's top with it, so a footprint lies across the course. Lanes
run east-west or north-south, whichever needs fewer pictures. `partition` assigns the cells: in a snake from the
south-west they are cut into runs of equal numbers of waypoints, one for each searcher in the common order.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from lingjing.plugins.policy import CameraSpec, Cell
from lingjing_agents.ground_plane import GroundRectangle


@dataclass(frozen=True, slots=True)
class PictureWaypoint:
    """A place for a picture."""

    x: float
    """East in metres."""
    y: float
    """North in metres."""
    height_m: float
    """Height above the water in metres."""
    cell: str
    """The name of its cell."""
    course_deg: float | None = None
    """The lane's axis in degrees, in either direction; None for any course."""
    size: tuple[float, float] = (0.0, 0.0)
    """Extent of the footprint (east, north) in metres."""


def footprint(camera: CameraSpec, height_m: float) -> tuple[float, float]:
    """Return width and height in metres of a nadir picture of flat water from `height_m` above it."""
    width = 2.0 * height_m * math.tan(math.radians(camera.hfov_deg) / 2.0)
    return width, width * camera.height / camera.width


def lattice(
    cells: tuple[Cell, ...], camera: CameraSpec, height_m: float, *, overlap: float = 0.03, crosswise: bool = False
) -> tuple[PictureWaypoint, ...]:
    """Return waypoints with footprints that cover the cells' bounding box, with at least `overlap` (0 to 1) between
    neighbours.

    With `crosswise` the lanes run in the other direction, which needs more pictures: the same height from other places.
    """
    if not cells:
        return ()
    across, along = footprint(camera, height_m)
    north_south = _lanes(cells, height_m, (across, along), 0.0, overlap)
    east_west = _lanes(cells, height_m, (along, across), 90.0, overlap)
    fewer, more = sorted((east_west, north_south), key=len)
    return more if crosswise else fewer


def _lanes(
    cells: tuple[Cell, ...], height_m: float, size: tuple[float, float], course_deg: float, overlap: float
) -> tuple[PictureWaypoint, ...]:
    whole = GroundRectangle.around([corner for cell in cells for corner in cell.polygon])
    xs = _stations(whole.west, whole.east, size[0], overlap)
    ys = _stations(whole.south, whole.north, size[1], overlap)
    return tuple(PictureWaypoint(x, y, height_m, _owner(cells, x, y), course_deg, size) for y in ys for x in xs)


def partition(cells: tuple[Cell, ...], plan: tuple[PictureWaypoint, ...], searchers: tuple[str, ...]) -> dict[str, str]:
    """Return the searcher of each cell: a snake of columns, cut into runs of about equal numbers of waypoints."""
    load = {cell.name: 0 for cell in cells}
    for waypoint in plan:
        load[waypoint.cell] += 1
    order = sorted(cells, key=lambda cell: (cell.column, cell.row if cell.column % 2 else -cell.row))
    total, done = sum(load.values()), 0
    owners: dict[str, str] = {}
    for cell in order:
        middle = done + load[cell.name] / 2
        index = min(len(searchers) - 1, int(middle / max(total, 1) * len(searchers)))
        owners[cell.name] = searchers[index]
        done += load[cell.name]
    return owners


def _stations(low: float, high: float, span: float, overlap: float) -> tuple[float, ...]:
    """Return the centres of the fewest equal spans that cover [low, high] with the overlap, evenly spaced."""
    count = max(1, math.ceil((high - low - span * overlap) / (span * (1.0 - overlap)) - 1e-9))
    if count == 1:
        return ((low + high) / 2,)
    first, last = low + span / 2, high - span / 2
    pitch = (last - first) / (count - 1)
    return tuple(first + pitch * index for index in range(count))


def _owner(cells: tuple[Cell, ...], x: float, y: float) -> str:
    return min(cells, key=lambda cell: (math.dist(cell.centre, (x, y)), cell.name)).name
