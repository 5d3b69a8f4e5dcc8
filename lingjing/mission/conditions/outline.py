"""`Outline`: an instance in which every value that depends on the seed is widened to its possible values.

`of_instance` widens nothing: a proof holds for that instance. `of_mission` uses the default settings and leaves every
draw open: a proof holds for every seed. Checks read only outlines.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import msgspec

from lingjing.errors import MissionError
from lingjing.mission import expression as ex
from lingjing.mission import model
from lingjing.mission.alternatives import with_alternatives
from lingjing.mission.conditions.drawn_params import Wide, loosened, property_bounds, property_places, reads
from lingjing.mission.conditions.motion import Air, bounds, ceiling, flight_s, moving_verbs, roaming_verbs
from lingjing.mission.conditions.spread import PossiblePlaces, numbers, places, point
from lingjing.mission.evaluate import Area, Scope, number
from lingjing.mission.instance import AgentSpec, Allowance, Budget, Entity, Instance, InteractionSpec
from lingjing.mission.instance_entities import DISPLACED_M, GROUND_REACH_M, count_of
from lingjing.mission.instance_rules import in_seconds
from lingjing.mission.instantiate import instantiate, parameters
from lingjing.mission.intervals import Bounds
from lingjing.mission.kinds import DISPLACEMENT, engine_kind

ENTITIES_MOST = 150
"""A mission with more entities or agents is not checked, because compilation must stay fast (chosen)."""

_MAX_DISPLACEMENT_M = {"ground": GROUND_REACH_M} | dict.fromkeys(
    ("road", "water", "roof", "facade", "bridge", "pipe"), 1000.0
)
"""The largest distance, metres, by which the scene moves an entity declared `on` a surface: only the built city has the
surface's position."""


_PLACING_M = 10.0
"""Metres by which a body can stand beside its place in the city (chosen): the middle of a lane, a kerb, a wall."""


_SWAY_M = 20.0
"""Metres by which a body may leave its place that no command moves in the plane (chosen): it sways as it climbs or
turns."""


class Body(msgspec.Struct, frozen=True):
    """An entity with bounds of what it can do."""

    entity: Entity
    where: PossiblePlaces
    """Its possible start positions."""
    drawn: dict[str, Bounds]
    """Bounds of its properties that are drawn."""
    speed_mps: float
    """Upper bound of its speed over ground, m/s."""
    flight_s: float
    """Upper bound of its flight time on one battery, seconds."""
    driven: bool
    """True if some agent may command it to move."""
    idle_mps: float = math.inf
    """Upper bound of its speed before its first command, m/s."""
    tether_m: float = math.inf
    """The largest distance from its start at which its own commands can bring it, metres."""
    sway_m: float = 0.0
    """The largest distance by which commands that only raise or turn it can move it in the plane, metres."""
    aboard: frozenset[str] = frozenset()
    """Ids of the entities that may carry it away."""
    aboard_m: float = 0.0
    """The largest distance from which it can be taken aboard, metres."""

    @property
    def id(self) -> str:
        """The entity's id."""
        return self.entity.id

    @property
    def path(self) -> str:
        """The path of its declaration."""
        return f"{self.entity.role}/{self.entity.group}"

    def bounds(self, name: str) -> Bounds:
        """The bounds of a property at the start."""
        return bounds(self.entity, self.drawn, name)


class Outline(msgspec.Struct, frozen=True):
    """The input of the checks."""

    instance: Instance
    scope: Scope
    bodies: dict[str, Body]
    groups: dict[str, tuple[Body, ...]]
    """The members of every group that exists in this mode."""
    kinds: frozenset[str]
    """The declared message kinds, including those without a sender in this mode."""
    drawn_sites: tuple[tuple[str, int, PossiblePlaces], ...] = ()
    """(name, number of members, region) of each group with drawn places."""
    wave_m: float = 0.0
    """The highest waves of the mission, metres."""
    first_ticks: Mapping[str, int] = {}
    """Event with a drawn time → its earliest tick."""
    wide: Wide = {}
    """The bounds of drawn params without a value."""

    @property
    def set_fields(self) -> frozenset[tuple[str, str]]:
        """(entity, `status` or a state by its name in rules) of everything that events set."""
        return frozenset((change.entity, change.field) for event in self.instance.events for change in event.changes)

    @property
    def ticks(self) -> int:
        """The budget of the whole episode."""
        return self.instance.budget.ticks

    def seconds(self, ticks: float) -> float:
        """Ticks as seconds of mission time."""
        return ticks * self.instance.clock.tick_s

    def actors(self, interaction: InteractionSpec) -> tuple[Body, ...]:
        """The bodies that may perform an interaction."""
        return tuple(self.bodies[actor.id] for actor in self.instance.actors(interaction))


def of_instance(instance: Instance) -> Outline:
    """The exact outline of one instance."""
    weathers = (instance.weather, *(event.weather for event in instance.events if event.weather is not None))
    air = Air(
        max(weather.wind_mps for weather in weathers),
        max(weather.current_mps for weather in weathers),
        max(weather.wave_height_m for weather in weathers),
    )
    return _outline(instance, _scope(instance), air, {}, frozenset(message.kind for message in instance.messages))


def of_mission(
    mission: model.Mission, mode: str, settings: Mapping[str, float] | None = None, wide: Wide | None = None
) -> Outline:
    """The outline of a mission at its default settings, for every seed. `settings` has a value for each drawn param.

    The values of the params `wide` are left open. Raises `MissionError` if the mission cannot be evaluated, or if a
    param without a setting is drawn.
    """
    settings, wide = settings or {}, wide or {}
    for param in mission.parameters:
        if isinstance(param.default, ex.Draw) and param.name not in settings:
            raise MissionError(f"the value of `{param.name}` is drawn: nothing holds for every seed")
    values = parameters(mission, mode, settings)
    mission = with_alternatives(mission, Scope(parameters=values, mode=mode))
    mission = loosened(mission, wide)
    instance = instantiate(_without_draws(mission, wide), mode=mode, settings=settings, is_chosen=True)
    scope = _scope(instance, _open_regions(mission, wide))
    scope = msgspec.structs.replace(scope, parameters=_known(scope.parameters, wide))
    opened = {group.name: _opened(group, scope, wide) for group in mission.groups if _is_there(group.name, instance)}
    kinds = frozenset(kind.name for kind in mission.messages)
    return _outline(
        instance,
        scope,
        _air(mission, scope, wide),
        opened,
        kinds,
        first_ticks=_first_ticks(mission, scope, wide),
        wide=wide,
        displaced_m=_displaced_m(mission, instance, wide),
    )


class Outlines:
    """The outlines of one mission, each made once: several checks read those of the default settings."""

    def __init__(self, mission: model.Mission) -> None:
        self.mission = mission
        self._made: dict[tuple[str, tuple[tuple[str, float], ...]], Outline] = {}

    def of(self, mode: str, settings: Mapping[str, float] | None = None, wide: Wide | None = None) -> Outline:
        """`of_mission` of the mission. Those with wide params are made each time."""
        if wide:
            return of_mission(self.mission, mode, settings, wide)
        key = mode, tuple(sorted((settings or {}).items()))
        if key not in self._made:
            self._made[key] = of_mission(self.mission, mode, settings)
        return self._made[key]


def _displaced_m(mission: model.Mission, instance: Instance, wide: Wide) -> float:
    """The farthest that the scene may move a body from its declared place, metres; infinity if that is not known."""
    if mission.origin.document or mission.origin.places or wide:
        return math.inf  # the bodies of an imported document are moved as far as its city requires
    option = instance.scene.options.get(DISPLACEMENT, DISPLACED_M)
    return max(float(option), DISPLACED_M) + _PLACING_M if isinstance(option, int | float) else math.inf


def _first_ticks(mission: model.Mission, scope: Scope, wide: Wide) -> dict[str, int]:
    """The earliest tick of each event with a drawn time."""
    ticks = {}
    for event in mission.events:
        if event.at is not None and _is_open(event.at, wide):
            low = property_bounds(event.at, wide, "", 1).low
            if isinstance(event.at, ex.Draw) and not reads(event.at, wide):
                low = numbers(event.at, scope).low
            low = low / scope.tick_s if in_seconds(event.at) else low
            ticks[event.name] = max(0, math.ceil(low - 1e-9)) if math.isfinite(low) else 0
    return ticks


def _known(settings: Mapping[str, float], wide: Wide) -> Mapping[str, float]:
    return {name: value for name, value in settings.items() if name not in wide} if wide else settings


def _is_open(value: ex.Expr, wide: Wide) -> bool:
    """True if the value depends on the seed."""
    return isinstance(value, ex.Draw) or reads(value, wide)


def too_large(mission: model.Mission, mode: str) -> bool:
    """True if the mission has more entities or agents than are checked. Raises `MissionError` if they cannot be
    counted."""
    if max(len(mission.groups), len(mission.agents)) > ENTITIES_MOST:
        return True
    scope = Scope(parameters=parameters(mission, mode, {}), mode=mode)
    return any(
        sum(count_of(part.count, scope) for part in parts) > ENTITIES_MOST for parts in (mission.groups, mission.agents)
    )


_Opened = tuple[PossiblePlaces | None, dict[str, Bounds]]
"""The possible places of a group's members if they are drawn, else None, and the bounds of its drawn numbers."""


def _outline(
    instance: Instance,
    scope: Scope,
    air: Air,
    opened: dict[str, _Opened],
    kinds: frozenset[str],
    *,
    first_ticks: Mapping[str, int] | None = None,
    wide: Wide | None = None,
    displaced_m: float = math.inf,
) -> Outline:
    driven = {name for agent in able_agents(instance) for name in agent.commands}
    driven |= {inspection.asset for inspection in instance.inspections}  # the kernel commands their routes
    bodies = {entity.id: _body(entity, air, opened, driven, instance, displaced_m) for entity in instance.entities}
    groups: dict[str, list[Body]] = {}
    for body in bodies.values():
        groups.setdefault(body.entity.group, []).append(body)
    whole = {name: tuple(bodies_of_group) for name, bodies_of_group in groups.items()}
    sites = tuple((name, len(whole.get(name, ())), where) for name, (where, _) in opened.items() if where)
    return Outline(instance, scope, bodies, whole, kinds, sites, air.wave_m, first_ticks or {}, wide or {})


def able_agents(instance: Instance) -> tuple[AgentSpec, ...]:
    """The agents that are called at all: none without an allowance of tokens or money from the start."""
    if _spent(instance.budget):
        return ()
    return tuple(agent for agent in instance.agents if agent.budget is None or not _spent(agent.budget))


def _spent(bound: Budget | Allowance) -> bool:
    return any(most is not None and most <= 0 for most in (bound.tokens, bound.money_usd))


def _body(
    entity: Entity, air: Air, opened: dict[str, _Opened], driven: set[str], instance: Instance, displaced_m: float
) -> Body:
    where, drawn = opened.get(entity.group, (None, {}))
    place = point(entity.position[0], entity.position[1]) if where is None else where
    loose_m = _MAX_DISPLACEMENT_M.get(str(entity.properties.get("on")), 0.0)
    if where is None:
        loose_m = min(loose_m, displaced_m)
    moves = entity.id in driven and bool(moving_verbs(entity))
    carrying = [interaction for interaction in entity.interactions if interaction.aboard]
    return Body(
        entity=entity,
        where=msgspec.structs.replace(place, loose_m=loose_m),
        drawn=drawn,
        speed_mps=ceiling(entity, drawn, air, driven=moves),
        flight_s=flight_s(entity, drawn),
        driven=moves,
        idle_mps=ceiling(entity, drawn, air, driven=False),
        tether_m=_SWAY_M if engine_kind(entity.engine).stays and not roaming_verbs(entity) else math.inf,
        sway_m=_SWAY_M if len(roaming_verbs(entity)) < len(moving_verbs(entity)) else 0.0,
        aboard=frozenset(actor.id for interaction in carrying for actor in instance.actors(interaction)),
        aboard_m=max((interaction.within_m for interaction in carrying), default=0.0),
    )


def _scope(instance: Instance, unknown: frozenset[str] = frozenset()) -> Scope:
    """The scope of static expressions; regions that are not known yet are left out."""
    ids: dict[str, list[str]] = {}
    for entity in instance.entities:
        ids.setdefault(entity.group, []).append(entity.id)
    return Scope(
        parameters=instance.settings,
        mode=instance.mode,
        areas={
            region.name: Area(region.polygon)
            for region in instance.regions
            if region.polygon and region.name not in unknown
        },
        members={name: tuple(members) for name, members in ids.items()},
        tick_s=instance.clock.tick_s,
    )


def _open_regions(mission: model.Mission, wide: Wide) -> frozenset[str]:
    """Regions around entities with places that are drawn or found by the scene, directly or through other regions, and
    those with a shape that is drawn."""
    loose = {
        group.name
        for group in mission.groups
        if any(p.name == "on" or (p.name == "position" and _is_open(p.value, wide)) for p in group.properties)
    }
    open_names: set[str] = set()
    for region in mission.regions:
        around = any(isinstance(leaf, ex.Ref) and leaf.name in loose | open_names for leaf in ex.leaves(region.shape))
        if around or reads(region.shape, wide):
            open_names.add(region.name)
    return frozenset(open_names)


def _is_there(group: str, instance: Instance) -> bool:
    return any(entity.group == group for entity in instance.entities)


def _opened(group: model.Group, scope: Scope, wide: Wide) -> _Opened:
    where: PossiblePlaces | None = None
    drawn: dict[str, Bounds] = {}
    for prop in group.properties:
        if not _is_open(prop.value, wide):
            continue
        of_param = reads(prop.value, wide)
        if prop.name == "position":
            size = count_of(group.count, scope)
            where = (
                property_places(prop.value, wide, group.index, size)
                if of_param
                else _places(prop.value, scope, group.name)
            )
        elif of_param:
            drawn[prop.name] = property_bounds(prop.value, wide, group.index, count_of(group.count, scope))
        elif isinstance(prop.value, ex.Draw):
            drawn[prop.name] = numbers(prop.value, scope)
    return where, drawn


def _places(value: ex.Expr, scope: Scope, group: str) -> PossiblePlaces:
    """Every place of a draw; any place in a region that is not known yet."""
    if not isinstance(value, ex.Draw):
        return PossiblePlaces()
    try:
        return places(value, scope, group)
    except MissionError:
        return PossiblePlaces()


def _air(mission: model.Mission, scope: Scope, wide: Wide) -> Air:
    weathers = [mission.weather, *(change.weather for event in mission.events for change in event.changes)]
    return Air(
        *(
            max(
                (_upper_bound(prop, scope, wide) for weather in weathers for prop in weather if prop.name == name),
                default=0,
            )
            for name in ("wind_mps", "current_mps", "wave_height_m")
        )
    )


def _upper_bound(prop: model.Property, scope: Scope, wide: Wide) -> float:
    if reads(prop.value, wide):
        return property_bounds(prop.value, wide, "", 1).high
    return numbers(prop.value, scope)[1] if isinstance(prop.value, ex.Draw) else number(prop.value, scope)


# -- the mission with its draws taken out ---------------------------------------------------------------------------

_ORIGIN = ex.Point((ex.Number(0.0, "m"), ex.Number(0.0, "m")))
_ZERO = ex.Number(0.0)


def _without_draws(mission: model.Mission, wide: Wide) -> model.Mission:
    """Return the mission with a constant in place of every draw: its instantiation needs no random numbers and cannot
    fail by chance. A place that reads a wide param keeps its elevation."""
    return msgspec.structs.replace(
        mission,
        requirements=(),
        groups=tuple(
            msgspec.structs.replace(g, properties=_constant_properties(g.properties, wide)) for g in mission.groups
        ),
        weather=_constant_properties(mission.weather, wide),
        scene=msgspec.structs.replace(mission.scene, options=_constant_properties(mission.scene.options, wide)),
        events=tuple(_constant_event(event, wide) for event in mission.events),
    )


def _constant_properties(properties: tuple[model.Property, ...], wide: Wide) -> tuple[model.Property, ...]:
    return tuple(
        msgspec.structs.replace(prop, value=_constant(prop), relation="=") if _is_open(prop.value, wide) else prop
        for prop in properties
    )


def _constant(prop: model.Property) -> ex.Expr:
    if isinstance(prop.value, ex.Point):
        return ex.Point((*_ORIGIN.items, *prop.value.items[2:]))
    return _ORIGIN if prop.name == "position" else _ZERO


def _constant_event(event: model.EventDeclaration, wide: Wide) -> model.EventDeclaration:
    changes = tuple(msgspec.structs.replace(c, weather=_constant_properties(c.weather, wide)) for c in event.changes)
    at = _ZERO if event.at is not None and _is_open(event.at, wide) else event.at
    return msgspec.structs.replace(event, at=at, changes=changes)
