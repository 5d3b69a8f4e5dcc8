"""ProjectVisible: the part of a boundary that an agent observes, and the brief that it receives before the first.

An agent observes its declared channels and nothing else. A property that the mission marks hidden is never read here.
An entity with a hidden position is never listed, whatever a channel declares. `event_visibility` selects the events.
Two instances that differ only in hidden values therefore produce identical inputs until a sensor or an admitted message
makes a difference.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Sequence
from functools import cached_property

import msgspec

from lingjing.kernel.commands import reachable
from lingjing.kernel.event_visibility import EventVisibility
from lingjing.kernel.gnss import GnssError, GnssErrors, shifted
from lingjing.kernel.imu import InertialUnits, Motion
from lingjing.kernel.pictures import reference_views
from lingjing.kernel.registry import Registry
from lingjing.kernel.rule_sentences import failure_sentences, rule_sentences
from lingjing.kernel.stocks import public_resources, stocks
from lingjing.mission.appearance import PHYSICAL
from lingjing.mission.functions import GNSS, IMU
from lingjing.mission.instance import AgentSpec, Cell, ChannelSpec, Entity, Instance, Weather
from lingjing.mission.kinds import admitted, engine_kind
from lingjing.mission.languages import ORIGINAL
from lingjing.mission.schedule import Schedule
from lingjing.mission.seeding import integer
from lingjing.mission.vocabulary import DORMANT
from lingjing.plugins.policy import Brief, CameraView, Observation, Peer, Picture, Privileged, Resource, RouteEnds
from lingjing.scene.city import City
from lingjing.trace.records import (
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
"""Fields of an entity's state that a channel may name directly.

A channel may also name `resources` or a declared state (the entity's stocks), `route` (its planned waypoints) and
`busy`, which an agent's own resources always carry, and `assignment`, the latest commanded destination.
"""

RESOURCES, ROUTE, BUSY, ASSIGNMENT, ALL = "resources", "route", "busy", "assignment", "*"
"""Further field names of a channel; `*` stands for all of them."""

_TELLS_ASSIGNMENT = "vessel"
"""Engine with bodies that show `assignment` in `*`: the paper's table of engines lists it for surface vessels alone."""


_SENDERS_WITHOUT_REDACTION = frozenset({"bus", "kernel", "policy"})
"""Senders of receipts that repeat only what the agents themselves sent. Their texts need no redaction."""

_ANONYMOUS = "something"
"""Replaces the id of an entity with a hidden position in an engine's receipt."""


class Projector:
    """The projection of one instance. Holds no run-time state."""

    def __init__(self, instance: Instance, policy_seed: int = 0, city: City | None = None) -> None:
        """`policy_seed` starts the random streams of policies. Without a `city`, briefs contain no bounds and no
        roads.
        """
        self._instance = instance
        self._city = city
        self._policy_seed = policy_seed
        self._entities = {entity.id: entity for entity in instance.entities}
        self._mounted = frozenset((entity.id, camera.name) for entity in instance.entities for camera in entity.cameras)
        self._event_visibility = EventVisibility(instance)
        self._schedule = Schedule(instance)
        self._gnss = GnssErrors(instance)
        self._imus = InertialUnits(instance)
        self._public = frozenset(entity.id for entity in instance.entities if "position" not in entity.hidden)
        self._unplaced = tuple(f"`{name}`" for name in self._entities if name not in self._public)

    def brief(self, agent: AgentSpec, classes: Sequence[str]) -> Brief:
        """Return all that the agent receives at reset. `classes` are the types of entities that may be visible."""
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
            settings={k: v for k, v in instance.settings.items() if k not in instance.hidden_settings},
            rules=self._rules,
            failures=self._failures,
            limits=instance.limits,
            language=instance.language,
            local_rules=self._local_rules,
            local_failures=self._local_failures,
            bounds=None if self._city is None else reachable(self._city.bounds),
            payload_bytes=instance.comms.payload_bytes,
            delay_ticks=instance.comms.delay_ticks,
            range_m=instance.comms.range_m,
            loss=instance.comms.loss,
            road_network="" if self._city is None else self._city.network,
            route_ends=tuple(ends for name, ends in self._route_ends if self._knows_place(agent, name)),
            views=self._views(agent),
            decision_s=instance.budget.policy_s,
        )

    def _views(self, agent: AgentSpec) -> tuple[CameraView, ...]:
        """Return the cameras with pictures that the agent's channels show, and its reference pictures."""
        mounted = (
            CameraView(entity=entity.id, camera=camera)
            for entity in self._instance.entities
            for camera in entity.cameras
            if self._shows(agent, entity.id, camera.name)
        )
        return (*mounted, *reference_views(self._instance, agent))

    def _knows_place(self, agent: AgentSpec, name: str) -> bool:
        """True if an agent observes an entity's place, or no agent does: then a prompt or the goal states the place."""
        observers = [
            each.id
            for each in self._instance.agents
            if any(spec.name == name and {"position", ALL} & set(spec.fields) for spec in each.observes)
        ]
        return not observers or agent.id in observers

    @cached_property
    def _route_ends(self) -> tuple[tuple[str, RouteEnds], ...]:
        return tuple(
            (
                inspection.destination,
                RouteEnds(
                    vehicle=inspection.asset,
                    start=self._entities[inspection.asset].position,
                    end=self._entities[inspection.destination].position,
                ),
            )
            for inspection in self._instance.inspections
            if inspection.destination in self._public and inspection.asset in self._public
        )

    @cached_property
    def _failures(self) -> tuple[str, ...]:
        return failure_sentences(self._instance)

    @cached_property
    def _local_rules(self) -> tuple[str, ...]:
        language = self._instance.language
        return () if language == ORIGINAL else rule_sentences(self._instance, language)

    @cached_property
    def _local_failures(self) -> tuple[str, ...]:
        language = self._instance.language
        return () if language == ORIGINAL else failure_sentences(self._instance, language)

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
        motion: Motion | None = None,
    ) -> Observation:
        """Return the agent's observation, its member of O_t.

        `task_events` are those of this boundary, `adjudicated` those of the boundary before: adjudication follows
        observation. `motion` is for inertial units; None without a boundary before.
        """
        entities: dict[str, EntityView] = {}
        cells: list[CellView] = []
        events: tuple[EventView, ...] = ()
        for channel in agent.observes:
            if channel.source == "grid":
                cells.extend(self._cells(channel, registry))
            elif channel.source == "events":
                events = self._event_visibility.visible_events(agent, task_events, adjudicated, registry.tick)
            else:
                self._entities_of(agent, channel, registry, entities)
        measured = self._measured(agent, registry.tick)
        for name, error in measured.items():
            if name in entities:
                entities[name] = _measured_view(entities[name], registry.states[name], error)
        for name in self._carriers(agent, IMU):
            if name in entities:
                reading = self._imus.read(self._entities[name], registry.tick, motion or _at_rest(registry))
                felt = {"specific_force": reading.specific_force, "angular_rate": reading.angular_rate}
                entities[name] = msgspec.structs.replace(entities[name], **felt)
        return Observation(
            agent=agent.id,
            tick=registry.tick,
            time_s=registry.time_s,
            entities=tuple(entities.values()),
            cells=tuple(cells),
            events=events,
            pictures=tuple(
                _measured_picture(picture, measured.get(picture.entity))
                for picture in pictures
                if self._shows(agent, picture.entity, picture.camera)
            ),
            absent=tuple(item for item in absent if self._shows(agent, item.entity, item.camera)),
            weather=self._weather(registry),
        )

    def _measured(self, agent: AgentSpec, tick: int) -> dict[str, GnssError]:
        """Return the errors of the receivers that the agent observes instead of true positions, by entity."""
        return {name: self._gnss.at(self._entities[name], tick) for name in self._carriers(agent, GNSS)}

    def _carriers(self, agent: AgentSpec, sensor: str) -> list[str]:
        """Return the entities with a sensor that the agent observes."""
        names: list[str] = []
        for channel in agent.observes:
            if sensor in channel.fields:
                names += (channel.name,) if channel.source == "entity" else self._peer_resources(agent)
        return [name for name in names if name in self._public and sensor in self._entities[name].properties]

    def _weather(self, registry: Registry) -> Weather:
        """Return the weather of a boundary."""
        if not registry.occurrences:
            return self._schedule.weather(registry.time_s)
        return Schedule(self._instance, registry.occurrences).weather(registry.time_s)

    def redacted(self, receipt: Receipt) -> Receipt:
        """Return the receipt as agents receive it: ids of entities with hidden positions are replaced in engine texts.

        An engine may name such an entity, for example as the body in a collision.
        """
        if receipt.by in _SENDERS_WITHOUT_REDACTION or not any(name in receipt.detail for name in self._unplaced):
            return receipt
        detail = receipt.detail
        for name in self._unplaced:
            detail = detail.replace(name, _ANONYMOUS)
        return msgspec.structs.replace(receipt, detail=detail)

    def privileged(
        self,
        registry: Registry,
        frames: Iterable[FrameInfo],
        *,
        forbidden: tuple[tuple[str, str], ...] = (),
        city: City | None = None,
    ) -> Privileged:
        """Return the ground truth for a policy that is declared privileged."""
        progress = registry.progress
        return Privileged(
            instance=self._instance,
            states=tuple(
                msgspec.structs.replace(state, resources=public_resources(state)) for state in registry.states.values()
            ),
            frames=tuple(frames),
            achieved=tuple(registry.achieved),
            emitted=tuple(registry.emitted),
            routes=tuple(registry.routes.values()),
            inspected={name: tuple(sorted(inspected.seen)) for name, inspected in progress.inspected.items()},
            used=dict(progress.used),
            forbidden=forbidden,
            city=city,
        )

    def _shows(self, agent: AgentSpec, entity: str, camera: str) -> bool:
        """Return whether the agent's channels show pictures of this camera. Reference pictures follow `reveal`
        instead.
        """
        return (entity, camera) in self._mounted and agent.receives_pictures(entity, camera)

    def _grid_of(self, agent: AgentSpec) -> tuple[Cell, ...]:
        """Return the cells of the grids that the agent observes."""
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
                shown = _shown(entity, state, channel.fields, self._event_visibility.withheld(agent, entity))
                if ROUTE in channel.fields or ALL in channel.fields:
                    shown[ROUTE] = route.waypoints if (route := registry.routes.get(name)) is not None else None
                if ASSIGNMENT in channel.fields or (ALL in channel.fields and entity.engine == _TELLS_ASSIGNMENT):
                    shown[ASSIGNMENT] = registry.destinations.get(name)
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
                    seen=registry.seen.get(cell.name, 0.0) if cell.seen else None,
                )


def _shown(entity: Entity, state: BodyState, fields: Sequence[str], withheld: frozenset[str]) -> dict[str, object]:
    """Return the fields of an entity's state that a channel shows, by their names in `EntityView`."""
    whole = ALL in fields
    wanted = STATE_FIELDS if whole else tuple(name for name in STATE_FIELDS if name in fields)
    shown: dict[str, object] = {
        name: getattr(state, name) for name in wanted if name not in entity.hidden and name not in withheld
    }
    named = {spec.name for spec in entity.state if spec.field in fields}
    if RESOURCES not in entity.hidden and (whole or RESOURCES in fields or named):
        # A new mapping for each view: a policy must not be able to change the engine's own.
        stock = stocks(entity, state)
        everything = whole or RESOURCES in fields
        shown[RESOURCES] = {
            name: value for name, value in stock.items() if (everything or name in named) and name not in withheld
        }
    return shown


def _at_rest(registry: Registry) -> Motion:
    return Motion(registry.states, registry.states, 0.0)


def _measured_view(view: EntityView, state: BodyState, error: GnssError) -> EntityView:
    """Return a view with the measured position and velocity in the place of the true ones."""
    position, velocity = shifted(state.position, error.position), shifted(state.velocity, error.velocity)
    return msgspec.structs.replace(view, position=position, velocity=velocity)


def _measured_picture(picture: Picture, error: GnssError | None) -> Picture:
    """Return a picture with the pose that its body has by its receiver; None leaves the true one."""
    if error is None:
        return picture
    pose = msgspec.structs.replace(picture.pose, position=shifted(picture.pose.position, error.position))
    return dataclasses.replace(picture, pose=pose)


_VIEW_FIELDS = (*STATE_FIELDS, RESOURCES, ROUTE, BUSY, ASSIGNMENT)
"""Fields of `EntityView` that channels fill."""


def _merged(seen: EntityView | None, entity: Entity, shown: dict[str, object]) -> EntityView:
    """Return a view with the fields of one more channel."""
    base = {} if seen is None else {name: getattr(seen, name) for name in _VIEW_FIELDS}
    before = base.get(RESOURCES)
    if before is not None:
        shown[RESOURCES] = {**before, **shown.get(RESOURCES, {})}  # type: ignore[dict-item]
    return EntityView(id=entity.id, type=entity.type, **{**base, **shown})
