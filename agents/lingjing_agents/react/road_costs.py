"""The table of road distances: metres of the shortest way between all places that an agent observes.

It is a part of the system text of agents that observe several fixed places without a commander, such as the points of a
delivery.
"""

from __future__ import annotations

from lingjing.plugins.policy import Brief, Observation, Vector
from lingjing.plugins.roads import RoadMap, read_road_map

LEAST_PLACES, MOST_PLACES = 3, 48
_ROUND_M = 10


def road_costs(brief: Brief, observation: Observation) -> dict[str, object] | None:
    """Return the table: its places, and a row of metres for each (from that place to all; None: no way).

    Returns None without roads, and where the agent observes too few or too many places.
    """
    places = _places(brief, observation)
    if not brief.road_network or not LEAST_PLACES <= len(places) <= MOST_PLACES:
        return None
    roads = read_road_map(brief.road_network)
    rows = [[_metres(roads, start, end) for end in places.values()] for start in places.values()]
    return {"places": list(places), "metres_from_row_to_column": rows}


def _places(brief: Brief, observation: Observation) -> dict[str, Vector]:
    moved = {name for peer in brief.peers for name in peer.resources} | {body.id for body in brief.resources}
    return {
        view.id: view.position
        for view in observation.entities
        if view.position is not None and view.id not in moved and not any(view.velocity or ())
    }


def _metres(roads: RoadMap, start: Vector, end: Vector) -> int | None:
    if start == end:
        return 0
    way = roads.way(start[:2], end[:2])
    return None if way is None else round(way.length_m / _ROUND_M) * _ROUND_M
