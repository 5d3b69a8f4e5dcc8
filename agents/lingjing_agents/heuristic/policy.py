"""`heuristic`: picks the rules by what the agent can do, then follows them."""

from __future__ import annotations

from typing import Protocol

from lingjing.plugins.policy import Brief, Decision, Inbox, Observation, Resource
from lingjing_agents.capability import exchanged, flying_camera, sends, vehicle, vessel
from lingjing_agents.heuristic.coordinator import Coordinator
from lingjing_agents.heuristic.counter import Counter
from lingjing_agents.heuristic.follower import Follower
from lingjing_agents.heuristic.guide.pilot import GuidingPilot
from lingjing_agents.heuristic.hauler import Hauler
from lingjing_agents.heuristic.kinds import GAPS, kind_of
from lingjing_agents.heuristic.planner import TourPlanner
from lingjing_agents.heuristic.rescuer import Rescuer
from lingjing_agents.heuristic.route_coordinator import RouteCoordinator
from lingjing_agents.heuristic.route_driver import RouteDriver
from lingjing_agents.heuristic.route_inspector import RouteInspector
from lingjing_agents.heuristic.searcher import Searcher
from lingjing_agents.heuristic.walker.rules import Walking, walker


class Rules(Protocol):
    """One role's rules: a pure function of what it has seen so far."""

    def act(self, observation: Observation, inbox: Inbox) -> Decision:
        """The decision for this boundary."""
        ...


class HeuristicPolicy:
    """The rule baseline. It needs no arguments and draws no random numbers."""

    def __init__(self) -> None:
        self._rules: Rules | None = None

    async def reset(self, brief: Brief) -> None:
        """Choose: who flies a camera over cells searches, who drives a vessel rescues, who has no body coordinates."""
        self._rules = rules_for(brief)

    async def act(self, observation: Observation, inbox: Inbox) -> Decision:
        """What the rules say; nothing for an agent no rule fits."""
        return self._rules.act(observation, inbox) if self._rules is not None else Decision()


def rules_for(brief: Brief) -> Rules | None:
    """The rules that fit an agent's abilities, or None: by whether it flies, sails, drives, walks or only speaks."""
    if (camera := flying_camera(brief)) is not None:
        return _flying(brief, camera)
    if (boat := vessel(brief)) is not None:
        return Rescuer(brief, boat)
    if (car := vehicle(brief)) is not None:
        return _driving(brief, car)
    if (dog := walker(brief)) is not None:
        return Walking(brief, dog)
    return None if any(resource.embodied for resource in brief.resources) else _speaking(brief)


def _flying(brief: Brief, camera: Resource) -> Rules | None:
    """Cells are searched, routes inspected, people counted, long things followed; who may guide somebody does so."""
    if brief.cells:
        return Searcher(brief, camera)
    if exchanged(brief, "trafficJam"):
        return RouteInspector(brief, camera)
    if sends(brief, "count") is not None:
        return Counter(brief, camera)
    if sends(brief, "guidance") is not None:
        return GuidingPilot(brief, camera)
    return Follower(brief, camera) if kind_of(brief, (GAPS,)) is not None else None


def _driving(brief: Brief, car: Resource) -> Rules:
    """Goods are hauled, inspected routes driven when told, and reported targets driven to."""
    if exchanged(brief, "delivery"):
        return Hauler(brief, car)
    return RouteDriver(brief, car) if exchanged(brief, "trafficJam") else Rescuer(brief, car)


def _speaking(brief: Brief) -> Rules:
    """Who has no body plans tours, has routes inspected, or coordinates a search."""
    if sends(brief, "tour") is not None:
        return TourPlanner(brief)
    return RouteCoordinator(brief) if exchanged(brief, "trafficJam") else Coordinator(brief)
