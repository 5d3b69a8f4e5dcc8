"""Small maps for tests, written in metres about a place and stored as OpenStreetMap XML."""

from __future__ import annotations

from pathlib import Path
from xml.sax.saxutils import quoteattr

import osmium

from lingjing.mission.frames import to_geodetic
from lingjing.scene.osm.features import Features, collect
from lingjing.scene.osm.frame import choose
from lingjing.scene.osm.read import read

PLACE = (31.2, 121.5)
Points = list[tuple[float, float]]


def square(x: float, y: float, side: float, high: float | None = None) -> Points:
    """A closed rectangle from its south-west corner."""
    top = side if high is None else high
    return [(x, y), (x + side, y), (x + side, y + top), (x, y + top), (x, y)]


class Map:
    """Collects nodes, ways and relations. Ids count from 1 in the order of adding. `half_m`: half the stated box."""

    def __init__(self, half_m: float | None = 500.0) -> None:
        self._nodes: dict[tuple[float, float], int] = {}
        self._tagged: dict[int, dict[str, str]] = {}
        self._ways: list[str] = []
        self._relations: list[str] = []
        self._half = half_m

    def node(self, x: float, y: float, **tags: str) -> int:
        ref = self._nodes.setdefault((x, y), len(self._nodes) + 1)
        self._tagged.setdefault(ref, {}).update(tags)
        return ref

    def way(self, points: Points, tags: dict[str, str] | None = None, missing: int = 0) -> int:
        """Add a way. `missing`: number of references to nodes that do not exist."""
        refs = [self.node(x, y) for x, y in points] + [10_000 + k for k in range(missing)]
        number = len(self._ways) + 1
        lines = "".join(f'<nd ref="{ref}"/>' for ref in refs)
        self._ways.append(f'<way id="{number}">{lines}{_tags(tags or {})}</way>')
        return number

    def relation(self, members: list[tuple[int, str]], tags: dict[str, str]) -> int:
        number = len(self._relations) + 1
        lines = "".join(f'<member type="way" ref="{ref}" role="{role}"/>' for ref, role in members)
        self._relations.append(f'<relation id="{number}">{lines}{_tags({"type": "multipolygon", **tags})}</relation>')
        return number

    def text(self, *, ways_first: bool = False) -> str:
        box = ""
        if self._half is not None:
            south, west = to_geodetic(-self._half, -self._half, PLACE)
            north, east = to_geodetic(self._half, self._half, PLACE)
            box = f'<bounds minlat="{south:.7f}" minlon="{west:.7f}" maxlat="{north:.7f}" maxlon="{east:.7f}"/>'
        nodes = []
        for (x, y), ref in self._nodes.items():
            latitude, longitude = to_geodetic(x, y, PLACE)
            nodes.append(
                f'<node id="{ref}" lat="{latitude:.7f}" lon="{longitude:.7f}">{_tags(self._tagged[ref])}</node>'
            )
        parts = [*self._relations, *self._ways, *nodes] if ways_first else [*nodes, *self._ways, *self._relations]
        return "\n".join(('<?xml version="1.0"?><osm version="0.6">', box, *parts, "</osm>\n"))

    def write(self, path: Path, *, ways_first: bool = False) -> Path:
        path.write_text(self.text(ways_first=ways_first), encoding="utf-8")
        return path

    def features(self, folder: Path) -> Features:
        data = read(self.write(folder / "small.osm"))
        return collect(data, choose(data, None))


def convert(path: Path, target: Path) -> Path:
    """Convert the map to the format of the target's suffix."""
    header = osmium.io.Reader(str(path)).header()  # it states the map's box
    with osmium.SimpleWriter(str(target), header=header) as writer:
        for item in osmium.FileProcessor(str(path)):
            writer.add(item)
    return target


def _tags(tags: dict[str, str]) -> str:
    return "".join(f"<tag k={quoteattr(key)} v={quoteattr(value)}/>" for key, value in tags.items())


def town() -> Map:
    """Four houses, a crossing with a bridge, a park with a pond, a river, a pier and a wall."""
    made = Map()
    for k, (x, y) in enumerate(((40, 40), (-80, 40), (-80, -80), (40, -80))):
        made.way(square(x, y, 30), {"building": "yes", "building:levels": str(3 + k)})
    made.way([(-400, 0), (0, 0), (400, 0)], {"highway": "primary", "lanes": "2", "name": "East Road"})
    made.way([(0, -400), (0, 0), (0, 150)], {"highway": "residential"})
    made.way([(0, 150), (0, 320)], {"highway": "residential", "bridge": "yes", "layer": "1"})
    made.way([(-100, 165), (100, 165)], {"highway": "residential", "name": "Under the Bridge"})
    made.way([(0, 320), (0, 450)], {"highway": "residential"})
    made.way(square(-480, 180, 960, 100), {"natural": "water", "water": "river"})
    made.way(square(100, -300, 150), {"leisure": "park"})
    made.way(square(150, -250, 40), {"natural": "water", "water": "pond"})
    made.way([(200, 180), (200, 220)], {"man_made": "pier"})
    made.way([(-200, -100), (-200, -40)], {"barrier": "wall", "height": "2.5"})
    made.node(60.5, -120.25, natural="tree")
    return made
