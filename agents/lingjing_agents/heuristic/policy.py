"""`heuristic`: picks the rules by what the agent can do, then follows them."""

from __future__ import annotations

from typing import Protocol

from lingjing.plugins.policy import Brief, Decision, Inbox, Observation
from lingjing_agents.capability import exchanged, flying_camera, sends, vehicle, vessel
from lingjing_agents.heuristic.coordinator import Coordinator
from lingjing_agents.heuristic.follower import Follower
from lingjing_agents.heuristic.guide_pilot import GuidingPilot
from lingjing_agents.heuristic.hauler import Hauler
from lingjing_agents.heuristic.kinds import GAPS, kind_of
from lingjing_agents.heuristic.planner import TourPlanner
from lingjing_agents.heuristic.rescuer import Rescuer
from lingjing_agents.heuristic.route_coordinator import RouteCoordinator
from lingjing_agents.heuristic.route_driver import RouteDriver
from lingjing_agents.heuristic.route_inspector import RouteInspector
from lingjing_agents.heuristic.searcher import Searcher
from lingjing_agents.heuristic.walk_rules import Walking, walker


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
    """The rules that fit an agent's abilities, or None."""
    camera, boat = flying_camera(brief), vessel(brief)
    if camera is not None and brief.cells:
        return Searcher(brief, camera)
    if exchanged(brief, "delivery"):
        if (van := vehicle(brief)) is not None:
            return Hauler(brief, van)
        if sends(brief, "tour") is not None:
            return TourPlanner(brief)
    if exchanged(brief, "trafficJam"):
        if camera is not None:
            return RouteInspector(brief, camera)
        if (van := vehicle(brief)) is not None:
            return RouteDriver(brief, van)
        if not any(resource.embodied for resource in brief.resources):
            return RouteCoordinator(brief)
    if camera is not None and sends(brief, "guidance") is None and kind_of(brief, (GAPS,)) is not None:
        return Follower(brief, camera)
    if camera is not None and sends(brief, "guidance") is not None:
        return GuidingPilot(brief, camera)
    if boat is not None:
        return Rescuer(brief, boat)
    if (truck := vehicle(brief)) is not None and brief.cells:
        return Rescuer(brief, truck)
    dog = walker(brief)
    if dog is not None:
        return Walking(brief, dog)
    if not any(resource.embodied for resource in brief.resources):
        return Coordinator(brief)
    return None
