"""resetScenario documents in: the paper's Listing, its axes, templates, notes and faults."""

import copy
import json
import statistics
from collections.abc import Callable
from pathlib import Path
from typing import Any

import jsonschema
import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from lingjing.errors import LingjingError, MissionError, UsageError
from lingjing.mission import document, frames, geometry2d
from lingjing.mission.instance import Entity, Instance
from lingjing.mission.reset.reading import instantiate_document
from lingjing.mission.weather_words import SKIES, sky_of, word_for
from lingjing.plugins.geometry import bearing_deg
from lingjing.testing import declarations as m
from lingjing.testing import expressions as ex
from lingjing.testing import instantiate

ROOT = Path(__file__).resolve().parents[2]
LISTING = (ROOT / "scenarios" / "reset" / "ssr-001.json").read_text(encoding="utf-8")


Edit = Callable[[dict[str, Any]], object]


def edited(edit: Edit) -> str:
    """The Listing with a change made to its scenario."""
    whole = json.loads(LISTING)
    edit(whole["scenario"])
    return json.dumps(whole)


def state(scenario: dict[str, Any]) -> dict[str, Any]:
    initial: dict[str, Any] = scenario["taskMatrix"][0]["initial_state"]
    return initial


def read(ssr: m.Mission, text: str) -> tuple[m.Mission, tuple[str, ...]]:
    return instantiate_document(text, "s.json", {"ssr": ssr}.__getitem__)


def entity(instance: Instance, name: str) -> Entity:
    return next(entity for entity in instance.entities if entity.id == name)


def test_the_listing_has_exactly_the_numbers_of_the_paper() -> None:
    whole = json.loads(LISTING)
    drones = whole["scenario"]["equipmentList"]["droneEntityList"]
    assert whole["taskId"] == "multiagentstasks_test_001"
    assert [tuple(d["data"].values()) for d in drones] == [
        *((30660.0, 62020.0, 112.0), (31000.0, 59010.0, 112.0), (27870.0, 59010.0, 112.0))
    ]
    assert [(corner["X"], corner["Y"]) for corner in state(whole["scenario"])["rescueRange"]] == [
        *((66510.0, 108110.0), (-12370.0, 110050.0), (-12370.0, 75020.0), (66510.0, 75490.0))
    ]
    assert '"X": 30660.0' in LISTING and '"heading": 30.0' in LISTING and '"uav_count": 3' in LISTING
    jsonschema.validate(whole, msgspec.json.decode(document.schemas()["reset-scenario.schema.json"]))


def test_the_listing_instantiates_the_sea_rescue(ssr: m.Mission) -> None:
    mission, notes = read(ssr, LISTING)
    assert notes == ("template 'ssr': recognised by rescuePersonPosition, shipEntityList and droneEntityList",)
    assert mission.origin.document == LISTING and mission.origin.file == "s.json"
    assert mission.title == mission.goal == "UAV tracks vessel for person rescue"
    instance = instantiate(mission, seed=5)
    assert [(e.id, e.label, e.position) for e in instance.entities] == [
        ("victim[1]", "PERSON-001", (319.2, -963.2, -3.5)),
        ("uav[1]", "UAV-MA-001", (306.6, -620.2, 1.12)),
        ("uav[2]", "UAV-MA-002", (310.0, -590.1, 1.12)),
        ("uav[3]", "UAV-MA-003", (278.7, -590.1, 1.12)),
        ("boat", "Ship-001", (12.4, -1351.8, -3.5)),
    ]
    assert entity(instance, "victim[1]").hidden == ("position",), "what was hidden stays hidden"
    assert entity(instance, "boat").heading_deg == 30.0
    assert instance.settings["uavs"] == 3.0 and instance.settings["victims"] == 1.0
    assert instance.rules == ssr.rules and instance.budget == instantiate(ssr).budget
    assert document.decode(document.encode(mission), "m.json") == mission


def test_the_search_area_bears_31_degrees_from_the_lifeboat_that_heads_30(ssr: m.Mission) -> None:
    # East = X/100 and north = -Y/100 prove themselves here: every other mapping of the axes misses.
    instance = instantiate(read(ssr, LISTING)[0])
    boat, polygon = entity(instance, "boat"), instance.regions[0].polygon
    corners = tuple(statistics.fmean(values) for values in zip(*polygon, strict=True))
    assert bearing_deg(boat.position[:2], (corners[0], corners[1])) == pytest.approx(31.0, abs=0.05)
    assert bearing_deg(boat.position[:2], geometry2d.centroid(polygon)) == pytest.approx(31.0, abs=0.5)
    assert boat.heading_deg == 30.0


def test_uavs_beyond_the_listed_ones_are_placed_by_the_template(ssr: m.Mission) -> None:
    mission, _ = read(ssr, LISTING)
    more = instantiate(mission, settings={"uavs": 5})
    assert more.entities[:4] == instantiate(mission).entities[:4]
    assert entity(more, "uav[4]").position == (314.6, -620.2, 1.12)
    with pytest.raises(UsageError, match=r"victims = 2 is outside of its range 1\.\.1"):
        instantiate(mission, settings={"victims": 2})


def test_a_scenario_without_its_envelope_gives_the_same_instance(ssr: m.Mission) -> None:
    bare = json.dumps(json.loads(LISTING)["scenario"])
    assert instantiate(read(ssr, bare)[0]) == instantiate(read(ssr, LISTING)[0])
    assert instantiate(read(ssr, "\ufeff" + bare)[0]).mission == "ssr"


def test_geodetic_places_and_unreal_yaw_are_converted(ssr: m.Mission) -> None:
    latitude, longitude = frames.to_geodetic(12.4, -1351.8, (31.0, 121.5))

    def relocate(scenario: dict[str, Any]) -> None:
        ship = scenario["equipmentList"]["shipEntityList"][0]
        del ship["heading"]
        ship |= {"yaw": -60.0, "data": {"lon": longitude, "lat": latitude, "alt": -3.5}}

    boat = entity(instantiate(read(ssr, edited(relocate))[0]), "boat")
    assert boat.position == pytest.approx((12.4, -1351.8, -3.5), abs=1e-4)
    assert boat.heading_deg == pytest.approx(30.0)


def test_different_headings_are_assigned_to_their_entities(ssr: m.Mission) -> None:
    def turn(scenario: dict[str, Any]) -> None:
        for k, drone in enumerate(scenario["equipmentList"]["droneEntityList"]):
            drone["raw"] = 10.0 * k

    instance = instantiate(read(ssr, edited(turn))[0])
    assert [entity(instance, f"uav[{k}]").heading_deg for k in (1, 2, 3)] == [0.0, 10.0, 20.0]


def test_a_place_without_height_stands_on_the_datum(ssr: m.Mission) -> None:
    mission, _ = read(ssr, edited(lambda s: s["equipmentList"]["shipEntityList"][0]["data"].pop("Z")))
    assert entity(instantiate(mission), "boat").position == (12.4, -1351.8, -3.5)


@pytest.mark.parametrize(
    ("edit", "note"),
    [
        (lambda s: s.update(lingjing={"mission": "ssr"}), "named by 'lingjing'"),
        (lambda s: s.update(taskType="Sea rescue"), "named by taskType 'Sea rescue'"),
        (lambda s: s["taskMatrix"][0].update(task_type="SSR"), "named by task_type 'SSR'"),
        (lambda s: s.update(taskType="Tea"), "recognised by rescuePersonPosition, shipEntityList and droneEntityList"),
        (lambda s: s.update(taskType="Tea"), "(taskType 'Tea' is not known)"),
        (lambda s: state(s).update(uav_count=4), "uav_count says 4, the list has 3: the list is used"),
        (lambda s: state(s).update(weather="Meatballs"), "'Meatballs' is not understood and kept"),
        (lambda s: state(s).update(weather="大雾"), "sets visibility 500 m, cloud 0.9"),
        (lambda s: state(s).pop("rescueRange"), "rescueRange: is missing or empty; the template's region 'search'"),
        (
            lambda s: state(s)["rescuePersonPosition"][0].update(X=0.0, Y=0.0),
            "rescuePersonPosition[0]: lies outside of rescueRange",
        ),
        (
            lambda s: s["equipmentList"].update(unmannedDogEntityList=s["equipmentList"]["shipEntityList"]),
            "unmannedDogEntityList: mission 'ssr' has no quadruped; 1 kept, not played",
        ),
        (
            lambda s: s["equipmentList"].update(satelliteEntityList=[{"equipmentCode": "SAT-1", "tle1": "1 25544U"}]),
            "satelliteEntityList: mission 'ssr' has no satellite; 1 kept, not played",
        ),
        (
            lambda s: s["equipmentList"].update(droneEntityList=s["equipmentList"]["droneEntityList"] * 4),
            "droneEntityList: holds 12, more than the 10 of mission 'ssr'",
        ),
        (
            lambda s: s["equipmentList"]["droneEntityList"][1].update(equipmentCode="UAV-MA-001"),
            "an equipmentCode is repeated",
        ),
        (lambda s: s["taskMatrix"].append(copy.deepcopy(s["taskMatrix"][0])), "the first of 2 rows is played"),
    ],
)
def test_decisions_and_ignored_fields_are_noted(ssr: m.Mission, edit: Edit, note: str) -> None:
    mission, notes = read(ssr, edited(edit))
    assert any(note in line for line in notes), notes
    assert instantiate(mission).mission == "ssr"


def test_targets_that_the_template_places_are_noted(ssr: m.Mission) -> None:
    """Hidden and public targets, with a field that is empty, missing or unknown."""
    public = replace(
        ssr,
        groups=tuple(
            replace(g, properties=tuple(replace(p, hidden=False) if p.name == "position" else p for p in g.properties))
            for g in ssr.groups
        ),
    )
    for template in (ssr, public):
        for edit, note in (
            (lambda s: state(s).update(rescuePersonPosition=[]), "rescuePersonPosition: is empty; the template places"),
            (lambda s: state(s).pop("rescuePersonPosition"), "initial_state: does not place 'victim'; the template"),
        ):
            text = edited(lambda s, edit=edit: (s.update(taskType="ssr"), edit(s)))
            assert sum(note in line for line in read(template, text)[1]) == 1


def test_places_without_a_matching_target_are_an_error_or_a_note(ssr: m.Mission) -> None:
    def swap(scenario: dict[str, Any]) -> None:
        state(scenario)["goalDelPosition"] = state(scenario).pop("rescuePersonPosition")

    with pytest.raises(
        MissionError, match=r"mission 'ssr' has no delivery_point or delivery_door; its entries .1. would be ign"
    ):
        read(ssr, edited(lambda s: (s.update(taskType="ssr"), swap(s))))
    _, notes = read(ssr, edited(lambda s: (s.update(lingjing={"mission": "ssr"}), swap(s))))
    assert any("has no delivery_point or delivery_door; 1 kept, not played" in note for note in notes)


def test_a_weather_word_changes_only_contradicting_values(ssr: m.Mission) -> None:
    clear, foggy = (read(ssr, edited(lambda s, w=w: state(s).update(weather=w)))[0] for w in ("clear", "Fog"))  # type: ignore[misc]
    assert clear.weather == ssr.weather
    weather = instantiate(foggy).weather
    assert weather.visibility_m == 500 and weather.cloud == 0.9
    assert weather.wave_height_m == instantiate(ssr).weather.wave_height_m, "draws of other properties stay"


@given(st.floats(1, 50_000), st.floats(0, 1))
def test_every_visibility_and_cloud_cover_has_a_weather_word_that_fits(visibility_m: float, cloud: float) -> None:
    sky = sky_of(word_for(visibility_m, cloud))
    assert sky is not None and sky.fits(visibility_m, cloud)


def test_typical_values_fit_their_word() -> None:
    assert all(sky.fits(sky.typical_visibility_m, sky.typical_cloud) for sky in SKIES)


def test_the_document_sets_the_settings_and_the_mode(ssr: m.Mission) -> None:
    extra = {"mission": "ssr", "mode": "star", "settings": {"altitude": 120}}
    instance = instantiate(read(ssr, edited(lambda s: s.update(lingjing=extra)))[0])
    assert instance.mode == "star" and instance.settings["altitude"] == 120.0


LISTS = "$.scenario.equipmentList"
STATE = "$.scenario.taskMatrix[0].initial_state"
FAULTS: list[tuple[Edit, str]] = [
    (lambda s: s.pop("equipmentList"), "$.scenario: 'equipmentList' is missing"),
    (lambda s: s.pop("taskMatrix"), "$.scenario: 'taskMatrix' is missing"),
    (lambda s: s.update(taskMatrix=[]), "$.scenario.taskMatrix: is empty"),
    (lambda s: s["equipmentList"].pop("shipEntityList"), "no template fits"),
    (
        lambda s: (s.update(taskType="ssr"), s["equipmentList"].pop("shipEntityList")),
        f"{LISTS}.shipEntityList: is missing or empty, mission 'ssr' needs a boat",
    ),
    (
        lambda s: (s.update(taskType="ssr"), s["equipmentList"].pop("droneEntityList")),
        f"{LISTS}.droneEntityList: is missing or empty, mission 'ssr' needs a uav",
    ),
    (
        lambda s: s["equipmentList"]["droneEntityList"][1]["data"].update(X="31000"),
        f"{LISTS}.droneEntityList[1].data.X: a number is due, this is the text '31000'",
    ),
    (
        lambda s: s["equipmentList"]["droneEntityList"][1]["data"].update(X=True),
        f"{LISTS}.droneEntityList[1].data.X: a number is due, this is true",
    ),
    (
        lambda s: s["equipmentList"]["droneEntityList"][2].update(data={"X": 1.0}),
        f"{LISTS}.droneEntityList[2].data: has no place",
    ),
    (
        lambda s: s["equipmentList"]["droneEntityList"][2].pop("data"),
        f"{LISTS}.droneEntityList[2]: 'data' is missing",
    ),
    (
        lambda s: state(s)["rescuePersonPosition"][0].update(Y=float("nan")),
        f"{STATE}.rescuePersonPosition[0].Y: is NaN, not a finite number",
    ),
    (
        lambda s: s["equipmentList"]["shipEntityList"][0].update(heading=float("-inf")),
        f"{LISTS}.shipEntityList[0].heading: is infinite, not a finite number",
    ),
    (lambda s: state(s).update(rescueRange=state(s)["rescueRange"][:2]), f"{STATE}.rescueRange: the outline has 2"),
    (lambda s: state(s)["rescueRange"].insert(1, state(s)["rescueRange"].pop(2)), "crosses itself"),
    (lambda s: s.update(lingjing={"mission": "tea"}), "$.scenario.lingjing.mission: there is no template 'tea'"),
    (
        lambda s: s.update(lingjing={"mission": "ssr", "settings": {"uav": 3}}),
        "lingjing.settings.uav: mission 'ssr' has no param",
    ),
    (
        lambda s: s.update(lingjing={"mission": "ssr", "policy": "oracle"}),
        "$.scenario.lingjing: unknown field 'policy'",
    ),
    (
        lambda s: state(s)["rescuePersonPosition"].append(state(s)["rescuePersonPosition"][0]),
        f"{STATE}.rescuePersonPosition[1]: has the id 'PERSON-001' of {STATE}.rescuePersonPosition[0]",
    ),
    (
        lambda s: s.update(
            lingjing={"mission": "ssr", "targets": {"victim": [{"id": 7, "X": 1, "Y": 1}, {"id": "7", "X": 2, "Y": 1}]}}
        ),
        "$.scenario.lingjing.targets.victim[1]: has the id '7'",
    ),
    (
        lambda s: s["equipmentList"]["droneEntityList"][0]["data"].update(Z=-243100.0),
        f"{LISTS}.droneEntityList[0].data: (306.6 m, -620.2 m, -2431 m) is no place",
    ),
    (
        lambda s: state(s)["rescuePersonPosition"][0].update(Z=9.9e7),
        f"{STATE}.rescuePersonPosition[0]: (319.2 m, -963.2 m, 990000 m) is no place",
    ),
    (lambda s: s.update(commandType="moveTo"), "$.scenario.commandType: 'moveTo' is not known, 'resetScenario' is"),
]


@pytest.mark.parametrize(("edit", "words"), FAULTS)
def test_errors_of_a_scenario_name_the_path_and_have_a_hint(ssr: m.Mission, edit: Edit, words: str) -> None:
    with pytest.raises(MissionError) as caught:
        read(ssr, edited(edit))
    assert str(caught.value).startswith("s.json: ") and words in str(caught.value)
    assert caught.value.hint


@pytest.mark.parametrize(
    ("text", "error", "words"),
    [
        ("", UsageError, "s.json:1:1: not JSON"),
        (LISTING[:400], UsageError, "s.json:1"),
        (LISTING.replace("30660.0", "30660,0"), UsageError, "s.json:15:24: not JSON"),
        (LISTING.replace("30660.0", "1e999"), MissionError, "droneEntityList[0].data.X: is infinite"),
        ("x" * 10_000_000, UsageError, "s.json:1:1: not JSON"),
        ("[]", MissionError, "$ is not a resetScenario"),
        ('{"type": "FeatureCollection"}', MissionError, "neither 'scenario' nor 'equipmentList'"),
        ('{"scenario": 3}', MissionError, "$.scenario: an object is due, this is the number 3"),
        ('{"scenario":' * 50_000, UsageError, "nested too deeply"),
    ],
)
def test_unreadable_text_gives_one_short_error_message(
    ssr: m.Mission, text: str, error: type[LingjingError], words: str
) -> None:
    with pytest.raises(error) as caught:
        read(ssr, text)
    assert words in str(caught.value) and len(str(caught.value)) < 300 and caught.value.hint


@given(
    st.recursive(
        st.none() | st.booleans() | st.floats() | st.text(), lambda x: st.lists(x) | st.dictionaries(st.text(), x)
    )
)
def test_any_json_value_gives_an_error_message(ssr: m.Mission, value: object) -> None:
    for whole in (value, {"scenario": value}, {"equipmentList": value, "taskMatrix": value}):
        with pytest.raises(LingjingError):
            read(ssr, json.dumps(whole))


def test_the_schema_requires_a_place_of_every_entity_except_satellites() -> None:
    validator = jsonschema.Draft202012Validator(msgspec.json.decode(document.schemas()["reset-scenario.schema.json"]))
    orbit = [{"equipmentCode": "SAT-1", "tle1": "1 25544U", "tle2": "2 25544"}]
    assert validator.is_valid(json.loads(edited(lambda s: s["equipmentList"].update(satelliteEntityList=orbit))))
    assert not validator.is_valid(json.loads(edited(lambda s: state(s)["rescuePersonPosition"][0].pop("Y"))))
    assert not validator.is_valid(json.loads(edited(lambda s: s["equipmentList"].update(shipEntityList=orbit))))


def test_a_template_without_a_count_parameter_uses_the_count_of_the_document(ssr: m.Mission) -> None:
    fixed = replace(
        ssr,
        parameters=ssr.parameters[2:],
        groups=tuple(replace(g, count=ex.Number(2.0)) if g.count else g for g in ssr.groups),
        agents=ssr.agents[1:],
    )
    instance = instantiate(read(fixed, LISTING)[0])
    assert len([e for e in instance.entities if e.group == "uav"]) == 3
