from pathlib import Path

import pytest
import shapely

from lingjing.scene.city import Building
from lingjing.scene.osm.buildings import buildings
from lingjing.scene.osm.heights import heights
from lingjing.scene.osm.tags import colour, layer
from tests.scene.osm_maps import Map, square


def built(made: Map, folder: Path, seed: int = 0) -> dict[str, Building]:
    return {building.id: building for building in buildings(made.features(folder), seed).buildings}


def test_colours_and_layers_are_read_or_missing() -> None:
    assert colour({"c": "#ff0000"}, "c") == (1.0, 0.0, 0.0)
    assert colour({"c": "#FFF"}, "c") == colour({"c": "white"}, "c") == (1.0, 1.0, 1.0)
    assert colour({"c": "light_grey"}, "c") == colour({"c": "lightgray"}, "c") is not None
    assert colour({"c": "of the sea"}, "c") is None
    assert [layer(tags) for tags in ({}, {"bridge": "yes"}, {"tunnel": "yes"}, {"layer": "2"}, {"layer": "x"})] == [
        0, 1, -1, 2, 0
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("tags", "wanted"),
    [
        ({"height": "30"}, (0.0, 30.0, 0.0)),
        ({"height": "30", "min_height": "10"}, (10.0, 30.0, 0.0)),
        ({"building:levels": "5"}, (0.0, 15.0, 0.0)),
        ({"building:levels": "5", "building:min_level": "2"}, (6.0, 15.0, 0.0)),
        ({"building:levels": "5", "roof:shape": "gabled", "roof:height": "4"}, (0.0, 19.0, 4.0)),
        ({"height": "9", "roof:shape": "gabled", "roof:height": "40"}, (0.0, 9.0, 9.0)),
        ({"height": "9", "min_height": "12"}, (0.0, 9.0, 0.0)),
        ({"height": "-3"}, (0.0, 18.0, 0.0)),
        ({"height": "99999"}, (0.0, 18.0, 0.0)),
        ({"height": "0"}, (0.0, 18.0, 0.0)),
        ({"height": "0", "building:levels": "2"}, (0.0, 6.0, 0.0)),
        ({"height": "tall", "est_height": "~12 m"}, (0.0, 12.0, 0.0)),
        ({"building:height": "21米"}, (0.0, 21.0, 0.0)),
        ({"levels": "G+4"}, (0.0, 15.0, 0.0)),
        ({"building:levels": "0"}, (0.0, 3.0, 0.0)),
        ({"building:levels": "0", "roof:shape": "gabled", "roof:levels": "2"}, (0.0, 5.4, 5.4)),
        ({"building": "roof", "height": "5"}, (4.5, 5.0, 0.0)),
        ({}, (0.0, 18.0, 0.0)),
    ],
)
def test_heights_follow_the_tags_and_invalid_ones_are_ignored(tags: dict[str, str], wanted: tuple[float, ...]) -> None:
    roof = tags.get("roof:shape", "flat")
    assert heights(tags, 3.0, roof, untagged_storeys=6, narrow_m=10.0)[:3] == wanted


def test_a_house_is_placed_by_the_map_in_metres(tmp_path: Path) -> None:
    made = Map()
    made.way(square(10.0, 20.0, 30.0, 12.0), {"building": "apartments", "height": "21", "name": "Long House"})
    (house,) = built(made, tmp_path).values()
    assert sorted(house.polygon) == [pytest.approx(p, abs=0.05) for p in ((10, 20), (10, 32), (40, 20), (40, 32))]
    assert (house.base_m, house.top_m, house.use, house.facade, house.name) == (
        0.0, 21.0, "residential", "punched", "Long House"
    )  # fmt: skip
    assert house.levels == 7


def test_building_parts_replace_their_outline(tmp_path: Path) -> None:
    made = Map()
    made.way(square(0, 0, 40), {"building": "office", "height": "100", "name": "Tower", "building:colour": "#ff0000"})
    made.way(square(0, 0, 30), {"building:part": "yes", "height": "60"})
    made.way(square(5, 5, 20), {"building:part": "yes", "height": "100", "min_height": "60"})
    made.way(square(100, 0, 40), {"building": "yes", "height": "30"})
    made.way(square(100, 0, 10), {"building:part": "yes", "height": "50"})
    buildings = built(made, tmp_path)
    assert set(buildings) == {"w2", "w3", "w4", "w5"}
    assert buildings["w3"].base_m == 60.0
    assert {buildings[key].name for key in ("w2", "w3")} == {"Tower"}
    assert buildings["w2"].colour == (1.0, 0.0, 0.0)
    # a part that covers little of its outline stands beside the remainder of the outline
    assert len(buildings["w4"].polygon) == 6
    assert buildings["w5"].top_m == 50.0


def test_a_relation_may_have_courtyards_and_several_outlines(tmp_path: Path) -> None:
    made = Map()
    outer, inner = made.way(square(0, 0, 60)), made.way(square(20, 20, 20))
    second = made.way(square(100, 0, 20))
    made.relation([(outer, "outer"), (inner, "inner"), (second, "outer")], {"building": "yes", "height": "12"})
    buildings = built(made, tmp_path)
    assert sorted(buildings) == ["r1", "r1-1"]
    assert sorted(len(building.holes) for building in buildings.values()) == [0, 1]


def test_swapped_roles_and_members_named_twice_give_the_same_courtyard(tmp_path: Path) -> None:
    areas = []
    for roles, times in ((("outer", "inner"), 1), (("inner", "outer"), 1), (("outer", "inner"), 2)):
        made = Map()
        ways = made.way(square(0, 0, 60)), made.way(square(20, 20, 20))
        made.relation(list(zip(ways, roles, strict=True)) * times, {"building": "yes", "height": "12"})
        features = made.features(tmp_path)
        (area,) = (area for area in features.areas if area.ref == "r1")
        areas.append(area.shape.area)
        assert not features.skipped
    assert areas == pytest.approx([3200.0] * 3, abs=1.0)


def test_an_outline_may_consist_of_several_ways_and_must_close(tmp_path: Path) -> None:
    made = Map()
    first = made.way([(0, 0), (50, 0), (50, 50)])
    second = made.way([(0, 0), (0, 50), (50, 50)])
    made.relation([(first, "outer"), (second, "outer")], {"building": "yes", "height": "12"})
    made.relation([(first, "outer")], {"building": "yes"})
    made.relation([(777, "outer"), (first, "outer")], {"building": "yes"})
    made.way([(200, 0), (230, 0), (230, 30)], {"building": "yes"})
    features = made.features(tmp_path)
    assert [building.id for building in buildings(features, 0).buildings] == ["r1"]
    assert features.skipped == {"multipolygons that do not close": 2, "areas that do not close": 1}


def test_invisible_and_outer_buildings_are_left_out(tmp_path: Path) -> None:
    made = Map(half_m=100.0)
    made.way(square(0, 0, 20), {"building": "yes", "location": "underground"})
    made.way(square(30, 0, 20), {"building": "yes", "layer": "-1"})
    made.way(square(60, 0, 20), {"building": "no"})
    made.way(square(90, 0, 60), {"building": "yes"})
    made.way(square(85, 60, 20), {"building": "yes"})
    assert set(built(made, tmp_path)) == {"w5"}


def test_the_seed_decides_only_untagged_details(tmp_path: Path) -> None:
    made = Map()
    for k in range(20):
        made.way(square(-400 + 40 * k, 0, 30), {"building": "yes"})
    made.way(square(0, 100, 30), {"building": "yes", "height": "33", "building:colour": "silver"})
    first, again, other = built(made, tmp_path), built(made, tmp_path), built(made, tmp_path, seed=1)
    assert first == again
    assert [b.top_m for b in first.values()] != [b.top_m for b in other.values()]
    assert len({b.top_m for b in first.values()}) > 3
    assert other["w21"].top_m == 33.0
    assert other["w21"].colour == first["w21"].colour
    made.way(square(0, 200, 30), {"building": "yes"})
    more = built(made, tmp_path)
    assert {key: more[key] for key in first} == first  # one more house changes no other


def test_the_use_of_a_building_follows_from_tags_and_the_surrounding_land_use(tmp_path: Path) -> None:
    made = Map()
    made.way(square(-300, -300, 200), {"landuse": "industrial"})
    made.way(square(-250, -250, 30), {"building": "yes"})
    made.way(square(0, 0, 30), {"building": "yes", "height": "120"})
    made.way(square(50, 0, 30), {"building": "school"})
    made.way(square(100, 0, 30), {"building": "yes", "building:material": "glass"})
    buildings = built(made, tmp_path)
    assert [buildings[key].use for key in ("w2", "w3", "w4")] == ["industrial", "office", "school"]
    assert buildings["w2"].facade == "industrial"
    assert buildings["w5"].facade == "curtain"


def test_untagged_blocks_look_like_tagged_blocks_nearby(tmp_path: Path) -> None:
    made = Map(half_m=2000.0)
    made.way(square(-1900, -1900, 3800), {"landuse": "commercial"})
    for k in range(12):
        made.way(square(-200 + 40 * k, 0, 30), {"building": "apartments", "building:levels": str(4 + k % 4)})
        made.way(square(-200 + 40 * k, 1500, 30), {"building": "office", "building:levels": str(20 + k % 4)})
    low = [f"w{made.way(square(-200 + 40 * k, 60, 30), {'building': 'yes'})}" for k in range(12)]
    high = [f"w{made.way(square(-200 + 40 * k, 1560, 30), {'building': 'yes'})}" for k in range(12)]
    alone = [f"w{made.way(square(-200 + 40 * k, -1500, 30), {'building': 'yes'})}" for k in range(12)]
    buildings = built(made, tmp_path)
    assert {buildings[key].use for key in (*low, *high, *alone)} == {"office"}
    assert all(2 <= buildings[key].levels <= 8 for key in low)
    assert all(15 <= buildings[key].levels <= 29 for key in high)
    assert all(1 <= buildings[key].levels <= 6 for key in alone)  # the land use alone makes no tower
    assert {buildings[key].facade for key in low} <= {"punched", "ribbon"}
    assert {buildings[key].facade for key in high} <= {"curtain", "ribbon"}
    assert len({buildings[key].levels for key in low}) > 1


def houses(made: Map, side: float, apart: float, count: int = 12, **tags: str) -> None:
    """Rows of buildings, ten to a row."""
    for number in range(10 * count):
        row, column = divmod(number, 10)
        made.way(square(-400 + column * apart, -400 + row * apart, side), {"building": "yes", **tags})


def test_untagged_buildings_among_houses_are_no_towers(tmp_path: Path) -> None:
    made = Map()
    houses(made, 11.0, 28.0)
    made.way(square(0, 0, 20, 40), {"building": "yes"})
    made.way(square(50, 0, 15, 15), {"building": "yes"})
    made.way(square(0, 60, 40), {"building": "yes"})
    made.way(square(60, 60, 20, 20), {"building": "apartments"})
    made.way(square(110, 60, 20, 20), {"building": "yes", "building:levels": "9"})
    for x in (-250, -180, -110):
        made.way([(x, 0), (x + 60, 0), (x + 60, 90), (x, 90), (x, 0)], {"landuse": "commercial"})
        made.way(square(x + 5, 5, 40), {"building": "yes"})
    built = {item.id: item.levels for item in buildings(made.features(tmp_path), 0).buildings}
    assert sorted(built.values())[-1] == 9
    assert sum(levels > 3 for levels in built.values()) <= 2  # the flats may have four
    assert all(levels >= 1 for levels in built.values())


def test_untagged_buildings_among_blocks_are_blocks_and_deep_ones_are_halls(tmp_path: Path) -> None:
    made = Map()
    houses(made, 22.0, 60.0, count=6)
    made.way(square(0, 300, 60, 80), {"building": "yes"})
    *blocks, hall = (item.levels for item in buildings(made.features(tmp_path), 0).buildings)
    assert sum(3 <= levels <= 6 for levels in blocks) == len(blocks)
    assert hall <= 3


def test_a_building_tagged_as_a_tower_is_tall_anywhere(tmp_path: Path) -> None:
    made = Map()
    houses(made, 11.0, 28.0)
    tower = made.way(square(0, 0, 25), {"building": "tower"})
    levels = {item.id: item.levels for item in buildings(made.features(tmp_path), 0).buildings}
    assert levels[f"w{tower}"] >= 6


def test_pieces_with_a_common_wall_are_separated(tmp_path: Path) -> None:
    made = Map()
    levels = {"building:part": "yes", "building:levels": "10"}
    made.way(square(0, 0, 60), {"building": "yes"})
    made.way(square(0, 0, 60), {"building:part": "yes", "height": "10"})  # a podium
    made.way(square(0, 0, 20), levels | {"height": "50"})  # a tower flush with two of its walls
    made.way(square(30, 30, 10), levels | {"height": "40"})  # a tower inside, clear of the walls
    made.way(square(100, 0, 20), {"building": "yes", "height": "12"})
    made.way(square(100, 0, 20, 40), {"building": "yes", "height": "12"})  # the same hall again, but longer
    made.way(square(200, 0, 40, 20), {"building": "yes", "height": "12"})
    made.way(square(220, 0, 40, 20), {"building": "yes", "height": "20"})  # a wing that half overlaps it
    buildings = built(made, tmp_path)
    podium, tower, clear = buildings["w2"], buildings["w3"], buildings["w4"]
    assert (podium.base_m, podium.top_m, podium.roof) == (0.0, 10.0, "bare")
    assert (tower.base_m, tower.top_m, tower.levels) == (10.0, 50.0, 8)
    assert (clear.base_m, clear.top_m) == (0.0, 40.0)
    assert "w5" not in buildings
    assert shapely.Polygon(buildings["w6"].polygon).area == pytest.approx(800.0, abs=2.0)
    assert shapely.Polygon(buildings["w7"].polygon).bounds == pytest.approx((200.0, 0.0, 220.0, 20.0), abs=0.1)
    assert shapely.Polygon(buildings["w8"].polygon).area == pytest.approx(800.0, abs=2.0)
    assert buildings["w8"].roof == "flat"


def test_neighbours_back_to_back_keep_their_roofs(tmp_path: Path) -> None:
    made = Map()
    made.way(square(0, 0, 20), {"building": "yes", "roof:shape": "flat", "height": "12"})
    made.way(square(20, 0, 20), {"building": "yes", "roof:shape": "flat", "height": "20", "min_height": "11.8"})
    buildings = built(made, tmp_path)
    assert [buildings[key].roof for key in ("w1", "w2")] == ["flat", "flat"]
    assert (buildings["w2"].base_m, buildings["w2"].top_m) == (11.8, 20.0)
