"""The delivery situation in an observation: stops with their demands, the depot, the vans."""

from __future__ import annotations

from dataclasses import dataclass

from lingjing.plugins.policy import EntityView, Observation
from lingjing_agents.ground_plane import GroundPoint

WANTED, LOADED = "demand", "load"
"""Names of stocks: the open demand of a stop and the load of a van, in kilograms."""


@dataclass(frozen=True, slots=True)
class DeliveryView:
    """The delivery situation at one boundary."""

    places: dict[str, GroundPoint]
    """Positions of the stops (east, north; m)."""
    demands_kg: dict[str, float]
    """Open demands of the stops."""
    depot: GroundPoint | None
    """Position of the depot; None if it is not visible."""
    vans: dict[str, EntityView]
    """The vans with a visible load."""


def look(observation: Observation) -> DeliveryView:
    """Classify the visible entities: with a demand a stop, with a load a van, the first other static one the depot."""
    places: dict[str, GroundPoint] = {}
    demands: dict[str, float] = {}
    vans: dict[str, EntityView] = {}
    depot: GroundPoint | None = None
    for view in observation.entities:
        if view.position is None:
            continue
        stocks = view.resources or {}
        if WANTED in stocks:
            places[view.id] = view.position[:2]
            demands[view.id] = stocks[WANTED]
        elif LOADED in stocks:
            vans[view.id] = view
        elif view.heading_deg is None and view.velocity is None and depot is None and not _moves(view, observation):
            depot = view.position[:2]
    return DeliveryView(places, demands, depot, vans)


def _moves(view: EntityView, observation: Observation) -> bool:
    """Return whether an entity is a van without visible load: of the same type as one with a visible load."""
    vans = {other.type for other in observation.entities if other.resources and LOADED in other.resources}
    return view.type in vans
