from pathlib import Path

import pytest
import shapely

from lingjing.scene.city import Lane, Road
from lingjing.scene.osm import ground, structures, trees, water
from lingjing.scene.osm.footbridges import LEVEL_M, footbridges
from tests.scene.osm_maps import Map, square


def is_wet(made: Map, folder: Path, *places: tuple[float, float]) -> list[bool]:
    area = water.wet(made.features(folder))
    return [bool(shapely.contains_xy(area, *place)) for place in places]


def test_the_sea_is_on_the_right_of_the_coastline(tmp_path: Path) -> None:
    eastward, westward = Map(), Map()
    eastward.way([(-600, 0), (0, 30), (600, 0)], {"natural": "coastline"})
    westward.way([(600, 0), (0, 30), (-600, 0)], {"natural": "coastline"})
    assert is_wet(eastward, tmp_path, (0, -200), (0, 200)) == [True, False]
    assert is_wet(westward, tmp_path, (0, -200), (0, 200)) == [False, True]


def test_a_coast_of_several_lines_may_have_islands(tmp_path: Path) -> None:
    made = Map()
    made.way([(-600, 100), (0, 100)], {"natural": "coastline"})
    made.way([(0, 100), (600, 100)], {"natural": "coastline"})
    made.way(square(-50, -150, 100), {"natural": "coastline"})  # anticlockwise: land inside
    assert is_wet(made, tmp_path, (0, -100), (-300, -100), (0, 200)) == [False, True, False]
    (sea,) = water.waters(water.wet(made.features(tmp_path)), -3.0)
    assert len(sea.holes) == 1
    assert sea.level_m == -3.0


def test_a_coast_that_ends_before_the_edge_is_continued_with_a_note(tmp_path: Path) -> None:
    made = Map()
    made.way([(-450, 0), (-10, 0)], {"natural": "coastline"})
    made.way([(10, 5), (460, 0)], {"natural": "coastline"})
    features = made.features(tmp_path)
    area = water.wet(features)
    assert shapely.contains_xy(area, 0, -100)
    assert not shapely.contains_xy(area, 0, 100)
    assert features.skipped == {"gaps of the coastline, closed with straight lines": 3}


def test_a_coastline_that_would_flood_the_city_is_ignored(tmp_path: Path) -> None:
    made = Map()
    made.way([(600, 400), (-600, 400)], {"natural": "coastline"})  # the wrong direction: water to the north
    for k in range(12):
        made.way(square(-400 + 40 * k, 420, 20), {"building": "yes"})
    features = made.features(tmp_path)
    assert water.wet(features).is_empty
    assert features.skipped == {"coastlines that would drown the city": 1}


def test_water_includes_lakes_and_canals_but_not_islands_and_tunnels(tmp_path: Path) -> None:
    made = Map()
    outer, inner = made.way(square(-400, -400, 300)), made.way(square(-300, -300, 100))
    made.relation([(outer, "outer"), (inner, "inner")], {"natural": "water"})
    made.way([(100, -490), (100, 490)], {"waterway": "canal", "width": "12"})
    made.way([(200, -490), (200, 490)], {"waterway": "canal", "tunnel": "yes"})
    made.way([(-380, -380), (-380, -60)], {"waterway": "river"})  # mostly in the lake
    assert is_wet(made, tmp_path, (-390, -390), (-250, -250), (105, 0), (108, 0), (200, 0), (-380, -80)) == [
        True, False, True, False, False, False
    ]  # fmt: skip


def test_surfaces_are_painted_coarse_to_fine_and_leave_water_out(tmp_path: Path) -> None:
    made = Map()
    made.way(square(50, 50, 40), {"leisure": "pitch"})
    made.way(square(0, 0, 200), {"leisure": "park"})
    made.way(square(-300, -300, 700), {"landuse": "residential"})
    made.way(square(100, 100, 50), {"natural": "water"})
    made.way(square(300, 300, 400), {"landuse": "grass"})
    made.way(square(-200, -200, 30), {"amenity": "parking", "parking": "underground"})
    features = made.features(tmp_path)
    wet = water.wet(features)
    surfaces = ground.areas(features, wet)
    assert [area.surface for area in surfaces] == ["residential", "grass", "park", "pitch"]
    shapes = [shapely.Polygon(area.polygon, area.holes) for area in surfaces]
    assert all(shape.is_valid for shape in shapes)
    assert shapely.union_all(shapes).intersection(wet).area < 1.0
    assert shapes[1].area == pytest.approx(200**2, rel=0.01)  # cut to the frame


def test_trees_avoid_water_roads_and_pitches(tmp_path: Path) -> None:
    made = Map()
    made.way(square(0, 0, 200), {"leisure": "park"})
    made.way(square(50, 50, 100), {"natural": "water"})
    made.way(square(0, 0, 60), {"leisure": "pitch"})
    made.way([(-400, 0), (-320, 0)], {"natural": "tree_row"})
    made.node(-100.0, -100.0, natural="tree", height="16", leaf_type="needleleaved")
    features = made.features(tmp_path)
    wet = water.wet(features)
    areas = ground.areas(features, wet)
    road = Road(id="e", lanes=(Lane(id="e_0", shape=((0, 180, 0), (200, 180, 0)), width_m=10.0),))
    occupied = trees.occupied_area(wet, (), trees.pavement((road,)))
    props = list(trees.trees(features, areas, occupied, seed=3))
    assert props == list(trees.trees(features, areas, occupied, seed=3))
    assert props != list(trees.trees(features, areas, occupied, seed=4))
    assert (props[0].model, props[0].scale) == ("pine", 2.0)
    assert sum(prop.position[0] < -300 for prop in props) == 11
    sown = [prop.position[:2] for prop in props if prop.position[0] >= 0]
    assert len(sown) > 40
    assert not any(shapely.contains_xy(occupied, x, y) or (x < 60 and y < 60) for x, y in sown)
    assert len({prop.id for prop in props}) == len(props)


def test_trees_of_a_large_wood_are_spread_evenly(tmp_path: Path) -> None:
    made = Map(half_m=1000.0)
    made.way(square(-900, -900, 1800), {"natural": "wood"})
    features = made.features(tmp_path)
    areas = ground.areas(features, water.wet(features))
    places = [tree.position[:2] for tree in trees.trees(features, areas, shapely.Polygon(), 0)]
    assert 0.9 * trees.MOST_PER_AREA < len(places) <= 1.1 * trees.MOST_PER_AREA
    for axis in (0, 1):
        strips = [[low <= place[axis] < low + 300 for place in places] for low in range(-900, 900, 300)]
        shares = [sum(strip) / len(places) for strip in strips]
        assert all(0.14 < share < 0.2 for share in shares), shares


def test_piers_have_piles_and_walls_leave_roads_free(tmp_path: Path) -> None:
    made = Map()
    made.way([(0, 0), (0, 60)], {"man_made": "pier", "width": "4"})
    made.way([(100, 0), (200, 0), (200, 100)], {"barrier": "wall"})
    made.way([(100, 50), (300, 50)], {"barrier": "fence"})
    features = made.features(tmp_path)
    piers = list(structures.piers(features, -1.5))
    deck = next(solid for solid in piers if "pile" not in solid.id)
    assert shapely.Polygon(deck.polygon).area == pytest.approx(240.0, rel=0.01)
    assert deck.top_m == structures.PIER_TOP_M
    piles = [solid for solid in piers if "pile" in solid.id]
    assert len(piles) >= 8
    assert all(pile.base_m < -1.5 and pile.top_m == pytest.approx(deck.base_m) for pile in piles)
    road = Road(id="e", lanes=(Lane(id="e_0", shape=((150, -50, 0), (150, 50, 0)), width_m=4.0),))
    (wall,) = structures.walls(features, trees.pavement([road]))
    assert wall.polygon[0][0] == pytest.approx(200.15, abs=0.1)  # the piece across the road is left out


def test_decks_lie_under_raised_ways_only(tmp_path: Path) -> None:
    shape = ((0, 0, 0), (100, 0, 6), (300, 0, 6), (400, 0, 0), (600, 0, 0))
    right = Lane(id="e_0", shape=shape, width_m=3.0)
    left = Lane(id="e_1", shape=tuple((x, 3.0, z) for x, _, z in shape), width_m=3.0)
    (deck,) = structures.decks([Road(id="e", lanes=(right, left), name="Ramp")])
    assert deck.path[0] == (pytest.approx(15.0), 1.5, structures.DECK_M)
    assert deck.path[-1] == (pytest.approx(385.0), 1.5, structures.DECK_M)
    assert (deck.width_m, deck.name) == (7.0, "Ramp")
    assert list(structures.decks([Road(id="flat", lanes=(Lane(id="f", shape=shape[3:], width_m=3.0),))])) == []


def test_roads_are_cut_at_the_frame() -> None:
    lane = Lane(id="e_0", shape=((-50, 0, 0), (50, 0, 0), (500, 0, 9), (500, 300, 9), (90, 300, 0)), width_m=3.0)
    bounds = (0.0, -100.0, 100.0, 400.0)
    cut = structures.clip_road(Road(id="e", lanes=(lane,)), bounds)
    assert cut is not None
    assert cut.lanes[0].shape == ((0.0, 0.0, 0.0), (50, 0, 0), (100.0, 0.0, 1.0))
    assert structures.clip_road(Road(id="e", lanes=(lane,)), (-900.0, -900.0, -800.0, -800.0)) is None
    assert structures.is_visible(Road(id="t", lanes=(lane,), tunnel=True)) is False


def test_footbridges_pass_over_roads_and_stairs_lead_up(tmp_path: Path) -> None:
    made = Map()
    foot = {"highway": "footway", "bridge": "yes", "layer": "3"}
    made.way([(-100, 0), (100, 0)], {"highway": "primary"})
    made.way([(0, -50), (0, 50)], foot)
    made.way([(0, 50), (60, 50)], foot)  # joined to it
    made.way([(60, 50), (60, 110)], {"highway": "steps"})
    made.way([(200, 200), (200, 300)], foot)  # over grass
    bridges = {bridge.id: bridge for bridge in footbridges(made.features(tmp_path), ())}
    assert {key: bridge.path[0][2] for key, bridge in bridges.items() if key.startswith("foot")} == {
        "foot-w2": 6.0, "foot-w3": 6.0, "foot-w5": LEVEL_M
    }  # fmt: skip
    (stairs,) = (bridge for key, bridge in bridges.items() if key.startswith("ramp"))
    (_, bottom, high), (_, top, low) = stairs.path
    assert (high, low) == (6.0, 0.0)
    assert top - bottom == pytest.approx(12.0, abs=0.1)  # at a grade of one in two
