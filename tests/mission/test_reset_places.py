"""resetScenario documents of other systems: odd spellings, frames, nulls and numbers, read or refused."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from lingjing.errors import LingjingError, MissionError
from lingjing.mission.reset.emit import emit
from lingjing.testing import instantiate
from lingjing.testing.documents import decode, encode, read, templates_beside

RESET = Path(__file__).resolve().parents[2] / "scenarios" / "reset"
TEMPLATES = templates_beside(Path("nowhere"))
Edit = Callable[[dict[str, Any], dict[str, Any], list[Any]], object]
"""Of the document, its first task's initial state and its drones."""


def edited(edit: Edit, name: str = "ssr") -> str:
    whole = json.loads((RESET / f"{name}-001.json").read_text(encoding="utf-8"))
    scenario = whole["scenario"]
    edit(whole, scenario["taskMatrix"][0]["initial_state"], scenario["equipmentList"]["droneEntityList"])
    return json.dumps(whole, ensure_ascii=False)


AT = "$.scenario.equipmentList.droneEntityList"
STATE = "$.scenario.taskMatrix[0].initial_state"
TIED = "X = Y = 0 is assumed to be at the template's 31, 121.5"
READ: list[tuple[Edit, tuple[str, ...]]] = [
    (lambda w, s, d: (d[0].update(name="无人机一号", equipmentCode="无人机-①"), s.update(weather="晴")), ()),
    (lambda w, s, d: w["scenario"].update(collaborationType="星型"), ("'星型' is the mode that is played",)),
    (lambda w, s, d: (d[0].update(heading=None), s.update(weather=None)), ()),
    (
        lambda w, s, d: d[0].update(data={"longitude": 121.5, "Latitude": 31.0, "altitude": 3}),
        (f"{AT}[].data: 'longitude', 'Latitude', 'altitude' read as lon, lat, alt", TIED),
    ),
    (
        lambda w, s, d: [x.update(data={"lng": 121.5, "lat": 31.0}) for x in d],
        (f"{AT}[].data: 'lng' read as lon", TIED, *(f"{AT}[{k}].data: gives no height" for k in range(3))),
    ),
    (
        lambda w, s, d: s.update(rescuePersonPosition=[{"position": {"经度": 121.501, "纬度": 30.991}}]),
        (f"{STATE}.rescuePersonPosition[].position: '经度', '纬度' read as lon, lat", TIED),
    ),
    (
        lambda w, s, d: d[0].update(raw=10, heading=20, yaw=30),
        ("heading, raw, yaw disagree; heading is used",),
    ),
    (
        lambda w, s, d: d[0].update(data={"x": 30660.0, "y": 62020.0, "z": 112.0}),
        (f"{AT}[].data: 'x', 'y', 'z' read as X, Y, Z, Unreal's centimetres",),
    ),
    (lambda w, s, d: d[1].update(equipmentCode="UAV-MA-001"), ("is repeated: 'UAV-MA-001'",)),
    (
        lambda w, s, d: (w.update(foo=[1]), s["rescuePersonPosition"][0].update(血型="A")),
        ("$: 'foo' not understood and kept", "'血型' not understood and kept"),
    ),
    (lambda w, s, d: s.update(rescue_person_position=s.pop("rescuePersonPosition")), ()),
    (lambda w, s, d: s.update(uav_count=99), ("uav_count says 99, the list has 3",)),
    (lambda w, s, d: w["scenario"]["equipmentList"].update(planeEntityList=[], satelliteEntityList=None), ()),
    (lambda w, s, d: w["scenario"]["taskMatrix"].append({"goal": "two"}), ("the first of 2 rows is played",)),
    (lambda w, s, d: s["rescuePersonPosition"][0].update(X=90000.0, Y=90000.0), ("lies outside of rescueRange",)),
]


@pytest.mark.parametrize(("edit", "notes"), READ)
def test_odd_spellings_are_read_noted_and_written_back_unchanged(edit: Edit, notes: tuple[str, ...]) -> None:
    text = edited(edit)
    mission, noted = read(text, "d.json", TEMPLATES)
    inferred = "\n".join(noted[1:])
    assert noted[0].startswith("template 'ssr': recognised by ")
    assert len(noted) == 1 + len(notes) and all(note in inferred for note in notes), inferred
    assert decode(encode(mission), "m.json") == mission
    first = instantiate(mission, seed=5)
    again, _ = read(emit(mission), "e.json", TEMPLATES)
    assert [(e.id, e.position) for e in instantiate(again, seed=5).entities] == [
        (e.id, e.position) for e in first.entities
    ]
    assert emit(again) == emit(mission)


REFUSED: list[tuple[Edit, str]] = [
    (lambda w, s, d: d[0].update(data={"X": 1.0}), f"{AT}[0].data: has no place"),
    (lambda w, s, d: d[0]["data"].update(X="30660.0"), f"{AT}[0].data.X: a number is due, this is the text '30660.0'"),
    (lambda w, s, d: d[0]["data"].update(X=1e300), f"{AT}[0].data: lies at (1e+298, -620.2, 1.12) m, beyond the scene"),
    (lambda w, s, d: d[0]["data"].update(X=10**400), "data.X: a number is due, this is a number out of range"),
    (lambda w, s, d: s.update(rescueRange=s["rescueRange"][:2]), "rescueRange: the outline has 2 different corners"),
    (
        lambda w, s, d: [d[1].pop(key, None) or d[1]["data"].pop(key, None) for key in ("heading", "raw", "yaw")],
        f"{AT}[1].data: has no heading while others have one",
    ),
    (
        lambda w, s, d: s.update(searchRange=s["rescueRange"][:3]),
        f"{STATE}: 'rescueRange' and 'searchRange' are spellings of one field and differ",
    ),
]


@pytest.mark.parametrize(("edit", "words"), REFUSED)
def test_errors_of_invalid_values_name_the_path_and_the_reason(edit: Edit, words: str) -> None:
    with pytest.raises(LingjingError) as caught:
        read(edited(edit), "d.json", TEMPLATES)
    assert words in str(caught.value) and caught.value.hint


def test_entries_that_are_no_objects_are_reported_together_with_other_faults() -> None:
    odd = [{"personId": "a", "X": 1.0, "Y": 2.0}, None, [1, 2, 3], "here", {"personId": "b", "X": 1.0}]
    with pytest.raises(MissionError) as caught:
        read(edited(lambda w, s, d: s.update(rescuePersonPosition=odd)), "d.json", TEMPLATES)
    at = f"{STATE}.rescuePersonPosition"
    assert [(fault.where, fault.message) for fault in caught.value.faults] == [
        (f"{at}[1]", "an object is due, this is null"),
        (f"{at}[2]", "an object is due, this is a list"),
        (f"{at}[3]", "an object is due, this is the text 'here'"),
        (f"{at}[4]", "has no place"),
    ]


def test_a_null_coordinate_is_reported_beside_an_invalid_one() -> None:
    wrong = f"{AT}[0].data.Y", "a number is due, this is the text 'here'"
    lacking = f"{AT}[0].data", "has no place"
    for coordinates, faults in (
        ({"X": None, "Y": "here"}, [wrong, lacking]),
        ({"Y": "here"}, [wrong, lacking]),
        ({"X": 1.0, "Y": "here"}, [wrong]),
        ({"X": None, "Y": "here", "lon": 120.0, "lat": 30.0}, [wrong]),
    ):
        with pytest.raises(MissionError) as caught:
            read(edited(lambda w, s, d, coordinates=coordinates: d[0].update(data=coordinates)), "d.json", TEMPLATES)
        assert [(fault.where, fault.message) for fault in caught.value.faults] == faults


def test_a_fault_in_a_row_is_not_reported_as_an_empty_matrix() -> None:
    with pytest.raises(MissionError) as caught:
        read(edited(lambda w, s, d: s.update(takeoff_height_m="60")), "d.json", TEMPLATES)
    assert [(fault.where, fault.message) for fault in caught.value.faults] == [
        (f"{STATE}.takeoff_height_m", "a number is due, this is the text '60'")
    ]
    with pytest.raises(MissionError, match="taskMatrix: is empty"):
        read(edited(lambda w, s, d: w["scenario"].update(taskMatrix=[])), "d.json", TEMPLATES)


def test_the_spelling_that_is_not_empty_is_used() -> None:
    def twice(whole: dict[str, Any], state: dict[str, Any], drones: list[Any]) -> None:
        state.update(search_range=state["rescueRange"], rescueRange=[])
        whole["scenario"]["equipmentList"].update(drone_entity_list=list(drones), droneEntityList=[])

    doubled, plain = (
        instantiate(read(edited(edit), "d.json", TEMPLATES)[0], seed=5) for edit in (twice, lambda w, s, d: None)
    )
    assert doubled.entities == plain.entities
    assert doubled.regions == plain.regions


@pytest.mark.parametrize("data", [{"X": 100.0, "Y": 0.0, "alt": 45.0}, {"lon": 121.5, "lat": 31.0, "Z": 4500.0}])
def test_a_height_may_be_alt_beside_x_and_y_or_z_beside_degrees(data: dict[str, float]) -> None:
    mission, _ = read(edited(lambda w, s, d: d[0].update(data=data)), "d.json", TEMPLATES)
    (uav, *_) = (e for e in instantiate(mission, seed=5).entities if e.label == "UAV-MA-001")
    assert uav.position[2] == 45.0
