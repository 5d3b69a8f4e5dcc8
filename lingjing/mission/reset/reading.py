"""`resetScenario` in: a document instantiates a template mission.

The document says who is where and what is hidden; the template says everything else (budget, actions, rules). Lists of
the document go to the groups of the template whose engine drives such entities (`groups`), hidden places to its
target groups (`targets`), the rescue range to the region targets are drawn in. What the template has no place
for stays in the document, which `Mission.origin` keeps to the letter, and is noted (`notes`). The way back is
`lingjing.mission.reset.emit`.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import msgspec

from lingjing.errors import MissionError, UsageError
from lingjing.mission import expression as ex
from lingjing.mission import geometry2d, model
from lingjing.mission.instance import SceneSpec, Weather
from lingjing.mission.instantiate import choose_settings
from lingjing.mission.reset.document import Parsed, parse
from lingjing.mission.reset.faults import document_error, foreign_lengths
from lingjing.mission.reset.fields import Found, hidden_fields
from lingjing.mission.reset.frame import DocumentFrame, frame_of, untied_fault
from lingjing.mission.reset.groups import Spot, draw_of, filled, origin_of, plays, point, with_default, world
from lingjing.mission.reset.notes import leftovers
from lingjing.mission.reset.repair import followed
from lingjing.mission.reset.row_goals import GOALS, goal_text, has_later_places, owners_of, row_goals
from lingjing.mission.reset.scene_fit import fitted_template
from lingjing.mission.reset.shapes import LISTS, EntityList, Equipment, folded
from lingjing.mission.reset.starts import note_starts
from lingjing.mission.reset.targets import PERSONS, targeted
from lingjing.mission.reset.template import FREE, fleet_of, template_name
from lingjing.mission.reset.unit import METRE_M
from lingjing.mission.vocabulary import MODES
from lingjing.mission.weather_words import RAINY, sky_of

MODE_WORDS: dict[str, str] = {**{mode: mode for mode in MODES}, "星型": "star", "广播": "broadcast"}
"""Spellings of a communication mode in `collaborationType`, which else says how the work is shared in free words."""


def instantiate_document(
    text: str, path: str, templates: Callable[[str], model.Mission]
) -> tuple[model.Mission, tuple[str, ...]]:
    """The mission that a document describes, and notes on what was recognised, kept or not understood.

    `path` stands in messages; `templates` gives the compiled mission of a name, or raises `KeyError` if there is none.
    Raises `UsageError` for text that is not JSON (line and column), `MissionError` for a bad scenario, with the JSON
    path of every fault.
    """
    parsed = parse(text, path)
    before = len(parsed.faults)
    found = hidden_fields(parsed)
    first = len(parsed.faults)
    if first and not parsed.decided:
        raise document_error(path, parsed.faults)
    try:
        name, where, why = template_name(parsed, found)
    except MissionError as error:
        if first > before:  # what hidden places could not be read may have told the template
            raise document_error(path, parsed.faults) from None
        if (fault := untied_fault(parsed, found, SceneSpec(kind="").origin)) is not None:
            raise document_error(path, [*error.faults, fault]) from None
        raise
    try:
        template = templates(name)
    except KeyError:
        raise parsed.fault(
            where, f"there is no template '{name[:60]}'", "name one of the missions in scenarios/"
        ) from None
    parsed.notes.insert(0, f"template '{name}': {why}")
    goals = row_goals(parsed, found) if name == GOALS else None
    found = (goals.found,) if goals else found
    template = _of_several(template, parsed, found, templates)
    template, mission = _placed(template, parsed, found, goals.order if goals else ())
    if parsed.faults:
        raise document_error(path, followed(parsed.faults, first, parsed.task_path))
    note_starts(parsed)
    parsed.notes.extend(leftovers(text, parsed, found))
    digest = hashlib.sha256(text.encode("utf-8", "surrogatepass")).hexdigest()
    draws: dict[str, ex.Expr] = {
        group.name: drawn for group in template.groups if (drawn := draw_of(group)) is not None
    }
    origin = model.Origin(file=path, sha256=digest, document=text, draws=draws, places=dict(parsed.placed))
    return msgspec.structs.replace(mission, origin=origin), tuple(parsed.notes)


def _of_several(
    template: model.Mission, parsed: Parsed, found: Sequence[Found], templates: Callable[[str], model.Mission]
) -> model.Mission:
    """The template's fleet, with a note, where the document has several of what the template has one of, unless it
    names the template itself."""
    fleet, given = fleet_of(template.name), parsed.scenario.lingjing
    if not fleet or (given is not None and given.mission is not None):
        return template
    for where, count, group in _several(template, parsed, found):
        if group.count is None:
            held = f"{where}: holds {count}, '{template.name}' has one {group.name}"
            parsed.notes.insert(1, f"{held}: '{fleet}' is played, which takes several")
            return templates(fleet)
    return template


def _several(template: model.Mission, parsed: Parsed, found: Sequence[Found]) -> Iterator[tuple[str, int, model.Group]]:
    """The lists and hidden fields that hold several, where, how many, and the template's one group for them."""
    for one in LISTS:
        count = len(getattr(parsed.scenario.equipment_list, one.attribute))
        driven = [group for group in template.groups if group.role == "asset" and group.engine == one.engine]
        if count > 1 and len(driven) == 1:
            yield parsed.list_path(one.name), count, driven[0]
    for field in found:
        meant = [group for group in template.groups if not {group.type, *group.bases}.isdisjoint(field.field.types)]
        if len(field.targets) > 1 and len(meant) == 1:
            yield field.path, len(field.targets), meant[0]


# -- the parts of the mission ---------------------------------------------------------------------------------------


def _placed(
    template: model.Mission, parsed: Parsed, found: Sequence[Found], order: Sequence[int]
) -> tuple[model.Mission, model.Mission]:
    """The template, with a scene that reaches the document's places, and the mission that it becomes. `order` is that
    of the UAVs, if it is not the document's."""
    plain = _worded(_configured(template, parsed), parsed)
    frame = frame_of(parsed, found, origin_of(plain))
    if frame.untied:
        return plain, plain
    plain = _with_origin(plain, frame)
    before = len(parsed.notes)
    mission = _filled(plain, parsed, found, frame, order)
    parsed.faults.extend(foreign_lengths(parsed.raw, parsed.path, in_metres=frame.unit_m == METRE_M))
    if parsed.faults:
        return plain, mission
    fitted = fitted_template(plain, mission, parsed)
    if fitted is None:
        return plain, mission
    told = parsed.notes[-1]
    del parsed.notes[before:]
    parsed.notes.append(told)
    return fitted, _filled(fitted, parsed, found, frame, order)


def _filled(
    plain: model.Mission, parsed: Parsed, found: Sequence[Found], frame: DocumentFrame, order: Sequence[int]
) -> model.Mission:
    """The mission with everything where the document says."""
    mission = plain
    for one in LISTS:
        mission = _equipped(mission, parsed, one, frame, order if one.engine == "multirotor" else ())
    outline = _outline(mission, parsed, frame)
    if outline is not None:
        mission = _with_region(mission, search_region(mission), outline)
    return targeted(mission, parsed, found, frame, outline)


def _with_origin(mission: model.Mission, frame: DocumentFrame) -> model.Mission:
    """The mission whose scene lies at the frame's origin."""
    if frame.origin == origin_of(mission):
        return mission
    degrees = ex.Point(tuple(ex.Number(value, "deg") for value in frame.origin))
    kept = tuple(option for option in mission.scene.options if option.name != "origin")
    options = (*kept, model.Property(name="origin", value=degrees))
    return msgspec.structs.replace(mission, scene=msgspec.structs.replace(mission.scene, options=options))


def _configured(template: model.Mission, parsed: Parsed) -> model.Mission:
    """The template with the mode and settings of the document's `lingjing` object as its defaults."""
    extra = parsed.scenario.lingjing
    said = MODE_WORDS.get(folded(parsed.scenario.collaboration_type))
    if extra is None or extra.mode is None:
        template = _collaborating(template, parsed)
    elif said not in (None, extra.mode):
        parsed.notes.append(
            f"{parsed.at('collaborationType')}: says '{said}', 'lingjing' {extra.mode}: the latter counts"
        )
    if extra is None:
        return template
    try:
        mode, _ = choose_settings(template, extra.mode, extra.settings)
    except UsageError as error:
        for fault in error.faults:
            parsed.report(f"{parsed.at('lingjing')}.{fault.where}", fault.message, fault.hint)
        return template
    for name, value in extra.settings.items():
        template = with_default(template, name, value)
    return msgspec.structs.replace(template, modes=msgspec.structs.replace(template.modes, default=mode))


def _collaborating(template: model.Mission, parsed: Parsed) -> model.Mission:
    """The template in the mode that `collaborationType` names, if it names one."""
    word = parsed.scenario.collaboration_type
    mode, where = MODE_WORDS.get(folded(word)), parsed.at("collaborationType")
    if mode is None or mode == template.modes.default:
        return template
    if mode not in template.modes.allowed:
        parsed.notes.append(
            f"{where}: mission '{template.name}' has no mode '{mode}'; kept, {template.modes.default} is played"
        )
        return template
    parsed.notes.append(f"{where}: '{word}' is the mode that is played")
    return msgspec.structs.replace(template, modes=msgspec.structs.replace(template.modes, default=mode))


def _worded(mission: model.Mission, parsed: Parsed) -> model.Mission:
    """Title, goal and weather."""
    state = parsed.task.initial_state
    rows = len(parsed.scenario.task_matrix)
    shared = rows > 1 and has_later_places(parsed)
    own = mission.name == GOALS
    if own or mission.name in dict(FREE):
        mission = _bounded(mission, parsed)
    else:
        _note_steps(mission, parsed)
    if rows > 1 and not own:
        beside = ", with the hidden places of the others" if shared else ""
        parsed.notes.append(f"{parsed.at('taskMatrix')}: the first of {rows} rows is played{beside}")
    if shared and not own:
        _note_owners(mission, parsed)
    mission = _at_height(mission, parsed)
    return msgspec.structs.replace(
        mission,
        title=parsed.scenario.scene_name or mission.title,
        goal=(goal_text(parsed) if own or shared else parsed.task.goal) or mission.goal,
        weather=_weather(mission.weather, state.weather, parsed.in_state("weather"), parsed),
    )


_MAX_STEPS, _STEPS_MOST = "max_steps", 10_000


def _max_steps(parsed: Parsed) -> tuple[str, object]:
    """The document's `max_steps` and its JSON path; "" where it has none."""
    for holder, path in parsed.holders():
        for key, value in holder.items():
            if folded(key) == folded(_MAX_STEPS):
                parsed.understood.add(folded(key))
                return f"{path}.{key}", value
    return "", None


def _note_steps(mission: model.Mission, parsed: Parsed) -> None:
    """Note that a template's own budget counts, whose ticks are as long as its actions need."""
    where, steps = _max_steps(parsed)
    if where:
        parsed.notes.append(
            f"{where}: {steps!r} is kept; the budget of mission '{mission.name}' counts, whose ticks are its own"
        )


def _note_owners(mission: model.Mission, parsed: Parsed) -> None:
    """Note that rows name whose their places are, and the mission lets any of its agents deal with them."""
    owners = owners_of(parsed)
    if len(owners) > 1:
        said = ", ".join(f"'{one}'" for one in owners)
        parsed.notes.append(
            f"{parsed.at('taskMatrix')}: the rows are of {said}; mission '{mission.name}' lets any of them deal with "
            "each place"
        )


def _bounded(mission: model.Mission, parsed: Parsed) -> model.Mission:
    """The mission with the document's `max_steps` as its budget of ticks."""
    where, steps = _max_steps(parsed)
    if not where:
        return mission
    if not isinstance(steps, int) or isinstance(steps, bool) or not 1 <= steps <= _STEPS_MOST:
        parsed.notes.append(
            f"{where}: is no number of ticks from 1 to {_STEPS_MOST}; kept, the template's budget stands"
        )
        return mission
    parsed.notes.append(f"{where}: is the budget of {steps} ticks")
    return msgspec.structs.replace(
        mission, budget=msgspec.structs.replace(mission.budget, ticks=ex.Number(float(steps)))
    )


_ALTITUDE = "altitude"
"""The parameter of a template that says how high its aircraft fly."""


def _at_height(mission: model.Mission, parsed: Parsed) -> model.Mission:
    """The mission with `takeoff_height_m` as the height its aircraft fly at, if it has a parameter that takes it."""
    height, where = parsed.task.initial_state.takeoff_height_m, parsed.in_state("takeoff_height_m")
    if height is None:
        return mission
    known = next((one for one in mission.parameters if one.name == _ALTITUDE), None)
    bounds = known.bounds if known else None
    low, high = (bounds.low, bounds.high) if isinstance(bounds, ex.Range) else (None, None)
    fits = isinstance(low, ex.Number) and isinstance(high, ex.Number) and low.value <= height <= high.value
    if known is None or not fits:
        parsed.notes.append(f"{where}: mission '{mission.name}' flies no aircraft at {height:g} m; kept")
        return mission
    parsed.notes.append(f"{where}: is the parameter '{_ALTITUDE}'")
    return with_default(mission, _ALTITUDE, height)


def _weather(
    given: tuple[model.Property, ...], word: str | dict[str, Any], where: str, parsed: Parsed
) -> tuple[model.Property, ...]:
    if not word:
        return given
    sky = sky_of(word) if isinstance(word, str) else None
    if sky is None:
        said = f"'{word}'" if isinstance(word, str) else "an object"
        parsed.notes.append(f"{where}: {said} is not understood and kept; the template's weather stands")
        return given
    if sky.word == RAINY:
        parsed.notes.append(f"{where}: '{word}' is read as what it does to visibility and cloud; no rain falls")
    known = {p.name: p.value.value for p in given if isinstance(p.value, ex.Number)}
    calm = Weather()
    if sky.fits(known.get("visibility_m", calm.visibility_m), known.get("cloud", calm.cloud)):
        return given
    parsed.notes.append(
        f"{where}: '{word}' sets visibility {sky.typical_visibility_m:g} m, cloud {sky.typical_cloud:g}"
    )
    changed = (
        model.Property(name="visibility_m", unit="m", value=ex.Number(sky.typical_visibility_m, "m")),
        model.Property(name="cloud", value=ex.Number(sky.typical_cloud)),
    )
    return (*(p for p in given if p.name not in ("visibility_m", "cloud")), *changed)


def _equipped(
    mission: model.Mission, parsed: Parsed, one: EntityList, frame: DocumentFrame, order: Sequence[int]
) -> model.Mission:
    """Put one of the six lists into the groups of the template that its engine drives, in its own order or another."""
    where = parsed.list_path(one.name)
    listed: tuple[Equipment, ...] = getattr(parsed.scenario.equipment_list, one.attribute)
    driven = [g for g in mission.groups if g.role == "asset" and g.engine == one.engine and plays(mission, g)]
    said = parsed.task.initial_state.uav_count
    if one.engine == "multirotor" and said is not None and said != len(listed):
        parsed.notes.append(
            f"{parsed.in_state('uav_count')} says {said:g}, the list has {len(listed)}: the list counts"
        )
    if not driven:
        if listed:
            parsed.notes.append(
                f"{where}: mission '{mission.name}' has no {one.engine}; {len(listed)} kept, not played"
            )
        return mission
    spots = tuple(Spot(item, f"{where}[{k}].data") for k, item in enumerate(listed))
    if order:
        listed, spots = tuple(listed[k] for k in order), tuple(spots[k] for k in order)
    # With several groups of one engine the name tells whose an entity is; without such a name it goes to the first.
    own = {group.name for group in driven}
    stems = [item.name.partition("[")[0] for item in listed]
    unnamed = [k for k, stem in enumerate(stems) if stem not in own]
    owners = [stem if stem in own else driven[0].name for stem in stems]
    shares = [[k for k, owner in enumerate(owners) if owner == group.name] for group in driven]
    if len(driven) > 1 and unnamed:
        names = ", ".join(group.name for group in driven)
        parsed.notes.append(f"{where}: {len(unnamed)} are named like none of {names}; they go to '{driven[0].name}'")
    for group, share in zip(driven, shares, strict=True):
        mission = filled(mission, group, [spots[k] for k in share], frame, parsed, where)
    return mission


# -- the region -----------------------------------------------------------------------------------------------------


def _outline(mission: model.Mission, parsed: Parsed, frame: DocumentFrame) -> geometry2d.Polygon | None:
    where = parsed.in_state("rescueRange")
    corners = parsed.task.initial_state.rescue_range
    region = search_region(mission)
    if not corners:
        if region and any(g.role == "target" and g.type == PERSONS for g in mission.groups):
            parsed.notes.append(f"{where}: is missing or empty; the template's region '{region}' stands")
        return None
    if not region:
        parsed.notes.append(f"{where}: mission '{mission.name}' has no region to search; kept")
        return None
    places = tuple(world(corner, f"{where}[{k}]", frame, parsed) for k, corner in enumerate(corners))
    outline = tuple((place[0], place[1]) for place in places)
    fault = geometry2d.fault(outline)
    if fault:
        parsed.report(where, f"the outline {fault}", "list the corners in order around the area")
        return None
    return outline


def search_region(mission: model.Mission) -> str:
    """The region that persons, or else other targets, are drawn in, else the first one a grid covers, or ""."""
    targets = [g for g in mission.groups if g.role == "target"]
    for group in sorted(targets, key=lambda group: group.type != PERSONS):
        drawn = draw_of(group)
        for argument in drawn.arguments if drawn else ():
            if isinstance(argument, ex.Ref) and argument.kind == "region":
                return argument.name
    return mission.grids[0].region if mission.grids else ""


def _with_region(mission: model.Mission, name: str, outline: geometry2d.Polygon) -> model.Mission:
    shape = ex.Call("polygon", tuple(point(corner) for corner in outline))
    regions = tuple(
        msgspec.structs.replace(region, shape=shape) if region.name == name else region for region in mission.regions
    )
    return msgspec.structs.replace(mission, regions=regions)
