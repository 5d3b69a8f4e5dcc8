"""Terrain: buildings, courtyards, slopes and bridges, for a city in memory and for one in a folder."""

import msgspec
import pytest
from pytest import approx

from lingjing.scene.blocks import Block, pier_places
from lingjing.scene.city import Bridge, Building, City, Land, Slope, Solid, Water
from lingjing.scene.outlines import inside, touches
from lingjing.scene.store import write_store
from lingjing.scene.terrain import REACH_M, Terrain

LOT = ((0.0, 0.0), (60.0, 0.0), (60.0, 60.0), (0.0, 60.0))
YARD = ((20.0, 20.0), (40.0, 20.0), (40.0, 40.0), (20.0, 40.0))
RIVER = ((-500.0, 200.0), (500.0, 200.0), (500.0, 300.0), (-500.0, 300.0))
ISLAND = ((-30.0, 240.0), (30.0, 240.0), (30.0, 260.0), (-30.0, 260.0))


@pytest.fixture
def city():
    return City(
        id="town",
        origin=(31.0, 121.5),
        bounds=(-500.0, -500.0, 500.0, 500.0),
        waters=(Water(polygon=RIVER, level_m=-1.0, holes=(ISLAND,)),),
        lands=(Land(polygon=((-500.0, -500.0), (500.0, -500.0), (500.0, 199.0), (-500.0, 199.0)), top_m=0.0),),
        buildings=(Building(id="b/1", polygon=LOT, base_m=0.0, top_m=30.0, holes=(YARD,)),),
        solids=(Solid(id="kerb", polygon=((100, 0), (110, 0), (110, 5), (100, 5)), base_m=0.0, top_m=0.15),),
        slopes=(Slope(id="ramp", top=((-60, 0, 0.0), (-20, 0, 4.0), (-20, 10, 4.0), (-60, 10, 0.0))),),
        bridges=(Bridge(id="span", path=((0, 150, 1.0), (0, 200, 8.0), (0, 300, 8.0), (0, 350, 1.0)), width_m=10.0),),
    )


@pytest.fixture(params=["memory", "folder"])
def terrain(request, city, tmp_path):
    return Terrain(city if request.param == "memory" else write_store(tmp_path / "store", city, city))


def test_solids_at_a_place_are_the_walls_that_a_body_touches(terrain):
    assert [block.id for block in terrain.solids_at(30.0, 10.0, 10.0, 11.0)] == ["b/1"]
    assert terrain.solids_at(30.0, 10.0, 31.0, 32.0) == ()
    assert terrain.solids_at(61.0, 10.0, 10.0, 11.0) == ()
    assert terrain.solids_at(61.0, 10.0, 10.0, 11.0, 1.5) != ()
    assert terrain.solids_at(60.0 + REACH_M - 0.01, 10.0, 10.0, 11.0, REACH_M) != ()
    assert terrain.solids_at(30.0, 30.0, 10.0, 11.0) == ()  # the courtyard is open


def test_roofs_slopes_and_decks_support_bodies(terrain):
    assert terrain.support(10.0, 10.0, 100.0) == 30.0
    assert terrain.support(10.0, 10.0, 5.0) == 0.0
    assert terrain.support(30.0, 30.0, 100.0) == 0.0
    assert terrain.support(-40.0, 5.0, 100.0) == approx(2.0)
    assert terrain.support(-50.0, 5.0, 100.0) == approx(1.0)
    assert terrain.support(0.0, 250.0, 100.0) == approx(8.0)
    assert terrain.support(0.0, 175.0, 100.0) == approx(4.5)
    assert terrain.support(105.0, 2.0, 1.0) == 0.15


def test_water_has_islands_and_passes_under_decks_between_piers(terrain):
    assert terrain.water_level(100.0, 250.0) == -1.0
    assert terrain.water_level(10.0, 250.0) is None
    assert terrain.water_level(100.0, 100.0) is None
    assert terrain.solids_at(0.0, 205.0, -1.5, 0.5) == ()
    x, y, z = next(place for place in pier_places(_span()) if place[2] == 8.0)
    assert [block.id for block in terrain.solids_at(x, y, -1.5, 0.5, 1.0)] == ["span"]
    assert z == 8.0


def test_piers_stand_at_the_middles_of_equal_spans():
    assert [(x, round(y, 1)) for x, y, _ in pier_places(_span())] == [
        (0.0, y) for y in (166.7, 200.0, 233.3, 266.7, 300.0, 333.3)
    ]
    wide = msgspec.structs.replace(_span(), width_m=20.0, pier_spacing_m=500.0)
    (left, middle, _), (right, _, _) = pier_places(wide)
    assert left == -right and abs(left) > 3.0
    assert middle == approx(250.0)
    assert list(pier_places(msgspec.structs.replace(wide, pier_spacing_m=0.0))) == []


def _span():
    return Bridge(id="span", path=((0, 150, 8.0), (0, 350, 8.0)), width_m=10.0)


def test_the_ceiling_is_at_least_the_height_of_the_tallest_solid(terrain):
    assert terrain.ceiling_m(10.0, 10.0) >= 30.0
    assert terrain.ceiling_m(-400.0, -400.0) == 0.0


def town(blocks):
    houses = tuple(
        Building(
            id=f"h/{column}/{row}",
            polygon=tuple((column * 40.0 + x, row * 40.0 + y) for x, y in ((0, 0), (20, 0), (20, 20), (0, 20))),
            base_m=0.0,
            top_m=20.0,
        )
        for column in range(blocks)
        for row in range(blocks)
    )
    return City(id="grid", origin=(31.0, 121.5), bounds=(0.0, 0.0, blocks * 40.0, blocks * 40.0), buildings=houses)


def compared(terrain, monkeypatch):
    """Number of solids that are tested in a thousand queries, most of them among houses."""
    looked = 0
    base_at = Block.base_at

    def counted(self, x, y):
        nonlocal looked
        looked += 1
        return base_at(self, x, y)

    with monkeypatch.context() as patch:
        patch.setattr(Block, "base_at", counted)
        for k in range(1000):
            terrain.solids_at(100.0 + k % 50, 100.0 + k % 37, 10.0, 11.0, 0.3)
    return looked


def test_the_cost_of_a_lookup_does_not_grow_with_the_city(monkeypatch):
    small, large = Terrain(town(6)), Terrain(town(80))  # 36 and 6,400 houses
    assert 0 < compared(small, monkeypatch) == compared(large, monkeypatch) < 1000 * 9


def test_a_stored_city_is_read_only_around_bodies(tmp_path, monkeypatch):
    from lingjing.scene import tiles

    stored = write_store(tmp_path / "store", town(60), town(60))
    read = []
    load = tiles._Folder.load
    monkeypatch.setattr(tiles._Folder, "load", lambda self, key: read.append(key) or load(self, key))
    terrain = Terrain(stored)
    assert terrain.solids_at(1030.0, 1005.0, 1.0, 2.0) == ()
    assert terrain.solids_at(1010.0, 1010.0, 1.0, 2.0)[0].id == "h/25/25"
    assert 1 <= len(set(read)) <= 9 < len(stored.tiles)


def test_close_pairs_equal_those_of_an_exhaustive_search():
    import itertools
    import math

    from lingjing.engines.close_pairs import close_pairs
    from lingjing.mission.seeding import Stream

    random = Stream(5, "pairs")
    places = [(random.uniform(0.0, 30.0), random.uniform(0.0, 30.0), random.uniform(0.0, 5.0)) for _ in range(120)]
    numbered = itertools.combinations(enumerate(places), 2)
    wanted = [(i, j) for (i, first), (j, second) in numbered if math.dist(first, second) < 2.0]
    assert close_pairs(places, 2.0) == wanted
    assert len(wanted) > 20


def test_cached_ground_and_water_equal_exact_ones_at_every_point(city):
    slanting = Water(polygon=((300.0, -300.0), (420.0, -260.0), (330.0, -120.0)), level_m=2.0)
    hill = Land(polygon=((0.0, 0.0), (140.0, 30.0), (60.0, 150.0)), top_m=5.0)
    city = msgspec.structs.replace(city, waters=(*city.waters, slanting), lands=(*city.lands, hill), datum_m=-2.5)
    terrain = Terrain(city)

    def plainly(x, y):
        wet = [water.level_m for water in city.waters if inside(water.polygon, x, y)
               and not any(inside(hole, x, y) for hole in water.holes)]  # fmt: skip
        level = max(wet, default=None)
        lands = [land.top_m for land in city.lands if inside(land.polygon, x, y)]
        afloat = None if level is None or any(top > level for top in lands) else level
        return max([*wet, *lands], default=city.datum_m), afloat

    places = [(x * 3.7 - 60.0, 190.0 + y * 1.3) for x in range(40) for y in range(90)]
    places += [(290.0 + x * 2.9, -310.0 + y * 4.1) for x in range(50) for y in range(50)]
    places += [(x * 7.3 - 520.0, -5.0 + y * 6.1) for x in range(90) for y in range(40)]
    exact = [plainly(x, y) for x, y in places]
    assert set(exact) == {(0.0, None), (-1.0, -1.0), (2.0, 2.0), (5.0, None), (-2.5, None)}
    assert [(terrain.surface(x, y), terrain.water_level(x, y)) for x, y in places] == exact


def test_an_outline_touches_squares_that_it_passes_or_runs_through():
    square = ((0.0, 0.0), (10.0, 0.0), (10.0, 10.0), (0.0, 10.0))
    assert touches(square, 0.0, 5.0, 1.0) and touches(square, 9.5, 9.5, 1.0)
    assert not touches(square, 5.0, 5.0, 4.0) and not touches(square, 15.0, 5.0, 4.0)
    assert not touches(((0.0, 0.0), (10.0, 10.0), (0.0, 10.0)), 8.0, 3.0, 1.0)
