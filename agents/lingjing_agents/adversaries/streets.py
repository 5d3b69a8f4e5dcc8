"""`StreetSweeper`: the adversary of deliveries that neither sends nor reads a message, and knows no stop.

Every van divides the public streets alike and drives over its share. It learns from public events alone what was
delivered, and sees the other vans. Where goods are delivered in passing, that is enough.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterable
from itertools import pairwise

from lingjing.plugins.policy import Brief, Decision, Inbox, Observation
from lingjing.plugins.roads import read_road_map
from lingjing_agents.adversaries.ids import FIRST_KG, OTHERS_KG
from lingjing_agents.capability import drive
from lingjing_agents.ground_plane import GroundPoint

CELL_M = 20.0
"""Side of the cells of a street, metres (chosen: a van reaches a stop within 30 m)."""
STEP_M = 10.0
"""Distance of the points of a street that are noted, metres (chosen)."""
BEYOND_M = 25.0
"""Distance beyond the region up to which streets count, metres (chosen)."""
NEAR_M, FAR_M = 25.0, 700.0
"""Shortest and longest leg, metres (chosen)."""
SPEED_MPS, START_S, TICK_S = 11.5, 3.0, 20.0
"""A van's speed on a street, the seconds of its start, and a tick of the mission (from its text)."""
OTHERS_SHARE = 0.3
"""Value of a cell in another van's share (chosen)."""
LOAD_KG = 200.0
"""A van's load (from the mission's text)."""

Cell = tuple[int, int]


class StreetSweeper:
    """Drives over all streets of the region."""

    async def reset(self, brief: Brief) -> None:
        """Divide the streets by their direction from the middle, equally among the vans."""
        self._van = next((resource for resource in brief.resources if resource.embodied), None)
        self._vans = sorted(
            {*(each.id for each in brief.resources), *(name for peer in brief.peers for name in peer.resources)}
        )
        self._streets = read_road_map(brief.road_network) if self._van and brief.road_network else None
        polygon = next((region.polygon for region in brief.regions if len(region.polygon) >= 3), ())
        self._cells: set[Cell] = set()
        self._ends: list[GroundPoint] = []
        if self._streets is not None and polygon:
            self._note_streets(polygon)
        ordered = sorted(self._cells, key=lambda cell: (math.atan2(cell[1], cell[0]), cell))
        self._share = {cell: self._vans[at * len(self._vans) // len(ordered)] for at, cell in enumerate(ordered)}
        stops = int(brief.settings.get("points", 20))
        self._demand = {f"point[{at}]": FIRST_KG if at == 1 else OTHERS_KG for at in range(1, stops + 1)}
        self._load = dict.fromkeys(self._vans, LOAD_KG)
        self._driven: set[Cell] = set()
        self._last: dict[str, GroundPoint] = {}

    async def act(self, observation: Observation, inbox: Inbox) -> Decision:
        """Return a drive along the streets with the most cells that no van has passed with a load."""
        if self._van is None or self._streets is None:
            return Decision()
        emptied = self._note_events(observation)
        for view in observation.entities:
            if view.position is not None and view.id in self._load:
                here = view.position[:2]
                if view.id in self._last and self._load[view.id] > 0.0 and view.id not in emptied:
                    self._driven |= self._passed(self._last[view.id], here)[0]
                self._last[view.id] = here
        own = next(view for view in observation.entities if view.id == self._van.id)
        if own.busy or own.position is None or not any(self._demand.values()):
            return Decision()
        if self._load[self._van.id] <= 0.0:
            depot = next((v.position[:2] for v in observation.entities if v.id == "depot" and v.position), (0.0, 0.0))
            return self._drive(depot)
        return self._drive(self._next(own.position[:2]))

    def _note_streets(self, polygon: Iterable[GroundPoint]) -> None:
        assert self._streets is not None
        xs, ys = zip(*polygon, strict=True)
        ends: defaultdict[str, list[GroundPoint]] = defaultdict(list)
        for street in self._streets.segments.values():
            first, last = street.shape[0], street.shape[-1]
            if street.id in self._streets.connected and all(
                min(xs) - BEYOND_M <= x <= max(xs) + BEYOND_M and min(ys) - BEYOND_M <= y <= max(ys) + BEYOND_M
                for x, y in (first, last)
            ):
                ends[street.start].append(first)
                ends[street.end].append(last)
                self._cells |= _cells(street.shape)
        self._ends = [(sum(x for x, _ in at) / len(at), sum(y for _, y in at) / len(at)) for at in ends.values()]

    def _note_events(self, observation: Observation) -> set[str]:
        """Note what public events say of loads and demands, and return the vans that are empty now."""
        emptied = set()
        for event in observation.events:
            van = next((name for name in event.entities if name in self._load), None)
            stop = next((name for name in event.entities if name in self._demand), None)
            if event.kind == "deliver" and van and stop:
                delivered_kg = min(self._load[van], self._demand[stop])
                self._load[van] -= delivered_kg
                self._demand[stop] -= delivered_kg
                if self._load[van] <= 0.0:
                    emptied.add(van)
            elif event.kind == "restock" and van:
                self._load[van] = LOAD_KG
            elif event.kind == "served" and stop:
                self._demand[stop] = 0.0
        return emptied

    def _passed(self, here: GroundPoint, there: GroundPoint) -> tuple[set[Cell], float]:
        """Return the cells beside the way between two places, and its length in metres."""
        assert self._streets is not None
        if math.dist(here, there) < 3.0:
            return self._beside(_cells((here, there))), 0.0
        way = self._streets.way(here, there)
        return (set(), math.inf) if way is None else (self._beside(_cells(way.points)), way.length_m)

    def _beside(self, cells: Iterable[Cell]) -> set[Cell]:
        return {(x + dx, y + dy) for x, y in cells for dx in (-1, 0, 1) for dy in (-1, 0, 1)} & self._cells

    def _next(self, here: GroundPoint) -> GroundPoint:
        """Return the crossing on the way to which most is new for each tick; else the nearest cell that is new."""
        assert self._van is not None
        if not self._cells - self._driven:
            self._driven = set()
        new = self._cells - self._driven
        mine = {cell for cell in new if self._share[cell] == self._van.id}
        best, goal = 0.0, here
        for end in self._ends:
            if NEAR_M <= math.dist(here, end) <= FAR_M:
                cells, length_m = self._passed(here, end)
                value = sum(1.0 if cell in mine else OTHERS_SHARE for cell in cells & new)
                ticks = math.ceil((length_m / SPEED_MPS + START_S) / TICK_S) if value else 1
                if value / ticks > best:
                    best, goal = value / ticks, end
        if best >= 2.0 or (best > 0.0 and not mine):
            return goal
        places = [(x * CELL_M, y * CELL_M) for x, y in mine or new]
        nearest = min(places, key=lambda place: (math.dist(here, place), place))
        crossing = min(self._ends, key=lambda end: math.dist(end, nearest))
        if math.dist(here, crossing) >= NEAR_M:
            return crossing
        if math.dist(here, nearest) < NEAR_M:
            self._driven |= self._beside([(round(nearest[0] / CELL_M), round(nearest[1] / CELL_M))])
        return nearest

    def _drive(self, place: GroundPoint) -> Decision:
        assert self._van is not None
        return Decision(command=drive(self._van, place))


def _cells(line: Iterable[GroundPoint]) -> set[Cell]:
    """Return the cells of a line."""
    cells: set[Cell] = set()
    for first, last in pairwise(line):
        parts = max(1, int(math.dist(first, last) / STEP_M))
        for part in range(parts + 1):
            x, y = (a + (b - a) * part / parts for a, b in zip(first, last, strict=True))
            cells.add((round(x / CELL_M), round(y / CELL_M)))
    return cells
