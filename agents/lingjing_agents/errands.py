"""Errands: tasks of a single body without search or communication, such as a picture or a flight to a given place.

The heuristic and the oracle share them, because they need no hidden information.
"""

from __future__ import annotations

import math

from lingjing.plugins.policy import Action, Brief, EntityView, Observation, Resource
from lingjing_agents.capability import fly, has_verb, nadir_camera, photo, rated
from lingjing_agents.flight_levels import LAYER_M

PHOTOGRAPHED = "has taken a picture"
"""The words of the function `photographed` in a brief's rules."""

CRUISE_M = 30.0
"""Flight level in metres above the datum. Chosen: above the houses of procedural districts, which reach 18 m, with room
for a roof.
"""

ARRIVED_M = 2.0
"""Distance in metres at which an aircraft counts as arrived. Aircraft stop at least this near to their destination."""

STEEP_M = 5.0
"""Height difference in metres to the flight level from which on an aircraft climbs before it moves horizontally.
Chosen.
"""


def wants_pictures(brief: Brief) -> bool:
    """Return whether pictures taken by bodies win the mission."""
    return any(PHOTOGRAPHED in sentence for sentence in brief.rules)


def camera_body(brief: Brief) -> Resource | None:
    """Return the first embodied resource that takes pictures."""
    able = (body for body in brief.resources if body.embodied and body.cameras and has_verb(body, "takePhoto"))
    return next(able, None)


def picture(body: Resource, observation: Observation) -> Action | None:
    """Return the command that takes a picture, downward if possible; None if the observation shows one of this body
    already.
    """
    if any(shown.entity == body.id for shown in observation.pictures):
        return None
    return photo(body, nadir_camera(body) or body.cameras[0])


def shown_place(brief: Brief, observation: Observation) -> EntityView | None:
    """Return the only observed entity with a position that is no agent's body; None if there are several."""
    bodies = {resource.id for resource in brief.resources}.union(*(peer.resources for peer in brief.peers))
    shown = [view for view in observation.entities if view.id not in bodies and view.position is not None]
    return shown[0] if len(shown) == 1 else None


def flight(brief: Brief, body: Resource, own: EntityView, place: EntityView) -> Action | None:
    """Return the next command of a flight: up to the aircraft's own level, then straight to the place; None on
    arrival.
    """
    if own.position is None or place.position is None or own.busy:
        return None
    (x, y, z), (east, north, up) = own.position, place.position
    if math.dist((x, y), (east, north)) <= ARRIVED_M:
        return None
    level = min(max(up, CRUISE_M) + LAYER_M * (brief.index - 1), rated(body, "band_high_m", math.inf))
    return fly(body, x, y, level) if z < level - STEEP_M else fly(body, east, north, level)
