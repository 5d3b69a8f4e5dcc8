"""The entities of an instance: count, place, properties, cameras and verbs of each member of a group."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from typing import NamedTuple

from lingjing.errors import MissionError, hint_of
from lingjing.mission import expression as ex
from lingjing.mission import geometry2d, model
from lingjing.mission.conditions import spread
from lingjing.mission.draws import Drawn, draw, outline
from lingjing.mission.evaluate import Interval, Members, Place, Scope, Value, describe, evaluate, flag_of, number, whole
from lingjing.mission.instance import (
    ArgumentSpec,
    BehaviourSpec,
    CameraSpec,
    Datum,
    Entity,
    InteractionSpec,
    Scalar,
    StateSpec,
    Vector,
    VerbSpec,
)
from lingjing.mission.kinds import engine_kind
from lingjing.mission.kinds_format import EngineKind, VerbKind
from lingjing.mission.natures import is_never_negative
from lingjing.mission.seeding import redrawn_path

_MAX_MEMBERS = 100_000
"""The largest number of members of a group (chosen)."""
DRAWN_MOST = 4096
"""The largest number of entities in a mission with cameras (chosen)."""

_FIELDS = ("position", "heading_deg")

FARTHEST_M = 1e6
"""A coordinate beyond this comes from a mistaken unit, metres (chosen): the scene's flat frame holds for kilometres."""

_LOWEST_M = -500.0
"""A lower elevation comes from a mistaken sign or unit, metres (chosen): the lowest shore, that of the Dead Sea, is at
-430 m."""
_HIGHEST_M = 30_000.0
"""A higher elevation comes from a mistaken unit, metres (chosen): aircraft fly below 30 km. Satellites are exempt."""

DISPLACED_M = 50.0
"""Farthest permitted move in a mission without the option `displacement`, metres (chosen: half a block of houses)."""

GROUND_REACH_M = 200.0
"""The largest distance by which the scene moves an entity that is `on = ground` or inside an obstacle, to the nearest
free ground, metres (chosen)."""

_POSITIVE = ("cruise_mps", "endurance_s", "swath_m")
"""Abilities of bodies that must be greater than zero."""
_NON_NEGATIVE = ("speed_mps", "drift_mps", "payload_kg", "load_kg", "radius_m")
"""Abilities of bodies that must not be negative."""


def place_fault(place: tuple[float, ...], engine: str) -> str:
    """The reason why no body of an engine can be at a place, or "". `place` is east, north and, if known, elevation in
    metres."""
    shown = f"({', '.join(f'{metres:g} m' for metres in place)})"
    if not all(abs(metres) <= FARTHEST_M for metres in place):
        return f"{shown} is beyond every scene: coordinates are metres from its origin, {FARTHEST_M:,.0f} at most"
    if not engine_kind(engine).orbits and len(place) == 3 and not _LOWEST_M <= place[2] <= _HIGHEST_M:
        return f"{shown} is no place: elevations lie between {_LOWEST_M:g} m and {_HIGHEST_M:,.0f} m"
    return ""


COUNT = "count"
"""The hidden property of a group with a hidden number of members."""


class NodeError(MissionError):
    """An error at one node of a mission."""

    path: str
    """The node: `ssr/boat`."""
    message: str
    """The message without the path."""

    def __init__(self, path: str, error: MissionError) -> None:
        super().__init__(f"{path}: {error}", hint=hint_of(error))
        inner = error if isinstance(error, NodeError) else None
        self.path = inner.path if inner else path
        self.message = inner.message if inner else str(error)


class at_path:  # noqa: N801 - used as a function; entered thousands of times, which a generator makes slow
    """Prefix the message of any `MissionError` raised inside with the node's path."""

    __slots__ = ("_path",)

    def __init__(self, path: str) -> None:
        self._path = path

    def __enter__(self) -> None:
        return None

    def __exit__(self, kind: object, error: BaseException | None, traceback: object) -> None:
        if isinstance(error, MissionError):
            raise NodeError(self._path, error) from error


def holds(guard: model.Guard | None, scope: Scope) -> bool:
    """True if a declaration exists in this mode and with these parameters."""
    if guard is None:
        return True
    value = evaluate(guard.condition, scope)
    if not isinstance(value, bool):
        raise MissionError(f"'when' takes true or false, not {describe(value)}")
    return value


def count_of(count: ex.Expr | None, scope: Scope) -> int:
    """The number of members of an indexed declaration (`n` or `1..n`); 1 for a single entity."""
    if count is None:
        return 1
    if isinstance(count, ex.Range):
        if whole(count.low, scope) != 1:
            raise MissionError("members are counted from 1", hint="write the index as 1..n")
        count = count.high
    members = whole(count, scope)
    if not 0 <= members <= _MAX_MEMBERS:
        raise MissionError(f"{members} members are declared, and 0 to {_MAX_MEMBERS} are possible")
    return members


def member_ids(name: str, count: ex.Expr | None, scope: Scope) -> tuple[str, ...]:
    """`uav[1]`, `uav[2]`, … for an indexed declaration, the bare name for a single one."""
    if count is None:
        return (name,)
    return tuple(f"{name}[{k}]" for k in range(1, count_of(count, scope) + 1))


_LITERALS = (ex.Number, ex.Symbol, ex.Text, ex.Flag)


class DrawnGroup(NamedTuple):
    """The members of a group, and what was drawn anew for them."""

    members: tuple[Entity, ...]
    anew: tuple[str, ...]
    """`group.property` of each property that was drawn anew because its first draw left no room for a member."""


def entities(
    group: model.Group,
    scope: Scope,
    *,
    mission: str,
    seed: int,
    datum_m: float,
    template_draw: ex.Expr | None = None,
    redraw: int = 0,
    hidden_redraw: int = 0,
) -> DrawnGroup:
    """The members of one group. `scope.members` must have every group; `mission` is part of the names of random
    streams.

    `template_draw` is the draw by which a document's template places a group. The document then gives the places.
    `redraw` is the number of draws that did not meet a requirement, `hidden_redraw` that of the hidden values alone.
    """
    ids = scope.members[group.name]
    drawn = {
        prop.name: _values(
            group,
            prop,
            scope,
            seed=seed,
            path=redrawn_path(f"{mission}/{group.name}/{prop.name}", redraw + hidden_redraw * prop.hidden),
            count=len(ids),
        )
        for prop in group.properties
    }
    columns = {name: values.values for name, values in drawn.items()}
    if "position" not in columns:
        raise MissionError(f"{mission}/{group.name} has no position", hint=f"give '{group.name}' a position")
    cameras = tuple(_camera(camera, scope, f"{mission}/{group.name}/{camera.name}") for camera in group.cameras)
    verbs = tuple(
        _verb(verb, scope, f"{mission}/{group.name}/{verb.name}", engine_kind(group.engine)) for verb in group.verbs
    )
    hidden = tuple(
        sorted({prop.name for prop in group.properties if prop.hidden} | ({COUNT} if group.hides_count else set()))
    )
    state = tuple(StateSpec(name=prop.plain, unit=prop.unit) for prop in group.properties if prop.state)
    _check_abilities(group, columns, mission, scope)
    drifts = "drift_mps" in columns
    interactions = tuple(
        _interaction(each, scope, f"{mission}/{group.name}/{each.name}", drifts) for each in group.interactions
    )
    with at_path(f"{mission}/{group.name}/position"):
        drawn_in = _drawn_in(group, template_draw, columns["position"], scope)
    members = []
    for k, entity_id in enumerate(ids):
        path = f"{mission}/{entity_id}"
        with at_path(path):
            values = {name: column[k] for name, column in columns.items()}
            members.append(
                Entity(
                    id=entity_id,
                    group=group.name,
                    index=k + 1,
                    role=group.role,
                    type=group.type,
                    engine=group.engine,
                    position=_position(values["position"], datum_m, group.engine),
                    heading_deg=_heading(values.get("heading_deg", 0.0)),
                    label=group.labels[k] if k < len(group.labels) else "",
                    properties={name: datum(v, datum_m) for name, v in values.items() if name not in _FIELDS},
                    hidden=hidden,
                    cameras=cameras,
                    verbs=verbs,
                    state=state,
                    bases=group.bases,
                    interactions=interactions,
                    drawn_in=drawn_in,
                    mounts=group.mounts,
                    parts=group.parts,
                    behaviour=_behaviour(group, scope.binding(group.index, float(k + 1)), entity_id),
                )
            )
    return DrawnGroup(tuple(members), tuple(f"{group.name}.{name}" for name, values in drawn.items() if values.anew))


def _interaction(interaction: model.Interaction, scope: Scope, path: str, drifts: bool) -> InteractionSpec:
    common_fields = {name: getattr(interaction, name) for name in model.Exchange.__struct_fields__}
    with at_path(path):
        return InteractionSpec(
            within_m=number(interaction.within, scope),
            lasting_s=None if interaction.lasting is None else number(interaction.lasting, scope),
            aboard=drifts if interaction.aboard is None else flag_of(interaction.aboard, scope),
            **common_fields,
        )


def _behaviour(group: model.Group, scope: Scope, own_id: str) -> BehaviourSpec | None:
    declared = group.behaviour
    if declared is None:
        return None
    speed_mps = number(declared.speed, scope)
    distance_m = 0.0 if declared.distance is None else number(declared.distance, scope)
    if speed_mps <= 0.0 or distance_m < 0.0:
        message = f"`{declared.kind}` has a speed of {speed_mps:g} m/s and a distance of {distance_m:g} m"
        raise MissionError(message, hint="the speed must be greater than 0, the distance 0 or greater")
    others = Members(()) if declared.of is None else evaluate(declared.of, scope)
    if not isinstance(others, Members):
        raise MissionError(f"`{declared.kind}` names bodies, not {describe(others)}")
    return BehaviourSpec(
        kind=declared.kind,
        speed_mps=speed_mps,
        of=tuple(name for name in others.ids if name != own_id),
        distance_m=distance_m,
        region=declared.region,
    )


def _check_abilities(group: model.Group, columns: Mapping[str, Collection[Value]], mission: str, scope: Scope) -> None:
    """Raise `MissionError` for an impossible speed, endurance or load, or for a negative state that interactions
    change.

    Of a value drawn from a list or a range, the least possible one is checked too: another seed draws it.
    """
    if not engine_kind(group.engine).standard_properties:
        return
    for prop in group.properties:
        amount = is_never_negative(prop.plain, group.interactions)
        if not amount and prop.name not in _POSITIVE and prop.name not in _NON_NEGATIVE:
            continue
        with at_path(f"{mission}/{group.name}/{prop.name}"):
            for value in (value for value in columns[prop.name] if isinstance(value, float)):
                _check_ability(prop, value, f"is {value:g}")
            if isinstance(prop.value, ex.Draw) and math.isfinite(least := spread.numbers(prop.value, scope).low):
                _check_ability(prop, least, f"can be {least:g}")


def _check_ability(prop: model.Property, value: float, described: str) -> None:
    if prop.name in _POSITIVE and value <= 0.0:
        raise MissionError(f"`{prop.plain}` {described}", hint="it must be greater than 0")
    if prop.name not in _POSITIVE and value < 0.0:
        raise MissionError(f"`{prop.plain}` {described}", hint="it must be 0 or greater")


def _drawn_in(
    group: model.Group, template_draw: ex.Expr | None, places: tuple[Value, ...], scope: Scope
) -> geometry2d.Polygon:
    """The outline from which the members' places are drawn, or () if they are not drawn.

    For places from a document it is the outline of its template's draw, if all of them lie in it. A document that was
    written from a draw is therefore played like that draw.
    """
    value = next((prop.value for prop in group.properties if prop.name == "position"), None)
    if isinstance(value, ex.Draw) or template_draw is None:
        return () if value is None else outline(value, scope)
    polygon = outline(template_draw, scope)
    inside = (isinstance(place, Place) and geometry2d.contains(polygon, place.east, place.north) for place in places)
    return polygon if polygon and all(inside) else ()


def single(prop: model.Property, scope: Scope, *, seed: int, path: str) -> Value:
    """The value of a property of the weather or the scene."""
    with at_path(path):
        if isinstance(prop.value, ex.Draw):
            return draw(prop.value, scope, seed=seed, path=path, count=1).values[0]
        return evaluate(prop.value, scope)


def datum(value: Value, datum_m: float) -> Datum:
    """A value as plain data: a point becomes three numbers, a range two, an entity its id."""
    match value:
        case Place():
            return _vector(value, datum_m)
        case Interval(low=low, high=high):
            return (low, high)
        case Members(ids=(only,)):
            return only
        case Members(ids=ids):
            return ids
        case bool() | float() | str():
            return value
        case tuple():
            return tuple(_scalar(item) for item in value)
    raise MissionError(f"{describe(value)} cannot be kept as a property")


def _scalar(value: Value) -> Scalar:
    if isinstance(value, bool | float | str):
        return value
    if isinstance(value, Members) and len(value.ids) == 1:
        return value.ids[0]
    raise MissionError(f"{describe(value)} cannot stand in a property's list")


def _values(group: model.Group, prop: model.Property, scope: Scope, *, seed: int, path: str, count: int) -> Drawn:
    with at_path(path):
        if isinstance(prop.value, ex.Draw):
            return draw(prop.value, scope, seed=seed, path=path, count=count)
        if isinstance(prop.value, _LITERALS):  # the same for every member
            return Drawn((evaluate(prop.value, scope),) * count)
        members = range(1, count + 1)
        return Drawn(tuple(evaluate(prop.value, scope.binding(group.index, float(k))) for k in members))


def _vector(value: Value, datum_m: float) -> Vector:
    if not isinstance(value, Place):
        raise MissionError(f"a position is a point, not {describe(value)}")
    place = value.east, value.north, datum_m if value.elevation is None else value.elevation
    if not all(abs(metres) <= FARTHEST_M for metres in place):
        raise MissionError(
            f"a position of ({', '.join(f'{metres:g}' for metres in place)}) m is beyond the scene",
            hint=f"coordinates are metres from the scene's origin, {FARTHEST_M:g} at most",
        )
    return place


def _position(value: Value, datum_m: float, engine: str) -> Vector:
    place = _vector(value, datum_m)
    fault = place_fault(place, engine)
    if fault:
        raise MissionError(fault, hint="check the sign and the unit of the elevation")
    return place


def _heading(value: Value) -> float:
    if isinstance(value, bool) or not isinstance(value, float):
        raise MissionError(f"a heading is an angle, not {describe(value)}")
    return value % 360.0


def _camera(camera: model.Camera, scope: Scope, path: str) -> CameraSpec:
    with at_path(path):
        width, height, hfov = whole(camera.width, scope), whole(camera.height, scope), number(camera.hfov, scope)
        if not (16 <= width <= 16_384 and 16 <= height <= 16_384):
            raise MissionError(f"{width} by {height} pixels", hint="a picture has 16 to 16384 pixels a side")
        if not 0 < hfov < 180:
            raise MissionError(f"hfov = {hfov:g} deg", hint="a field of view lies between 0 and 180 deg")
        return CameraSpec(
            name=camera.name,
            view=camera.view,
            width=width,
            height=height,
            hfov_deg=hfov,
            channels=camera.channels,
            capture=camera.capture,
        )


def _verb(verb: model.Verb, scope: Scope, path: str, engine: EngineKind) -> VerbSpec:
    kind = engine.verbs.get(verb.name, VerbKind())
    with at_path(path):
        return VerbSpec(
            name=verb.name,
            arguments=tuple(_argument(argument, scope) for argument in verb.arguments),
            doc=verb.doc or kind.doc,
            motion=kind.motion,
        )


def _argument(argument: model.Argument, scope: Scope) -> ArgumentSpec:
    low, high, default = (
        None if bound is None else number(bound, scope)
        for bound in (argument.minimum, argument.maximum, argument.default)
    )
    if low is not None and high is not None and low > high:
        raise MissionError(f"argument '{argument.name}' is bounded by {low:g}..{high:g}, which is empty")
    return ArgumentSpec(
        name=argument.name,
        unit=argument.dimension,
        minimum=low,
        maximum=high,
        default=default,
        optional=argument.optional,
    )
