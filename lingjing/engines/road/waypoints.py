"""Where a route passes: points on its lanes at each turn and at most some 200 m apart, the last one its end.

A stretch between two turns is cut into equal parts of 220 m at most; a turn closer than 80 m to the point before is
left out, so that a route of 900 m has four or five points.
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
TURN_DEG = 40.0
_CLOSEST_M = 80.0


def waypoints(sim: Simulation, graph: Graph, way: DrivingWay, from_m: float, to_m: float) -> tuple[Vector, ...]:
    """The points of a way from a point on its first edge to one on its last; the start itself is none of them."""
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
"""A part of an edge: its id and the metres along it from where to where."""


def _stretches(graph: Graph, way: DrivingWay, from_m: float, to_m: float) -> list[Stretch]:
    last = len(way.edges) - 1
    return [
        (name, from_m if number == 0 else 0.0, to_m if number == last else graph.edges[name].length_m)
        for number, name in enumerate(way.edges)
    ]


def _turns(graph: Graph, stretches: Sequence[Stretch], ends: Sequence[float]) -> list[float]:
    """How far along the ends of those edges are that are left by a turn."""
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
