"""`emit(mission)`: a mission as a `resetScenario` document.

A mission from a document gives that document unchanged, with the `lingjing` object added to its scenario if it had
none. A mission in the language gives a complete document with the paper's keys. Such a document has places and no
draws, so that they are drawn first; seed, mode and settings are recorded in `lingjing`. Reading the document again
gives the same instance for that seed.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence

import msgspec

from lingjing.errors import MissionError
from lingjing.mission import frames, jsontext, model
from lingjing.mission.instance import Entity, Instance, Region
from lingjing.mission.instantiate import instantiate
from lingjing.mission.languages import WRITTEN
from lingjing.mission.reset.document import scenario_keys
from lingjing.mission.reset.fields import FIELDS
from lingjing.mission.reset.groups import MEASURES
from lingjing.mission.reset.reading import search_region
from lingjing.mission.reset.shapes import LISTS, fold_key
from lingjing.mission.reset.targets import PERSONS
from lingjing.mission.reset.unit import CROWDED_M
from lingjing.mission.weather_words import word_for

_PERSON_FIELD = "rescuePersonPosition"
_FIRE_FIELD = "goalFirePosition"
"""The paper's field of hidden fires."""

_OWN_FIELDS = {"fire_source": _FIRE_FIELD, "delivery_door": "goalPosition", "air_goal": "goalPosition"}
"""Fields of target types that are not the first type of any field."""

Json = bool | int | float | str | list["Json"] | dict[str, "Json"] | None


def emit(
    mission: model.Mission,
    *,
    seed: int = 0,
    mode: str | None = None,
    settings: Mapping[str, float] | None = None,
    plain: bool = False,
) -> str:
    """The mission as a `resetScenario` document. Seed, mode and settings affect a template only.

    `plain` adds no `lingjing` object: a document comes back unchanged. Raises `MissionError` with the places of a
    template that only that object can hold.
    """
    if mission.origin.document:
        return mission.origin.document if plain else with_template(mission.origin.document, mission.name)
    instance = instantiate(mission, seed=seed, mode=mode, settings=settings)
    scenario = _scenario(mission, instance, dict(settings or {}))
    added = scenario["lingjing"]
    if isinstance(added, dict) and mission.goals:
        added["goals"] = {
            language: instantiate(mission, seed=seed, mode=mode, settings=settings, language=language).goal
            for language in mission.goals
            if language in WRITTEN
        }
    if plain:
        _without_template(mission, scenario)
    document: Json = {"commandType": "resetScenario", "taskId": f"{mission.name}-{seed}", "scenario": scenario}
    return msgspec.json.format(msgspec.json.encode(document), indent=2).decode() + "\n"


def scenario_of(
    mission: model.Mission, instance: Instance, settings: Mapping[str, float], list_of: Callable[[Entity], str]
) -> dict[str, Json]:
    """The `resetScenario` object of a placed instance, in Unreal's centimetres whatever its document had.

    `list_of` gives the list of each asset. The object `lingjing` is left out unless only it can hold some places.
    """
    scenario = _scenario(mission, instance, dict(settings), list_of)
    added = scenario["lingjing"]
    if not (isinstance(added, dict) and "targets" in added):
        del scenario["lingjing"]
    return scenario


def _without_template(mission: model.Mission, scenario: dict[str, Json]) -> None:
    """Remove the `lingjing` object from a generated scenario."""
    added = scenario.pop("lingjing")
    targets = added.get("targets") if isinstance(added, dict) else None
    if isinstance(targets, dict):
        names = " and ".join(f"'{name}'" for name in targets)
        raise MissionError(
            f"no field of a plain document can hold the places of {names} of mission '{mission.name}'",
            hint="leave out --plain: the `lingjing` object holds them",
        )


def with_template(text: str, name: str) -> str:
    """The document with `"lingjing": {"mission": name}` as its scenario's first field; unchanged if it has one."""
    start, keys = _scenario_span(text)
    if any(fold_key(key) == "lingjing" for key in keys):
        return text
    inner = text[start + 1 :]
    margin = inner[: len(inner) - len(inner.lstrip())]
    comma = "" if inner.lstrip().startswith("}") else ","
    added = f'"lingjing": {{"mission": {json.dumps(name, ensure_ascii=False)}}}'
    return f"{text[: start + 1]}{margin}{added}{comma}{inner}"


def _scenario_span(text: str) -> tuple[int, set[str]]:
    """The offset of the scenario's opening brace, and the scenario's keys."""
    plain = jsontext.without_extras(text)
    start = len(plain) - len(plain.removeprefix("\ufeff").lstrip())
    members = _members(plain, start)
    for key in scenario_keys(text):
        start = members[key]
        members = _members(plain, start)
    return start, set(members)


def _members(text: str, start: int) -> dict[str, int]:
    """Keys of the JSON object that begins at `start`, with the offset of each value. Of equal keys the last one is
    used."""
    decoder = json.JSONDecoder()
    offsets: dict[str, int] = {}
    position = _blank(text, start + 1)
    while text[position] != "}":
        key, position = decoder.raw_decode(text, position)
        position = _blank(text, _blank(text, position) + 1)
        offsets[key] = position
        _, position = decoder.raw_decode(text, position)
        position = _blank(text, position)
        if text[position] == ",":
            position = _blank(text, position + 1)
    return offsets


def _blank(text: str, position: int) -> int:
    while text[position] in " \t\r\n":
        position += 1
    return position


# -- a document for a template --------------------------------------------------------------------------------------


def _is_crowded(instance: Instance) -> bool:
    """True if a reader could take the centimetres of the assets' places for metres."""
    assets = [entity.position for entity in instance.entities if entity.role == "asset"]
    return all(max(abs(east), abs(north)) < CROWDED_M for east, north, _ in assets)


def _list_of(entity: Entity) -> str:
    """The list of the bodies of an entity's engine; "" without one."""
    return next((entity_list.name for entity_list in LISTS if entity_list.engine == entity.engine), "")


def _scenario(
    mission: model.Mission,
    instance: Instance,
    settings: dict[str, float],
    list_of: Callable[[Entity], str] = _list_of,
) -> dict[str, Json]:
    added: dict[str, Json] = {"mission": mission.name, "mode": instance.mode, "seed": instance.seed}
    drawn = {param.name: instance.settings[param.name] for param in mission.parameters if param.is_drawn}
    if settings or drawn:
        added["settings"] = {**drawn, **settings}
    if _is_crowded(instance):
        added["unit"] = "cm"
    fields, others = _targets(mission, instance)
    if others:
        added["targets"] = others
    lists: dict[str, Json] = {
        entity_list.name: [
            _equipment(e) for e in instance.entities if e.role == "asset" and list_of(e) == entity_list.name
        ]
        for entity_list in LISTS
    }
    return {
        "commandType": "resetScenario",
        "lingjing": added,
        "sceneName": instance.title,
        "collaborationType": instance.mode,
        "sceneRegion": instance.scene.kind,
        "equipmentList": lists,
        "taskMatrix": [
            {
                "taskLevel": "System",
                "task_id": f"{mission.name.upper()}_{instance.seed}",
                "goal": instance.goal,
                "initial_state": _initial_state(mission, instance, lists, fields),
            }
        ],
    }


def _initial_state(
    mission: model.Mission, instance: Instance, lists: Mapping[str, Json], fields: dict[str, Json]
) -> dict[str, Json]:
    drones = lists["droneEntityList"]
    state: dict[str, Json] = {
        "weather": word_for(instance.weather.visibility_m, instance.weather.cloud),
        "uav_count": len(drones) if isinstance(drones, list) else 0,
    }
    persons = any(group.type == PERSONS for group in mission.groups)
    name = search_region(mission) if persons else ""
    outline = _corners([region for region in instance.regions if region.name == name], instance)
    # The paper's own keys are always present; the hidden places of other missions follow.
    return {**state, _PERSON_FIELD: [], "rescueRange": outline, _FIRE_FIELD: [], **fields}


def _targets(mission: model.Mission, instance: Instance) -> tuple[dict[str, Json], dict[str, Json]]:
    """The places of the target groups: under the document's own fields, and by group without such a field.

    A field belongs to the first group of its types; the reader assigns it to the same group.
    """
    fields: dict[str, Json] = {}
    others: dict[str, Json] = {}
    types: set[str] = set()
    for group in (group for group in mission.groups if group.role == "target"):
        members = [entity for entity in instance.entities if entity.group == group.name]
        if not members and group.when is not None:
            continue  # a group of another mode
        field = _OWN_FIELDS.get(group.type) or next(
            (f.name for f in FIELDS if f.types[0] in (group.type, *group.bases)), None
        )
        places: Json = [_target(entity, field == _PERSON_FIELD) for entity in members]
        if field is None or field in fields or group.type in types:
            others[group.name] = places
        else:
            fields[field] = places
        types.add(group.type)
    return fields, others


def _target(entity: Entity, person: bool) -> Json:
    values = ((measure, entity.properties.get(measure.property)) for measure in MEASURES)
    added: dict[str, Json] = {
        measure.field: value * measure.per_unit for measure, value in values if isinstance(value, int | float)
    }
    return {"personId" if person else "targetId": entity.label or entity.id, **_coordinates(entity.position), **added}


def _corners(regions: Sequence[Region], instance: Instance) -> list[Json]:
    return [
        {"rangeId": f"RANGE-{k:03d}", **_coordinates((east, north, instance.scene.datum_m))}
        for region in regions
        for k, (east, north) in enumerate(region.polygon, start=1)
    ]


def _equipment(entity: Entity) -> Json:
    heading = "raw" if entity.engine == "multirotor" else "heading"
    return {
        "equipmentCode": entity.label or entity.id,
        "name": entity.id,
        "data": _coordinates(entity.position),
        heading: entity.heading_deg,
        "sensorType": "/".join(camera.name for camera in entity.cameras),
    }


def _coordinates(position: tuple[float, float, float]) -> dict[str, Json]:
    x, y, z = frames.to_unreal(*position)
    return {"X": x, "Y": y, "Z": z}
