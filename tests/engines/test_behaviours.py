"""Targets that move by themselves: they flee, wander and follow, on their surface and in the city."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator

import msgspec
import pytest

from lingjing.mission.instance import BehaviourSpec, Entity, Instance, InteractionSpec, Region, Vector
from lingjing.plugins.engine import Engine
from lingjing.plugins.terrain import Terrain
from lingjing.scene.city import City
from lingjing.testing import EngineRun, PluginHost, placed, square
from lingjing.trace.records import BodyState

DRY = City(id="dry", origin=(31.0, 121.5), bounds=(-200.0, -200.0, 200.0, 200.0))
YARD = Region(name="yard", polygon=square(0.0, 0.0, 80.0))
MISSION = """ljs 2
use std.ground { robot_dog }
target stray { engine = city, on = ground, look = none, shape = none }
mission strays "Strays" {
  goal "Look."
  scene industrial { extent = 400 m, blocks = 2 by 2, height = 6 m..12 m }
  clock { tick = 10 s, sync = 500 ms }
  budget { ticks <= 60 }
  region yard = box((-80 m, -80 m), (80 m, 80 m))
  target stray[1..4] : stray { position ~ sites(yard), behaviour wander { in = yard, speed = 2 m/s } }
  asset dog : robot_dog { position = (0 m, 0 m), heading = 0 deg }
  agent walker as walker controls dog { observes dog.*, stray.position }
  success when now > 500 s
}
"""

Play = Callable[..., EngineRun]


def city_engine() -> Engine:
    return PluginHost().engine("city").factory()


def in_yard(x: float, y: float) -> bool:
    return abs(x) <= 80.0 and abs(y) <= 80.0


def is_clear(terrain: Terrain, place: Vector) -> bool:
    """True for a place on dry ground that no building or other body reaches."""
    x, y, z = place
    return terrain.water_level(x, y) is None and not terrain.solids_at(x, y, z + 0.5, z + 2.0, 0.3)


def roaming(name: str, behaviour: BehaviourSpec, place: Vector = (0.0, 0.0, 0.0), on: str = "ground") -> Entity:
    afloat = {"drift_mps": 0.3} if on == "water" else {"on": on}
    return Entity(
        id=name, group=name.partition("[")[0], index=1, role="target", type="stray", engine="city", position=place,
        properties=afloat, behaviour=behaviour,
    )  # fmt: skip


FLEES = BehaviourSpec(kind="flee", speed_mps=2.0, of=("dog",), distance_m=60.0)
FOLLOWS = BehaviourSpec(kind="follow", speed_mps=2.0, of=("dog",), distance_m=10.0)
WANDERS = BehaviourSpec(kind="wander", speed_mps=2.0, region="yard")
DOG = Entity(
    id="dog", group="dog", index=1, role="asset", type="dog", engine="quadruped", position=(500.0, 0.0, 0.0)
)  # fmt: skip


@pytest.fixture
def play(player: type[EngineRun], instance_of: Callable[..., Instance]) -> Play:
    def start(*entities: Entity, city: City = DRY, seed: int = 1) -> EngineRun:
        instance = msgspec.structs.replace(instance_of((*entities, DOG), None, 0.5), regions=(YARD,))
        return player(city_engine(), instance, city, "city", seed)

    return start


def dog(x: float, y: float = 0.0, status: str = "") -> BodyState:
    return BodyState(id="dog", position=(x, y, 0.0), status=status)


def places(played: EngineRun) -> dict[str, Vector]:
    return {state.id: state.position for state in played.boundary.states}


def way(played: EngineRun, steps: int, *mirrors: BodyState) -> list[dict[str, Vector]]:
    rows = []
    for _ in range(steps):
        played.step(mirrors)
        rows.append(places(played))
    return rows


def test_a_body_flees_from_the_nearest_pursuer_until_it_is_far_enough(play: Play) -> None:
    played = play(roaming("hare", FLEES))
    played.step((dog(-10.0),))
    assert played.state.velocity == pytest.approx((2.0, 0.0, 0.0)) and played.state.heading_deg == pytest.approx(90.0)
    played.run(60.0, (dog(-10.0),))
    assert played.state.position == pytest.approx((50.0, 0.0, 0.0), abs=0.3)
    assert played.state.velocity == (0.0, 0.0, 0.0)


@pytest.mark.parametrize("pursuer", [(dog(-61.0),), (dog(-10.0, status="dormant"),), ()])
def test_a_body_does_not_flee_from_a_distant_or_absent_pursuer(play: Play, pursuer: tuple[BodyState, ...]) -> None:
    assert {row["hare"] for row in way(play(roaming("hare", FLEES)), 20, *pursuer)} == {(0.0, 0.0, 0.0)}


def test_a_fleeing_body_never_leaves_the_scene_or_runs_towards_its_pursuer(play: Play) -> None:
    played = play(roaming("hare", FLEES, (180.0, 190.0, 0.0)))
    apart = [math.dist(row["hare"][:2], (170.0, 180.0)) for row in way(played, 200, dog(170.0, 180.0))]
    x, y, _ = played.state.position
    assert abs(x) <= 200.0 and abs(y) <= 200.0 and (x, y) != (180.0, 190.0)
    assert all(after >= before - 1e-9 for before, after in itertools.pairwise(apart))


def test_a_body_follows_at_its_distance(play: Play) -> None:
    played = play(roaming("pup", FOLLOWS))
    for step in range(200):
        played.step((dog(5.0 + 0.5 * step),))  # at 1 m/s
    assert 5.0 + 0.5 * 199 - played.state.position[0] == pytest.approx(10.0, abs=0.6)
    played.run(10.0, (dog(104.5),))
    assert 104.5 - played.state.position[0] == pytest.approx(10.0, abs=1e-5)
    assert played.state.velocity == (0.0, 0.0, 0.0)


def test_a_wanderer_crosses_its_region_and_never_leaves_it(play: Play) -> None:
    rows = [row["hare"] for row in way(play(roaming("hare", WANDERS)), 400)]
    assert all(in_yard(x, y) for x, y, _ in rows)
    assert max(x for x, _, _ in rows) - min(x for x, _, _ in rows) > 60.0


def test_a_wanderer_that_begins_outside_goes_into_its_region_and_stays(play: Play) -> None:
    rows = [row["hare"] for row in way(play(roaming("hare", WANDERS, (150.0, 0.0, 0.0))), 400)]
    inside = [in_yard(x, y) for x, y, _ in rows]
    assert not inside[0] and all(inside[inside.index(True) :])


def test_equal_seeds_give_equal_paths_whatever_other_bodies_exist(play: Play) -> None:
    def of_first(seed: int, *others: Entity) -> list[Vector]:
        return [row["hare[1]"] for row in way(play(roaming("hare[1]", WANDERS), *others, seed=seed), 100)]

    assert of_first(1) == of_first(1, roaming("hare[2]", WANDERS), roaming("fox", WANDERS)) != of_first(2)


@pytest.mark.parametrize("pursuer_x", [55.0, 80.0])
def test_a_swimmer_stays_in_the_water_and_avoids_obstacles(play: Play, quay: City, pursuer_x: float) -> None:
    terrain, flees = Terrain(quay), msgspec.structs.replace(FLEES, distance_m=500.0)
    played = play(roaming("swan", flees, (60.0, 0.0, -3.5), on="water"), city=quay)
    rows = [row["swan"] for row in way(played, 200, dog(pursuer_x))]
    assert all(terrain.water_level(x, y) is not None for x, y, _ in rows)
    assert not any(terrain.solids_at(x, y, -3.5, 0.0) for x, y, _ in rows)
    assert math.dist(rows[-1][:2], (60.0, 0.0)) > 20.0


def test_a_walker_stays_on_the_quay(play: Play, quay: City) -> None:
    flees = msgspec.structs.replace(FLEES, distance_m=500.0)
    played = play(roaming("hare", flees, (0.0, 0.0, 0.9)), city=quay)
    rows = [row["hare"] for row in way(played, 100, dog(-10.0, 3.0))]
    assert all(abs(x) <= 40.0 and abs(y) <= 40.0 and z == pytest.approx(0.9) for x, y, z in rows)
    assert math.dist(rows[-1][:2], (0.0, 0.0)) > 35.0


def test_a_body_without_a_free_path_stays_in_place(play: Play, quay: City) -> None:
    played = play(roaming("hare", WANDERS, (300.0, 0.0, -3.5)), city=quay)  # a walker in the middle of the water
    assert {row["hare"] for row in way(played, 40)} == {(300.0, 0.0, -3.5)}


def test_a_body_that_was_served_stands_still(play: Play) -> None:
    catch = InteractionSpec(name="catch", by="quadruped", within_m=3.0, status="caught")
    played = play(msgspec.structs.replace(roaming("hare", FLEES), interactions=(catch,)))
    played.command("hare", "unlock.catch", origin="kernel")
    played.step((dog(-2.0),))
    assert played.state.status == "caught"
    caught_at = played.state.position
    played.run(10.0, (dog(-2.0),))
    assert (played.state.position, played.state.velocity) == (caught_at, (0.0, 0.0, 0.0))


@pytest.fixture(scope="module")
def strays() -> Iterator[tuple[Instance, City]]:
    yield placed(MISSION, seed=3)


def test_wanderers_stay_out_of_buildings_and_water_in_a_real_city(strays: tuple[Instance, City]) -> None:
    instance, city = strays
    terrain, played = Terrain(city), EngineRun(city_engine(), instance, city, "city", 3)
    begun = places(played)
    for row in way(played, 200):
        for place in row.values():
            assert is_clear(terrain, place) and in_yard(*place[:2])
    assert all(math.dist(place, begun[name]) > 1.0 for name, place in places(played).items())


def test_a_fleeing_body_stays_out_of_buildings_in_a_real_city(strays: tuple[Instance, City]) -> None:
    instance, city = strays
    flees = msgspec.structs.replace(FLEES, speed_mps=3.0, distance_m=150.0)
    entities = tuple(
        msgspec.structs.replace(entity, behaviour=flees) if entity.behaviour else entity for entity in instance.entities
    )
    terrain = Terrain(city)
    played = EngineRun(city_engine(), msgspec.structs.replace(instance, entities=entities), city, "city", 3)
    begun = places(played)
    for row in way(played, 100, dog(0.0)):
        assert all(is_clear(terrain, place) for place in row.values())
    for name, place in places(played).items():
        assert math.dist(place[:2], (0.0, 0.0)) > math.dist(begun[name][:2], (0.0, 0.0)) + 5.0
