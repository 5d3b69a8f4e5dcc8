"""Maps with faults planted at random by a seed: structure, attributes, tags, bytes, compression, formats."""

from __future__ import annotations

import gzip
import random
import re
from functools import cache
from pathlib import Path

import osmium

from tests.scene.osm_maps import Map, square

NASTY = (
    "", " ", "0", "-1", "1", "7", "nan", "inf", "-inf", "1e308", "-1e308", "1e-320", "9" * 30, "9" * 5000, "-" * 40,
    "0x10", "yes", "no", "\u0663", "\u0661\u0662", "1_000", "+5", " 5 ", "5.5", "90.0001", "-180", "180", "91", "a;b;c",
    ";;;", "|", "||||||", "50;30", "residential|closed", "&#9;", "&#10;", "&amp;&lt;", "%s%n", "{}", "../../etc",
    "\U0001f600" * 50, "x" * 900, "x" * 2000, "multipolygon", "restriction", "lanelet", "true", "false", "delete",
    "2006-01-01T00:00:00Z", "-0.0",
)  # fmt: skip
"""Values that replace others."""

TAGS = (
    ("building", "yes"), ("building:part", "yes"), ("height", "12 m"), ("building:levels", "3"), ("min_height", "4"),
    ("roof:shape", "gabled"), ("roof:height", "3"), ("roof:direction", "90"), ("roof:levels", "1"), ("layer", "1"),
    ("building:colour", "red"), ("est_height", "~20"), ("height", "3-5"), ("place", "town"), ("population", "25000"),
    ("natural", "water"), ("natural", "coastline"), ("natural", "tree_row"),
    ("water", "river"), ("waterway", "river"), ("waterway", "riverbank"), ("width", "10"), ("highway", "primary"),
    ("highway", "motorway"), ("highway", "service"), ("highway", "footway"), ("highway", "steps"),
    ("highway", "construction"), ("lanes", "4"), ("lanes:forward", "2"), ("oneway", "-1"), ("maxspeed", "50"),
    ("maxspeed:backward", "walk"), ("access", "private"), ("motor_vehicle:backward", "no"), ("bus", "designated"),
    ("bridge", "yes"), ("tunnel", "yes"), ("junction", "roundabout"), ("area", "yes"), ("barrier", "wall"),
    ("man_made", "pier"), ("man_made", "bridge"), ("landuse", "residential"), ("landuse", "forest"),
    ("leisure", "park"), ("leisure", "pitch"), ("amenity", "parking"), ("place", "island"), ("railway", "tram"),
    ("aeroway", "runway"), ("turn:lanes", "left|through"), ("width:lanes", "3|3"), ("ele", "10"),
    ("type", "multipolygon"), ("restriction", "no_left_turn"), ("entrance", "yes"), ("name", "Ring"),
)  # fmt: skip

_ELEMENT = re.compile(r"<(?:node|way|relation)\b.*?(?:/>|</(?:node|way|relation)>)", re.DOTALL)
_ATTRIBUTE = re.compile(r'(\w+)="([^"]*)"')
_TAG = re.compile(r"<tag [^>]*/>")


@cache
def small_town() -> str:
    """A house with a part, a crossing with a bridge, water with an island, a restriction, a wall, metadata; 3 KB."""
    made = Map(half_m=150.0)
    made.way(square(20, 20, 30), {"building": "yes", "height": "40", "roof:shape": "gabled"})
    made.way(square(25, 25, 10), {"building:part": "yes", "min_height": "10", "height": "60"})
    made.way([(-140, 0), (0, 0), (140, 0)], {"highway": "primary", "lanes": "2", "name": "Ring", "maxspeed": "50"})
    made.way([(0, -140), (0, 0), (0, 60)], {"highway": "residential", "access": "destination"})
    made.way([(0, 60), (0, 140)], {"highway": "residential", "bridge": "yes", "layer": "1"})
    outer = made.way(square(-140, 70, 280, 40), {})
    inner = made.way(square(-100, 80, 20, 20), {"natural": "wood"})
    made.relation([(outer, "outer"), (inner, "inner")], {"natural": "water", "water": "river"})
    made.relation([(3, "from"), (4, "to")], {"type": "restriction", "restriction": "no_left_turn"})
    made.way([(-100, -40), (-60, -40)], {"barrier": "wall", "height": "2"})
    made.node(60.5, -50.25, natural="tree")
    text = made.text()
    return text.replace("<node ", '<node version="2" timestamp="2020-01-01T00:00:00Z" uid="1" user="a" changeset="3" ')


def mutated(seed: int, folder: Path) -> Path:
    """Write the map of a seed with one to eight faults."""
    chance = random.Random(seed)
    form = chance.choice(("osm",) * 8 + ("bytes", "gz", "pbf", "pbf"))
    if form == "pbf":
        path = folder / f"{seed}.osm.pbf"
        path.write_bytes(_damaged(_binary(folder), chance))
        return path
    text = small_town()
    for _ in range(chance.randint(1, 8)):
        text = chance.choice(_FAULTS)(text, chance)
    data = text.encode("utf-8", "surrogatepass")
    path = folder / f"{seed}.osm"
    if form == "bytes":
        data = _damaged(data, chance)
    elif form == "gz":
        path, data = folder / f"{seed}.osm.gz", gzip.compress(data, mtime=0)
        data = _damaged(data, chance) if chance.random() < 0.5 else data
    path.write_bytes(data)
    return path


# -- faults


def _other_attribute(text: str, chance: random.Random) -> str:
    return _replaced(text, _ATTRIBUTE, chance, lambda match: f'{match[1]}="{chance.choice(NASTY)}"')


def _no_attribute(text: str, chance: random.Random) -> str:
    return _replaced(text, _ATTRIBUTE, chance, lambda match: "")


def _odd_attribute(text: str, chance: random.Random) -> str:
    name = chance.choice(("action", "visible", "version", "uid", "changeset", "lat", "ref", "id", "minlat"))
    odd = f'{name}_odd="{chance.choice(NASTY)}" '
    return _replaced(
        text, re.compile("<(node|way|relation|nd|member|tag|bounds) "), chance, lambda match: match[0] + odd
    )


def _fresh_tag(text: str, chance: random.Random) -> str:
    key, value = chance.choice(TAGS)
    if chance.random() < 0.4:
        value = chance.choice(NASTY)
    return _replaced(
        text, re.compile("</(way|relation)>"), chance, lambda match: f'<tag k="{key}" v="{value}"/>{match[0]}'
    )


def _element(text: str, chance: random.Random) -> str:
    """Double an element, remove it, nest it in another, delete it, or move it."""
    match = chance.choice(list(_ELEMENT.finditer(text)) or [None])
    if match is None:
        return text
    other = chance.choice(list(_ELEMENT.finditer(text)))[0]
    way = chance.randrange(5)
    if way == 3:
        new = match[0].replace(" id=", chance.choice((' action="delete" id=', ' visible="false" id=')), 1)
    else:
        new = (match[0] * 2, "", match[0].replace(">", f">{other}", 1), "", other)[way]
    return text[: match.start()] + new + text[match.end() :]


def _swapped_refs(text: str, chance: random.Random) -> str:
    refs = [match[0] for match in re.finditer(r'ref="[^"]*"', text)] or ['ref="1"']
    return _replaced(text, re.compile(r'ref="[^"]*"'), chance, lambda match: chance.choice(refs))


def _moved_node(text: str, chance: random.Random) -> str:
    by = chance.choice((0.0, 1e-7, -1e-4, 1e-4, 1e-3, 1.0, 100.0))
    return _replaced(text, re.compile(r'lat="([^"]*)"'), chance, lambda match: f'lat="{_plus(match[1], by)}"')


def _stray(text: str, chance: random.Random) -> str:
    strays = (
        "<remark>runtime error: timed out</remark>", "<remark>fine</remark>", "<bounds/>", "<note>x</note>", "<way/>",
        "<tag/>", '<bounds minlat="a" minlon="1" maxlat="2" maxlon="3"/>', "<nd/>", '<nd ref="1" lat="5" lon="5"/>',
        '<bounds minlat="2" minlon="2" maxlat="1" maxlon="1"/>', "<osm>", "</osm>", "<action/>", "<!-- -->",
        '<member type="way" ref="1" role="outer"><nd lat="31.2" lon="121.5"/><nd/></member>', "<![CDATA[x]]>",
        '<bound box="1,2,3"/>', '<way id="99"><nd lat="31.2" lon="121.5"/><nd lat="31.3" lon="121"/></way>',
    )  # fmt: skip
    places = [match.end() for match in re.finditer(">", text)] or [0]
    at = chance.choice(places)
    return text[:at] + chance.choice(strays) + text[at:]


_FAULTS = (
    _other_attribute, _other_attribute, _no_attribute, _odd_attribute, _fresh_tag, _fresh_tag, _fresh_tag, _element,
    _swapped_refs, _moved_node, _stray,
)  # fmt: skip


def _replaced(text: str, pattern: re.Pattern[str], chance: random.Random, new) -> str:  # type: ignore[no-untyped-def]
    places = list(pattern.finditer(text))
    if not places:
        return text
    match = chance.choice(places)
    return text[: match.start()] + new(match) + text[match.end() :]


def _plus(text: str, by: float) -> str:
    try:
        return str(float(text) + by)
    except ValueError:
        return text


def _damaged(data: bytes, chance: random.Random) -> bytes:
    """The bytes with some changed, cut off, lost or doubled."""
    made = bytearray(data)
    for _ in range(chance.randint(1, 6)):
        at = chance.randrange(max(1, len(made)))
        way = chance.randrange(5)
        if way == 0:
            del made[at:]
        elif way == 1:
            del made[at : at + chance.randint(1, 50)]
        elif way == 2:
            made[at:at] = made[at : at + chance.randint(1, 50)]
        else:
            made[at : at + 1] = bytes((chance.randrange(256),))
    return bytes(made)


_BINARY: list[bytes] = []


def _binary(folder: Path) -> bytes:
    """The small town as uncompressed PBF, so that faults reach its content."""
    if not _BINARY:
        plain, target = folder / "plain.osm", folder / "plain.osm.pbf"
        plain.write_text(small_town(), encoding="utf-8")
        header = osmium.io.Reader(str(plain)).header()
        with osmium.SimpleWriter(osmium.io.File(str(target), "pbf,pbf_compression=none"), header=header) as writer:
            for item in osmium.FileProcessor(str(plain)):
                writer.add(item)
        _BINARY.append(target.read_bytes())
    return _BINARY[0]
