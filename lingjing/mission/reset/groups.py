"""Fill a group of the template from a `resetScenario`: count, places, headings, labels and measures."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from itertools import pairwise
from typing import NamedTuple, TypeGuard

import msgspec

from lingjing.mission import expression as ex
from lingjing.mission import frames, model
from lingjing.mission.evaluate import Scope
from lingjing.mission.instance_entities import FARTHEST_M, holds, place_fault
from lingjing.mission.instantiate import parameters, scene_spec
from lingjing.mission.kinds import engine_kind
from lingjing.mission.reset.document import Parsed
from lingjing.mission.reset.elements import elements_fault
from lingjing.mission.reset.frame import (
    FAR_M,
    FLYING,
    GROUND_HIGH_M,
    HIDDEN_HIGH_M,
    LOW_M,
    ON_THE_GROUND,
    DocumentFrame,
)
from lingjing.mission.reset.shapes import Coordinates, Equipment, HiddenPlace, Satellite
from lingjing.mission.reset.template import fleet_of
from lingjing.mission.tiers import without_settings

_MOST = 1e9
"""Upper bound of every measure of a hidden place (chosen)."""


class Measure(NamedTuple):
    """A number of a hidden place that sets a property of the target."""

    field: str
    """Its field in the document."""
    property: str
    """The property that it sets."""
    says: str
    """The quantity in words."""
    unit: str = ""
    """The property's unit."""
    per_unit: float = 1.0
    """Number of the document's units in one of the property's."""
    said_in: str = ""
    """The document's unit in words."""
    least: float = 0.0
    """Its smallest value."""

    def fits(self, value: object) -> TypeGuard[float]:
        """True if a value of the document is such a number."""
        return isinstance(value, int | float) and not isinstance(value, bool) and self.least <= value < _MOST


MEASURES = (
    Measure("weight", "demand_kg", "demand", "kg", said_in="kg"),
    Measure("personCount", "people", "people"),
    Measure("spacing", "spacing_m", "spacing", "m", 100.0, "centimetres", 20.0),
    Measure("range", "range_m", "range", "m", 100.0, "centimetres"),
    Measure("scale", "scale", "scale"),
)
"""The measures of hidden places."""

_AGREE_M = 1.0
"""Two spellings of one place may differ by this distance without a note, metres (chosen): documents round degrees."""


_AGREE_DEG = 1.0
"""Two spellings of one direction may differ by this angle without a note, degrees (chosen)."""


class Spot(NamedTuple):
    """A part of the document that places an entity, and the JSON path of its place."""

    part: Equipment | HiddenPlace
    path: str


def to_world(data: Coordinates, path: str, frame: DocumentFrame, parsed: Parsed) -> tuple[float, ...]:
    """East, north and, if given, elevation in metres. A place beyond every scene is reported."""
    place = frame.place(data)
    if place is None:
        parsed.report(path, "has no place", "give X and Y in centimetres, or lon and lat in degrees")
        return (0.0, 0.0)
    if max(abs(metres) for metres in place) > FARTHEST_M:
        shown = ", ".join(f"{metres:g}" for metres in place)
        hint = f"coordinates lie within {FARTHEST_M:g} m of the scene's origin; X, Y and Z are centimetres"
        parsed.report(path, f"lies at ({shown}) m, beyond the scene", hint)
        return (0.0, 0.0)
    return place


def _place_notes(spot: Spot, group: model.Group, frame: DocumentFrame, parsed: Parsed) -> Iterator[str]:
    """Notes on a place: two different spellings of it or of its height, a distance from the origin larger than a scene,
    or an implausible height for such an entity."""
    data = spot.part.place
    east, north, *above = to_world(data, spot.path, frame, parsed)
    if None not in (data.x, data.y, data.lon, data.lat):
        other = frames.from_geodetic(data.lat or 0.0, data.lon or 0.0, frame.origin)
        apart = max(abs(east - other[0]), abs(north - other[1]))
        if apart > _AGREE_M:
            yield f"{spot.path}: lon and lat lie {apart:.0f} m off X and Y: X and Y are used"
    if data.z is not None and data.alt is not None:
        z_m = frames.from_unreal(0.0, 0.0, data.z)[2]
        if abs(z_m - data.alt) > _AGREE_M:
            source = "alt" if None in (data.x, data.y) else "Z"
            yield f"{spot.path}: alt says {data.alt:g} m and Z {z_m:g} m: {source} is used"
    distance = math.hypot(east, north)
    if distance > FAR_M:
        latitude, longitude = frame.origin
        yield f"{spot.path}: lies {distance / 1000:.0f} km from the scene's origin at {latitude:g}, {longitude:g}"
    if not above and group.engine in FLYING:
        yield f"{spot.path}: gives no height (Z or alt); it begins on the surface below"
    high_m = GROUND_HIGH_M if group.engine in ON_THE_GROUND else HIDDEN_HIGH_M
    if above and not LOW_M <= above[0] <= high_m and not engine_kind(group.engine).anywhere:
        yield (
            f"{spot.path}: its height is {above[0]:g} m over the scene, which is used as it is; if heights have "
            'another reference, "lingjing": {"datum_m": metres} would state it'
        )


def _headings(group: model.Group, spots: Sequence[Spot], parsed: Parsed) -> tuple[float, ...]:
    """The compass headings of all entities; none if no entity has one. Different spellings are noted."""
    spellings = [spot.part.headings for spot in spots]
    for spot, named in zip(spots, spellings, strict=True):
        if not named and any(spellings):
            parsed.report(spot.path, "has no heading while others have one", "give every entity a heading, or none")
        if any(abs((a - b + 180.0) % 360.0 - 180.0) > _AGREE_DEG for a, b in pairwise(named.values())):
            where = spot.path.removesuffix(".data")
            parsed.notes.append(f"{where}: {', '.join(named)} disagree; {next(iter(named))} is used")
    return tuple(next(iter(named.values())) for named in spellings if named)


def origin_of(mission: model.Mission) -> tuple[float, float]:
    """Latitude and longitude of the scene's origin in degrees."""
    # The other options may need regions and entities, which are not known yet.
    options = tuple(option for option in mission.scene.options if option.name == "origin")
    bare = msgspec.structs.replace(mission, scene=msgspec.structs.replace(mission.scene, options=options))
    return scene_spec(bare, _scope(mission), 0).origin


def exists_by_default(mission: model.Mission, group: model.Group) -> bool:
    """True if the group exists in the mission's default mode."""
    return holds(group.when, _scope(mission))


def _scope(mission: model.Mission) -> Scope:
    mode = mission.modes.default
    return Scope(parameters=parameters(mission, mode, {}), mode=mode)


def fill_group(
    mission: model.Mission,
    group: model.Group,
    spots: Sequence[Spot],
    frame: DocumentFrame,
    parsed: Parsed,
    where: str,
) -> model.Mission:
    """The mission with one group's count, places, headings, labels and measures from the document."""
    if group.count is None:
        if not spots:
            _too_few(parsed, where, group, mission)
            return mission
        if len(spots) > 1:
            message = f"holds {len(spots)}, mission '{mission.name}' has one {group.name}"
            fleet = fleet_of(mission.name)
            named = f'one that has several: "lingjing": {{"mission": "{fleet}"}}' if fleet else "one of your own"
            hint = f"leave one, or name a template, {named}"
            parsed.report(where, message, hint)
            return mission
    else:
        mission = _with_count(mission, group, len(spots), parsed, where)
        group = next(g for g in mission.groups if g.name == group.name)
    if not spots:
        return mission
    parsed.placed.update((_member_id(group, k), spot.path) for k, spot in enumerate(spots, start=1))
    properties = _with_positions(group, spots, frame, parsed, where)
    headings = _headings(group, spots, parsed)
    if len(headings) == len(spots):
        values = tuple(ex.Number(heading, "deg") for heading in headings)
        properties = _set(properties, "heading_deg", _indexed(group, values, "heading_deg"), unit="deg")
    properties = _with_measures(group, _with_elements(group, properties, spots, where, parsed), spots, parsed, where)
    codes = (spot.part.code for spot in spots)
    labels = tuple("" if code == _member_id(group, k) else code for k, code in enumerate(codes, start=1))
    changed = msgspec.structs.replace(group, properties=properties, labels=labels if any(labels) else ())
    return _with_group(mission, changed)


def _too_few(parsed: Parsed, where: str, group: model.Group, mission: model.Mission) -> None:
    parsed.report(where, f"is missing or empty, mission '{mission.name}' needs a {group.name}", "add one")


def allows_none(mission: model.Mission, group: model.Group) -> bool:
    """True if the group may have no members."""
    parameter = _count_parameter(mission, group)
    low = parameter.bounds.low if parameter and isinstance(parameter.bounds, ex.Range) else None
    return isinstance(low, ex.Number) and low.value <= 0


def _with_positions(
    group: model.Group, spots: Sequence[Spot], frame: DocumentFrame, parsed: Parsed, where: str
) -> tuple[model.Property, ...]:
    # Only satellites may lack coordinates, because elements place them.
    if not any(any(coordinate is not None for coordinate in spot.part.place.pairs) for spot in spots):
        parsed.notes.append(
            f"{where}: gives elements and no coordinates; the places of '{group.name}' are the template's"
        )
        return group.properties
    parsed.notes.extend(note for spot in spots for note in _place_notes(spot, group, frame, parsed))
    places = tuple(to_world(spot.part.place, spot.path, frame, parsed) for spot in spots)
    for spot, place in zip(spots, places, strict=True):
        fault = place_fault(place, group.engine)
        if fault:
            parsed.report(spot.path, fault, "X, Y and Z are centimetres, alt is metres")
    points = tuple(point(place) for place in places)
    return _set(group.properties, "position", _indexed(group, points, "position"))


def _with_elements(
    group: model.Group,
    properties: tuple[model.Property, ...],
    spots: Sequence[Spot],
    where: str,
    parsed: Parsed,
) -> tuple[model.Property, ...]:
    """The properties with the two-line elements. Invalid lines are kept in the document and noted."""
    lines = [spot.part.lines if isinstance(spot.part, Satellite) else () for spot in spots]
    if not any(lines):
        return properties
    wrong = [
        f"{spot.path.removesuffix('.data')}: {fault}"
        for spot, pair in zip(spots, lines, strict=True)
        if pair and (fault := elements_fault(pair))
    ]
    if not wrong and (not all(lines) or _property(properties, "tle1") is None):
        wrong = [f"{where}: not all have two-line elements, or '{group.name}' takes none"]
    if wrong:
        parsed.notes.extend(f"{fault}; kept, and the template's elements are used" for fault in wrong)
        return properties
    for k, name in enumerate(("tle1", "tle2")):
        properties = _set(properties, name, _indexed(group, tuple(ex.Text(pair[k]) for pair in lines), name))
    return properties


def _with_measures(
    group: model.Group,
    properties: tuple[model.Property, ...],
    entries: Sequence[Spot],
    parsed: Parsed,
    where: str,
) -> tuple[model.Property, ...]:
    """The properties with the document's measures, as far as the group has them. Others are kept in the document and
    noted."""
    for measure in MEASURES:
        amounts = tuple(
            entry.part.measures.get(measure.field) if isinstance(entry.part, HiddenPlace) else None for entry in entries
        )
        if all(value is None for value in amounts):
            continue
        if _property(properties, measure.property) is None:
            parsed.notes.append(f"{where}: '{group.name}' has no {measure.says}; '{measure.field}' is kept, not played")
            continue
        odd = next((value for value in amounts if value is not None and not measure.fits(value)), None)
        if odd is not None:
            parsed.notes.append(
                f"{where}: {odd!r} is no {measure.says} in {measure.said_in}; '{measure.field}' is kept, not played"
            )
            continue
        if measure.per_unit != 1.0:
            parsed.notes.append(f"{where}: '{measure.field}' is the {measure.says} in {measure.said_in}")
        for entry, value in zip(entries, amounts, strict=True):
            if value is None:
                hint = f"give every entry a {measure.field}, or none"
                parsed.report(entry.path, f"has no {measure.field} while others have one", hint)
        values = tuple(
            ex.Number(value / measure.per_unit if measure.fits(value) else 0.0, measure.unit) for value in amounts
        )
        properties = _set(properties, measure.property, _indexed(group, values, measure.property))
    return properties


def _with_count(mission: model.Mission, group: model.Group, count: int, parsed: Parsed, where: str) -> model.Mission:
    """The mission with the group's count: as the default of its parameter, or the count itself.

    It holds in every tier, with a note if one sets another. If the document exceeds the parameter's upper bound, the
    bound is raised, with a note. If the template cannot place further members (no `spread`), the parameter is bounded
    by the document's count.
    """
    parameter = _count_parameter(mission, group)
    if parameter is None:
        return _with_group(mission, msgspec.structs.replace(group, count=ex.Number(float(count))))
    name, bounds = parameter.name, parameter.bounds
    for tier in mission.tiers:
        if any(each.name == name and each.value != ex.Number(float(count)) for each in tier.settings):
            message = f"what tier {tier.level} of mission '{mission.name}' sets for '{name}' is left out"
            parsed.notes.append(f"{where}: holds {count} in every tier; {message}")
    mission = msgspec.structs.replace(mission, tiers=without_settings(mission.tiers, {name}))
    if isinstance(bounds, ex.Range) and isinstance(bounds.low, ex.Number) and isinstance(bounds.high, ex.Number):
        if count < bounds.low.value:
            message = f"holds {count}, mission '{mission.name}' needs at least {bounds.low.value:g}"
            hint = f"list as many or widen the parameter '{name}' of the template"
            if count:
                parsed.report(where, message, hint)
            else:
                _too_few(parsed, where, group, mission)
            return mission
        more, alone = count > bounds.high.value, bool(count) and not _spread(group)
        if more:
            message = f"holds {count}, more than the {bounds.high.value:g} of mission '{mission.name}'"
            parsed.notes.append(f"{where}: {message}")
        if alone:
            mission = _limit_sweeps(mission, name, count, where, parsed)
        if more or alone:
            bounds = msgspec.structs.replace(bounds, high=_number_like(bounds.high, float(count)))
    return with_default(mission, name, float(count), bounds)


def _limit_sweeps(mission: model.Mission, name: str, most: int, where: str, parsed: Parsed) -> model.Mission:
    """The mission with the values of its sweeps limited to the number that the document places."""
    sweeps: list[model.Sweep] = []
    for sweep in mission.sweeps:
        values = tuple(
            tuple(v for v in column if parameter != name or not (isinstance(v, ex.Number) and v.value > most))
            for parameter, column in zip(sweep.parameters, sweep.values, strict=True)
        )
        if values != sweep.values:
            parsed.notes.append(f"{where}: places {most}; what sweep '{sweep.name}' has beyond is left out")
        if all(values):
            sweeps.append(msgspec.structs.replace(sweep, values=values))
    return msgspec.structs.replace(mission, sweeps=tuple(sweeps))


# -- small parts of the graph ---------------------------------------------------------------------------------------


def with_default(mission: model.Mission, name: str, value: float, bounds: ex.Expr | None = None) -> model.Mission:
    """The mission with another default of a parameter, in the unit of the old one, and optionally other bounds."""
    parameters = tuple(
        msgspec.structs.replace(p, default=_default_like(p.default, value), bounds=bounds or p.bounds)
        if p.name == name
        else p
        for p in mission.parameters
    )
    return msgspec.structs.replace(mission, parameters=parameters)


def _with_group(mission: model.Mission, changed: model.Group) -> model.Mission:
    groups = tuple(changed if group.name == changed.name else group for group in mission.groups)
    return msgspec.structs.replace(mission, groups=groups)


def _count_parameter(mission: model.Mission, group: model.Group) -> model.Parameter | None:
    """The parameter that counts the group's members."""
    count = group.count.high if isinstance(group.count, ex.Range) else group.count
    name = count.name if isinstance(count, ex.Ref) and count.kind == "param" else ""
    return next((p for p in mission.parameters if p.name == name), None)


def _spread(group: model.Group) -> tuple[tuple[str, ex.Expr], ...]:
    position = _property(group.properties, "position")
    named = position.value.named if position and isinstance(position.value, ex.Call) else ()
    return tuple(pair for pair in named if pair[0] == "spread")


def _indexed(group: model.Group, values: Sequence[ex.Expr], name: str) -> ex.Expr:
    """One value for a single entity or if all are equal, else a list from which each member takes its own."""
    if group.count is None or (name != "position" and len(set(values)) == 1):
        return values[0]
    named = _spread(group) if name == "position" else ()
    return ex.Call("at", (ex.Ref(group.index, "local"), ex.Sequence(tuple(values))), named)


def _set(properties: Iterable[model.Property], name: str, value: ex.Expr, unit: str = "") -> tuple[model.Property, ...]:
    """The properties with one of them set to a value. It stays hidden, or a state."""
    kept = tuple(properties)
    old = _property(kept, name)
    if old is None:
        return (*kept, model.Property(name=name, value=value, unit=unit))
    new = msgspec.structs.replace(old, value=value, relation="=", inherited=False)
    return tuple(new if p is old else p for p in kept)


def _property(properties: Iterable[model.Property], name: str) -> model.Property | None:
    return next((p for p in properties if p.name == name), None)


def draw_of(group: model.Group) -> ex.Draw | None:
    """The draw that places the group's members, or None."""
    position = _property(group.properties, "position")
    return position.value if position and isinstance(position.value, ex.Draw) else None


def is_hidden(group: model.Group) -> bool:
    """True if the group's places are hidden."""
    return any(p.name == "position" and p.hidden for p in group.properties)


def point(items: Iterable[float]) -> ex.Point:
    """A point in metres."""
    return ex.Point(tuple(ex.Number(item, "m") for item in items))


def _default_like(default: ex.Expr, value: float) -> ex.Expr:
    """A default with this value. A drawn one stays drawn, from this value alone, so that it may stay hidden."""
    if isinstance(default, ex.Flag):
        return ex.Flag(value != 0.0)
    if not isinstance(default, ex.Draw):
        return _number_like(default, value)
    first = next((leaf for leaf in ex.leaves(default) if isinstance(leaf, ex.Number)), default)
    return ex.Draw("choice", (ex.Sequence((_number_like(first, value),)),))


def _number_like(expr: ex.Expr, value: float) -> ex.Number:
    """A number in the unit of another one."""
    return ex.Number(value, expr.unit if isinstance(expr, ex.Number) else "")


def _member_id(group: model.Group, index: int) -> str:
    """`uav[1]`, or the bare name of a single entity."""
    return group.name if group.count is None else f"{group.name}[{index}]"
