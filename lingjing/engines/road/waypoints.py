"""Points on a route: at each turn and at most about 200 m apart; the last one is its end.

A stretch between two turns is divided into equal parts of at most 220 m. A turn less than 80 m after the point before
is left out. A route of 900 m thus has four or five points.
"""

from __future__ import annotations

import bisect
import itertools
import math
from collections.abc import Sequence

from lingjing.engines.road.graph import Graph
from lingjing.engines.road.routing import DrivingWay
from lingjing.engines.road.simulation import Simulation
from lingjing.mission.instance import Vector
from lingjing.scene.camera_geometry import bearing_deg, turn_deg

SPACING_M = 220.0
"""Largest distance between two points, metres (chosen)."""

TURN_DEG = 40.0
"""Change of heading from which a turn has a point, degrees (chosen)."""

_CLOSEST_M = 80.0
"""Least distance between a turn's point and its neighbours, metres (chosen)."""


def waypoints(sim: Simulation, graph: Graph, way: DrivingWay, from_m: float, to_m: float) -> tuple[Vector, ...]:
    """Return the points of a way from a point on its first edge to one on its last; the start is left out."""
    stretches = _stretches(graph, way, from_m, to_m)
    ends = tuple(itertools.accumulate(upper - lower for _, lower, upper in stretches))
    stops: list[float] = []
    before = 0.0
    for mark in (*_turns(graph, stretches, ends), ends[-1]):
        if mark < ends[-1] and (mark - before < _CLOSEST_M or ends[-1] - mark < _CLOSEST_M):
            continue
        parts = max(1, math.ceil((mark - before) / SPACING_M))
        stops += [before + (mark - before) * part / parts for part in range(1, parts + 1)]
        before = mark
    return tuple(_at(sim, graph, stretches, ends, stop) for stop in stops)


Stretch = tuple[str, float, float]
"""A part of an edge: its id, and the metres along it at which the part begins and ends."""


def _stretches(graph: Graph, way: DrivingWay, from_m: float, to_m: float) -> list[Stretch]:
    last = len(way.edges) - 1
    return [
        (name, from_m if number == 0 else 0.0, to_m if number == last else graph.edges[name].length_m)
        for number, name in enumerate(way.edges)
    ]


def _turns(graph: Graph, stretches: Sequence[Stretch], ends: Sequence[float]) -> list[float]:
    """Return the distances along the way of the edges' ends at which it turns, metres."""
    marks = []
    for (name, _, _), (following, _, _), end in zip(stretches, stretches[1:], ends, strict=False):
        leaving, entering = graph.edges[name].lanes[0].shape, graph.edges[following].lanes[0].shape
        if abs(turn_deg(bearing_deg(*entering[:2]), bearing_deg(*leaving[-2:]))) > TURN_DEG:
            marks.append(end)
    return marks


def _at(sim: Simulation, graph: Graph, stretches: Sequence[Stretch], ends: Sequence[float], along_m: float) -> Vector:
    number = min(bisect.bisect_left(ends, along_m - 1e-6), len(stretches) - 1)
    name, _, upper = stretches[number]
    lane = graph.edges[name].lanes[0]
    position = min(max(upper - (ends[number] - along_m), 0.0), lane.length_m)
    x, y, z = sim.simulation.convert3D(name, position, lane.index)
    return (x, y, z)
