"""Deliveries of goods, in loads that a vehicle holds.

The plan of `paths.delivery_tours` is computed once, from the first boundary. Every driver computes the same plan, so
drivers agree without a coordinator; with one they follow its tours. The ground truth shows deviations, such as a stop
that was served in passing.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from lingjing.plugins.policy import Action, Brief, Datum, Entity, Outgoing, Resource
from lingjing.plugins.tasks import Task, field_named
from lingjing_agents.ground_plane import GroundPoint
from lingjing_agents.oracle.ability import Ability
from lingjing_agents.oracle.aircraft import AircraftControl, flyer
from lingjing_agents.oracle.composing import MessageComposer
from lingjing_agents.oracle.privileged_state import InstanceIndex, PrivilegedState
from lingjing_agents.oracle.vehicles import mover
from lingjing_agents.paths.delivery_tours import DeliveryTour, shared_out, tours

MEANT_M = 50.0
"""Largest distance in metres between a destination and a place that it refers to in `assigned`. Chosen."""


@dataclass(frozen=True, slots=True)
class SupplyChain:
    """Deliveries and the supply that feeds them."""

    deliveries: tuple[Task, ...]
    """The deliveries."""
    supply: Task
    """The loading task."""
    bodies: tuple[Entity, ...]
    """The vehicles or aircraft."""
    holds: float
    """The smallest capacity of a body, in the unit of the goods."""


def supply_chain(plan: InstanceIndex) -> SupplyChain | None:
    """Return the deliveries that the mission requires with their supply, or None."""
    deliveries = tuple(task for task in plan.tasks if task.takes and task.source)
    for supply in plan.supplies:
        if deliveries and supply.gives == deliveries[0].source:
            bodies = plan.able(supply)
            holds = min((_limit(body, supply.up_to) for body in bodies), default=0.0)
            if holds > 0.0:
                return SupplyChain(deliveries, supply, bodies, holds)
    return None


def vehicle_tours(truth: PrivilegedState, chain: SupplyChain) -> dict[str, list[DeliveryTour]]:
    """Return the tours of each vehicle in order."""
    demands = {task.target: truth.stock(task.target, task.takes) for task in chain.deliveries}
    places = {name: truth.place(name) for name in demands}
    plan = tours(truth.place(chain.supply.target), places, demands, chain.holds)
    return shared_out(plan, tuple(body.id for body in chain.bodies))


class _DeliveryAbility(Ability):
    """Sends one vehicle or aircraft along its stops, and back to the depot when it is empty."""

    def __init__(
        self, body: Resource, chain: SupplyChain, composer: MessageComposer, aircraft: AircraftControl | None
    ) -> None:
        self._body, self._chain, self._composer, self._aircraft = body, chain, composer, aircraft
        self._stops: list[str] | None = None
        self._meant: tuple[int, tuple[GroundPoint, ...]] = (0, ())
        self._before: dict[str, float] = {}
        self._load = 0.0
        self._tries: dict[str, int] = {}

    def say(self, truth: PrivilegedState) -> list[Outgoing]:
        """Return reports of deliveries since the last boundary, and the planned stops once they are known."""
        messages = self._hand_over(truth)
        if self._learn(truth):
            for stop in dict.fromkeys(self._stops or ()):
                place = truth.states[stop].position
                self._mean(truth, place[:2])
                messages += self._composer.order(truth.brief.agent, "deliver", {"position": place})
        return messages

    def act(self, truth: PrivilegedState) -> Action | None:
        """Return the command to the next stop or back to the depot."""
        if truth.busy(self._body.id):
            return None
        if self._stops is None:
            return None
        goal = self._next(truth)
        load = truth.stock(self._body.id, self._chain.supply.gives)
        if not goal and not self._is_due_to_load(truth, load):
            return None
        if not goal or load <= 0.0 or self._short(truth, goal, load):
            goal = self._chain.supply.target
        self.aim = goal
        reach = self._chain.supply.within_m if goal == self._chain.supply.target else self._chain.deliveries[0].within_m
        if truth.distance(self._body.id, goal) <= 0.8 * reach:
            return None
        x, y = self._near(truth, goal)
        self._mean(truth, (x, y))
        if self._aircraft is not None:
            height = truth.states[goal].position[2]
            return self._aircraft.to(truth, x, y, self._aircraft.altitude(truth, (x, y), height))
        arguments: dict[str, Datum] = {"x": x, "y": y}
        return Action(verb=mover(self._body), arguments=arguments, resource=self._body.id)

    def _is_due_to_load(self, truth: PrivilegedState, load: float) -> bool:
        """Return whether the body was assigned a destination that also refers to the depot, and is not full.

        This happens for a stop beside the depot. An assignment there keeps a loading pending until the body is full.
        """
        depot = truth.place(self._chain.supply.target)
        return load < self._chain.holds and any(math.dist(place, depot) <= MEANT_M for place in self._meant[1])

    def _mean(self, truth: PrivilegedState, place: GroundPoint) -> None:
        """Store a destination that is announced or commanded. Those of one boundary count together until later ones."""
        kept = self._meant[1] if self._meant[0] == truth.tick else ()
        self._meant = truth.tick, (*kept, place)

    def _near(self, truth: PrivilegedState, goal: str) -> GroundPoint:
        """Return the goal, or a place beside it after two failed attempts."""
        tries = self._tries[goal] = self._tries.get(goal, 0) + 1
        x, y = truth.place(goal)
        if tries % 4 < 3:
            return x, y
        angle = math.radians(90.0 * (tries // 4))
        return x + 12.0 * math.sin(angle), y + 12.0 * math.cos(angle)

    def _short(self, truth: PrivilegedState, goal: str, load: float) -> bool:
        """Return whether the stop would be served in part although a full load would suffice."""
        if not goal:
            return False
        wanted = min(truth.stock(goal, self._chain.deliveries[0].takes), self._chain.holds)
        return load < wanted

    def _next(self, truth: PrivilegedState) -> str:
        """Return the first own stop with an open demand, else the nearest stop with one; "" without any."""
        open_now = self._open(truth)
        for name in self._stops or ():
            if name in open_now:
                return name
        if self._stops is None or not open_now:
            return ""
        return min(open_now, key=lambda name: (truth.distance(self._body.id, name), name))

    def _open(self, truth: PrivilegedState) -> tuple[str, ...]:
        return tuple(task.target for task in truth.left if task in self._chain.deliveries)

    def _learn(self, truth: PrivilegedState) -> bool:
        """Read the coordinator's latest tour, or compute the common plan without a coordinator. Return whether it
        changed.
        """
        before = self._stops
        for message in truth.inbox.messages:
            stops, assignee = message.body.get("stops"), message.body.get("assignee")
            if isinstance(stops, tuple | list) and assignee in (truth.brief.agent, self._body.id):
                self._stops = [str(name) for name in stops]
        if self._stops is None and truth.brief.hub is None:
            self._stops = [name for tour in vehicle_tours(truth, self._chain)[self._body.id] for name in tour.stops]
        return self._stops != before

    def _hand_over(self, truth: PrivilegedState) -> list[Outgoing]:
        messages: list[Outgoing] = []
        load = truth.stock(self._body.id, self._chain.supply.gives)
        message = self._composer.with_fields("stop", "delivered")
        for task in self._chain.deliveries:
            wants = truth.stock(task.target, task.takes)
            delivered = self._before.get(task.target, wants) - wants
            near = truth.distance(self._body.id, task.target) <= 200.0
            if message is not None and delivered > 0.0 and near and load < self._load:
                body: dict[str, Datum] = {"stop": task.target, "delivered": delivered, "left": wants}
                messages += self._composer.say(message.kind, body)
            self._before[task.target] = wants
        self._load = load
        return messages


class _DispatchAbility(Ability):
    """The coordinator without a vehicle: sends a tour to each driver."""

    def __init__(self, chain: SupplyChain, plan: InstanceIndex, composer: MessageComposer, kind: str) -> None:
        self._chain, self._plan, self._composer, self._kind = chain, plan, composer, kind
        self._sent = False

    def say(self, truth: PrivilegedState) -> list[Outgoing]:
        """Return the tours, once at the start."""
        if self._sent:
            return []
        self._sent = True
        messages: list[Outgoing] = []
        for body, plan in vehicle_tours(truth, self._chain).items():
            owner = self._plan.owners[body].id
            stops = tuple(name for tour in plan for name in tour.stops)
            first = plan[0].load if plan else 0.0
            content: dict[str, Datum] = {"assignee": owner, "stops": stops, "load": first}
            messages += self._composer.say(self._kind, content, (owner,))
        return messages


def delivery_abilities(brief: Brief, plan: InstanceIndex, composer: MessageComposer) -> list[Ability]:
    """Return the abilities of drivers of goods and of the coordinator that sends tours."""
    chain = supply_chain(plan)
    if chain is None:
        return []
    carriers = {body.id for body in chain.bodies}
    own = [resource for resource in brief.resources if resource.embodied and resource.id in carriers]
    aircraft = flyer(brief)
    abilities: list[Ability] = [
        _DeliveryAbility(resource, chain, composer, AircraftControl(resource, plan) if resource == aircraft else None)
        for resource in own
    ]
    message = composer.with_fields("assignee", "stops")
    if not brief.resources and message is not None:
        abilities.append(_DispatchAbility(chain, plan, composer, message.kind))
    return abilities


def _limit(body: Entity, name: str) -> float:
    """Return the capacity of a body; 0 if it declares none."""
    field = field_named(name, body.properties)
    return 0.0 if field is None else body.number_or(field, 0.0)
