import bz2
import gzip
import os
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

import msgspec
import osmium
import pytest
import shapely
import shapely.affinity

from lingjing.errors import UsageError
from lingjing.mission.instance import SceneSpec
from lingjing.scene import store
from lingjing.scene.osm import read as reading
from lingjing.scene.osm.build import Options, build
from lingjing.scene.osm.frame import choose, parse_box
from lingjing.scene.osm.provider import city_of
from lingjing.scene.osm.summary import read_summary, reason_text
from lingjing.scene.store import cities_folder
from lingjing.scene.tiles import Tiles
from tests.scene.osm_maps import Map, convert, square, town


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.delenv("LINGJING_NO_CACHE", raising=False)
    return tmp_path / "cache"


def test_a_town_is_built_completely(tmp_path: Path) -> None:
    phases: list[str] = []
    built = build(town().write(tmp_path / "town.osm"), Options(seed=2), tmp_path / "town", phases.append)
    city, pieces = built.city, list(Tiles(built.city))
    assert not built.cached
    assert phases[0] == "looking at the map"
    assert phases[-1] == "writing the city"
    assert sorted(house.levels for tile in pieces for house in tile.buildings) == [3, 4, 5, 6]
    assert {road.name for tile in pieces for road in tile.roads} >= {"East Road"}
    assert any(road.bridge for tile in pieces for road in tile.roads)
    assert max(point[2] for tile in pieces for deck in tile.bridges for point in deck.path) == 6.0
    assert [body.level_m for body in city.waters] == [-1.5, -1.5]
    assert any(solid.id.startswith("pier") for tile in pieces for solid in tile.solids)
    assert any(solid.id.startswith("wall") and solid.top_m == 2.5 for tile in pieces for solid in tile.solids)
    assert any(area.surface == "park" for tile in pieces for area in tile.areas)
    assert city.datum_m == 0.0
    assert city.attribution == "© OpenStreetMap contributors, ODbL 1.0"
    assert Path(city.network).read_text(encoding="utf-8").startswith("<?xml")
    summary = read_summary(tmp_path / "town")
    assert summary is not None
    assert summary.counts["buildings"] == 4
    assert summary.attribution == city.attribution
    assert summary.box_is == "stated in the file"
    names = [item.id for tile in pieces for kind in (tile.buildings, tile.solids, tile.props) for item in kind]
    assert len(names) == len(set(names))


def test_formats_element_orders_and_folders_give_the_same_city(tmp_path: Path) -> None:
    plain = town().write(tmp_path / "town.osm")
    (tmp_path / "b").mkdir()
    (tmp_path / "c").mkdir()
    turned = town().write(tmp_path / "b" / "town.osm", ways_first=True)
    packed = tmp_path / "c" / "town.osm.gz"
    packed.write_bytes(gzip.compress(plain.read_bytes()))
    binary = tmp_path / "c" / "town.osm.pbf"
    convert(plain, binary)
    bzipped = tmp_path / "c" / "town.osm.bz2"
    convert(plain, bzipped)
    cities = [build(path, Options(), tmp_path / f"out-{path.name}{k}").city
              for k, path in enumerate((plain, turned, packed, binary, bzipped))]  # fmt: skip
    assert len({city.sha256 for city in cities}) == 1
    assert build(plain, Options(seed=1), tmp_path / "other").city.sha256 != cities[0].sha256


def test_a_second_build_comes_from_the_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = town().write(tmp_path / "town.osm")
    first = build(path, Options())
    assert first.folder.parent == cities_folder()
    monkeypatch.setattr(reading, "read", None)  # the map is not read again
    assert build(path, Options()).cached
    copied = build(path, Options(), tmp_path / "copy")
    assert copied.cached
    assert copied.city.sha256 == first.city.sha256
    assert copied.city.store == str(tmp_path / "copy")
    monkeypatch.undo()
    monkeypatch.setenv("XDG_CACHE_HOME", str(first.folder.parents[2]))
    assert not build(path, Options(seed=7)).cached
    tile = next((first.folder / "tiles").glob("0_0.msgpack"))
    (first.folder / "city.msgpack").write_bytes(b"")
    tile.unlink()
    mended = build(path, Options())
    assert not mended.cached
    assert mended.city.sha256 == first.city.sha256


def test_without_a_cache_a_city_needs_a_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = town().write(tmp_path / "town.osm")
    monkeypatch.setenv("LINGJING_NO_CACHE", "1")
    with pytest.raises(UsageError, match="needs a folder") as caught:
        build(path, Options())
    assert "-o DIR" in caught.value.hint
    assert not build(path, Options(), tmp_path / "out").cached
    assert not build(path, Options(), tmp_path / "out").cached


def test_a_map_without_roads_or_buildings_gives_a_city_with_a_note(tmp_path: Path) -> None:
    made = Map()
    made.way(square(0, 0, 30), {"building": "yes"})
    houses = build(made.write(tmp_path / "houses.osm"), Options(), tmp_path / "houses")
    assert houses.city.network == ""
    assert houses.summary.notes == ("no roads in this part of the map: a city without traffic",)
    made = Map()
    made.way([(-300, 0), (300, 0)], {"highway": "primary"})
    streets = build(made.write(tmp_path / "streets.osm"), Options(), tmp_path / "streets")
    assert streets.summary.notes == ("no buildings in this part of the map",)
    assert streets.summary.counts["roads"] == 2
    made = Map()
    made.way([(-300, 0), (300, 0)], {"highway": "construction"})
    with pytest.raises(UsageError, match="nothing to build a city from"):
        build(made.write(tmp_path / "none.osm"), Options(), tmp_path / "none")
    assert not (tmp_path / "none").exists()


def test_a_part_around_buildings_includes_near_streets_and_notes_the_others(tmp_path: Path) -> None:
    made = Map(half_m=None)
    made.way(square(0, 0, 100), {"building": "yes"})
    made.way([(0, 210), (280, 210)], {"highway": "residential"})
    near = build(made.write(tmp_path / "near.osm"), Options(), tmp_path / "near").summary
    assert (near.box_is, near.notes) == ("around its buildings and the streets near them", ())
    assert near.counts["roads"] == 2
    made.way([(2000, 0), (2000, 400)], {"highway": "residential"})
    made.way([(2000, 0), (2300, 0)], {"highway": "footway"})
    path = made.write(tmp_path / "far.osm")
    far = build(path, Options(), tmp_path / "far").summary
    assert (far.box, far.counts["roads"]) == (near.box, 2)
    (note,) = far.notes
    assert note.startswith("1 road lies outside the part around its buildings and the streets near them; the")
    wide = build(path, Options(box=parse_box(note.split("=")[1])), tmp_path / "wide").summary
    assert wide.counts["roads"] > 2
    assert not wide.notes


def test_neighbouring_lanes_leave_no_gap(tmp_path: Path) -> None:
    made = Map()
    bend = [(-200, 0), (-100, 7), (0, 31), (90, 80), (170, 160)]
    made.way(bend, {"highway": "primary", "oneway": "yes", "lanes": "5"})
    city = build(made.write(tmp_path / "bend.osm"), Options(), tmp_path / "out").city
    (road,) = {road.id: road for tile in Tiles(city) for road in tile.roads}.values()
    assert len(road.lanes) == 5
    lanes = [shapely.LineString([point[:2] for point in lane.shape]) for lane in road.lanes]
    for (right, a), (left, b) in pairwise(zip(road.lanes, lanes, strict=True)):
        apart = max(shapely.Point(place).distance(b) for place in a.coords)
        assert apart < (right.width_m + left.width_m) / 2.0 < apart + 0.05


def test_the_directions_of_a_street_leave_no_gap(tmp_path: Path) -> None:
    made = Map()
    made.way([(-200, 0), (-100, 7), (0, 31), (90, 80)], {"highway": "residential"})
    city = build(made.write(tmp_path / "street.osm"), Options(), tmp_path / "out").city
    there, back = {road.id: road for tile in Tiles(city) for road in tile.roads}.values()
    a, b = (shapely.LineString([point[:2] for point in road.lanes[-1].shape]) for road in (there, back))
    apart = max(shapely.Point(place).distance(b) for place in a.coords)
    assert apart < (there.lanes[-1].width_m + back.lanes[-1].width_m) / 2.0 < apart + 0.06


def test_dangling_references_are_left_out_and_counted(tmp_path: Path) -> None:
    made = town()
    made.way([(300, 300)], {"highway": "residential"}, missing=3)
    made.way([], {"building": "yes"}, missing=4)
    half, ring = made.way([(300, -300), (340, -300)]), made.way(square(300, -250, 40))
    made.relation([(half, "outer"), (4711, "outer")], {"natural": "water"})
    made.relation([(ring, "outer"), (4711, "outer")], {"natural": "water"})
    built = build(made.write(tmp_path / "dangling.osm"), Options(), tmp_path / "out")
    assert built.summary.skipped == {
        "areas that do not close": 1,
        "multipolygons that do not close": 1,
        "multipolygons with members missing": 1,
        "ways without enough nodes": 1,
    }
    assert built.summary.counts["buildings"] == 4
    reasons = [reason_text(count, reason) for reason, count in built.summary.skipped.items()]
    assert reasons[:2] == ["1 area that does not close", "1 multipolygon that does not close"]


def test_nodes_missing_from_streets_and_outlines_are_counted(tmp_path: Path) -> None:
    made = Map()
    made.way([(0, 0), (200, 0)], {"highway": "residential"}, missing=2)
    made.way(square(0, 30, 30), {"building": "yes"})
    half = made.way([(100, 100), (140, 100), (140, 140)], missing=1)
    other = made.way([(140, 140), (100, 140), (100, 100)])
    made.relation([(half, "outer"), (other, "outer")], {"natural": "water"})
    made.way([(5000, 0), (5200, 0)], {"highway": "residential"}, missing=9)  # outside: no loss to this part
    skipped = build(made.write(tmp_path / "gaps.osm"), Options(), tmp_path / "out").summary.skipped
    assert skipped == {"references to missing nodes": 3}
    assert reason_text(3, "references to missing nodes") == "3 references to missing nodes"
    assert reason_text(1, "references to missing nodes") == "1 reference to a missing node"


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("zero.osm", b"", "is empty: 0 bytes"),
        ("text.osm", b"hello", "is not OpenStreetMap data: it begins with `hello`"),
        ("cut.osm", b'<osm version="0.6"><node id="1" lat="1" lon="2"/><way', "stops in the middle, in line 1"),
        ("page.osm", b"<html></html>", r"is not OpenStreetMap data: it is a web page \(HTML\)"),
        ("cut.osm.pbf", b"\x00\x00\x00\x0e\x0a\x09OSMHeader\x18\x7c", "is not OpenStreetMap data: PBF error"),
        ("bad.osm.gz", b"no gzip", "is not OpenStreetMap data"),
        ("none.osm", b'<osm version="0.6"></osm>', "not one node"),
        ("map.kml", b"<kml/>", "is not OpenStreetMap data: it is KML"),
    ],
)
def test_a_file_that_is_no_map_gives_a_one_line_error(tmp_path: Path, name: str, content: bytes, message: str) -> None:
    (tmp_path / name).write_bytes(content)
    with pytest.raises(UsageError, match=message) as caught:
        build(tmp_path / name, Options(), tmp_path / "out")
    assert caught.value.hint
    assert not (tmp_path / "out").exists()


def test_a_missing_map_and_a_folder_are_errors(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="does not exist"):
        build(tmp_path / "no.osm", Options())
    with pytest.raises(UsageError, match="is a folder"):
        build(tmp_path, Options())


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("1,2,3", "is not a bounding box"),
        ("a,b,c,d", "is not a bounding box"),
        ("10,60,5,70", "antimeridian"),
        ("179,-17,-179,-16", "antimeridian"),
        ("10,60,10,70", "it is empty"),
        ("10,70,20,60", "its south is not below its north"),
        ("10,60,20,95", "not on Earth"),
        ("nan,1,2,3", "not on Earth"),
    ],
)
def test_malformed_boxes_are_refused(text: str, message: str) -> None:
    with pytest.raises(UsageError, match=message):
        parse_box(text)


def test_boxes_outside_too_large_or_across_the_antimeridian_are_refused(tmp_path: Path) -> None:
    data = reading.read(town().write(tmp_path / "town.osm"))
    with pytest.raises(UsageError, match="lies outside the map") as caught:
        choose(data, (10.0, 50.0, 10.1, 50.1))
    assert "it covers 121.49" in caught.value.hint
    with pytest.raises(UsageError, match="more than a city"):
        choose(data, (120.0, 30.0, 123.0, 33.0))
    pacific = tmp_path / "pacific.osm"
    nodes = "".join(f'<node id="{k}" lat="-16.8" lon="{lon}"/>' for k, lon in ((1, 179.99), (2, -179.99), (3, 179.98)))
    refs = "".join(f'<nd ref="{k}"/>' for k in (1, 2, 3))
    pacific.write_text(f'<osm version="0.6">{nodes}<way id="1">{refs}<tag k="highway" v="primary"/></way></osm>')
    with pytest.raises(UsageError, match="antimeridian") as caught:
        build(pacific, Options(), tmp_path / "out")
    assert "--bbox" in caught.value.hint


BLANKS = b" " * (64 << 20)


@pytest.mark.parametrize(("name", "packed"), [("bomb.osm.gz", gzip.compress), ("bomb.osm.bz2", bz2.compress)])
def test_a_decompression_bomb_is_rejected(tmp_path: Path, name: str, packed: Callable[[bytes], bytes]) -> None:
    (tmp_path / name).write_bytes(packed(b'<osm version="0.6">') + 6 * packed(BLANKS))
    with pytest.raises(UsageError, match="it unpacks to more than 100 times its size"):
        build(tmp_path / name, Options(), tmp_path / "out")


def test_a_map_with_more_objects_than_bytes_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "many.osm.pbf"
    with osmium.SimpleWriter(str(path)) as writer:
        for number in range(1, 150_001):
            writer.add_node(osmium.osm.mutable.Node(id=number, location=(10.0, 50.0)))
    assert path.stat().st_size < 100_000
    with pytest.raises(UsageError, match="it holds more than it has bytes"):
        reading.read(path)


@pytest.mark.parametrize("latitude", [89.99, -89.99, 85.5])
def test_a_map_at_a_pole_is_refused(tmp_path: Path, latitude: float) -> None:
    path = tmp_path / "pole.osm"
    path.write_text(house(latitude, 10.0))
    with pytest.raises(UsageError, match=r"degrees of latitude .*; beyond 85 one frame does not fit"):
        build(path, Options(), tmp_path / "out")


def test_a_map_far_north_is_built(tmp_path: Path) -> None:
    path = tmp_path / "north.osm"
    path.write_text(house(78.22, 15.65))
    assert build(path, Options(), tmp_path / "out").summary.counts["buildings"] == 1


def test_an_empty_stated_part_is_ignored_with_a_note(tmp_path: Path) -> None:
    path = tmp_path / "empty.osm"
    bounds = '<bounds minlat="31.2" minlon="121.5" maxlat="31.2" maxlon="121.5"/>'
    path.write_text(house(31.2, 121.5, bounds))
    built = build(path, Options(), tmp_path / "out")
    assert built.summary.counts["buildings"] == 1
    assert any("states an empty part" in note for note in built.summary.notes)
    path.write_text(house(31.2, 121.5, bounds.replace('="31.2" maxlon="121.5"', '="31.20001" maxlon="121.50001"')))
    with pytest.raises(UsageError, match=r"the map is 1\.0 by 1\.1 m \(stated in the file\): too small"):
        build(path, Options(), tmp_path / "out2")


@pytest.mark.parametrize(
    ("bounds", "fault"),
    [
        ('<bounds minlat="10" minlon="10" maxlat="10.01" maxlon="10.01"/>', "a part without data (10,10,10.01,10.01)"),
        ('<bound box="-90,-180,90,180"/>', "the whole Earth as its part"),
    ],
)
def test_a_stated_part_without_data_is_ignored_with_a_note(tmp_path: Path, bounds: str, fault: str) -> None:
    path = tmp_path / "elsewhere.osm"
    path.write_text(house(31.2, 121.5, bounds))
    summary = build(path, Options(), tmp_path / "out").summary
    assert (summary.counts["buildings"], summary.box_is) == (1, "around its buildings")
    assert any(f"states {fault}" in note for note in summary.notes)


def test_objects_outside_of_the_stated_part_are_noted(tmp_path: Path) -> None:
    made = Map(half_m=100.0)
    made.way(square(0, 0, 30), {"building": "yes"})
    made.way([(-300, 10), (300, 10)], {"highway": "footway"})
    made.way([(-300, 50), (0, 50), (300, 50)], {"highway": "residential"})  # ways extend beyond the box, as in extracts
    whole = build(made.write(tmp_path / "whole.osm"), Options(), tmp_path / "whole").summary
    assert not whole.notes
    made.way(square(300, 0, 30), {"building": "yes"})
    made.way(square(400, 0, 30), {"building": "no"})
    made.way([(300, 80), (300, 200)], {"highway": "residential"})
    path = made.write(tmp_path / "part.osm")
    (note,) = build(path, Options(), tmp_path / "part").summary.notes
    assert note.startswith("1 building and 1 road lie outside the part stated in the file; the box with all is")
    wide = build(path, Options(box=parse_box(note.split("=")[1])), tmp_path / "wide").summary
    assert (wide.counts["buildings"], wide.notes) == (2, ())
    made.way(square(90_000, 0, 30), {"building": "yes"})
    (note,) = build(made.write(tmp_path / "far.osm"), Options(), tmp_path / "far").summary.notes
    assert note.endswith("stated in the file, too far away to be built with it")


@pytest.mark.parametrize("value", ["nan", "inf", "999", "1e300"])
def test_places_outside_of_the_earth_are_rejected(tmp_path: Path, value: str) -> None:
    path = tmp_path / "odd.osm"
    path.write_text(house(31.2, 121.5).replace('lat="31.2"', f'lat="{value}"', 1))
    with pytest.raises(UsageError):
        build(path, Options(), tmp_path / "out")


@pytest.mark.parametrize("tag", ["lanes", "width", "building:levels", "height", "layer", "maxspeed"])
@pytest.mark.parametrize("value", ["1e308", "999999", "nan", "-0.5"])
def test_an_invalid_tag_counts_as_missing(tmp_path: Path, tag: str, value: str) -> None:
    made = Map()
    tags = {tag: value}
    made.way(square(0, 0, 30), {"building": "yes", **tags})
    made.way([(-200, -50), (200, -50)], {"highway": "residential", **tags})
    built = build(made.write(tmp_path / "odd.osm"), Options(), tmp_path / "out")
    assert built.summary.counts["buildings"] == 1
    assert 1 <= sum(len(road.lanes) for tile in Tiles(built.city) for road in tile.roads) <= 4


def house(latitude: float, longitude: float, bounds: str = "") -> str:
    """A map of one house."""
    corners = [(0, 0), (0, 1), (1, 1), (1, 0)]
    nodes = "".join(
        f'<node id="{k}" lat="{latitude + 0.0005 * north}" lon="{longitude + 0.0005 * east}"/>'
        for k, (north, east) in enumerate(corners, 1)
    )
    refs = "".join(f'<nd ref="{k}"/>' for k in (1, 2, 3, 4, 1))
    way = f'<way id="1">{refs}<tag k="building" v="yes"/></way>'
    return f'<osm version="0.6">{bounds}{nodes}{way}</osm>'


def test_a_city_is_clipped_to_the_chosen_part(tmp_path: Path) -> None:
    path = town().write(tmp_path / "town.osm")
    whole = choose(reading.read(path), None)
    west, south, east, north = whole.box
    part = (west, south, (west + east) / 2, (south + north) / 2)
    built = build(path, Options(box=part), tmp_path / "part")
    low_x, low_y, high_x, high_y = built.city.bounds
    assert built.summary.counts["buildings"] == 1
    assert high_x - low_x == pytest.approx(500.0, abs=0.5)
    for tile in Tiles(built.city):
        for road in tile.roads:
            assert all(low_x <= x <= high_x and low_y <= y <= high_y for lane in road.lanes for x, y, _ in lane.shape)
        for area in tile.areas:
            assert all(low_x <= x <= high_x and low_y <= y <= high_y for x, y in area.polygon)


def test_an_interrupted_build_leaves_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = town().write(tmp_path / "town.osm")
    written = store._write_files

    def torn(*args: object, **kwargs: object) -> None:
        written(*args, **kwargs)  # type: ignore[arg-type]
        raise KeyboardInterrupt

    monkeypatch.setattr(store, "_write_files", torn)
    with pytest.raises(KeyboardInterrupt):
        build(path, Options(), tmp_path / "out")
    assert sorted(item.name for item in tmp_path.iterdir()) == ["cache", "town.osm"]


def test_a_mission_names_a_folder_or_a_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = town().write(tmp_path / "town.osm")
    built = build(path, Options(), tmp_path / "city")
    monkeypatch.chdir(tmp_path)
    stored = city_of(SceneSpec(kind="map", options={"folder": "city"}, seed=5))
    assert stored == msgspec.structs.replace(built.city, store=str(tmp_path / "city"))
    made = city_of(SceneSpec(kind="map", options={"file": "town.osm"}, seed=6))
    assert made.sha256 == built.city.sha256
    assert Path(made.store).parent == cities_folder()
    assert city_of(SceneSpec(kind="map", options={"map": "town.osm"})) == made
    flat = city_of(SceneSpec(kind="map", options={"file": "town.osm", "default_levels": 2}))
    assert flat.sha256 == made.sha256  # every house of the town has levels of its own
    assert flat.store != made.store
    high = city_of(SceneSpec(kind="map", options={"folder": "city"}, datum_m=-3.5))
    assert {body.level_m for body in high.waters} == {-3.5}
    assert high.sha256 != stored.sha256
    assert city_of(SceneSpec(kind="map", options={"folder": "city"}, origin=built.city.origin)) == stored


@pytest.mark.parametrize(
    ("options", "datum", "origin", "message"),
    [
        ({}, 0.0, None, "names no map"),
        ({"folder": "a", "file": "b"}, 0.0, None, r"2 times \(folder, file\)"),
        ({"folder": "a", "trees": 3}, 0.0, None, "no option `trees`"),
        ({"folder": 3}, 0.0, None, "not a text in quotes"),
        ({"folder": "nowhere"}, 0.0, None, "`.*nowhere`.*working folder"),
        ({"file": "no.osm"}, 0.0, None, "scene `map`: no map at"),
        ({"folder": "city", "bbox": "1,2,3,4"}, 0.0, None, "with `folder` there is no `bbox`"),
        ({"folder": "city", "default_levels": 3}, 0.0, None, "with `folder` there is no `default_levels`"),
        ({"map": "city", "default_levels": 3}, 0.0, None, "`default_levels` cannot change it"),
        ({"file": "town.osm", "default_levels": 0}, 0.0, None, "default_levels"),
        ({"file": "town.osm", "default_levels": 2.5}, 0.0, None, "not a whole number"),
        ({"file": "town.osm", "bbox": "1,2"}, 0.0, None, "not a bounding box"),
        ({"folder": "city"}, 2.0, None, "would flood the ground"),
        ({"folder": "city"}, 0.0, (30.0, 121.5), "origin is 1.* m from the city's"),
    ],
)
def test_wrong_options_of_a_mission_are_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, options: dict[str, str], datum: float,
    origin: tuple[float, float] | None, message: str,
) -> None:  # fmt: skip
    monkeypatch.chdir(tmp_path)
    bare = Map()
    bare.way(square(0, 0, 30), {"building": "yes"})  # no roads: built in a moment
    build(bare.write(tmp_path / "town.osm"), Options(), tmp_path / "city")
    place = {} if origin is None else {"origin": origin}
    with pytest.raises(UsageError, match=message) as caught:
        city_of(SceneSpec(kind="map", options=options, datum_m=datum, **place))  # type: ignore[arg-type]
    assert caught.value.hint


def test_the_cache_folder_follows_the_environment(cache: Path) -> None:
    assert os.fspath(cities_folder()) == os.fspath(cache / "lingjing" / "cities")


def furnished(tmp_path: Path) -> Path:
    made = town()
    for x in (-300.0, -250.0):
        made.node(x, 9.0, highway="street_lamp")
    made.node(-200.0, 0.7, highway="bus_stop")  # on the carriageway
    made.node(-150.0, -12.0, amenity="bench")
    made.node(0.0, 230.0, amenity="bench")  # in the river
    made.way(square(-300, -350, 60, 40), {"amenity": "parking"})
    made.way(square(-200, -350, 60, 40), {"amenity": "parking", "parking": "underground"})
    return made.write(tmp_path / "furnished.osm")


def test_furniture_of_the_map_is_an_option(tmp_path: Path) -> None:
    file = furnished(tmp_path)
    plain = {
        prop.cls for tile in Tiles(city_of(SceneSpec(kind="map", options={"file": str(file)}))) for prop in tile.props
    }
    assert plain == {"tree"}
    city = city_of(SceneSpec(kind="map", options={"file": str(file), "furniture": 1}))
    props = [prop for tile in Tiles(city) for prop in tile.props]
    by_kind = {cls: [prop for prop in props if prop.cls == cls] for cls in {prop.cls for prop in props}}
    assert [len(by_kind[cls]) for cls in ("lamp", "bus_stop", "bench")] == [2, 1, 1]
    assert all(abs(lamp.heading_deg - 180.0) < 5.0 for lamp in by_kind["lamp"])  # the road lies to the south of them
    (stop,) = by_kind["bus_stop"]
    lanes = [shapely.LineString([p[:2] for p in lane.shape]).buffer(lane.width_m / 2)
             for tile in Tiles(city) for road in tile.roads for lane in road.lanes]  # fmt: skip
    place = shapely.Point(stop.position[:2])
    assert 0.3 < shapely.union_all(lanes).distance(place) < 3.0
    cars = by_kind["parked_car"]
    assert 40 < len(cars) < 100 and {car.options["variant"] for car in cars} > {0, 1, 2, 3}
    boxes = [
        shapely.affinity.rotate(shapely.box(-0.9, -2.25, 0.9, 2.25), -car.heading_deg, origin=(0, 0)) for car in cars
    ]
    moved = [shapely.affinity.translate(box, *car.position[:2]) for box, car in zip(boxes, cars, strict=True)]
    assert all(shapely.box(-300, -350, -240, -310).buffer(0.2).contains(box) for box in moved)
    assert shapely.union_all(moved).area == pytest.approx(sum(box.area for box in moved))  # none overlap
