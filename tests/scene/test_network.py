import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from lingjing.errors import InfrastructureError, UsageError
from lingjing.installation import install_line
from lingjing.scene import network
from lingjing.scene.network import StreetEdge, StreetNode, build_network, network_from_osm, read_roads

ORIGIN = (31.0, 121.5)


@pytest.fixture(autouse=True)
def cache_folder(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))


def cross(control="traffic_light", deck=0.0, lanes=2):
    places = {"c": (0, 0, 0), "w": (-200, 0, 0), "e": (200, 30, deck), "n": (0, 150, 0)}
    nodes = [
        StreetNode(id=k, east=x, north=y, elevation=z, control=control if k == "c" else "priority")
        for k, (x, y, z) in places.items()
    ]
    edges = []
    for other in "wen":
        edges.append(
            StreetEdge(id=f"c{other}", start="c", end=other, lanes=lanes, bridge=other == "e", name="Main & Co")
        )
        edges.append(StreetEdge(id=f"{other}c", start=other, end="c", lanes=lanes, bridge=other == "e"))
    return nodes, edges


def test_lanes_lie_in_world_metres_to_the_right_of_the_street():
    roads, junctions = read_roads(build_network(*cross(deck=9.0)).path)
    by_id = {road.id: road for road in roads}
    assert len(roads) == 6
    east_bound = by_id["wc"]
    assert len(east_bound.lanes) == 2
    right, left = east_bound.lanes
    assert right.shape[0] == pytest.approx((-200.0, -4.95, 0.0), abs=0.02)
    assert left.shape[0] == pytest.approx((-200.0, -1.65, 0.0), abs=0.02)
    assert right.shape[-1][0] < -5.0, "a lane ends before the crossing"
    assert by_id["ce"].bridge and not by_id["wc"].bridge
    assert by_id["ce"].name == "Main & Co"
    assert by_id["ce"].lanes[0].shape[-1][2] == pytest.approx(9.0, abs=0.5)
    centre = next(junction for junction in junctions if junction.id == "c")
    assert centre.lights
    assert min(x for x, _ in centre.polygon) < 0 < max(x for x, _ in centre.polygon)


def test_a_bent_street_goes_through_its_points_from_node_to_node():
    nodes = [StreetNode(id="a", east=0, north=0), StreetNode(id="b", east=300, north=0, elevation=6.0)]
    bend = ((100.0, 50.0, 0.0), (200.0, 50.0, 6.0))
    there = StreetEdge(id="ab", start="a", end="b", shape=bend)
    back = StreetEdge(id="ba", start="b", end="a", shape=bend[::-1])
    roads, _ = read_roads(build_network(nodes, [there, back]).path)
    line = next(road for road in roads if road.id == "ab").lanes[0].shape
    assert line[0][0] < 15.0 and line[-1][0] > 285.0
    assert any(abs(x - 200.0) < 3.0 and abs(y - 48.5) < 3.0 and z == 6.0 for x, y, z in line)


def test_a_network_is_cached_by_content_and_the_same_in_every_folder(tmp_path, monkeypatch):
    first = build_network(*cross())
    stamp = os.stat(first.path).st_mtime_ns
    assert build_network(*cross()) == first
    assert os.stat(first.path).st_mtime_ns == stamp
    assert build_network(*cross(lanes=1)).sha256 != first.sha256
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "elsewhere"))
    again = build_network(*cross())
    assert again.path != first.path
    assert again.sha256 == first.sha256
    assert Path(again.path).read_bytes() == Path(first.path).read_bytes()


def test_concurrent_builders_leave_one_complete_network():
    with ThreadPoolExecutor(4) as pool:
        nets = list(pool.map(lambda _: build_network(*cross()), range(4)))
    assert len(set(nets)) == 1
    assert len(read_roads(nets[0].path)[0]) == 6
    assert [item for item in Path(nets[0].path).parent.iterdir() if item.name.startswith(".new-")] == []


def test_sumo_finds_routes_through_the_network():
    """SUMO finds routes through the crossing: the network's connections are valid."""
    net = build_network(*cross())
    program = (
        "import sumolib, sys; net = sumolib.net.readNet(sys.argv[1]);"
        "path, cost = net.getShortestPath(net.getEdge('wc'), net.getEdge('ce')); print([e.getID() for e in path])"
    )
    run = subprocess.run([sys.executable, "-c", program, net.path], capture_output=True, text=True, check=True)
    assert run.stdout.strip() == "['wc', 'ce']"


def test_streets_that_form_no_network_are_refused_with_the_reason():
    nodes, edges = cross()
    with pytest.raises(UsageError, match="nowhere"):
        build_network(nodes, [*edges, StreetEdge(id="x", start="c", end="nowhere")])
    with pytest.raises(UsageError, match="has no streets"):
        build_network(nodes, [])


def test_a_missing_netconvert_is_reported_with_the_line_that_installs_it(monkeypatch, tmp_path):
    network.netconvert.cache_clear()
    network._version.cache_clear()
    monkeypatch.setattr(network, "find_spec", lambda name: None)
    monkeypatch.setattr(network.sys, "executable", str(tmp_path / "python"))
    monkeypatch.delenv("SUMO_HOME", raising=False)
    with pytest.raises(InfrastructureError, match="netconvert") as caught:
        build_network(*cross(lanes=1))
    assert install_line("road") in caught.value.hint
    network.netconvert.cache_clear()


def test_a_file_that_is_no_network_is_refused(tmp_path):
    for text in ("", "<net><edge", "<nodes/>"):
        file = tmp_path / "x.net.xml"
        file.write_text(text)
        with pytest.raises(UsageError, match="no road network"):
            read_roads(file)
    with pytest.raises(UsageError, match="no road network"):
        read_roads(tmp_path / "absent.net.xml")


OSM = """<osm version="0.6"><bounds minlat="30.99" minlon="121.49" maxlat="31.01" maxlon="121.51"/>
<node id="1" lat="31.0" lon="121.5"/><node id="2" lat="31.0" lon="121.503"/>
<node id="3" lat="31.0" lon="121.506"><tag k="ele" v="6"/></node>
<node id="4" lat="31.0" lon="121.495"/><node id="5" lat="31.005" lon="121.495"/><node id="6" lat="31.002" lon="121.5"/>
<way id="7"><nd ref="1"/><nd ref="2"/>
<tag k="highway" v="primary"/><tag k="name" v="Quay"/><tag k="lanes" v="4"/></way>
<way id="8"><nd ref="2"/><nd ref="3"/>
<tag k="highway" v="primary"/><tag k="bridge" v="yes"/><tag k="layer" v="1"/></way>
<way id="10"><nd ref="1"/><nd ref="4"/><nd ref="5"/><tag k="highway" v="secondary"/></way>
<way id="11"><nd ref="1"/><nd ref="6"/><tag k="highway" v="residential"/></way>
<way id="9"><nd ref="1"/><nd ref="3"/><tag k="highway" v="footway"/></way></osm>"""


def test_roads_of_a_map_are_in_metres_from_its_origin():
    roads, _ = read_roads(network_from_osm(OSM, ORIGIN).path)
    assert sorted(road.id for road in roads) == ["-10", "-11", "-7", "-8", "10", "11", "7", "8"]
    by_id = {road.id: road for road in roads}
    assert by_id["7"].name == "Quay" and by_id["7"].kind == "primary" and len(by_id["7"].lanes) == 2
    assert by_id["8"].bridge and by_id["8"].lanes[0].shape[-1][0] == pytest.approx(573.0, abs=1.5)
    assert max(z for _, _, z in by_id["8"].lanes[0].shape) == pytest.approx(6.0)
    assert by_id["10"].lanes[0].shape[-1][2] == pytest.approx(0.0)


def test_a_map_without_roads_is_refused():
    with pytest.raises(UsageError, match=r"the map: there is no road|made no road network of the map"):
        network_from_osm('<osm version="0.6"><node id="1" lat="31.0" lon="121.5"/></osm>', ORIGIN)


def test_a_variant_of_a_kind_has_its_own_permissions_and_the_speed_of_its_kind():
    document = OSM.replace('"secondary"', '"secondary|closed"')
    roads, _ = read_roads(network_from_osm(document, ORIGIN, variants={"secondary|closed": "private"}).path)
    by_id = {road.id: road for road in roads}
    assert {lane.kind for lane in by_id["10"].lanes} == {"closed"}
    assert (by_id["10"].kind, by_id["10"].speed_mps) == ("secondary", pytest.approx(27.78))
    assert {lane.kind for lane in by_id["7"].lanes} == {"car"}
