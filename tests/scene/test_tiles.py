import gc
import os
from itertools import pairwise
from math import hypot
from pathlib import Path

import msgspec
import pytest

import lingjing.scene.tiles as module
from lingjing.errors import UsageError
from lingjing.scene.city import Bridge, Building, City, Lane, PaintedArea, Pieces, Prop, Road, Water
from lingjing.scene.cutting import cut
from lingjing.scene.store import read_store, write_store
from lingjing.scene.tiles import TILED, Tiles, buildings_within

FRAME = City(id="squares", origin=(31.0, 121.5), bounds=(-1000.0, -1000.0, 1000.0, 1000.0), tile_m=250.0)


def block(x: float, y: float, side: float = 20.0) -> tuple[tuple[float, float], ...]:
    return ((x, y), (x + side, y), (x + side, y + side), (x, y + side))


def pieces() -> Pieces:
    return Pieces(
        waters=(Water(polygon=block(-900, -900, 1800), level_m=0.0),),
        buildings=tuple(
            Building(id=f"b-{x}-{y}", polygon=block(x, y), base_m=0.0, top_m=10.0)
            for x in range(-975, 1000, 100)
            for y in range(-975, 1000, 100)
        ),
        props=(Prop(id="tree", cls="tree", model="tree", position=(-0.5, -0.5, 0.0)),),
    )


def both(tmp_path: Path) -> list[City]:
    there = pieces()
    values = {field: getattr(there, field) for field in (*TILED, "waters")}
    return [msgspec.structs.replace(FRAME, **values), write_store(tmp_path / "city", FRAME, there)]


def test_inline_and_stored_cities_have_the_same_tiles(tmp_path: Path) -> None:
    inline, stored = (Tiles(city) for city in both(tmp_path))
    assert inline.keys == stored.keys == tuple(sorted(inline.keys))
    assert list(inline) == list(stored)
    assert sum(len(tile.buildings) for tile in stored) == 400
    assert stored.load((-1, -1)).props[0].id == "tree"
    assert not any(tile.waters for tile in stored)


@pytest.mark.parametrize("radius", [0.0, 30.0, 260.0, 5000.0])
def test_near_returns_every_piece_within_the_radius_and_few_others(tmp_path: Path, radius: float) -> None:
    for city in both(tmp_path):
        tiles = Tiles(city)
        near = tiles.near(130.0, -20.0, radius)
        assert tuple(tile.key for tile in near) == tiles.keys_near(130.0, -20.0, radius)
        got = {building.id for tile in near for building in tile.buildings}
        wanted = {
            building.id
            for building in pieces().buildings
            if min(hypot(x - 130.0, y + 20.0) for x, y in building.polygon) <= radius
        }
        assert wanted <= got
        assert len(near) <= (2 * (radius + 20.0) / 250.0 + 2) ** 2


def test_pieces_that_project_from_their_square_are_found(tmp_path: Path) -> None:
    hall = Building(id="hall", polygon=((10, 10), (700, 10), (700, 60), (10, 60)), base_m=0.0, top_m=12.0)
    for city in (
        msgspec.structs.replace(FRAME, buildings=(hall,)),
        write_store(tmp_path / "hall", FRAME, Pieces(buildings=(hall,))),
    ):
        tiles = Tiles(city)
        assert tiles.keys == ((0, 0),)
        assert [tile.key for tile in tiles.near(690.0, 40.0, 5.0)] == [(0, 0)]
        assert tiles.near(690.0, 400.0, 5.0) == ()


def test_buildings_within_a_rectangle_are_those_that_reach_into_it(tmp_path: Path) -> None:
    for city in both(tmp_path):
        # Blocks of 20 m begin at 25 m and 125 m, so a rectangle from 40 m to 125 m touches two in each direction.
        got = {building.id for building in buildings_within(city, (40.0, 40.0, 125.0, 125.0))}
        assert got == {"b-25-25", "b-25-125", "b-125-25", "b-125-125"}
        assert buildings_within(city, (46.0, 46.0, 124.0, 124.0)) == ()


def test_only_a_limited_number_of_tiles_is_kept_in_memory(tmp_path: Path) -> None:
    city = both(tmp_path)[1]
    tiles = Tiles(city, keep=3)
    assert len(tiles.near(0.0, 0.0, 5000.0)) == 64
    assert tiles._source._read.cache_info().currsize == 3  # type: ignore[attr-defined]
    assert tiles.load(tiles.keys[-1]) is tiles.load(tiles.keys[-1])
    with pytest.raises(KeyError):
        tiles.load((99, 99))


def test_long_pieces_are_cut_and_nothing_is_lost() -> None:
    lane = Lane(id="e_0", shape=((0.0, 5.0, 0.0), (400.0, 5.0, 0.0), (400.0, 900.0, 8.0)), width_m=3.2)
    park = PaintedArea(polygon=block(-100, -100, 700), surface="park", holes=(block(0, 0, 400),))
    bridge = Bridge(id="b", path=((0.0, 0.0, 6.0), (1000.0, 0.0, 6.0)), width_m=12.0, pier_spacing_m=40.0)
    got = cut(Pieces(roads=(Road(id="e", lanes=(lane,)),), areas=(park,), bridges=(bridge,)), 250.0)
    assert {road.id for road in got.roads} == {"e"}
    joined = [point for road in got.roads for point in road.lanes[0].shape]
    assert joined[0] == lane.shape[0]
    assert joined[-1] == lane.shape[-1]
    ends = [road.lanes[0].shape for road in got.roads]
    assert all(before[-1] == pytest.approx(after[0]) for before, after in pairwise(ends))
    assert sum(length(road.lanes[0].shape) for road in got.roads) == pytest.approx(length(lane.shape))
    assert max(length(road.lanes[0].shape) for road in got.roads) < 260.0
    assert sum(area(part.polygon) - sum(map(area, part.holes)) for part in got.areas) == pytest.approx(700**2 - 400**2)
    for part in got.areas:
        assert area(part.polygon) > 0.0
        xs, ys = zip(*part.polygon, strict=True)
        assert max(xs) - min(xs) <= 250.0
        assert max(ys) - min(ys) <= 250.0
    assert sum(length(part.path) for part in got.bridges) == pytest.approx(1000.0)
    assert len({part.id for part in got.bridges}) == len(got.bridges) > 3
    assert all(part.path[0][0] % 40.0 == pytest.approx(0.0) for part in got.bridges)


def length(path: tuple[tuple[float, ...], ...]) -> float:
    return sum(hypot(b[0] - a[0], b[1] - a[1]) for a, b in pairwise(path))


def area(ring: tuple[tuple[float, float], ...]) -> float:
    return sum(a[0] * b[1] - b[0] * a[1] for a, b in zip(ring, (*ring[1:], ring[0]), strict=True)) / 2.0


def test_a_store_has_the_same_hash_in_every_place(tmp_path: Path) -> None:
    network = tmp_path / "any.xml"
    network.write_text("<net/>")
    frame = msgspec.structs.replace(FRAME, network=str(network))
    first = write_store(tmp_path / "a", frame, pieces(), {"scene.json": b"{}"})
    second = write_store(tmp_path / "deep" / "b", frame, pieces())
    assert first.sha256 == second.sha256 != ""
    assert first.store != second.store
    assert Path(first.network).read_text() == "<net/>"
    assert (tmp_path / "a" / "scene.json").read_bytes() == b"{}"
    assert len(first.waters) == 1
    (tmp_path / "a").rename(tmp_path / "moved")
    moved = read_store(tmp_path / "moved")
    assert Tiles(moved).near(0.0, 0.0, 10.0)
    assert Path(moved.network).is_file()
    changed = write_store(tmp_path / "c", frame, msgspec.structs.replace(pieces(), props=()))
    assert changed.sha256 != first.sha256


def test_an_older_city_is_replaced_and_other_files_are_kept(tmp_path: Path) -> None:
    folder = tmp_path / "city"
    write_store(folder, FRAME, pieces())
    smaller = write_store(folder, FRAME, Pieces(buildings=pieces().buildings[:1]))
    assert len(smaller.tiles) == len(list((folder / "tiles").glob("*_*.msgpack"))) == 1
    assert [path.name for path in tmp_path.iterdir()] == ["city"]
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "notes.txt").write_text("keep me")
    with pytest.raises(UsageError, match="holds something that is no city"):
        write_store(tmp_path / "mine", FRAME, pieces())
    with pytest.raises(UsageError, match="it is a file"):
        write_store(tmp_path / "mine" / "notes.txt", FRAME, pieces())
    assert (tmp_path / "mine" / "notes.txt").read_text() == "keep me"


def test_a_failed_write_leaves_no_files_and_removes_remainders_of_dead_writers(tmp_path: Path) -> None:
    (tmp_path / ".city.999999999.part").mkdir()
    with pytest.raises(UsageError, match="cannot write"):
        write_store(tmp_path / "city", msgspec.structs.replace(FRAME, network=str(tmp_path / "gone.xml")), pieces())
    assert list(tmp_path.iterdir()) == []
    (tmp_path / f".city.{os.getppid()}.part").mkdir()
    write_store(tmp_path / "city", FRAME, pieces())
    assert {path.name for path in tmp_path.iterdir()} == {"city", f".city.{os.getppid()}.part"}


def test_folders_without_a_city_give_an_error(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="does not exist") as caught:
        read_store(tmp_path / "nowhere")
    assert "scene build" in caught.value.hint
    (tmp_path / "file").write_text("x")
    with pytest.raises(UsageError, match="is a file"):
        read_store(tmp_path / "file")
    with pytest.raises(UsageError, match=r"holds no `city.msgpack`"):
        read_store(tmp_path)
    city = write_store(tmp_path / "city", FRAME, pieces())
    tile = next((tmp_path / "city" / "tiles").glob("0_0.msgpack"))
    tile.write_bytes(tile.read_bytes()[:50])
    with pytest.raises(UsageError, match=r"damaged: `tiles/0_0.msgpack`"):
        Tiles(city).load((0, 0))
    tile.unlink()
    with pytest.raises(UsageError, match=r"lost `tiles/0_0.msgpack`"):
        Tiles(city).load((0, 0))
    (tmp_path / "city" / "city.msgpack").write_bytes(b"\x00")
    with pytest.raises(UsageError, match="damaged, or of another version"):
        read_store(tmp_path / "city")


def test_all_users_of_a_city_share_its_tiles(tmp_path: Path) -> None:
    inline, stored = both(tmp_path)
    for city in (inline, stored):
        first, second = Tiles(city), Tiles(city)
        assert all(tile is other_tile for tile, other_tile in zip(first, second, strict=True))
    assert Tiles(stored, keep=2)._source._read.cache_info().currsize == 0  # type: ignore[attr-defined]


def test_a_city_has_no_tiles_of_an_earlier_city(tmp_path: Path) -> None:
    for number in range(20):  # ids of deleted cities are reused
        house = Building(id=f"house-{number}", polygon=block(10, 10), base_m=0.0, top_m=9.0)
        city = msgspec.structs.replace(FRAME, buildings=(house,))
        assert Tiles(city).load((0, 0)).buildings == (house,)
        stored = write_store(tmp_path / "city", FRAME, Pieces(buildings=(house,)))
        assert Tiles(stored).load((0, 0)).buildings == (house,)


def test_an_unused_city_is_removed_from_the_cache(tmp_path: Path) -> None:
    gc.collect()
    before = len(module._memories), len(module._folders)
    users = [Tiles(city) for city in both(tmp_path) for _ in range(5)]
    assert (len(module._memories), len(module._folders)) == (before[0] + 1, before[1] + 1)
    users.clear()
    assert (len(module._memories), len(module._folders)) == before
