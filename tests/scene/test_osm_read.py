"""Normalisation of maps: the result for each form of real files."""

import bz2
import gzip
import os
import shutil
import sys
from collections.abc import Callable
from pathlib import Path

import osmium
import pytest

from lingjing.errors import UsageError
from lingjing.scene.osm.build import Options, build
from lingjing.scene.osm.map_data import LONGEST_TEXT, MapData
from lingjing.scene.osm.read import read
from lingjing.scene.osm.summary import read_summary
from lingjing.scene.osm.xml_format import LONGEST_TOKEN
from lingjing.scene.tiles import Tiles
from lingjing.testing import run_command
from tests.scene.osm_maps import Map, convert, square, town

CORNERS = {1: (31.2, 121.5), 2: (31.2, 121.5003), 3: (31.2003, 121.5003), 4: (31.2003, 121.5)}
NODES = "".join(f'<node id="{ref}" lat="{lat}" lon="{lon}"/>' for ref, (lat, lon) in CORNERS.items())
RING = "".join(f'<nd ref="{ref}"/>' for ref in (1, 2, 3, 4, 1))
HOUSE = f'<way id="9">{RING}<tag k="building" v="yes"/></way>'
ROAD = '<way id="8"><nd ref="1"/><nd ref="2"/><tag k="highway" v="primary"/></way>'


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))


def reading(folder: Path, body: str, head: str = '<osm version="0.6">', name: str = "map.osm") -> MapData:
    path = folder / name
    path.write_text(f"{head}{body}</osm>", encoding="utf-8")
    return read(path)


# -- the part of the Earth that a file states


def bounds(south: float, west: float, north: float, east: float) -> str:
    return f'<bounds minlat="{south}" minlon="{west}" maxlat="{north}" maxlon="{east}" origin="x"/>'


def test_several_stated_parts_are_joined(tmp_path: Path) -> None:
    parts = bounds(31.0, 121.0, 31.1, 121.1) + bounds(31.05, 121.05, 31.2, 121.3) + bounds(30.9, 121.1, 31.0, 121.2)
    assert reading(tmp_path, parts + NODES).box == (121.0, 30.9, 121.3, 31.2)


def test_both_halves_of_a_map_with_two_stated_parts_are_built(tmp_path: Path) -> None:
    made = Map(half_m=None)
    made.way(square(0, 0, 30), {"building": "yes"})
    made.way(square(600, 0, 30), {"building": "yes"})
    halves = bounds(31.199, 121.499, 31.201, 121.502) + bounds(31.199, 121.502, 31.201, 121.508)
    path = tmp_path / "halves.osm"
    path.write_text(made.text().replace('<osm version="0.6">', f'<osm version="0.6">{halves}'))
    assert build(path, Options()).summary.counts["buildings"] == 2


def test_stated_parts_of_osmosis_are_read_and_bounds_of_ways_are_not(tmp_path: Path) -> None:
    assert reading(tmp_path, '<bound box="31.0,121.0,31.1,121.2" origin="osmosis"/>' + NODES).box == (
        121.0, 31.0, 121.2, 31.1,
    )  # fmt: skip
    inside = HOUSE.replace('id="9">', f'id="9">{bounds(1.0, 2.0, 3.0, 4.0)}')
    assert reading(tmp_path, NODES + inside).box is None  # Overpass's bounds of a way are not the file's


@pytest.mark.parametrize("value", ["", "nan", "north", "999", "inf"])
def test_an_invalid_stated_part_is_ignored_with_a_note(tmp_path: Path, value: str) -> None:
    odd = bounds(31.0, 121.0, 31.1, 121.1).replace("31.1", value)
    data = reading(tmp_path, bounds(31.0, 121.0, 31.3, 121.3) + odd + NODES)
    assert data.box == (121.0, 31.0, 121.3, 31.3)
    assert "not on Earth" in data.notes[0]


# -- versions of an object


@pytest.mark.parametrize("mark", ['action="delete"', 'visible="false"'])
def test_deleted_objects_are_left_out(tmp_path: Path, mark: str) -> None:
    lone = f'<node id="5" lat="31.2" lon="121.5" {mark}><tag k="natural" v="tree"/></node>'
    data = reading(tmp_path, NODES + lone + ROAD + HOUSE.replace('id="9"', f'id="9" {mark}'))
    assert [way.id for way in data.ways] == [8]
    assert 5 not in data.nodes and not data.spots
    kept = reading(tmp_path, NODES + HOUSE.replace('id="9"', 'id="9" action="modify" visible="true"'))
    assert [way.id for way in kept.ways] == [9]


def versions(*marks: str) -> str:
    """A way in several versions, each with its attributes and a height that identifies it."""
    return "".join(
        f'<way id="9" {mark}>{RING}<tag k="building" v="yes"/><tag k="height" v="{k}"/></way>'
        for k, mark in enumerate(marks, 1)
    )


@pytest.mark.parametrize(
    ("history", "counts"),
    [
        (('version="1"', 'version="2"'), "2"),
        (('version="2"', 'version="1"'), "1"),
        (('version="9"', 'version="10"'), "2"),
        (('version="1" visible="true"', 'version="2" visible="true"', 'version="3" visible="false"'), None),
        (('version="1"', 'version="2" visible="false"', 'version="3" visible="true"'), "3"),
        (('version="3" visible="true"', 'version="2" visible="false"'), "1"),
        (("", ""), "2"),
        (('version="draft"', 'version=""'), "2"),
    ],
)
def test_the_highest_version_of_a_history_counts(tmp_path: Path, history: tuple[str, ...], counts: str | None) -> None:
    data = reading(tmp_path, NODES + versions(*history))
    assert [way.tags["height"] for way in data.ways] == ([counts] if counts else [])


def test_a_house_uses_the_latest_version_of_its_nodes(tmp_path: Path) -> None:
    moved = '<node id="1" version="2" lat="31.1" lon="121.4"/>'
    assert reading(tmp_path, moved + NODES.replace("<node", '<node version="1"') + HOUSE).nodes[1] == (31.1, 121.4)


def test_a_history_gives_the_same_map_from_pbf_and_from_xml(tmp_path: Path) -> None:
    plain, binary = tmp_path / "history.osh", tmp_path / "history.osh.pbf"
    history = versions('version="1" visible="true"', 'version="2" visible="true"')
    deleted = f'<way id="10" version="1" visible="true">{RING}</way><way id="10" version="2" visible="false"/>'
    nodes = NODES.replace("<node", '<node version="1"')
    plain.write_text(f'<osm version="0.6">{nodes}{history}{deleted}</osm>')
    source = osmium.io.File(str(plain), "osm")
    with osmium.SimpleWriter(osmium.io.File(str(binary), "osh.pbf")) as writer:
        for item in osmium.FileProcessor(source):
            writer.add(item)
    assert read(binary) == read(plain)
    assert [(way.id, way.tags["height"]) for way in read(binary).ways] == [(9, "2")]


# -- ids, names of files, packing, metadata


def test_negative_ids_become_unique_positive_ids(tmp_path: Path) -> None:
    text = NODES + HOUSE + ROAD
    for ref in (1, 2, 9):
        text = text.replace(f'id="{ref}"', f'id="-{ref}"').replace(f'ref="{ref}"', f'ref="-{ref}"')
    data = reading(tmp_path, text + ROAD.replace('"8"', '"-8"').replace('"1"', '"3"').replace('"2"', '"4"'))
    assert all(ref > 0 for ref in (*data.nodes, *(way.id for way in data.ways)))
    assert len({way.id for way in data.ways}) == 3
    lines = {way.id: [data.nodes[ref] for ref in way.nodes] for way in data.ways}
    assert lines[8] == [CORNERS[1], CORNERS[2]]
    assert [CORNERS[3], CORNERS[4]] in lines.values()
    assert [way.id for way in data.ways] == sorted(lines)


def test_a_street_with_a_negative_id_is_driven_in_both_directions(tmp_path: Path) -> None:
    made = town()
    text = made.text()
    (number,) = (way.id for way in read(made.write(tmp_path / "t.osm")).ways if way.tags.get("name") == "East Road")
    path = tmp_path / "new.osm"
    path.write_text(text.replace(f'<way id="{number}">', f'<way id="-{number + 1}">'))
    built = build(path, Options())
    plain = build(made.write(tmp_path / "plain.osm"), Options())
    assert built.summary.counts["roads"] == plain.summary.counts["roads"]


@pytest.mark.parametrize(
    "name", ["MAP.OSM", "Map.Osm", "map.XML", "map", "interpreter", "MAP.OSM.GZ", "MAP.OSM.BZ2", "m.osm"]
)
@pytest.mark.parametrize("packed", [bytes, gzip.compress, bz2.compress])
def test_the_content_decides_the_format_not_the_name(tmp_path: Path, name: str, packed) -> None:  # type: ignore[no-untyped-def]
    (tmp_path / name).write_bytes(packed(f'<osm version="0.6">{NODES}{HOUSE}</osm>'.encode()))
    assert len(read(tmp_path / name).nodes) == 4


@pytest.mark.parametrize("name", ["MAP.OSM.PBF", "map.PBF", "map.osm"])
def test_pbf_is_recognised_under_any_name(tmp_path: Path, name: str) -> None:
    with osmium.SimpleWriter(str(tmp_path / "made.osm.pbf")) as writer:
        writer.add_node(osmium.osm.mutable.Node(id=1, location=(10.0, 50.0)))
    shutil.move(tmp_path / "made.osm.pbf", tmp_path / name)
    assert read(tmp_path / name).nodes == {1: (50.0, 10.0)}


METADATA = ("uid", "user", "changeset", "timestamp", "version", "visible", "action", "upload", "generator", "foo:bar")


@pytest.mark.parametrize("value", ["", "-1", "-5", "nan", "2 days ago", "99999999999999999999", "1.5", "ü", "x" * 3000])
@pytest.mark.parametrize("name", METADATA)
def test_metadata_may_have_any_form(tmp_path: Path, name: str, value: str) -> None:
    odd = f'{name}="{value}"'
    body = (NODES + HOUSE).replace("<node ", f"<node {odd} ").replace("<way ", f"<way {odd} ")
    data = reading(tmp_path, body, f'<osm xmlns:foo="x" {odd if name != "foo:bar" else ""}>')
    assert len(data.nodes) == 4
    assert [way.nodes for way in data.ways] == [(1, 2, 3, 4, 1)]


@pytest.mark.parametrize("ref", ["", "a", "1.5", "9" * 30, "9" * 5000])
def test_objects_without_a_number_are_left_out_and_counted(tmp_path: Path, ref: str) -> None:
    data = reading(tmp_path, NODES + HOUSE + HOUSE.replace('id="9"', f'id="{ref}"') + HOUSE.replace('id="9"', ""))
    assert [way.id for way in data.ways] == [9]
    assert data.skipped == {"objects without a number": 2}


# -- geometry in ways and relations (`out geom`)


def geometry(*refs: int, named: bool = False) -> str:
    lines = []
    for ref in refs:
        name = f' ref="{ref}"' if named else ""
        lines.append(f'<nd{name} lat="{CORNERS[ref][0]}" lon="{CORNERS[ref][1]}"/>' if ref else "<nd/>")
    return "".join(lines)


@pytest.mark.parametrize("named", [True, False])
def test_ways_may_contain_their_own_places(tmp_path: Path, named: bool) -> None:
    ring = geometry(1, 2, 3, 4, 1, named=named)
    other = geometry(2, 3, named=named)
    data = reading(
        tmp_path,
        f'<way id="9">{bounds(31, 121, 32, 122)}{ring}<tag k="building" v="yes"/></way>'
        f'<way id="8">{other}<tag k="highway" v="primary"/></way>',
    )
    assert len(data.nodes) == 4
    road, house = data.ways
    assert [data.nodes[ref] for ref in house.nodes] == [CORNERS[ref] for ref in (1, 2, 3, 4, 1)]
    assert house.nodes[0] == house.nodes[-1]
    assert set(road.nodes) < set(house.nodes), "two ways that meet share their nodes"


def test_ways_of_a_pbf_may_contain_their_places(tmp_path: Path) -> None:
    plain, binary = town().write(tmp_path / "town.osm"), tmp_path / "ways.osm.pbf"
    with osmium.SimpleWriter(osmium.io.File(str(binary), "pbf,locations_on_ways=true")) as writer:
        for item in osmium.FileProcessor(str(plain)).with_locations():
            if len(item.tags):
                writer.add(item)
    assert read(binary).nodes == read(plain).nodes
    assert read(binary).ways == read(plain).ways


def test_relations_may_contain_the_lines_of_their_members(tmp_path: Path) -> None:
    halves = "".join(
        f'<member type="way" ref="{ref}" role="outer">{geometry(*line)}</member>'
        for ref, line in ((21, (1, 2, 3)), (22, (3, 4, 1)))
    )
    tags = '<tag k="type" v="multipolygon"/><tag k="building" v="yes"/>'
    path = tmp_path / "geom.osm"
    path.write_text(f'<osm version="0.6"><relation id="5">{halves}{tags}</relation></osm>')
    data = read(path)
    assert [way.id for way in data.ways] == [21, 22]
    assert build(path, Options()).summary.counts["buildings"] == 1


def test_a_line_with_a_missing_place_has_a_gap(tmp_path: Path) -> None:
    data = reading(tmp_path, f'<way id="8">{geometry(1, 2, 0, 3, 4)}<tag k="highway" v="primary"/></way>')
    assert [ref in data.nodes for ref in data.ways[0].nodes] == [True, True, False, True, True]


def test_nodes_of_the_file_precede_places_in_ways(tmp_path: Path) -> None:
    moved = HOUSE.replace('ref="1"', 'ref="1" lat="1" lon="1"')
    assert reading(tmp_path, NODES + moved).nodes[1] == CORNERS[1]


def test_the_error_for_ways_without_places_names_the_query(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="not one node with a position") as caught:
        reading(tmp_path, HOUSE)
    assert "out geom" in caught.value.hint


# -- files that are no map, or incomplete


@pytest.mark.parametrize(
    "remark",
    [
        'runtime error: Query timed out in "query" at line 3 after 25 seconds.',
        "runtime error: Query run out of memory using about 2048 MB of RAM.",
        "Timeout &amp; abort",
    ],
)
def test_an_incomplete_answer_of_overpass_is_an_error(tmp_path: Path, remark: str) -> None:
    with pytest.raises(UsageError, match="is incomplete: Overpass stopped before its end: ") as caught:
        reading(tmp_path, f"{NODES}<remark> {remark} </remark>")
    assert "download again" in caught.value.hint


def test_another_remark_is_a_note(tmp_path: Path) -> None:
    data = reading(tmp_path, f"{NODES}<remark> served from\n a copy </remark><remark/><note>an error</note>")
    assert data.notes == ("the map's server remarks: served from a copy",)


def test_a_remark_of_overpass_on_its_budget_is_no_error(tmp_path: Path) -> None:
    budget = "runtime remark: Timeout is 180 and maxsize is 536870912."
    assert reading(tmp_path, f"{NODES}<remark> {budget} </remark>").notes == ()
    with pytest.raises(UsageError, match="stopped before its end: runtime error: Query timed out"):
        reading(tmp_path, f"{NODES}<remark> {budget}\nruntime error: Query timed out </remark>")


LANELET = (
    '<node id="1" lat="" lon=""><tag k="local_x" v="1"/></node><node id="2" lat="49.1" lon="8.2"/>'
    '<way id="3"><nd ref="1"/><nd ref="2"/><tag k="type" v="line_thin"/></way>'
    '<relation id="4"><member type="way" ref="3" role="left"/><tag k="type" v="lanelet"/></relation>'
)
OVERPASS_PAGE = """<?xml version="1.0" encoding="UTF-8"?>
<!DOCTYPE html PUBLIC "-//W3C//DTD XHTML 1.0 Strict//EN" "http://www.w3.org/TR/xhtml1/DTD/xhtml1-strict.dtd">
<html><head><title>OSM3S Response</title></head><body>
<p><strong style="color:#FF0000">Error</strong>: runtime error: The server is probably too busy. </p></body></html>"""
LFS = "version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 4\n"


@pytest.mark.parametrize(
    ("content", "message", "hint"),
    [
        ('{"version": 0.6, "osm3s": {}, "elements": []}', "OpenStreetMap data as Overpass JSON", "[out:xml]"),
        ('\n  {\n  "elements" : []}', "Overpass JSON", "[out:xml]"),
        ('{"type": "FeatureCollection", "features": []}', "it is GeoJSON", ".osm"),
        ('{"a": 1}', "it is JSON", ".osm"),
        ("[out:xml][timeout:25];way(1);out;", "it is a query to Overpass", "give the answer"),
        ("<osm-script><query/></osm-script>", "it is a query to Overpass", "give the answer"),
        (f"<osm>{LANELET}</osm>", "is a Lanelet2 map: it has lanes", "OpenStreetMap data of the same place"),
        (
            f"<osm>{LANELET.partition('<relation')[0]}</osm>",
            "is a Lanelet2 map",
            "OpenStreetMap data of the same place",
        ),
        (OVERPASS_PAGE, r"a web page \(HTML\), `runtime error: The server is probably too busy\.`", "download"),
        ("\ufeff <!DOCTYPE HTML><title>Sign in</title>", r"a web page \(HTML\), `Sign in`", "download"),
        ("<!-- a --><HTML lang='en'>", "a web page", "download"),
        ("<osmChange><modify/></osmChange>", "a list of changes", "osmium"),
        (f"<osm>{NODES}<delete>{HOUSE}</delete></osm>", "a list of changes", "osmium"),
        ("<osm><action type='create'/></osm>", "augmented diff", "as a map"),
        ("<gpx/>", "a GPS track", ".osm"),
        ('<k:kml xmlns:k="x"/>', "it is KML", ".osm"),
        ("<OpenDRIVE/>", "OpenDRIVE", ".osm"),
        ("<net version='1'/>", "a SUMO network", ".osm"),
        ("<a/>", "XML that begins with <a>", ".osm"),
        ("PK\x03\x04zip", "a zip archive", "unpack"),
        (LFS, "a Git LFS pointer", "git lfs pull"),
        ("hello", "it begins with `hello`", ".osm"),
        ("\0\1\2\3", "it is no text", ".osm"),
        ("n1 v1 dV c1 t2020-01-01T00:00:00Z i1 ua T x1 y2\n", "OpenStreetMap data as OPL", "osmium cat"),
        ("hello <osm>", "XML error: syntax error", ".osm"),
        ('<!DOCTYPE osm [<!ENTITY a "b">]><osm/>', "it declares entities", ".osm"),
        ('<?xml version="1.0" encoding="klingon"?><osm/>', "XML error: .*encoding", ".osm"),
        (f"<osm>{NODES}<way id='1'>", "it stops in the middle, in line 1", "download the map again"),
        (f"<osm>{NODES}<way id='1'><nd", "it stops in the middle, in line 1", "download the map again"),
    ],
)
def test_other_formats_are_named_with_advice(tmp_path: Path, content: str, message: str, hint: str) -> None:
    for path, data in (
        (tmp_path / "map.osm", content.encode()),
        (tmp_path / "map.osm.gz", gzip.compress(content.encode())),
    ):
        path.write_bytes(data)
        with pytest.raises(UsageError, match=message) as caught:
            read(path)
        assert hint in caught.value.hint
        assert str(path) in str(caught.value)


@pytest.mark.parametrize("filling", [" ", "\n", "<!---->", "<!-- a -->\n", "<?xml?>", "<title>"])
def test_text_before_a_map_is_skipped_fast(tmp_path: Path, filling: str) -> None:
    head = '<?xml version="1.0"?>' + 9000 * filling
    if filling.startswith(("<?", "<t")):
        with pytest.raises(UsageError):
            reading(tmp_path, "", head=f"<!doctype html>{head}")
    else:
        assert len(reading(tmp_path, NODES, head=f"{head}<osm>").nodes) == 4


def test_a_map_of_streets_may_have_lanelets_too(tmp_path: Path) -> None:
    both = LANELET.replace('lat=""', 'lat="49"').replace('lon=""', 'lon="8"') + ROAD
    assert len(reading(tmp_path, both).ways) == 2
    with pytest.raises(UsageError, match="is not on Earth"):
        reading(tmp_path, LANELET + ROAD)


def test_a_truncated_compressed_download_is_named(tmp_path: Path) -> None:
    (tmp_path / "cut.osm.gz").write_bytes(gzip.compress(f"<osm>{NODES}</osm>".encode())[:-12])
    with pytest.raises(UsageError, match=r"cannot be unpacked: .*end") as caught:
        read(tmp_path / "cut.osm.gz")
    assert "download the map again" in caught.value.hint


@pytest.mark.parametrize("inner", [gzip.compress, bz2.compress])
def test_a_twice_compressed_map_is_named(tmp_path: Path, inner: Callable[[bytes], bytes]) -> None:
    (tmp_path / "a.osm.gz").write_bytes(gzip.compress(inner(f"<osm>{NODES}</osm>".encode())))
    with pytest.raises(UsageError, match="was packed twice") as caught:
        read(tmp_path / "a.osm.gz")
    assert "unpack it once" in caught.value.hint


def test_a_compressed_pbf_is_named(tmp_path: Path) -> None:
    with osmium.SimpleWriter(str(tmp_path / "a.osm.pbf")) as writer:
        writer.add_node(osmium.osm.mutable.Node(id=1, location=(10.0, 50.0)))
    (tmp_path / "a.osm.pbf.gz").write_bytes(gzip.compress((tmp_path / "a.osm.pbf").read_bytes()))
    with pytest.raises(UsageError, match="packed once more"):
        read(tmp_path / "a.osm.pbf.gz")


# -- long tags


@pytest.mark.parametrize("tag", ['k="name" v="{}"', 'k="{}" v="yes"'])
def test_a_tag_of_two_megabytes_is_left_out_and_counted(tmp_path: Path, tag: str) -> None:
    long = f"<tag {tag.format('x' * (2 << 20))}/>"
    path = tmp_path / "long.osm"
    path.write_text(f'<osm version="0.6">{NODES}{HOUSE.replace("<tag", long + "<tag", 1)}</osm>')
    built = build(path, Options())
    assert built.summary.skipped == {f"tags longer than {LONGEST_TEXT} characters": 1}
    assert sum(len(tile.buildings) for tile in Tiles(built.city)) == 1


def test_an_endless_element_is_rejected_before_it_fills_the_memory(tmp_path: Path) -> None:
    path = tmp_path / "endless.osm.gz"
    begun = f'<osm version="0.6">{NODES}<tag k="a" v="'.encode()
    path.write_bytes(gzip.compress(begun + os.urandom(1 << 20).hex().encode() * (LONGEST_TOKEN // (1 << 20))))
    with pytest.raises(UsageError, match="line 1 begins an element of more than 8 MB"):
        read(path)


def test_the_command_line_prints_a_one_line_error(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "answer.osm"
    path.write_text('{"elements": []}')
    assert run_command(["scene", "build", str(path)]) == 2
    output = capsys.readouterr().err
    assert "Overpass JSON" in output and "[out:xml]" in output and "Traceback" not in output


@pytest.mark.parametrize("name", [b"\xff\xfe.osm", b"a\nb.osm", b"\x1b[31m.osm"])
def test_a_map_may_have_any_name(tmp_path: Path, name: bytes) -> None:
    path = tmp_path / os.fsdecode(name)
    try:
        path.write_text(f"<osm>{NODES}{HOUSE}</osm>")
    except OSError:
        pytest.skip("this file system has no such names")
    build(path, Options(), tmp_path / "city")
    summary = read_summary(tmp_path / "city")
    assert summary is not None and summary.city.isprintable() and summary.source.name.isprintable()


def test_only_pbf_needs_osmium(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    plain = town().write(tmp_path / "town.osm")
    binary = convert(plain, tmp_path / "town.osm.pbf")
    monkeypatch.setitem(sys.modules, "osmium", None)
    assert len(read(plain).ways) > 5
    with pytest.raises(UsageError, match="needs the package `osmium`") as caught:
        read(binary)
    assert "pip install" in caught.value.hint or "make setup" in caught.value.hint
