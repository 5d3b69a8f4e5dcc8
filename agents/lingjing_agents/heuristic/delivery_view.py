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
    """Positions of the stops (east, north; m); of some stops only the demand may be known."""
    demands_kg: dict[str, float]
    """Open demands of the stops; of some stops only the place may be known."""
    depot: GroundPoint | None
    """Position of the depot; None if it is not visible."""
    vans: dict[str, EntityView]
    """The vans with a visible load."""


def look(observation: Observation) -> DeliveryView:
    """Classify the visible entities: with a demand a stop, with a load a van.

    Of the other static ones the only one of its type is the depot, the others are stops without a visible demand.
    """
    places: dict[str, GroundPoint] = {}
    demands: dict[str, float] = {}
    vans: dict[str, EntityView] = {}
    static: list[EntityView] = []
    for view in observation.entities:
        stocks = view.resources or {}
        if WANTED in stocks:
            demands[view.id] = stocks[WANTED]
        if view.position is None:
            continue
        if WANTED in stocks:
            places[view.id] = view.position[:2]
        elif LOADED in stocks:
            vans[view.id] = view
        elif view.heading_deg is None and view.velocity is None and not _moves(view, observation):
            static.append(view)
    types = [view.type for view in static]
    depot = next((view for view in static if types.count(view.type) == 1), static[0] if static else None)
    stops = {view.id: view.position[:2] for view in static if view.position and depot and view.type != depot.type}
    return DeliveryView({**places, **stops}, demands, depot.position[:2] if depot and depot.position else None, vans)


def _moves(view: EntityView, observation: Observation) -> bool:
    """Return whether an entity is a van without visible load: of the same type as one with a visible load."""
    vans = {other.type for other in observation.entities if other.resources and LOADED in other.resources}
    return view.type in vans
