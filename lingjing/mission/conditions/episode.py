"""`EpisodeKnowledge`: bounds of every quantity that hold during the whole episode, for every policy and every seed.

A condition with `truth(condition, names, EpisodeKnowledge(outline)) is False` never holds. Bounds are as wide as the
engines' declarations permit; a quantity of an engine without a description is unknown.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import msgspec

from lingjing.errors import MissionError
from lingjing.mission import expression as ex
from lingjing.mission.certain import Knowledge, certain, known, truth
from lingjing.mission.conditions.outline import Body, Outline
from lingjing.mission.conditions.spread import extent
from lingjing.mission.functions import TEMPORAL
from lingjing.mission.instance import InteractionSpec
from lingjing.mission.intervals import Bounds
from lingjing.mission.kinds import builtin_engines, engine_kind, levels_m, scene_kind
from lingjing.mission.model import Field
from lingjing.mission.natures import CITY, TargetTraits, later_words, nature_of
from lingjing.mission.operations import AXES
from lingjing.mission.units import field_named
from lingjing.mission.values import Value
from lingjing.mission.vocabulary import DORMANT

EVENT = "event/"
"""Beginning of the name of an event among the givers of a status word."""

NOW = "now"
"""The name of the time of the mission."""

_MEASURED = frozenset(
    ("battery", "battery_wh", "fuel", "fuel_kg", "load_kg", "speed_mps", "odometer_m", "elevation_deg", "range_m")
) | {"next_pass_s"}
"""Quantities that engines measure and report in place of a property of the same name."""

_BAND_SLACK_M = 15.0
"""Metres by which a flying body may leave its altitude band (chosen): overshoot of a climb and gusts."""

_SURFACE_SLACK_M = 10.0
"""Metres by which a body may lie above or below the level of its surface, besides waves (chosen)."""

_ROOF_FACTOR, _ROOF_SLACK_M = 2.0, 50.0
"""Bound of the height of roofs: the scene's greatest height of buildings times the first, plus the second value, metres
(chosen: generous)."""

_PARTIAL = frozenset(("truth", "iou", "sqrt", "min", "max", "distance", "replans", "at"))
"""Functions that may have no value in a run. A limit that does not exist in a mode has unknown bounds."""


class AnyMessage(msgspec.Struct, frozen=True):
    """An arbitrary message of a kind."""

    kind: str


class StatusOf(msgspec.Struct, frozen=True):
    """The status of a body during the episode."""

    body: Body


class PositionOf(msgspec.Struct, frozen=True):
    """The position of a body during the episode."""

    body: Body


class EpisodeKnowledge(Knowledge):
    """The bounds of an outline. Names of groups with one member are that `Body`."""

    def __init__(self, outline: Outline) -> None:
        self.outline = outline
        self._rules = {rule.name: rule for rule in outline.instance.rules}
        self._fields = {spec.kind: {field.name: field for field in spec.fields} for spec in outline.instance.messages}
        self._open: list[str] = []
        self._amounts: dict[tuple[str, str], Value] = {}
        self._last_s = outline.seconds(outline.ticks)
        self._set_fields = outline.set_fields

    def name(self, ref: ex.Ref) -> Value:
        """The time of the episode, an entity, a region or a setting."""
        if ref.kind == "clock" and ref.name == NOW:
            return Bounds(0.0, self._last_s)
        if ref.kind in ("group", "entity"):
            bodies = self.outline.groups.get(ref.name, ())
            return bodies[0] if len(bodies) == 1 else None if bodies else ref.name
        if ref.kind == "param" and ref.name in self.outline.wide:
            return self.outline.wide[ref.name]
        try:
            return known(self.outline.scope.refer(ref))
        except MissionError:
            return None

    def field(self, value: Value, name: str) -> Value:
        """The bounds of a field of an entity, a position or a message."""
        match value:
            case Body() if name == "position":
                return PositionOf(value)
            case Body() if name == "status":
                return StatusOf(value)
            case Body():
                return self.amount(value, name)
            case PositionOf(body=body) if name in AXES:
                return self.coordinate(body, AXES[name])
            case AnyMessage(kind=kind):
                field = self._fields.get(kind, {}).get(name)
                if field is not None:
                    return _field_bounds(field)
                return Bounds(0.0, self._last_s) if name == "sent" else None
        return None

    def members(self, domain: str) -> Sequence[Value] | None:
        """The bodies of a group; None for a message kind."""
        return None if domain in self.outline.kinds else self.outline.groups.get(domain, ())

    def any_member(self, domain: str) -> Value:
        """An arbitrary message."""
        return AnyMessage(domain)

    def answer(self, call: ex.Call, arguments: Sequence[Value]) -> Value:
        """False for a rule that never holds, the bounds of a counter; None for everything else."""
        if not call.rule:
            return never_over_time(call, arguments) if call.function in TEMPORAL else self._counter(call, arguments)
        rule = self._rules.get(call.function)
        if rule is None or rule.name in self._open or len(rule.parameters) != len(arguments):
            return None
        names = {parameter.name: value for parameter, value in zip(rule.parameters, arguments, strict=True)}
        self._open.append(rule.name)
        value = truth(rule.condition, names, self)
        self._open.pop()
        return None if value is True else value

    def defined(self, expr: ex.Expr) -> bool:
        """True if every value in the expression exists at all times."""
        return not any(self._may_lack(part) for part in ex.parts(expr))

    # -- bounds of single quantities

    def amount(self, body: Body, name: str) -> Value:
        """The bounds of a property, state or heading of a body; None if unknown."""
        key = body.id, name
        if key not in self._amounts:
            self._amounts[key] = self._amount(body, name)
        return self._amounts[key]

    def _amount(self, body: Body, name: str) -> Value:
        entity = body.entity
        if name == "heading_deg":
            return None if body.drawn else Bounds(min(0.0, entity.heading_deg), max(360.0, entity.heading_deg))
        state = entity.state_of(name)
        if entity.engine not in builtin_engines():
            return None
        if state is not None:
            own = self._stock(body, name, state.name)
            return self._with_set_values(body, name, own) if (entity.id, name) in self._set_fields else own
        if name in engine_kind(entity.engine).shares and name not in entity.properties:
            return Bounds(0.0, 1.0)
        if name in _MEASURED and entity.role == "asset":
            return None
        value = entity.properties.get(name)
        if isinstance(value, str | bool):
            return value
        return body.bounds(name) if name in body.drawn or value is not None else None

    def _with_set_values(self, body: Body, name: str, own: Value) -> Value:
        """The bounds of a state, with the values that events set; unknown if these depend on a field."""
        whole = own
        for event in self.outline.instance.events:
            for change in event.changes:
                if (change.entity, change.field) != (body.id, name):
                    continue
                if any(isinstance(part, ex.Attr) for part in ex.parts(change.value)):
                    return None
                value = certain(change.value, {}, self)
                if not isinstance(whole, Bounds) or not isinstance(value, Bounds):
                    return None
                # interactions lower what an event has set, and engines keep it from falling below 0
                whole = Bounds(min(whole.low, value.low, 0.0), max(whole.high, value.high))
        return whole

    def _stock(self, body: Body, name: str, plain: str) -> Value:
        """The bounds of a state: between its start value and the limits of the interactions that change it."""
        start, entity = body.bounds(name), body.entity
        if (
            plain == "people"
            or {name, plain} & (_MEASURED - {"load_kg"})
            or not math.isfinite(start.low)
            or not math.isfinite(start.high)
        ):
            return None
        low, high = start
        if any(spec.own == plain for spec in entity.interactions):
            low, high = min(low, 0.0), max(high, 1.0) if plain in ("heat", "flow") else high
        for owner in self.outline.bodies.values():
            for spec in owner.entity.interactions:
                if spec.carried == plain and any(actor.id == body.id for actor in self.outline.actors(spec)):
                    low, high = min(low, 0.0), max(high, _most_given(spec, body))
        if plain in ("heat", "flow"):
            low, high = min(low, 0.0), max(high, 1.0)
        return Bounds(low, high)

    def status_words(self, body: Body) -> Mapping[str, tuple[str, ...]] | None:
        """The status words that a body can have → the interactions that give them, none for a word that it may have at
        the start or without an interaction. None if the words are unknown."""
        entity, kind = body.entity, engine_kind(body.entity.engine)
        if entity.role == "asset":
            return None if kind.words is None else dict.fromkeys((*kind.words, DORMANT), ())
        if entity.engine != CITY or "status" in body.drawn:
            return None
        traits = TargetTraits(
            states=[spec.field for spec in entity.state],
            properties=entity.properties,
            interactions=entity.interactions,
            surface=str(entity.properties.get("on", "")),
            blocks=entity.blocked_m is not None,
        )
        nature = nature_of(traits)
        later = later_words(nature, entity.interactions, [spec.name for spec in entity.state])
        givers: dict[str, tuple[str, ...]] = {
            word: tuple(spec.name for spec in entity.interactions if word in (spec.status, nature.over, spec.done_word))
            for word in later
        }
        first = entity.properties.get("status")
        for event in self.outline.instance.events:
            for change in event.changes:
                if (change.entity, change.field) == (entity.id, "status"):
                    if not isinstance(change.value, ex.Symbol):
                        return None
                    givers[change.value.name] = (*givers.get(change.value.name, ()), EVENT + event.name)
        return givers | dict.fromkeys((str(first or nature.word), nature.vanished, DORMANT), ())

    def coordinate(self, body: Body, axis: int) -> Bounds:
        """The bounds of a coordinate of a body during the episode: 0 for east, 1 for north, 2 for elevation."""
        if axis == 2:
            return self._elevation(body)
        start = extent(body.where, axis)
        reach = self.reach_m(body)
        return Bounds(start.low - reach, start.high + reach)

    def reach_m(self, body: Body) -> float:
        """The largest distance of a body from its declared places during the episode, metres."""
        carriers = [self.outline.bodies[name].speed_mps for name in body.aboard]
        boarding_m = body.aboard_m if carriers else 0.0
        speed = max((body.speed_mps, *carriers))
        if not carriers and math.isfinite(body.tether_m):
            return min(speed * self._last_s, body.idle_mps * self._last_s + body.tether_m) + self.aside_m(body)
        return speed * self._last_s + boarding_m + self.aside_m(body)

    def drift_m(self, body: Body) -> float:
        """The largest distance of a body from its declared places that no command and no carrier causes, metres."""
        speed = body.speed_mps if body.entity.role == "target" else body.idle_mps
        return speed * self._last_s + self.aside_m(body)

    def aside_m(self, body: Body) -> float:
        """The largest distance by which the scene moves a body before the start, metres."""
        kind = scene_kind(self.outline.instance.scene.kind)
        if body.where.loose_m or body.where.drawn:
            return body.where.loose_m
        return math.inf if kind is None else kind.aside_m

    def _elevation(self, body: Body) -> Bounds:
        entity, kind = body.entity, engine_kind(body.entity.engine)
        scene = self.outline.instance.scene
        described = scene_kind(scene.kind)
        if kind.stands_on == "water" and (levels := levels_m(scene, "water")) is not None:
            slack = _SURFACE_SLACK_M + 2.0 * self.outline.wave_m
            return Bounds(levels[0] - slack, levels[1] + slack)
        levelled = described is not None and bool(described.level)
        low = min(0.0, scene.datum_m) - _SURFACE_SLACK_M if kind.landbound and levelled else -math.inf
        band = body.bounds("band_high_m").high
        if not (kind.in_band and levelled and math.isfinite(band)) or "on" in entity.properties:
            return Bounds(low, math.inf)
        return Bounds(low, max(entity.position[2], band, self._roof_m()) + _BAND_SLACK_M)

    def start_top_m(self, body: Body) -> float:
        """Upper bound of the elevation of a body that was never commanded, metres; infinity if unknown."""
        kind, scene = engine_kind(body.entity.engine), scene_kind(self.outline.instance.scene.kind)
        known_place = kind.in_band and kind.stays and scene is not None and bool(scene.level)
        if not known_place or "on" in body.entity.properties:
            return math.inf
        return max(body.entity.position[2], self._roof_m()) + _BAND_SLACK_M

    def _roof_m(self) -> float:
        """Upper bound of the elevation of a roof on which the scene can place a body, metres."""
        scene = self.outline.instance.scene
        described = scene_kind(scene.kind)
        if described is not None and "roof" in described.lacks:
            return 0.0
        usual = described.default("height") if described is not None else ()
        height = scene.options.get("height_high_m", usual[-1] if usual else math.inf)
        return _ROOF_FACTOR * height + _ROOF_SLACK_M if isinstance(height, int | float) else math.inf

    def _counter(self, call: ex.Call, arguments: Sequence[Value]) -> Value:
        if call.function == "used" and arguments:
            limits = [limit.most for limit in self.outline.instance.limits if limit.name == str(arguments[0])]
            return Bounds(0.0, float(sum(limits))) if limits else None
        return Bounds(0.0, math.inf) if call.function in ("replans", "count") else None

    def _may_lack(self, part: ex.Expr) -> bool:
        match part:
            case ex.Call(function=name, rule=False):
                return name in _PARTIAL
            case ex.Aggregate(function=name):
                return name in ("min", "max")
            case ex.Index() | ex.Binary(operator="/"):
                return True
            case ex.Attr(base=ex.Ref(kind="group" | "entity"), name="position"):
                return False
            case ex.Attr(name=name):
                fields = [fields[name] for fields in self._fields.values() if name in fields]
                return any(field.optional for field in fields) or (bool(fields) and name == "position")
        return False


def never_over_time(call: ex.Call, arguments: Sequence[Value]) -> Value:
    """False for a function over time with a condition that is never true; None for another one."""
    required = arguments[:1] if call.function == "before" else arguments[: TEMPORAL[call.function]]
    return False if any(value is False for value in required) else None


def _field_bounds(field: Field) -> Bounds | None:
    if field.type != "number":
        return None
    return Bounds(
        -math.inf if field.minimum is None else field.minimum, math.inf if field.maximum is None else field.maximum
    )


def _most_given(spec: InteractionSpec, body: Body) -> float:
    """Upper bound of an actor's amount that an interaction fills up."""
    if not spec.gives:
        return -math.inf
    limit = field_named(spec.up_to, body.entity.properties) if spec.up_to else None
    return math.inf if limit is None else body.bounds(limit).high
