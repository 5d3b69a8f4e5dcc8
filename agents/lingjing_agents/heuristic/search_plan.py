"""The shared plan of a team of searchers: the owner of each cell and the next place for a picture.

All searchers compute the same lattice and the same first partition without communication. With a hub, its assignments
replace the partition. A message `assignment(search, cell)` moves a cell to another searcher, `status(searched, cell)`
closes it. When all cells are searched, the next pass flies crosswise, for other waves and glints, then lower, where
people appear larger.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from lingjing.plugins.geometry import bearing_deg
from lingjing.plugins.policy import Brief, CameraSpec, Cell
from lingjing_agents.capability import team
from lingjing_agents.ground_plane import GroundPoint, GroundRectangle
from lingjing_agents.heuristic.picture_lattice import PictureWaypoint, lattice, partition
from lingjing_agents.perception.images import FloatArray, MaskArray

PASSES = ((1.0, False), (1.0, True), (0.7, False), (0.55, False))
"""Height of each pass as a share of the mission's altitude, and whether its lanes run crosswise; the last one
repeats.
"""
ALIGNED_DEG = 20.0
"""Largest deviation in degrees from a lane's axis for a picture. Chosen."""
TURN_M = 60.0
"""Cost of a turn into the lane, in metres of flight. Chosen."""
WORTH_GAIN = 0.12
"""Share of new ground in a footprint below which a waypoint is skipped. Chosen."""


SPACING_M = 12.0
"""Distance between sample points in metres. Chosen."""


class CoverageMap:
    """Counts the pictures of each sample point in the cells' bounding box."""

    def __init__(self, cells: tuple[Cell, ...]) -> None:
        corners = np.array([corner for cell in cells for corner in cell.polygon] or [(0.0, 0.0)])
        (west, south), (east, north) = corners.min(axis=0), corners.max(axis=0)
        xs = np.arange(west + SPACING_M / 2, east, SPACING_M)
        ys = np.arange(south + SPACING_M / 2, north, SPACING_M)
        self._points: FloatArray = np.stack(np.meshgrid(xs, ys), axis=-1).reshape(-1, 2)
        self._views = np.zeros(len(self._points), np.int64)

    def mark(self, polygon: tuple[GroundPoint, ...]) -> None:
        """Count one picture of all points in a convex polygon of either orientation (east, north; m)."""
        self._views[self._inside(np.array(polygon))] += 1

    def gain(self, x: float, y: float, size: tuple[float, float], looks: int) -> float:
        """Return the share (0 to 1) of a rectangle of `size` (east, north; m) with fewer than `looks` pictures."""
        near = np.abs(self._points - (x, y)) <= np.array(size) / 2
        inside = near[:, 0] & near[:, 1]
        total = int(inside.sum())
        return float((self._views[inside] < looks).sum()) / total if total else 0.0

    def _inside(self, polygon: FloatArray) -> MaskArray:
        edges = np.roll(polygon, -1, axis=0) - polygon
        offsets = self._points[:, None, :] - polygon[None, :, :]
        cross = edges[None, :, 0] * offsets[..., 1] - edges[None, :, 1] * offsets[..., 0]
        inside: MaskArray = np.all(cross >= 0, axis=1) | np.all(cross <= 0, axis=1)
        return inside


@dataclass(slots=True)
class SearchPlan:
    """The state of the search as one searcher knows it."""

    brief: Brief
    """The searcher's brief."""
    camera: CameraSpec
    """Its camera."""
    height_m: float
    """Height of the first pass above the water in metres."""
    lowest_m: float
    """Least height of later passes in metres."""
    overlap: float = 0.03
    """Overlap of neighbouring pictures, 0 to 1."""
    number: int = 0
    """Number of the pass, from 0."""
    plan: tuple[PictureWaypoint, ...] = ()
    """The open waypoints of all searchers."""
    owner: dict[str, str] = field(default_factory=dict)
    """The searcher of each cell."""
    open_cells: set[str] = field(default_factory=set)
    """Cells that are not searched yet in this pass."""
    map: CoverageMap = field(init=False)
    """The photographed ground."""

    def __post_init__(self) -> None:
        self.map = CoverageMap(self.brief.cells)
        self.plan = lattice(self.brief.cells, self.camera, self.height_m, overlap=self.overlap)
        self.owner = partition(self.brief.cells, self.plan, team(self.brief))
        self.open_cells = {cell.name for cell in self.brief.cells}

    def next_waypoint(self, here: GroundPoint) -> PictureWaypoint | None:
        """Return this searcher's nearest waypoint that would show new ground, or None. An approach along the lane saves
        a turn.
        """
        mine = [waypoint for waypoint in self.plan if self._is_mine(waypoint.cell)]
        worth = [waypoint for waypoint in mine if self._worth(waypoint)]
        return min(worth, key=lambda waypoint: _effort_m(here, waypoint), default=None)

    def drop(self, waypoint: PictureWaypoint) -> None:
        """Remove a waypoint that was photographed or cannot be reached."""
        self.plan = tuple(other for other in self.plan if other != waypoint)

    def finished_cells(self) -> tuple[str, ...]:
        """Close own cells that no open waypoint touches. Return those that have mostly been photographed.

        A cell that was taken over may have no waypoint of its own and is then closed without being returned.
        """
        left = [waypoint for waypoint in self.plan if self._is_mine(waypoint.cell) and self._worth(waypoint)]
        mine = [cell for cell in self.brief.cells if self._is_mine(cell.name)]
        done = [cell for cell in mine if not any(_touches(waypoint, cell) for waypoint in left)]
        self.open_cells.difference_update(cell.name for cell in done)
        return tuple(cell.name for cell in done if self._looked_at(cell))

    def claim(self) -> str | None:
        """Return a cell to take over from the team mate with the most open cells (at least two), or None."""
        left: dict[str, list[str]] = {}
        for cell in dict.fromkeys(waypoint.cell for waypoint in self.plan if self._worth(waypoint)):
            if cell in self.open_cells and self.owner[cell] != self.brief.agent:
                left.setdefault(self.owner[cell], []).append(cell)
        busiest = max(left.values(), key=len, default=[])
        return busiest[-1] if len(busiest) >= 2 else None

    def next_pass(self) -> None:
        """Start a new pass over the cells from other places."""
        self.number += 1
        share, crosswise = PASSES[min(self.number, len(PASSES) - 1)]
        height_m = max(self.height_m * share, self.lowest_m)
        self.plan = lattice(self.brief.cells, self.camera, height_m, overlap=self.overlap, crosswise=crosswise)
        self.owner = partition(self.brief.cells, self.plan, team(self.brief))
        self.open_cells = {cell.name for cell in self.brief.cells}

    def _is_mine(self, cell: str) -> bool:
        return cell in self.open_cells and self.owner.get(cell) == self.brief.agent

    def _looked_at(self, cell: Cell) -> bool:
        own = GroundRectangle.around(cell.polygon)
        middle = (own.west + own.east) / 2, (own.south + own.north) / 2
        return self.map.gain(*middle, (own.east - own.west, own.north - own.south), self.number + 1) < 0.5

    def _worth(self, waypoint: PictureWaypoint) -> bool:
        return self.map.gain(waypoint.x, waypoint.y, waypoint.size, self.number + 1) >= WORTH_GAIN


def _touches(waypoint: PictureWaypoint, cell: Cell) -> bool:
    own, wide, high = GroundRectangle.around(cell.polygon), waypoint.size[0] / 2, waypoint.size[1] / 2
    across = own.west < waypoint.x + wide and waypoint.x - wide < own.east
    return across and own.south < waypoint.y + high and waypoint.y - high < own.north


def off_course_deg(course_deg: float, heading_deg: float) -> float:
    """Return the deviation of a heading from a lane's axis, in either direction: 0 to 90 degrees."""
    off = abs(heading_deg - course_deg) % 180.0
    return min(off, 180.0 - off)


def _effort_m(here: GroundPoint, waypoint: PictureWaypoint) -> float:
    there = (waypoint.x, waypoint.y)
    turn = (
        waypoint.course_deg is not None and off_course_deg(waypoint.course_deg, bearing_deg(here, there)) > ALIGNED_DEG
    )
    return math.dist(here, there) + TURN_M * turn
