"""The road map: routes along permitted turns, with their lengths, from the file that the traffic engine loads."""

import math

import pytest

from lingjing.errors import UsageError
from lingjing.mission.geometry2d import Vector2
from lingjing.scene.network import StreetEdge, StreetNode, build_network
from lingjing.scene.road_map import RoadMap, RoadSegment, read_road_map

NODES = [
    StreetNode(id="a", east=0, north=0),
    StreetNode(id="b", east=200, north=0),
    StreetNode(id="c", east=200, north=200),
    StreetNode(id="d", east=0, north=200),
]


@pytest.fixture(scope="module")
def square() -> str:
    """A one-way square, driven anticlockwise."""
    edges = [StreetEdge(id=f"{a}{b}", start=a, end=b, speed_mps=10.0) for a, b in ("ab", "bc", "cd", "da")]
    return build_network(NODES, edges).path


def test_a_way_follows_one_way_streets(square: str):
    roads = read_road_map(square)
    assert set(roads.segments) == {"ab", "bc", "cd", "da"}
    way = roads.way((150.0, 0.0), (50.0, 0.0))
    assert way is not None
    assert way.segments == ("ab", "bc", "cd", "da", "ab")
    assert way.length_m == pytest.approx(700.0, abs=30.0)
    assert way.time_s == pytest.approx(way.length_m / 10.0, rel=0.01)
    assert math.dist(way.points[0], (150.0, 0.0)) < 4.0


def test_a_way_within_one_segment_is_straight(square: str):
    way = read_road_map(square).way((50.0, 3.0), (150.0, 3.0))
    assert way is not None
    assert (way.segments, len(way.points)) == (("ab",), 2)
    assert way.length_m == pytest.approx(100.0, abs=1.0)


def test_every_step_of_a_way_is_a_connection(square: str):
    roads = read_road_map(square)
    way = roads.way((200.0, 100.0), (200.0, 50.0))
    assert way is not None
    assert all(
        after in roads.segments[before].following for before, after in zip(way.segments, way.segments[1:], strict=False)
    )


def test_a_file_that_is_no_network_is_refused(tmp_path):
    (tmp_path / "x.net.xml").write_text("<notes/>")
    with pytest.raises(UsageError, match="is no road network"):
        read_road_map(str(tmp_path / "x.net.xml"))


def test_the_way_to_a_place_far_from_every_road_is_the_shortest() -> None:
    """The remaining distance is measured to the nearest point of the road network, not to the place itself."""

    def segment(name: str, start: Vector2, end: Vector2, length_m: float, *following: str) -> RoadSegment:
        return RoadSegment(
            id=name, start="", end="", shape=(start, end), length_m=length_m, speed_mps=10.0, following=following
        )

    roads = RoadMap(
        (
            segment("start", (-50.0, 0.0), (0.0, 0.0), 50.0, "short", "long"),
            segment("short", (0.0, 0.0), (40.0, -20.0), 110.0, "goal"),
            segment("long", (0.0, 0.0), (40.0, 20.0), 111.0, "goal"),
            segment("goal", (100.0, 0.0), (200.0, 0.0), 100.0),
        )
    )
    way = roads.way((-25.0, 0.0), (150.0, 300.0))
    assert way is not None and way.segments == ("start", "short", "goal")
    assert way.length_m == pytest.approx(25.0 + 110.0 + math.hypot(60.0, 20.0) + 50.0)
