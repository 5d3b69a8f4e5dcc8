"""ValidateAndResolve: candidate commands become at most one admitted command per resource; the others receive
rejections.

The checks, in the order of the collected policy outputs: unknown agent, stale tick, authority, action space, argument
schema, a place outside the world, busy resource, conflict, permit, counted budget. Arguments beyond their bounds are
clipped, and the admission receipt lists the changes. Bounds come from the mission's declarations, the altitude band and
the limits of the resource's engine (`command_limits`). `stop` pre-empts a pending request and needs no permit; every
other command is rejected until the pending request has completed. Engines reject commands to dead entities. Pictures do
not pass through the motion engines, so those of dead entities are rejected here.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import msgspec
from msgspec import field

from lingjing.kernel.admission import arguments_check
from lingjing.kernel.budgets import LIMIT, Tally
from lingjing.kernel.command_limits import CommandLimits
from lingjing.kernel.context import RuntimeContext
from lingjing.kernel.registry import Registry
from lingjing.kernel.rules import holds
from lingjing.mission.instance import AgentSpec, Datum, Entity, Instance
from lingjing.mission.vocabulary import PHOTO, STOP
from lingjing.scene.city import City
from lingjing.trace.records import DEAD, Action, Command, Receipt
from lingjing.trace.request_ids import request_id

MARGIN_M = 1_000.0
"""Distance in metres by which a destination may lie outside the city's bounds. Chosen: generous for flights around the
city, and still far below errors of unit or grid, which `_place_fault` detects.
"""

BLIND = ("out_of_view", "below_horizon")
"""The status words of a satellite that does not see its region."""


class Rejection(msgspec.Struct, frozen=True):
    """The rejection of a candidate."""

    reason: str
    """A stable reason code."""
    detail: str
    """The description for the receipt."""


class Resolution(msgspec.Struct, frozen=True):
    """The result of validation."""

    commands: tuple[Command, ...] = ()
    """Admitted commands [Û]."""
    receipts: tuple[Receipt, ...] = ()
    """Validator receipts [C^U]."""
    clipped: Mapping[str, str] = field(default_factory=dict)
    """Notes on clipped arguments, by command id."""


class CommandValidator:
    """ValidateAndResolve for one instance in one city. Without a city, places and elevations are not bounded."""

    def __init__(self, instance: Instance, city: City | None = None) -> None:
        self._instance = instance
        self._bounds = None if city is None else city.bounds
        self._agents = {agent.id: agent for agent in instance.agents}
        self._entities = {entity.id: entity for entity in instance.entities}
        self._verbs = {entity.id: {verb.name: verb for verb in entity.verbs} for entity in instance.entities}
        self._arguments = {
            (entity.id, verb.name): arguments_check(verb) for entity in instance.entities for verb in entity.verbs
        }
        self._limits = CommandLimits(instance, city)

    def resolve(
        self,
        candidates: Iterable[tuple[str, Action | None]],
        registry: Registry,
        tick: int,
        *,
        tally: Tally | None = None,
        at: RuntimeContext | None = None,
    ) -> Resolution:
        """Admit at most one command per resource, in policy order.

        `tally` counts admitted commands against the counted budgets. `at` is the instant at which permits are
        evaluated.
        """
        admitted: dict[str, Command] = {}
        receipts: list[Receipt] = []
        clipped: dict[str, str] = {}
        number = 0
        for sender, action in candidates:
            if action is None:
                continue
            number += 1
            name = request_id("command", tick, number)
            resource = self._resource(sender, action)
            fault = self._fault(sender, action, resource, registry, tick, admitted)
            fault = fault or self._constraint_fault(action, resource, tally, at)
            if fault is not None:
                receipts.append(self._refusal(name, sender, resource, tick, fault))
                continue
            if tally is not None:
                tally.count_command(resource, action.verb)
            admitted[resource], note = self._command(name, sender, action, resource, registry, tick)
            if note:
                clipped[name] = note
        return Resolution(tuple(admitted.values()), tuple(receipts), clipped)

    def _command(
        self, name: str, sender: str, action: Action, resource: str, registry: Registry, tick: int
    ) -> tuple[Command, str]:
        """Return the command of a valid candidate with a note on clipped arguments."""
        entity = self._entities[resource]
        verb = self._verbs[resource][action.verb]
        arguments, note = self._limits.clipped(verb, action.arguments, entity, registry)
        command = Command(id=name, tick=tick, sender=sender, resource=resource, verb=action.verb, arguments=arguments)
        return command, note

    def _resource(self, sender: str, action: Action) -> str:
        if action.resource is not None:
            return action.resource
        agent = self._agents.get(sender)
        return agent.commands[0] if agent is not None and agent.commands else ""

    def _fault(
        self,
        sender: str,
        action: Action,
        resource: str,
        registry: Registry,
        tick: int,
        admitted: Mapping[str, Command],
    ) -> Rejection | None:
        agent = self._agents.get(sender)
        return (
            _identity_fault(sender, agent, action, tick)
            or self._authority_fault(agent, resource)
            or self._schema_fault(action, resource)
            or self._place_fault(action)
            or _resource_fault(action, self._entities[resource], registry, admitted)
        )

    def _constraint_fault(
        self, action: Action, resource: str, tally: Tally | None, at: RuntimeContext | None
    ) -> Rejection | None:
        """Return the rejection by a permit or a counted budget of the mission, if any."""
        for permit in self._instance.permits if at is not None else ():
            concerned = permit.resource == resource and permit.verb in ("", action.verb)
            if concerned and action.verb != STOP and at is not None and not holds(permit.condition, {}, at):
                return Rejection("not_permitted", f"the mission does not permit `{action.verb}` of `{resource}` yet")
        forbidden = tally.command(resource, action.verb) if tally is not None else ""
        return Rejection(LIMIT, forbidden) if forbidden else None

    def forbidden(self, at: RuntimeContext) -> tuple[tuple[str, str], ...]:
        """Return the (resource, verb) pairs of the permits that do not hold at an instant. The verb "" stands for all
        verbs.
        """
        permits = self._instance.permits
        return tuple((permit.resource, permit.verb) for permit in permits if not holds(permit.condition, {}, at))

    def _authority_fault(self, agent: AgentSpec | None, resource: str) -> Rejection | None:
        assert agent is not None
        if resource in agent.commands:
            return None
        allowed = ", ".join(agent.commands) or "nothing"
        entity = self._entities.get(resource)
        if entity is None or "position" in entity.hidden:  # a receipt must not reveal that a hidden entity exists
            return Rejection(
                "unknown_resource", f"there is no resource `{resource}`; `{agent.id}` may command {allowed}"
            )
        return Rejection("no_authority", f"`{agent.id}` may not command `{resource}`, only {allowed}")

    def _schema_fault(self, action: Action, resource: str) -> Rejection | None:
        entity = self._entities[resource]
        check = self._arguments.get((resource, action.verb))
        if check is None:
            known = ", ".join(item.name for item in entity.verbs)
            return Rejection("unknown_verb", f"`{action.verb}` is not in the action space of `{resource}`: {known}")
        detail = check.fault(action.arguments) or _camera_fault(entity, action)
        return Rejection("bad_argument", detail) if detail else None

    def _place_fault(self, action: Action) -> Rejection | None:
        """Reject a place far from the city. It comes from another frame: centimetres, another grid, degrees used as
        metres.
        """
        x, y = action.arguments.get("x"), action.arguments.get("y")
        if self._bounds is None or not isinstance(x, int | float) or not isinstance(y, int | float):
            return None
        west, south, east, north = self._bounds
        beyond_m = max(west - x, x - east, south - y, y - north)
        if beyond_m <= MARGIN_M:
            return None
        return Rejection(
            "outside_world",
            f"({x:g}, {y:g}) lies {beyond_m:.0f} m outside the city: places are metres east and north of its origin, "
            f"within ({west:g}, {south:g}) and ({east:g}, {north:g})",
        )

    def _refusal(self, name: str, sender: str, resource: str, tick: int, fault: Rejection) -> Receipt:
        return Receipt(
            request=name,
            tick=tick,
            sender=sender,
            resource=resource,
            status="rejected",
            reason=fault.reason,
            detail=fault.detail,
            by="kernel",
            time_s=(tick - 1) * self._instance.clock.tick_s,
        )


def reachable(bounds: tuple[float, float, float, float]) -> tuple[float, float, float, float]:
    """Return the bounds (west, south, east, north; metres) of allowed destinations: the city's bounds with `MARGIN_M`
    around.
    """
    west, south, east, north = bounds
    return west - MARGIN_M, south - MARGIN_M, east + MARGIN_M, north + MARGIN_M


def camera_of(entity: Entity, arguments: Mapping[str, Datum]) -> str:
    """Return the camera of a `takePhoto`: the one that it names, else the first camera of the entity; "" without
    cameras.
    """
    name = arguments.get("camera")
    return str(name) if name is not None else entity.cameras[0].name if entity.cameras else ""


def _identity_fault(sender: str, agent: AgentSpec | None, action: Action, tick: int) -> Rejection | None:
    if agent is None:
        return Rejection("unknown_agent", f"`{sender}` is not active in this episode")
    if action.tick is not None and action.tick != tick - 1:
        return Rejection("stale", f"decided on boundary {action.tick}, now is {tick - 1}")
    return None


def _resource_fault(
    action: Action, entity: Entity, registry: Registry, admitted: Mapping[str, Command]
) -> Rejection | None:
    resource = entity.id
    first = admitted.get(resource)
    if first is not None:
        return Rejection("conflict", f"`{first.sender}` was admitted first (`{first.verb}`, {first.id})")
    pending = registry.pending.get(resource)
    if pending is not None and action.verb != STOP:
        way_out = "; `stop` pre-empts it" if any(verb.name == STOP for verb in entity.verbs) else ""
        return Rejection("busy", f"`{resource}` is still doing `{pending.verb}` ({pending.id}){way_out}")
    if action.verb == PHOTO:
        return _sight_fault(resource, registry.states[resource].status)
    return None


def _sight_fault(resource: str, status: str) -> Rejection | None:
    if status == DEAD:
        return Rejection(DEAD, f"`{resource}` is dead and takes no pictures")
    if status in BLIND:
        return Rejection("not_in_view", f"`{resource}` does not see the region now: {status}")
    return None


def _camera_fault(entity: Entity, action: Action) -> str:
    if action.verb != PHOTO:
        return ""
    name = camera_of(entity, action.arguments)
    mounts = [camera.name for camera in entity.cameras]
    return "" if name in mounts else f"`{entity.id}` has no camera `{name}`: {', '.join(mounts) or 'none'}"
