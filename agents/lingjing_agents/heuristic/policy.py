"""`heuristic`: selects the rules by an agent's abilities and follows them."""

from __future__ import annotations

from types import MappingProxyType

from msgspec.structs import replace

from lingjing.plugins.policy import NOTE, Brief, Decision, Inbox, Observation, Resource
from lingjing_agents.capability import exchanged, flying_camera, sends, vehicle, vessel
from lingjing_agents.errands import camera_body, wants_pictures
from lingjing_agents.heuristic.aerial_searcher import AerialSearcher
from lingjing_agents.heuristic.bridge_inspector import BridgeInspector
from lingjing_agents.heuristic.delivery_coordinator import DeliveryCoordinator
from lingjing_agents.heuristic.delivery_driver import DeliveryDriver
from lingjing_agents.heuristic.dogs.dog_rules import DogRules, walking_body
from lingjing_agents.heuristic.errand_rules import GoalFlyer, PictureTaker
from lingjing_agents.heuristic.guidance.to_leak import LeakGuidance
from lingjing_agents.heuristic.line_counter import LineCounter
from lingjing_agents.heuristic.rescuer import Rescuer
from lingjing_agents.heuristic.role_rules import RoleRules
from lingjing_agents.heuristic.route_coordinator import RouteCoordinator
from lingjing_agents.heuristic.route_driver import RouteDriver
from lingjing_agents.heuristic.route_inspector import RouteInspector
from lingjing_agents.heuristic.search_coordinator import SearchCoordinator
from lingjing_agents.heuristic.target_types import GAPS, Detectors, lack_of_detectors, on_pixels, target_type_of
from lingjing_agents.perception.learned.detector import learned_detectors

ROLE_RULES: tuple[type[RoleRules], ...] = (
    AerialSearcher,
    SearchCoordinator,
    Rescuer,
    BridgeInspector,
    RouteInspector,
    RouteCoordinator,
    RouteDriver,
    DeliveryDriver,
    DeliveryCoordinator,
    LineCounter,
    LeakGuidance,
    DogRules,
)
"""All rules of agents that exchange messages, each with its roles and message records. Agents with an errand have
`errand_rules`.
"""


class HeuristicPolicy:
    """The rule baseline. It needs no arguments and draws no random numbers.

    Classes in `detectors` are detected by these detectors, the others by the colour rules.
    """

    def __init__(self, detectors: Detectors = MappingProxyType({})) -> None:
        self._detectors, self._note = detectors, ""
        self._rules: RoleRules | None = None

    async def reset(self, brief: Brief) -> None:
        """Select the rules."""
        self._rules = rules_for(brief, self._detectors)
        self._note = lack_of_detectors(brief, self._detectors)

    async def act(self, observation: Observation, inbox: Inbox) -> Decision:
        """Return the decision of the rules, or a no-op without rules. The first one has a note on missing detectors."""
        decision = self._rules.act(observation, inbox) if self._rules is not None else Decision()
        if self._note and observation.tick == 0:
            return replace(decision, thought=f"{NOTE}{self._note}\n{decision.thought}".rstrip())
        return decision


def learned_policy() -> HeuristicPolicy:
    """Build `learned`: the same rules with the shipped trained detectors in place of colour rules."""
    return HeuristicPolicy({name: on_pixels(find) for name, find in learned_detectors().items()})


def rules_for(brief: Brief, detectors: Detectors = MappingProxyType({})) -> RoleRules | None:
    """Return the rules that fit an agent's abilities (flying, sailing, driving, walking, communication only), or
    None.
    """
    if wants_pictures(brief) and (body := camera_body(brief)) is not None:
        return PictureTaker(body)
    if (camera := flying_camera(brief)) is not None:
        return _flying(brief, camera, detectors)
    if (boat := vessel(brief)) is not None:
        return Rescuer(brief, boat)
    if (car := vehicle(brief)) is not None:
        return _driving(brief, car)
    if (dog := walking_body(brief)) is not None:
        return DogRules(brief, dog, detectors)
    return None if any(resource.embodied for resource in brief.resources) else _speaking(brief, detectors)


def _flying(brief: Brief, camera: Resource, detectors: Detectors) -> RoleRules:
    """Return the rules of an aircraft: search of cells, inspection of routes, counting, guidance, bridges, else a
    flight.
    """
    if brief.cells:
        return AerialSearcher(brief, camera, detectors)
    if exchanged(brief, "trafficJam"):
        return RouteInspector(brief, camera, detectors)
    if sends(brief, "count") is not None:
        return LineCounter(brief, camera)
    if sends(brief, "guidance") is not None:
        return LeakGuidance(brief, camera, detectors)
    if target_type_of(brief, (GAPS,)) is not None:
        return BridgeInspector(brief, camera, detectors)
    return GoalFlyer(brief, camera)


def _driving(brief: Brief, car: Resource) -> RoleRules:
    """Return the rules of a vehicle: deliveries, inspected routes, else drives to reported targets."""
    if exchanged(brief, "delivery"):
        return DeliveryDriver(brief, car)
    return RouteDriver(brief, car) if exchanged(brief, "trafficJam") else Rescuer(brief, car)


def _speaking(brief: Brief, detectors: Detectors) -> RoleRules:
    """Return the rules of an agent without a body: planning of tours, coordination of routes, or coordination of a
    search.
    """
    if sends(brief, "tour") is not None:
        return DeliveryCoordinator(brief)
    return RouteCoordinator(brief, detectors) if exchanged(brief, "trafficJam") else SearchCoordinator(brief)
