"""Detours around road blocks, as successive places to drive to.

A vehicle follows its engine's route to a place, through any block on it. For inspected routes the engine plans another
route on request; for other vehicles this module plans the detour.
"""

from __future__ import annotations

import math

from lingjing.plugins.roads import RoadMap, RoadSegment, read_road_map
from lingjing_agents.ground_plane import GroundPoint
from lingjing_agents.oracle.privileged_state import PrivilegedState
from lingjing_agents.oracle.routes import jams

CLEAR_M = 3.0
"""Least distance in metres between a detour and the edge of a jam. Chosen: half a lane with a margin."""


def next_place(truth: PrivilegedState, vehicle: str, goal: GroundPoint) -> GroundPoint:
    """Return the goal, or the last place on the shortest open way to it that the vehicle's own route reaches unblocked.

    Also the goal if the vehicle's route is inspected by the mission, or if no way is open.
    """
    blocked = [(truth.place(jam.id), jam.blocked_m or 0.0) for jam in jams(truth)]
    inspected = any(spec.asset == vehicle for spec in truth.plan.instance.inspections)
    if not blocked or inspected or not truth.brief.road_network:
        return goal
    roads = read_road_map(truth.brief.road_network)
    here = truth.place(vehicle)
    shut = {each.id for each in roads.segments.values() if any(_passes(each, *jam) for jam in blocked)}
    last = roads.nearest(goal)
    shut.discard(last.segment if last else "")  # a jam on the goal's own segment may lie behind the goal
    if _is_open(roads, here, goal, shut):
        return goal
    way = RoadMap([each for each in roads.segments.values() if each.id not in shut]).way(here, goal)
    if way is None:
        return goal
    places = (_middle(roads.segments[name]) for name in reversed(way.segments[1:]))
    return next((place for place in places if _is_open(roads, here, place, shut)), goal)


def _is_open(roads: RoadMap, here: GroundPoint, there: GroundPoint, shut: set[str]) -> bool:
    way = roads.way(here, there)
    return way is not None and shut.isdisjoint(way.segments[1:])


def _passes(segment: RoadSegment, place: GroundPoint, radius_m: float) -> bool:
    """Return whether a vehicle on the segment comes near a jam."""
    return any(_off(a, b, place) <= radius_m + CLEAR_M for a, b in zip(segment.shape, segment.shape[1:], strict=False))


def _off(a: GroundPoint, b: GroundPoint, place: GroundPoint) -> float:
    """Return the distance in metres between a place and the segment between two points."""
    along = (b[0] - a[0], b[1] - a[1])
    length = math.hypot(*along)
    share = ((place[0] - a[0]) * along[0] + (place[1] - a[1]) * along[1]) / length**2 if length else 0.0
    share = min(1.0, max(0.0, share))
    return math.dist(place, (a[0] + share * along[0], a[1] + share * along[1]))


def _middle(segment: RoadSegment) -> GroundPoint:
    """Return the point half-way along a segment."""
    left = segment.length_m / 2.0
    for a, b in zip(segment.shape, segment.shape[1:], strict=False):
        step = math.dist(a, b)
        if step >= left > 0.0:
            return a[0] + (b[0] - a[0]) * left / step, a[1] + (b[1] - a[1]) * left / step
        left -= step
    return segment.shape[-1]
