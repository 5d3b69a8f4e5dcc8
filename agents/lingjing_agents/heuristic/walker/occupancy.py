"""A walker's map: where it has bumped into something or seen a wall; everything else counts as free until proven not.

Routes are planned over what is known (A* on a grid) and planned anew at every step, so an unknown building is felt out
side by side: each bump closes a few metres, and the way around becomes the shortest.
"""

from __future__ import annotations

import heapq
import math
from dataclasses import dataclass, field

CELL_M = 1.5
SIDES = 5
NEAR_COST = 2.0
"""What a step beside something closed costs more, in cells: keeps the way off walls where there is room."""

MAX_EXPANSIONS = 60_000

Place = tuple[float, float]
Cell = tuple[int, int]

_STEPS = tuple((i, j, math.hypot(i, j)) for i in (-1, 0, 1) for j in (-1, 0, 1) if i or j)


@dataclass(frozen=True, slots=True)
class Bounds:
    """A rectangle in metres that routes do not leave."""

    west: float = -math.inf
    south: float = -math.inf
    east: float = math.inf
    north: float = math.inf

    @staticmethod
    def around(points: tuple[Place, ...], margin_m: float) -> Bounds:
        """The rectangle of `points`, grown by `margin_m` on each side; endless without points."""
        if not points:
            return Bounds()
        xs, ys = [x for x, _ in points], [y for _, y in points]
        return Bounds(min(xs) - margin_m, min(ys) - margin_m, max(xs) + margin_m, max(ys) + margin_m)

    def holds(self, place: Place) -> bool:
        """Whether a place lies inside, the rim included."""
        return self.west <= place[0] <= self.east and self.south <= place[1] <= self.north


@dataclass(slots=True)
class WalkMap:
    """What one walker knows of the ground. Cells are squares of `CELL_M` metres."""

    bounds: Bounds = field(default_factory=Bounds)
    closed: set[Cell] = field(default_factory=set)
    trodden: set[Cell] = field(default_factory=set)

    def reach(self, place: Place, margin_m: float) -> None:
        """Routes may go as far as a place and so much beyond."""
        own = self.bounds
        self.bounds = Bounds(
            min(own.west, place[0] - margin_m),
            min(own.south, place[1] - margin_m),
            max(own.east, place[0] + margin_m),
            max(own.north, place[1] + margin_m),
        )

    def tread(self, place: Place) -> None:
        """Somebody stands here, so it is free."""
        cell = _cell(place)
        self.trodden.add(cell)
        self.closed.discard(cell)

    def close(self, place: Place) -> None:
        """Something is in the way here; where somebody has walked stays free."""
        cell = _cell(place)
        if cell not in self.trodden:
            self.closed.add(cell)

    def wall(self, a: Place, b: Place) -> None:
        """Something long is in the way from one place to another; where somebody has walked stays free."""
        count = max(1, math.ceil(math.dist(a, b) / (CELL_M / 3)))
        for index in range(count + 1):
            share = index / count
            self.close((a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1])))

    def bump(self, here: Place, heading_deg: float, *, half_width_m: float = 2.4) -> None:
        """A walk along `heading_deg` ended here against something: close a short wall ahead, even where somebody has
        walked (whatever it is may have come since), but not the cell one stands in."""
        east, north = math.sin(math.radians(heading_deg)), math.cos(math.radians(heading_deg))
        start = _cell(here)
        for ahead in (CELL_M / 2, CELL_M, 1.5 * CELL_M):
            for index in range(-SIDES, SIDES + 1):
                side = half_width_m * index / SIDES
                if ahead < CELL_M and side != 0.0:
                    continue  # the flanks are free: it stands there
                cell = _cell((here[0] + ahead * east + side * north, here[1] + ahead * north - side * east))
                if cell != start:
                    self.trodden.discard(cell)
                    self.closed.add(cell)

    def forget(self) -> None:
        """All that is closed may be open again: what stood there may have gone."""
        self.closed.clear()

    def is_closed(self, place: Place) -> bool:
        """Whether something is known to be in the way at a place."""
        return _cell(place) in self.closed

    def clear(self, here: Place, there: Place) -> bool:
        """Whether nothing known is in the way of a straight walk."""
        length = math.dist(here, there)
        count = max(1, math.ceil(length / (CELL_M / 3)))
        start = _cell(here)
        for index in range(count + 1):
            share = index / count
            cell = _cell((here[0] + share * (there[0] - here[0]), here[1] + share * (there[1] - here[1])))
            if cell != start and cell in self.closed:
                return False
        return True

    def route(self, here: Place, goal: Place, *, reach_m: float = 0.0) -> tuple[Place, ...]:
        """Corners of the shortest known way to within `reach_m` of `goal`, without the start; empty if there is
        none or none is needed."""
        if math.dist(here, goal) <= reach_m:
            return ()
        if self.clear(here, goal):
            return (goal,)
        cells = self._search(_cell(here), goal, max(reach_m, CELL_M))
        places = [_centre(cell) for cell in cells]
        if places and math.dist(places[-1], goal) <= 2 * CELL_M and self.clear(places[-1], goal):
            places.append(goal)
        return self._pulled(here, places)

    def _search(self, start: Cell, goal: Place, reach_m: float) -> list[Cell]:
        gx, gy = goal[0] / CELL_M - 0.5, goal[1] / CELL_M - 0.5
        reach = reach_m / CELL_M
        best = {start: 0.0}
        came: dict[Cell, Cell] = {}
        queue = [(math.hypot(start[0] - gx, start[1] - gy), start)]
        done: set[Cell] = set()
        while queue and len(done) < MAX_EXPANSIONS:
            _, cell = heapq.heappop(queue)
            if cell in done:
                continue
            done.add(cell)
            if math.hypot(cell[0] - gx, cell[1] - gy) <= reach:
                return _traced(came, cell)
            for i, j, length in _STEPS:
                other = cell[0] + i, cell[1] + j
                if other in done or other in self.closed or not self.bounds.holds(_centre(other)):
                    continue
                if i and j and ((cell[0] + i, cell[1]) in self.closed or (cell[0], cell[1] + j) in self.closed):
                    continue
                cost = best[cell] + length + (NEAR_COST if self._beside(other) else 0.0)
                if cost < best.get(other, math.inf):
                    best[other], came[other] = cost, cell
                    heapq.heappush(queue, (cost + math.hypot(other[0] - gx, other[1] - gy), other))
        return []

    def _beside(self, cell: Cell) -> bool:
        i, j = cell
        closed = self.closed
        return bool(closed) and (
            (i + 1, j) in closed or (i - 1, j) in closed or (i, j + 1) in closed or (i, j - 1) in closed
        )

    def _pulled(self, here: Place, places: list[Place]) -> tuple[Place, ...]:
        """The corners that remain when the way is pulled tight."""
        corners: list[Place] = []
        at, index = here, 0
        while index < len(places):
            far = index
            while far + 1 < len(places) and self._roomy(at, places[far + 1]):
                far += 1
            corners.append(places[far])
            at, index = places[far], far + 1
        return tuple(corners)

    def _roomy(self, here: Place, there: Place) -> bool:
        """A straight walk with half a metre to spare on both sides."""
        length = math.dist(here, there)
        if length == 0.0:
            return True
        side = (there[1] - here[1]) / length * 0.6, -(there[0] - here[0]) / length * 0.6
        return all(
            self.clear((here[0] + k * side[0], here[1] + k * side[1]), (there[0] + k * side[0], there[1] + k * side[1]))
            for k in (-1.0, 1.0)
        )


def _cell(place: Place) -> Cell:
    return math.floor(place[0] / CELL_M), math.floor(place[1] / CELL_M)


def _centre(cell: Cell) -> Place:
    return (cell[0] + 0.5) * CELL_M, (cell[1] + 0.5) * CELL_M


def _traced(came: dict[Cell, Cell], cell: Cell) -> list[Cell]:
    way = [cell]
    while cell in came:
        cell = came[cell]
        way.append(cell)
    return way[-2::-1]
