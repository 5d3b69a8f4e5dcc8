"""Documents in the forms of other systems (`made_up/`): the scene is moved to their places, or an error names what is
missing."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from benchmarks.silent_guesses import silent_guesses
from lingjing.errors import ExitCode, MissionError
from lingjing.kernel.cities import CityBuilder
from lingjing.mission.instance import Instance
from lingjing.mission.reset.emit import emit
from lingjing.scene.lines import project
from lingjing.testing import PluginHost, instantiate, run_command
from lingjing.testing.documents import read, templates_beside

FOLDER = Path(__file__).parent / "made_up"
FILES = {path.name[:2]: path for path in sorted(FOLDER.glob("*.json"))}
TEMPLATES = templates_beside(Path("nowhere"))
MISSIONS = {
    "01": "bi",
    "02": "fire_search",
    "03": "cd",
    "04": "ld",
    "05": "free",
    "06": "free",
    "07": "free",
    "08": "free",
    "10": "goals",
    "11": "goals",
    "13": "ufr_fleet",
    "14": "vdn",
    "15": "vdn",
    "16": "goals",
}
REFUSED = {
    "09": "nothing relates the two",
    "12": "several templates fit",
}
Json = dict[str, Any]
Edit = Callable[[Json], object]


def loaded(number: str, edit: Edit = lambda scenario: None) -> tuple[Instance, str]:
    """The instance of a document with a change made to its scenario, and its notes as one text."""
    whole = json.loads(FILES[number].read_text(encoding="utf-8"))
    edit(whole)
    text = json.dumps(whole, ensure_ascii=False)
    mission, notes = read(text, "w.json", TEMPLATES)
    assert emit(mission, plain=True) == text
    return instantiate(mission, seed=1), "\n".join(notes)


def state(scenario: Json) -> Json:
    initial: Json = scenario["taskMatrix"][0]["initial_state"]
    return initial


def listed(scenario: Json, name: str) -> list[Json]:
    rows: list[Json] = scenario["equipmentList"][name]
    return rows


def at(instance: Instance, group: str) -> list[tuple[float, ...]]:
    return [entity.position for entity in instance.entities if entity.group == group]


def test_every_document_is_listed() -> None:
    assert FILES.keys() == MISSIONS.keys() | REFUSED.keys()


@pytest.mark.parametrize("number", MISSIONS)
def test_a_document_validates_and_is_written_back_unchanged(number: str, capsys: pytest.CaptureFixture[str]) -> None:
    text = FILES[number].read_text(encoding="utf-8")
    mission, notes = read(text, "w.json", TEMPLATES)
    assert mission.name == MISSIONS[number]
    assert not list(silent_guesses(text, mission, notes, TEMPLATES))
    assert run_command(["compile", str(FILES[number]), "--emit", "reset-scenario", "--plain"]) == ExitCode.OK
    assert capsys.readouterr().out == text
    assert run_command(["validate", str(FILES[number])]) == ExitCode.OK
    again, _ = read(emit(mission), "w.json", TEMPLATES)
    for seed in (0, 1):
        assert instantiate(again, seed=seed) == instantiate(mission, seed=seed)


@pytest.mark.parametrize("number", REFUSED)
def test_the_error_of_a_refused_document_names_what_is_missing(number: str) -> None:
    with pytest.raises(MissionError, match=REFUSED[number]) as raised:
        loaded(number)
    assert raised.value.hint and "lingjing" in raised.value.hint
    assert any("nothing relates the two" in fault.message for fault in raised.value.faults)


# -- the scene is moved to the document --------------------------------------------------------------------------------


@pytest.mark.parametrize("number", [key for key in MISSIONS if key not in ("14", "15")])
def test_the_scene_contains_every_placed_entity(number: str) -> None:
    instance, notes = loaded(number)
    moved = "beyond the scene of template" in notes
    assert moved == (number in ("01", "02", "03", "04", "05", "06", "07", "08"))
    extent, centre = instance.scene.options["extent_m"], instance.scene.options.get("centre", ((0.0, 0.0),))
    assert isinstance(extent, float) and isinstance(centre, tuple) and isinstance(centre[0], tuple)
    for entity in instance.entities:
        for metres, middle in zip(entity.position[:2], centre[0], strict=False):
            bridge = 200.0 if instance.mission == "bi" and entity.role == "target" else 0.0
            assert abs(metres - middle) <= extent / 2.0 + bridge


@pytest.mark.parametrize(("east", "north"), [(0.0, 0.0), (1_500_000.0, -900_000.0), (-1_900_000.0, 700_000.0)])
def test_a_document_may_be_shifted_within_the_reach_of_the_scene(east: float, north: float) -> None:
    """The same bodies, up to 24 km from X = Y = 0: the distances between them stay."""

    def move(scenario: Json) -> None:
        for drone in listed(scenario, "droneEntityList"):
            drone["data"]["X"] += east
            drone["data"]["Y"] += north

    plain, _ = loaded("05")
    instance, _ = loaded("05", move)
    ways = [
        [round(b[k] - a[k], 3) for a, b in zip(at(each, "uav"), at(each, "uav")[1:], strict=False) for k in (0, 1)]
        for each in (plain, instance)
    ]
    assert ways[0] == ways[1]
    assert instance.scene.options["extent_m"] == plain.scene.options["extent_m"]


def test_a_template_with_a_structure_is_moved_as_a_whole() -> None:
    """The UAV of a bridge inspection begins where the template has it, at the bridge's head."""
    plain = instantiate(TEMPLATES("bi"), seed=1)
    instance, _ = loaded("01")
    (uav,), (own,) = at(instance, "uav"), at(plain, "uav")
    by = uav[0] - own[0], uav[1] - own[1]
    assert [(east - by[0], north - by[1]) for east, north, *_ in at(instance, "fracture")] == [
        pytest.approx(place[:2], abs=1.0) for place in at(plain, "fracture")
    ]
    bridge, before = instance.scene.options["bridge"], plain.scene.options["bridge"]
    assert isinstance(bridge, tuple) and isinstance(before, tuple)
    assert bridge[0] == pytest.approx((before[0][0] + by[0], before[0][1] + by[1]), abs=1.0)  # type: ignore[index]


def test_places_wider_apart_than_any_scene_are_an_error(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    whole = json.loads(FILES["05"].read_text(encoding="utf-8"))
    listed(whole, "droneEntityList")[0]["data"]["X"] += 1_500_000.0
    file = tmp_path / "w.json"
    file.write_text(json.dumps(whole), encoding="utf-8")
    assert run_command(["validate", str(file)]) == ExitCode.MISSION
    assert "droneEntityList" in capsys.readouterr().out


@pytest.mark.parametrize("centre", [(39.83, 109.9455), (-33.9, 18.4), (64.1, -21.9), (0.5, -78.5)])
def test_geodetic_places_may_lie_anywhere_on_earth(centre: tuple[float, float]) -> None:
    """The middle of the range is the origin, wherever most of the places lie."""

    def move(scenario: Json) -> None:
        points = state(scenario)["task_points"]
        for place in [*(car["data"] for car in listed(scenario, "autoVehicleEntityList")), *points]:
            place["lat"] += centre[0] - 39.9
            place["lon"] += centre[1] - 110.02

    instance, notes = loaded("03", move)
    places = [place for group in ("van", "point") for place in at(instance, group)]
    for axis in (0, 1):
        assert min(place[axis] for place in places) == pytest.approx(-max(place[axis] for place in places), abs=2.0)
    assert f"origin is assumed to be at {instance.scene.origin[0]:g}" in notes


def test_a_declared_origin_relates_places_in_degrees_to_places_in_metres() -> None:
    instance, _ = loaded("09", lambda scenario: scenario.update(lingjing={"origin": [39.93, 110.08]}))
    (uav,), (dog,) = at(instance, "uav"), at(instance, "dog")
    assert uav[:2] == (-4552.005, -2119.0025)
    assert dog[:2] == pytest.approx((-4573.0, -4097.0), abs=10.0)
    assert uav[2] == dog[2] == 0.0  # heights of Z and of alt begin at different grounds


# -- bodies alone ------------------------------------------------------------------------------------------------------


def test_a_free_mission_has_no_targets_and_the_budget_of_the_document() -> None:
    instance, notes = loaded("08")
    assert [len(at(instance, group)) for group in ("uav", "dog", "car")] == [10, 5, 3]
    assert not any(entity.role == "target" or entity.hidden for entity in instance.entities)
    assert instance.budget.ticks == 5 and "max_steps: is the budget of 5 ticks" in notes
    _, notes = loaded("08", lambda scenario: scenario.update(max_steps="long"))
    assert "max_steps: is no number of ticks" in notes


def test_ships_are_placed_at_sea() -> None:
    def launch(scenario: Json) -> None:
        lists = scenario["equipmentList"]
        lists["shipEntityList"] = [{"equipmentCode": "S", "data": {"X": 2_000_000.0, "Y": 1_000_000.0, "Z": -350.0}}]
        lists["unmannedDogEntityList"] = []
        del state(scenario)["dog_start_positions"]

    instance, notes = loaded("06", launch)
    assert instance.mission == "free_sea" and at(instance, "ship")[0][:2] == (20_000.0, -10_000.0)
    assert instance.scene.kind == "bay" and "moved to" in notes


@pytest.mark.parametrize(
    "value", [{"status": "pending"}, {"position": {"status": "待定"}}, {"note": "to be set later"}]
)
def test_a_pending_place_is_treated_as_absent(value: Json) -> None:
    instance, notes = loaded("05", lambda scenario: state(scenario).update(target_house=value))
    assert instance.mission == "free" and "target_house: has no place yet" in notes
    instance, _ = loaded("04")
    assert at(instance, "stop_node") == [(-33.0, 203.0, 0.55)]


# -- goals of one UAV each ---------------------------------------------------------------------------------------------


def test_every_goal_is_assigned_to_its_uav() -> None:
    goals = {"10": [(110.0, -25.0), (75.0, -85.0), (140.0, 45.0)], "11": [(11.1, 11.1)]}
    goals["16"] = goals["10"]
    for number, places in goals.items():
        instance, notes = loaded(number)
        assert [place[:2] for place in at(instance, "goal")] == [pytest.approx(goal, abs=0.1) for goal in places]
        assert "rows is played" not in notes
    assert [entity.label for entity in instance.entities if entity.group == "uav"] == ["U-01", "U-02", "U-03"]


def test_the_goal_of_a_row_is_assigned_to_the_uav_that_the_row_names() -> None:
    def swap(scenario: Json) -> None:
        rows = scenario["taskMatrix"]
        rows[0]["goal"], rows[2]["goal"] = rows[2]["goal"], rows[0]["goal"]

    instance, _ = loaded("16", swap)
    assert [place[:2] for place in at(instance, "goal")] == [(140.0, 45.0), (75.0, -85.0), (110.0, -25.0)]

    def drop(scenario: Json) -> None:
        del scenario["taskMatrix"][0]

    instance, notes = loaded("16", drop)
    assert [entity.label for entity in instance.entities if entity.group == "uav"] == ["U-02", "U-03", "U-01"]
    assert len(at(instance, "goal")) == 2 and "no goal belongs to 'drone1'" in notes


def test_goals_that_are_not_assigned_to_uavs_are_an_error() -> None:
    def drop_a_uav(scenario: Json) -> None:
        listed(scenario, "droneEntityList").pop()

    with pytest.raises(MissionError, match="holds 3 goals for 2 UAVs, and nothing assigns them"):
        loaded("16", drop_a_uav)


def test_a_single_goal_applies_to_every_uav() -> None:
    def keep_one_row(scenario: Json) -> None:
        del scenario["taskMatrix"][1:]
        scenario["taskMatrix"][0]["goal"] = "Fly to the goal."

    instance, notes = loaded("16", keep_one_row)
    assert len(at(instance, "goal")) == 3 and len(set(at(instance, "goal"))) == 1
    assert "one goal for 3 UAVs: each flies there" in notes


@pytest.mark.parametrize(("task", "mission"), [("bridge", "bi_fleet"), ("deliverytask", "goals"), ("", "goals")])
def test_the_task_type_of_a_document_with_goals_selects_the_template(task: str, mission: str) -> None:
    assert loaded("16", lambda scenario: scenario.update(task_type=task))[0].mission == mission


# -- inferred values ---------------------------------------------------------------------------------------------------


def test_coordinates_are_read_as_metres_if_bodies_would_overlap_in_centimetres() -> None:
    instance, notes = loaded("13")
    assert at(instance, "truck") == [(-25.0, 0.0, 0.0), (-25.0, -12.0, 0.0)] and "are read as metres" in notes
    for edit in (
        lambda scenario: scenario.update(lingjing={"unit": "cm"}),
        lambda scenario: state(scenario).update(coordinate_system="UE_XYZ_cm"),
    ):
        instance, notes = loaded("13", edit)
        assert at(instance, "truck")[1] == (-0.25, -0.12, 0.0) and "are read as metres" not in notes
    with pytest.raises(MissionError, match="says centimetres, 'lingjing' metres"):
        loaded("13", lambda s: (s.update(lingjing={"unit": "m"}), state(s).update(coordinate_system="UE_XYZ_cm")))


def test_a_unit_that_contradicts_the_inferred_unit_is_an_error() -> None:
    loaded("13", lambda scenario: state(scenario).update(unit="m"))
    with pytest.raises(MissionError, match="says 'm', and X, Y and Z are read in centimetres") as raised:
        loaded("16", lambda scenario: state(scenario).update(unit="m"))
    assert raised.value.hint and '{"unit": "m"}' in raised.value.hint


@pytest.mark.parametrize("unit", ["cm", "m"])
def test_the_document_must_state_the_unit_if_both_units_are_plausible(unit: str) -> None:
    def alone(scenario: Json) -> None:
        listed(scenario, "autoVehicleEntityList").pop()

    with pytest.raises(MissionError, match="X and Y may be centimetres or metres") as raised:
        loaded("13", alone)
    assert raised.value.hint and '{"unit": "m"}' in raised.value.hint
    instance, notes = loaded("13", lambda scenario: (alone(scenario), scenario.update(lingjing={"unit": unit})))
    assert at(instance, "truck")[0][:2] == ((-25.0, 0.0) if unit == "m" else (-0.25, 0.0))
    assert "read as metres" not in notes
    instance, _ = loaded("13", lambda scenario: (alone(scenario), state(scenario).update(coordinate_system="local_m")))
    assert at(instance, "truck")[0][:2] == (-25.0, 0.0)


def test_close_bodies_do_not_imply_metres() -> None:
    """Dogs 40 cm apart, and heights of 2.4 km below everything: no scene is as large in metres."""
    instance, notes = loaded("06")
    assert at(instance, "dog")[1][0] - at(instance, "dog")[0][0] == pytest.approx(0.4)
    assert "read as metres" not in notes


def test_a_yaw_is_used_instead_of_a_placeholder() -> None:
    instance, notes = loaded("01")
    (uav,) = (entity for entity in instance.entities if entity.group == "uav")
    assert uav.heading_deg == 180.0 and "yaw, raw disagree; yaw is used" in notes
    instance, notes = loaded("01", lambda scenario: listed(scenario, "droneEntityList")[0].update(raw=10.0))
    assert instance.entities[-1].heading_deg == 10.0 and "raw, yaw disagree; raw is used" in notes


def test_run_prints_the_notes_that_compile_prints(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = str(FILES["13"])
    assert run_command(["compile", path]) == ExitCode.OK
    notes = [line for line in capsys.readouterr().err.splitlines() if line.startswith("note: ")]
    assert any("are read as metres" in note for note in notes)
    assert run_command(["run", path, "--policy", "nobody", "-o", str(tmp_path / "out")]) == ExitCode.USAGE
    assert [line for line in capsys.readouterr().err.splitlines() if line.startswith("note: ")] == notes


def test_delivery_points_of_several_rows_are_goals_and_those_of_one_row_are_shared() -> None:
    def deliver(scenario: Json) -> None:
        for row in scenario["taskMatrix"]:
            row["initial_state"]["delivery_point"] = row["initial_state"].pop("goalPosition")

    def in_one_row(scenario: Json) -> None:
        deliver(scenario)
        points = [row["initial_state"]["delivery_point"] for row in scenario["taskMatrix"]]
        del scenario["taskMatrix"][1:]
        state(scenario)["delivery_point"] = points

    for task in ("", "deliverytask"):
        instance, _ = loaded("16", lambda scenario, task=task: (deliver(scenario), scenario.update(task_type=task)))
        assert instance.mission == "goals" and len(at(instance, "goal")) == 3
        instance, _ = loaded("16", lambda scenario, task=task: (in_one_row(scenario), scenario.update(task_type=task)))
        assert instance.mission == "air_delivery" and len(at(instance, "point")) == 3


def test_a_goal_is_read_as_a_leak_or_a_fracture_only_if_the_document_names_one() -> None:
    def with_dog(scenario: Json, goal: str = "Go to the goal.") -> None:
        dog = {"equipmentCode": "D", "data": {"X": 500.0, "Y": 0.0}}
        scenario["equipmentList"]["unmannedDogEntityList"] = [dog]
        scenario["taskMatrix"][0]["goal"] = goal

    assert loaded("11", with_dog)[0].mission != "upr"
    assert loaded("11", lambda scenario: with_dog(scenario, "Find the leak and seal it."))[0].mission == "upr"
    instance, notes = loaded("16", lambda scenario: scenario.update(task_type="bridge"))
    assert "the first of 3 rows is played, with the hidden places of the others" in notes
    assert len(at(instance, "fracture")) == 3


@pytest.mark.parametrize(
    ("name", "settings"),
    [
        ("free", {"dogs": 2, "cars": 1, "planes": 1, "satellites": 1}),
        ("free_sea", {"uavs": 2}),
        ("goals", {"goals": 1}),
    ],
)
def test_emitted_templates_are_read_as_the_same_instance(name: str, settings: dict[str, float]) -> None:
    again, _ = read(emit(TEMPLATES(name), seed=1, settings=settings), "w.json", TEMPLATES)
    assert instantiate(again, seed=1) == instantiate(TEMPLATES(name), seed=1, settings=settings)


def test_heights_above_a_plateau_are_relative_to_the_ground() -> None:
    def lift(scenario: Json) -> None:
        for k, drone in enumerate(listed(scenario, "droneEntityList")):
            drone["data"] = {"lon": 109.94 + 0.001 * k, "lat": 39.83, "alt": 1342.0 + k}

    instance, notes = loaded("05", lambda scenario: (lift(scenario), state(scenario).clear()))
    assert [place[2] for place in at(instance, "uav")] == [float(k) for k in range(10)]
    assert "heights begin at 1342 m" in notes


@pytest.mark.parametrize("number", ["10", "11", "16"])
def test_the_heuristic_wins_a_document(number: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The heuristic wins, and the notes are printed again. The longest document is in `tests/episodes`."""
    arguments = ["run", str(FILES[number]), "--seed", "1", "--no-overview", "-o", str(tmp_path / "out")]
    assert run_command(arguments) == ExitCode.OK
    output = capsys.readouterr()
    assert "success: yes" in output.out and f"note: template '{MISSIONS[number]}'" in output.err


@pytest.mark.study  # minutes each
@pytest.mark.parametrize("number", [number for number in MISSIONS if number not in ("06", "10", "11", "16")])
def test_the_oracle_wins_a_document(number: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ["run", str(FILES[number]), "--seed", "1", "--policy", "oracle", "--no-overview"]
    assert run_command([*arguments, "-o", str(tmp_path / "out")]) == ExitCode.OK
    assert "success: yes" in capsys.readouterr().out


def test_a_dog_that_waits_for_a_vehicle_begins_beside_the_road() -> None:
    """Document 04 places its dog on the street that its van comes along, 38 m before the stop."""
    instance, _ = loaded("04")
    placed, city = CityBuilder(PluginHost()).place(instance, imported=True)
    dog, van = (next(entity for entity in placed.entities if entity.id == name) for name in ("dog", "van"))
    lanes = [lane for road in city.roads for lane in road.lanes if lane.kind == "car"]
    off_m = min(project(lane.shape, *dog.position[:2]).off_m - lane.width_m / 2.0 for lane in lanes)
    assert 0.4 < off_m < 10.0 and math.dist(dog.position[:2], (-71.0, 203.0)) < 10.0
    assert math.dist(van.position[:2], (-1935.0, -472.0)) < 50.0


def test_a_row_may_have_several_goals_or_none() -> None:
    def listed_in_one(scenario: Json) -> None:
        goals = [row["initial_state"]["goalPosition"] for row in scenario["taskMatrix"]]
        del scenario["taskMatrix"][1:]
        state(scenario)["goalPosition"] = goals

    def second(value: object) -> Edit:
        return lambda scenario: scenario["taskMatrix"][1]["initial_state"].update(goalPosition=value)

    assert at(loaded("16", listed_in_one)[0], "goal") == at(loaded("16")[0], "goal")
    instance, notes = loaded("16", second({"status": "pending"}))
    assert len(at(instance, "goal")) == 2 and "no goal belongs to 'drone2'" in notes
    with pytest.raises(MissionError, match=r"taskMatrix\[1\].initial_state.goalPosition: a place"):
        loaded("16", second("over there"))


def test_places_beyond_every_scene_are_reported_as_outside_of_the_scene(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    whole = json.loads(FILES["06"].read_text(encoding="utf-8"))
    for dog in listed(whole, "unmannedDogEntityList"):
        dog["data"]["X"] += 20_000_000.0
    file = tmp_path / "w.json"
    file.write_text(json.dumps(whole), encoding="utf-8")
    assert run_command(["validate", str(file)]) == ExitCode.MISSION
    assert "outside of the scene" in capsys.readouterr().out
