"""`resetScenario` in: a document instantiates a template mission.

The document says who is where and what is hidden; the template says everything else (budget, actions, rules). Lists of
the document go to the groups of the template whose engine drives such entities, hidden persons to its target group,
the rescue range to the region they are drawn in. What the template has no place for stays in the document, which
`Mission.origin` keeps to the letter, and is noted. The way back is `lingjing.mission.reset_emit`.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import msgspec

from lingjing.errors import UsageError
from lingjing.mission import expression as ex
from lingjing.mission import frames, geometry2d, model
from lingjing.mission.evaluate import Scope
from lingjing.mission.instance import Weather
from lingjing.mission.instantiate import choose_mode, parameters, scene_spec
from lingjing.mission.reset_document import Coordinates, Equipment, Parsed, parse
from lingjing.mission.sky import sky_of

LISTS: tuple[tuple[str, str], ...] = (
    ("droneEntityList", "multirotor"),
    ("unmannedDogEntityList", "quadruped"),
    ("autoVehicleEntityList", "road"),
    ("satelliteEntityList", "satellite"),
    ("shipEntityList", "vessel"),
    ("planeEntityList", "plane"),
)
"""The six lists and the engine that drives what is in each."""

TASK_TYPES: dict[str, str] = {
    "ssr": "ssr",
    "searescue": "ssr",
    "seasearchandrescue": "ssr",
    "maritimerescue": "ssr",
    "海上搜救": "ssr",
}
"""Spellings of `taskType` (letters and digits, lower case) and the template each names."""

PERSONS = "person_in_water"


@dataclass(frozen=True, slots=True)
class Spot:
    """One thing the document places: its coordinates, their JSON path, its code and compass heading."""

    data: Coordinates
    path: str
    code: str
    heading_deg: float | None = None


def instantiate_document(
    text: str, path: str, templates: Callable[[str], model.Mission]
) -> tuple[model.Mission, tuple[str, ...]]:
    """The mission that a document describes, and notes on what was recognised, kept or not understood.

    `path` stands in messages; `templates` gives the compiled mission of a name, or raises `KeyError` if there is none.
    Raises `UsageError` for text that is not JSON (line and column), `MissionError` for a bad scenario (JSON path).
    """
    parsed = parse(text, path)
    name, where, why = _template_name(parsed)
    try:
        template = templates(name)
    except KeyError:
        raise parsed.fault(where, f"there is no template '{name}'", "name one of the missions in scenarios/") from None
    notes = [f"template '{name}': {why}"]
    mission = _placed(template, parsed, notes)
    digest = hashlib.sha256(text.encode("utf-8", "surrogatepass")).hexdigest()
    origin = model.Origin(file=path, sha256=digest, document=text)
    return msgspec.structs.replace(mission, origin=origin), tuple(notes)


def _template_name(parsed: Parsed) -> tuple[str, str, str]:
    """Template, the JSON path that decided, and the reason in words."""
    scenario, task = parsed.scenario, parsed.task
    if scenario.lingjing is not None:
        return scenario.lingjing.mission, f"{parsed.path}.lingjing.mission", "named by 'lingjing'"
    unknown = ""
    rows = ((scenario, parsed.path), (task, f"{parsed.path}.taskMatrix[0]"))
    for holder, where in rows:
        for field, word in (("taskType", holder.task_type), ("task_type", holder.task_type_snake)):
            found = TASK_TYPES.get(re.sub(r"[\W_]+", "", word).casefold())
            if found:
                return found, f"{where}.{field}", f"named by {field} '{word}'"
            unknown = unknown or (f" ({field} '{word}' is not known)" if word else "")
    equipment = scenario.equipment_list
    if task.initial_state.rescue_person_position and equipment.ship_entity_list and equipment.drone_entity_list:
        seen = "rescuePersonPosition, shipEntityList and droneEntityList"
        return "ssr", f"{parsed.path}.equipmentList", f"recognised by {seen}{unknown}"
    raise parsed.fault(
        parsed.path,
        f"no template fits: a sea rescue has persons in rescuePersonPosition, ships and drones{unknown}",
        'name the template: "lingjing": {"mission": "ssr"} in the scenario',
    )


# -- the parts of the mission ---------------------------------------------------------------------------------------


def _placed(template: model.Mission, parsed: Parsed, notes: list[str]) -> model.Mission:
    mission = _worded(_configured(template, parsed), parsed, notes)
    for field, engine in LISTS:
        mission = _equipped(mission, parsed, field, engine, notes)
    outline = _outline(mission, parsed, notes)
    if outline is not None:
        mission = _with_region(mission, search_region(mission), outline)
    return _with_persons(mission, parsed, outline, notes)


def _configured(template: model.Mission, parsed: Parsed) -> model.Mission:
    """The template with the mode and settings of the document's `lingjing` object as its defaults."""
    extra = parsed.scenario.lingjing
    if extra is None:
        return template
    try:
        mode = choose_mode(template, extra.mode)
        parameters(template, mode, extra.settings)
    except UsageError as error:
        raise parsed.fault(f"{parsed.path}.lingjing", str(error), error.hint) from None
    changed = tuple(
        msgspec.structs.replace(p, default=_number_like(p.default, extra.settings[p.name]))
        if p.name in extra.settings
        else p
        for p in template.parameters
    )
    modes = msgspec.structs.replace(template.modes, default=mode)
    return msgspec.structs.replace(template, modes=modes, parameters=changed)


def _worded(mission: model.Mission, parsed: Parsed, notes: list[str]) -> model.Mission:
    """Title, goal and weather."""
    state = parsed.task.initial_state
    if len(parsed.scenario.task_matrix) > 1:
        notes.append(f"{parsed.path}.taskMatrix: the first of {len(parsed.scenario.task_matrix)} rows is played")
    return msgspec.structs.replace(
        mission,
        title=parsed.scenario.scene_name or mission.title,
        goal=parsed.task.goal or mission.goal,
        weather=_weather(mission.weather, state.weather, f"{parsed.state_path}.weather", notes),
    )


def _weather(given: tuple[model.Property, ...], word: str, where: str, notes: list[str]) -> tuple[model.Property, ...]:
    if not word:
        return given
    sky = sky_of(word)
    if sky is None:
        notes.append(f"{where}: '{word}' is not understood and kept; the template's weather stands")
        return given
    known = {p.name: p.value.value for p in given if isinstance(p.value, ex.Number)}
    calm = Weather()
    if sky.fits(known.get("visibility_m", calm.visibility_m), known.get("cloud", calm.cloud)):
        return given
    notes.append(f"{where}: '{word}' sets visibility {sky.typical_visibility_m:g} m, cloud {sky.typical_cloud:g}")
    changed = (
        model.Property(name="visibility_m", value=ex.Number(sky.typical_visibility_m, "m")),
        model.Property(name="cloud", value=ex.Number(sky.typical_cloud)),
    )
    return (*(p for p in given if p.name not in ("visibility_m", "cloud")), *changed)


def _equipped(mission: model.Mission, parsed: Parsed, field: str, engine: str, notes: list[str]) -> model.Mission:
    """Put one of the six lists into the group of the template that its engine drives."""
    where = f"{parsed.path}.equipmentList.{field}"
    listed: tuple[Equipment, ...] = getattr(parsed.scenario.equipment_list, _snake(field))
    group = next((g for g in mission.groups if g.role == "asset" and g.engine == engine), None)
    if group is None:
        if listed:
            notes.append(f"{where}: mission '{mission.name}' has no {engine}; {len(listed)} kept, not played")
        return mission
    spots = tuple(
        Spot(item.data, f"{where}[{k}].data", item.equipment_code, _compass(item)) for k, item in enumerate(listed)
    )
    codes = [spot.code for spot in spots if spot.code]
    if len(codes) != len(set(codes)):
        notes.append(f"{where}: an equipmentCode stands more than once")
    said = parsed.task.initial_state.uav_count
    if engine == "multirotor" and said is not None and said != len(listed):
        notes.append(f"{parsed.state_path}.uav_count says {said}, the list has {len(listed)}: the list counts")
    return _filled(mission, group, spots, parsed, where, notes)


def _with_persons(
    mission: model.Mission, parsed: Parsed, outline: geometry2d.Polygon | None, notes: list[str]
) -> model.Mission:
    where = f"{parsed.state_path}.rescuePersonPosition"
    persons = parsed.task.initial_state.rescue_person_position
    group = _person_group(mission)
    if group is None:
        if persons:
            notes.append(f"{where}: mission '{mission.name}' has nobody in the water; {len(persons)} kept, not played")
        return mission
    spots = tuple(Spot(person, f"{where}[{k}]", person.person_id) for k, person in enumerate(persons))
    origin = _origin(mission)
    for spot in spots:
        east, north, _ = _world(spot, origin, parsed)
        if outline is not None and not geometry2d.contains(outline, east, north):
            notes.append(f"{spot.path}: lies outside of rescueRange, where no report of it counts")
    return _filled(mission, group, spots, parsed, where, notes)


def _filled(
    mission: model.Mission,
    group: model.Group,
    spots: Sequence[Spot],
    parsed: Parsed,
    where: str,
    notes: list[str],
) -> model.Mission:
    """The mission with one group's count, places, headings and labels taken from the document."""
    if group.count is None:
        if not spots:
            raise parsed.fault(where, f"is missing or empty, mission '{mission.name}' needs a {group.name}", "add one")
        if len(spots) > 1:
            notes.append(f"{where}: the first of {len(spots)} is the {group.name}; the others are kept, not played")
            spots = spots[:1]
    else:
        mission = _counted(mission, group, len(spots), parsed, where)
        group = next(g for g in mission.groups if g.name == group.name)
    origin = _origin(mission)
    points = tuple(_point(_world(spot, origin, parsed)) for spot in spots)
    properties = _set(group.properties, "position", _indexed(group, points, "position"))
    if any(spot.heading_deg is not None for spot in spots):
        headings = tuple(ex.Number(spot.heading_deg or 0.0, "deg") for spot in spots)
        properties = _set(properties, "heading_deg", _indexed(group, headings, "heading_deg"))
    labels = tuple("" if spot.code == _member_id(group, k) else spot.code for k, spot in enumerate(spots, start=1))
    changed = msgspec.structs.replace(group, properties=properties, labels=labels if any(labels) else ())
    groups = tuple(changed if g.name == group.name else g for g in mission.groups)
    return msgspec.structs.replace(mission, groups=groups)


def _counted(mission: model.Mission, group: model.Group, count: int, parsed: Parsed, where: str) -> model.Mission:
    """The mission with the group's count: the default of its parameter, or the count itself.

    Where the template cannot place further members (no `spread`), the parameter may not exceed what the document has.
    """
    name = _count_parameter(group)
    parameter = next((p for p in mission.parameters if p.name == name), None)
    if parameter is None:
        changed = msgspec.structs.replace(group, count=ex.Number(float(count)))
        groups = tuple(changed if g.name == group.name else g for g in mission.groups)
        return msgspec.structs.replace(mission, groups=groups)
    bounds = parameter.bounds
    if isinstance(bounds, ex.Range) and isinstance(bounds.low, ex.Number) and isinstance(bounds.high, ex.Number):
        if not bounds.low.value <= count <= bounds.high.value:
            raise parsed.fault(
                where,
                f"holds {count}, mission '{mission.name}' takes {bounds.low.value:g}..{bounds.high.value:g}",
                f"list as many or widen the parameter '{name}' of the template",
            )
        if not _spread(group):
            bounds = msgspec.structs.replace(bounds, high=_number_like(bounds.high, float(count)))
    default = _number_like(parameter.default, float(count))
    replaced = msgspec.structs.replace(parameter, default=default, bounds=bounds)
    return msgspec.structs.replace(
        mission, parameters=tuple(replaced if p.name == name else p for p in mission.parameters)
    )


# -- the region -----------------------------------------------------------------------------------------------------


def _outline(mission: model.Mission, parsed: Parsed, notes: list[str]) -> geometry2d.Polygon | None:
    where = f"{parsed.state_path}.rescueRange"
    corners = parsed.task.initial_state.rescue_range
    region = search_region(mission)
    if not corners:
        if region:
            notes.append(f"{where}: is missing or empty; the template's region '{region}' stands")
        return None
    if not region:
        notes.append(f"{where}: mission '{mission.name}' has no region to search; kept")
        return None
    origin = _origin(mission)
    spots = tuple(Spot(corner, f"{where}[{k}]", corner.range_id) for k, corner in enumerate(corners))
    places = tuple(_world(spot, origin, parsed) for spot in spots)
    outline = tuple((place[0], place[1]) for place in places)
    fault = geometry2d.fault(outline)
    if fault:
        raise parsed.fault(where, f"the outline {fault}", "list the corners in order around the area")
    return outline


def search_region(mission: model.Mission) -> str:
    """The region the persons are drawn in, else the first one a grid covers, else the first."""
    group = _person_group(mission)
    drawn = _property(group.properties, "position") if group else None
    if drawn and isinstance(drawn.value, ex.Draw):
        for argument in drawn.value.arguments:
            if isinstance(argument, ex.Ref) and argument.kind == "region":
                return argument.name
    names = [grid.region for grid in mission.grids] + [region.name for region in mission.regions]
    return names[0] if names else ""


def _with_region(mission: model.Mission, name: str, outline: geometry2d.Polygon) -> model.Mission:
    shape = ex.Call("polygon", tuple(_point(corner) for corner in outline))
    regions = tuple(
        msgspec.structs.replace(region, shape=shape) if region.name == name else region for region in mission.regions
    )
    return msgspec.structs.replace(mission, regions=regions)


# -- places ---------------------------------------------------------------------------------------------------------


def _world(spot: Spot, origin: tuple[float, float], parsed: Parsed) -> tuple[float, ...]:
    """East, north and, if given, elevation in metres."""
    data = spot.data
    if data.x is not None and data.y is not None:
        east, north, elevation = frames.from_unreal(data.x, data.y, data.z or 0.0)
        return (east, north) if data.z is None else (east, north, elevation)
    if data.lon is not None and data.lat is not None:
        east, north = frames.from_geodetic(data.lat, data.lon, origin)
        east, north = round(east, 4), round(north, 4)
        return (east, north) if data.alt is None else (east, north, data.alt)
    raise parsed.fault(spot.path, "has no place", "give X and Y in centimetres, or lon and lat in degrees")


def _compass(item: Equipment) -> float | None:
    if item.heading is not None:
        return item.heading
    if item.raw is not None:
        return item.raw
    return None if item.yaw is None else frames.compass_from_yaw(item.yaw)


def _origin(mission: model.Mission) -> tuple[float, float]:
    mode = mission.modes.default
    return scene_spec(mission, Scope(parameters=parameters(mission, mode, {}), mode=mode), 0).origin


# -- small parts of the graph ---------------------------------------------------------------------------------------


def _person_group(mission: model.Mission) -> model.Group | None:
    return next((g for g in mission.groups if g.role == "target" and g.type == PERSONS), None)


def _count_parameter(group: model.Group) -> str:
    count = group.count.high if isinstance(group.count, ex.Range) else group.count
    return count.name if isinstance(count, ex.Ref) and count.kind == "param" else ""


def _spread(group: model.Group) -> tuple[tuple[str, ex.Expr], ...]:
    position = _property(group.properties, "position")
    return position.value.named if position and isinstance(position.value, ex.Call) else ()


def _indexed(group: model.Group, values: Sequence[ex.Expr], name: str) -> ex.Expr:
    """One value for a single entity or if all are equal, else the member's own out of a list."""
    if group.count is None or (name != "position" and len(set(values)) == 1):
        return values[0]
    named = _spread(group) if name == "position" else ()
    return ex.Call("at", (ex.Ref(group.index, "local"), ex.Sequence(tuple(values))), named)


def _set(properties: Iterable[model.Property], name: str, value: ex.Expr) -> tuple[model.Property, ...]:
    """The properties with one fixed to a value; it stays hidden if it was."""
    kept = tuple(properties)
    old = _property(kept, name)
    new = model.Property(name=name, value=value, hidden=old.hidden if old else False)
    return tuple(new if p is old else p for p in kept) if old else (*kept, new)


def _property(properties: Iterable[model.Property], name: str) -> model.Property | None:
    return next((p for p in properties if p.name == name), None)


def _point(items: Iterable[float]) -> ex.Point:
    return ex.Point(tuple(ex.Number(item, "m") for item in items))


def _number_like(expr: ex.Expr, value: float) -> ex.Number:
    return ex.Number(value, expr.unit if isinstance(expr, ex.Number) else "")


def _member_id(group: model.Group, index: int) -> str:
    return group.name if group.count is None else f"{group.name}[{index}]"


def _snake(name: str) -> str:
    return re.sub("([A-Z])", lambda match: "_" + match[1].lower(), name)
