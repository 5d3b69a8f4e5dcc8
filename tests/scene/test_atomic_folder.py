"""Writers of cities and networks leave complete results, no remainders of killed writers, and no damaged cache."""

import os
import shutil
import subprocess
import sys
import threading
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from lingjing.errors import UsageError
from lingjing.mission.instance import SceneSpec
from lingjing.scene import store
from lingjing.scene.atomic_folder import folder_beside
from lingjing.scene.city import City, Pieces
from lingjing.scene.network import StreetEdge, StreetNode, build_network
from lingjing.scene.osm import read as reading
from lingjing.scene.osm.build import Options, build
from lingjing.scene.osm.provider import city_of
from lingjing.scene.osm.tags import metres, number
from lingjing.scene.store import check_free, cities_folder, copy_store, intact_city, read_store, write_store
from tests.scene.osm_maps import Map, square


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))


@pytest.fixture
def hut(tmp_path: Path) -> Path:
    bare = Map()
    bare.way(square(0, 0, 30), {"building": "yes"})  # no roads: built in a moment
    return bare.write(tmp_path / "hut.osm")


def test_the_next_writer_removes_the_remainder_of_a_killed_writer(tmp_path: Path) -> None:
    code = (
        "import os, sys; from pathlib import Path; from lingjing.scene.atomic_folder import folder_beside\n"
        "with folder_beside(Path(sys.argv[1])) as folder:\n"
        "    (folder / 'half').write_bytes(b'x'); os.kill(os.getpid(), 9)"
    )
    subprocess.run([sys.executable, "-c", code, str(tmp_path / "city")], check=False)
    assert len(list(tmp_path.glob(".city.*.part/new/half"))) == 1
    mine = tmp_path / f".city.{os.getpid()}.other.part"
    mine.mkdir()
    with folder_beside(tmp_path / "city") as folder:
        assert sorted(tmp_path.iterdir()) == sorted([mine, folder.parent])
    assert list(tmp_path.iterdir()) == [mine]


def test_concurrent_writers_of_one_folder_leave_one_complete_city(tmp_path: Path, hut: Path) -> None:
    target = tmp_path / "city"
    build(hut, Options(), tmp_path / "first")
    with ThreadPoolExecutor(8) as pool:
        for done in [pool.submit(copy_store, tmp_path / "first", target) for _ in range(24)]:
            done.result()
    assert intact_city(target) == read_store(target)
    assert not list(tmp_path.glob(".city*"))


@pytest.mark.parametrize("can_exchange", [True, False])
def test_a_folder_with_competing_writers_always_holds_a_complete_city(
    tmp_path: Path, can_exchange: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Two cities alternate in one folder. A concurrent reader finds one of them complete, and may write."""
    target, sources = tmp_path / "city", [tmp_path / "one", tmp_path / "two"]
    cities = [write_store(source, frame_of(source.name), Pieces()) for source in sources]
    if not can_exchange:
        monkeypatch.setattr(store, "_exchanged", lambda first, second: False)
    copy_store(sources[0], target)
    stop = threading.Event()

    def fight(source: Path) -> None:
        while not stop.is_set():
            copy_store(source, target)

    with ThreadPoolExecutor(2) as pool:
        fights = [pool.submit(fight, sources[number]) for number in range(2)]
        try:
            for _ in range(100):
                check_free(target)
                if can_exchange:
                    assert read_store(target).id in {city.id for city in cities}
        finally:
            stop.set()
        for done in fights:
            done.result()
    left = intact_city(target)
    assert left is not None and left.sha256 in {city.sha256 for city in cities}
    assert not list(tmp_path.glob(".city*"))


def test_writing_the_same_city_again_keeps_its_folder(tmp_path: Path) -> None:
    write_store(tmp_path / "one", frame_of("one"), Pieces())
    copy_store(tmp_path / "one", tmp_path / "city")
    before = (tmp_path / "city").stat().st_ino
    copy_store(tmp_path / "one", tmp_path / "city")
    assert (tmp_path / "city").stat().st_ino == before
    (tmp_path / "city" / "tiles" / "index.msgpack").write_bytes(b"rotten")
    copy_store(tmp_path / "one", tmp_path / "city")
    assert intact_city(tmp_path / "city") is not None


def frame_of(name: str) -> City:
    return City(id=name, origin=(31.0, 121.5), bounds=(-100.0, -100.0, 100.0, 100.0), tile_m=50.0)


def test_a_built_map_is_reused_for_another_folder(tmp_path: Path, hut: Path) -> None:
    assert not build(hut, Options(), tmp_path / "a").cached
    assert build(hut, Options(), tmp_path / "b").cached
    assert build(hut, Options()).cached


def test_a_damaged_cache_is_rebuilt(tmp_path: Path, hut: Path) -> None:
    good = build(hut, Options()).city
    (tile,) = next(cities_folder().iterdir()).glob("tiles/[0-9-]*")
    tile.write_bytes(tile.read_bytes()[:-1])
    again = build(hut, Options())
    assert not again.cached
    assert intact_city(again.folder) == good


def test_a_mission_is_not_played_in_a_damaged_city(tmp_path: Path, hut: Path) -> None:
    folder = build(hut, Options(), tmp_path / "city").folder
    spec = SceneSpec(kind="map", options={"folder": str(folder)})
    assert city_of(spec) == intact_city(folder)
    (tile,) = folder.glob("tiles/[0-9-]*")
    tile.write_bytes(tile.read_bytes()[:-1])
    with pytest.raises(UsageError, match="is damaged") as caught:
        city_of(spec)
    assert "scene build" in caught.value.hint


def test_a_damaged_network_is_rebuilt() -> None:
    nodes = [StreetNode(id="a", east=0.0, north=0.0), StreetNode(id="b", east=100.0, north=0.0)]
    edges = [StreetEdge(id="ab", start="a", end="b")]
    first = build_network(nodes, edges)
    written = Path(first.path).read_bytes()
    Path(first.path).write_bytes(written[:100])
    assert build_network(nodes, edges) == first
    assert Path(first.path).read_bytes() == written


@pytest.mark.parametrize("place", ["taken/notes.txt", "taken", "hut.osm/city"])
def test_an_occupied_folder_is_rejected_before_the_map_is_read(
    tmp_path: Path, hut: Path, place: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "taken").mkdir()
    (tmp_path / "taken" / "notes.txt").write_text("mine", encoding="utf-8")
    monkeypatch.setattr(reading, "read", lambda path: pytest.fail("the map was read"))
    with pytest.raises(UsageError, match="cannot write") as caught:
        build(hut, Options(), tmp_path / place)
    assert caught.value.hint


def test_a_full_disk_gives_a_readable_error(tmp_path: Path, hut: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    build(hut, Options(), tmp_path / "city")

    def full(source: str, target: str) -> None:
        raise OSError(28, "No space left on device", source, None, target)

    monkeypatch.setattr(shutil, "copy2", full)
    monkeypatch.setattr(shutil.copytree, "__defaults__", (False, None, full, False, False))
    with pytest.raises(UsageError, match=r"other`: No space left on device"):
        copy_store(tmp_path / "city", tmp_path / "other")
    assert not (tmp_path / "other").exists()


@pytest.mark.parametrize("value", ["inf", "nan", "-inf", "1e999", "9" * 400])
def test_infinite_numbers_count_as_missing(value: str) -> None:
    assert number({"k": value}, "k") is None
    assert metres({"k": value}, "k") is None


def test_infinite_storeys_are_ignored_and_nodes_off_the_earth_are_an_error(tmp_path: Path) -> None:
    town = Map()
    town.way(square(0, 0, 30), {"building": "yes", "building:levels": "inf", "height": "9" * 400})
    town.write(tmp_path / "town.osm")
    assert build(tmp_path / "town.osm", Options(), tmp_path / "town").summary.counts["tallest_m"] < 100
    text = (tmp_path / "town.osm").read_text(encoding="utf-8")
    (tmp_path / "off.osm").write_text(text.replace(' lat="31', ' lat="931', 1), encoding="utf-8")
    with pytest.raises(UsageError, match=r"off\.osm` is not OpenStreetMap data"):
        build(tmp_path / "off.osm", Options(), tmp_path / "off")
