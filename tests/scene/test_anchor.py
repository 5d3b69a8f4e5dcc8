"""The anchor places the entities of the nine missions on the declared surfaces, deterministically and within reach."""

import os
import random
import subprocess
import sys
from functools import cache
from heapq import heappop, heappush
from itertools import combinations
from math import hypot
from pathlib import Path

import msgspec
import pytest
import shapely

from lingjing.dsl.source.text import SourceText, read_source
from lingjing.errors import MissionError
from lingjing.mission.footprint import sunk_below_m
from lingjing.mission.instance import Entity, Instance
from lingjing.mission.kinds import reach_m
from lingjing.scene.anchor import anchor
from lingjing.scene.city import City, Land, Lane, Prop, Road, Solid
from lingjing.scene.districts.palette import WHITE
from lingjing.scene.footing import Footing
from lingjing.scene.lines import point_at, project
from lingjing.scene.store import write_store
from lingjing.scene.terrain import Terrain
from lingjing.testing import PluginHost, instantiate
from lingjing.testing.missions import compile_source

SCENARIOS = Path(__file__).parents[2] / "scenarios"
NINE = ("vdn", "bi", "ld", "idf", "upr", "ufr", "cr", "ssr", "cd")
SEEDS = range(5)


@pytest.fixture(autouse=True, scope="module")
def cache_folder(tmp_path_factory):
    before = os.environ.get("XDG_CACHE_HOME")
    os.environ["XDG_CACHE_HOME"] = str(tmp_path_factory.mktemp("cache"))
    yield
    city_of.cache_clear()
    if before is None:
        del os.environ["XDG_CACHE_HOME"]
    else:
        os.environ["XDG_CACHE_HOME"] = before


@cache
def mission(name: str):
    compiled = compile_source(read_source(str(SCENARIOS / f"{name}.ljs"))).mission
    assert compiled is not None
    return compiled


@cache
def city_of(name: str, seed: int) -> City:
    scenes = PluginHost().scenes
    spec = instantiate(mission(name), seed=seed).scene
    return scenes[spec.kind].build(spec)


def anchored(name: str, seed: int, **settings: float) -> tuple[Instance, City]:
    city = city_of(name, seed)
    return anchor(instantiate(mission(name), seed=seed, settings=settings), city), city


def on(instance: Instance, what: str) -> list[Entity]:
    return [entity for entity in instance.entities if entity.properties.get("on") == what]


@pytest.mark.parametrize("name", NINE)
def test_entities_are_placed_on_the_declared_surfaces(name: str) -> None:
    for seed in SEEDS:
        instance, city = anchored(name, seed)
        footing = Footing(city)
        buildings = {building.id: building for building in city.buildings}
        lanes = [lane for road in city.roads for lane in road.lanes if lane.kind == "car"]
        for entity in on(instance, "road"):
            x, y, z = entity.position
            assert min(project(lane.shape, x, y).off_m for lane in lanes) < 0.01, entity.id
            assert z == pytest.approx(0.0)
        for entity in on(instance, "roof"):
            x, y, z = entity.position
            building = buildings[str(entity.properties["building"])]
            assert shapely.Polygon(building.polygon).buffer(-1.9).contains(shapely.Point(x, y))
            assert z == building.top_m == footing.roof_over(x, y)
            assert "building" in entity.hidden, "which building burns is as hidden as where"
        for entity in on(instance, "facade"):
            x, y, _ = entity.position
            building = buildings[str(entity.properties["building"])]
            assert shapely.Polygon(building.polygon).distance(shapely.Point(x, y)) == pytest.approx(0.3, abs=0.01)
            assert entity.heading_deg == building.entrance[2]
        for entity in on(instance, "ground"):
            x, y, z = entity.position
            assert footing.is_clear(x, y, 0.5), entity.id
            assert z == footing.height(x, y)
        for entity in on(instance, "bridge"):
            assert min(project(bridge.path, *entity.position[:2]).off_m for bridge in city.bridges) < 0.01
            assert entity.position[2] == 12.0
        for entity in on(instance, "pipe"):
            assert min(project(pipe.path, *entity.position[:2]).off_m for pipe in city.pipes) < 0.01
            assert 1.0 < entity.position[2] < 2.0
        for entity in instance.entities:
            if "on" not in entity.properties:
                roof = footing.roof_over(*entity.position[:2])
                assert roof is None or entity.position[2] >= roof, f"{entity.id} begins inside a building"


def test_aircraft_begin_beside_roads_and_assets_at_sea_keep_their_places() -> None:
    for name in ("ufr", "cr", "ld"):
        instance, city = anchored(name, 0)
        footing = Footing(city)
        places = {entity.id: entity.position for entity in instantiate(mission(name), seed=0).entities}
        for uav in (entity for entity in instance.entities if entity.group == "uav"):
            x, y, z = uav.position
            assert footing.is_clear(x, y, 0.6, off_road=True)
            assert z - footing.height(x, y) == pytest.approx(sunk_below_m(uav), abs=1e-3), "it rests on the ground"
            assert hypot(x - places[uav.id][0], y - places[uav.id][1]) < 25.0
    for name in ("ssr", "bi"):
        declared, (instance, _) = instantiate(mission(name), seed=0), anchored(name, 0)
        for before, after in zip(declared.entities, instance.entities, strict=True):
            if before.role != "asset":
                continue
            assert before.position[:2] == after.position[:2]
            assert after.position[2] == pytest.approx(before.position[2], abs=0.03), "a UAV is put down by that much"


WALKS = {"vdn": ("home", 25.0), "idf": ("fire", 2.0), "upr": ("leak", 4.5), "ld": ("house", 12.0)}


def walks(footing: Footing, start: tuple[float, float], end: tuple[float, float], within: float) -> bool:
    """True if a search over a grid of 1.5 m, nearest to the end first, comes within that distance of the end."""
    seen, edge = {(0, 0)}, [(hypot(end[0] - start[0], end[1] - start[1]), 0, 0)]
    while edge and len(seen) < 20_000:
        left, i, j = heappop(edge)
        if left <= within:
            return True
        for step in ((i + 1, j), (i - 1, j), (i, j + 1), (i, j - 1)):
            x, y = start[0] + 1.5 * step[0], start[1] + 1.5 * step[1]
            if step not in seen and footing.is_clear(x, y, 0.4):
                heappush(edge, (hypot(end[0] - x, end[1] - y), *step))
            seen.add(step)
    return False


@pytest.mark.parametrize("name", WALKS)
def test_dogs_can_walk_to_their_targets(name: str) -> None:
    group, within = WALKS[name]
    for seed in SEEDS:
        instance, city = anchored(name, seed)
        footing = Footing(city)
        for dog in (entity for entity in instance.entities if entity.type == "robot_dog"):
            for target in (entity for entity in instance.entities if entity.group == group):
                there = walks(footing, dog.position[:2], target.position[:2], within)
                assert there, f"{dog.id} gets from {dog.position} to {target.id} at {target.position} with seed {seed}"


@pytest.mark.parametrize("name", NINE)
def test_anchoring_is_deterministic_and_changes_only_places(name: str) -> None:
    instance, city = anchored(name, 3)
    before = instantiate(mission(name), seed=3)
    assert anchor(before, city) == instance
    same = [msgspec.structs.replace(a, position=b.position, heading_deg=b.heading_deg, properties=b.properties,
                                    hidden=b.hidden)
            for a, b in zip(instance.entities, before.entities, strict=True)]  # fmt: skip
    assert msgspec.structs.replace(instance, entities=tuple(same)) == before
    assert anchor(instance, city) == instance, "what is anchored stays"


def test_fires_are_on_different_roofs_within_reach_of_the_truck() -> None:
    for seed in SEEDS:
        instance, city = anchored("ufr", seed, fires=6)
        fires = on(instance, "roof")
        assert len({fire.properties["building"] for fire in fires}) == len(fires) == 6
        for fire in fires:
            x, y, _ = fire.position
            lane = min(project(lane.shape, x, y).off_m for road in city.roads for lane in road.lanes)
            assert lane <= 25.0, fire.id


def test_vehicles_start_a_length_apart_and_along_their_lane() -> None:
    for seed in SEEDS:
        instance, city = anchored("cd", seed, vans=8)
        vans = [entity for entity in instance.entities if entity.group == "van"]
        lanes = [lane for road in city.roads for lane in road.lanes]
        for first, second in combinations(vans, 2):
            assert hypot(first.position[0] - second.position[0], first.position[1] - second.position[1]) > 2.9
        for van in vans:
            places = ((project(lane.shape, *van.position[:2]), lane.shape) for lane in lanes)
            distance, at, shape = min((place.off_m, place.at_m, shape) for place, shape in places)
            assert distance < 0.01
            assert point_at(shape, at)[1] == pytest.approx(van.heading_deg, abs=0.01)
            assert hypot(*van.position[:2]) < 60.0, "they start at the depot"


def test_a_vehicle_is_placed_on_the_lane_in_the_direction_of_its_heading() -> None:
    city = city_of("cr", 0)
    base = instantiate(mission("cr"), seed=0)
    for heading in (0.0, 90.0, 180.0, 270.0):
        place = (-300.0, -200.0, 0.0) if heading in (90.0, 270.0) else (-200.0, -300.0, 0.0)
        entities = tuple(
            msgspec.structs.replace(e, position=place, heading_deg=heading) if e.id == "van" else e
            for e in base.entities
        )  # fmt: skip
        van = next(e for e in anchor(msgspec.structs.replace(base, entities=entities), city).entities if e.id == "van")
        assert van.heading_deg == heading


@pytest.mark.parametrize(
    ("name", "start", "ends"),
    [
        ("cr", "van", ("goal_place",)),
        ("ld", "van", ("stop_node",)),
        ("ufr", "truck", ("fire",)),
        ("cd", "van", ("point", "depot")),
    ],
)
def test_vehicles_have_a_route_from_the_start_to_every_target_and_back(
    name: str, start: str, ends: tuple[str, ...]
) -> None:
    for seed in (0, 1):
        instance, city = anchored(name, seed)
        edges = {lane.id: road.id for road in city.roads for lane in road.lanes}
        lanes = [lane for road in city.roads for lane in road.lanes]

        def edge(entity: Entity, lanes: list = lanes, edges: dict = edges) -> str:
            return edges[min((project(lane.shape, *entity.position[:2]).off_m, lane.id) for lane in lanes)[1]]

        pairs = [(edge(a), edge(b)) for a in instance.entities if a.group == start
                 for b in instance.entities if b.group in ends]  # fmt: skip
        pairs += [(b, a) for a, b in pairs]
        program = (
            "import sumolib, sys; net = sumolib.net.readNet(sys.argv[1]);"
            "print([p for p in sys.argv[2:] if net.getShortestPath(*map(net.getEdge, p.split('|')))[0] is None])"
        )
        arguments = [sys.executable, "-c", program, city.network, *sorted({"|".join(pair) for pair in pairs})]
        run = subprocess.run(arguments, capture_output=True, text=True, check=True)
        assert run.stdout.strip() == "[]"


def test_no_other_building_has_the_colour_of_the_reference_building() -> None:
    """The camera paints the building that a target on a facade names: no other building has its colour."""
    instance, city = anchored("vdn", 1)
    home = next(entity for entity in instance.entities if entity.id == "home")
    assert home.properties["building"] in {building.id for building in city.buildings}
    assert all(max(abs(a - b) for a, b in zip(b.colour, WHITE, strict=True)) > 0.1 for b in city.buildings)


def test_the_error_names_a_scene_without_the_required_surface() -> None:
    base = instantiate(mission("cr"), seed=0)
    bay = city_of("ssr", 0)
    with pytest.raises(MissionError, match=r"no road for `goal_place` .* in the scene `bay-") as caught:
        anchor(base, bay)
    assert "choose a scene" in caught.value.hint
    hidden = instantiate(mission("bi"), seed=0)
    with pytest.raises(MissionError, match="no bridge for `fracture`") as caught:
        anchor(hidden, city_of("cr", 0))
    assert "of its place in" in str(caught.value), "a hidden place stays hidden"
    odd = msgspec.structs.replace(base.entities[0], properties={"on": "cloud"})
    with pytest.raises(MissionError, match="on 'cloud'"):
        anchor(msgspec.structs.replace(base, entities=(odd,)), city_of("cr", 0))


@pytest.mark.parametrize("kind", ["road", "roof", "facade", "ground", ""])
def test_drawn_entities_stay_in_their_region(kind: str) -> None:
    """If the nearest road, roof or door lies outside of a small region, the next one inside is used, or none."""
    base, city = instantiate(mission("ufr"), seed=0), city_of("ufr", 0)
    fire = next(entity for entity in base.entities if entity.group == "fire")
    accepted = refused = 0
    for step in range(24):
        x, y = -430.0 + 37.0 * step, 300.0 - 29.0 * step
        region = ((x, y), (x + 40.0, y), (x + 40.0, y + 40.0), (x, y + 40.0))
        odd = msgspec.structs.replace(
            fire, position=(x + 39.0, y + 39.0, 0.0), drawn_in=region, properties={"on": kind} if kind else {}
        )
        try:
            (placed,) = anchor(msgspec.structs.replace(base, entities=(odd,)), city).entities
        except MissionError as error:
            assert "in the region it is drawn from" in str(error) and f"{x:g}" not in str(error)
            refused += 1
            continue
        assert shapely.Polygon(region).covers(shapely.Point(placed.position[:2]))
        accepted += 1
    assert accepted >= 5 and (refused >= 1 or kind in ("ground", ""))


@pytest.mark.parametrize("name", NINE)
def test_drawn_places_of_the_missions_stay_in_their_regions(name: str) -> None:
    for entity in anchored(name, 1)[0].entities:
        assert not entity.drawn_in or shapely.Polygon(entity.drawn_in).covers(shapely.Point(entity.position[:2]))


@pytest.mark.parametrize(
    ("position", "words"),
    [
        ((5000.0, 20.0, 30.0), r"begins at \(5000 m, 20 m\), outside of the scene `commercial-"),
        ((0.0, -420.0, -30.0), "at an elevation of -30 m, under the surface of the scene, which lies at 0"),
    ],
)
def test_an_asset_outside_of_the_city_or_under_it_is_refused(position: tuple[float, float, float], words: str) -> None:
    base, city = instantiate(mission("ufr"), seed=0), city_of("ufr", 0)
    entities = tuple(msgspec.structs.replace(e, position=position) if e.id == "uav[1]" else e for e in base.entities)
    with pytest.raises(MissionError, match=words):
        anchor(msgspec.structs.replace(base, entities=entities), city)


@pytest.mark.parametrize(
    ("engine", "position", "words"),
    [
        ("road", (-150.0, 0.0, 60.0), "elevation of 60 m, and is always on a road, which lies at 12 m"),
        ("quadruped", (-150.0, 0.0, 90.0), "elevation of 90 m, and is always on the ground, which lies at"),
        ("vessel", (-150.0, 0.0, -3.0), "which is on land"),
        ("vessel", (900.0, 300.0, 20.0), "elevation of 20 m, and is always on the water, which lies at -"),
        ("road", (-150.0, 0.0, 5.0), ""),
        ("quadruped", (-150.0, 0.0, 1.0), ""),
        ("vessel", (900.0, 300.0, 1.0), ""),
    ],
)
def test_entities_bound_to_a_surface_are_rejected_off_it(
    engine: str, position: tuple[float, float, float], words: str
) -> None:
    spec, city = instantiate(mission("bi"), seed=0), city_of("bi", 0)
    properties = {"on": "road"} if engine == "road" else {}
    entity = msgspec.structs.replace(
        spec.entities[-1], id="it", role="asset", engine=engine, properties=properties, hidden=(), position=position
    )
    alone = msgspec.structs.replace(spec, entities=(entity,))
    if words:
        with pytest.raises(MissionError, match=words):
            anchor(alone, city)
    else:
        anchor(alone, city)


@pytest.mark.parametrize("name", ["bi", "ssr"])
def test_the_anchor_and_the_terrain_agree_about_water(name: str) -> None:
    """The anchor and the engines agree about water, also over land that lies below it."""
    city = city_of(name, 0)
    deep = Land(polygon=((600.0, -300.0), (900.0, -300.0), (900.0, 300.0)), top_m=-20.0, surface="sand")
    city = msgspec.structs.replace(city, lands=(*city.lands, deep))
    footing, terrain, chance = Footing(city), Terrain(city), random.Random(3)
    places = [(chance.uniform(-900.0, 1500.0), chance.uniform(-900.0, 900.0)) for _ in range(300)]
    wet = [footing.is_water(*place) for place in places]
    assert wet == [terrain.water_level(*place) is not None for place in places]
    assert 5 < len(wet) - sum(wet) < 295


def test_an_asset_without_an_elevation_is_placed_on_the_ground_not_at_the_water_level() -> None:
    spec = msgspec.structs.replace(instantiate(mission("ufr"), seed=0), scene=instantiate(mission("bi"), seed=0).scene)
    uav = msgspec.structs.replace(spec.entities[-1], id="uav", role="asset", engine="multirotor", properties={})
    city = city_of("bi", 0)
    assert city.datum_m < -1.0
    low = msgspec.structs.replace(uav, position=(-150.0, 0.0, city.datum_m))
    (placed,) = anchor(msgspec.structs.replace(spec, entities=(low,)), city).entities
    assert placed.position[2] == Footing(city).height(*placed.position[:2]) > -0.5


def test_the_proofs_about_places_use_the_extents_of_the_scenes() -> None:
    for name in ("ssr", "cd", "ufr", "cr"):
        reach = reach_m(instantiate(mission(name), seed=0).scene)
        assert reach is not None and city_of(name, 0).bounds == (-reach, -reach, reach, reach)


def test_a_stored_city_and_an_inline_city_give_the_same_places(tmp_path) -> None:
    instance, city = anchored("ufr", 2, fires=4)
    pieces = ("areas", "solids", "slopes", "buildings", "roads", "junctions", "bridges", "pipes", "props")
    light = msgspec.structs.replace(city, **dict.fromkeys((*pieces, "waters", "lands"), ()))
    stored = write_store(tmp_path / "city", light, city)
    again = anchor(instantiate(mission("ufr"), seed=2, settings={"fires": 4}), stored)
    assert [e.position for e in again.entities if e.group == "fire"] == [
        e.position for e in instance.entities if e.group == "fire"
    ]


ON_MAP = 'region main = road("Central Avenue")\n  region strip = along(main, 20 m)\n  region district'


def test_regions_made_of_roads_get_outlines() -> None:
    text = (SCENARIOS / "cr.ljs").read_text(encoding="utf-8").replace("region district", ON_MAP)
    compiled = compile_source(SourceText(text, "m.ljs")).mission
    assert compiled is not None
    base = instantiate(compiled, seed=0)
    assert [region.name for region in base.regions if region.on_map is not None] == ["main", "strip"]
    instance = anchor(base, city_of("cr", 0))
    regions = {region.name: shapely.Polygon(region.polygon) for region in instance.regions}
    assert all(region.on_map is None for region in instance.regions)
    main = regions["main"]
    assert main.is_valid and main.contains(shapely.Point(0, 100)) and main.contains(shapely.Point(0, 0))
    assert not main.contains(shapely.Point(15, 100)) and main.bounds[3] > 350.0
    assert regions["strip"].contains(shapely.Point(15, 100)) and not regions["strip"].contains(shapely.Point(40, 100))
    wrong = compile_source(SourceText(text.replace("Central Avenue", "Nowhere Lane"), "m.ljs")).mission
    assert wrong is not None
    with pytest.raises(MissionError, match="no road named 'Nowhere Lane'") as caught:
        anchor(instantiate(wrong, seed=0), city_of("cr", 0))
    assert "Avenue" in caught.value.hint


def yard() -> City:
    """A lane along the south, two objects of different size in the west, and a step, a wall and a beam in the east."""
    lane = Lane(id="s_0", shape=((0.0, -50.0, 0.0), (100.0, -50.0, 0.0)), width_m=3.0)
    foot = Lane(id="s_1", shape=((0.0, -60.0, 0.0), (100.0, -60.0, 0.0)), width_m=2.0, kind="foot")
    under = Lane(id="t_0", shape=((0.0, 50.0, 0.0), (100.0, 50.0, 0.0)), width_m=3.0)
    props = [
        Prop(id=cls, cls=cls, model=cls, position=(x, 0.0, 0.0), scale=scale)
        for cls, x, scale in (("parked_truck", -80.0, 1.0), ("bench", -50.0, 0.5), ("sign", -30.0, 1.0))
    ]
    solids = [
        Solid(id=name, polygon=((x, 0.0), (x + 4.0, 0.0), (x + 4.0, 4.0), (x, 4.0)), base_m=base, top_m=top)
        for name, x, base, top in (("step", 20.0, 0.0, 0.4), ("wall", 50.0, 0.0, 3.0), ("beam", 80.0, 2.5, 4.0))
    ]
    return City(
        id="yard", origin=(31.0, 121.5), bounds=(-100.0, -100.0, 120.0, 100.0), props=tuple(props),
        solids=tuple(solids), roads=(Road(id="s", lanes=(lane, foot)), Road(id="t", lanes=(under,), tunnel=True)),
    )  # fmt: skip


@pytest.mark.parametrize(
    ("x", "y", "margin", "clear", "off_road"),
    [
        (50.0, -47.4, 1.0, True, True), (50.0, -47.6, 1.0, True, False),  # on a lane, which alone blocks off the road
        (50.0, -52.6, 1.0, True, True), (102.4, -50.0, 1.0, True, False), (102.6, -50.0, 1.0, True, True),
        (50.0, -60.0, 1.0, True, True), (50.0, 50.0, 1.0, True, True),  # a pavement and a tunnel
        (-75.3, 0.0, 0.0, False, False), (-75.1, 0.0, 0.0, True, True), (-80.0, 5.7, 1.0, False, False),
        (-80.0, 5.9, 1.0, True, True), (-50.0, 0.9, 0.5, False, False), (-50.0, 1.1, 0.5, True, True),
        (-30.0, 0.0, 0.0, True, True),  # a sign blocks nothing
        (22.0, 2.0, 1.0, True, True), (82.0, 2.0, 1.0, True, True),  # onto a step, and under a beam
        (52.0, 2.0, 0.0, False, False), (49.1, 2.0, 1.0, False, False), (48.9, 2.0, 1.0, True, True),
    ],
)  # fmt: skip
def test_a_place_is_clear_if_no_obstacle_or_lane_is_within_the_margin(
    x: float, y: float, margin: float, clear: bool, off_road: bool
) -> None:
    footing = Footing(yard())
    assert footing.is_clear(x, y, margin) == clear
    assert footing.is_clear(x, y, margin, off_road=True) == off_road
