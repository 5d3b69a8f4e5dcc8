"""The streets of a map for netconvert: a plain `.osm` of them alone, in the order of ids.

Whatever a map's format, order and other contents are, the same streets give the same bytes, so their network is made
once. (netconvert reads no `.pbf`, and finds no nodes in a file that begins with its ways.)
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from xml.sax.saxutils import quoteattr

from lingjing.scene.osm.elevation import heights
from lingjing.scene.osm.features import Features
from lingjing.scene.osm.read import MapData
from lingjing.scene.osm.tags import VEHICLES


def streets_xml(data: MapData, features: Features) -> str:
    """The document, with each node's height in its tag `ele`; empty if no way for vehicles touches the frame."""
    west, south, east, north = features.frame.box
    inside = {ref for ref, (lat, lon) in data.nodes.items() if west <= lon <= east and south <= lat <= north}
    ways = [way for way in data.ways if "highway" in way.tags and not inside.isdisjoint(way.nodes)]
    if not any(way.tags["highway"] in VEHICLES for way in ways):
        return ""
    kept = {way.id for way in ways}
    high = heights(data, features, [way for way in ways if way.tags["highway"] in VEHICLES])
    tags = {spot.id: spot.tags for spot in data.spots}
    lines = ['<?xml version="1.0" encoding="UTF-8"?>', '<osm version="0.6">']
    for ref in sorted({ref for way in ways for ref in way.nodes if ref in data.nodes}):
        lat, lon = data.nodes[ref]
        lines += _element(
            "node",
            f'id="{ref}" lat="{lat:.7f}" lon="{lon:.7f}"',
            (),
            tags.get(ref, {}) | {"ele": f"{high.get(ref, 0.0):g}"},
        )
    for way in ways:
        refs = [f'<nd ref="{ref}"/>' for ref in way.nodes if ref in data.nodes]
        lines += _element("way", f'id="{way.id}"', refs, _believable(way.tags))
    for relation in data.relations:
        if relation.tags["type"] != "restriction":
            continue
        if any(kind == "w" and ref in kept for kind, ref, _ in relation.members):
            members = [_member(*member) for member in relation.members]
            lines += _element("relation", f'id="{relation.id}"', members, relation.tags)
    return "\n".join((*lines, "</osm>\n"))


_KINDS = {"n": "node", "w": "way", "r": "relation"}


def _member(kind: str, ref: int, role: str) -> str:
    return f'<member type="{_KINDS[kind]}" ref="{ref}" role={quoteattr(role)}/>'


_MOST = {"lanes": 20.0, "width": 100.0, "maxspeed": 400.0}
"""The most that a tag of that first word may say: toll plazas have twenty lanes; no road is as wide or fast as that."""


_NUMBER = re.compile(r"-?\d+(?:\.\d+)?(?:[eE][+-]?\d+)?")


def _believable(tags: Mapping[str, str]) -> dict[str, str]:
    """Tags without those whose numbers are nonsense: a million lanes are a minute's work for netconvert."""
    return {key: text for key, text in tags.items() if _fits(text, _MOST.get(key.split(":")[0]))}


def _fits(text: str, most: float | None) -> bool:
    return most is None or all(0.0 < float(value) <= most for value in _NUMBER.findall(text))


def _element(name: str, attributes: str, children: Iterable[str], tags: dict[str, str]) -> Iterator[str]:
    yield f'<{name} {attributes} version="1">'
    yield from children
    yield from (f"<tag k={quoteattr(key)} v={quoteattr(value)}/>" for key, value in sorted(tags.items()))
    yield f"</{name}>"
