"""A mission that passes validation runs: errors of playing it are reported by the compiler, at their declarations."""

from __future__ import annotations

import itertools
from pathlib import Path
from pkgutil import resolve_name
from typing import Any

import msgspec
import pytest

from lingjing.dsl.printing.printer import to_ljs
from lingjing.errors import LingjingError
from lingjing.mission.instance import Entity, Instance, SceneSpec
from lingjing.mission.kinds import builtin_scenes, lacks, scene_faults
from lingjing.scene.anchor import anchor
from lingjing.scene.city import City
from lingjing.scene.districts import build
from lingjing.scene.districts.options import plan
from lingjing.testing import compile_file, compile_text, instantiate, mission_file

FAR = "subset([(0 m, 2 m), (1 m, 2 m), ({}, 0 m), (3 m, 2 m), (4 m, 2 m), (5 m, 2 m)])"
"""Possible places, one of which may be too far; seed 0 does not draw that place."""

# replaced text of the small mission, its replacement, code, line, column, a part of the message
CASES = [
    ("param uavs = 2 in 1..10", "param uavs = 7 in [1, 2]", "LJ0206", 13, 16, "none of the values allowed"),
    ("ticks <= 60", "ticks <= 5.5", "LJ0206", 10, 21, "counts in whole numbers, this is 5.5"),
    ("ticks <= 60", "ticks <= uavs / 4", "LJ0206", 10, 21, "this is 0.5"),
    ("done when rescued(v)", "done when rescued(v), ticks <= 2.5", "LJ0206", 36, 66, "whole numbers"),
    ("delay = 1 tick", "delay = 1.5 tick", "LJ0206", 12, 54, "whole numbers"),
    ("distance_xy(boat, v)", "distance_xy(boat, victim[9])", "LJ0206", 34, 88, "`victim` has 3 members, there is no 9"),
    ("distance_xy(boat, v)", "distance_xy(uav[11], v)", "LJ0206", 34, 79, "`uav` has 10 members, there is no 11"),
    ("distance_xy(boat, v)", "distance_xy(boat, victim[3/2])", "LJ0201", 34, 88, "members are counted 1, 2, 3"),
    ("  asset boat", "  event e at 9 tick { vanish victim[4] }\n  asset boat", "LJ0206", 26, 37, "there is no 4"),
    ("position = (12.4 m, -51.8 m)", "position = uav[1].position", "LJ0507", 26, 27, "before the mission runs"),
    ("lifeboat {", "lifeboat when mode == star {", "LJ0507", 27, 9, "in broadcast mode, there is no entity 'boat'"),
    ("(1 m, 2 m), (3 m, 4 m)], spread 8 m", "(1 m, 2 m)]", "LJ0507", 22, 5, "member 2 has no place"),
    ("  param alt", "  sweep all over uavs in [1, 5]\n  param alt", "LJ0507", 23, 5, "with uavs = 5, m"),
    (
        "speed <= 3 m/s }",
        "speed ~ choice([3 m/s, 2 m/s, 4 m/s, 5 m/s, 6 m/s, -1 m/s]) }",
        "LJ0507", 26, 75, "`speed` can be -1",
    ),
    ("speed <= 3 m/s }", "speed ~ uniform(-1 m/s, 3 m/s) }", "LJ0507", 26, 75, "`speed` can be -1"),
    ("speed <= 3 m/s }", "speed <= 3 m/s, on = water }", "LJ0109", 26, 96, "`on` cannot be `water`"),
    ("speed <= 3 m/s }", "speed <= 3 m/s, on = road }", "LJ0509", 26, 91, "the scene `bay` has none"),
    ("bay {", "coastal { pipeline = [(0 m, 0 m)],", "LJ0508", 8, 19, "no line of 2 or more points"),
    ("bay {", "residential { bridge = [(0 m, 0 m), (9 m, 0 m)],", "LJ0508", 8, 23, "has no `bridge`"),
    ("bay {", "bay { extent = 3 km,", "LJ0508", 8, 15, "has no option `extent`"),
    ("bay {", "commercial { deck = 2 m,", "LJ0508", 8, 22, "`deck` is 2.0"),
    ("~ sites(search, apart >= 10 m)", f"~ {FAR.format('uavs * 1e6 m')}", "LJ0211", 19, 23, "is beyond every scene"),
    ("  param alt", "  sweep all over uavs in [1, 2]\n  stage spare { done when uav[2].heading > 0 deg }\n  param alt",
        "LJ0507", 15, 9, "with uavs = 1, `spare` refers to `uav[2]`, and `uav` has 1 member"),
    ("at(i, [", "at(1e15, [", "LJ0507", 22, 5, "counts from 1 to 100,000"),
    ("policy <= 90 s", "policy <= 1e15 s", "LJ0206", 10, 35, "at most 86400 s"),
    ("bay {", "campus { traffic = 1e12,", "LJ0508", 8, 18, "`traffic` is 1000000000000.0"),
    ("speed <= 3 m/s }", "speed = -3 m/s }", "LJ0507", 26, 75, "`speed` is -3"),
    ("    camera nadir", "    endurance = 0 s\n    camera nadir", "LJ0507", 23, 5, "`endurance` is 0"),
    ("bay {", "map {", "LJ0508", 8, 9, "names no map"),
    ("bay { datum = sea level at -3.5 m", "city { datum = 0 m", "LJ0508", 8, 16, "flood"),
]  # fmt: skip


@pytest.mark.parametrize(("old", "new", "code", "line", "column", "part"), CASES, ids=lambda value: str(value)[:30])
def test_errors_of_playing_are_reported(
    small: str, old: str, new: str, code: str, line: int, column: int, part: str
) -> None:
    text = small.replace(", spread 8 m", "") if "sweep" in new else small
    diagnostics = compile_text(text.replace(old, new, 1)).diagnostics
    assert [(item.code, item.span.line, item.span.column) for item in diagnostics] == [(code, line, column)]
    assert part in diagnostics[0].message


CASTAWAYS = mission_file("examples/castaways").read_text(encoding="utf-8")
"""Two to four people at sea; a requirement bounds their distance to the boat by a drawn param."""


@pytest.mark.parametrize(
    ("places", "fits"),
    [
        ("sites(search, apart >= 200 m)", False),
        ("sites(search, apart >= 90 m)", True),
        ("sites_along([(-150 m, -1400 m), (150 m, -1400 m)], apart >= 74.8 m)", False),
        ("sites_along([(-150 m, -1400 m), (150 m, -1400 m)], apart >= 30 m)", True),
    ],
)
def test_crowded_places_are_drawn_with_further_seeds(places: str, fits: bool) -> None:
    text = CASTAWAYS.replace("sites(search, apart >= 40 m)", places).replace("integer(2, 4)", "integer(4, 4)")
    errors = [item for item in compile_text(text).diagnostics if item.severity == "error"]
    assert [item.code for item in errors] == ([] if fits else ["LJ0507"])
    assert fits or "apart do not fit" in errors[0].message
    assert fits or "along" in places or "with seed " in errors[0].message


@pytest.mark.parametrize(
    ("people", "places"),
    [
        ("integer(1, 14)", "sites(search, apart >= 95 m)"),
        ("integer(3, 3)", f"sites_along([{', '.join(['(-50 m, -1300 m), (50 m, -1300 m)'] * 5)}], apart >= 45 m)"),
    ],
    ids=["a number that each seed draws", "a line that turns back"],
)
def test_places_that_seed_0_does_not_show_to_be_crowded_are_drawn_with_further_seeds(people: str, places: str) -> None:
    text = "\n".join(line for line in CASTAWAYS.splitlines() if not line.lstrip().startswith("require"))
    text = text.replace("sites(search, apart >= 40 m)", places).replace("integer(2, 4)", people)
    (error,) = [item for item in compile_text(text).diagnostics if item.severity == "error"]
    assert error.code == "LJ0507" and "with seed " in error.message and "do not fit" in error.message


def test_further_seeds_of_a_large_mission_are_drawn_for_its_first_settings(monkeypatch: pytest.MonkeyPatch) -> None:
    drawn: list[tuple[int, float]] = []
    make = resolve_name("lingjing.mission.trial:instantiate")

    def noted(mission: object, **options: Any) -> Instance:
        drawn.append((options.get("seed", 0), options["settings"].get("people", 0.0)))
        instance: Instance = make(mission, **options)
        return instance

    monkeypatch.setattr("lingjing.mission.trial.instantiate", noted)
    text = "\n".join(line for line in CASTAWAYS.splitlines() if not line.lstrip().startswith("require"))
    text = text.replace("hidden people ~ integer(2, 4)", "people = 4 in 1..9").replace("apart >= 40 m", "apart >= 95 m")
    text = text.replace("  mode broadcast\n", "  mode broadcast\n  sweep crowd over people in [5, 6]\n")
    for most, further in ((40_000, {5.0, 6.0}), (110, {5.0}), (0, set())):
        drawn.clear()
        monkeypatch.setattr("lingjing.mission.trial._MOST_FURTHER", most)
        assert compile_text(text).diagnostics == ()
        assert {people for seed, people in drawn if seed and people} == further
        assert {seed for seed, people in drawn if not people} == set(range(10)), "the usual setting is always tried"


@pytest.mark.parametrize(("clear_m", "fits"), [(112, True), (118, False)])
def test_places_with_a_wide_edge_are_drawn_with_further_seeds(clear_m: int, fits: bool) -> None:
    places = f"sites(search, apart >= 40 m, clear >= {clear_m} m)"
    text = CASTAWAYS.replace("sites(search, apart >= 40 m)", places).replace("integer(2, 4)", "integer(4, 4)")
    errors = [
        item for item in compile_text(text.replace("  require", "  # require")).diagnostics if item.code == "LJ0507"
    ]
    assert [error.message[:14] for error in errors] == ([] if fits else ["with seed 7, 4"])


def test_a_requirement_that_seed_0_meets_is_tried_with_further_seeds() -> None:
    text = CASTAWAYS.replace("uniform(60 m, 120 m)", "uniform(60 m, 270 m)")
    (error,) = [item for item in compile_text(text).diagnostics if item.severity == "error"]
    assert error.code == "LJ0507" and "seed 1 meets the requirement in none of" in error.message
    assert text.splitlines()[error.span.line - 1].lstrip().startswith("require forall")


NEAREST = "  sweep far over reach in [60 m, 90 m]\n  param reach = 60 m in 10 m..500 m\n"
OTHER = "  sweep wide over other in [1, 2, 3]\n  param other = 1 in 1..3\n"


@pytest.mark.parametrize(("added", "instances"), [("", 10), (OTHER, 12), (NEAREST, 20)])
def test_further_seeds_are_tried_once_for_equal_draws(
    added: str, instances: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Ten seeds for the default settings. Other settings have seed 0 alone, unless the requirement reads them."""
    seeds: list[int] = []

    def counted(mission: object, *, seed: int = 0, **options: Any) -> Instance:
        seeds.append(seed)
        return instantiate(mission, seed=seed, **options)

    monkeypatch.setattr("lingjing.mission.trial.instantiate", counted)
    text = CASTAWAYS.replace("  mode ", f"{added}  mode ", 1)
    if added == NEAREST:
        text = text.replace("uniform(60 m, 120 m)", "uniform(reach, reach + 10 m)")
    assert not [item for item in compile_text(text).diagnostics if item.severity == "error"]
    assert len(seeds) == instances


def test_an_error_of_further_seeds_names_its_settings() -> None:
    text = CASTAWAYS.replace("  mode ", f"{NEAREST.replace('90 m', '150 m')}  mode ", 1)
    text = text.replace("uniform(60 m, 120 m)", "uniform(reach, reach + 10 m)")
    (error,) = [item for item in compile_text(text).diagnostics if item.severity == "error"]
    assert error.message.startswith("with reach = 150, seed 5 meets the requirement in none of")


def test_a_side_of_an_or_may_name_a_member_that_is_not_there(small: str) -> None:
    sweep = "  sweep all over uavs in [1, 2]\n"
    stage = "  stage spare { done when uavs < 2 or uav[2].heading > 0 deg }\n"
    text = small.replace("  param alt", f"{sweep}{stage}  param alt")
    assert not compile_text(text).diagnostics


def test_a_group_may_be_empty_by_its_param(small: str) -> None:
    text = small.replace("param uavs = 2 in 1..10", "param uavs = 2 in 1..10\n  param jams = 0 in 0..4")
    jam = "  target jam[1..jams] : person_in_water { position = at(i, [(5 m, 5 m)]) }\n"
    text = text.replace("  asset boat", f"{jam}  asset boat")
    assert not compile_text(text).diagnostics
    assert [item.code for item in compile_text(text.replace("1..jams", "1..0")).diagnostics] == ["LJ0206"]


@pytest.mark.parametrize(
    ("options", "column", "message"),
    [
        ('tle1 = "1 25544U", tle2 = "2 xyz"', 27, "line 1 of the elements is not 69 characters that begin with `1 `"),
        ('epoch = "yesterday"', 27, "`yesterday` is no epoch of a satellite"),
    ],
)
def test_a_satellite_with_faulty_orbital_data_is_an_error(small: str, options: str, column: int, message: str) -> None:
    text = small.replace("use std.sea", "use std.orbit { satellite }\nuse std.sea")
    text = text.replace("  asset boat", f"  asset eye : satellite {{ {options} }}\n  asset boat")
    diagnostics = [item for item in compile_text(text).diagnostics if message in item.message]
    assert [(item.code, item.span.line, item.span.column) for item in diagnostics] == [("LJ0507", 27, column)]


def test_more_entities_than_cameras_can_draw_are_refused(small: str) -> None:
    crowd = small.replace(
        "  asset boat", "  target rock[1..4100] : person_in_water { position = (0 m, 0 m) }\n  asset boat"
    )
    (diagnostic,) = [item for item in compile_text(crowd).diagnostics if "cameras to draw" in item.message]
    assert (diagnostic.code, diagnostic.severity) == ("LJ0507", "error")
    assert not [item for item in compile_text(crowd.replace("4100", "4000")).diagnostics if item.severity == "error"]


def test_a_place_that_only_a_sweep_puts_too_far_is_refused(small: str) -> None:
    far = small.replace("~ sites(search, apart >= 10 m)", f"~ {FAR.format('(uavs - 1) * 2e3 m')}")
    assert compile_text(far).diagnostics == ()
    swept = far.replace("  param alt", "  sweep all over uavs in [1, 4]\n  param alt")
    (diagnostic,) = compile_text(swept).diagnostics
    assert (diagnostic.code, diagnostic.span.line) == ("LJ0507", 20)
    assert "with uavs = 4, a place that `victim` may be drawn at is beyond the scene" in diagnostic.message


PLACES = [
    ("position = (600 m, 0 m), on = ground", "LJ0211", "outside of the scene, which spans 160 m to every side"),
    ("position ~ subset([(0 m, 0 m), (0 m, 161 m)])", "LJ0507", "may be drawn at is beyond the scene"),
    ("position ~ sites(wide)", "LJ0507", "may be drawn at is beyond the scene"),
    ("position = (170 m, 0 m), on = ground", "", ""),
    ("position ~ subset([(0 m, 0 m), (0 m, 159 m)])", "", ""),
]
TOWN = """ljs 1
use std.ground {{ robot_dog }}
mission walk "A walk" {{
  goal "Walk."
  scene residential {{ extent = 200 m, blocks = 2 by 2 }}
  clock {{ tick = 5 s, sync = 500 ms }}
  budget {{ ticks <= 300 }}
  region wide = box((-10 m, -10 m), (10 m, 300 m))
  asset dog : robot_dog {{ {} }}
  agent walker as walker controls dog {{ observes dog.*, events }}
  success when dog in wide
}}
"""


@pytest.mark.parametrize(("place", "code", "message"), PLACES)
def test_places_outside_of_a_town_give_the_error_of_building_it(place: str, code: str, message: str) -> None:
    compilation = compile_text(TOWN.format(place))
    diagnostics = compilation.diagnostics
    assert [item.code for item in diagnostics] == ([code] if code else []), diagnostics
    assert all(message in item.message for item in diagnostics)
    if code or compilation.mission is None:
        return
    for seed in range(4):
        instance = instantiate(compilation.mission, seed=seed)
        city = build(instance.scene)
        placed = anchor(instance, city)
        assert max(abs(metres) for metres in placed.entities[0].position[:2]) <= 160.0


def test_one_run_reports_every_declaration_that_cannot_be_evaluated() -> None:
    more = """
  asset cart : wagon { position = (0 m, 20 m), speed <= -3 m/s }
  asset pony : robot_dog { position = dog[1].position }
  grid cells over wide { shape = 1000 by 1000 }
  success when dog[1] in wide
"""
    text = TOWN.format("position = at(i, [(0 m, 0 m)]), endurance = 0 s").replace("asset dog", "asset dog[1..2]")
    text = text.replace("controls dog {", "controls dog[1] {").replace("  success when dog in wide\n", more[1:])
    text = text.replace("use std.ground { robot_dog }", "use std.ground { car, robot_dog }\nasset wagon : car { }")
    text = text.replace("blocks = 2 by 2", "blocks = 200 by 2")
    diagnostics = {(item.code, item.span.line): item.message for item in compile_text(text).diagnostics}
    assert [where for where in diagnostics if where[0] == "LJ0507"] == [
        ("LJ0507", line) for line in (10, 12, 13, 14)
    ], diagnostics
    assert ("LJ0508", 6) in diagnostics and "`endurance` is 0" in diagnostics["LJ0507", 10]


@pytest.mark.parametrize(
    ("place", "message"),
    [
        ("position = (461 m, 0 m)", "outside of the scene, which spans 460 m to every side"),
        ("position = (459 m, 0 m)", ""),
        ("position = (0 m, 0 m, -30 m)", "below everything in the scene, whose lowest surface lies at 0 m"),
    ],
)
@pytest.mark.parametrize("options", ["", "inside = wide"])
def test_a_town_without_an_extent_has_the_default_one(place: str, message: str, options: str) -> None:
    text = TOWN.format(place).replace("robot_dog", "quadrotor").replace("std.ground", "std.air")
    diagnostics = compile_text(text.replace("extent = 200 m, blocks = 2 by 2", options)).diagnostics
    if options and "outside" in message:  # such a town may be wider than its extent
        message = ""
    assert [item.code for item in diagnostics] == (["LJ0211"] if message else []), diagnostics
    assert all(message in item.message for item in diagnostics)


def test_an_error_in_a_base_mission_is_reported_at_its_name(small: str, tmp_path: Path) -> None:
    (tmp_path / "base.ljs").write_text(small.replace("lifeboat {", "lifeboat when mode == star {"))
    (tmp_path / "m.ljs").write_text("ljs 1\nuse .base { small }\nmission more extends small {}\n")
    (diagnostic,) = compile_file(str(tmp_path / "m.ljs")).diagnostics
    assert (diagnostic.code, diagnostic.span.line, diagnostic.span.column) == ("LJ0507", 3, 22)


SHORE, SQUARE = ((0.0, -90.0), (0.0, 90.0)), ((0.0, 0.0), (9.0, 0.0), (9.0, 9.0))
OPTIONS = [
    {},
    {"extent_m": 100.0},
    {"extent_m": 300.0, "traffic": 2.0},
    {"blocks_rows": 2.5, "blocks_columns": 900.0},
    {"height_low_m": 50.0, "height_high_m": 10.0},
    {"height_high_m": 3.0},
    {"shore": SHORE},
    {"shore": SHORE, "bridge": SHORE},
    {"bridge": SHORE},
    {"inside": SQUARE},
    {"homes": SQUARE[:2]},
    {"pipeline": (1.0,)},
    {"inside": ((-4e2, -4e2), (9e2, -4e2), (9e2, 9e2))},
    {"pipeline": ((0.0, 0.0), (1e7, 0.0))},
    {"deck_m": 5.0},
    {"colour": "white"},
    {"map": "x.osm"},
]


def test_the_checker_and_the_planner_of_scenes_report_the_same_errors() -> None:
    """The planner of districts raises exactly where the options have a fault."""
    for kind, options, level in itertools.product(
        (kind for kind in builtin_scenes() if kind not in ("bay", "map")), OPTIONS, (0.0, -3.0)
    ):
        spec = SceneSpec(kind=kind, options=options, datum_m=level)
        faults = list(scene_faults(spec))
        try:
            plan(spec)
        except LingjingError as error:
            assert faults and f"{error}" == "\n".join(fault.message for fault in faults)
        else:
            assert faults == []


AFLOAT = "shore = [(50 m, -99 m), (50 m, 99 m)], datum = sea level at -3 m"
SPAN = AFLOAT + ", bridge = [(60 m, 0 m), (90 m, 0 m)], deck = 60 m"


@pytest.mark.parametrize(
    ("options", "body", "position", "code", "words"),
    [
        ("", "delivery_van", "(0 m, 0 m, 50 m)", "LJ0211", "is always on a road, which lies at 0 m"),
        ("", "delivery_van", "(0 m, 0 m, -50 m)", "LJ0211", "is always on a road, which lies at 0 m"),
        (SPAN, "delivery_van", "(80 m, 0 m, 90 m)", "LJ0211", "which lies between 0 m and 60 m"),
        ("", "lifeboat", "(0 m, 0 m)", "LJ0509", "is on the water, and the scene `residential` has none"),
        (AFLOAT, "lifeboat", "(0 m, 0 m)", "LJ0211", "begins at (0 m, 0 m, -3 m), which is on land"),
        (AFLOAT, "lifeboat", "(80 m, 0 m, 9 m)", "LJ0211", "is always on the water, which lies at -3 m"),
        (AFLOAT, "lifeboat", "(80 m, 0 m)", "", ""),
        (SPAN, "delivery_van", "(80 m, 0 m, 60 m)", "", ""),
        ("", "delivery_van", "(0 m, 0 m, 5 m)", "", ""),
        (AFLOAT.replace("-3 m", "-30 m"), "delivery_van", "(0 m, 0 m)", "", ""),
    ],
)
def test_entities_bound_to_a_surface_begin_on_it(options: str, body: str, position: str, code: str, words: str):
    """The city reports errors that the text alone does not show (`tests/scene/test_anchor.py`)."""
    text = TOWN.format(f"position = {position}").replace("robot_dog", body)
    text = text.replace("2 by 2", f"2 by 2, {options}" if options else "2 by 2")
    text = text.replace("std.ground", "std.sea") if body == "lifeboat" else text
    diagnostics = [item for item in compile_text(text).diagnostics if item.severity == "error"]
    assert [item.code for item in diagnostics] == ([code] if code else [])
    assert all(words in item.message for item in diagnostics)


@pytest.mark.parametrize("kind", ["residential", "coastal", "industrial"])
def test_surfaces_that_a_scene_declares_as_missing_are_missing(kind: str, small: str) -> None:
    """The anchor finds no surface of a kind that the scene's data declare as missing."""
    spec = SceneSpec(kind=kind, options={"extent_m": 300.0}, datum_m=-3.0)
    city: City = build(spec)
    mission = compile_text(small).mission
    assert mission is not None
    instance = instantiate(mission)
    boat = next(entity for entity in instance.entities if entity.id == "boat")
    assert lacks(spec, "water") == (not city.waters)
    for surface in ("bridge", "pipe", "road"):
        alone = _alone(instance, boat, surface)
        if lacks(spec, surface):
            with pytest.raises(LingjingError, match=f"there is no {surface}"):
                anchor(alone, city)
    assert not lacks(spec, "road")
    anchor(_alone(instance, boat, "road"), city, imported=True)


def _alone(instance: Instance, entity: Entity, surface: str) -> Instance:
    there = msgspec.structs.replace(entity, position=(0.0, 0.0, 0.0), properties={"on": surface}, engine="city")
    return msgspec.structs.replace(instance, entities=(there,))


def test_a_mission_with_very_many_members_is_not_instantiated(small: str) -> None:
    many = small.replace("victim[1..3]", "victim[1..50000]").replace("apart >= 10 m", "apart >= 0.01 m")
    (diagnostic,) = compile_text(many).diagnostics  # its instance is not built
    assert "50003 entities for cameras to draw" in diagnostic.message


@pytest.mark.parametrize(
    ("old", "new", "line", "column"),
    [
        ("param uavs = 2 in 1..10", "param uavs = 2 in 1..10\n  param wait = 3 * tick", 14, 20),
        ("param uavs = 2 in 1..10", "param uavs = 2 in 1..10\n  param wait = 3 s in 1 s..tick", 14, 28),
        ("sync = 500 ms", "sync = tick / 20", 9, 31),
        ("  success", "  sweep s over uavs in [1] when tick > 3 s\n  success", 38, 33),
    ],
)
def test_a_ticks_length_is_not_known_before_the_clock(small: str, old: str, new: str, line: int, column: int) -> None:
    diagnostics = compile_text(small.replace(old, new, 1)).diagnostics
    assert [(item.code, item.span.line, item.span.column) for item in diagnostics] == [("LJ0304", line, column)]


@pytest.mark.parametrize(
    ("at", "tick"),
    [
        ("12 tick", 12),
        ("35 s", 4),
        ("wait", 3),
        ("2 * wait", 6),
        ("1.5 * tick", 2),
        ("tick + wait", 4),
        ("late", 7),
        ("(3 m / 1 m) * 2 tick", 6),
        ("~ choice([wait])", 3),
        ("~ uniform(late, late)", 7),
        ("~ uniform(wait, wait + 0 s)", 3),
    ],
)
def test_an_event_happens_at_a_time_or_after_a_number_of_ticks(small: str, at: str, tick: int) -> None:
    params = "  param wait = 30 s\n  param late = 7 tick\n  event turn at"
    text = small.replace("  success", f"{params} {at} {{ weather {{ visibility = 1 km }} }}\n  success")
    mission = compile_text(text).mission
    assert mission is not None
    assert instantiate(mission).events[0].tick == tick
    again = compile_text(to_ljs(mission)).mission
    assert again is not None and again.events == mission.events


def test_a_condition_over_an_empty_group_is_reported_at_success(small: str) -> None:
    (diagnostic,) = compile_text(
        small.replace("forall v in victim: rescued(v)", "distance_xy(uav[4], boat) <= 5 m")
    ).diagnostics
    assert (diagnostic.code, diagnostic.span.line, diagnostic.span.column) == ("LJ0507", 38, 3), diagnostic


def test_no_position_can_be_drawn_from_a_region_that_depends_on_the_city() -> None:
    text = TOWN.format("position ~ sites(quay)").replace("  asset", '  region quay = along(road("A"), 5 m)\n  asset')
    (diagnostic,) = compile_text(text).diagnostics
    assert (diagnostic.code, diagnostic.span.line) == ("LJ0507", 10), diagnostic
    assert "the area of region 'quay' is not known yet" in diagnostic.message and "along a road" in diagnostic.hint
