"""Errands of one body that need neither search nor speech: a picture, a flight to a place of its own.

The heuristic and the oracle follow the same ones: nothing of them is hidden.
"""

from __future__ import annotations

import math

from lingjing.plugins.policy import Action, Brief, EntityView, Observation, Resource
from lingjing_agents.capability import fly, has_verb, nadir_camera, photo, rated
from lingjing_agents.flight_levels import LAYER_M

PHOTOGRAPHED = "has taken a picture"
"""How a brief's rules word the function `photographed`."""

CRUISE_M = 30.0
"""Over the houses of the procedural districts that ask for no more than 18 m, with room for a roof."""

ARRIVED_M = 2.0
"""An aircraft stops as near as this to where it was sent."""

STEEP_M = 5.0
"""One that is this far under its flight level climbs before it goes anywhere."""


def wants_pictures(brief: Brief) -> bool:
    """True if the mission is won by pictures that bodies have taken."""
    return any(PHOTOGRAPHED in sentence for sentence in brief.rules)


def camera_body(brief: Brief) -> Resource | None:
    """The first embodied resource that takes pictures."""
    return next((one for one in brief.resources if one.embodied and one.cameras and has_verb(one, "takePhoto")), None)


def picture(body: Resource, observation: Observation) -> Action | None:
    """The command that takes a picture, straight down if the body can; None while one of it is among those seen."""
    if any(one.entity == body.id for one in observation.pictures):
        return None
    return photo(body, nadir_camera(body) or body.cameras[0])


def shown_place(brief: Brief, observation: Observation) -> EntityView | None:
    """The one thing with a place that the agent is shown and that is nobody's body; None if it is shown more."""
    bodies = {resource.id for resource in brief.resources}.union(*(peer.resources for peer in brief.peers))
    shown = [view for view in observation.entities if view.id not in bodies and view.position is not None]
    return shown[0] if len(shown) == 1 else None


def flight(brief: Brief, body: Resource, own: EntityView, place: EntityView) -> Action | None:
    """The next command of a flight to a place: up to a level of its own, then straight there; None once it is there."""
    if own.position is None or place.position is None or own.busy:
        return None
    (x, y, z), (east, north, up) = own.position, place.position
    if math.dist((x, y), (east, north)) <= ARRIVED_M:
        return None
    level = min(max(up, CRUISE_M) + LAYER_M * (brief.index - 1), rated(body, "band_high_m", math.inf))
    return fly(body, x, y, level) if z < level - STEEP_M else fly(body, east, north, level)
