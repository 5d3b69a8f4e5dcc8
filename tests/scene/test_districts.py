"""Procedural districts: equal for equal specs, on a valid network, with space for the missions."""

import os
import subprocess
import sys
from pathlib import Path

import msgspec
import pytest
import shapely

from lingjing.errors import UsageError
from lingjing.mission.instance import SceneSpec
from lingjing.scene.city import City
from lingjing.scene.districts import build
from lingjing.scene.districts.district import build_district
from lingjing.scene.districts.draft import KERB_M
from lingjing.scene.districts.options import plan
from lingjing.scene.footing import Footing
from lingjing.scene.lines import point_at, project
from lingjing.scene.tiles import Tiles
from lingjing.testing import PluginHost, compile_text, instantiate

KINDS = ("residential", "industrial", "commercial", "campus", "logistics", "coastal")
DRONE = """ljs 1
use std.air { quadrotor }
mission drone "Drone" {
  goal "Stay."
  scene SCENE
  clock { tick = 10 s, sync = 1 s }
  budget { ticks <= 3 }
  mode broadcast
  region r = box((-1 m, -1 m), (1 m, 1 m))
  asset u : quadrotor { position = (0 m, 0 m, 30 m), actions { stop } }
  agent a as a controls u { observes u.* }
  success when u in r
}
"""


@pytest.fixture(autouse=True, scope="module")
def cache_folder(tmp_path_factory):
    before = os.environ.get("XDG_CACHE_HOME")
    os.environ["XDG_CACHE_HOME"] = str(tmp_path_factory.mktemp("cache"))
    yield
    if before is None:
        del os.environ["XDG_CACHE_HOME"]
    else:
        os.environ["XDG_CACHE_HOME"] = before


def district(kind: str, layout: int = 1, seed: int = 0, **options: object) -> City:
    datum = -3.0 if kind in ("coastal", "city") else 0.0
    return build(SceneSpec(kind=kind, layout=layout, seed=seed, datum_m=datum, options=options))


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_of_district_is_built_reproducibly(kind: str) -> None:
    cities = [district(kind, layout) for layout in (1, 2, 3)]
    assert len({city.sha256 for city in cities}) == 3
    again = district(kind, 1)
    assert again == cities[0] and again.sha256 == cities[0].sha256
    for city in cities:
        assert len(city.buildings) > 25 and len(city.roads) > 20 and len(city.junctions) > 9
        assert {"tree", "lamp"} <= {prop.cls for prop in city.props}
        assert len({building.id for building in city.buildings}) == len(city.buildings)
        assert Path(city.network).is_file()


def test_a_coastal_episode_changes_only_floating_objects() -> None:
    options = {"extent_m": 600.0, "bridge": ((-60.0, 0.0), (150.0, 10.0), (280.0, 5.0))}
    first, second = (district("coastal", 3, seed=seed, **options) for seed in (11, 12))
    assert first.buildings is second.buildings and first.roads is second.roads
    assert first.props != second.props and first.sha256 != second.sha256
    for city, seed in ((first, 11), (second, 12)):
        spec = SceneSpec(kind="coastal", layout=3, seed=seed, datum_m=-3.0, options=options)
        assert build_district(plan(spec)) == city  # laid out from nothing


@pytest.mark.parametrize("kind", KINDS)
def test_buildings_stand_apart_from_each_other_and_from_the_roads(kind: str) -> None:
    city = district(kind, 5)
    shapes = [shapely.Polygon(building.polygon) for building in city.buildings]
    assert all(shape.is_valid and shape.exterior.is_ccw for shape in shapes)
    lanes = shapely.union_all([
        shapely.LineString([point[:2] for point in lane.shape]).buffer(lane.width_m / 2)
        for road in city.roads if not road.bridge for lane in road.lanes
    ])  # fmt: skip
    assert not any(lanes.intersects(shape) for shape in shapes)
    tree = shapely.STRtree(shapes)
    for building, shape in zip(city.buildings, shapes, strict=True):
        for k in tree.query(shape):
            other = city.buildings[k]
            apart = building.base_m >= other.top_m or other.base_m >= building.top_m or building is other
            assert apart or shape.intersection(shapes[k]).area < 0.01, (building.id, other.id)
        assert building.top_m > building.base_m and building.levels >= 1
    lanes_of_doors = [b for b in city.buildings if b.entrance is not None]
    assert len(lanes_of_doors) > 0.3 * len(city.buildings)
    for building in lanes_of_doors:
        x, y, _ = building.entrance
        assert shapely.Polygon(building.polygon).exterior.distance(shapely.Point(x, y)) < 0.01


def test_props_stand_clear_of_buildings() -> None:
    city = district("industrial", 4, extent_m=500.0)
    walls = [shapely.Polygon(building.polygon) for building in city.buildings]
    tree = shapely.STRtree(walls)
    for prop in city.props:
        spot = shapely.Point(prop.position[:2])
        assert not any(walls[k].contains(spot) for k in tree.query(spot)), prop.id


def test_a_block_is_a_kerb_high_and_its_corners_are_ramps() -> None:
    city = district("residential", 2)
    footing = Footing(city)
    assert footing.height(20.0, 20.0) == KERB_M
    assert footing.height(0.0, 60.0) == 0.0, "streets are at 0"
    kerbs = [solid for solid in city.solids if solid.id.startswith("kerb")]
    ramps = [slope for slope in city.slopes if slope.id.startswith("dropped-kerb")]
    assert len(ramps) == 4 * len(kerbs)
    for ramp in ramps[:40]:
        heights = sorted(z for _, _, z in ramp.top)
        assert heights == [0.0, 0.0, KERB_M, KERB_M]
        outline = shapely.Polygon([point[:2] for point in ramp.top])
        assert outline.exterior.is_ccw
        assert all(outline.intersection(shapely.Polygon(kerb.polygon)).area < 1e-3 for kerb in kerbs)


COMPOUND = ((0.0, -150.0), (300.0, -150.0), (300.0, 150.0), (0.0, 150.0))


def test_a_compound_has_no_streets_a_wall_with_a_gate_and_houses_that_differ() -> None:
    city = district("residential", 3, extent_m=500.0, blocks_rows=4.0, blocks_columns=4.0, height_low_m=9.0,
                    height_high_m=24.0, inside=COMPOUND)  # fmt: skip
    site = shapely.box(0, -150, 300, 150)
    assert not any(site.intersects(shapely.LineString(lane.shape)) for road in city.roads for lane in road.lanes)
    homes = [b for b in city.buildings if site.contains(shapely.Polygon(b.polygon))]
    assert len(homes) >= 16
    assert len({home.colour for home in homes}) >= 14, "most can be told apart by colour"
    footing = Footing(city)
    for step in range(-60, 100, 2):
        assert footing.is_clear(float(step), 0.0, 0.5), f"the way in through the gate is free at {step}"
    assert not footing.is_clear(0.0, 40.0, 0.5), "the wall"


def test_detached_homes_have_their_doors_on_any_side_and_a_canopy_on_the_others() -> None:
    """In a depth image a door is one canopy of four, and no step shows it."""
    yard = ((180.0, 170.0), (360.0, 170.0), (360.0, 330.0), (180.0, 330.0))
    city = district("residential", 3, extent_m=900.0, blocks_rows=5.0, blocks_columns=5.0, homes=yard, detached=1.0)
    around = shapely.Polygon(yard)
    houses = [b for b in city.buildings if b.entrance is not None and around.contains(shapely.Polygon(b.polygon))]
    assert len(houses) >= 25 and len({house.entrance[2] for house in houses if house.entrance}) == 4
    solids = [(solid.id, shapely.Polygon(solid.polygon)) for solid in city.solids]
    for house in houses:
        near = [name for name, outline in solids if outline.distance(shapely.Polygon(house.polygon)) < 0.1]
        assert sum(name.startswith("canopy") for name in near) == 3
        assert not any(name.startswith("step") for name in near)


def test_the_ways_through_a_factory_are_free_from_gate_to_gate() -> None:
    inside = ((-80.0, -60.0), (80.0, -60.0), (80.0, 60.0), (-80.0, 60.0))
    for layout in range(6):
        city = district("industrial", layout, extent_m=320.0, blocks_rows=3.0, blocks_columns=4.0, inside=inside)
        footing = Footing(city)
        for east in range(-85, 86, 2):
            assert footing.is_clear(float(east), 0.0, 0.6)
        for north in range(-65, 61, 2):
            assert footing.is_clear(0.0, float(north), 0.6)
        halls = [b for b in city.buildings if shapely.box(-80, -60, 80, 60).contains(shapely.Polygon(b.polygon))]
        assert len(halls) >= 4


def test_a_pipeline_lies_at_the_declared_place_on_open_ground() -> None:
    line = ((-60.0, -40.0), (-60.0, 40.0), (20.0, 40.0), (20.0, -30.0), (60.0, -30.0))
    city = district("industrial", 1, extent_m=300.0, blocks_rows=2.0, blocks_columns=3.0, pipeline=line)
    main = next(pipe for pipe in city.pipes if pipe.id == "pipeline")
    assert [point[:2] for point in main.path] == list(line)
    footing = Footing(city)
    start = shapely.Point(0, -50)
    for x, y in ((-60, -20), (-60, 15), (-30, 40), (0, 40), (20, 20), (20, -10), (45, -30)):
        way = shapely.LineString([start, (x, y)])
        for k in range(21):
            spot = way.interpolate(k / 20, normalized=True)
            assert footing.is_clear(spot.x, spot.y, 0.5), (x, y)


def test_a_bridge_runs_from_the_streets_over_the_water() -> None:
    shore = ((-120.0, -800.0), (-100.0, 0.0), (-130.0, 800.0))
    bridge = ((-150.0, 0.0), (400.0, 30.0), (1000.0, 20.0))
    city = district("coastal", 1, extent_m=1600.0, shore=shore, bridge=bridge)
    footing = Footing(city)
    assert footing.is_water(500.0, 200.0) and not footing.is_water(-150.0, 0.0) and not footing.is_water(1010.0, 20.0)
    deck = next(item for item in city.bridges if item.id == "bridge")
    assert all(z == 12.0 for _, _, z in deck.path)
    spans = [road for road in city.roads if road.bridge]
    assert len(spans) == 2
    for lane in spans[0].lanes:
        line = shapely.LineString([point[:2] for point in lane.shape])
        assert line.distance(shapely.Point(700, 25)) < 10.0
        assert max(z for _, _, z in lane.shape) == 12.0 and min(z for _, _, z in lane.shape) < 0.5
        ramp = next(item for item in city.bridges if item.id == "bridge-ramp").path
        for x, y, z in lane.shape:
            if x < -150.0:
                assert z == pytest.approx(point_at(ramp, project(ramp, x, y).at_m)[0][2], abs=0.05), "on the ramp"
    slab, width = next(item for item in city.bridges if item.id == "bridge-ramp"), deck.width_m / 2.0
    way = shapely.LineString([point[:2] for point in (*slab.path[:2], *deck.path[1:])])
    parts = [shapely.LineString([point[:2] for point in item.path]) for item in (slab, deck)]
    paved = shapely.union_all([part.buffer(width, cap_style="flat", join_style="mitre") for part in parts])
    missing = way.buffer(width - 0.05, cap_style="flat", join_style="mitre").difference(paved)
    assert missing.area < 0.01, "no gap where the ramp bends into the bridge"
    paving = [area for area in city.areas if area.surface == "asphalt" and area.top_m == 0.0]
    assert all(any(shapely.Polygon(a.polygon).contains(shapely.Point(*j.polygon[0])) for a in paving)
               for j in city.junctions if j.elevation_m == 0.0 and not j.id.startswith("bridge"))  # fmt: skip
    names = {prop.cls for prop in city.props}
    assert {"buoy", "moored_boat", "container"} <= names
    other = district("coastal", 1, seed=9, extent_m=1600.0, shore=shore, bridge=bridge)
    assert other.buildings == city.buildings and other.props != city.props, "a seed moves what floats, nothing else"
    assert [p for p in other.props if not p.floating] == [p for p in city.props if not p.floating]


def test_a_city_has_all_districts_and_keeps_them_in_tiles() -> None:
    city = district("city", 1, extent_m=2500.0)
    assert city.store and not city.buildings and city.network.startswith(city.store)
    tiles = Tiles(city, keep=4)
    uses: dict[str, int] = {}
    for tile in tiles:
        for building in tile.buildings:
            uses[building.use] = uses.get(building.use, 0) + 1
    assert sum(uses.values()) > 1500
    assert {"residential", "industrial", "commercial", "school", "warehouse", "office", "house"} <= set(uses)
    assert district("city", 1, extent_m=2500.0) == city
    assert district("city", 1, seed=7, extent_m=2500.0).sha256 == city.sha256, "one city for every episode"
    assert district("city", 2, extent_m=2500.0).sha256 != city.sha256


def test_a_city_is_the_same_in_another_process_with_another_hash_seed() -> None:
    program = (
        "from lingjing.scene.districts import build; from lingjing.mission.instance import SceneSpec;"
        "print(build(SceneSpec(kind='logistics', layout=1)).sha256)"
    )
    run = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True,
        env={**os.environ, "PYTHONHASHSEED": "77"},
    )  # fmt: skip
    assert run.stdout.strip() == district("logistics", 1).sha256


@pytest.mark.parametrize("kind", ["residential", "industrial", "logistics", "coastal"])
@pytest.mark.parametrize("blocks", [(1.0, 1.0), (1.0, 2.0), (3.0, 1.0), (2.0, 2.0)])
@pytest.mark.parametrize("inside_m", [0.0, 30.0, 145.0])
def test_a_road_runs_around_a_site_that_fills_the_scene(
    kind: str, blocks: tuple[float, float], inside_m: float
) -> None:
    """One block, a site as large as its scene, a strip by the sea: each has a road, and no building stands on it."""
    options: dict[str, object] = {"extent_m": 300.0, "blocks_rows": blocks[0], "blocks_columns": blocks[1]}
    if inside_m:
        h = inside_m
        options["inside"] = ((-h, -h), (h, -h), (h, h), (-h, h))
    city = build(SceneSpec(kind=kind, options=options, datum_m=-3.0 if kind == "coastal" else 0.0))
    lanes = [lane for road in city.roads for lane in road.lanes if lane.kind == "car"]
    assert lanes
    houses = shapely.union_all([shapely.Polygon(building.polygon) for building in city.buildings])
    for lane in lanes:
        assert shapely.LineString(lane.shape).distance(houses) > lane.width_m / 2.0
        assert not any(Footing(city).is_water(*place) for place in ((x, y) for x, y, *_ in lane.shape))


def test_streets_have_names_and_some_junctions_have_lights() -> None:
    city = district("commercial", 1)
    names = {road.name for road in city.roads}
    assert {"Central Avenue", "Central Street", "Avenue E1", "Street S1"} <= names
    lit = [junction for junction in city.junctions if junction.lights]
    assert 0 < len(lit) < len(city.junctions)
    assert {len(road.lanes) for road in city.roads} == {1, 2}


@pytest.mark.parametrize(
    ("kind", "options", "words"),
    [
        ("residential", {"colour": "red"}, "has no option `colour`"),
        ("residential", {"extent_m": 20.0}, "`extent` is 20.0"),
        ("residential", {"extent_m": True}, "`extent` is True"),
        ("industrial", {"inside": ((0.0, 1.0), (2.0, 3.0))}, "`inside` is no line"),
        ("residential", {"bridge": ((0.0, 0.0), (9.0, 9.0))}, "has no `bridge`"),
        ("city", {"inside": ((0.0, 0.0), (9.0, 0.0), (9.0, 9.0))}, "has no option `inside`"),
        ("commercial", {"height_low_m": 50.0, "height_high_m": 10.0}, "`height` is 10.0"),
    ],
)
def test_invalid_options_are_refused(kind: str, options: dict[str, object], words: str) -> None:
    with pytest.raises(UsageError, match=words):
        district(kind, **options)


def test_a_sea_that_would_flood_the_town_is_refused() -> None:
    with pytest.raises(UsageError, match="flood") as caught:
        build(SceneSpec(kind="coastal", datum_m=0.0))
    assert "-3 m" in caught.value.hint


@pytest.mark.parametrize(
    ("scene", "level"),
    [
        ("coastal { extent = 800 m }", -3.0),
        ("city { extent = 1 km }", -3.0),
        ("industrial { extent = 400 m, shore = [(100 m, -200 m), (100 m, 200 m)] }", -3.0),
        ("coastal { extent = 800 m, datum = sea level at -2 m }", -2.0),
        ("industrial { extent = 400 m }", 0.0),
        ("bay { }", 0.0),
    ],
)
def test_a_mission_by_the_sea_may_omit_the_sea_level(scene: str, level: float) -> None:
    compiled = compile_text(DRONE.replace("SCENE", scene))
    assert compiled.mission is not None
    spec = instantiate(compiled.mission, seed=1).scene
    assert spec.datum_m == level
    city = PluginHost().scenes[spec.kind].build(spec)
    assert {water.level_m for water in city.waters} <= {level}


def test_the_kinds_are_declared_as_scenes() -> None:
    scenes = PluginHost().scenes
    assert {*KINDS, "city"} <= set(scenes)
    assert scenes["campus"].build(SceneSpec(kind="campus", layout=1)).id == "campus-1"
    assert msgspec.msgpack.decode(msgspec.msgpack.encode(district("campus")), type=City) == district("campus")


def test_a_large_compound_has_more_houses_than_there_are_colours() -> None:
    wide = ((-800.0, -800.0), (700.0, -800.0), (700.0, 700.0), (-800.0, 700.0))
    city = district("residential", 3, extent_m=2000.0, blocks_rows=8.0, blocks_columns=8.0, inside=wide)
    assert len(city.buildings) > 300


@pytest.mark.parametrize("kind", ["residential", "coastal"])
def test_a_district_at_another_centre_is_the_translated_district(kind: str) -> None:
    """Every point of the district and of its network is translated like its centre."""
    east, north = -4000.0, 2500.0
    options = {"extent_m": 400.0, "blocks_rows": 2.0, "blocks_columns": 2.0}
    here, there = district(kind, **options), district(kind, **options, centre=((east, north),))
    assert there.bounds == tuple(edge + (north if k % 2 else east) for k, edge in enumerate(here.bounds))
    for before, after in zip(here.buildings, there.buildings, strict=True):
        assert after.polygon == tuple((pytest.approx(x + east), pytest.approx(y + north)) for x, y in before.polygon)
    for before, after in zip(here.roads, there.roads, strict=True):
        assert after.lanes[0].shape[0][:2] == pytest.approx(
            (before.lanes[0].shape[0][0] + east, before.lanes[0].shape[0][1] + north), abs=0.02
        )
    assert len(there.props) == len(here.props) and there.sha256 != here.sha256
