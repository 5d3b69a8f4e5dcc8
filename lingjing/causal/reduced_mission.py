"""`ReducibleMission`: the mission of a trace with everything drawn made fast, and parts of it left out.

What the instance of the trace drew stands as values: places, properties, the weather, the times of events. So leaving
one part out does not draw another one anew. Members of a group that stay are counted from 1 in their old order. The
mode is the trace's alone, and what only counts in another mode is gone.

Parts are agents (with the bodies that nobody else may command), targets, assets that no agent controls, events, and
kinds of messages. What cannot be said without a part goes with it: relations, authorities, reveals, limits, permits,
inspections, and stages, constraints and rules over a group that is gone. Whether what is left is a mission is for the
compiler to say.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, Literal, NamedTuple

from msgspec.structs import replace

from lingjing.mission import expression as ex
from lingjing.mission import model
from lingjing.mission.evaluate import Scope
from lingjing.mission.instance import Datum, Entity, Instance, MessageSpec
from lingjing.mission.instance_entities import holds
from lingjing.mission.vocabulary import EVERYONE

PartKind = Literal["target", "agent", "asset", "event", "message"]


class RemovablePart(NamedTuple):
    """What may be left out, by its id (`victim[2]`) or its name."""

    kind: PartKind
    name: str

    def __str__(self) -> str:
        """`target victim[2]`."""
        return f"{self.kind} {self.name}"


class ReducedMission(NamedTuple):
    """A mission with parts left out; `agents` maps the new ids of its agents to the old ones."""

    mission: model.Mission
    agents: Mapping[str, str]


class ReducibleMission:
    """The mission of an instance. `parts` are what may be left out, targets first."""

    def __init__(self, mission: model.Mission, instance: Instance) -> None:
        self._instance = instance
        self._mission = _in_mode(mission, instance)
        self._bodies = _own_bodies(instance)
        owned = {name for names in self._bodies.values() for name in names}
        controlled = owned | {name for agent in instance.agents for name in agent.controls}
        entities = instance.entities
        self.parts: tuple[RemovablePart, ...] = (
            *(RemovablePart("target", one.id) for one in entities if one.role == "target"),
            *(RemovablePart("agent", one.id) for one in instance.agents),
            *(RemovablePart("asset", one.id) for one in entities if one.role == "asset" and one.id not in controlled),
            *(RemovablePart("event", one.name) for one in instance.events),
            *(RemovablePart("message", one.kind) for one in instance.messages if not self._is_asked_for(one)),
        )

    def _is_asked_for(self, message: MessageSpec) -> bool:
        """Whether somebody must be assigned by such messages: without them none could be, whoever played."""
        mission = self._mission
        asked = (*(one.condition for one in mission.rules), *(one.condition for one in mission.stages), mission.success)
        calls = (part for one in asked for part in ex.parts(one) if isinstance(part, ex.Call))
        return message.category == "assignment" and any(call.function == "assigned" for call in calls)

    def keeping(self, kept: Iterable[RemovablePart], ticks: int) -> ReducedMission:
        """The mission with these parts and none of the others, and so many ticks."""
        gone = set(self.parts) - set(kept)
        agents = [one.id for one in self._instance.agents if RemovablePart("agent", one.id) not in gone]
        lost_bodies = {body for name, bodies in self._bodies.items() if name not in agents for body in bodies}
        lost = lost_bodies | {part.name for part in gone if part.kind in ("target", "asset")}
        entities = [one for one in self._instance.entities if one.id not in lost]
        told = _Kept(
            entities=tuple(entities),
            agents=tuple(agents),
            events=frozenset(one.name for one in self._instance.events) - _names(gone, "event"),
            messages=frozenset(one.kind for one in self._instance.messages) - _names(gone, "message"),
        )
        mission = _reduced(self._mission, self._instance, told)
        budget = replace(mission.budget, ticks=ex.Number(float(ticks)))
        return ReducedMission(replace(mission, budget=budget), self._old_names(told))

    def _old_names(self, kept: _Kept) -> dict[str, str]:
        """The ids of agents that stay, by their new ids."""
        groups: dict[str, list[str]] = {}
        for one in self._instance.agents:
            if one.id in kept.agents:
                groups.setdefault(one.name, []).append(one.id)
        counted = {agent.name for agent in self._mission.agents if agent.count is not None}
        return {
            f"{name}[{number}]" if name in counted else name: old
            for name, olds in groups.items()
            for number, old in enumerate(olds, 1)
        }


class _Kept(NamedTuple):
    """What stays."""

    entities: tuple[Entity, ...]
    agents: tuple[str, ...]
    events: frozenset[str]
    messages: frozenset[str]


def _names(parts: Iterable[RemovablePart], kind: PartKind) -> set[str]:
    return {part.name for part in parts if part.kind == kind}


def _own_bodies(instance: Instance) -> dict[str, tuple[str, ...]]:
    """The bodies of each agent that no other may command."""
    owners: dict[str, list[str]] = {}
    for agent in instance.agents:
        for body in agent.commands:
            owners.setdefault(body, []).append(agent.id)
    return {agent.id: tuple(body for body in agent.controls if owners[body] == [agent.id]) for agent in instance.agents}


# -- one mode, one instance


def _in_mode(mission: model.Mission, instance: Instance) -> model.Mission:
    """The mission as it is in the mode and with the settings of the instance, without draws but those of groups."""
    scope = Scope(parameters=instance.settings, mode=instance.mode, tick_s=instance.clock.tick_s)

    def there(parts: Sequence[Any]) -> tuple[Any, ...]:
        return tuple(replace(part, when=None) for part in parts if holds(part.when, scope))

    hub = mission.comms.hub if instance.mode == "star" else None
    return replace(
        mission,
        parameters=tuple(replace(one, default=_like(one.default, instance.settings[one.name]))
                         for one in mission.parameters),
        modes=model.Modes(default=instance.mode, allowed=(instance.mode,)),
        scene=replace(mission.scene, options=tuple(
            _fixed(one, instance.scene.options.get(one.name)) for one in mission.scene.options
        )),
        weather=tuple(_fixed(one, getattr(instance.weather, one.name)) for one in mission.weather),
        groups=there(mission.groups),
        agents=there(mission.agents),
        authorities=there(mission.authorities),
        messages=there(mission.messages),
        comms=replace(mission.comms, hub=hub),
        limits=there(mission.limits),
        stages=tuple(replace(one, limits=there(one.limits)) for one in mission.stages),
        constraints=there(mission.constraints),
        inspections=there(mission.inspections),
        relations=there(mission.relations),
        events=tuple(_at_tick(one, instance) for one in there(mission.events)),
        sweeps=(),
        origin=model.Origin(),
    )  # fmt: skip


def _at_tick(event: model.EventDeclaration, instance: Instance) -> model.EventDeclaration:
    if not isinstance(event.at, ex.Draw):
        return event
    tick = next(one.tick for one in instance.events if one.name == event.name)
    return replace(event, at=ex.Number(float(tick), "tick"))


def _like(expr: ex.Expr, value: float) -> ex.Expr:
    """A number in the unit of what it takes the place of."""
    unit = next((one.unit for one in ex.parts(expr) if isinstance(one, ex.Number) and one.unit), "")
    return ex.Number(value, unit)


def _fixed(prop: model.Property, value: Any) -> model.Property:
    """A property whose draw has become its value."""
    if not isinstance(prop.value, ex.Draw):
        return prop
    return replace(prop, relation="=", value=_value(prop.value, value))


def _value(given: ex.Expr, value: Datum) -> ex.Expr:
    """A drawn value as an expression, in the unit of the draw."""
    match value:
        case bool():
            return ex.Flag(value)
        case int() | float():
            return _like(given, float(value))
        case str() if any(isinstance(one, ex.Text) for one in ex.parts(given)):
            return ex.Text(value)
        case str():
            return ex.Symbol(value)
        case tuple():
            return ex.Sequence(tuple(_value(given, one) for one in value))
    raise ValueError(f"a drawn value of {value!r}")


# -- parts left out

Resolvable = Callable[..., bool]
"""Whether expressions (or None) speak of nothing that is gone."""


def _reduced(mission: model.Mission, instance: Instance, kept: _Kept) -> model.Mission:
    groups = tuple(filter(None, (_group(group, instance, kept) for group in mission.groups)))
    agents = tuple(filter(None, (_agent(agent, instance, kept) for agent in mission.agents)))
    names = {group.name for group in groups}
    lost = {group.name for group in mission.groups} - names
    roles = {agent.role for agent in agents}
    messages = tuple(one for one in mission.messages if one.name in kept.messages)
    kinds = {one.name for one in messages}
    lowered = _lowered(mission, groups, agents)

    def stands(*parts: ex.Expr | None) -> bool:
        """Whether no part speaks of a group that is gone."""
        return not any(_speaks_of(part, lost) for part in parts if part is not None)

    return replace(
        mission,
        parameters=tuple(_parameter(one, lowered) for one in mission.parameters),
        groups=tuple(_group_as_written(one, mission, lowered) for one in groups),
        agents=tuple(_agent_as_written(one, mission, lowered) for one in agents),
        authorities=tuple(one for one in mission.authorities if one.role in roles and stands(one.resource)),
        messages=tuple(_addressed(one, roles) for one in messages),
        rules=tuple(one for one in mission.rules if not lost & {parameter.domain for parameter in one.parameters}),
        unlocks=tuple(one for one in mission.unlocks if not lost & {parameter.domain for parameter in one.parameters}),
        stages=tuple(replace(one, limits=_limits(one.limits, kinds, stands)) for one in mission.stages
                     if one.domain not in lost),
        relations=tuple(one for one in mission.relations if _relates(one, roles, kinds, lost)),
        reveals=tuple(one for one in mission.reveals if one.role in roles and stands(one.entity)),
        limits=_limits(mission.limits, kinds, stands),
        permits=tuple(one for one in mission.permits if stands(one.resource)),
        constraints=tuple(one for one in mission.constraints if one.domain not in lost),
        inspections=tuple(one for one in mission.inspections if stands(one.asset, *one.by, one.destination)),
        events=tuple(_changes(one, stands) for one in mission.events if one.name in kept.events),
    )  # fmt: skip


def _speaks_of(expr: ex.Expr, groups: set[str]) -> bool:
    return any(isinstance(one, ex.Ref) and one.kind in ("group", "entity") and one.name in groups
               for one in ex.parts(expr))  # fmt: skip


def _group(group: model.Group, instance: Instance, kept: _Kept) -> model.Group | None:
    members = [one for one in kept.entities if one.group == group.name]
    if not members:
        return None
    properties = tuple(_placed(group, prop, members) for prop in group.properties)
    labels = tuple(one.label for one in members) if group.labels else ()
    return replace(group, count=_count(group.count, len(members)), properties=properties, labels=labels)


def _agent(agent: model.Agent, instance: Instance, kept: _Kept) -> model.Agent | None:
    members = [one.id for one in instance.agents if one.name == agent.name and one.id in kept.agents]
    return replace(agent, count=_count(agent.count, len(members))) if members else None


def _count(given: ex.Expr | None, members: int) -> ex.Expr | None:
    return None if given is None else ex.Number(float(members))


def _placed(group: model.Group, prop: model.Property, members: Sequence[Entity]) -> model.Property:
    """A property with the members' values, where they were drawn or differ from member to member; a place always, for
    the scene may have moved it onto a road or a roof."""
    numbered = any(isinstance(one, ex.Ref) and one.kind == "local" for one in ex.parts(prop.value))
    if prop.name != "position" and not numbered and not isinstance(prop.value, ex.Draw):
        return prop
    values = [_member_value(prop, one) for one in members]
    if any(value is None for value in values):
        return prop
    known = [value for value in values if value is not None]
    if group.count is None:
        return replace(prop, relation="=", value=known[0])
    listed = ex.Call("at", (ex.Ref(group.index, "local"), ex.Sequence(tuple(known))))
    return replace(prop, relation="=", value=listed)


def _member_value(prop: model.Property, entity: Entity) -> ex.Expr | None:
    """What the member has; None for what is no plain value (another entity)."""
    if prop.name == "position":
        return ex.Point(tuple(ex.Number(metres, "m") for metres in entity.position))
    value = entity.heading_deg if prop.name == "heading_deg" else entity.properties.get(prop.name)
    if value is None or (isinstance(value, tuple) and not all(isinstance(one, str | float | bool) for one in value)):
        return None
    if isinstance(value, str) and not isinstance(prop.value, ex.Draw):
        return None
    return _value(prop.value, value)


def _lowered(mission: model.Mission, groups: Sequence[model.Group], agents: Sequence[model.Agent]) -> dict[str, float]:
    """Parameters that say how many of something there are, with what they say now; none on which those that it counts
    do not agree."""
    before = {group.name: group.count for group in mission.groups}
    before |= {agent.name: agent.count for agent in mission.agents}
    now = {group.name: group.count for group in groups} | {agent.name: agent.count for agent in agents}
    wanted: dict[str, set[float]] = {}
    for name, count in now.items():
        given = before[name]
        if isinstance(given, ex.Ref) and given.kind == "param" and isinstance(count, ex.Number):
            wanted.setdefault(given.name, set()).add(count.value)
    return {name: min(values) for name, values in wanted.items() if len(values) == 1}


def _parameter(one: model.Parameter, lowered: Mapping[str, float]) -> model.Parameter:
    """A parameter with what it says now, out of its bounds if need be."""
    if one.name not in lowered:
        return one
    default = _like(one.default, lowered[one.name])
    return one if default == one.default else replace(one, default=default, bounds=None)


def _group_as_written(one: model.Group, mission: model.Mission, lowered: Mapping[str, float]) -> model.Group:
    """The group with its count as it was written, if that is a parameter that says the same."""
    given = next(group.count for group in mission.groups if group.name == one.name)
    return replace(one, count=given) if isinstance(given, ex.Ref) and given.name in lowered else one


def _agent_as_written(one: model.Agent, mission: model.Mission, lowered: Mapping[str, float]) -> model.Agent:
    given = next(agent.count for agent in mission.agents if agent.name == one.name)
    return replace(one, count=given) if isinstance(given, ex.Ref) and given.name in lowered else one


def _addressed(kind: model.MessageKind, roles: set[str]) -> model.MessageKind:
    """A kind of messages without the roles that nobody plays any more."""
    senders = tuple(one for one in kind.senders if one in roles or one == EVERYONE)
    recipients = tuple(one for one in kind.recipients if one in roles or one == EVERYONE)
    return replace(kind, senders=senders or kind.senders, recipients=recipients or kind.recipients)


def _relates(one: model.Relation, roles: set[str], kinds: set[str], lost: set[str]) -> bool:
    if one.kind != "dependency" and not {one.source, one.target} <= roles:
        return False
    named = [name for name in (one.carries, one.by) if name]
    return all(name in kinds for name in named) and not lost & {one.over, one.per}


def _limits(limits: Sequence[model.Limit], kinds: set[str], stands: Resolvable) -> tuple[model.Limit, ...]:
    """The limits, each without what is gone of what it counts."""
    kept = []
    for limit in limits:
        counts = tuple(
            one for one in limit.counts if (one.kind == "command" or one.name in kinds) and stands(one.resource)
        )
        kept += [replace(limit, counts=counts)] if counts else []
    return tuple(kept)


def _changes(event: model.EventDeclaration, stands: Resolvable) -> model.EventDeclaration:
    return replace(event, changes=tuple(one for one in event.changes if stands(one.entity)))
