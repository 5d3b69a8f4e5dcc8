"""Siting: the places of the shipped missions in a city from a map, and the missing features if they do not fit."""

from __future__ import annotations

import itertools
from functools import lru_cache
from math import dist
from pathlib import Path

import pytest

from lingjing.errors import MissionError, UsageError
from lingjing.mission import expression as ex
from lingjing.mission.instance import Instance
from lingjing.mission.instantiate import instantiate
from lingjing.mission.model import Mission
from lingjing.scene.anchor import anchor
from lingjing.scene.city import City
from lingjing.scene.footing import Footing
from lingjing.scene.lines import project
from lingjing.scene.osm.build import Options, build
from lingjing.scene.road_map import read_road_map
from lingjing.scene.siting.city_view import CityView
from lingjing.scene.siting.sited import sited, with_city_option
from lingjing.testing import compile_text, compiled, mission_file
from tests.missions.test_mission_routes import planned_in
from tests.scene.osm_maps import Map, square, town

FITTING = ("ufr", "cd", "cr", "vdn", "ld", "bi", "idf", "upr")
BLOCK = 110
STREETS = range(-440, 441, BLOCK)


def grid_town(flats: str = "12", towers: str = "") -> Map:
    """Blocks of houses and flats on two-way streets, works with a pipeline in the east, a river with a bridge.

    `flats` is the height of the flats in metres, `towers` that of the flats in the south-west, if it is another one.
    """
    made = Map(half_m=620.0)
    for x in STREETS:
        made.way([(x, y) for y in STREETS], {"highway": "residential", "name": f"Street {x}"})
    for y in STREETS:
        made.way([(x, y) for x in STREETS], {"highway": "residential", "name": f"Avenue {y}"})
    for x, y in itertools.product(list(STREETS)[:-1], list(STREETS)[:-1]):
        if x >= 330 and y < 0:
            made.way(square(x + 15, y + 20, 36, 60), {"building": "industrial", "height": "9"})
            made.way(square(x + 65, y + 20, 30, 30), {"building": "warehouse", "height": "8"})
            continue
        for i, j in itertools.product(range(3), range(2)):
            tags = {"building": "house", "height": "7", "roof:shape": "gabled"}
            if (i + j) % 2:
                height = towers if towers and x < -100 and y < -100 else flats
                tags = {"building": "apartments", "height": height, "roof:shape": "flat"}
            made.way(square(x + 14 + 28 * i, y + 15 + 52 * j, 16, 22), tags)
    made.way([(x, 520) for x in range(-600, 601, 100)], {"waterway": "river", "width": "90"})
    made.way([(0, 440), (0, 460)], {"highway": "residential"})
    made.way([(0, 460), (0, 580)], {"highway": "residential", "bridge": "yes", "layer": "1"})
    made.way([(0, 580), (0, 610)], {"highway": "residential"})
    made.way([(470, -400), (470, -220)], {"man_made": "pipeline", "location": "overground"})
    return made


@pytest.fixture(scope="module")
def grid_city(tmp_path_factory: pytest.TempPathFactory) -> City:
    folder = tmp_path_factory.mktemp("grid")
    return build(grid_town().write(folder / "grid.osm"), Options(), folder / "city").city


@pytest.fixture(scope="module")
def town_of_towers(tmp_path_factory: pytest.TempPathFactory) -> City:
    folder = tmp_path_factory.mktemp("towers")
    return build(grid_town(towers="180").write(folder / "grid.osm"), Options(), folder / "city").city


@lru_cache
def mission(name: str) -> Mission:
    return with_city_option(compiled(name), "city")


def sited_in(name: str, city: City) -> Mission:
    return sited(mission(name), city, {"folder": ex.Text(value="city")})


_instances: dict[tuple[str, int], list[Instance]] = {}


def instances(name: str, city: City, tier: int = 0) -> list[Instance]:
    """Placed instances of other seeds than siting tries, computed once for all tests."""
    if (name, tier) not in _instances:
        sites = sited_in(name, city)
        for number in (0, 1):
            drawn = [instantiate(sites, seed=seed, tier=number) for seed in range(20, 24)]
            _instances[name, number] = [anchor(instance, city) for instance in drawn]
    return _instances[name, tier]


@pytest.mark.parametrize("name", FITTING)
def test_every_mission_fits_into_a_town_that_has_all_it_needs(grid_city: City, name: str) -> None:
    west, south, east, north = grid_city.bounds
    for tier in (0, 1):
        for instance in instances(name, grid_city, tier):
            assert instance.scene.kind == "map" and "city" not in instance.scene.options
            assert instance.goal == instantiate(mission(name)).goal
            for entity in instance.entities:
                x, y, _ = entity.position
                assert west <= x <= east and south <= y <= north


def test_siting_is_deterministic(grid_city: City) -> None:
    again = anchor(instantiate(sited_in("cr", grid_city), seed=20), grid_city)
    assert again == instances("cr", grid_city)[0]


def test_vehicles_are_placed_on_roads_of_the_connected_network(grid_city: City) -> None:
    roads = read_road_map(grid_city.network)
    for name in ("ufr", "cd", "cr", "ld"):
        for entity in instances(name, grid_city)[0].entities:
            if entity.properties.get("on") == "road":
                near = roads.nearest(entity.position[:2])
                assert near is not None and near.off_m < 3.5 and near.segment in roads.connected


def test_every_pair_of_jams_leaves_a_way_to_the_goal(grid_city: City) -> None:
    from lingjing.scene.siting.routes import BLOCKED_M, LONGEST_AROUND_M, Router

    router = Router(CityView(grid_city))
    for instance in instances("cr", grid_city):
        at = {entity.id: entity.position[:2] for entity in instance.entities}
        closed = frozenset().union(*(router.near(at[f"jam[{k}]"], BLOCKED_M) for k in (1, 2)))
        names = [sorted(router.near(at[name], 2.0))[0] for name in ("van", "goal_place")]
        start, goal = (
            router.spot(segment, project(router.segments[segment].shape, *at[name]).at_m)
            for segment, name in zip(names, ("van", "goal_place"), strict=True)
        )
        way = router.way(start, goal, closed)
        assert way is not None and way.length_m <= LONGEST_AROUND_M + 100.0


@pytest.mark.parametrize(("jams", "met"), [(0, {0}), (1, {1}), (2, {2}), (3, {2, 3})])
def test_at_tier_1_routes_have_the_number_of_jams_that_success_requires(
    grid_city: City, jams: int, met: set[int]
) -> None:
    """Success requires reports of two jams. A jam on no route could not be reported."""
    sites = sited_in("cr", grid_city)
    places = set()
    for seed in range(8):
        instance = anchor(instantiate(sites, seed=seed, tier=1, settings={"jams": jams}), grid_city)
        with planned_in(grid_city, instance, seed, whole=True) as plan:
            assert len(plan.stood) in met, (seed, plan.jams)
            assert plan.met(plan.routes[-1]) is None and plan.routes[-1].length_m <= 1600.0
            places |= {jam.position[:2] for jam in plan.stood}
    assert len(places) >= 2 * min(met)


@pytest.mark.parametrize(("name", "place"), [("ufr", "(0 m, -430 m)"), ("cr", "(-120 m, -202 m)")])
def test_a_vehicle_with_a_drawn_start_is_sited_too(grid_city: City, name: str, place: str) -> None:
    text = mission_file(name).read_text(encoding="utf-8")
    drawn = text.replace(f"position = {place}, heading", f"position ~ choice([{place}, (10 m, -202 m)]), heading")
    assert drawn != text
    compilation = compile_text(drawn)
    assert compilation.mission is not None
    own = sited(with_city_option(compilation.mission, "city"), grid_city, {"folder": ex.Text(value="city")})
    roads = read_road_map(grid_city.network)
    for seed in (0, 1):
        for entity in anchor(instantiate(own, seed=seed), grid_city).entities:
            if entity.role == "asset" and entity.engine == "road":
                near = roads.nearest(entity.position[:2])
                assert near is not None and near.off_m < 3.5


def test_dogs_begin_on_free_ground_near_their_targets(grid_city: City) -> None:
    footing = Footing(grid_city)
    for name in ("vdn", "ld", "idf", "upr"):
        for instance in instances(name, grid_city):
            dogs = [entity for entity in instance.entities if entity.engine == "quadruped"]
            for dog in dogs:
                assert footing.is_clear(*dog.position[:2], 0.5)
            goal = next(e for e in instance.entities if e.group in ("home", "house", "fire", "leak"))
            assert min(dist(dog.position[:2], goal.position[:2]) for dog in dogs) < 420.0


def test_a_dog_begins_clear_of_the_vehicle_that_parks_at_the_stop(grid_city: City) -> None:
    """A vehicle parks beside its lane: it would push a dog that stands there, and block its way."""
    for instance in instances("ld", grid_city):
        at = {entity.id: entity.position[:2] for entity in instance.entities}
        assert 6.0 <= dist(at["dog"], at["stop_node"]) <= 40.0


def test_a_district_of_slow_streets_is_chosen_if_no_other_district_fits(
    grid_city: City, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("lingjing.scene.siting.areas.MOST_DRIVE_S", 0.0)
    assert anchor(instantiate(sited_in("cd", grid_city), seed=20), grid_city).scene.kind == "map"
    monkeypatch.setattr("lingjing.scene.siting.areas.LONGEST_DRIVE_S", 0.0)
    with pytest.raises(MissionError, match=r"connected roads, reached within 0 s on average"):
        sited_in("cd", grid_city)


def test_a_small_district_has_room_for_the_declared_number_of_drawn_places(
    grid_city: City, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Twenty customers 90 m apart, as declared, do not fit into a third of the declared size."""
    monkeypatch.setattr("lingjing.scene.siting.areas.SCALES", (0.35,))
    monkeypatch.setattr("lingjing.scene.siting.areas.LONGEST_DRIVE_S", 1000.0)
    small = sited_in("cd", grid_city)
    for seed in range(20):
        drawn = [each.position for each in instantiate(small, seed=seed).entities if each.id.startswith("point[")]
        assert len(drawn) == 20
        assert min(dist(a[:2], b[:2]) for a, b in itertools.combinations(drawn, 2)) >= 0.35 * 90.0 - 0.01


def test_detours_of_the_road_engine_have_no_waypoint_in_a_jam(grid_city: City) -> None:
    """The engine avoids the streets at a jam; a waypoint within the jam's radius on the next street is never clear."""
    for instance in instances("ld", grid_city):
        with planned_in(grid_city, instance, instance.seed, whole=True) as plan:
            jams = [entity for entity in instance.entities if entity.group == "jam"]
            assert jams and plan.met(plan.routes[-1]) is None
            for jam in jams:
                nearest = min(dist(point[:2], jam.position[:2]) for point in plan.routes[-1].waypoints)
                assert jam.blocked_m is not None and nearest > jam.blocked_m


def test_no_district_with_roofs_above_the_altitude_band_is_chosen(town_of_towers: City) -> None:
    roofs = [building.top_m for building in CityView(town_of_towers).buildings if building.roof_m == 0.0]
    assert max(roofs) > 160.0 > min(roofs)
    for seed in range(20, 26):
        instance = anchor(instantiate(sited_in("ufr", town_of_towers), seed=seed), town_of_towers)
        fires = [entity for entity in instance.entities if entity.group == "fire"]
        assert fires and all(fire.position[2] < 150.0 for fire in fires)


def test_a_city_of_towers_alone_is_refused_for_flights_over_roofs(tmp_path: Path) -> None:
    city = build(grid_town("180").write(tmp_path / "towers.osm"), Options(), tmp_path / "city").city
    with pytest.raises(MissionError, match="no flat roof above 150 m"):
        sited_in("ufr", city)


def test_the_fracture_is_over_water_and_the_inspection_begins_on_land(grid_city: City) -> None:
    footing = Footing(grid_city)
    for instance in instances("bi", grid_city):
        fracture, uav = instance.entities
        assert footing.is_water(*fracture.position[:2]) and not footing.is_water(*uav.position[:2])
        deck = next(region for region in instance.regions if region.name == "deck")
        assert any(dist(corner, fracture.position[:2]) < 200.0 for corner in deck.polygon)


NEEDS = {
    "ufr": "flat roofs within", "cd": "connected roads", "cr": "waypoints that have a way around", "vdn": "entrances",
    "ld": "entrances which a dog reaches", "bi": "a bridge of at least", "idf": "industrial buildings",
    "upr": "a pipeline in the open",
}  # fmt: skip


@pytest.fixture(scope="module")
def small_city(tmp_path_factory: pytest.TempPathFactory) -> City:
    folder = tmp_path_factory.mktemp("small")
    made = Map()
    made.way([(-400, 0), (400, 0)], {"highway": "residential"})
    made.way(square(0, 20, 15), {"building": "house"})
    return build(made.write(folder / "small.osm"), Options(), folder / "city").city


@pytest.mark.parametrize("name", FITTING)
def test_a_city_without_a_required_feature_is_refused_with_the_missing_feature(small_city: City, name: str) -> None:
    with pytest.raises(MissionError, match=NEEDS[name]) as raised:
        sited_in(name, small_city)
    assert f"`{name}` does not fit into `map-small`" in str(raised.value) and "\n" not in str(raised.value)


def test_a_mission_on_open_water_cannot_be_sited_in_a_city() -> None:
    with pytest.raises(UsageError, match="the scene `bay` of `ssr` cannot be played in a city"):
        with_city_option(compiled("ssr"), "x.osm")


def test_a_city_named_by_the_mission_gives_the_same_places_as_the_option(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from lingjing.play.siting import sited_mission
    from lingjing.plugins.host import PluginHost

    monkeypatch.chdir(tmp_path)
    grid_town().write(tmp_path / "town.osm")
    text = mission_file("ufr").read_text(encoding="utf-8")
    result = compile_text(text.replace("traffic = 40", 'traffic = 40, city = "town.osm"'))
    assert [item.message for item in result.diagnostics] == [] and result.mission is not None
    host = PluginHost()
    by_line = sited_mission(result.mission, "", host)
    by_option = sited_mission(compiled("ufr"), "town.osm", host)
    assert by_line.scene == by_option.scene and by_line.groups == by_option.groups
    assert sited_mission(compiled("ufr"), "", host) is not None


def test_the_largest_connected_part_of_a_network_is_found(tmp_path: Path) -> None:
    city = build(town().write(tmp_path / "town.osm"), Options(), tmp_path / "city").city
    roads = read_road_map(city.network)
    connected = roads.connected
    assert connected
    for name in connected:
        assert any(after in connected for after in roads.segments[name].following)
