"""Reduction of a trace's mission: drawn values are fixed, and parts are removed.

Values drawn in the instance (positions, properties, weather, times of events) become constants, so that removing a
part does not change other draws. The remaining members of a group are renumbered from 1 in their old order. Only the
trace's mode is kept.

Parts are agents (with the bodies that no other agent may command), targets, assets that no agent controls, events, and
message kinds. Declarations that refer to a removed part are removed too: relations, authorities, reveals, limits,
permits, inspections, and stages, constraints and rules over a removed group. The compiler then decides whether the
result is a mission.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, Literal, NamedTuple

from msgspec.structs import replace

from lingjing.mission import expression as ex
from lingjing.mission import model
from lingjing.mission.alternatives import with_alternatives
from lingjing.mission.evaluate import Scope
from lingjing.mission.instance import Datum, Entity, Instance, MessageSpec
from lingjing.mission.instance_entities import holds
from lingjing.mission.tiers import without_settings
from lingjing.mission.vocabulary import EVERYONE

PartKind = Literal["target", "agent", "asset", "event", "message"]
"""The kinds of parts."""


class RemovablePart(NamedTuple):
    """A part that may be removed."""

    kind: PartKind
    name: str
    """Its id (`victim[2]`) or its name."""

    def __str__(self) -> str:
        """Return the part as text: `target victim[2]`."""
        return f"{self.kind} {self.name}"


class ReducedMission(NamedTuple):
    """A mission with parts removed."""

    mission: model.Mission
    agents: Mapping[str, str]
    """The old ids of agents by their new ids."""


class ReducibleMission:
    """The mission of an instance. `parts` are its removable parts, targets first."""

    def __init__(self, mission: model.Mission, instance: Instance) -> None:
        self._instance = instance
        self._mission = _in_mode(mission, instance)
        self._bodies = _own_bodies(instance)
        owned = {name for names in self._bodies.values() for name in names}
        controlled = owned | {name for agent in instance.agents for name in agent.controls}
        entities = instance.entities
        self.parts: tuple[RemovablePart, ...] = (
            *(RemovablePart("target", item.id) for item in entities if item.role == "target"),
            *(RemovablePart("agent", item.id) for item in instance.agents),
            *(
                RemovablePart("asset", item.id)
                for item in entities
                if item.role == "asset" and item.id not in controlled
            ),
            *(RemovablePart("event", item.name) for item in instance.events),
            *(RemovablePart("message", item.kind) for item in instance.messages if not self._is_required(item)),
        )

    def _is_required(self, message: MessageSpec) -> bool:
        """Return whether rules, stages or success require assignments by such messages."""
        mission = self._mission
        conditions = (
            *(item.condition for item in mission.rules),
            *(item.condition for item in mission.stages),
            mission.success,
        )
        calls = (part for item in conditions for part in ex.parts(item) if isinstance(part, ex.Call))
        return message.category == "assignment" and any(call.function == "assigned" for call in calls)

    def keeping(self, kept: Iterable[RemovablePart], ticks: int) -> ReducedMission:
        """Return the mission with only these parts, and with this budget of ticks."""
        removed = set(self.parts) - set(kept)
        agents = [item.id for item in self._instance.agents if RemovablePart("agent", item.id) not in removed]
        lost_bodies = {body for name, bodies in self._bodies.items() if name not in agents for body in bodies}
        lost = lost_bodies | {part.name for part in removed if part.kind in ("target", "asset")}
        entities = [item for item in self._instance.entities if item.id not in lost]
        remaining = _Kept(
            entities=tuple(entities),
            agents=tuple(agents),
            events=frozenset(item.name for item in self._instance.events) - _names(removed, "event"),
            messages=frozenset(item.kind for item in self._instance.messages) - _names(removed, "message"),
        )
        mission = _reduced(self._mission, self._instance, remaining)
        budget = replace(mission.budget, ticks=ex.Number(float(ticks)))
        return ReducedMission(replace(mission, budget=budget), self._old_names(remaining))

    def _old_names(self, kept: _Kept) -> dict[str, str]:
        """Return the old ids of the remaining agents by their new ids."""
        groups: dict[str, list[str]] = {}
        for agent_spec in self._instance.agents:
            if agent_spec.id in kept.agents:
                groups.setdefault(agent_spec.name, []).append(agent_spec.id)
        counted = {agent.name for agent in self._mission.agents if agent.count is not None}
        return {
            f"{name}[{number}]" if name in counted else name: old
            for name, olds in groups.items()
            for number, old in enumerate(olds, 1)
        }


class _Kept(NamedTuple):
    """The remaining entities, agents, events and message kinds."""

    entities: tuple[Entity, ...]
    agents: tuple[str, ...]
    events: frozenset[str]
    messages: frozenset[str]


def _names(parts: Iterable[RemovablePart], kind: PartKind) -> set[str]:
    return {part.name for part in parts if part.kind == kind}


def _own_bodies(instance: Instance) -> dict[str, tuple[str, ...]]:
    """Return the bodies of each agent that no other agent may command."""
    owners: dict[str, list[str]] = {}
    for agent in instance.agents:
        for body in agent.commands:
            owners.setdefault(body, []).append(agent.id)
    return {agent.id: tuple(body for body in agent.controls if owners[body] == [agent.id]) for agent in instance.agents}


# -- one mode, one instance


def _in_mode(mission: model.Mission, instance: Instance) -> model.Mission:
    """Return the mission in the mode and with the settings of the instance, with fixed draws outside groups."""
    scope = Scope(parameters=instance.settings, mode=instance.mode, tick_s=instance.clock.tick_s)
    switches = {item.name: 0.0 for item in mission.parameters if item.is_switch}
    settings = {**switches, **instance.settings}
    mission = with_alternatives(mission, replace(scope, parameters=settings))

    def active(parts: Sequence[Any]) -> tuple[Any, ...]:
        return tuple(replace(part, when=None) for part in parts if holds(part.when, scope))

    hub = mission.comms.hub if instance.mode == "star" else None
    return replace(
        mission,
        parameters=tuple(replace(item, default=_like(item.default, settings[item.name]))
                         for item in mission.parameters),
        modes=model.Modes(default=instance.mode, allowed=(instance.mode,)),
        scene=replace(mission.scene, options=tuple(
            _fixed(item, instance.scene.options.get(item.name)) for item in mission.scene.options
        )),
        weather=tuple(_fixed(item, getattr(instance.weather, item.name)) for item in mission.weather),
        groups=active(mission.groups),
        agents=active(mission.agents),
        authorities=active(mission.authorities),
        messages=active(mission.messages),
        comms=replace(mission.comms, hub=hub),
        limits=active(mission.limits),
        stages=tuple(replace(item, limits=active(item.limits)) for item in mission.stages),
        constraints=active(mission.constraints),
        inspections=active(mission.inspections),
        relations=active(mission.relations),
        events=tuple(_at_tick(item, instance) for item in active(mission.events)),
        sweeps=(),
        expectations=(),  # the expectations of the whole mission need not hold for a part of it
        origin=model.Origin(),
    )  # fmt: skip


def _at_tick(event: model.EventDeclaration, instance: Instance) -> model.EventDeclaration:
    if not isinstance(event.at, ex.Draw):
        return event
    tick = next(spec.tick for spec in instance.events if spec.name == event.name)
    return event if tick is None else replace(event, at=ex.Number(float(tick), "tick"))


def _like(expr: ex.Expr, value: float) -> ex.Expr:
    """Return a number in the unit of the expression that it replaces; a flag in place of a flag."""
    if isinstance(expr, ex.Flag):
        return ex.Flag(value != 0.0)
    unit = next((part.unit for part in ex.parts(expr) if isinstance(part, ex.Number) and part.unit), "")
    return ex.Number(value, unit)


def _fixed(prop: model.Property, value: Any) -> model.Property:
    """Return a property with its draw replaced by the drawn value."""
    if not isinstance(prop.value, ex.Draw):
        return prop
    return replace(prop, relation="=", value=_value(prop.value, value))


def _value(draw: ex.Expr, value: Datum) -> ex.Expr:
    """Return a drawn value as an expression, in the unit of the draw."""
    match value:
        case bool():
            return ex.Flag(value)
        case int() | float():
            return _like(draw, float(value))
        case str() if any(isinstance(item, ex.Text) for item in ex.parts(draw)):
            return ex.Text(value)
        case str():
            return ex.Symbol(value)
        case tuple():
            return ex.Sequence(tuple(_value(draw, item) for item in value))
    raise ValueError(f"a drawn value of {value!r}")


# -- removal of parts

Resolvable = Callable[..., bool]
"""Returns whether expressions (or None) refer to no removed group."""


def _reduced(mission: model.Mission, instance: Instance, kept: _Kept) -> model.Mission:
    groups = tuple(filter(None, (_group(group, instance, kept) for group in mission.groups)))
    agents = tuple(filter(None, (_agent(agent, instance, kept) for agent in mission.agents)))
    names = {group.name for group in groups}
    lost = {group.name for group in mission.groups} - names
    roles = {agent.role for agent in agents}
    messages = tuple(item for item in mission.messages if item.name in kept.messages)
    kinds = {item.name for item in messages}
    lowered = _lowered(mission, groups, agents)

    def stands(*parts: ex.Expr | None) -> bool:
        return not any(_refers_to(part, lost) for part in parts if part is not None)

    return replace(
        mission,
        parameters=tuple(_parameter(item, lowered) for item in mission.parameters),
        tiers=without_settings(mission.tiers, lowered),
        groups=tuple(_group_as_written(item, mission, lowered) for item in groups),
        agents=tuple(_agent_as_written(item, mission, lowered) for item in agents),
        authorities=tuple(item for item in mission.authorities if item.role in roles and stands(item.resource)),
        messages=tuple(_addressed(item, roles) for item in messages),
        rules=tuple(item for item in mission.rules if not lost & {parameter.domain for parameter in item.parameters}),
        unlocks=tuple(item for item in mission.unlocks
                      if not lost & {parameter.domain for parameter in item.parameters}),
        stages=tuple(replace(item, limits=_limits(item.limits, kinds, stands)) for item in mission.stages
                     if item.domain not in lost),
        relations=tuple(item for item in mission.relations if _relates(item, roles, kinds, lost)),
        reveals=tuple(item for item in mission.reveals if item.role in roles and stands(item.entity)),
        limits=_limits(mission.limits, kinds, stands),
        permits=tuple(item for item in mission.permits if stands(item.resource)),
        constraints=tuple(item for item in mission.constraints if item.domain not in lost),
        inspections=tuple(item for item in mission.inspections if stands(item.asset, *item.by, item.destination)),
        events=tuple(
            _event_changes(item, stands)
            for item in mission.events
            if item.name in kept.events and stands(item.condition, item.until)
        ),
    )  # fmt: skip


def _refers_to(expr: ex.Expr, groups: set[str]) -> bool:
    return any(isinstance(part, ex.Ref) and part.kind in ("group", "entity") and part.name in groups
               for part in ex.parts(expr))  # fmt: skip


def _group(group: model.Group, instance: Instance, kept: _Kept) -> model.Group | None:
    members = [entity for entity in kept.entities if entity.group == group.name]
    if not members:
        return None
    properties = tuple(_placed(group, prop, members) for prop in group.properties)
    labels = tuple(entity.label for entity in members) if group.labels else ()
    return replace(group, count=_count(group.count, len(members)), properties=properties, labels=labels)


def _agent(agent: model.Agent, instance: Instance, kept: _Kept) -> model.Agent | None:
    members = [spec.id for spec in instance.agents if spec.name == agent.name and spec.id in kept.agents]
    return replace(agent, count=_count(agent.count, len(members))) if members else None


def _count(written: ex.Expr | None, members: int) -> ex.Expr | None:
    return None if written is None else ex.Number(float(members))


def _placed(group: model.Group, prop: model.Property, members: Sequence[Entity]) -> model.Property:
    """Return a property with the members' values if they were drawn or differ between members; always for positions,
    because the scene may have moved them onto a road or a roof.
    """
    numbered = any(isinstance(item, ex.Ref) and item.kind == "local" for item in ex.parts(prop.value))
    if prop.name != "position" and not numbered and not isinstance(prop.value, ex.Draw):
        return prop
    values = [_member_value(prop, item) for item in members]
    if any(value is None for value in values):
        return prop
    known = [value for value in values if value is not None]
    if group.count is None:
        return replace(prop, relation="=", value=known[0])
    listed = ex.Call("at", (ex.Ref(group.index, "local"), ex.Sequence(tuple(known))))
    return replace(prop, relation="=", value=listed)


def _member_value(prop: model.Property, entity: Entity) -> ex.Expr | None:
    """Return the member's value, or None if it is no constant (another entity)."""
    if prop.name == "position":
        return ex.Point(tuple(ex.Number(metres, "m") for metres in entity.position))
    value = entity.heading_deg if prop.name == "heading_deg" else entity.properties.get(prop.name)
    if value is None or (isinstance(value, tuple) and not all(isinstance(item, str | float | bool) for item in value)):
        return None
    if isinstance(value, str) and not isinstance(prop.value, ex.Draw):
        return None
    return _value(prop.value, value)


def _lowered(mission: model.Mission, groups: Sequence[model.Group], agents: Sequence[model.Agent]) -> dict[str, float]:
    """Return the parameters that count members, with their new values; without parameters with contradictory counts."""
    before = {group.name: group.count for group in mission.groups}
    before |= {agent.name: agent.count for agent in mission.agents}
    now = {group.name: group.count for group in groups} | {agent.name: agent.count for agent in agents}
    counts: dict[str, set[float]] = {}
    for name, count in now.items():
        written = before[name]
        if isinstance(written, ex.Ref) and written.kind == "param" and isinstance(count, ex.Number):
            counts.setdefault(written.name, set()).add(count.value)
    return {name: min(values) for name, values in counts.items() if len(values) == 1}


def _parameter(parameter: model.Parameter, lowered: Mapping[str, float]) -> model.Parameter:
    """Return a parameter with its new value; its bounds are removed if the value changed."""
    if parameter.name not in lowered:
        return parameter
    default = _like(parameter.default, lowered[parameter.name])
    return parameter if default == parameter.default else replace(parameter, default=default, bounds=None)


def _group_as_written(item: model.Group, mission: model.Mission, lowered: Mapping[str, float]) -> model.Group:
    """Return the group with its written count, if that is a parameter with the same value."""
    written = next(group.count for group in mission.groups if group.name == item.name)
    return replace(item, count=written) if isinstance(written, ex.Ref) and written.name in lowered else item


def _agent_as_written(item: model.Agent, mission: model.Mission, lowered: Mapping[str, float]) -> model.Agent:
    written = next(agent.count for agent in mission.agents if agent.name == item.name)
    return replace(item, count=written) if isinstance(written, ex.Ref) and written.name in lowered else item


def _addressed(kind: model.MessageKind, roles: set[str]) -> model.MessageKind:
    """Return a message kind without roles that no agent has any more."""
    senders = tuple(role for role in kind.senders if role in roles or role == EVERYONE)
    recipients = tuple(role for role in kind.recipients if role in roles or role == EVERYONE)
    return replace(kind, senders=senders or kind.senders, recipients=recipients or kind.recipients)


def _relates(relation: model.Relation, roles: set[str], kinds: set[str], lost: set[str]) -> bool:
    if relation.kind != "dependency" and not {relation.source, relation.target} <= roles:
        return False
    named = [name for name in (relation.carries, relation.by) if name]
    return all(name in kinds for name in named) and not lost & {relation.over, relation.per}


def _limits(limits: Sequence[model.Limit], kinds: set[str], stands: Resolvable) -> tuple[model.Limit, ...]:
    """Return the limits without counts of removed kinds and resources."""
    kept = []
    for limit in limits:
        counts = tuple(
            count
            for count in limit.counts
            if (count.kind == "command" or count.name in kinds) and stands(count.resource)
        )
        kept += [replace(limit, counts=counts)] if counts else []
    return tuple(kept)


def _event_changes(event: model.EventDeclaration, stands: Resolvable) -> model.EventDeclaration:
    return replace(event, changes=tuple(change for change in event.changes if stands(change.entity, change.value)))
