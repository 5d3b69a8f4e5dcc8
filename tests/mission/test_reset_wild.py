"""resetScenario documents as other systems write them: each loads, says what it inferred, and comes back the same."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from benchmarks.mutated_documents import read_mutated
from lingjing.dsl.loading.load import templates_beside
from lingjing.errors import MissionError
from lingjing.mission.document import read
from lingjing.mission.instance import Instance
from lingjing.mission.instantiate import instantiate
from lingjing.mission.reset.emit import emit

TEMPLATES = templates_beside(Path("nowhere"))
Json = dict[str, Any]

DRONE = {"equipmentCode": "UAV-001", "name": "无人机1", "data": {"x": 1000.0, "y": 2000.0, "z": 100.0, "yaw": 0.0}}
DOG = {"equipmentCode": "DOG-001", "name": "机器狗", "data": {"x": 0.0, "y": 0.0, "z": 0.0, "yaw": -90.0}}
CAR = {"equipmentCode": "CAR-001", "name": "车", "data": {"x": 0.0, "y": 0.0, "z": 0.0}, "heading": 10}


def document(state: Json, *, drones: int = 0, dogs: int = 0, cars: int = 0, ships: int = 0, **task: Any) -> Json:
    """A document with so many entities 20 m apart, and this initial state."""

    def fleet(one: Json, count: int) -> list[Json]:
        return [
            {**one, "equipmentCode": f"{one['equipmentCode'][:-1]}{k}", "data": {**one["data"], "y": 2000.0 * k}}
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
    """The instance of a document and what was noted; it comes back with the same values."""
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
def test_tasks_are_told_by_their_words_entities_and_fields(mission: str, fleet: Json, task: Json, state: Json) -> None:
    instance, notes = play(document(state, **fleet, **task))
    assert instance.mission == mission
    assert any("read as X, Y, Z, Unreal's centimetres" in note for note in notes)
    assert not [note for note in notes if "not understood" in note], notes


def test_every_value_arrives() -> None:
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


def test_yaw_stands_in_the_place_and_is_unreals() -> None:
    instance, _ = play(document({"goalPosition": PLACE}, dogs=1, task_type="single dog"))
    assert next(e for e in instance.entities if e.group == "dog").heading_deg == 0.0  # yaw -90


@pytest.mark.parametrize(
    ("edit", "note"),
    [
        (lambda w: {"type": "COMMAND", "data": w}, "the wire's envelope is taken off"),
        (lambda w: {"type": "COMMAND", "data": w["scenario"]}, "the wire's envelope is taken off"),
        (lambda w: _rows(w, w["scenario"]["taskMatrix"][0]), "taskMatrix: is one object"),
        (lambda w: json.dumps(w).replace('"taskId"', '// 说明\n"taskId" /* id */', 1), "comments are no JSON"),
        (lambda w: json.dumps(w, separators=(",", ":")), ""),
        (lambda w: json.dumps(w).replace("droneEntityList", "drone_entity_list"), ""),
        (lambda w: json.dumps(w).replace("equipmentCode", "equipment_code").replace("taskMatrix", "task_matrix"), ""),
    ],
)
def test_wrappings(edit: Callable[[Json], Json | str], note: str) -> None:
    whole = document({"goalFirePosition": [{"range": 5, "scale": 2, **PLACE}]}, drones=1, cars=1)
    plain, before = play(whole)
    instance, notes = play(edit(json.loads(json.dumps(whole))))
    assert instance.entities == plain.entities
    assert note in "\n".join(notes) and len(notes) == len(before) + bool(note), notes


def _rows(whole: Json, rows: Json) -> Json:
    whole["scenario"]["taskMatrix"] = rows
    return whole


def test_a_search_range_and_a_height_to_fly_at() -> None:
    corners = [{"x": x, "y": y} for x, y in ((-9000, -9000), (9000, -9000), (9000, 9000), (-9000, 9000))]
    state = {"goalFirePosition": [PLACE], "search_range": corners, "takeoff_height_m": 90}
    instance, notes = play(document(state, drones=2, cars=1))
    assert set(instance.regions[0].polygon) == {(-90.0, -90.0), (90.0, -90.0), (90.0, 90.0), (-90.0, 90.0)}
    assert instance.settings["altitude"] == 90.0
    assert any("takeoff_height_m: is the parameter 'altitude'" in note for note in notes)
    _, notes = play(document({**state, "takeoff_height_m": 900}, drones=2, cars=1))
    assert any("flies no aircraft at 900 m; kept" in note for note in notes)


ORDOS = (39.83, 109.9455)


def _in_degrees(east: float, north: float) -> Json:
    return {"lon": ORDOS[1] + east / 85_500.0, "lat": ORDOS[0] + north / 111_030.0, "alt": 1342.0}


def test_the_origin_is_where_the_degrees_lie_and_the_ground_is_the_lowest_height() -> None:
    whole = document({"goalFirePosition": [_in_degrees(0.0, 100.0)]}, drones=1, cars=1)
    lists = whole["scenario"]["equipmentList"]
    lists["droneEntityList"][0]["data"] = {**_in_degrees(-50.0, -50.0), "alt": 1352.0}
    lists["autoVehicleEntityList"][0]["data"] = _in_degrees(50.0, -50.0)
    instance, notes = play(whole)
    assert instance.scene.origin == pytest.approx(ORDOS, abs=1e-3)
    assert at(instance, "truck") == [pytest.approx((50.0, -50.0), abs=1.0)]
    heights = {e.group: e.position[2] for e in instance.entities}
    assert heights["uav"] - heights["truck"] == pytest.approx(10.0)
    assert any("origin is taken to be at 39.83, 109.9" in note for note in notes), notes
    whole["scenario"]["lingjing"] = {"origin": [*ORDOS], "datum_m": 1340.0}
    instance, notes = play(whole)
    assert instance.scene.origin == ORDOS and not [note for note in notes if "is taken" in note]
    assert {e.group: e.position[2] for e in instance.entities}["truck"] == pytest.approx(2.0)


def test_deep_heights_of_older_documents() -> None:
    whole = document({"goalFirePosition": [{**PLACE, "z": -243_000.0}]}, drones=1, cars=1)
    lists = whole["scenario"]["equipmentList"]
    lists["droneEntityList"][0]["data"]["z"] = lists["autoVehicleEntityList"][0]["data"]["z"] = -242_900.0
    instance, notes = play(whole)
    assert [e.position[2] for e in instance.entities if e.group in ("uav", "truck")] == [1.0, 1.0]
    assert any("heights begin at -2430 m, which is taken for the ground" in note for note in notes)


def test_both_spellings_of_a_place_tie_the_origin() -> None:
    whole = document({"goalFirePosition": [_in_degrees(0.0, 100.0)]}, drones=1, cars=1)
    whole["scenario"]["equipmentList"]["droneEntityList"][0]["data"] |= _in_degrees(10.0, 0.0) | {"alt": 0.0}
    instance, _ = play(whole)  # which is at (10, 0) m by its centimetres, and by its degrees then
    assert at(instance, "fire") == [pytest.approx((0.0, 100.0), abs=1.0)]


@pytest.mark.parametrize(("drones", "dogs"), [(10, 0), (0, 5)])
def test_fleets_of_any_size(drones: int, dogs: int) -> None:
    fire = {"goalFirePosition": [PLACE]}
    instance, notes = play(document(fire, drones=drones, dogs=dogs, cars=1 if drones else 0))
    assert sum(e.role == "asset" for e in instance.entities) == drones + dogs + bool(drones)
    assert any("more than the" in note for note in notes)
    assert len({agent.id for agent in instance.agents}) >= max(drones, dogs)


def test_every_fault_is_told_in_one_run_with_its_path() -> None:
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
    assert {(one.where, one.message) for one in caught.value.faults} == {
        (f"{at}.droneEntityList[0].data.x", "a number is due, this is the text '1000'"),
        (f"{at}.droneEntityList[1]", "'data' is missing"),
        (f"{at}.droneEntityList[2].heading", "a number is due, this is an object"),
        (f"{at}.autoVehicleEntityList[0].data.lon", "is 500, at most 180 is due"),
        ("$.scenario.commandType", "'moveTo' is not known, 'resetScenario' is"),
        ("$.scenario.taskMatrix[0].initial_state.goalFirePosition[0].x", "a number is due, this is the text '1'"),
        ("$.scenario.taskMatrix[0].initial_state.goalFirePosition[1]", "has no place"),
    }
    assert all(one.hint for one in caught.value.faults)


def test_what_no_template_binds_is_an_error() -> None:
    with pytest.raises(MissionError, match="no template has anything for 'pollutionPosition'"):
        play(document({"pollutionPosition": [PLACE]}, drones=1))
    with pytest.raises(MissionError, match="no template has anything for 'pollution_source'"):
        play(document({"pollution_source": PLACE, "goalFirePosition": [PLACE]}, drones=1))
    assert play(document({"pollutionPosition": [], "goalFirePosition": [PLACE]}, drones=1))[0].mission == "fire_search"


@pytest.mark.parametrize("seed", [1, 2])
def test_mutated_documents_end_in_a_mission_or_a_message(seed: int) -> None:
    """A hundred thousand are read by `benchmarks/mutated_documents.py`."""
    ends = read_mutated(250, seed, lambda number, ends: None)
    assert set(ends) <= {"read", "MissionError", "UsageError"} and 25 < ends["read"] < 225
