"""Outlines of buffers without shapely are those of shapely, to the last bit."""

from __future__ import annotations

import json
import subprocess
import sys

import pytest

SCRIPT = """
import json, math, random, sys
from lingjing.mission.geos import buffer_outline

chance, cases = random.Random(3), []
for case in range(120):
    closed = case % 2 == 0
    if closed:
        corners = chance.randint(3, 9)
        turns = [2 * math.pi * k / corners for k in range(corners)]
        points = [(chance.uniform(5, 300) * math.cos(t), chance.uniform(5, 300) * math.sin(t)) for t in turns]
        reach = chance.choice([chance.uniform(0.5, 100), -chance.uniform(0.5, 5)])
    else:
        points = [(chance.uniform(-300, 300), chance.uniform(-300, 300)) for _ in range(chance.randint(2, 7))]
        reach = chance.uniform(0.5, 60)
    cases.append((points, reach, closed, buffer_outline(points, reach, closed=closed, segments=8)))
assert not {"shapely", "numpy"} & sys.modules.keys()
import shapely

plain_ones = differ = 0
for points, reach, closed, own in cases:
    shape = shapely.Polygon(points) if closed else shapely.LineString(points)
    grown = shape.buffer(reach, quad_segs=8, cap_style="round" if closed else "flat")
    plain = grown.geom_type == "Polygon" and not grown.is_empty and not grown.interiors
    differ += own != (list(grown.exterior.coords) if plain else None)
    plain_ones += own is not None
print(json.dumps([plain_ones, differ, buffer_outline([(0, 0), (1, 0)], 1.0, closed=False, segments=8)]))
"""


@pytest.mark.skipif(sys.platform != "linux", reason="the library lies elsewhere, and shapely is used")
def test_outlines_are_those_of_shapely() -> None:
    done = subprocess.run([sys.executable, "-c", SCRIPT], capture_output=True, text=True, check=True)
    plain_ones, differ, beside_shapely = json.loads(done.stdout)
    assert plain_ones > 80
    assert differ == 0
    assert beside_shapely is None, "a process with shapely uses shapely"
