"""The streets of a map for netconvert: a plain `.osm` with only the streets, in the order of ids.

The same streets give the same bytes, independent of the map's format, order and other content, so their network is made
once. netconvert supports neither OpenStreetMap's hierarchy of access keys nor most notations of speed limits. So the
document states both in a form that it supports: speeds are numbers in km/h, and a street with unusual permissions gets
a variant of its kind, `residential|closed`.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from xml.sax.saxutils import quoteattr

from lingjing.scene.network import THROUGH_KEY
from lingjing.scene.osm.access import BUS_KEYS, CAR_KEYS, access
from lingjing.scene.osm.elevation import heights
from lingjing.scene.osm.features import Features
from lingjing.scene.osm.map_data import MapData
from lingjing.scene.osm.speed import limits
from lingjing.scene.osm.tags import VEHICLES

_SERVICES = "private emergency authority army vip pedestrian bicycle"
_TRAFFIC = f"{_SERVICES} passenger taxi bus coach delivery truck trailer motorcycle moped evehicle"
VARIANTS = {"closed": _SERVICES, "bus": f"{_SERVICES} bus coach", "open": f"{_TRAFFIC} hov", "destination": _TRAFFIC}
"""Vehicle classes of SUMO on the variants of a kind of street. No two are equal, because netconvert merges edges with
equal permissions."""


@dataclass(frozen=True, slots=True)
class Streets:
    """The streets of a map as input for netconvert."""

    document: str
    """OpenStreetMap XML; empty if no way for vehicles touches the frame."""
    variants: Mapping[str, str]
    """Kinds of streets in the document that SUMO does not define → permitted vehicle classes."""


def streets(data: MapData, features: Features) -> Streets:
    """The streets that touch the frame, with each node's elevation in its tag `ele`."""
    west, south, east, north = features.frame.box
    inside = {ref for ref, (lat, lon) in data.nodes.items() if west <= lon <= east and south <= lat <= north}
    ways = [way for way in data.ways if "highway" in way.tags and not inside.isdisjoint(way.nodes)]
    if not any(way.tags["highway"] in VEHICLES for way in ways):
        return Streets("", {})
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
    variants: dict[str, str] = {}
    for way in ways:
        refs = [f'<nd ref="{ref}"/>' for ref in way.nodes if ref in data.nodes]
        plain = street_tags(way.tags)
        kind, _, variant = plain["highway"].partition("|")
        if variant:
            variants[f"{kind}|{variant}"] = VARIANTS[variant]
        lines += _element("way", f'id="{way.id}"', refs, plain)
    for relation in data.relations:
        if relation.tags["type"] != "restriction":
            continue
        if any(kind == "w" and ref in kept for kind, ref, _ in relation.members):
            members = [_member(*member) for member in relation.members]
            lines += _element("relation", f'id="{relation.id}"', members, relation.tags)
    return Streets("\n".join((*lines, "</osm>\n")), variants)


def street_tags(tags: Mapping[str, str]) -> dict[str, str]:
    """A way's tags in the form for netconvert."""
    plain = {key: text for key, text in tags.items() if key != THROUGH_KEY and _fits(key.split(":")[0], text)}
    forward, backward = limits(tags)
    if forward is not None:
        plain["maxspeed"] = f"{forward:g}"
    if backward is not None and backward != forward:
        plain["maxspeed:backward"] = f"{backward:g}"
    if tags["highway"] in VEHICLES:
        plain = _permitted(plain)
    else:
        plain["highway"] = tags["highway"].replace("|", "_")
    plain.pop("access", None)  # netconvert lets `access=no` override all more specific keys
    return plain


# -- private

_KINDS = {"n": "node", "w": "way", "r": "relation"}


def _member(kind: str, ref: int, role: str) -> str:
    return f'<member type="{_KINDS[kind]}" ref="{ref}" role={quoteattr(role)}/>'


_MOST = {"lanes": 20.0, "width": 100.0, "maxspeed": 0.0, "zone": 0.0}
"""Greatest plausible value of tags with that first word (chosen: toll plazas have twenty lanes; no road is 100 m wide).
Speeds (0) are dropped and written anew."""


_NUMBER = re.compile(r"-?\d+(?:\.\d+)?(?:[eE][+-]?\d+)?")

_TYPE_KEYS = ("railway", "service", "waterway", "aeroway", "aerialway", "route", "usage", "highspeed", "cycleway")
"""Keys from which netconvert derives further kinds of a way, which would override a variant."""

_INNER = ("parking_aisle", "driveway", "drive-through")
"""Service roads that lead to one place and carry no through traffic."""


def _permitted(tags: dict[str, str]) -> dict[str, str]:
    """The tags with the variant of the kind, and the directions, that cars and buses may use."""
    ways = [access(tags, CAR_KEYS, direction) for direction in ("forward", "backward")]
    buses = [access(tags, BUS_KEYS, direction) for direction in ("forward", "backward")]
    oneway = _oneway(tags)
    used = {"yes": (0,), "-1": (1,)}.get(oneway, (0, 1))
    closed = [side for side in used if ways[side] == "closed"]
    if len(closed) == len(used):
        return _variant(tags, "bus" if any(buses[side] in ("open", "destination") for side in used) else "closed")
    if closed:
        tags = {**tags, "oneway": "-1" if closed == [0] else "yes"}
        if closed == [1] and buses[1] in ("open", "destination"):
            tags["oneway:bus"] = "no"
    elif oneway:
        tags = {**tags, "oneway": oneway}
    if tags["highway"] == "service" and tags.get("service") in _INNER:
        return tags
    if all(ways[side] == "destination" for side in used if side not in closed):
        return {**_variant(tags, "destination"), THROUGH_KEY: "no"}
    return _variant(tags, "open") if tags["highway"] == "service" and any(ways) else tags


def _oneway(tags: Mapping[str, str]) -> str:
    """`yes`, `-1`, `no` or empty: the most specific key that states the direction for cars."""
    keys = ("oneway:motorcar", "oneway:motor_vehicle", "oneway:vehicle", "oneway")
    text = next((tags[key] for key in keys if key in tags), "").strip().casefold()
    known = {"true": "yes", "1": "yes", "yes": "yes", "-1": "-1", "reverse": "-1", "no": "no", "false": "no", "0": "no"}
    return known.get(text, "")


def _variant(tags: Mapping[str, str], name: str) -> dict[str, str]:
    kept = {key: text for key, text in tags.items() if key.split(":")[0] not in (*_TYPE_KEYS, "bus", "psv")}
    return {**kept, "highway": f"{tags['highway']}|{name}"}


def _fits(word: str, text: str) -> bool:
    most = _MOST.get(word)
    return most is None or (most > 0.0 and all(0.0 < float(value) <= most for value in _NUMBER.findall(text)))


def _element(name: str, attributes: str, children: Iterable[str], tags: Mapping[str, str]) -> Iterator[str]:
    yield f'<{name} {attributes} version="1">'
    yield from children
    yield from (f"<tag k={quoteattr(key)} v={quoteattr(value)}/>" for key, value in sorted(tags.items()))
    yield f"</{name}>"
