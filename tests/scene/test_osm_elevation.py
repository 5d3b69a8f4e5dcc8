from itertools import pairwise
from pathlib import Path

import pytest

from lingjing.scene.osm.elevation import GRADE, bridge_heights, heights
from lingjing.scene.osm.features import collect
from lingjing.scene.osm.frame import choose
from lingjing.scene.osm.read import read
from tests.scene.osm_maps import Map

STREET, BRIDGE = {"highway": "primary"}, {"highway": "primary", "bridge": "yes", "layer": "1"}
TUNNEL = {"highway": "primary", "tunnel": "yes", "layer": "-1"}


def profile(made: Map, folder: Path, points: list[tuple[float, float]]) -> list[float]:
    """Elevations of the nodes at some points."""
    data = read(made.write(folder / "small.osm"))
    elevations = heights(data, collect(data, choose(data, None)), [way for way in data.ways if "highway" in way.tags])
    return [elevations[made.node(x, y)] for x, y in points]


def line(start: int, end: int) -> list[tuple[float, float]]:
    return [(float(x), 0.0) for x in range(start, end + 1, 20)]


def test_a_bridge_over_a_street_is_raised_and_its_ramps_descend(tmp_path: Path) -> None:
    made = Map()
    made.way(line(-400, -40), STREET)
    made.way(line(-40, 40), BRIDGE)
    made.way(line(40, 400), STREET)
    made.way([(0, -200), (0, 200)], STREET)
    elevations = profile(made, tmp_path, line(-400, 400))
    middle = [z for (x, _), z in zip(line(-400, 400), elevations, strict=True) if -40 <= x <= 40]
    assert middle == [6.0] * 5
    assert elevations[0] == elevations[-1] == 0.0
    assert max(abs(b - a) / 20.0 for a, b in pairwise(elevations)) == pytest.approx(GRADE, abs=0.001)
    assert profile(made, tmp_path, [(0, -200), (0, 200)]) == [0.0, 0.0]


def test_a_bridge_over_water_alone_stays_level(tmp_path: Path) -> None:
    made = Map()
    made.way(line(-400, -40), STREET)
    made.way(line(-40, 40), BRIDGE)
    made.way(line(40, 400), STREET)
    made.way([(0, -200), (0, 200)], {"waterway": "river"})
    assert set(profile(made, tmp_path, line(-400, 400))) == {0.0}


def test_a_bridge_over_a_bridge_is_raised_higher(tmp_path: Path) -> None:
    made = Map()
    made.way([(0, -200), (0, 200)], STREET)
    made.way([(-100, 0), (100, 0)], BRIDGE)
    made.way([(-50, -150), (50, 150)], BRIDGE | {"layer": "3"})
    made.way([(200, -100), (200, 100)], {"railway": "rail"})
    made.way([(150, 50), (250, 50)], BRIDGE)
    made.way([(300, -100), (300, 100)], {"railway": "subway", "tunnel": "yes", "layer": "-1"})
    made.way([(280, 50), (350, 50)], BRIDGE)
    assert bridge_heights(made.features(tmp_path)) == {"w2": 6.0, "w3": 12.0, "w5": 6.0, "w7": 0.0}


def test_tunnels_descend_from_their_portals_and_streets_stay_level(tmp_path: Path) -> None:
    made = Map()
    made.way(line(-400, -200), STREET)
    made.way(line(-200, 200), TUNNEL)
    made.way(line(200, 400), STREET)
    elevations = dict(zip(line(-400, 400), profile(made, tmp_path, line(-400, 400)), strict=True))
    assert all(z == 0.0 for (x, _), z in elevations.items() if abs(x) >= 200)
    assert elevations[-180.0, 0.0] == pytest.approx(-20 * GRADE, abs=0.01)
    assert elevations[0.0, 0.0] == -6.0
