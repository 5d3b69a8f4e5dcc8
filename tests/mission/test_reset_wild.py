"""resetScenario documents of other systems: each is read with notes on inferred values, and written back unchanged."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from benchmarks.mutated_documents import read_mutated
from benchmarks.silent_guesses import silent_guesses
from lingjing.errors import ExitCode, MissionError
from lingjing.mission.instance import Instance
from lingjing.mission.reset.emit import emit
from lingjing.testing import instantiate, run_command
from lingjing.testing.documents import read, templates_beside

TEMPLATES = templates_beside(Path("nowhere"))
Json = dict[str, Any]

DRONE = {"equipmentCode": "UAV-001", "name": "无人机1", "data": {"x": 1000.0, "y": 2000.0, "z": 100.0, "yaw": 0.0}}
DOG = {"equipmentCode": "DOG-001", "name": "机器狗", "data": {"x": 0.0, "y": 0.0, "z": 0.0, "yaw": -90.0}}
CAR = {"equipmentCode": "CAR-001", "name": "车", "data": {"x": 0.0, "y": 0.0, "z": 0.0}, "heading": 10}


def document(state: Json, *, drones: int = 0, dogs: int = 0, cars: int = 0, ships: int = 0, **task: Any) -> Json:
    """A document with these numbers of entities, 20 m apart, and this initial state."""

    def fleet(template: Json, count: int) -> list[Json]:
        return [
            {
                **template,
                "equipmentCode": f"{template['equipmentCode'][:-1]}{k}",
                "data": {**template["data"], "y": 2000.0 * k},
            }
            for k in range(count)
        ]

    lists = {
        "droneEntityList": fleet(DRONE, drones),
        "unmannedDogEntityList": fleet(DOG, dogs),
        "autoVehicleEntityList": fleet(CAR, cars),
        "shipEntityList": fleet({**CAR, "equipmentCode": "SHIP-001"}, ships),
        "satelliteEntityList": [],
    }
    return {
        "commandType": "resetScenario",
        "taskId": "wild_001",
        "scenario": {"equipmentList": lists, "taskMatrix": [{**task, "initial_state": state}]},
    }


def play(whole: Json | str) -> tuple[Instance, tuple[str, ...]]:
    """The instance of a document, and its notes. Asserts that the document comes back with the same values."""
    text = whole if isinstance(whole, str) else json.dumps(whole, ensure_ascii=False)
    mission, notes = read(text, "w.json", TEMPLATES)
    instance = instantiate(mission, seed=3)
    assert emit(mission, plain=True) == text
    again, _ = read(emit(mission), "w.json", TEMPLATES)
    assert instantiate(again, seed=3).entities == instance.entities
    return instance, notes


def at(instance: Instance, group: str) -> list[tuple[float, float]]:
    return [entity.position[:2] for entity in instance.entities if entity.group == group]


PLACE = {"x": 5000.0, "y": -3000.0, "z": 0.0}
JAMS = [{"conId": "c1", "x": 2000.0, "y": 300.0, "z": 0.0}]
POINTS = [{"delId": f"d{k}", **PLACE, "x": 4000.0 * k} for k in range(1, 4)]
STORE = {"warehouseId": "w1", "x": 100.0, "y": -100.0, "z": 0.0}


@pytest.mark.parametrize(
    ("mission", "fleet", "task", "state"),
    [
        ("bi", {"drones": 1}, {"task_type": "bridge"}, {"fracturePosition": [PLACE]}),
        ("bi", {"drones": 1}, {"task_type": "Bridge"}, {}),
        ("vdn", {"dogs": 1}, {"task_type": "singledog"}, {"goalPosition": PLACE}),
        ("vdn", {"dogs": 1}, {"task_type": "single_dog"}, {"target_house": {"status": "open", "position": PLACE}}),
        ("upr", {"drones": 1, "dogs": 1}, {"task_type": "uavdog"}, {"pipelineLeakPosition": [{"pipeId": 7, **PLACE}]}),
        ("upr", {"drones": 1, "dogs": 1}, {"task_type": "UAV with dog"}, {}),
        ("cd", {"cars": 4}, {"task_type": "deliverytask"}, {"goalDelPosition": POINTS, "warehousePosition": [STORE]}),
        ("cd", {"cars": 2}, {"task_type": "multicars"}, {"delivery_points": POINTS, "warehouse": STORE}),
        ("cr", {"drones": 1, "cars": 1}, {"task_type": "multi-cars"},
         {"congestionPoints": JAMS, "goalPosition": PLACE}),
        ("ufr", {"drones": 2, "cars": 1}, {"task_type": "fire_rescue"}, {"goalFirePosition": [{"fireId": 1, **PLACE}]}),
        ("idf", {"dogs": 2}, {"task_type": "fire-rescue"}, {"goalFirePosition": [PLACE]}),
        ("queue", {"drones": 1, "dogs": 1}, {},
         {"queuingList": [{"personCount": n, "spacing": 60, "heading": 90, **PLACE, "x": 3000.0 * n} for n in (4, 9)]}),
        ("ld", {"drones": 1, "cars": 1, "dogs": 1}, {"task_type": "delivery"},
         {"delivery_point": {"status": "idle", "position": PLACE}, "target_house": {"position": {**PLACE, "x": 0.0}}}),
        ("ssr", {"drones": 2, "ships": 1}, {}, {"rescuePersonPosition": [{"personId": "p", **PLACE}]}),
    ],
)  # fmt: skip
def test_templates_are_selected_by_task_type_entities_and_fields(
    mission: str, fleet: Json, task: Json, state: Json
) -> None:
    instance, notes = play(document(state, **fleet, **task))
    assert instance.mission == mission
    assert any("read as X, Y, Z, Unreal's centimetres" in note for note in notes)
    assert not [note for note in notes if "not understood" in note], notes


def test_every_value_of_a_document_reaches_the_instance() -> None:
    people = [{"personCount": n, "heading": 30.0 * n, "x": 3000.0 * n, "y": 0.0} for n in (4, 9)]
    shops = [e for e in play(document({"queuingList": people}, drones=1, dogs=1))[0].entities if e.group == "shop"]
    assert [(e.position[:2], e.properties["people"], e.heading_deg) for e in shops] == [
        ((120.0, 0.0), 4.0, 120.0), ((270.0, 0.0), 9.0, 270.0),
    ]  # fmt: skip
    state = {"goalDelPosition": [{**POINTS[0], "weight": 12.5}], "warehousePosition": [STORE]}
    instance, _ = play(document(state, cars=1))
    assert at(instance, "point") == [(40.0, 30.0)] and at(instance, "depot") == [(1.0, 1.0)]
    point = next(entity for entity in instance.entities if entity.group == "point")
    assert (point.label, point.properties["demand_kg"]) == ("d1", 12.5)
    delivery = {"delivery_point": {"position": PLACE}, "target_house": {"position": {**PLACE, "x": 0.0}}}
    instance, _ = play(document(delivery, drones=1, cars=1, dogs=1, task_type="delivery"))
    assert at(instance, "house") == [(0.0, 30.0)] and at(instance, "stop_node") == [(50.0, 30.0)]


def test_a_yaw_inside_the_place_is_read_as_unreal_yaw() -> None:
    instance, _ = play(document({"goalPosition": PLACE}, dogs=1, task_type="single dog"))
    assert next(e for e in instance.entities if e.group == "dog").heading_deg == 0.0  # yaw -90


@pytest.mark.parametrize(
    ("edit", "note"),
    [
        (lambda w: {"type": "COMMAND", "data": w}, "the transport envelope is removed"),
        (lambda w: {"type": "COMMAND", "data": w["scenario"]}, "the transport envelope is removed"),
        (lambda w: {"Data": {"type": "COMMAND", "data": w}}, "the transport envelope is removed; $.Data.data is read"),
        (lambda w: _rows(w, w["scenario"]["taskMatrix"][0]), "taskMatrix: is one object"),
        (lambda w: json.dumps(w).replace('"taskId"', '// 说明\n"taskId" /* id */', 1), "comments are not valid JSON"),
        (
            lambda w: json.dumps(w).replace("}]", "} , ]").replace("]}", "],\n}"),
            "commas before a bracket are not valid JSON",
        ),
        (lambda w: _drones(w, w["scenario"]["equipmentList"]["droneEntityList"][0]), "droneEntityList: is one object"),
        (lambda w: json.dumps(w, separators=(",", ":")), ""),
        (lambda w: json.dumps(w).replace("droneEntityList", "drone_entity_list"), ""),
        (lambda w: json.dumps(w).replace("equipmentCode", "equipment_code").replace("taskMatrix", "task_matrix"), ""),
    ],
)
def test_wrapped_or_slightly_malformed_documents_are_read_with_a_note(
    edit: Callable[[Json], Json | str], note: str
) -> None:
    whole = document({"goalFirePosition": [{"range": 5, "scale": 2, **PLACE}]}, drones=1, cars=1)
    plain, before = play(whole)
    instance, notes = play(edit(json.loads(json.dumps(whole))))
    assert instance.entities == plain.entities
    assert note in "\n".join(notes) and len(notes) == len(before) + bool(note), notes


def _rows(whole: Json, rows: Json) -> Json:
    whole["scenario"]["taskMatrix"] = rows
    return whole


def _drones(whole: Json, drones: Json) -> Json:
    whole["scenario"]["equipmentList"]["droneEntityList"] = drones
    return whole


def test_the_search_range_and_the_takeoff_height_are_used() -> None:
    corners = [{"x": x, "y": y} for x, y in ((-9000, -9000), (9000, -9000), (9000, 9000), (-9000, 9000))]
    state = {"goalFirePosition": [PLACE], "search_range": corners, "takeoff_height_m": 90}
    instance, notes = play(document(state, drones=2, cars=1))
    assert set(instance.regions[0].polygon) == {(-90.0, -90.0), (90.0, -90.0), (90.0, 90.0), (-90.0, 90.0)}
    assert instance.settings["altitude"] == 90.0
    assert any("takeoff_height_m: is the parameter 'altitude'" in note for note in notes)
    _, notes = play(document({**state, "takeoff_height_m": 900}, drones=2, cars=1))
    assert any("has no flight altitude of 900 m; kept" in note for note in notes)


ORDOS = (39.83, 109.9455)


def _in_degrees(east: float, north: float) -> Json:
    return {"lon": ORDOS[1] + east / 85_500.0, "lat": ORDOS[0] + north / 111_030.0, "alt": 1342.0}


def test_the_origin_is_inferred_from_degrees_and_the_ground_from_the_lowest_height() -> None:
    whole = document({"goalFirePosition": [_in_degrees(0.0, 100.0)]}, drones=1, cars=1)
    lists = whole["scenario"]["equipmentList"]
    lists["droneEntityList"][0]["data"] = {**_in_degrees(-50.0, -50.0), "alt": 1352.0}
    lists["autoVehicleEntityList"][0]["data"] = _in_degrees(50.0, -50.0)
    instance, notes = play(whole)
    assert instance.scene.origin == pytest.approx(ORDOS, abs=1e-3)
    assert at(instance, "truck") == [pytest.approx((50.0, -75.0), abs=1.0)]  # the middle of the range lies 25 m north
    heights = {e.group: e.position[2] for e in instance.entities}
    assert heights["uav"] - heights["truck"] == pytest.approx(10.0)
    assert any("origin is assumed to be at 39.8302, 109.9" in note for note in notes), notes
    whole["scenario"]["lingjing"] = {"origin": [*ORDOS], "datum_m": 1340.0}
    instance, notes = play(whole)
    assert instance.scene.origin == ORDOS and not [note for note in notes if "is taken" in note]
    assert {e.group: e.position[2] for e in instance.entities}["truck"] == pytest.approx(2.0)


def test_very_low_heights_are_read_relative_to_the_lowest_one() -> None:
    whole = document({"goalFirePosition": [{**PLACE, "z": -243_000.0}]}, drones=1, cars=1)
    lists = whole["scenario"]["equipmentList"]
    lists["droneEntityList"][0]["data"]["z"] = lists["autoVehicleEntityList"][0]["data"]["z"] = -242_900.0
    instance, notes = play(whole)
    assert [e.position[2] for e in instance.entities if e.group in ("uav", "truck")] == [1.0, 1.0]
    assert any("heights begin at -2430 m, which is used as ground level" in note for note in notes)


def test_a_place_in_both_frames_determines_the_origin() -> None:
    whole = document({"goalFirePosition": [_in_degrees(0.0, 100.0)]}, drones=1, cars=1)
    whole["scenario"]["equipmentList"]["droneEntityList"][0]["data"] |= _in_degrees(10.0, 0.0) | {"alt": 0.0}
    instance, _ = play(whole)  # the drone is at (10, 0) m both by its centimetres and by its degrees
    assert at(instance, "fire") == [pytest.approx((0.0, 100.0), abs=1.0)]


@pytest.mark.parametrize(("drones", "dogs"), [(10, 0), (0, 5)])
def test_fleets_of_any_size_are_accepted_and_noted(drones: int, dogs: int) -> None:
    fire = {"goalFirePosition": [PLACE]}
    instance, notes = play(document(fire, drones=drones, dogs=dogs, cars=1 if drones else 0))
    assert sum(e.role == "asset" for e in instance.entities) == drones + dogs + bool(drones)
    assert any("more than the" in note for note in notes)
    assert len({agent.id for agent in instance.agents}) >= max(drones, dogs)


def test_every_fault_is_reported_in_one_run_with_its_path() -> None:
    whole = document({"goalFirePosition": [{"x": "1", "y": 2}, {"name": "nowhere"}]}, drones=3, cars=1)
    scenario = whole["scenario"]
    drones = scenario["equipmentList"]["droneEntityList"]
    drones[0]["data"]["x"] = "1000"
    del drones[1]["data"]
    drones[2]["heading"] = {"deg": 3}
    scenario["equipmentList"]["autoVehicleEntityList"][0]["data"] = {"lon": 500.0, "lat": 31.0}
    scenario["commandType"] = "moveTo"
    with pytest.raises(MissionError) as caught:
        read(json.dumps(whole), "w.json", TEMPLATES)
    at = "$.scenario.equipmentList"
    assert {(fault.where, fault.message) for fault in caught.value.faults} == {
        (f"{at}.droneEntityList[0].data.x", "a number is due, this is the text '1000'"),
        (f"{at}.droneEntityList[1]", "'data' is missing"),
        (f"{at}.droneEntityList[2].heading", "a number is due, this is an object"),
        (f"{at}.autoVehicleEntityList[0].data.lon", "is 500, at most 180 is due"),
        ("$.scenario.commandType", "'moveTo' is not known, 'resetScenario' is"),
        ("$.scenario.taskMatrix[0].initial_state.goalFirePosition[0].x", "a number is due, this is the text '1'"),
        ("$.scenario.taskMatrix[0].initial_state.goalFirePosition[1]", "has no place"),
    }
    assert all(fault.hint for fault in caught.value.faults)


def test_faults_of_all_phases_are_reported_in_one_run() -> None:
    """Each phase checks something else: numbers, shapes, the `lingjing` object, places and outlines."""
    whole = document({"goalFirePosition": [{"fireId": 1, **PLACE}, {"fireId": 2, "x": "3", "y": 2}]}, drones=3, cars=1)
    scenario = whole["scenario"]
    scenario["lingjing"] = {"bogus": 1, "settings": {"foo": 1, "uavs": 99}, "origin": [200, 300]}
    lists = scenario["equipmentList"]
    lists["droneEntityList"][0]["data"]["x"] = float("nan")
    lists["droneEntityList"][1]["data"]["x"] = 1e300
    lists["droneEntityList"][2]["heading"] = 1e9
    lists["autoVehicleEntityList"][0]["data"] = "here"
    scenario["taskMatrix"][0]["initial_state"]["takeoff_height_m"] = float("inf")
    with pytest.raises(MissionError) as caught:
        read(json.dumps(whole), "w.json", TEMPLATES)
    at, state = "$.scenario.equipmentList", "$.scenario.taskMatrix[0].initial_state"
    assert [(fault.where, fault.message) for fault in caught.value.faults] == [
        (f"{at}.droneEntityList[0].data.x", "is NaN, not a finite number"),
        (f"{state}.takeoff_height_m", "is infinite, not a finite number"),
        ("$.scenario.lingjing", "unknown field 'bogus'"),
        (f"{at}.droneEntityList[2].heading", "is 1e+09, at most 360 is due"),
        (f"{at}.autoVehicleEntityList[0].data", "an object is due, this is the text 'here'"),
        (f"{state}.goalFirePosition[1].x", "a number is due, this is the text '3'"),
        ("$.scenario.lingjing.settings.foo", "mission 'ufr' has no parameter 'foo'"),
        ("$.scenario.lingjing.settings.uavs", "uavs = 99 is outside of its range 1..5"),
        ("$.scenario.lingjing.origin", "is no latitude and longitude"),
        (f"{at}.droneEntityList[1].data", "lies at (1e+298, -20, 1) m, beyond the scene"),
    ]


@pytest.mark.parametrize(
    ("key", "value", "kind"), [("goalFirePosition", "here", "text 'here'"), ("firePoints", 3, "number 3")]
)
def test_hidden_places_that_are_a_text_or_a_number_are_an_error(key: str, value: object, kind: str) -> None:
    whole = document({key: value, "takeoff_height_m": "high"}, drones=1, cars=1, task_type="fire_rescue")
    with pytest.raises(MissionError) as caught:
        read(json.dumps(whole), "w.json", TEMPLATES)
    state = "$.scenario.taskMatrix[0].initial_state"
    assert {(fault.where, fault.message) for fault in caught.value.faults} == {
        (f"{state}.{key}", f"a place or a list of places is due, this is the {kind}"),
        (f"{state}.takeoff_height_m", "a number is due, this is the text 'high'"),
    }


@pytest.mark.parametrize(
    ("entry", "path", "message"),
    [
        ({"personCount": 2.5}, ".personCount", "is 2.5, a whole number is due"),
        ({"personCount": 0}, ".personCount", "is 0, at least 1 is due"),
        ({"weight": 3, "demand": 5}, "", "has 'weight' 3 and 'demand' 5, which are the same measure and differ"),
        ({"data": {"x": 1.0, "y": 2.0}}, "", "has 2 places that differ"),
        ({"position": {"lon": 121.5, "lat": 31.0}, "data": {"x": 1.0, "y": 2.0}}, "", "has 3 places that differ"),
        ({"heading": 1e9}, ".heading", "is 1e+09, at most 360 is due"),
    ],
)
def test_an_impossible_or_contradictory_entry_is_an_error(entry: Json, path: str, message: str) -> None:
    with pytest.raises(MissionError) as caught:
        play(document({"queuingList": [PLACE, {**PLACE, **entry}]}, drones=1, dogs=1))
    where = f"$.scenario.taskMatrix[0].initial_state.queuingList[1]{path}"
    assert [(fault.where, fault.message) for fault in caught.value.faults] == [(where, message)]
    assert caught.value.hint
    same = {"weight": 3, "demand": 3, "data": dict(PLACE)}
    assert play(document({"goalDelPosition": [{**PLACE, **same}], "warehousePosition": [STORE]}, cars=1))[0]


def test_paths_name_keys_as_the_document_spells_them() -> None:
    crossed = [{"x": x, "y": y} for x, y in ((0.0, 0.0), (9000.0, 9000.0), (9000.0, 0.0), (0.0, 9000.0))]
    whole = document({"search_range": crossed, "goalFirePosition": [PLACE]}, drones=1, cars=3)
    scenario = whole["scenario"]
    scenario["lingjing"] = {"mission": "ufr"}
    scenario["equipmentList"]["auto_vehicle_entity_list"] = scenario["equipmentList"].pop("autoVehicleEntityList")
    scenario["equipment_list"] = scenario.pop("equipmentList")
    scenario["task_matrix"] = scenario.pop("taskMatrix")
    scenario["task_matrix"][0]["initialState"] = scenario["task_matrix"][0].pop("initial_state")
    with pytest.raises(MissionError) as caught:
        read(json.dumps(whole), "w.json", TEMPLATES)
    assert [fault.where for fault in caught.value.faults] == [
        "$.scenario.equipment_list.auto_vehicle_entity_list",
        "$.scenario.task_matrix[0].initialState.search_range",
    ]


@pytest.mark.parametrize(
    ("word", "mission"),
    [
        ("sea_search", "ssr"), ("SeaSearch", "ssr"), ("ＳＥＡ　ＲＥＳＣＵＥ", "ssr"), ("海上搜索", "ssr"),
        ("rescue task", "ssr"), ("find fire", "ufr"), ("FIND-FIRE", "ufr"), ("找火任务", "ufr"),
        ("warehouse delivery", "cd"), ("仓库配送", "cd"),
        ("ＵＡＶ－ＤＯＧ", "upr"), ("Bridge_Inspection_Task", "bi"), ("traffic.jam", "cr"), ("express delivery", "ld"),
        ("queue detection", "queue"), ("dog_fire", "idf"), ("uav_search_fire", "fire_search"),
    ],
)  # fmt: skip
def test_task_types_are_recognised_in_different_spellings(word: str, mission: str) -> None:
    whole = document({}, drones=1, dogs=1, cars=1, ships=1, task_type=word)
    assert read(json.dumps(whole), "w.json", TEMPLATES)[0].name == mission


def test_two_task_types_may_differ_in_wording_but_not_in_the_template() -> None:
    whole = document({"goalFirePosition": [PLACE]}, drones=2, cars=1, task_type="fire")
    whole["scenario"]["taskType"] = "fire truck"
    assert play(whole)[0].mission == "ufr"
    whole["scenario"]["taskType"] = "bridge"
    with pytest.raises(MissionError, match=r"task_type: contradicts the other task type: taskType names bi"):
        play(whole)


@pytest.mark.parametrize("word", ["rain", "Rainy", "雨", "大雨", "heavy_rain", "ＲＡＩＮ"])
def test_rain_lowers_visibility_and_raises_cloud_cover_with_a_note(word: str) -> None:
    instance, notes = play(document({"fracturePosition": [PLACE], "weather": word}, drones=1))
    assert instance.weather.visibility_m <= 10_000.0 and instance.weather.cloud >= 0.7
    assert any(f"weather: '{word}' sets visibility and cloud alone; no rain falls" in n for n in notes)


def test_heights_that_cannot_be_over_the_scene_are_noted() -> None:
    whole = document({"goalFirePosition": [{**PLACE, "z": 134_500.0}]}, drones=1, cars=1)
    lists = whole["scenario"]["equipmentList"]
    lists["droneEntityList"][0]["data"]["z"] = 136_000.0
    lists["autoVehicleEntityList"][0]["data"]["z"] = 134_000.0
    instance, notes = play(whole)
    assert any("heights begin at 1340 m, which is used as ground level" in note for note in notes)
    heights = {entity.group: entity.position[2] for entity in instance.entities}
    assert (heights["truck"], heights["uav"], heights["fire"]) == (0.0, 20.0, 5.0)
    lists["autoVehicleEntityList"][0]["data"]["z"] = 0.0  # one height within the scene: no height is shifted
    _, notes = play(whole)
    far = [note for note in notes if "over the scene, which is used as it is" in note]
    assert [note.partition(": its")[0].rpartition(".")[0] for note in far] == [
        "$.scenario.equipmentList.droneEntityList[0]",
        "$.scenario.taskMatrix[0].initial_state",
    ]
    whole["scenario"]["lingjing"] = {"datum_m": 1340.0}
    with pytest.raises(MissionError, match=r"autoVehicleEntityList\[0\]"):
        play(whole)


@pytest.mark.parametrize(
    ("edit", "note"),
    [
        (
            lambda lists, state, scenario: lists["droneEntityList"][0]["data"].update(alt=400.0),
            "droneEntityList[0].data: alt says 400 m and Z 1 m: Z is used",
        ),
        (
            lambda lists, state, scenario: state["goalFirePosition"][0].update(heading=90.0, yaw=10.0),
            "goalFirePosition[0]: heading, yaw disagree; heading is used",
        ),
        (
            lambda lists, state, scenario: scenario.update(collaborationType="星型", lingjing={"mode": "broadcast"}),
            "collaborationType: says 'star', 'lingjing' broadcast: the latter is used",
        ),
    ],
)
def test_the_note_on_contradicting_values_names_the_value_that_is_used(
    edit: Callable[[Json, Json, Json], object], note: str
) -> None:
    whole = document({"goalFirePosition": [dict(PLACE)]}, drones=1, cars=1)
    scenario = whole["scenario"]
    edit(scenario["equipmentList"], scenario["taskMatrix"][0]["initial_state"], scenario)
    _, notes = play(whole)
    assert any(line.endswith(note) for line in notes), notes


@pytest.mark.parametrize(
    ("seed", "message"),
    [(-1, "is -1, at least 0 is due"), (10**400, "is a number out of range, at most 9223372036854775807 is due")],
)
def test_a_seed_has_bounds(seed: int, message: str) -> None:
    whole = document({"goalFirePosition": [PLACE]}, drones=1, cars=1)
    whole["scenario"]["lingjing"] = {"seed": seed}
    with pytest.raises(MissionError) as caught:
        play(whole)
    assert [(fault.where, fault.message) for fault in caught.value.faults] == [("$.scenario.lingjing.seed", message)]


def test_faults_beside_invalid_places_are_reported_as_well() -> None:
    whole = document({"goalFirePosition": "here", "leak": [1]}, drones=2, task_type=5)
    drones = whole["scenario"]["equipmentList"]["droneEntityList"]
    drones[0] = {"equipmentCode": {"a": 1}, "data": {"lon": 500.0, "lat": 2.0}}
    del drones[1]["data"]
    whole["scenario"]["lingjing"] = {"origin": [1.0]}
    with pytest.raises(MissionError) as caught:
        play(whole)
    listed, state = "$.scenario.equipmentList.droneEntityList", "$.scenario.taskMatrix[0].initial_state"
    assert [(fault.where, fault.message) for fault in caught.value.faults] == [
        ("$.scenario.lingjing.origin", "'[1]' is missing"),
        (f"{listed}[0].equipmentCode", "a text is due, this is an object"),
        (f"{listed}[0].data.lon", "is 500, at most 180 is due"),
        (f"{listed}[1]", "'data' is missing"),
        ("$.scenario.taskMatrix[0].task_type", "a text is due, this is the number 5"),
        (f"{state}.goalFirePosition", "a place or a list of places is due, this is the text 'here'"),
        (f"{state}.leak[0]", "an object is due, this is the number 1"),
    ]


def test_errors_and_notes_name_missing_and_unused_entities() -> None:
    people = {"rescuePersonPosition": [{"personId": "p", **PLACE}]}
    with pytest.raises(MissionError, match="'ssr' would, with shipEntityList"):
        play(document(people, drones=3))
    with pytest.raises(MissionError, match="shipEntityList: is missing or empty, mission 'ssr' needs a boat"):
        play(document(people, drones=3, task_type="sea search"))
    fire = {"goalFirePosition": [PLACE]}
    instance, notes = play(document(fire, drones=3, dogs=2, cars=1, task_type="dog fire"))
    assert instance.mission == "idf" and any("has no multirotor; 3 kept, not played" in note for note in notes)
    with pytest.raises(MissionError, match="fit none: 'idf' needs unmannedDogEntityList; 'ufr' needs droneE"):
        play(document(fire, ships=1, task_type="fire rescue"))
    whole = document(fire, drones=2, cars=3)
    whole["scenario"]["lingjing"] = {"mission": "ufr"}
    with pytest.raises(MissionError, match="autoVehicleEntityList: holds 3, mission 'ufr' has one truck") as caught:
        play(whole)
    assert '"lingjing": {"mission": "ufr_fleet"}' in (caught.value.hint or "")


FLEETS = [
    ("ufr", {"drones": 2, "cars": 3}, {"task_type": "fire truck"}, {"goalFirePosition": [PLACE]}, "one truck"),
    ("ssr", {"drones": 2, "ships": 2}, {}, {"rescuePersonPosition": [{"personId": "p", **PLACE}]}, "one boat"),
    ("bi", {"drones": 10}, {"task_type": "bridge"}, {"fracturePosition": [PLACE]}, "one uav"),
    ("cr", {"drones": 1, "cars": 2}, {"task_type": "multicars"}, {"congestionPoints": JAMS, "goalPosition": PLACE},
     "one van"),
    ("cr", {"drones": 3, "cars": 1}, {}, {"congestionPoints": JAMS, "destination": PLACE}, "one uav"),
    ("cr", {"drones": 1, "cars": 1}, {"task_type": "traffic"},
     {"congestionPoints": JAMS, "destination": [{**PLACE, "id": 1}, {**PLACE, "x": 0.0, "id": 2}]}, "one goal_place"),
    ("bi", {"drones": 1}, {"task_type": "bridge"},
     {"fracturePosition": [{**PLACE, "id": 1}, {**PLACE, "x": 0.0, "id": 2}]}, "one fracture"),
    ("vdn", {"dogs": 5}, {"task_type": "singledog"}, {"targetHouse": PLACE}, "one dog"),
    ("vdn", {"dogs": 1}, {}, {"targetHouse": [{**PLACE, "id": 1}, {**PLACE, "x": 0.0, "id": 2}]}, "one home"),
    ("upr", {"drones": 2, "dogs": 2}, {"task_type": "uavdog"}, {"pipelineLeakPosition": PLACE}, "one uav"),
    ("ld", {"drones": 2, "cars": 2, "dogs": 2}, {"task_type": "delivery"}, {"target_house": PLACE}, "one uav"),
    ("queue", {"drones": 1, "dogs": 2}, {}, {"queuingList": [{**PLACE, "personCount": 4}]}, "one dog"),
]  # fmt: skip


@pytest.mark.parametrize(("mission", "fleet", "task", "state", "single"), FLEETS)
def test_several_entities_where_a_template_has_one_select_its_fleet_template(
    mission: str, fleet: Json, task: Json, state: Json, single: str
) -> None:
    instance, notes = play(document(state, **fleet, **task))
    assert instance.mission == f"{mission}_fleet"
    assert sum(entity.role == "asset" for entity in instance.entities) == sum(fleet.values())
    (fleet_note,) = [note for note in notes if "is played, which takes several" in note]
    assert fleet_note.endswith(f"'{mission}' has {single}: '{mission}_fleet' is played, which takes several")
    assert not [note for note in notes if "not understood" in note or "kept, not played" in note], notes


def test_cars_alone_drive_around_congestion() -> None:
    state = {"congestionPoints": JAMS, "destinationPosition": [{**PLACE, "id": "a"}, {**PLACE, "x": 0.0, "id": "b"}]}
    for task in ({}, {"task_type": "multi-cars"}, {"task_type": "congestion"}):
        for cars in (1, 2):
            instance, _ = play(document(state, cars=cars, **task))
            assert instance.mission == "cr_fleet"
            assert [len(at(instance, group)) for group in ("van", "uav", "goal_place", "jam")] == [cars, 0, 2, 1]


@pytest.mark.parametrize("count", [1, 5])
def test_trucks_alone_ships_alone_and_uavs_with_dogs_have_templates(count: int) -> None:
    fire, person = {"goalFirePosition": [PLACE]}, {"rescuePersonPosition": [{"personId": "p", **PLACE}]}
    for state, listed, mission in (
        (fire, {"cars": count}, "ufr_fleet"),
        (person, {"ships": count}, "ssr_fleet"),
        (fire, {"drones": count, "dogs": 2}, "idf_air"),
    ):
        instance, notes = play(document(state, **listed))
        assert instance.mission == mission and not [note for note in notes if "kept, not played" in note]
        assert sum(entity.role == "asset" for entity in instance.entities) == sum(listed.values())


def test_validate_reports_unplayable_places_with_paths_and_moved_bodies_with_distances(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    whole = document({"goalFirePosition": [PLACE]}, drones=2, cars=1)
    file = tmp_path / "w.json"
    file.write_text(json.dumps(whole))
    assert run_command(["validate", str(file)]) == ExitCode.OK
    output = capsys.readouterr().out
    at = "note: $.scenario.equipmentList.autoVehicleEntityList[0].data: `truck` is put "
    assert re.search(re.escape(at) + r"\d+ m away, on the nearest road that suits\n", output)
    assert re.search(r"goalFirePosition\[0\]: `fire\[1\]` is put .*\d+ m higher, on the nearest roof", output)
    assert "`uav" not in output
    whole["scenario"]["equipmentList"]["droneEntityList"][1]["data"]["x"] = 1_900_000.0
    file.write_text(json.dumps(whole))
    assert run_command(["validate", str(file)]) == ExitCode.MISSION  # 19 km: no scene is as wide
    output = capsys.readouterr().out
    assert "$.scenario.equipmentList.droneEntityList[1].data: `uav[2]` begins at (19,000 m" in output


def test_fields_beside_a_scenario_are_written_back_beside_it() -> None:
    """The document comes back with its template, even with a field `data` or `Scenario` beside the scenario."""
    whole = document({"goalFirePosition": [PLACE]}, drones=1)
    play({**whole, "data": 3})
    play({"Data": {"scenario": 1}, "scenario": None, "Scenario": whole["scenario"]})
    with pytest.raises(MissionError, match=r"\$\.Data\.Scenario\.equipmentList"):
        play({"Data": {"Scenario": {**whole["scenario"], "equipmentList": []}}})
    own = {**whole["scenario"], "Lingjing": {"mission": "fire_search"}}
    assert emit(read(json.dumps(own), "w.json", TEMPLATES)[0]) == json.dumps(own)


def test_a_field_that_no_template_uses_is_an_error() -> None:
    with pytest.raises(MissionError, match="no template has a target for 'pollutionPosition'"):
        play(document({"pollutionPosition": [PLACE]}, drones=1))
    with pytest.raises(MissionError, match="no template has a target for 'pollution_source'"):
        play(document({"pollution_source": PLACE, "goalFirePosition": [PLACE]}, drones=1))
    assert play(document({"pollutionPosition": [], "goalFirePosition": [PLACE]}, drones=1))[0].mission == "fire_search"


@pytest.mark.parametrize(
    ("mission", "word", "state", "lists"),
    [
        ("vdn_fleet", "multi dogs", {"target_house": {"position": PLACE}}, {"dogs": 2}),
        ("idf", "multi dogs", {"goalFirePosition": [PLACE]}, {"dogs": 2}),
        ("upr_fleet", "多机器狗", {"leakPosition": [PLACE]}, {"dogs": 2, "drones": 1}),
        ("fire_search", "multi UAVs", {"goalFirePosition": [PLACE]}, {"drones": 3}),
        ("air_delivery", "multi UAVs", {"goalDelPosition": [PLACE]}, {"drones": 3}),
        ("air_delivery", "UAV", {"goalDelPosition": [PLACE]}, {"drones": 1}),
    ],
)
def test_hidden_places_decide_the_template_if_the_task_type_names_only_entities(
    mission: str, word: str, state: Json, lists: Json
) -> None:
    instance, notes = play(document(state, task_type=word, **lists))
    assert instance.mission == mission and "kept, not played" not in "".join(notes)


def test_a_length_in_another_unit_is_a_fault_and_places_within_a_few_metres_are_noted() -> None:
    for unit in ({"unit": "m"}, {"单位": "米"}):
        with pytest.raises(MissionError, match=r"says '.+', and X, Y and Z are read in centimetres"):
            play(document({"goalFirePosition": [PLACE], **unit}, drones=1))
        with pytest.raises(MissionError, match=r"goalFirePosition\[0\]\.\w+: says"):
            play(document({"goalFirePosition": [{**PLACE, **unit}]}, drones=1))
    play(document({"goalFirePosition": [{**PLACE, "unit": "cm"}], "unit": "Brigade 3"}, drones=1))
    near = document({"goalFirePosition": [{"x": 90, "y": -120, "z": 0}]}, drones=1)
    near["scenario"]["equipmentList"]["droneEntityList"][0]["data"] = {"x": 109.94, "y": 39.83, "z": 2}
    with pytest.raises(MissionError, match="X and Y may be centimetres or metres") as raised:
        play(near)
    assert raised.value.hint is not None and '"lingjing": {"unit": "cm"}' in raised.value.hint
    near["scenario"]["lingjing"] = {"unit": "cm"}
    assert any("all X and Y lie within 1.2 m of the origin" in note for note in play(near)[1])


@pytest.mark.parametrize(
    ("twice", "keys"), [({"X": 100, "x": 900}, "'X' and 'x'"), ({"lon": 1, "lat": 2, "long": 3}, "'lon' and 'long'")]
)
def test_two_spellings_of_a_hidden_place_that_differ_are_a_fault(twice: Json, keys: str) -> None:
    place = {"Y": 5, **twice}
    with pytest.raises(MissionError, match=f"{keys} are spellings of one field and differ") as raised:
        play(document({"goalFirePosition": [place, {"position": place}]}, drones=1))
    where = [fault.where.partition("goalFirePosition")[2] for fault in raised.value.faults]
    assert where == ["[0]", "[1].position"]


def test_two_spellings_of_a_hidden_place_may_agree() -> None:
    play(document({"goalFirePosition": [{"X": 100, "x": 100, "Y": 5}]}, drones=1))


def test_one_fault_does_not_hide_others() -> None:
    """A value of several possible types has a fault for each of them, and is mended once."""
    bad = document({"goalFirePosition": [{"x": 1}, {"lon": 3, "lat": 121.5}], "weather": 7}, drones=1, task_type=3)
    bad["scenario"]["equipmentList"]["droneEntityList"][0]["equipmentCode"] = {"a": 1}
    with pytest.raises(MissionError) as raised:
        play(bad)
    assert [fault.where.rpartition(".")[2] for fault in raised.value.faults] == [
        "equipmentCode",
        "task_type",
        "weather",
        "goalFirePosition[0]",
        "lat",
    ]
    assert raised.value.faults[-1].hint == "are lon and lat swapped?"
    with pytest.raises(MissionError) as packed:
        play({"type": "COMMAND", "data": json.dumps(document({}))})
    assert packed.value.hint is not None and "packed into a text" in packed.value.hint


@pytest.mark.parametrize("seed", [1, 2])
def test_mutated_documents_give_a_mission_or_an_error_message(seed: int) -> None:
    """A hundred thousand are read by `benchmarks/mutated_documents.py`."""
    ends = read_mutated(250, seed, lambda number, ends: None)
    assert set(ends) <= {"read", "MissionError", "UsageError"} and 25 < ends["read"] < 225


@pytest.mark.parametrize(
    ("original", "other", "guess"),
    [
        ('"x": 5000.0', '"x": 5000.5', "says (50.005, 30.0), fire[1] lies at (50.0, 30.0, 0.0)"),
        ('"y": -3000.0', '"y": 3000.0', "says (50.0, -30.0), fire[1] lies at (50.0, 30.0, 0.0)"),
        ('"z": 100.0', '"z": 200.0', "heights are lowered by [0.0, 1.0] m"),
        ('"yaw": 0.0', '"yaw": 5.0', "turns to 95.0, uav[1] to 90.0"),
        ('"droneEntityList": [', '"droneEntityList": [1, ', "droneEntityList lists 2, 1 are played"),
    ],
)
def test_the_search_for_silent_guesses_finds_planted_guesses(original: str, other: str, guess: str) -> None:
    text = json.dumps(document({"goalFirePosition": [PLACE]}, drones=1))
    mission, notes = read(text, "w.json", TEMPLATES)
    assert not list(silent_guesses(text, mission, notes, TEMPLATES))
    assert text.count(original) == 1
    assert guess in "; ".join(silent_guesses(text.replace(original, other), mission, notes, TEMPLATES))
