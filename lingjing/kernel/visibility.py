"""ProjectVisible: what an agent may see at a boundary, and what it may know before the first.

An agent sees its declared channels and nothing else. A property that the mission marks hidden is never read here,
and an entity with a hidden position is never listed, whatever a channel says; which events it is told is said in
`announcements`. So instances that differ only in hidden values give identical inputs until a
sensor or an admitted message makes the difference.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import cached_property

import msgspec

from lingjing.kernel.commands import reachable
from lingjing.kernel.event_visibility import EventVisibility
from lingjing.kernel.registry import Registry
from lingjing.kernel.rule_sentences import rule_sentences
from lingjing.kernel.stocks import public, stocks
from lingjing.mission.appearance import PHYSICAL
from lingjing.mission.instance import AgentSpec, Cell, ChannelSpec, Entity, Instance
from lingjing.mission.kinds import admitted, engine_kind
from lingjing.mission.schedule import Schedule
from lingjing.mission.seeding import integer
from lingjing.plugins.policy import Brief, Observation, Peer, Picture, Privileged, Resource, RouteEnds
from lingjing.scene.city import City
from lingjing.trace.records import (
    DORMANT,
    Absent,
    AdjudicatedEvent,
    BodyState,
    CellView,
    EntityView,
    EventView,
    FrameInfo,
    Receipt,
    TaskEvent,
)

STATE_FIELDS = ("position", "velocity", "heading_deg", "status")
"""Fields of an entity's state that a channel may name as they are. `resources` and the names of declared states show
what it has in stock, `route` where it is planned to go; `busy` comes with an agent's own resources."""

RESOURCES, ROUTE, BUSY, ALL = "resources", "route", "busy", "*"


_KERNELS = frozenset({"bus", "kernel", "policy"})
"""Whose receipts repeat no more than what agents said themselves."""

_SOMEBODY = "something"


class Projector:
    """The projection of one instance; holds no run-time state. Policies' random streams start from `policy_seed`;
    without a `city` nothing is said of its bounds and roads."""

    def __init__(self, instance: Instance, policy_seed: int = 0, city: City | None = None) -> None:
        self._instance = instance
        self._city = city
        self._policy_seed = policy_seed
        self._entities = {entity.id: entity for entity in instance.entities}
        self._mounted = frozenset((entity.id, camera.name) for entity in instance.entities for camera in entity.cameras)
        self._event_visibility = EventVisibility(instance)
        self._schedule = Schedule(instance)
        self._public = frozenset(entity.id for entity in instance.entities if "position" not in entity.hidden)
        self._unplaced = tuple(f"`{name}`" for name in self._entities if name not in self._public)

    def brief(self, agent: AgentSpec, classes: Sequence[str]) -> Brief:
        """All the agent is told at reset."""
        instance = self._instance
        return Brief(
            agent=agent.id,
            role=agent.role,
            index=agent.index,
            goal=instance.goal,
            prompt=agent.prompt,
            mode=instance.mode,
            hub=instance.comms.hub,
            tick_s=instance.clock.tick_s,
            ticks=instance.budget.ticks,
            seed=integer(self._policy_seed, f"policy/{agent.id}"),
            resources=tuple(self._resource(agent, name) for name in agent.commands),
            peers=tuple(
                Peer(id=peer.id, role=peer.role, resources=peer.controls)
                for peer in instance.agents
                if peer.id != agent.id
            ),
            messages=instance.messages,
            regions=tuple(region for region in instance.regions if not region.hidden),
            cells=self._grid_of(agent),
            classes=tuple(classes),
            weather=self._schedule.weather(0.0),
            water_level_m=instance.scene.datum_m,
            settings=dict(instance.settings),
            rules=self._rules,
            bounds=None if self._city is None else reachable(self._city.bounds),
            payload_bytes=instance.comms.payload_bytes,
            delay_ticks=instance.comms.delay_ticks,
            range_m=instance.comms.range_m,
            loss=instance.comms.loss,
            road_network="" if self._city is None else self._city.network,
            route_ends=self._route_ends,
            decision_s=instance.budget.policy_s,
        )

    @cached_property
    def _route_ends(self) -> tuple[RouteEnds, ...]:
        return tuple(
            RouteEnds(
                vehicle=one.asset,
                start=self._entities[one.asset].position,
                end=self._entities[one.destination].position,
            )
            for one in self._instance.inspections
            if one.destination in self._public and one.asset in self._public
        )

    @cached_property
    def _rules(self) -> tuple[str, ...]:
        return rule_sentences(self._instance)

    def observe(
        self,
        agent: AgentSpec,
        registry: Registry,
        *,
        pictures: Sequence[Picture] = (),
        absent: Sequence[Absent] = (),
        task_events: Sequence[TaskEvent] = (),
        adjudicated: Sequence[AdjudicatedEvent] = (),
    ) -> Observation:
        """The agent's member of O_t: `task_events` are this boundary's, `adjudicated` those of the one before."""
        entities: dict[str, EntityView] = {}
        cells: list[CellView] = []
        events: tuple[EventView, ...] = ()
        for channel in agent.observes:
            if channel.source == "grid":
                cells.extend(self._cells(channel, registry))
            elif channel.source == "events":
                events = self._event_visibility.of(agent, task_events, adjudicated, registry.tick)
            else:
                self._entities_of(agent, channel, registry, entities)
        return Observation(
            agent=agent.id,
            tick=registry.tick,
            time_s=registry.time_s,
            entities=tuple(entities.values()),
            cells=tuple(cells),
            events=events,
            pictures=tuple(picture for picture in pictures if self._shows(agent, picture.entity, picture.camera)),
            absent=tuple(item for item in absent if self._shows(agent, item.entity, item.camera)),
            weather=self._schedule.weather(registry.time_s),
        )

    def told(self, receipt: Receipt) -> Receipt:
        """A receipt as agents read it: an engine may name somebody whose place is hidden as what a body has hit."""
        if receipt.by in _KERNELS or not any(name in receipt.detail for name in self._unplaced):
            return receipt
        detail = receipt.detail
        for name in self._unplaced:
            detail = detail.replace(name, _SOMEBODY)
        return msgspec.structs.replace(receipt, detail=detail)

    def privileged(
        self,
        registry: Registry,
        frames: Iterable[FrameInfo],
        *,
        forbidden: tuple[tuple[str, str], ...] = (),
        city: City | None = None,
    ) -> Privileged:
        """The truth, for a policy that was declared privileged."""
        progress = registry.progress
        return Privileged(
            instance=self._instance,
            states=tuple(msgspec.structs.replace(state, resources=public(state)) for state in registry.states.values()),
            frames=tuple(frames),
            achieved=tuple(registry.achieved),
            emitted=tuple(registry.emitted),
            routes=tuple(registry.routes.values()),
            inspected={name: tuple(sorted(one.seen)) for name, one in progress.inspected.items()},
            used=dict(progress.used),
            forbidden=forbidden,
            city=city,
        )

    def _shows(self, agent: AgentSpec, entity: str, camera: str) -> bool:
        """True for pictures of a mounted camera that the agent's channels show; reference pictures go by `reveal`."""
        return (entity, camera) in self._mounted and agent.receives_pictures(entity, camera)

    def _grid_of(self, agent: AgentSpec) -> tuple[Cell, ...]:
        """The cells of the grids that the agent observes."""
        watched = {channel.name for channel in agent.observes if channel.source == "grid"}
        return tuple(cell for cell in self._instance.cells if cell.grid in watched and not cell.hidden)

    def _resource(self, agent: AgentSpec, name: str) -> Resource:
        entity = self._entities[name]
        return Resource(
            id=entity.id,
            type=entity.type,
            embodied=name in agent.controls,
            verbs=tuple(admitted(verb, engine_kind(entity.engine)) for verb in entity.verbs),
            cameras=entity.cameras,
            properties={
                key: value
                for key, value in entity.properties.items()
                if key not in entity.hidden and key not in PHYSICAL
            },
        )

    def _entities_of(
        self, agent: AgentSpec, channel: ChannelSpec, registry: Registry, into: dict[str, EntityView]
    ) -> None:
        names = (channel.name,) if channel.source == "entity" else self._peer_resources(agent)
        for name in names:
            entity, state = self._entities.get(name), registry.states.get(name)
            if entity is not None and state is not None and name in self._public and state.status != DORMANT:
                shown = _shown(entity, state, channel.fields)
                if ROUTE in channel.fields or ALL in channel.fields:
                    shown[ROUTE] = route.waypoints if (route := registry.routes.get(name)) is not None else None
                if BUSY in channel.fields or name in agent.commands:
                    shown[BUSY] = name in registry.pending
                into[name] = _merged(into.get(name), entity, shown)

    def _peer_resources(self, agent: AgentSpec) -> tuple[str, ...]:
        return tuple(name for peer in self._instance.agents if peer.id != agent.id for name in peer.controls)

    def _cells(self, channel: ChannelSpec, registry: Registry) -> Iterable[CellView]:
        for cell in self._instance.cells:
            if cell.grid == channel.name and not cell.hidden:
                visit = registry.visits.get(cell.name)
                yield CellView(
                    name=cell.name,
                    visited_tick=visit.tick if visit else None,
                    visited_by=visit.entity if visit else None,
                )


def _shown(entity: Entity, state: BodyState, fields: Sequence[str]) -> dict[str, object]:
    """What a channel with these fields shows of an entity's state, by the names of `EntityView`."""
    whole = ALL in fields
    wanted = STATE_FIELDS if whole else tuple(name for name in STATE_FIELDS if name in fields)
    shown: dict[str, object] = {name: getattr(state, name) for name in wanted if name not in entity.hidden}
    named = {spec.name for spec in entity.state if spec.field in fields}
    if RESOURCES not in entity.hidden and (whole or RESOURCES in fields or named):
        # A new mapping each time: the engine's own is not a policy's to change.
        stock = stocks(entity, state)
        everything = whole or RESOURCES in fields
        shown[RESOURCES] = {name: value for name, value in stock.items() if everything or name in named}
    return shown


def _merged(seen: EntityView | None, entity: Entity, shown: dict[str, object]) -> EntityView:
    """A view with a channel's fields added to what other channels already show."""
    base = {} if seen is None else {name: getattr(seen, name) for name in (*STATE_FIELDS, RESOURCES, ROUTE, BUSY)}
    before = base.get(RESOURCES)
    if before is not None:
        shown[RESOURCES] = {**before, **shown.get(RESOURCES, {})}  # type: ignore[dict-item]
    return EntityView(id=entity.id, type=entity.type, **{**base, **shown})
