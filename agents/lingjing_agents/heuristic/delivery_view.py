"""What a driver or planner of deliveries sees of the town: stops with what they want, the depot, the vans."""

from __future__ import annotations

from dataclasses import dataclass

from lingjing.plugins.policy import EntityView, Observation
from lingjing_agents.ground_plane import GroundPoint

WANTED, LOADED = "demand", "load"
"""Stocks: what a stop still wants and what a van carries (kg)."""


@dataclass(frozen=True, slots=True)
class DeliveryView:
    """One boundary's view. `vans` are those that show their load."""

    places: dict[str, GroundPoint]
    demands_kg: dict[str, float]
    depot: GroundPoint | None
    vans: dict[str, EntityView]


def look(observation: Observation) -> DeliveryView:
    """Sort what is seen: who wants something is a stop, who carries something a van, the rest that stands a depot."""
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
    """Whether it is one of the vans whose load is not shown: of the same type as one that shows it."""
    vans = {other.type for other in observation.entities if other.resources and LOADED in other.resources}
    return view.type in vans
