"""`instantiate_document`: a `resetScenario` document fills a template mission.

The document places entities and hidden targets. The template supplies everything else (budget, actions, rules). Lists
of the document fill the groups of the template with the same engine (`groups`), hidden places its target groups
(`targets`), and the rescue range the region in which targets are drawn. Other parts stay in the document, which
`Mission.origin` keeps unchanged, and are noted (`notes`). `lingjing.mission.reset.emit` is the inverse.
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
from lingjing.mission.reset.fields import HiddenEntries, hidden_fields
from lingjing.mission.reset.frame import DocumentFrame, frame_of, untied_fault
from lingjing.mission.reset.groups import (
    Spot,
    draw_of,
    exists_by_default,
    fill_group,
    origin_of,
    point,
    to_world,
    with_default,
)
from lingjing.mission.reset.notes import note_starts, unread_notes
from lingjing.mission.reset.repair import without_consequences
from lingjing.mission.reset.row_goals import GOALS, goal_text, has_later_places, owners_of, row_goals
from lingjing.mission.reset.scene_fit import fit_template
from lingjing.mission.reset.shapes import LISTS, EntityList, Equipment, fold_key
from lingjing.mission.reset.targets import PERSONS, place_targets
from lingjing.mission.reset.template import FREE, fleet_of, template_name
from lingjing.mission.reset.unit import METRE_M
from lingjing.mission.vocabulary import MODES
from lingjing.mission.weather_words import RAINY, sky_of

_MODE_WORDS: dict[str, str] = {**{mode: mode for mode in MODES}, "星型": "star", "广播": "broadcast"}
"""Spellings of a communication mode in `collaborationType`. Other values are free text."""


def instantiate_document(
    text: str, path: str, templates: Callable[[str], model.Mission]
) -> tuple[model.Mission, tuple[str, ...]]:
    """The mission that a document describes, and notes on recognised, kept and unknown parts.

    `path` is used in messages. `templates` returns the compiled mission of a name and raises `KeyError` if there is
    none. Raises `UsageError` for text that is not JSON (line and column), `MissionError` for an invalid scenario, with
    the JSON path of every fault.
    """
    parsed = parse(text, path)
    before = len(parsed.faults)
    hidden_entries = hidden_fields(parsed)
    first = len(parsed.faults)
    if first and not parsed.decided:
        raise document_error(path, parsed.faults)
    try:
        name, where, why = template_name(parsed, hidden_entries)
    except MissionError as error:
        if first > before:  # the unreadable hidden places may be the ones that select the template
            raise document_error(path, parsed.faults) from None
        if (fault := untied_fault(parsed, hidden_entries, SceneSpec(kind="").origin)) is not None:
            raise document_error(path, [*error.faults, fault]) from None
        raise
    try:
        template = templates(name)
    except KeyError:
        raise parsed.fault(
            where, f"there is no template '{name[:60]}'", "name one of the missions in scenarios/"
        ) from None
    parsed.notes.insert(0, f"template '{name}': {why}")
    goals = row_goals(parsed, hidden_entries) if name == GOALS else None
    hidden_entries = (goals.hidden,) if goals else hidden_entries
    template = _fleet_template(template, parsed, hidden_entries, templates)
    template, mission = _place_all(template, parsed, hidden_entries, goals.order if goals else ())
    if parsed.faults:
        raise document_error(path, without_consequences(parsed.faults, first, parsed.task_path))
    note_starts(parsed)
    parsed.notes.extend(unread_notes(text, parsed, hidden_entries))
    digest = hashlib.sha256(text.encode("utf-8", "surrogatepass")).hexdigest()
    draws: dict[str, ex.Expr] = {
        group.name: drawn for group in template.groups if (drawn := draw_of(group)) is not None
    }
    origin = model.Origin(file=path, sha256=digest, document=text, draws=draws, places=dict(parsed.placed))
    return msgspec.structs.replace(mission, origin=origin), tuple(parsed.notes)


def _fleet_template(
    template: model.Mission,
    parsed: Parsed,
    hidden_entries: Sequence[HiddenEntries],
    templates: Callable[[str], model.Mission],
) -> model.Mission:
    """The template's fleet, with a note, if the document has several entities for a single group of the template and
    does not name the template itself."""
    fleet, extra = fleet_of(template.name), parsed.scenario.lingjing
    if not fleet or (extra is not None and extra.mission is not None):
        return template
    for where, count, group in _fields_with_several(template, parsed, hidden_entries):
        if group.count is None:
            held = f"{where}: holds {count}, '{template.name}' has one {group.name}"
            parsed.notes.insert(1, f"{held}: '{fleet}' is played, which takes several")
            return templates(fleet)
    return template


def _fields_with_several(
    template: model.Mission, parsed: Parsed, hidden_entries: Sequence[HiddenEntries]
) -> Iterator[tuple[str, int, model.Group]]:
    """(JSON path, count, group) of each list or hidden field with several entries for one group of the template."""
    for entity_list in LISTS:
        count = len(getattr(parsed.scenario.equipment_list, entity_list.attribute))
        driven = [group for group in template.groups if group.role == "asset" and group.engine == entity_list.engine]
        if count > 1 and len(driven) == 1:
            yield parsed.list_path(entity_list.name), count, driven[0]
    for field in hidden_entries:
        suitable = [group for group in template.groups if not {group.type, *group.bases}.isdisjoint(field.field.types)]
        if len(field.targets) > 1 and len(suitable) == 1:
            yield field.path, len(field.targets), suitable[0]


# -- the parts of the mission ---------------------------------------------------------------------------------------


def _place_all(
    template: model.Mission, parsed: Parsed, hidden_entries: Sequence[HiddenEntries], order: Sequence[int]
) -> tuple[model.Mission, model.Mission]:
    """The template, with a scene that reaches the document's places, and the mission from it. `order` is the order of
    the UAVs if it differs from the document's."""
    plain = _set_texts(_configure(template, parsed), parsed)
    frame = frame_of(parsed, hidden_entries, origin_of(plain))
    if frame.untied:
        return plain, plain
    plain = _with_origin(plain, frame)
    before = len(parsed.notes)
    mission = _fill_all(plain, parsed, hidden_entries, frame, order)
    parsed.faults.extend(foreign_lengths(parsed.raw, parsed.path, in_metres=frame.unit_m == METRE_M))
    if parsed.faults:
        return plain, mission
    fitted = fit_template(plain, mission, parsed)
    if fitted is None:
        return plain, mission
    note = parsed.notes[-1]
    del parsed.notes[before:]
    parsed.notes.append(note)
    return fitted, _fill_all(fitted, parsed, hidden_entries, frame, order)


def _fill_all(
    plain: model.Mission,
    parsed: Parsed,
    hidden_entries: Sequence[HiddenEntries],
    frame: DocumentFrame,
    order: Sequence[int],
) -> model.Mission:
    """The mission with all entities and regions from the document."""
    mission = plain
    for entity_list in LISTS:
        mission = _fill_from_list(
            mission, parsed, entity_list, frame, order if entity_list.engine == "multirotor" else ()
        )
    outline = _outline(mission, parsed, frame)
    if outline is not None:
        mission = _with_region(mission, search_region(mission), outline)
    return place_targets(mission, parsed, hidden_entries, frame, outline)


def _with_origin(mission: model.Mission, frame: DocumentFrame) -> model.Mission:
    """The mission with its scene at the frame's origin."""
    if frame.origin == origin_of(mission):
        return mission
    degrees = ex.Point(tuple(ex.Number(value, "deg") for value in frame.origin))
    kept = tuple(option for option in mission.scene.options if option.name != "origin")
    options = (*kept, model.Property(name="origin", value=degrees))
    return msgspec.structs.replace(mission, scene=msgspec.structs.replace(mission.scene, options=options))


def _configure(template: model.Mission, parsed: Parsed) -> model.Mission:
    """The template with the mode and settings of the document's `lingjing` object as its defaults."""
    extra = parsed.scenario.lingjing
    mode_word = _MODE_WORDS.get(fold_key(parsed.scenario.collaboration_type))
    if extra is None or extra.mode is None:
        template = _set_mode(template, parsed)
    elif mode_word not in (None, extra.mode):
        parsed.notes.append(
            f"{parsed.at('collaborationType')}: says '{mode_word}', 'lingjing' {extra.mode}: the latter is used"
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


def _set_mode(template: model.Mission, parsed: Parsed) -> model.Mission:
    """The template in the mode that `collaborationType` names, if any."""
    word = parsed.scenario.collaboration_type
    mode, where = _MODE_WORDS.get(fold_key(word)), parsed.at("collaborationType")
    if mode is None or mode == template.modes.default:
        return template
    if mode not in template.modes.allowed:
        parsed.notes.append(
            f"{where}: mission '{template.name}' has no mode '{mode}'; kept, {template.modes.default} is played"
        )
        return template
    parsed.notes.append(f"{where}: '{word}' is the mode that is played")
    return msgspec.structs.replace(template, modes=msgspec.structs.replace(template.modes, default=mode))


def _set_texts(mission: model.Mission, parsed: Parsed) -> model.Mission:
    """The mission with the document's title, goal, weather, budget and altitude."""
    state = parsed.task.initial_state
    rows = len(parsed.scenario.task_matrix)
    shared = rows > 1 and has_later_places(parsed)
    own = mission.name == GOALS
    if own or mission.name in dict(FREE):
        mission = _set_tick_budget(mission, parsed)
    else:
        _note_steps(mission, parsed)
    if rows > 1 and not own:
        beside = ", with the hidden places of the others" if shared else ""
        parsed.notes.append(f"{parsed.at('taskMatrix')}: the first of {rows} rows is played{beside}")
    if shared and not own:
        _note_owners(mission, parsed)
    mission = _set_altitude(mission, parsed)
    goal = goal_text(parsed) if own or shared else parsed.task.goal
    return msgspec.structs.replace(
        mission,
        title=parsed.scenario.scene_name or mission.title,
        goal=goal or mission.goal,
        goals=_goals(mission, goal, parsed),
        weather=_weather(mission.weather, state.weather, parsed.in_state("weather"), parsed),
    )


def _goals(mission: model.Mission, goal: str | None, parsed: Parsed) -> dict[str, str]:
    """The goal in the template's other languages: the document's text in each, or its only text, whatever its language
    is; the template's without a goal in the document."""
    own = parsed.scenario.lingjing.goals if parsed.scenario.lingjing else {}
    return {language: own.get(language) or goal or text for language, text in mission.goals.items()}


_MAX_STEPS = "max_steps"
"""The document's field with a budget of ticks."""

_STEPS_MOST = 10_000
"""The largest budget of ticks from a document (chosen)."""


def _max_steps(parsed: Parsed) -> tuple[str, object]:
    """The JSON path of the document's `max_steps` and its value; ("", None) without one."""
    for holder, path in parsed.holders():
        for key, value in holder.items():
            if fold_key(key) == fold_key(_MAX_STEPS):
                parsed.understood.add(fold_key(key))
                return f"{path}.{key}", value
    return "", None


def _note_steps(mission: model.Mission, parsed: Parsed) -> None:
    """Note that the template's own budget is used, because its ticks have the length that its actions need."""
    where, steps = _max_steps(parsed)
    if where:
        parsed.notes.append(
            f"{where}: {steps!r} is kept; the budget of mission '{mission.name}' is used, which has its own ticks"
        )


def _note_owners(mission: model.Mission, parsed: Parsed) -> None:
    """Note that rows assign their places to single agents, and that in the mission any agent may serve them."""
    owners = owners_of(parsed)
    if len(owners) > 1:
        names = ", ".join(f"'{owner}'" for owner in owners)
        parsed.notes.append(
            f"{parsed.at('taskMatrix')}: the rows name {names}; in mission '{mission.name}' any of them may serve "
            "each place"
        )


def _set_tick_budget(mission: model.Mission, parsed: Parsed) -> model.Mission:
    """The mission with the document's `max_steps` as its budget of ticks."""
    where, steps = _max_steps(parsed)
    if not where:
        return mission
    if not isinstance(steps, int) or isinstance(steps, bool) or not 1 <= steps <= _STEPS_MOST:
        parsed.notes.append(
            f"{where}: is no number of ticks from 1 to {_STEPS_MOST}; kept, the template's budget is used"
        )
        return mission
    parsed.notes.append(f"{where}: is the budget of {steps} ticks")
    return msgspec.structs.replace(
        mission, budget=msgspec.structs.replace(mission.budget, ticks=ex.Number(float(steps)))
    )


_ALTITUDE = "altitude"
"""The parameter of a template with the altitude of its aircraft."""


def _set_altitude(mission: model.Mission, parsed: Parsed) -> model.Mission:
    """The mission with `takeoff_height_m` as the altitude of its aircraft, if it has a suitable parameter."""
    height, where = parsed.task.initial_state.takeoff_height_m, parsed.in_state("takeoff_height_m")
    if height is None:
        return mission
    known = next((parameter for parameter in mission.parameters if parameter.name == _ALTITUDE), None)
    bounds = known.bounds if known else None
    low, high = (bounds.low, bounds.high) if isinstance(bounds, ex.Range) else (None, None)
    fits = isinstance(low, ex.Number) and isinstance(high, ex.Number) and low.value <= height <= high.value
    if known is None or not fits:
        parsed.notes.append(f"{where}: mission '{mission.name}' has no flight altitude of {height:g} m; kept")
        return mission
    parsed.notes.append(f"{where}: is the parameter '{_ALTITUDE}'")
    return with_default(mission, _ALTITUDE, height)


def _weather(
    properties: tuple[model.Property, ...], word: str | dict[str, Any], where: str, parsed: Parsed
) -> tuple[model.Property, ...]:
    if not word:
        return properties
    sky = sky_of(word) if isinstance(word, str) else None
    if sky is None:
        value = f"'{word}'" if isinstance(word, str) else "an object"
        parsed.notes.append(f"{where}: {value} is not understood and kept; the template's weather is used")
        return properties
    if sky.word == RAINY:
        parsed.notes.append(f"{where}: '{word}' sets visibility and cloud alone; no rain falls")
    known = {p.name: p.value.value for p in properties if isinstance(p.value, ex.Number)}
    calm = Weather()
    if sky.fits(known.get("visibility_m", calm.visibility_m), known.get("cloud", calm.cloud)):
        return properties
    parsed.notes.append(
        f"{where}: '{word}' sets visibility {sky.typical_visibility_m:g} m, cloud {sky.typical_cloud:g}"
    )
    changed = (
        model.Property(name="visibility_m", unit="m", value=ex.Number(sky.typical_visibility_m, "m")),
        model.Property(name="cloud", value=ex.Number(sky.typical_cloud)),
    )
    return (*(p for p in properties if p.name not in ("visibility_m", "cloud")), *changed)


def _fill_from_list(
    mission: model.Mission, parsed: Parsed, entity_list: EntityList, frame: DocumentFrame, order: Sequence[int]
) -> model.Mission:
    """Fill the groups of the template that an engine drives from its list, in the document's order or in `order`."""
    where = parsed.list_path(entity_list.name)
    listed: tuple[Equipment, ...] = getattr(parsed.scenario.equipment_list, entity_list.attribute)
    driven = [
        g
        for g in mission.groups
        if g.role == "asset" and g.engine == entity_list.engine and exists_by_default(mission, g)
    ]
    stated_count = parsed.task.initial_state.uav_count
    if entity_list.engine == "multirotor" and stated_count is not None and stated_count != len(listed):
        parsed.notes.append(
            f"{parsed.in_state('uav_count')} says {stated_count:g}, the list has {len(listed)}: the list is used"
        )
    if not driven:
        if listed:
            parsed.notes.append(
                f"{where}: mission '{mission.name}' has no {entity_list.engine}; {len(listed)} kept, not played"
            )
        return mission
    spots = tuple(Spot(item, f"{where}[{k}].data") for k, item in enumerate(listed))
    if order:
        listed, spots = tuple(listed[k] for k in order), tuple(spots[k] for k in order)
    # With several groups of one engine, an entity's name selects its group; other names belong to the first group.
    own = {group.name for group in driven}
    stems = [item.name.partition("[")[0] for item in listed]
    unnamed = [k for k, stem in enumerate(stems) if stem not in own]
    owners = [stem if stem in own else driven[0].name for stem in stems]
    shares = [[k for k, owner in enumerate(owners) if owner == group.name] for group in driven]
    if len(driven) > 1 and unnamed:
        names = ", ".join(group.name for group in driven)
        parsed.notes.append(f"{where}: {len(unnamed)} have no name of {names}; they are assigned to '{driven[0].name}'")
    for group, share in zip(driven, shares, strict=True):
        mission = fill_group(mission, group, [spots[k] for k in share], frame, parsed, where)
    return mission


# -- the region -----------------------------------------------------------------------------------------------------


def _outline(mission: model.Mission, parsed: Parsed, frame: DocumentFrame) -> geometry2d.Polygon | None:
    where = parsed.in_state("rescueRange")
    corners = parsed.task.initial_state.rescue_range
    region = search_region(mission)
    if not corners:
        if region and any(g.role == "target" and g.type == PERSONS for g in mission.groups):
            parsed.notes.append(f"{where}: is missing or empty; the template's region '{region}' is used")
        return None
    if not region:
        parsed.notes.append(f"{where}: mission '{mission.name}' has no region to search; kept")
        return None
    places = tuple(to_world(corner, f"{where}[{k}]", frame, parsed) for k, corner in enumerate(corners))
    outline = tuple((place[0], place[1]) for place in places)
    fault = geometry2d.fault(outline)
    if fault:
        parsed.report(where, f"the outline {fault}", "list the corners in order around the area")
        return None
    return outline


def search_region(mission: model.Mission) -> str:
    """The region in which persons, or else other targets, are drawn; else the region of the first grid, or ""."""
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
