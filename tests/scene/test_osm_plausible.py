"""Gaps of maps are filled in the usual way: passages, quays, entrances, roofs, trees beside lanes, pipelines."""

from __future__ import annotations

from pathlib import Path

import pytest
import shapely

from lingjing.scene.city import Building, Pieces
from lingjing.scene.osm.build import Options, build
from lingjing.scene.tiles import Tiles
from tests.scene.osm_maps import Map, square

STREET = {"highway": "residential"}


def city_of(made: Map, folder: Path) -> Pieces:
    city = build(made.write(folder / "map.osm"), Options(), folder / "city").city
    tiles = list(Tiles(city))
    kinds = {kind: tuple(piece for tile in tiles for piece in getattr(tile, kind)) for kind in Pieces.__struct_fields__}
    return Pieces(**{**kinds, "waters": city.waters, "lands": city.lands})


def lanes_of(city: Pieces) -> list[tuple[shapely.LineString, float]]:
    return [
        (shapely.LineString([point[:2] for point in lane.shape]), max(point[2] for point in lane.shape))
        for road in city.roads
        for lane in road.lanes
        if lane.kind == "car"
    ]


def named(city: Pieces, ref: str) -> list[Building]:
    return [building for building in city.buildings if building.id.partition("-")[0] == ref]


def test_a_street_passes_through_a_high_building_and_beside_a_low_building(tmp_path: Path) -> None:
    made = Map()
    made.way([(-200, 0), (-40, 0), (40, 0), (200, 0)], STREET)
    made.way([(-200, 60), (-40, 60)], STREET)
    made.way([(-40, 60), (40, 60)], {**STREET, "tunnel": "building_passage"})
    made.way([(40, 60), (200, 60)], STREET)
    made.way(square(-20, -10, 40, 20), {"building": "apartments", "height": "18"})
    made.way(square(-20, 50, 40, 20), {"building": "apartments", "height": "18"})
    made.way(square(80, -10, 20, 20), {"building": "garage", "height": "3"})
    made.way(square(120, 1, 20, 15), {"building": "house", "height": "8"})
    city = city_of(made, tmp_path)
    lanes = lanes_of(city)
    for building in city.buildings:
        shape = shapely.Polygon(building.polygon)
        for line, top_m in lanes:
            assert line.intersection(shape).length < 0.05 or building.base_m >= top_m + 4.5
    for ref in ("w5", "w6"):
        above = [building for building in named(city, ref) if building.base_m > 0.0]
        (upper,) = above
        assert upper.top_m == 18.0 and shapely.Polygon(upper.polygon).area == pytest.approx(800.0, abs=2.0)
        below = [building for building in named(city, ref) if building.base_m == 0.0]
        assert len(below) == 2 and {building.top_m for building in below} == {upper.base_m}
    (house,) = named(city, "w8")
    assert 0.8 * 300 < shapely.Polygon(house.polygon).area < 300
    passed = [
        road for road in city.roads if "w" not in road.id and any(abs(p[1] - 60) < 3 for p in road.lanes[0].shape)
    ]
    assert passed and not any(road.tunnel for road in passed)


def test_entrances_are_mapped_or_face_the_street_on_free_ground(tmp_path: Path) -> None:
    made = Map()
    made.way([(-200, 0), (200, 0)], STREET)
    made.way([(0, 10), (10, 10), (20, 10), (20, 30), (0, 30), (0, 10)], {"building": "yes", "height": "9"})
    made.node(20, 30, entrance="yes")
    made.node(10, 30.0, entrance="main")
    made.way([(0, 30), (10, 30), (20, 30)], {"barrier": "no"})
    made.way(square(40, 10, 15), {"building": "house", "height": "7"})
    made.way(square(80, 10, 6), {"building": "garage"})
    made.way(square(100, 10, 30), {"building": "industrial", "height": "8"})
    made.way(square(140, 10, 15), {"building": "house", "height": "7"})
    made.way([(139, 8), (156, 8), (156, 9.5), (139, 9.5), (139, 8)], {"building": "shed", "height": "3"})
    city = city_of(made, tmp_path)
    doors = {ref: named(city, ref)[0].entrance for ref in ("w2", "w4", "w5", "w6", "w7")}
    assert doors["w2"] is not None and doors["w2"][:2] == pytest.approx((10.0, 30.0), abs=0.1)  # the main one
    assert doors["w4"] == (pytest.approx(47.5, abs=0.1), pytest.approx(10.0, abs=0.1), pytest.approx(180.0, abs=0.5))
    assert doors["w5"] is None and doors["w6"] is None
    assert doors["w7"] is not None and doors["w7"][1] > 10.5  # a shed stands before the wall at the street


def test_a_house_in_the_water_has_a_quay_or_stands_on_piles(tmp_path: Path) -> None:
    made = Map()
    made.way(square(-300, 0, 600, 200), {"natural": "water"})
    made.way(square(-100, -20, 30, 24), {"building": "yes", "height": "9"})
    made.way(square(50, 60, 20, 10), {"building": "boathouse", "height": "4"})
    made.way(square(0, -100, 20), {"building": "house"})
    city = city_of(made, tmp_path)
    wet = shapely.union_all([shapely.Polygon(water.polygon, water.holes) for water in city.waters])
    decks = shapely.union_all([shapely.Polygon(solid.polygon) for solid in city.solids])
    quay, boathouse = (shapely.Polygon(named(city, ref)[0].polygon) for ref in ("w2", "w3"))
    assert quay.intersection(wet).area < 0.1
    assert boathouse.intersection(wet).area > 100.0 and boathouse.difference(decks).area < 0.1
    assert any("pile" in solid.id for solid in city.solids if solid.id.startswith("platform"))


def test_a_mapped_tree_on_a_lane_stands_beside_it(tmp_path: Path) -> None:
    made = Map()
    made.way([(-200, 0), (200, 0)], STREET)
    made.way([(-150, 0.5), (-50, 0.5)], {"natural": "tree_row"})
    made.node(20, -1.0, natural="tree")
    made.way(square(40, -60, 40), {"building": "yes"})
    made.node(60, -40, natural="tree")
    city = city_of(made, tmp_path)
    trees = [prop.position for prop in city.props if prop.cls == "tree"]
    assert any(abs(x - 20) < 0.5 for x, _, _ in trees) and sum(x < -45 for x, _, _ in trees) >= 10
    for x, y, _ in trees:
        assert all(line.distance(shapely.Point(x, y)) > 1.6 for line, _ in lanes_of(city))
        assert not any(shapely.Polygon(b.polygon).contains(shapely.Point(x, y)) for b in city.buildings)


def test_a_pipeline_in_the_open_is_built_and_crosses_streets_on_a_gantry(tmp_path: Path) -> None:
    made = Map()
    made.way([(0, -200), (0, 200)], STREET)
    made.way(
        [(-100, 20), (-40, 20), (100, 20)], {"man_made": "pipeline", "location": "overground", "diameter": "800 mm"}
    )
    made.way([(-100, 60), (100, 60)], {"man_made": "pipeline", "location": "underground"})
    made.way(square(60, -60, 20), {"building": "yes"})
    city = city_of(made, tmp_path)
    (pipe,) = city.pipes  # the other lies under the ground
    assert pipe.radius_m == pytest.approx(0.4)
    over = {round(z, 1) for x, _, z in pipe.path if abs(x) < 3.0}
    assert over == {5.5} and {round(z, 1) for x, _, z in pipe.path if abs(x) > 10.0} == {0.9}


def test_small_houses_have_pitched_roofs_unless_tagged_neighbours_are_flat(tmp_path: Path) -> None:
    def share(tags: dict[str, str]) -> float:
        made = Map()
        for k in range(60):
            made.way(square(-400 + 30 * (k % 20), 40 * (k // 20), 11), {"building": "house"})
        for k in range(60):
            made.way(square(-400 + 30 * (k % 20), -200 - 40 * (k // 20), 11), {"building": "house", **tags})
        city = city_of(made, tmp_path / str(len(tags)))
        free = [b for b in city.buildings if int(b.id[1:].partition("-")[0]) <= 60]
        return sum(building.roof != "flat" for building in free) / len(free)

    (tmp_path / "0").mkdir()
    (tmp_path / "1").mkdir()
    usual, flat_place = share({}), share({"roof:shape": "flat"})
    assert usual > 0.45 and flat_place < 0.35
