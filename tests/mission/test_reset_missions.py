"""resetScenario documents of all missions: recognition, hidden places, twins, and what is kept and noted."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import jsonschema
import msgspec
import pytest

from lingjing.errors import MissionError
from lingjing.mission import document, frames
from lingjing.mission.instance import Instance, StateSpec
from lingjing.mission.reset.elements import elements_fault
from lingjing.mission.reset.emit import emit
from lingjing.mission.reset.fields import FIELDS, field_of
from lingjing.mission.reset.reading import instantiate_document
from lingjing.mission.reset.shapes import LISTS
from lingjing.mission.reset.template import fleet_of, signatures
from lingjing.testing import at_tier, instantiate
from lingjing.testing import declarations as m
from lingjing.testing import expressions as ex
from lingjing.testing.documents import templates_beside

ROOT = Path(__file__).resolve().parents[2]
NAMES = ("air_delivery", "bi", "cd", "cr", "fire_search", "idf", "ld", "queue", "ssr", "ufr", "upr", "vdn")
FLEETS = tuple(name for name in NAMES if fleet_of(name))
TEMPLATES = templates_beside(ROOT / "nowhere")
TWINS = sorted((ROOT / "scenarios" / "reset").glob("*.json"))
Nine = dict[str, m.Mission]
Scenario = dict[str, Any]
Edit = Callable[[Scenario], object]


@pytest.fixture(scope="module")
def nine() -> Nine:
    return {name: TEMPLATES(name) for name in (*NAMES, "idf_air", *map(fleet_of, FLEETS))}


def read(nine: Nine, text: str) -> tuple[m.Mission, tuple[str, ...]]:
    return instantiate_document(text, "s.json", nine.__getitem__)


def foreign(nine: Nine, name: str, edit: Edit = lambda scenario: None) -> str:
    """A document of a mission as other systems write it: without the object `lingjing`, and with a change made."""
    whole = json.loads(emit(nine[name], seed=1))
    del whole["scenario"]["lingjing"]
    whole["scenario"]["collaborationType"] = "多智能体协同"
    edit(whole["scenario"])
    return json.dumps(whole, ensure_ascii=False)


def state(scenario: Scenario) -> Scenario:
    initial: Scenario = scenario["taskMatrix"][0]["initial_state"]
    return initial


def targets(instance: Instance, group: str) -> list[tuple[float, ...]]:
    return [entity.position for entity in instance.entities if entity.group == group]


def places(instance: Instance) -> dict[str, tuple[float, float, float]]:
    return {entity.id: entity.position for entity in instance.entities}


# -- writing and reading again --------------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", [0, 1, 7])
@pytest.mark.parametrize("name", NAMES)
def test_every_emitted_mission_is_read_as_the_same_instance(nine: Nine, name: str, seed: int) -> None:
    for mode in nine[name].modes.allowed:
        text = emit(nine[name], seed=seed, mode=mode)
        again, notes = read(nine, text)
        assert instantiate(again, seed=seed) == instantiate(nine[name], seed=seed, mode=mode)
        assert emit(again) == text
        assert notes[0] == f"template '{name}': named by 'lingjing'"
        assert not [note for note in notes if "not understood" in note or "not played" in note]


@pytest.mark.parametrize(
    ("name", "settings"),
    [
        ("cr", {"jams": 0}),
        ("ld", {"jams": 2, "moves_most": 75}),
        ("ufr", {"fires": 6, "uavs": 2}),
        ("cd", {"points": 5, "vans": 2}),
        ("idf", {"dogs": 1, "fires": 5}),
        ("upr", {"guidance_steps": 10, "high": 100}),
    ],
)
def test_emitted_settings_are_read_as_the_same_instance(nine: Nine, name: str, settings: dict[str, float]) -> None:
    again, _ = read(nine, emit(nine[name], seed=3, settings=settings))
    assert instantiate(again, seed=3) == instantiate(nine[name], seed=3, settings=settings)


@pytest.mark.parametrize("file", TWINS, ids=lambda file: file.stem)
def test_twin_documents_are_valid_and_round_trip_without_a_loss(nine: Nine, file: Path) -> None:
    text = file.read_text(encoding="utf-8")
    jsonschema.validate(json.loads(text), msgspec.json.decode(document.schemas()["reset-scenario.schema.json"]))
    mission, notes = instantiate_document(text, file.name, nine.__getitem__)
    out = emit(mission)
    assert emit(read(nine, out)[0]) == out
    assert document.decode(document.encode(mission), "m.json") == mission
    assert not [note for note in notes if "kept" in note]
    name = file.stem.partition("-")[0]
    assert mission.name == name
    if name != "ssr":
        assert out == text == emit(nine[name], seed=1), "the twin is what is written for seed 1"
        assert instantiate(mission, seed=1) == instantiate(nine[name], seed=1)


def test_each_mission_has_a_twin_document() -> None:
    assert [file.stem for file in TWINS] == [f"{name}-001" for name in NAMES]


def test_unknown_fields_are_noted_and_written_back_unchanged(nine: Nine) -> None:
    def add(scenario: Scenario) -> None:
        scenario["lingjing"] = {"mission": "cd"}
        scenario["附注"] = {"x": [1, None, 2.50]}
        state(scenario)["tide"] = "ebb"
        scenario["equipmentList"]["autoVehicleEntityList"][0]["battery"] = 0.5

    text = foreign(nine, "cd", add)
    mission, notes = read(nine, text)
    assert emit(mission) == text
    assert "$.scenario: '附注' not understood and kept" in notes
    assert "$.scenario.taskMatrix[0].initial_state: 'tide' not understood and kept" in notes
    assert "$.scenario.equipmentList.autoVehicleEntityList[]: 'battery' not understood and kept" in notes


# -- the choice of a template ---------------------------------------------------------------------------------------


def test_signatures_match_the_compiled_missions(nine: Nine) -> None:
    driven = {entity_list.engine for entity_list in LISTS}
    for signature in signatures():
        groups = at_tier(nine[signature.mission]).groups
        engines = {g.engine for g in groups if g.role == "asset"} & driven
        assert (signature.engines | signature.optional, signature.engines & signature.optional) == (engines, set())
        assert signature.types == {(g.type, *g.bases)[-1] for g in groups if g.role == "target"}
    assert {signature.mission for signature in signatures()} == {
        *NAMES,
        "cr_fleet",
        "idf_air",
        "ssr_fleet",
        "ufr_fleet",
    }


@pytest.mark.parametrize("name", FLEETS)
def test_a_fleet_template_has_the_groups_of_its_mission_with_counts(nine: Nine, name: str) -> None:
    mission, fleet = nine[name], nine[fleet_of(name)]
    held = [{(g.name, (g.type, *g.bases)[-1], g.role) for g in at_tier(each).groups} for each in (mission, fleet)]
    assert held[0] == held[1]
    assert all(group.count is not None for group in fleet.groups if group.name != "stop_node")
    for mode in fleet.modes.allowed:
        text = emit(fleet, seed=2, mode=mode)
        again, notes = read(nine, text)
        assert instantiate(again, seed=2) == instantiate(fleet, seed=2, mode=mode) and emit(again) == text
        assert notes[0] == f"template '{fleet.name}': named by 'lingjing'"


def test_no_spelling_belongs_to_two_fields() -> None:
    table = [field.spellings for field in FIELDS]
    assert sum(map(len, table)) == len(frozenset().union(*table))


@pytest.mark.parametrize("name", NAMES)
def test_each_mission_is_recognised_by_entities_and_hidden_fields(nine: Nine, name: str) -> None:
    mission, notes = read(nine, foreign(nine, name))
    assert mission.name == name and notes[0].startswith(f"template '{name}': recognised by ")
    assert places(instantiate(mission)) == places(instantiate(nine[name], seed=1))
    hidden = {e.id: e.hidden for e in instantiate(nine[name], seed=1).entities}
    assert {e.id: e.hidden for e in instantiate(mission).entities} == hidden, "what was hidden stays hidden"
    bare = json.dumps(json.loads(foreign(nine, name))["scenario"])
    assert instantiate(read(nine, bare)[0]) == instantiate(mission)


@pytest.mark.parametrize(
    ("word", "name"),
    [
        ("VDN", "vdn"), ("机器狗视觉导航", "vdn"), ("bridge_inspection", "bi"), ("Last-Mile Delivery", "ld"),
        ("Industrial dog firefighting", "idf"), ("pipeline-repair", "upr"), ("UAV fire response", "ufr"),
        ("congestion replanning", "cr"), ("海上搜救", "ssr"), ("city_logistics", "cd"), ("城市物流", "cd"),
    ],
)  # fmt: skip
@pytest.mark.parametrize("key", ["taskType", "task_type"])
def test_task_types_name_templates(nine: Nine, word: str, name: str, key: str) -> None:
    for holder in (lambda s: s, lambda s: s["taskMatrix"][0]):
        mission, notes = read(nine, foreign(nine, name, lambda s, h=holder: h(s).update({key: word})))  # type: ignore[misc]
        assert mission.name == name and f"named by {key} '{word}'" in notes[0]


def test_contradicting_task_types_are_an_error_unless_the_template_is_named(nine: Nine) -> None:
    text = foreign(nine, "ufr", lambda s: (s.update(taskType="ufr"), s["taskMatrix"][0].update(task_type="cr")))
    with pytest.raises(MissionError, match="taskType names ufr; task_type names cr") as caught:
        read(nine, text)
    assert [fault.where for fault in caught.value.faults] == ["$.scenario.taskMatrix[0].task_type"]
    assert 'name the template: "lingjing": {"mission": "ufr"}' in caught.value.hint
    named = json.loads(text)
    named["scenario"]["lingjing"] = {"mission": "ufr"}
    assert read(nine, json.dumps(named))[0].name == "ufr"


def _only_words(scenario: Scenario) -> None:
    scenario["equipmentList"] = {}
    for key in [key for key in state(scenario) if field_of(key)]:
        del state(scenario)[key]


@pytest.mark.parametrize(
    ("name", "edit", "words"),
    [
        ("idf", _only_words, "no template fits a scenario of empty lists without any hidden place"),
        ("idf", lambda s: state(s).update(goalPosition={"X": 1.0, "Y": 2.0}), ": vdn, idf"),
        ("ufr", lambda s: state(s).update(congestion=[{"X": 1.0, "Y": 2.0}]), ": ufr, cr"),
        ("upr", lambda s: s["equipmentList"].update(unmannedDogEntityList=[]), "of leakPosition and droneEntityList;"),
        ("cd", lambda s: s.update(equipmentList={}), "no template fits a scenario of warehousePosition and"),
    ],
)
def test_the_error_of_an_ambiguous_or_unknown_document_lists_candidates_and_a_hint(
    nine: Nine, name: str, edit: Edit, words: str
) -> None:
    with pytest.raises(MissionError) as caught:
        read(nine, foreign(nine, name, edit))
    assert words in str(caught.value), str(caught.value)
    assert '"lingjing": {"mission": "' in (caught.value.hint or "")


# -- hidden places --------------------------------------------------------------------------------------------------


def _moved(old: str, new: str, wrap: Callable[[list[Scenario]], object] = list) -> Edit:
    return lambda scenario: state(scenario).update({new: wrap(state(scenario).pop(old))})


def _nested(rows: list[Scenario]) -> list[Scenario]:
    return [{"name": "目标一", "data": {axis: row[axis] for axis in "XYZ"}} for row in rows]


@pytest.mark.parametrize(
    ("name", "edit"),
    [
        ("ufr", _moved("goalFirePosition", "fire_spots")),
        ("ufr", _moved("goalFirePosition", "fireSpots", _nested)),
        ("idf", _moved("goalFirePosition", "fire_spots")),
        ("idf", _moved("goalFirePosition", "火点")),
        ("vdn", _moved("goalPosition", "goalPosition", lambda rows: rows[0])),
        ("vdn", _moved("goalPosition", "goal_position")),
        ("bi", _moved("fracturePosition", "goalPosition")),
        ("bi", _moved("fracturePosition", "task_points")),
        ("upr", _moved("leakPosition", "leak", lambda rows: rows[0])),
        ("upr", _moved("leakPosition", "goalPosition")),
        ("cr", _moved("congestionPosition", "congestion")),
        ("cr", _moved("destinationPosition", "goalPosition")),
        ("cd", _moved("deliveryPoints", "task_points")),
        ("cd", _moved("deliveryPoints", "delivery_points")),
        ("cd", _moved("warehousePosition", "warehouse", lambda rows: rows[0])),
        ("ssr", _moved("rescuePersonPosition", "rescue_person_position")),
        ("ssr", lambda s: s.update(rescuePersonPosition=state(s).pop("rescuePersonPosition"))),
        ("vdn", lambda s: s["taskMatrix"][0].update(goalPosition=state(s).pop("goalPosition"))),
        ("cr", lambda s: s["equipmentList"].update(dict.fromkeys(("shipEntityList", "planeEntityList")))),
        ("ld", lambda s: [s["equipmentList"].pop(key) for key in ("satelliteEntityList", "planeEntityList")]),
    ],
)
def test_hidden_places_are_recognised_under_many_field_names(nine: Nine, name: str, edit: Edit) -> None:
    mission, notes = read(nine, foreign(nine, name, edit))
    instance = instantiate(mission)
    assert places(instance) == places(instantiate(nine[name], seed=1))
    assert not [note for note in notes if "kept" in note]
    hidden = {
        g.name for g in at_tier(nine[name]).groups if any(p.name == "position" and p.hidden for p in g.properties)
    }
    assert {e.group for e in instance.entities if "position" in e.hidden} == hidden


def test_weights_become_demands(nine: Nine) -> None:
    def weigh(scenario: Scenario) -> None:
        points = [{"X": 100.0 * k, "Y": -300.0 * k, "demand": 40.0 * k, "name": f"配送点{k}"} for k in (1, 2, 3)]
        state(scenario)["deliveryPoints"] = points

    instance = instantiate(read(nine, foreign(nine, "cd", weigh))[0])
    points = [entity for entity in instance.entities if entity.group == "point"]
    assert [(e.label, e.position[:2], e.properties["demand_kg"]) for e in points] == [
        ("配送点1", (1.0, 3.0), 40.0), ("配送点2", (2.0, 6.0), 80.0), ("配送点3", (3.0, 9.0), 120.0),
    ]  # fmt: skip
    assert all(entity.state == (StateSpec(name="demand", unit="kg"),) for entity in points)


def test_a_missing_or_negative_weight_is_an_error_and_an_unused_weight_is_noted(nine: Nine) -> None:
    with pytest.raises(MissionError, match=r"deliveryPoints\[1\]: has no weight while others have one"):
        read(nine, foreign(nine, "cd", lambda s: state(s)["deliveryPoints"][1].pop("weight")))
    with pytest.raises(MissionError, match=r"deliveryPoints\[1\]\.weight: is -3, at least 0 is due"):
        read(nine, foreign(nine, "cd", lambda s: state(s)["deliveryPoints"][1].update(weight=-3.0)))
    _, notes = read(nine, foreign(nine, "upr", lambda s: state(s)["leakPosition"][0].update(weight=3.0)))
    assert any("'leak' has no demand; 'weight' is kept, not played" in note for note in notes)


def test_geodetic_targets_are_converted_and_disagreeing_coordinates_are_noted(nine: Nine) -> None:
    latitude, longitude = frames.to_geodetic(150.0, 20.0, (31.0, 121.5))
    goal = {"lon": longitude, "lat": latitude, "alt": 2.0}
    mission, notes = read(nine, foreign(nine, "vdn", lambda s: state(s).update(goalPosition=goal)))
    assert targets(instantiate(mission), "home") == [pytest.approx((150.0, 20.0, 2.0), abs=1e-3)]
    assert len(notes) == 2 and "assumed to be at the template's 31, 121.5" in notes[1]
    both = {"X": 15_000.0, "Y": -2_500.0, **goal}
    mission, notes = read(nine, foreign(nine, "vdn", lambda s: state(s).update(goalPosition=both)))
    assert targets(instantiate(mission), "home") == [(150.0, 25.0, 2.0)]
    assert notes[1].endswith("goalPosition: lon and lat lie 5 m off X and Y: X and Y are used")


@pytest.mark.parametrize(
    ("name", "edit", "note"),
    [
        ("cr", lambda s: state(s).update(congestionLevel="heavy"), "'congestionLevel' not understood and kept"),
        ("cr", lambda s: state(s).update(congestion="heavy"), "congestion: is no list of places; not understood and"),
        ("upr", lambda s: state(s).update(leak=3.0), "leak: is no list of places"),
        ("upr", lambda s: state(s).update(leak=state(s)["leakPosition"]), "'leak' is given by $.scenario"),
        ("ufr", lambda s: (s.update(lingjing={"mission": "ufr"}), state(s).update(leak={"X": 0.0, "Y": 0.0})),
         "mission 'ufr' has no pipeline_leak; 1 kept, not played"),
        ("ufr", lambda s: (s.update(taskType="ufr"), _moved("goalFirePosition", "goalPosition")(s)),
         "goalPosition: assigned to 'fire', the only hidden target of mission 'ufr'"),
        ("vdn", lambda s: [s.update(taskType="vdn"), *map(state(s).pop, ["goalPosition"])],
         "does not place 'home'; the template"),
        ("vdn", lambda s: s["equipmentList"]["unmannedDogEntityList"][0].update(yaw=10.0), "heading, yaw disagree"),
        ("vdn", lambda s: s.update(collaborationType="broadcast"), "mission 'vdn' has no mode 'broadcast'; kept"),
        ("cd", lambda s: s.update(collaborationType="广播"), "'广播' is the mode that is played"),
        ("ufr", lambda s: s["equipmentList"]["autoVehicleEntityList"][0].update(equipmentCode="uav[1]"),
         "an equipmentCode is repeated: 'uav[1]'"),
        ("ufr", lambda s: state(s)["goalFirePosition"].pop(), "places 2; what sweep 'workload' has beyond is left"),
        ("bi", lambda s: state(s).update(weather={"类型": "晴"}), "weather: an object is not understood and kept"),
        ("bi", lambda s: state(s).update(uav_count=2.0), "uav_count says 2, the list has 1"),
        ("bi", lambda s: s["equipmentList"].update(tankEntityList=[]), "'tankEntityList' not understood"),
    ],
)  # fmt: skip
def test_decisions_and_ignored_fields_are_noted(nine: Nine, name: str, edit: Edit, note: str) -> None:
    text = foreign(nine, name, edit)
    mission, notes = read(nine, text)
    assert any(note in line for line in notes), notes
    assert mission.origin.document == text and instantiate(mission).mission == name


def test_repeated_keys_are_noted_with_their_path(nine: Nine) -> None:
    text = foreign(nine, "vdn").replace('"goalPosition": [', '"goalPosition": [], "goalPosition": [', 1)
    text = text.replace('"uav_count"', '"weather": "Fog", "uav_count"', 1)
    mission, notes = read(nine, text)
    where = "$.scenario.taskMatrix[0].initial_state"
    assert f"{where}.weather: is repeated in its object; the last one is used" in notes
    assert f"{where}.goalPosition: is repeated in its object; the last one is used" in notes
    assert instantiate(mission).weather.visibility_m == 500 and mission.origin.document == text


# -- satellites, and templates of others ----------------------------------------------------------------------------

ISS = (
    "1 25544U 98067A   08264.51782528 -.00002182  00000-0 -11606-4 0  2927",
    "2 25544  51.6416 247.4627 0006703 130.5360 325.0288 15.72125391563537",
)


def watched(mission: m.Mission) -> m.Mission:
    """The mission with a satellite over it."""
    properties = (
        m.Property(name="position", value=ex.Point(tuple(ex.Number(v, "m") for v in (0.0, 0.0, 550e3)))),
        m.Property(name="tle1", value=ex.Text("")),
        m.Property(name="tle2", value=ex.Text("")),
    )
    eye = m.Group(name="eye", role="asset", type="satellite", engine="satellite", properties=properties)
    return msgspec.structs.replace(mission, groups=(*mission.groups, eye))


@pytest.mark.parametrize(
    "lines",
    [
        {"tle1": ISS[0], "tle2": ISS[1]},
        {"tle": list(ISS)},
        {"TLE": {"line1": ISS[0], "line2": ISS[1]}},
        {"tleLine1": ISS[0], "tleLine2": ISS[1], "data": {"lon": 121.5, "lat": 31.0, "alt": 420e3}},
        {"data": {"tle_line_1": ISS[0], "tle_line_2": ISS[1]}},
        {"tle": "ISS (ZARYA)\n" + "\r\n".join(ISS) + "\n"},
        {"tle": ["国际空间站", *ISS], "data": {"lon": 121.5, "lat": 31.0, "alt": 420e3}},
    ],
)
def test_satellites_have_the_orbital_elements_of_the_document(nine: Nine, lines: Scenario) -> None:
    high = 420e3 if "lat" in lines.get("data", {}) else 550e3
    satellite = {"equipmentCode": "SAT-1", **lines}
    text = foreign(nine, "ufr", lambda s: s["equipmentList"].update(satelliteEntityList=[satellite]))
    mission, _ = read({**nine, "ufr": watched(nine["ufr"])}, text)
    eye = instantiate(mission).entities[-1]
    assert (eye.label, eye.properties["tle1"], eye.properties["tle2"]) == ("SAT-1", *ISS)
    assert eye.position[2] == high
    assert any("1 kept, not played" in note for note in read(nine, text)[1]), "without a satellite it is kept"


@pytest.mark.parametrize(
    ("lines", "fault"),
    [
        (ISS, ""),
        (ISS[:1], "has 1 line of elements, not two"),
        ((ISS[1], ISS[0]), "line 1 of its elements is not"),
        ((ISS[0][:-1] + "8", ISS[1]), "line 1 of its elements has the checksum 8, its digits give 7"),
        ((ISS[0], ISS[1][:50]), "line 2 of its elements is not 69 characters"),
    ],
)
def test_orbital_elements_are_checked(lines: tuple[str, ...], fault: str) -> None:
    assert elements_fault(lines).startswith(fault) and bool(elements_fault(lines)) == bool(fault)


NUMBERS = {
    "inclination": 51.6416, "raan": 247.4627, "eccentricity": 0.0006703, "argPerigee": 130.536, "meanAnomaly": 325.0288,
    "meanMotion": 15.72125391, "epoch": "2008-09-20T12:25:40Z",
}  # fmt: skip


@pytest.mark.parametrize("holder", [lambda n: {"tle": n}, lambda n: {"data": n}, lambda n: n])
def test_orbital_elements_may_be_numbers(nine: Nine, holder: Callable[[Scenario], Scenario]) -> None:
    satellite = {"equipmentCode": "SAT-1", **holder(dict(NUMBERS))}
    text = foreign(nine, "ufr", lambda s: s["equipmentList"].update(satelliteEntityList=[satellite]))
    properties = instantiate(read({**nine, "ufr": watched(nine["ufr"])}, text)[0]).entities[-1].properties
    lines = (str(properties["tle1"]), str(properties["tle2"]))
    assert elements_fault(lines) == "" and lines[1][8:63] == ISS[1][8:63]
    assert lines[0][18:32] == "08264.51782407"  # day 264 of 2008, 12:25:40


@pytest.mark.parametrize("edit", [{"inclination": "high"}, {"epoch": None}, {"eccentricity": 1.5}])
def test_numbers_that_are_no_orbital_elements_are_not_used(nine: Nine, edit: Scenario) -> None:
    satellite = {"equipmentCode": "SAT-1", "tle": {**NUMBERS, **edit}}
    text = foreign(nine, "ufr", lambda s: s["equipmentList"].update(satelliteEntityList=[satellite]))
    assert instantiate(read({**nine, "ufr": watched(nine["ufr"])}, text)[0]).entities[-1].properties["tle1"] == ""


def test_invalid_orbital_elements_are_noted_and_not_used(nine: Nine) -> None:
    satellite = {"equipmentCode": "SAT-1", "tle1": ISS[0][:40], "tle2": ISS[1]}
    text = foreign(nine, "ufr", lambda s: s["equipmentList"].update(satelliteEntityList=[satellite]))
    mission, notes = read({**nine, "ufr": watched(nine["ufr"])}, text)
    assert any("satelliteEntityList[0]: line 1 of its elements is not 69 characters" in note for note in notes), notes
    assert instantiate(mission).entities[-1].properties["tle1"] == ""


def test_unread_fields_may_have_any_value(nine: Nine) -> None:
    def fill(scenario: Scenario) -> None:
        scenario["sceneRegion"] = ["园区", 3]
        scenario["taskMatrix"][0].update(task_id=17, taskLevel={"level": 2})
        scenario["equipmentList"]["unmannedDogEntityList"][0].update(sensorType=["RGB", "深度"], side=1)

    text = foreign(nine, "vdn", fill)
    mission, notes = read(nine, text)
    assert len(notes) == 1 and mission.origin.document == text
    schema = msgspec.json.decode(document.schemas()["reset-scenario.schema.json"])
    assert jsonschema.Draft202012Validator(schema).is_valid(json.loads(text))


def test_equipment_codes_and_target_ids_may_be_numbers(nine: Nine) -> None:
    def number(scenario: Scenario) -> None:
        scenario["equipmentList"]["autoVehicleEntityList"][0]["equipmentCode"] = 7
        state(scenario)["goalFirePosition"][0]["targetId"] = 0

    labels = {e.id: e.label for e in instantiate(read(nine, foreign(nine, "ufr", number))[0]).entities}
    assert labels["truck"] == "7" and labels["fire[1]"] == "0" and labels["fire[2]"] == ""


def test_a_field_with_places_precedes_an_empty_one_and_a_second_field_is_noted(nine: Nine) -> None:
    def split(scenario: Scenario) -> None:
        state(scenario)["fire_spots"] = state(scenario)["goalFirePosition"]
        state(scenario)["goalFirePosition"] = []

    mission, notes = read(nine, foreign(nine, "ufr", split))
    assert places(instantiate(mission)) == places(instantiate(nine["ufr"], seed=1))
    assert not any("kept" in note for note in notes)
    where = "$.scenario.taskMatrix[0].initial_state"
    text = foreign(nine, "ufr", lambda s: state(s).update(fire_spots=state(s)["goalFirePosition"][:1]))
    assert f"{where}.fire_spots: 'fire' is given by {where}.goalFirePosition; 1 kept, not played" in read(nine, text)[1]
    spots = [{"X": 0.0, "Y": 0.0}]
    with pytest.raises(MissionError, match=r"'fire' is given by .*goalFirePosition; its entries .1. would be ignored"):
        read(nine, foreign(nine, "ufr", lambda s: state(s).update(fire_spots=spots)))


def test_the_search_area_of_a_document_replaces_the_region_of_the_mission(nine: Nine) -> None:
    corners = [
        {"X": x, "Y": y} for x, y in ((-20_000.0, 0.0), (20_000.0, 0.0), (20_000.0, -30_000.0), (-20_000.0, -30_000.0))
    ]
    mission, _ = read(nine, foreign(nine, "ufr", lambda s: state(s).update(rescueRange=corners)))
    instance = instantiate(mission)
    assert set(instance.regions[0].polygon) == {(-200.0, 0.0), (200.0, 0.0), (200.0, 300.0), (-200.0, 300.0)}
    assert len(instance.cells) == 5 and all(abs(cell.centre[0]) < 200 for cell in instance.cells)
    mission, notes = read(nine, foreign(nine, "bi", lambda s: state(s).update(rescueRange=corners)))
    assert any("mission 'bi' has no region to search; kept" in note for note in notes)
    assert instantiate(mission).regions == instantiate(nine["bi"]).regions


def test_groups_without_a_field_of_their_own_are_written_and_read_by_name(nine: Nine) -> None:
    queue = msgspec.structs.replace(
        next(g for g in nine["ufr"].groups if g.name == "fire"), name="second", type="beacon", count=None
    )
    twin = msgspec.structs.replace(queue, name="third", type="building_fire")
    engine = msgspec.structs.replace(next(g for g in nine["ufr"].groups if g.name == "truck"), name="engine")
    more = msgspec.structs.replace(nine["ufr"], groups=(*nine["ufr"].groups, queue, twin, engine))
    text = emit(more, seed=2)
    assert json.loads(text)["scenario"]["lingjing"]["targets"].keys() == {"second", "third"}
    again, _ = read({**nine, "ufr": more}, text)
    assert instantiate(again, seed=2) == instantiate(more, seed=2)
    assert [e.position for e in instantiate(again, seed=9).entities] == [
        e.position for e in instantiate(more, seed=2).entities
    ]
    with pytest.raises(MissionError, match=r"targets\.tea: mission 'ufr' has no target group 'tea'"):
        read({**nine, "ufr": more}, text.replace('"second"', '"tea"'))
