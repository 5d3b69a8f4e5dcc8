"""Outlines of buffers without shapely equal those of shapely, to the last bit."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

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

FALLBACK = """
import json, sys
from lingjing.mission import geos
from lingjing.mission.geometry2d import buffered

shapes = [([(0.0, 0.0), (100.0, 0.0), (100.0, 50.0), (0.1, 60.3)], reach, True) for reach in (7.3, -5.0, 0.0)]
shapes += [([(0.0, 0.0), (100.0, 20.0), (60.0, -70.0)], 12.5, False)]
own = [buffered(points, reach, closed=closed) for points, reach, closed in shapes]
cold = "shapely" not in sys.modules
geos._library = lambda: None
print(json.dumps([cold, own == [buffered(points, reach, closed=closed) for points, reach, closed in shapes]]))
"""

MEMORY = """
import pathlib
from lingjing.mission.geos import buffer_outline

def grown(times):
    for _ in range(times):
        assert buffer_outline([(0.0, 0.0), (9.0, 0.0), (9.0, 5.0)], 5.0, closed=True, segments=8)
        assert buffer_outline([(0.0, 0.0), (9.0, 0.0), (9.0, 5.0)], -50.0, closed=True, segments=8) is None
    return int(pathlib.Path("/proc/self/statm").read_text().split()[1])

before = grown(100)
print(grown(5000) - before)
"""

BESIDE = """
import importlib.util, json, pathlib, sys
from lingjing.mission.geos import buffer_outline, _library

libraries = pathlib.Path(importlib.util.find_spec("shapely").origin).parents[1] / "shapely.libs"
place = pathlib.Path(sys.argv[1], "shapely.libs")
for file in libraries.iterdir():
    (place / file.name).symlink_to(file)
sys.path.insert(0, sys.argv[1])

def answers():
    _library.cache_clear()
    return buffer_outline([(0.0, 0.0), (9.0, 0.0)], 5.0, closed=False, segments=8) is not None

alone = answers()
(place / "libgeos_c-0.so").symlink_to(next(libraries.glob("libgeos_c*")))
print(json.dumps([alone, answers()]))
"""

LINUX = pytest.mark.skipif(sys.platform != "linux", reason="the library lies elsewhere, and shapely is used")


def printed(script: str, *arguments: str) -> Any:
    done = subprocess.run([sys.executable, "-c", script, *arguments], capture_output=True, text=True, check=True)
    return json.loads(done.stdout)


@LINUX
def test_outlines_equal_those_of_shapely() -> None:
    plain_ones, differ, beside_shapely = printed(SCRIPT)
    assert plain_ones > 80
    assert differ == 0
    assert beside_shapely is None, "a process with shapely uses shapely"


@LINUX
def test_buffers_are_the_same_without_the_library() -> None:
    assert printed(FALLBACK) == [True, True]


@LINUX
def test_the_memory_of_the_library_is_freed() -> None:
    assert printed(MEMORY) < 512, "pages of 4 KiB; 10,000 buffers took 5,600"


@LINUX
def test_no_library_is_used_if_several_are_present(tmp_path: Path) -> None:
    """A library that remains from a removed shapely may be of another version."""
    (tmp_path / "shapely").mkdir()
    (tmp_path / "shapely" / "__init__.py").touch()
    (tmp_path / "shapely.libs").mkdir()
    assert printed(BESIDE, str(tmp_path)) == [True, False]
