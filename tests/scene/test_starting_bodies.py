"""Bodies that begin at one place are separated. Moves beyond the limit are errors; moves beyond a length are
reported."""

import itertools
import json
import math
import sys

import msgspec
import pytest

import lingjing
from lingjing import read as read_trace
from lingjing.errors import MissionError
from lingjing.mission.footprint import STANDS_M, footprint, sunk_below_m
from lingjing.plugins.building import build_city
from lingjing.scene.anchor import SHORE_CLEAR_M, anchor
from lingjing.scene.displacement import in_words, moved_bodies
from lingjing.scene.footing import Footing
from lingjing.scene.terrain import Terrain
from lingjing.testing import PluginHost, instantiate, mission_file, placed
from lingjing.testing.missions import SourceText, compile_source
from lingjing.trace.records import Decision
from tools.python_forks import run_python

HEAD = """ljs 1
use std.air {{ quadrotor, fixed_wing }}
use std.ground {{ robot_dog, car }}
use std.sea {{ lifeboat }}
use std.weather {{ clear }}
mission starts "Starts" {{
  goal "Begin."
  scene {scene}
  clock {{ tick = 1 s, sync = 500 ms }}
  budget {{ ticks <= 2 }}
  weather clear
  mode broadcast
{assets}
  agent pilot as pilot controls a {{
    observes a.*, events
    prompt "Wait."
  }}
  success when now > 1 s
}}
"""
TOWN = "residential { extent = 400 m, blocks = 2 by 2 }"


def text(*assets, scene=TOWN):
    return HEAD.format(scene=scene, assets="\n".join(f"  asset {asset}" for asset in assets))


def drawn(name, kind, x=0, y=0, z=None):
    places = ", ".join(f"{metres} m" for metres in (x, y, z) if metres is not None)
    return f"{name} : {kind} {{ position ~ subset([({places})]) }}"


def begun(*assets, scene=TOWN, **how):
    mission = compile_source(SourceText(text(*assets, scene=scene), "starts.ljs")).mission
    assert mission is not None
    declared = instantiate(mission)
    city = build_city(declared.scene, PluginHost())
    return declared, anchor(declared, city, **how), city


def overlapping(instance):
    rooms = [(entity.id, footprint(entity)) for entity in instance.entities]
    return [
        (entity, other) for (entity, a), (other, b) in itertools.combinations(rooms, 2) if a and b and a.overlaps(b)
    ]


@pytest.mark.parametrize(
    ("assets", "scene"),
    [
        ([drawn(name, "quadrotor", z=30) for name in "abcde"], TOWN),
        ([drawn(name, "quadrotor", 15, 15, 0.2) for name in "abcde"], TOWN),
        ([drawn("a", "fixed_wing", z=90), drawn("b", "fixed_wing", 3, 3, 91), drawn("c", "quadrotor", z=90)], TOWN),
        (
            [
                drawn("a", "lifeboat", -500, -500),
                drawn("b", "lifeboat", -500, -503),
                drawn("c", "quadrotor", -500, -500, 1),
            ],
            "bay",
        ),
        (
            [
                drawn("a", "quadrotor", 0, 2, 0.5),
                drawn("b", "robot_dog", 0, 2),
                drawn("c", "car", 0, 2),
                drawn("d", "car", 0, 2),
            ],
            TOWN,
        ),
        ([drawn("a", "robot_dog", 0, 2), drawn("b", "quadrotor", 0, 2, 0.5), drawn("c", "robot_dog", 0, 2)], TOWN),
    ],
    ids=["in the air", "on the ground", "aeroplanes", "afloat", "of all kinds", "dog first"],
)
def test_no_two_bodies_begin_in_one_place(assets, scene):
    """The bug: two aircraft at one point were valid and destroyed each other at 0.02 s."""
    declared, placed, city = begun(*assets, scene=scene)
    assert overlapping(declared) and not overlapping(placed)
    assert anchor(placed, city) == placed, "what is apart stays"
    assert placed.entities[0].position[:2] == pytest.approx(declared.entities[0].position[:2], abs=9.0)
    terrain = Terrain(city)
    for before, after in zip(declared.entities, placed.entities, strict=True):
        if before.engine in ("multirotor", "plane"):
            above_m = before.position[2] - sunk_below_m(before) - terrain.support(*before.position)
            assert after.position[2] - sunk_below_m(after) - terrain.support(*after.position) == pytest.approx(
                0.0 if above_m <= STANDS_M else above_m, abs=0.3
            ), "it rests on the surface, or hovers as it was declared to"


BRIDGE = (
    "residential { extent = 600 m, blocks = 2 by 2, shore = [(-300 m, -150 m), (300 m, -150 m)], "
    "bridge = [(100 m, -150 m), (100 m, -290 m)] }"
)
"""The deck lies at 12 m, and a pier of it at (100 m, -210 m)."""


@pytest.mark.parametrize(
    ("kind", "place", "to"),
    [
        ("quadrotor", (100, -205, 9.0), "stays"),
        ("quadrotor", (100, -205, 11.0), "aside"),
        ("quadrotor", (100, -205, 11.5), "aside"),
        ("quadrotor", (100, -205, 11.9), "deck"),
        ("quadrotor", (100, -205, 12.1), "stays"),
        ("quadrotor", (100, -205, 12.9), "deck"),
        ("quadrotor", (100, -205, 13.3), "stays"),
        ("fixed_wing", (100, -205, 11.5), "deck"),
        ("lifeboat", (100, -205), "aside"),
        ("lifeboat", (100, -180), "stays"),
    ],
)
def test_no_body_begins_inside_a_bridge(kind, place, to):
    """The bugs: a drone hovered inside the deck, and a boat began with its hull in a pier."""
    declared, placed, city = begun(f"a : {kind} {{ position = ({', '.join(f'{m} m' for m in place)}) }}", scene=BRIDGE)
    before, after = declared.entities[0].position, placed.entities[0].position
    room, terrain = footprint(placed.entities[0]), Terrain(city)
    low, high = (after[2] - 0.5, after[2] + 1.5) if kind == "lifeboat" else (room.low, room.high)
    assert to == "stays" or not terrain.solids_at(*after[:2], low + 1e-3, high, min(room.half_width, 1.0))
    moved_m = math.dist(before[:2], after[:2])
    assert (moved_m > 1.0) == (to == "aside")
    assert room.low == pytest.approx(12.0, abs=1e-3) if to == "deck" else after[2] == before[2]


def test_the_error_of_a_boat_on_land_names_the_declared_place():
    """The bug: the boat was first moved away from an obstacle, and the error named another place."""
    with pytest.raises(MissionError, match=r"`a` begins at \(100 m, -210 m\), which is on land"):
        begun("a : lifeboat { position = (100 m, -210 m) }", scene=BRIDGE)


def test_bodies_above_each_other_keep_their_places():
    declared, placed, _ = begun(drawn("a", "quadrotor", z=30), drawn("b", "quadrotor", z=31))
    assert [entity.position for entity in placed.entities] == [entity.position for entity in declared.entities]


@pytest.mark.parametrize("apart", ["0 m", "0.5 m"])
def test_a_mission_that_declares_two_bodies_at_one_place_is_an_error(apart):
    assets = ("a : quadrotor { position = (0 m, 0 m, 30 m) }", f"b : quadrotor {{ position = (0 m, {apart}, 30.2 m) }}")
    diagnostics = compile_source(SourceText(text(*assets), "starts.ljs")).diagnostics
    assert [diagnostic.code for diagnostic in diagnostics] == ["LJ0212"]
    apart_now = text(assets[0], "b : quadrotor { position = (0 m, 1 m, 30.2 m) }")
    assert not compile_source(SourceText(apart_now, "starts.ljs")).diagnostics


@pytest.mark.parametrize("scene", [TOWN, TOWN.replace("blocks", "displacement = 20 m, blocks")])
def test_a_body_that_would_be_moved_too_far_is_an_error(scene):
    most = "20 m" if "displacement" in scene else "50 m"
    far = ("a : quadrotor { position = (0 m, 0 m, 30 m) }", "c : car { position = (60 m, 60 m) }")
    with pytest.raises(
        MissionError, match=f"`c` .* nearest road that suits it lies 5.* moved by {most} at most"
    ) as caught:
        begun(*far, scene=scene)
    assert "displacement = 60 m" in caught.value.hint
    _, placed, _ = begun(*far, scene=TOWN.replace("blocks", "displacement = 60 m, blocks"))
    declared, imported, _ = begun(*far, imported=True)
    assert imported.entities == placed.entities
    (moved,) = moved_bodies(declared, imported)
    assert (moved.entity, moved.on, moved.declared) == ("c", "road", (60.0, 60.0, 0.0))
    assert moved.moved_m == pytest.approx(math.dist(moved.declared[:2], moved.placed[:2]), abs=1e-3)


def test_short_moves_and_drawn_places_are_not_reported():
    declared, placed, _ = begun("a : quadrotor { position = (0 m, 0 m, 30 m) }", "c : car { position = (3 m, 17.6 m) }")
    moves = [
        math.dist(before.position, after.position)
        for before, after in zip(declared.entities, placed.entities, strict=True)
    ]
    assert 1.0 < moves[1] < 4.5 and not moved_bodies(declared, placed)
    region = ((50.0, 50.0), (70.0, 50.0), (70.0, 70.0), (50.0, 70.0))
    entities = tuple(msgspec.structs.replace(before, drawn_in=region) for before in declared.entities)
    far = tuple(msgspec.structs.replace(before, position=(999.0, 0.0, 0.0)) for before in entities)
    assert not moved_bodies(*(msgspec.structs.replace(declared, entities=those) for those in (entities, far)))


def test_a_summary_names_five_moved_bodies_and_counts_the_rest():
    declared, placed, _ = begun(*(drawn(name, "quadrotor", z=30) for name in "abcdefgh"))
    (line,) = in_words(moved_bodies(declared, placed))
    assert line.count("`") == 10 and line.endswith("and 2 more") and in_words(()) == ()


class Idle:
    """Does nothing."""

    async def reset(self, brief):
        pass

    async def act(self, observation, inbox):
        return Decision()


def test_a_moved_body_is_in_the_report_and_in_the_trace(tmp_path):
    file = tmp_path / "starts.ljs"
    file.write_text(text(drawn("a", "quadrotor", z=30), drawn("b", "quadrotor", z=30)))
    report = lingjing.run(file, policy=Idle, world="inline", overview=False, out=tmp_path / "out")
    assert report.success and not report.incidents
    trace = read_trace(report.folder / "trace.mcap")
    assert [moved_body.entity for moved_body in trace.header.moved] == ["b"] and report.moved == trace.header.moved
    assert any("moved from their declared places" in line and "`b` 2.0 m" in line for line in report.warnings)


def test_a_moved_body_is_in_the_summary_of_a_run(tmp_path):
    file = tmp_path / "starts.ljs"
    file.write_text(
        text(drawn("a", "quadrotor", z=30), drawn("b", "quadrotor", z=30), drawn("c", "quadrotor", 9, 9, 0.9))
    )
    command = [sys.executable, "-m", "lingjing.cli.main", "run", str(file), "--policy", "random", "--no-overview"]
    shown = run_python([*command, "-o", str(tmp_path / "o"), "--json"])
    summary = json.loads(shown.stdout)
    assert [moved_body["entity"] for moved_body in summary["moved"]] == ["b", "c"]
    warnings = " ".join(summary["warnings"])
    assert "moved from their declared places by more than their own length: `b`" in warnings
    assert "put down onto the surface below, because they begin close above it: `c` 0.7 m" in warnings


def test_bodies_of_a_document_at_one_place_are_separated_and_noted(tmp_path):
    """Bodies of an imported document that share a place are moved apart; the document is not rejected."""
    document = json.loads(mission_file("reset/ssr-001.json").read_text(encoding="utf-8"))
    drones = document["scenario"]["equipmentList"]["droneEntityList"]
    for drone in drones:
        drone["data"] = drones[0]["data"]
    file = tmp_path / "one-place.json"
    file.write_text(json.dumps(document))
    shown = run_python([sys.executable, "-m", "lingjing.cli.main", "validate", str(file)])
    assert shown.returncode == 0, shown.stderr
    notes = shown.stdout + shown.stderr
    assert "droneEntityList[1]" in notes and "m away, clear of what stands there" in notes
    mission = lingjing.compile(file)
    declared = instantiate(mission)
    placed = anchor(declared, build_city(declared.scene, PluginHost()), imported=True)
    assert len(overlapping(declared)) == 3 and not overlapping(placed)


QUAY = """ljs 2
use std.ground { robot_dog }
mission m "M" {
  goal "Go."
  scene coastal { extent = 800 m }
  clock { tick = 2 s, sync = 100 ms }
  budget { ticks <= 10 }
  asset dog : robot_dog { position = (EAST m, 58.9 m) }
  agent walker as walker controls dog { observes dog.*, events }
  success when distance_xy(dog, (0 m, 0 m)) <= 5 m
}
"""


def test_a_dog_begins_a_step_away_from_the_edge_of_a_sea_wall() -> None:
    _, city = placed(QUAY.replace("EAST", "-40"))
    footing = Footing(city)
    dry, wet = -40.0, 40.0
    assert not footing.is_water(dry, 58.9) and footing.is_water(wet, 58.9)
    while wet - dry > 0.05:
        middle = (dry + wet) / 2.0
        dry, wet = (dry, middle) if footing.is_water(middle, 58.9) else (middle, wet)
    moved, _ = placed(QUAY.replace("EAST", f"{dry - 0.2:.2f}"))
    (dog,) = moved.entities
    assert not footing.is_shore(*dog.position[:2], SHORE_CLEAR_M - 0.05), "places are rounded"
    assert math.dist(dog.position[:2], (dry, 58.9)) < 30.0
