"""Which cell is whose and where to take the next picture: the shared plan of a team of searchers.

All searchers compute the same lattice and the same first partition, so nothing has to be said to agree on it; under a
hub its assignments replace the partition. Messages `assignment(search, cell)` move a cell to another searcher and
`status(searched, cell)` closes it. When all is done the next pass flies
crosswise, for other waves and glints, then lower, where people are larger.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from lingjing.plugins.geometry import bearing_deg
from lingjing.plugins.policy import Brief, CameraSpec, Cell
from lingjing_agents.capability import team
from lingjing_agents.ground_plane import GroundPoint, GroundRectangle
from lingjing_agents.heuristic.coverage_map import CoverageMap
from lingjing_agents.heuristic.picture_lattice import PictureWaypoint, lattice, partition

PASSES = ((1.0, False), (1.0, True), (0.7, False), (0.55, False))
"""Height of each pass as a share of the mission's altitude, and whether lanes run crosswise; the last one repeats."""
ALIGNED_DEG = 20.0
TURN_M = 60.0
"""What a turn into the lane costs, in metres of flight."""
WORTH_GAIN = 0.12
"""A waypoint is skipped when less than this share of its footprint is new."""


@dataclass(slots=True)
class SearchPlan:
    """The state of the search as one searcher knows it."""

    brief: Brief
    camera: CameraSpec
    height_m: float
    lowest_m: float
    overlap: float = 0.03
    number: int = 0
    plan: tuple[PictureWaypoint, ...] = ()
    owner: dict[str, str] = field(default_factory=dict)
    open_cells: set[str] = field(default_factory=set)
    map: CoverageMap = field(init=False)

    def __post_init__(self) -> None:
        self.map = CoverageMap(self.brief.cells)
        self.plan = lattice(self.brief.cells, self.camera, self.height_m, overlap=self.overlap)
        self.owner = partition(self.brief.cells, self.plan, team(self.brief))
        self.open_cells = {cell.name for cell in self.brief.cells}

    def next_waypoint(self, here: GroundPoint) -> PictureWaypoint | None:
        """The quickest to reach of this searcher's waypoints that would still show something new.

        Coming along the lane saves a turn, which is worth a tick's flight."""
        mine = [waypoint for waypoint in self.plan if self._is_mine(waypoint.cell)]
        worth = [waypoint for waypoint in mine if self._worth(waypoint)]
        return min(worth, key=lambda waypoint: _effort_m(here, waypoint), default=None)

    def drop(self, waypoint: PictureWaypoint) -> None:
        """Never mind this waypoint any more: it has been photographed or cannot be reached."""
        self.plan = tuple(other for other in self.plan if other != waypoint)

    def finished_cells(self) -> tuple[str, ...]:
        """Own open cells that no picture still to be taken would touch; they count as searched from now on.

        Only those are told that have mostly been looked at: a cell taken over may have no waypoint of its own."""
        left = [waypoint for waypoint in self.plan if self._is_mine(waypoint.cell) and self._worth(waypoint)]
        mine = [cell for cell in self.brief.cells if self._is_mine(cell.name)]
        done = [cell for cell in mine if not any(_touches(waypoint, cell) for waypoint in left)]
        self.open_cells.difference_update(cell.name for cell in done)
        return tuple(cell.name for cell in done if self._looked_at(cell))

    def claim(self) -> str | None:
        """A cell to take over from the team mate with most left (at least two), or None."""
        left: dict[str, list[str]] = {}
        for cell in dict.fromkeys(waypoint.cell for waypoint in self.plan if self._worth(waypoint)):
            if cell in self.open_cells and self.owner[cell] != self.brief.agent:
                left.setdefault(self.owner[cell], []).append(cell)
        busiest = max(left.values(), key=len, default=[])
        return busiest[-1] if len(busiest) >= 2 else None

    def next_pass(self) -> None:
        """Look again at this searcher's share of the cells, from other places."""
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
    """How far a heading is from a lane's axis, either way along it: 0..90 degrees."""
    off = abs(heading_deg - course_deg) % 180.0
    return min(off, 180.0 - off)


def _effort_m(here: GroundPoint, waypoint: PictureWaypoint) -> float:
    there = (waypoint.x, waypoint.y)
    turn = (
        waypoint.course_deg is not None and off_course_deg(waypoint.course_deg, bearing_deg(here, there)) > ALIGNED_DEG
    )
    return math.dist(here, there) + TURN_M * turn
