"""Whole `resetScenario` documents in the styles of other systems (`wild/`): read and written back.

`pytest tests/mission --update` rewrites the golden notes. They name each value that is inferred, ignored or converted.
"""

from __future__ import annotations

import json
from pathlib import Path

import pytest

import lingjing
from lingjing import read as read_trace
from lingjing.errors import MissionError
from lingjing.mission import jsontext
from lingjing.mission.instance import Instance
from lingjing.mission.reset.emit import emit
from lingjing.testing import instantiate
from lingjing.testing.documents import read, templates_beside

WILD = Path(__file__).parent / "wild"
TEMPLATES = templates_beside(Path("nowhere"))
MISSIONS = {
    "bridge": "bi",
    "bridge_compact": "bi",
    "delivery_degrees": "cd",
    "delivery_uavs": "air_delivery",
    "fire_rescue": "ufr",
    "fire_rescue_dogs": "idf",
    "fire_rescue_uav": "fire_search",
    "multicars": "cr",
    "multicars_delivery": "cd",
    "sea_rescue": "ssr",
    "singledog": "vdn",
    "singledog_comments": "vdn",
    "uavdog": "upr",
    "uavdog_queue": "queue",
}


def text_of(name: str) -> str:
    return (WILD / f"{name}.json").read_text(encoding="utf-8")


def instance_of(name: str) -> tuple[Instance, tuple[str, ...]]:
    mission, notes = read(text_of(name), f"{name}.json", TEMPLATES)
    return instantiate(mission, seed=1), notes


def scenario_of(text: str) -> dict[str, object]:
    value = jsontext.load(text, "w.json", [])
    assert isinstance(value, dict)
    whole = value.get("data", value)
    scenario = whole["scenario"]
    assert isinstance(scenario, dict)
    return scenario


def test_every_document_is_listed() -> None:
    assert {path.stem for path in WILD.glob("*.json")} == MISSIONS.keys()


@pytest.mark.parametrize("name", MISSIONS)
def test_a_document_round_trips_with_the_same_values(name: str) -> None:
    mission, _ = read(text_of(name), f"{name}.json", TEMPLATES)
    assert mission.name == MISSIONS[name]
    assert emit(mission, plain=True) == text_of(name)
    written = emit(mission)
    added = scenario_of(written)
    assert added.pop("lingjing") == {"mission": mission.name}
    assert added == scenario_of(text_of(name))
    again, notes = read(written, f"{name}.json", TEMPLATES)
    assert notes[0] == f"template '{mission.name}': named by 'lingjing'"
    for seed in (1, 2):
        assert instantiate(again, seed=seed) == instantiate(mission, seed=seed)


@pytest.mark.parametrize("name", MISSIONS)
def test_notes_state_exactly_the_inferred_values(name: str, request: pytest.FixtureRequest) -> None:
    golden = Path(__file__).parent / "golden" / "wild" / f"{name}.txt"
    notes = "\n".join(instance_of(name)[1]) + "\n"
    if request.config.getoption("--update"):
        golden.write_text(notes, encoding="utf-8")
    assert notes == golden.read_text(encoding="utf-8")


def test_weights_spacings_and_headings_reach_the_instance() -> None:
    instance, _ = instance_of("delivery_uavs")
    wanted = {e.label: e.properties["demand_kg"] for e in instance.entities if e.group == "point"}
    assert wanted == {"d1": 0.4, "d2": 0.4, "d3": 0.8, "d4": 0.3, "d5": 0.5}
    instance, _ = instance_of("uavdog_queue")
    shops = [e for e in instance.entities if e.group == "shop"]
    assert [(e.label, e.properties["people"], e.properties["spacing_m"], e.heading_deg) for e in shops] == [
        ("q1", 4.0, 0.6, 90.0), ("q2", 11.0, 0.8, 0.0), ("q3", 7.0, 0.7, 180.0),
    ]  # fmt: skip
    assert shops[0].hidden == ("people",)


@pytest.mark.parametrize(
    ("name", "key", "value", "note"),
    [
        ("uavdog_queue", "spacing", 1.5, "1.5 is no spacing in centimetres; 'spacing' is kept, not played"),
        ("uavdog_queue", "spacing", "wide", "'wide' is no spacing in centimetres; 'spacing' is kept, not played"),
        ("uavdog_queue", "scale", 2, "'shop' has no scale; 'scale' is kept, not played"),
    ],
)
def test_an_invalid_measure_is_kept_and_noted(name: str, key: str, value: object, note: str) -> None:
    whole = json.loads(text_of(name))
    for row in whole["scenario"]["taskMatrix"][0]["initial_state"]["queuingList"]:
        row[key] = value
    mission, notes = read(json.dumps(whole), "w.json", TEMPLATES)
    assert any(line.endswith(note) for line in notes), notes
    spacing = {e.properties["spacing_m"] for e in instantiate(mission).entities if e.group == "shop"}
    assert spacing == ({0.8} if key == "spacing" else {0.6, 0.7, 0.8})


def test_a_template_of_the_user_can_use_the_range_and_the_scale_of_a_fire(tmp_path: Path) -> None:
    text = (Path(__file__).parents[2] / "scenarios" / "reset" / "fire_search.ljs").read_text(encoding="utf-8")
    typed = "target wildfire : building_fire { range = 5 m, scale = 1 }\n\nmission "
    text = text.replace("mission ", typed, 1).replace(" : building_fire {\n", " : wildfire {\n")
    (tmp_path / "fire_search.ljs").write_text(text.replace("== building_fire", "== wildfire"), encoding="utf-8")
    whole = json.loads(text_of("fire_rescue_uav"))
    whole["scenario"]["lingjing"] = {"mission": "fire_search"}
    (fire,) = whole["scenario"]["taskMatrix"][0]["initial_state"]["goalFirePosition"]
    fire |= {"range": 700, "scale": 3}
    mission, notes = read(json.dumps(whole), "w.json", templates_beside(tmp_path))
    (fire,) = (e for e in instantiate(mission).entities if e.group == "fire")
    assert (fire.properties["range_m"], fire.properties["scale"]) == (7.0, 3.0)
    assert any("'range' is the range in centimetres" in note for note in notes)


@pytest.mark.parametrize(
    ("name", "path", "message"),
    [
        ("singledog", "equipmentList.unmannedDogEntityList", "holds 3, mission 'vdn' has one dog"),
        ("uavdog", "equipmentList.droneEntityList", "holds 3, mission 'upr' has one uav"),
    ],
)
def test_several_entities_are_an_error_if_the_named_template_has_one(name: str, path: str, message: str) -> None:
    whole = json.loads(text_of(name))
    holder = whole["scenario"]
    holder["lingjing"] = {"mission": MISSIONS[name]}
    *way, last = path.replace("[0]", ".0").split(".")
    for key in way:
        holder = holder[int(key) if key == "0" else key]
    (entry,) = holder[last]
    holder[last] = [{**entry, "equipmentCode": f"E{k}", "targetId": f"T{k}"} for k in range(3)]
    with pytest.raises(MissionError) as caught:
        read(json.dumps(whole), "w.json", TEMPLATES)
    assert [(fault.where, fault.message) for fault in caught.value.faults] == [(f"$.scenario.{path}", message)]


@pytest.mark.parametrize(
    ("word", "lists", "field", "mission"),
    [
        ("fire_rescue", {"drone": 1}, "goalFirePosition", "fire_search"),
        ("fire_rescue", {"drone": 1, "autoVehicle": 1}, "goalFirePosition", "ufr"),
        ("fire_rescue", {"drone": 1, "unmannedDog": 2}, "goalFirePosition", "idf_air"),
        ("", {"drone": 3}, "goalFirePosition", "fire_search"),
        ("", {"drone": 3}, "goalDelPosition", "air_delivery"),
        ("", {"drone": 3}, "warehousePosition", "air_delivery"),
        ("deliverytask", {"drone": 2}, "goalPosition", "air_delivery"),
        ("UAV", {"drone": 1}, "fracturePosition", "bi"),
        ("singledog", {"unmannedDog": 1}, "goalFirePosition", "idf"),
        ("singledog", {"unmannedDog": 2}, "goalFirePosition", "idf"),
        ("uavdog", {"drone": 1, "unmannedDog": 1}, "queuingList", "queue"),
        ("uavdog", {"drone": 1, "unmannedDog": 1}, "leak", "upr"),
    ],
)
def test_entities_and_hidden_places_decide_the_template_of_an_ambiguous_task_type(
    word: str, lists: dict[str, int], field: str, mission: str
) -> None:
    def fleet(count: int) -> list[dict[str, object]]:
        return [{"equipmentCode": f"E{k}", "data": {"X": 500.0 * k, "Y": 0.0, "Z": 0.0}} for k in range(count)]

    equipment = {f"{name}EntityList": fleet(count) for name, count in lists.items()}
    task = {"task_type": word, "initial_state": {field: [{"id": "a", "X": 3000.0, "Y": 2000.0, "Z": 0.0}]}}
    whole = {"scenario": {"equipmentList": equipment, "taskMatrix": [task]}}
    assert read(json.dumps(whole), "w.json", TEMPLATES)[0].name == mission


def test_the_oracle_wins_a_document(tmp_path: Path) -> None:
    """The other kinds and fleets are played in `tests/episodes`."""
    document = WILD / "delivery_uavs.json"
    report = lingjing.run(document, policy="oracle", world="inline", overview=False, out=tmp_path / "run")
    assert (report.mission, report.success) == (MISSIONS["delivery_uavs"], True)
    assert {binding.privileged for binding in read_trace(report.trace).header.bindings} == {True}


def test_the_yaw_of_a_hidden_place_is_converted_and_an_empty_data_object_is_ignored() -> None:
    plain, _ = instance_of("uavdog_queue")
    whole = json.loads(text_of("uavdog_queue"))
    for row in whole["scenario"]["taskMatrix"][0]["initial_state"]["queuingList"]:
        row |= {"yaw": row.pop("heading") - 90.0, "data": {}}
    mission, _ = read(json.dumps(whole), "w.json", TEMPLATES)
    assert instantiate(mission, seed=1).entities == plain.entities
