"""The declarations that conditions refer to, of a compiled mission or of one of its instances, in one form.

A `Group` stands for all members of an entity group. Names of single entities of an instance (`uav[1]`) are looked up by
their group.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import cached_property

import msgspec

from lingjing.errors import MissionError
from lingjing.mission import model
from lingjing.mission.evaluate import Scope, number
from lingjing.mission.expression import Attr, Expr, Index, Ref, Symbol, parts
from lingjing.mission.instance import Entity, Instance
from lingjing.mission.instance_entities import COUNT
from lingjing.mission.kinds import engine_kind
from lingjing.mission.vocabulary import EVERYONE, PHOTO, STOP

EVENTS = "events"
"""The channel of an agent that observes events."""


class Motion(msgspec.Struct, frozen=True):
    """A behaviour of a group, as far as conditions depend on it."""

    of: tuple[str, ...]
    """The groups or entities that its members flee from or follow."""
    region: str
    """The region that they wander in; "" for none."""


class Taint(msgspec.Struct, frozen=True):
    """Public things that hidden values decide through interactions (`lingjing.mission.conditions.taint`)."""

    interactions: frozenset[tuple[str, str]] = frozenset()
    """(interaction, group of its targets)."""
    fields: frozenset[tuple[str, str]] = frozenset()
    """(group, field in rules): a state, `status`, or `position` for the place, the velocity and the heading."""
    sighted: frozenset[str] = frozenset()
    """The groups with an `assigned(…)` that depends on a hidden value, although the groups have none."""
    amounts: frozenset[tuple[str, str]] = frozenset()
    """(interaction, group of its targets) where a hidden value decides the moved amount, also with `told = all`."""


class Group(msgspec.Struct, frozen=True):
    """An entity group, as far as conditions depend on it."""

    name: str
    role: str
    """`asset` or `target`."""
    engine: str
    hidden: frozenset[str]
    """Its hidden properties, by their names in the graph."""
    states: Mapping[str, str]
    """The field of each state in rules (`demand_kg`) → the author's name (`demand`)."""
    verbs: tuple[str, ...]
    interactions: tuple[model.Exchange, ...]
    aboard: frozenset[str]
    """Its interactions in which the actor takes the target along."""
    drifts: bool
    """True if it moves without commands."""
    photographs: bool
    """True if one of its cameras takes a picture at each tick."""
    commanded_by: tuple[str, ...] = ()
    """The roles that may command it."""
    shares: tuple[str, ...] = ()
    """Resources between 0 and 1 that its engine reports, such as `battery`, without those that are declared."""
    behaviour: Motion | None = None
    """Its motion by itself; None if it has none."""

    @property
    def moving_verbs(self) -> tuple[str, ...]:
        """The verbs that move it."""
        return tuple(verb for verb in self.verbs if verb not in (STOP, PHOTO))


class MessageFacts(msgspec.Struct, frozen=True):
    """A message kind, as far as conditions depend on it."""

    kind: str
    category: str
    fields: tuple[model.Field, ...]
    senders: tuple[str, ...]


class Declarations(msgspec.Struct, frozen=True, dict=True):
    """All declarations of a mission that its conditions refer to."""

    groups: Mapping[str, Group]
    messages: Mapping[str, MessageFacts]
    rules: Mapping[str, model.Rule]
    unlocked: Mapping[str, tuple[model.Unlock, ...]]
    """Interaction → its unlocks."""
    hidden_regions: frozenset[str]
    inspections: Mapping[str, tuple[str, tuple[str, ...], str]]
    """Inspection → (group of the inspected asset, groups of the inspectors, message kind that requests a replan)."""
    counted: Mapping[str, tuple[tuple[str, str], ...]]
    """Limit → the (kind, name) pairs that it counts; kind is `verb` or `message`."""
    presences: Mapping[str, tuple[str, ...]]
    """Group → the events that make members of it appear or vanish."""
    settings: Mapping[tuple[str, str], tuple[str, ...]]
    """(group, `status` or a state by its name in rules) → the events that set it."""
    events: frozenset[str]
    """The mission's own events."""
    roles: tuple[str, ...]
    hidden_settings: frozenset[str] = frozenset()
    """The params that agents must not learn."""
    scope: Scope = Scope()
    """The settings that radii depend on."""
    events_observed: bool = False
    """True if every agent observes `events`."""
    taint: Taint = Taint()
    """The public things that hidden values decide."""

    def group(self, name: str) -> Group | None:
        """The group of this name, or of the entity with this id."""
        return self.groups.get(name) or self.groups.get(name.partition("[")[0])

    def actors(self, interaction: model.Exchange) -> tuple[str, ...]:
        """The asset groups that may perform an interaction: `by` names their engine or a role that commands them."""
        return self._assets_by_word.get(interaction.by, ())

    @cached_property
    def _assets_by_word(self) -> Mapping[str, tuple[str, ...]]:
        """Engine or role → its asset groups. Each target asks for the actors of its interactions."""
        named: dict[str, dict[str, None]] = {}
        for group in self.groups.values():
            for word in (group.engine, *group.commanded_by) if group.role == "asset" else ():
                named.setdefault(word, {})[group.name] = None
        return {word: tuple(groups) for word, groups in named.items()}

    def senders(self, kind: str) -> tuple[str, ...]:
        """The roles that may send messages of a kind."""
        message = self.messages.get(kind)
        if message is None:
            return ()
        return self.roles if EVERYONE in message.senders else message.senders


def of_mission(mission: model.Mission) -> Declarations:
    """The declarations of a compiled mission."""
    commanded = _commanded(mission)
    return Declarations(
        groups={group.name: _group(group, commanded.get(group.name, ())) for group in mission.groups},
        messages={
            kind.name: MessageFacts(kind.name, kind.category, kind.fields, kind.senders) for kind in mission.messages
        },
        rules={rule.name: rule for rule in mission.rules},
        unlocked=_by_interaction(mission.unlocks),
        hidden_regions=frozenset(region.name for region in mission.regions if region.hidden),
        inspections={
            inspection.name: (
                next(iter(group_names((inspection.asset,))), ""),
                group_names(inspection.by),
                inspection.replan,
            )
            for inspection in mission.inspections
        },
        counted={limit.name: tuple(map(_counted, limit.counts)) for limit in _limits(mission)},
        presences=_presences(
            (event.name, group_names(change.entity for change in event.changes if change.entity is not None))
            for event in mission.events
        ),
        settings=_settings(
            (event.name, group, change.field)
            for event in mission.events
            for change in event.changes
            if change.kind == "change" and change.entity is not None
            for group in group_names((change.entity,))
        ),
        events=frozenset(event.name for event in mission.events),
        roles=tuple(dict.fromkeys(agent.role for agent in mission.agents)),
        hidden_settings=frozenset(param.name for param in mission.parameters if param.hidden),
        events_observed=all(
            any(channel.source == Symbol(EVENTS) for channel in agent.observes) for agent in mission.agents
        ),
        scope=default_scope(mission, mission.modes.default),
    )


def of_instance(instance: Instance) -> Declarations:
    """The declarations of one instance."""
    firsts: dict[str, Entity] = {}
    hidden: dict[str, set[str]] = {}
    for entity in instance.entities:
        firsts.setdefault(entity.group, entity)
        hidden.setdefault(entity.group, set()).update(entity.hidden)
    group_of = {entity.id: entity.group for entity in instance.entities}
    commanded: dict[str, dict[str, None]] = {}
    for agent in instance.agents:
        for name in agent.commands:
            commanded.setdefault(group_of[name], {})[agent.role] = None
    counted: dict[str, tuple[tuple[str, str], ...]] = {}
    for limit in instance.limits:
        counted[limit.name] = tuple(("message" if c.kind == "message" else "verb", c.name) for c in limit.counts)
    return Declarations(
        groups={
            name: _entity_group(entity, frozenset(hidden[name]), tuple(commanded.get(name, ())))
            for name, entity in firsts.items()
        },
        messages={
            spec.kind: MessageFacts(spec.kind, spec.category, spec.fields, spec.senders) for spec in instance.messages
        },
        rules={rule.name: rule for rule in instance.rules},
        unlocked=_by_interaction(instance.unlocks),
        hidden_regions=frozenset(region.name for region in instance.regions if region.hidden),
        inspections={
            spec.name: (
                group_of.get(spec.asset, spec.asset),
                tuple(dict.fromkeys(group_of.get(name, name) for name in spec.by)),
                spec.replan,
            )
            for spec in instance.inspections
        },
        counted=counted,
        presences=_presences(
            (event.name, tuple(dict.fromkeys(group_of[name] for name in (*event.appear, *event.vanish))))
            for event in instance.events
        ),
        settings=_settings(
            (event.name, group_of[change.entity], change.field) for event in instance.events for change in event.changes
        ),
        events=frozenset(event.name for event in instance.events),
        roles=tuple(dict.fromkeys(agent.role for agent in instance.agents)),
        hidden_settings=frozenset(instance.hidden_settings),
        events_observed=all(any(channel.source == EVENTS for channel in each.observes) for each in instance.agents),
        scope=Scope(parameters=instance.settings, mode=instance.mode),
    )


def default_scope(mission: model.Mission, mode: str) -> Scope:
    """A scope with the parameters that have a value before any draw."""
    values: dict[str, float] = {}
    for parameter in mission.parameters:
        try:
            values[parameter.name] = number(parameter.default, Scope(parameters=values))
        except MissionError:
            continue  # drawn in a run: expressions with this parameter have no value here
    return Scope(parameters=values, mode=mode)


# -- private


def _group(group: model.Group, commanded_by: tuple[str, ...]) -> Group:
    states = {prop.name: prop.plain for prop in group.properties if prop.state}
    names = {prop.name for prop in group.properties}
    return Group(
        name=group.name,
        role=group.role,
        engine=group.engine,
        hidden=frozenset(prop.name for prop in group.properties if prop.hidden)
        | (frozenset({COUNT}) if group.hides_count else frozenset()),
        states=states,
        verbs=tuple(verb.name for verb in group.verbs),
        interactions=group.interactions,
        aboard=frozenset(spec.name for spec in group.interactions if spec.aboard is not None),
        drifts=group.behaviour is not None or _drifts(group.engine, names),
        photographs=any(camera.capture == "each_tick" for camera in group.cameras),
        commanded_by=commanded_by,
        shares=tuple(name for name in engine_kind(group.engine).shares if name not in names),
        behaviour=_motion(group.behaviour),
    )


def _entity_group(entity: Entity, hidden: frozenset[str], commanded_by: tuple[str, ...]) -> Group:
    return Group(
        name=entity.group,
        role=entity.role,
        engine=entity.engine,
        hidden=hidden,
        states={spec.field: spec.name for spec in entity.state},
        verbs=tuple(verb.name for verb in entity.verbs),
        interactions=entity.interactions,
        aboard=frozenset(spec.name for spec in entity.interactions if spec.aboard),
        drifts=entity.behaviour is not None or _drifts(entity.engine, entity.properties),
        photographs=any(camera.capture == "each_tick" for camera in entity.cameras),
        commanded_by=commanded_by,
        shares=tuple(name for name in engine_kind(entity.engine).shares if name not in entity.properties),
        behaviour=None if entity.behaviour is None else Motion(entity.behaviour.of, entity.behaviour.region),
    )


def _motion(behaviour: model.Behaviour | None) -> Motion | None:
    if behaviour is None:
        return None
    return Motion(() if behaviour.of is None else group_names((behaviour.of,)), behaviour.region)


def _drifts(engine: str, properties: Iterable[str]) -> bool:
    kind = engine_kind(engine)
    return "drift_mps" in properties if kind.drift_factor is not None else not kind.stays


def _commanded(mission: model.Mission) -> dict[str, tuple[str, ...]]:
    """Group → the roles that control or may command it."""
    roles: dict[str, dict[str, None]] = {}
    pairs = [(agent.role, name) for agent in mission.agents for name in group_names(agent.controls)]
    pairs += [
        (authority.role, name) for authority in mission.authorities for name in group_names((authority.resource,))
    ]
    for role, name in pairs:
        roles.setdefault(name, {})[role] = None
    return {name: tuple(names) for name, names in roles.items()}


def group_names(expressions: Iterable[Expr]) -> tuple[str, ...]:
    """The groups that entity expressions name."""
    return tuple(
        dict.fromkeys(
            part.name
            for expr in expressions
            for part in parts(_entity(expr))
            if isinstance(part, Ref) and part.kind in ("group", "entity")
        )
    )


def _entity(expr: Expr) -> Expr:
    """The entity of an expression without its index, because names in the index are no entities."""
    return expr.base if isinstance(expr, Index | Attr) else expr


def _limits(mission: model.Mission) -> Iterable[model.Limit]:
    return (*mission.limits, *(limit for stage in mission.stages for limit in stage.limits))


def _counted(item: model.Counted) -> tuple[str, str]:
    return ("message" if item.kind == "message" else "verb", item.name)


def _by_interaction(unlocks: Iterable[model.Unlock]) -> dict[str, tuple[model.Unlock, ...]]:
    unlocked: dict[str, tuple[model.Unlock, ...]] = {}
    for unlock in unlocks:
        unlocked[unlock.interaction] = (*unlocked.get(unlock.interaction, ()), unlock)
    return unlocked


def _presences(pairs: Iterable[tuple[str, tuple[str, ...]]]) -> dict[str, tuple[str, ...]]:
    presences: dict[str, tuple[str, ...]] = {}
    for event, groups in pairs:
        for group in groups:
            presences[group] = (*presences.get(group, ()), event)
    return presences


def _settings(triples: Iterable[tuple[str, str, str]]) -> dict[tuple[str, str], tuple[str, ...]]:
    settings: dict[tuple[str, str], tuple[str, ...]] = {}
    for event, group, field in triples:
        settings[group, field] = tuple(dict.fromkeys((*settings.get((group, field), ()), event)))
    return settings
