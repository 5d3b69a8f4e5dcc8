"""Access and speed of streets: OpenStreetMap's tags, and their effect in the network."""

from pathlib import Path

import pytest

from lingjing.engines.road.graph import read_graph
from lingjing.engines.road.routing import find_way
from lingjing.engines.road.simulation import Simulation
from lingjing.engines.road.traffic import Traffic
from lingjing.scene.city import Road
from lingjing.scene.network import network_from_osm, read_roads
from lingjing.scene.osm.access import BUS_KEYS, CAR_KEYS, access
from lingjing.scene.osm.features import collect
from lingjing.scene.osm.frame import choose
from lingjing.scene.osm.map_data import MapData
from lingjing.scene.osm.read import read
from lingjing.scene.osm.speed import NONE_KMH, WALK_KMH, limit_kmh, limits
from lingjing.scene.osm.streets import streets
from lingjing.scene.osm.tags import VEHICLES
from lingjing.scene.road_map import read_road_map
from tests.scene.osm_maps import Map

MAPS = Path(__file__).parents[3] / "shared" / "data" / "maps"
Tags = dict[str, str]


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))


# -- the hierarchy


@pytest.mark.parametrize(
    ("tags", "cars", "buses"),
    [
        ({}, None, None),
        ({"access": "no"}, "closed", "closed"),
        ({"access": "private"}, "closed", "closed"),
        ({"vehicle": "no"}, "closed", "closed"),
        ({"motor_vehicle": "no"}, "closed", "closed"),
        ({"motorcar": "no"}, "closed", None),
        ({"bicycle": "no", "foot": "no", "hgv": "no"}, None, None),
        ({"access": "no", "motor_vehicle": "yes"}, "open", "open"),
        ({"access": "yes", "vehicle": "no"}, "closed", "closed"),
        ({"motor_vehicle": "no", "psv": "yes"}, "closed", "open"),
        ({"motor_vehicle": "no", "bus": "designated"}, "closed", "open"),
        ({"psv": "yes", "bus": "no"}, None, "closed"),
        ({"motor_vehicle": "no", "motorcar": "destination"}, "destination", "closed"),
        ({"access": "destination"}, "destination", "destination"),
        ({"access": "customers"}, "destination", "destination"),
        ({"access": "agricultural;forestry"}, "closed", "closed"),
        ({"access": "Agricultural; Destination"}, "destination", "destination"),
        ({"motor_vehicle": "sometimes", "vehicle": "private"}, "closed", "closed"),
        ({"access": "unknown"}, None, None),
        ({"motor_vehicle:conditional": "no @ (22:00-06:00)"}, None, None),
    ],
)
def test_the_most_specific_key_with_a_value_counts(tags: Tags, cars: str | None, buses: str | None) -> None:
    assert access(tags, CAR_KEYS) == cars
    assert access(tags, BUS_KEYS) == buses


def test_a_key_for_one_direction_precedes_the_general_key() -> None:
    tags = {"vehicle": "yes", "vehicle:backward": "no"}
    assert [access(tags, CAR_KEYS, way) for way in ("forward", "backward")] == ["open", "closed"]
    assert access({**tags, "motorcar": "yes"}, CAR_KEYS, "backward") == "open"


# -- speeds


@pytest.mark.parametrize(
    ("text", "kmh"),
    [
        ("50", 50.0),
        (" 50 ", 50.0),
        ("50;30", 30.0),
        ("30;50", 30.0),
        ("50; 30 ", 30.0),
        ("50,30", 30.0),
        ("50|30|30", 30.0),
        ("50/30", 30.0),
        ("30-50", 30.0),
        ("sign;50", 50.0),
        ("12,5", 12.5),
        ("30 mph", 48.28),
        ("30mph", 48.28),
        ("20 mph;30 mph", 32.19),
        ("50 km/h", 50.0),
        ("50kmh", 50.0),
        ("10 knots", 18.52),
        ("walk", WALK_KMH),
        ("none", NONE_KMH),
        ("None", NONE_KMH),
        ("DE:urban", 50.0),
        ("de:rural", 100.0),
        ("AT:urban", 50.0),
        ("AT:rural", 100.0),
        ("AT:zone:30", 30.0),
        ("DE:zone30", 30.0),
        ("DE:zone:20", 20.0),
        ("DE:30", 30.0),
        ("zone30", 30.0),
        ("DE:bicycle_road", 30.0),
        ("DE:living_street", WALK_KMH),
        ("DE:motorway", NONE_KMH),
        ("RU:urban", 60.0),
        ("GB:nsl_single", 96.56),
        ("GB:zone20", 32.19),
        ("BE-VLG:rural", 90.0),
        ("50 (30)", 30.0),
        ("ca. 50", 50.0),
        ("50?", 50.0),
        ("50km", 50.0),
        ("max 30 mph", 48.28),
        ("20-30 mph", 32.19),
        ("30;20 mph", 32.19),
        ("RU:60 ?", None),
        ("US:urban", 40.23),
        ("80 @ (wet)", None),
        ("80@(wet)", None),
        ("100;80 @ (22:00-06:00; wet)", 100.0),
        ("sign", None),
        ("signals", None),
        ("variable", None),
        ("", None),
        (";;", None),
        ("0", None),
        ("-50", None),
        ("nan", None),
        ("1e308", None),
        ("999", None),
        ("9" * 5000, None),
        ("fast", None),
    ],
)
def test_speeds_are_read_in_every_notation(text: str, kmh: float | None) -> None:
    assert limit_kmh(text) == (None if kmh is None else pytest.approx(kmh, abs=0.01))


@pytest.mark.parametrize(
    ("tags", "along", "against"),
    [
        ({"maxspeed": "50"}, 50.0, 50.0),
        ({"maxspeed": "50", "maxspeed:backward": "30"}, 50.0, 30.0),
        ({"maxspeed": "50", "maxspeed:forward": "70"}, 70.0, 50.0),
        ({"maxspeed:forward": "70"}, 70.0, None),
        ({"maxspeed": "sign", "source:maxspeed": "DE:urban"}, 50.0, 50.0),
        ({"maxspeed": "80", "maxspeed:type": "DE:rural"}, 80.0, 80.0),
        ({"zone:maxspeed": "DE:30"}, 30.0, 30.0),
        ({"source:maxspeed": "survey 2020-05-30"}, None, None),
        ({"source:maxspeed": "bing 2012/05; DE:urban"}, 50.0, 50.0),
        ({"maxspeed": "50", "maxspeed:motorcar": "40", "maxspeed:hgv": "20"}, 40.0, 40.0),
        ({"maxspeed:conditional": "30 @ (wet)"}, None, None),
    ],
)
def test_speed_limits_are_read_for_both_directions_of_a_street(
    tags: Tags, along: float | None, against: float | None
) -> None:
    assert limits(tags) == (along, against)


# -- the network that netconvert makes


def roads_of(folder: Path, *ways: Tags) -> dict[str, list[Road]]:
    """The roads of each way by the sign of their direction. Each way runs from one cross street to another."""
    made = Map()
    made.way([(0, -20), (0, 20 * len(ways) + 20)], {"highway": "primary"})
    made.way([(200, -20), (200, 20 * len(ways) + 20)], {"highway": "primary"})
    names = [f"street {k}" for k in range(len(ways))]
    for k, tags in enumerate(ways):
        made.way([(0, 20 * k), (200, 20 * k)], {"highway": "secondary", "name": names[k], **tags})
    data = read(made.write(folder / "streets.osm"))
    roads, _ = _network(data)
    return {name: [road for road in roads if road.name == name] for name in names}


def _network(data: MapData) -> tuple[tuple[Road, ...], str]:
    frame = choose(data, None)
    map_streets = streets(data, collect(data, frame))
    made = network_from_osm(map_streets.document, frame.origin, frame.box, map_streets.variants)
    return read_roads(made.path)[0], made.path


def kinds(roads: list[Road]) -> dict[str, set[str]]:
    """Kinds of lanes by direction: `+` along the way, `-` against it."""
    return {"-" if road.id.startswith("-") else "+": {lane.kind for lane in road.lanes} for road in roads}


BOTH_WAYS = {"+": {"car"}, "-": {"car"}}
PERMISSIONS: list[tuple[Tags, dict[str, set[str]]]] = [
    ({}, BOTH_WAYS),
    ({"access": "no"}, {"+": {"closed"}, "-": {"closed"}}),
    ({"access": "private", "oneway": "yes"}, {"+": {"closed"}}),
    ({"access": "no", "motor_vehicle": "yes"}, BOTH_WAYS),
    ({"vehicle": "no", "bicycle": "yes"}, {"+": {"closed"}, "-": {"closed"}}),
    ({"motor_vehicle": "no", "psv": "yes"}, {"+": {"bus"}, "-": {"bus"}}),
    ({"access": "no", "bus": "designated", "oneway": "yes"}, {"+": {"bus"}}),
    ({"motorcar": "private", "railway": "tram", "cycleway": "lane"}, {"+": {"closed"}, "-": {"closed"}}),
    ({"access": "destination"}, BOTH_WAYS),
    ({"access": "permissive"}, BOTH_WAYS),
    ({"motor_vehicle:backward": "no"}, {"+": {"car"}}),
    ({"vehicle:forward": "no"}, {"-": {"car"}}),
    ({"oneway": "yes", "vehicle:forward": "no"}, {"+": {"closed"}}),
    ({"oneway": "no", "oneway:motor_vehicle": "yes"}, {"+": {"car"}}),
    ({"highway": "service", "access": "yes"}, BOTH_WAYS),
    ({"highway": "living_street", "access": "private"}, {"+": {"closed"}, "-": {"closed"}}),
]


def test_permissions_reach_the_network(tmp_path: Path) -> None:
    made = roads_of(tmp_path, *(tags for tags, _ in PERMISSIONS))
    for (tags, wanted), roads in zip(PERMISSIONS, made.values(), strict=True):
        assert kinds(roads) == wanted, tags
        assert {road.kind for road in roads} == {tags.get("highway", "secondary")}


SPEEDS: list[tuple[Tags, float, float]] = [
    ({"maxspeed": "50;30"}, 30.0, 30.0),
    ({"highway": "primary", "maxspeed": "50;30"}, 30.0, 30.0),
    ({"maxspeed": "30 mph"}, 48.28, 48.28),
    ({"maxspeed": "walk"}, WALK_KMH, WALK_KMH),
    ({"maxspeed": "none"}, NONE_KMH, NONE_KMH),
    ({"maxspeed": "AT:zone:30"}, 30.0, 30.0),
    ({"maxspeed": "DE:urban"}, 50.0, 50.0),
    ({"maxspeed": "60", "maxspeed:backward": "40"}, 60.0, 40.0),
    ({"maxspeed:forward": "20", "maxspeed": "40"}, 20.0, 40.0),
    ({"maxspeed": "sign"}, 100.0, 100.0),
    ({"maxspeed": "1e308"}, 100.0, 100.0),
    ({"access": "private", "maxspeed": "10"}, 10.0, 10.0),
]


def test_speeds_reach_the_network(tmp_path: Path) -> None:
    made = roads_of(tmp_path, *(tags for tags, _, _ in SPEEDS))
    for (tags, along, against), roads in zip(SPEEDS, made.values(), strict=True):
        speeds = {road.id.startswith("-"): road.speed_mps * 3.6 for road in roads}
        assert speeds == {False: pytest.approx(along, abs=0.1), True: pytest.approx(against, abs=0.1)}, tags


def short_cut(folder: Path, tags: Tags) -> str:
    """The network of a street that makes a detour, and of a short cut with these tags and a dead end."""
    made = Map()
    made.way([(-100, 0), (0, 0), (0, 300), (400, 300), (400, 0), (500, 0)], {"highway": "secondary", "name": "around"})
    made.way([(0, 0), (200, 0), (400, 0)], {"highway": "secondary", "name": "across", **tags})
    made.way([(200, 0), (200, -100)], {"highway": "residential", **tags})
    return _network(read(made.write(folder / "cut.osm")))[1]


@pytest.mark.parametrize(("tags", "through"), [({}, True), ({"motor_vehicle": "destination"}, False)])
def test_no_route_leads_through_streets_without_through_traffic(tmp_path: Path, tags: Tags, through: bool) -> None:
    path = short_cut(tmp_path, tags)
    roads = read_road_map(path)
    west, east, inside = (-80.0, 0.0), (480.0, 0.0), (200.0, -80.0)
    ways = {place: roads.way(west, place) for place in (east, inside)}
    back = roads.way(inside, west)
    lengths = [way.length_m for way in (ways[east], ways[inside], back) if way is not None]
    assert lengths[0] == pytest.approx(560.0 if through else 1160.0, rel=0.06)
    assert len(lengths) == 3 and max(lengths[1:]) < 450.0

    sim = Simulation(path, 1)  # the traffic engine
    try:
        graph = read_graph(sim)
        start, goal, near = (graph.nearest(*place, heading_deg=90.0) for place in (west, east, inside))
        assert start is not None and goal is not None and near is not None
        driven = find_way(graph, (start.lane.edge, start.at_m), (goal.lane.edge, goal.at_m))
        reached = find_way(graph, (start.lane.edge, start.at_m), (near.lane.edge, near.at_m))
        assert driven is not None and reached is not None
        assert driven.length_m == pytest.approx(560.0 if through else 1160.0, rel=0.06)
        assert driven.duration_s < 200.0, "what keeps it out is no part of the time it takes"
        assert reached.length_m < 500.0
        Traffic(sim, graph, 1)  # background vehicles use SUMO's own routing
        edges = sim.simulation.findRoute(start.lane.edge, goal.lane.edge).edges
        assert set(edges) == set(driven.edges)
    finally:
        sim.close()


def test_streets_without_access_tags_keep_their_kind(tmp_path: Path) -> None:
    made = Map()
    made.way([(0, 0), (100, 0)], {"highway": "residential", "foot": "yes", "hgv": "no"})
    data = read(made.write(tmp_path / "plain.osm"))
    assert streets(data, collect(data, choose(data, None))).variants == {}


@pytest.mark.parametrize(("name", "closed"), [("krems", 12), ("north-bayreuth", 28)])
def test_no_closed_street_of_a_real_town_is_open_to_cars(name: str, closed: int) -> None:
    """No closed way for vehicles of the two towns is open to cars. Eight were when only `access=no` counted."""
    path = MAPS / f"{name}.osm.gz"
    if not path.is_file():
        pytest.skip(f"the map is not at {path}")
    data = read(path)
    ways = {
        f"{way.id}"
        for way in data.ways
        if way.tags.get("highway") in VEHICLES and access(way.tags, CAR_KEYS) == "closed"
    }
    assert len(ways) == closed
    roads, _ = _network(data)
    open_to_cars = {
        road.id.lstrip("-").split("#")[0] for road in roads if any(lane.kind == "car" for lane in road.lanes)
    }
    assert len(open_to_cars) > 300
    assert not ways & open_to_cars
