"""`resetScenario` documents of other systems: each value is used, noted or refused, and none is dropped silently."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from lingjing import Mission
from lingjing.errors import MissionError
from lingjing.mission.instance import Instance
from lingjing.mission.reset.emit import emit
from lingjing.testing import instantiate
from lingjing.testing.documents import read, templates_beside
from lingjing.testing.expressions import Number

TEMPLATES = templates_beside(Path("nowhere"))
MADE_UP = Path(__file__).parent / "made_up"
LISTS = {
    "uav": "droneEntityList",
    "dog": "unmannedDogEntityList",
    "car": "autoVehicleEntityList",
    "ship": "shipEntityList",
}
Json = dict[str, Any]


def xyz(x: float, y: float, z: float = 0.0, **beside: Any) -> Json:
    return {"X": x, "Y": y, "Z": z, **beside}


UAVS = [xyz(0.0, 0.0, 3000.0), xyz(0.0, 3000.0, 3000.0)]


def document(*states: Json, top: Json | None = None, **bodies: list[Json]) -> Json:
    """A scenario with one row for each initial state, and bodies called `uav1`, `car2`, … at their places."""
    lists = {
        LISTS[kind]: [{"equipmentCode": f"{kind}{k}", "data": data} for k, data in enumerate(places, start=1)]
        for kind, places in bodies.items()
    }
    return {"equipmentList": lists, "taskMatrix": [{"initial_state": state} for state in states], **(top or {})}


def loaded(whole: Json) -> tuple[Mission, Instance, str]:
    """The mission of a document, its instance, and its notes as one text; it comes back as it was."""
    text = json.dumps(whole, ensure_ascii=False)
    mission, notes = read(text, "w.json", TEMPLATES)
    assert emit(mission, plain=True) == text
    return mission, instantiate(mission, seed=1), "\n".join(notes)


def refused(whole: Json) -> str:
    with pytest.raises(MissionError) as caught:
        loaded(whole)
    return f"{caught.value}\n{caught.value.hint}"


def at(instance: Instance, group: str) -> list[tuple[float, ...]]:
    return [entity.position[:2] for entity in instance.entities if entity.group == group]


# -- rows --------------------------------------------------------------------------------------------------------------


def test_the_hidden_places_of_every_row_are_played() -> None:
    fires = {"goalFirePosition": [xyz(9000.0, 5000.0)]}, {"goalFirePosition": xyz(-9000.0, 5000.0)}
    mission, instance, notes = loaded(document(*fires, uav=UAVS))
    assert mission.name == "fire_search" and at(instance, "fire") == [(90.0, -50.0), (-90.0, -50.0)]
    assert "the first of 2 rows is played, with the hidden places of the others" in notes


def test_a_place_that_several_rows_repeat_counts_once() -> None:
    fire = {"goalFirePosition": [xyz(9000.0, 5000.0, fireId="F-1")]}
    _, instance, _ = loaded(document(fire, fire, {"goalFirePosition": xyz(9000.0, 5000.0)}, uav=UAVS))
    assert at(instance, "fire") == [(90.0, -50.0)]


def test_rows_of_two_tasks_are_an_error() -> None:
    fire, person = {"goalFirePosition": [xyz(9000.0, 5000.0)]}, {"rescuePersonPosition": [xyz(9000.0, 9000.0)]}
    bodies = {"uav": UAVS, "car": [xyz(4000.0, 0.0)], "ship": [xyz(0.0, 15000.0)]}
    assert "several templates fit rescuePersonPosition, goalFirePosition" in refused(document(fire, person, **bodies))
    named = document(fire, person, top={"lingjing": {"mission": "ufr"}}, **bodies)
    assert "mission 'ufr' has no person_in_water; 1 kept, not played" in loaded(named)[2]


def test_a_contradicting_task_type_in_a_later_row_is_an_error() -> None:
    whole = document({"goalFirePosition": [xyz(9000.0, 5000.0)]}, {}, uav=UAVS)
    for row, word in zip(whole["taskMatrix"], ("fire_rescue", "bridge"), strict=True):
        row["task_type"] = word
    assert "contradicts the other task type" in refused(whole)


def test_a_place_without_a_target_in_the_named_mission_is_an_error() -> None:
    whole = document({"goalFirePosition": [xyz(9000.0, 5000.0)]}, uav=UAVS[:1], top={"taskType": "bridge"})
    message = refused(whole)
    assert "mission 'bi' has no building_fire or fire_source; its entries (1) would be ignored" in message
    assert '"lingjing": {"mission": "bi"}' in message


def test_cars_with_goals_in_rows_keep_every_destination_and_lost_assignments_are_noted() -> None:
    rows = [
        {"vehicle_id": "car2", "goalPosition": xyz(2e4, 0.0)},
        {"vehicle_id": "car1", "goalPosition": xyz(0.0, 2e4)},
    ]
    mission, instance, notes = loaded(document(*rows, car=[xyz(0.0, 0.0), xyz(0.0, 4000.0)]))
    assert mission.name == "cr_fleet" and len(at(instance, "goal_place")) == 2
    assert "the rows name 'car2', 'car1'; in mission 'cr_fleet' any of them may serve each place" in notes


def test_goals_that_name_uavs_keep_their_assignment_beside_other_bodies() -> None:
    rows = [{"uav_id": "uav2", "goalPosition": xyz(9000.0, 0.0)}, {"uav_id": "uav1", "goalPosition": xyz(0.0, 9000.0)}]
    mission, instance, notes = loaded(document(*rows, uav=UAVS, dog=[xyz(1000.0, 1000.0)]))
    assert mission.name == "goals" and at(instance, "goal") == [(0.0, -90.0), (90.0, 0.0)]
    assert "mission 'goals' has no quadruped; 1 kept, not played" in notes and "uav_id" not in notes


def test_goals_that_may_belong_to_uavs_or_to_a_dog_are_an_error() -> None:
    rows = [{"goalPosition": xyz(9000.0, 0.0)}, {"goalPosition": xyz(0.0, 9000.0)}]
    bodies = {"uav": UAVS, "dog": [xyz(1000.0, 1000.0)]}
    assert "several templates fit goalPosition" in refused(document(*rows, **bodies))
    named = document(*rows, top={"lingjing": {"mission": "goals"}}, **bodies)
    assert at(loaded(named)[1], "goal") == [(90.0, 0.0), (0.0, -90.0)]


# -- pending and incomplete places -------------------------------------------------------------------------------------


@pytest.mark.parametrize("value", [{}, xyz(0, 0.0, status="pending"), {"state": "待定", "data": {"lon": 0, "lat": 0}}])
def test_a_place_of_zeros_that_is_pending_is_absent(value: Json) -> None:
    mission, instance, notes = loaded(document({"goalPosition": value}, uav=UAVS))
    assert mission.name == "free" and not [entity for entity in instance.entities if entity.role == "target"]
    assert "goalPosition: has no place yet" in notes and "treated as absent" in notes


@pytest.mark.parametrize("value", [xyz(0.0, 0.0, status="ready"), xyz(12000.0, 0.0, status="pending"), xyz(0.0, 0.0)])
def test_a_place_counts_unless_it_is_zero_and_pending(value: Json) -> None:
    assert len(at(loaded(document({"goalPosition": value}, uav=UAVS[:1]))[1], "goal")) == 1


def test_a_flying_body_without_a_height_is_noted() -> None:
    whole = document({"goalPosition": {"X": 12000.0, "Y": 0.0}}, uav=[{"X": 0.0, "Y": 0.0}], dog=[])
    assert "droneEntityList[0].data: gives no height (Z or alt); it begins on the surface below" in loaded(whole)[2]
    assert "gives no height" not in loaded(document({}, uav=UAVS, dog=[{"X": 0.0, "Y": 0.0}]))[2]


def test_the_place_of_a_body_may_have_the_key_position() -> None:
    whole = document({"goalPosition": xyz(12000.0, 0.0)}, uav=[xyz(500.0, 200.0, 3000.0)])
    body = whole["equipmentList"]["droneEntityList"][0]
    body["position"] = body.pop("data")
    assert at(loaded(whole)[1], "uav") == [(5.0, -2.0)]


def test_a_start_position_that_differs_from_the_entity_list_is_noted() -> None:
    starts = {"uav_start_positions": {"uav1": UAVS[0], "uav2": UAVS[0]}, "dog_start_position": xyz(1.0, 1.0)}
    notes = loaded(document(starts, uav=UAVS, dog=[xyz(1.0, 1.0)]))[2]
    assert "uav_start_positions.uav2: is not the place of a listed body; the lists of entities are used" in notes
    assert notes.count("is not the place of") == 1 and "start_position" not in notes.replace(
        "uav_start_positions.uav2", ""
    )
    assert "uav_start_position: is not" in loaded(document({"uav_start_position": xyz(5e4, 0.0)}, uav=UAVS))[2]


# -- frames ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("system", "message"),
    [("local_ENU", "whose axes are not Unreal's"), ("NED", "whose axes are not"), ("WGS84", "places have X and Y")],
)
def test_axes_of_another_system_are_an_error_unless_the_unit_is_declared(system: str, message: str) -> None:
    state = {"coordinate_system": system, "goalPosition": xyz(12000.0, 0.0, 3000.0)}
    assert message in refused(document(state, uav=UAVS[:1]))
    with_unit = document(state, uav=UAVS[:1], top={"lingjing": {"unit": "cm"}})
    assert at(loaded(with_unit)[1], "goal") == [(120.0, 0.0)]


def test_a_coordinate_system_that_is_not_understood_is_noted_and_degrees_may_be_wgs84() -> None:
    state = {"coordinate_system": "city grid", "goalPosition": xyz(12000.0, 0.0, 3000.0)}
    assert "'city grid' is not understood and kept; X counts to the east" in loaded(document(state, uav=UAVS[:1]))[2]
    degrees = {"lon": 110.0, "lat": 39.8, "alt": 30.0}
    whole = document({"coordinate_system": "WGS84", "goalPosition": {**degrees, "lon": 110.001}}, uav=[degrees])
    assert "coordinate_system" not in loaded(whole)[2]


def test_degrees_tens_of_kilometres_from_x_and_y_are_an_error() -> None:
    body = {"lon": 121.48, "lat": 31.23, "alt": 30.0}
    message = refused(document({"goalPosition": xyz(12000.0, 0.0)}, uav=[body]))
    assert "droneEntityList[0].data: is in degrees and" in message and "nothing relates the two" in message
    near = {"lon": 121.5, "lat": 31.0, "alt": 30.0}
    assert (
        "assumed to be at the template's 31, 121.5" in loaded(document({"goalPosition": xyz(1e4, 0.0)}, uav=[near]))[2]
    )


# -- budgets and scenes ------------------------------------------------------------------------------------------------


def test_a_wider_scene_has_a_larger_budget_of_ticks() -> None:
    text = (MADE_UP / "04-delivery-house-pending.json").read_text(encoding="utf-8")
    mission, notes = read(text, "w.json", TEMPLATES)
    assert mission.budget.ticks == Number(140.0)  # 50 ticks for 900 m, and the scene is 2,520 m wide
    assert any("for longer ways the budget of 50 ticks is 140" in note for note in notes)
    assert any("max_steps: 50 is kept; the budget of mission 'ld' is used" in note for note in notes)
    text = (MADE_UP / "07-three-cars-no-target.json").read_text(encoding="utf-8")
    assert read(text, "w.json", TEMPLATES)[0].budget.ticks == Number(5.0)  # the document's own


def test_places_wider_apart_than_every_scene_are_noted_with_their_extent() -> None:
    notes = loaded(document({}, uav=[UAVS[0], xyz(2_000_000.0, 0.0, 3000.0)]))[2]
    assert "places reach from (0 m, 0 m) to (20000 m, 0 m)" in notes and "at most 12000 m wide" in notes
