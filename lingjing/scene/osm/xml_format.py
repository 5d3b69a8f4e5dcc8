"""Read OpenStreetMap XML into a `MapCollector`, in one pass with the standard library's expat.

Only ids, places, versions, tags and references are read. Metadata (user, changeset, timestamp and additions of
programs) may have any form. Supported are files of the OpenStreetMap API, planet extracts, JOSM, Osmosis and Overpass
with all its forms of geometry.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from math import inf
from xml.parsers import expat

from lingjing.errors import UsageError
from lingjing.scene.osm.map_data import (
    LARGEST_ID,
    LONGEST_TEXT,
    DegreeBox,
    LatLon,
    MapCollector,
    Member,
)
from lingjing.scene.osm.source import HINT, MapFile

LONGEST_TOKEN = 8 << 20
"""Most bytes of one start tag (chosen): expat parses an unfinished tag again with each chunk, which is quadratic."""

_Attributes = dict[str, str]
_KINDS = {"node": "n", "way": "w", "relation": "r"}
_CUT = re.compile(r"error|time[d]?[ -]?out|out of memory|abort|exceed|incomplete|too many|truncat", re.IGNORECASE)
"""Words of a remark by which Overpass reports that its answer is incomplete."""

_BUDGET = re.compile(r"runtime remark: timeout is \d+( and maxsize is \d+)?\.?\s*", re.IGNORECASE)
"""The part of an Overpass remark that repeats the limits of the query."""

_ELSEWHERE = "download the place's OpenStreetMap data instead (.osm or .osm.pbf)"
_ROOTS: dict[str, tuple[str, str]] = {
    "html": ("a web page (HTML)", "the server answered with a page, perhaps an error: read it in a browser"),
    "osmChange": ("a list of changes (osmChange)", "apply it to a map: osmium apply-changes MAP.osm FILE.osc"),
    "osmAugmentedDiff": ("a list of changes (augmented diff)", "download the place as a map, not as changes"),
    "osm-script": ("a query to Overpass", "send it to Overpass and give the answer"),
    "gpx": ("a GPS track (GPX)", _ELSEWHERE),
    "kml": ("KML", _ELSEWHERE),
    "svg": ("a drawing (SVG)", _ELSEWHERE),
    "CityModel": ("CityGML", _ELSEWHERE),
    "FeatureCollection": ("GML", _ELSEWHERE),
    "OpenDRIVE": ("an OpenDRIVE road network", _ELSEWHERE),
    "net": ("a SUMO network", "give the .osm file that it was made from"),
    "osm-derived": ("Overpass data with derived elements", "ask Overpass for nodes, ways and relations"),
    "diff": ("a patch", _ELSEWHERE),
}
"""Root elements of XML that is no map → description, advice."""


def read_xml(source: MapFile, collector: MapCollector) -> None:
    """Fill the collector. Raises `UsageError` for a file that is no XML, no map, incomplete or not on Earth."""
    handler = _Handler(source, collector)
    parser = expat.ParserCreate()
    parser.buffer_text = True
    parser.StartElementHandler = handler.start
    parser.EndElementHandler = handler.end
    parser.CharacterDataHandler = handler.text
    parser.EntityDeclHandler = handler.refuse_entity
    fed = 0
    try:
        for chunk in source.chunks():
            parser.Parse(chunk, False)
            fed += len(chunk)
            if fed - parser.CurrentByteIndex > LONGEST_TOKEN:
                raise UsageError(
                    f"`{source.path}`: line {parser.CurrentLineNumber} begins an element of more than "
                    f"{LONGEST_TOKEN >> 20} MB",
                    hint="no map needs that: download it again, or take the element out",
                )
        parser.Parse(b"", True)
    except (expat.ExpatError, LookupError, ValueError) as error:  # the last two: unknown encodings
        raise _broken(source, error, handler.has_root) from None
    handler.check()


# -- private


def _broken(source: MapFile, error: Exception, has_root: bool) -> UsageError:
    code = getattr(error, "code", 0)
    if has_root and code in (expat.errors.codes[expat.errors.XML_ERROR_NO_ELEMENTS], _UNCLOSED):
        line = getattr(error, "lineno", 0)
        return UsageError(
            f"`{source.path}` is not OpenStreetMap data to its end: it stops in the middle, in line {line}",
            hint="the download was cut off: download the map again",
        )
    return UsageError(f"`{source.path}` is not OpenStreetMap data: XML error: {error}", hint=HINT)


_UNCLOSED = expat.errors.codes[expat.errors.XML_ERROR_UNCLOSED_TOKEN]


class _Handler:
    """Callbacks for expat. At most one item (node, way or relation) is open; elements outside of items belong to the
    file.
    """

    def __init__(self, source: MapFile, collector: MapCollector) -> None:
        self.has_root = False
        self._source = source
        self._collector = collector
        self._kind = ""
        self._attributes: _Attributes = {}
        self._tags: dict[str, str] = {}
        self._nodes: list[int | LatLon | None] = []
        self._members: list[Member] = []
        self._line: list[LatLon | None] | None = None
        self._remark: list[str] | None = None
        self._remarks: list[str] = []
        self._wrong = ""
        """The first fault of the file. It is reported at the end, when the file is known to be a map."""
        self._starts: dict[str, Callable[[_Attributes], None]] = {
            "tag": self._start_tag, "nd": self._start_nd, "member": self._start_member, "bounds": self._start_bounds,
            "bound": self._start_bound, "remark": self._start_remark, "action": self._start_action,
            "create": self._start_change, "modify": self._start_change, "delete": self._start_change,
        }  # fmt: skip

    def start(self, name: str, attributes: _Attributes) -> None:
        if name in _KINDS:
            self._open(name, attributes)
        elif not self.has_root:
            self._check_root(name)
        else:
            starter = self._starts.get(name)
            if starter is not None:
                starter(attributes)

    def end(self, name: str) -> None:
        if name == self._kind:
            self._close()
        elif name == "member":
            self._end_member()
        elif name == "remark" and self._remark is not None:
            self._remarks.append(_BUDGET.sub("", " ".join("".join(self._remark).split())))
            self._remark = None

    def text(self, text: str) -> None:
        if self._remark is not None and len(self._remark) < 64:
            self._remark.append(text[:1000])

    def refuse_entity(self, *_: object) -> None:
        raise UsageError(
            f"`{self._source.path}` is no map: it declares entities of its own, which maps never do", hint=HINT
        )

    def check(self) -> None:
        """Raise `UsageError` for faults that are known only at the end of the file."""
        cut = next((text for text in self._remarks if _CUT.search(text)), "")
        if cut:
            raise UsageError(
                f"`{self._source.path}` is incomplete: Overpass stopped before its end: {cut[:200]}",
                hint="ask for a smaller part, or with a longer [timeout:…] and more [maxsize:…], and download again",
            )
        self._collector.notes += [f"the map's server remarks: {text[:200]}" for text in self._remarks if text]
        if self._wrong and not self._collector.is_lanelet():
            raise UsageError(f"`{self._source.path}` is not OpenStreetMap data: {self._wrong}", hint=HINT)

    # -- items

    def _check_root(self, name: str) -> None:
        self.has_root = True
        local = name.rpartition(":")[2]
        if local == "osm":
            return
        kind, hint = _ROOTS.get(local, (f"XML that begins with <{local[:40]}>", HINT))
        raise UsageError(f"`{self._source.path}` is not OpenStreetMap data: it is {kind}", hint=hint)

    def _open(self, name: str, attributes: _Attributes) -> None:
        if not self.has_root:
            self._check_root(name)
        self._kind, self._attributes = name, attributes
        self._tags, self._nodes, self._members, self._line = {}, [], [], None

    def _close(self) -> None:
        kind, attributes = self._kind, self._attributes
        self._kind = ""
        ref = _id(attributes.get("id", ""))
        if ref is None:
            self._collector.skipped["objects without a number"] += 1
            return
        deleted = attributes.get("action") == "delete" or attributes.get("visible") == "false"
        version = _version(attributes.get("version"))
        if kind == "node":
            self._collector.add_node(
                ref, None if deleted else self._place(attributes), self._tags, version, deleted=deleted
            )
        elif kind == "way":
            self._collector.add_way(ref, self._nodes, self._tags, version, deleted=deleted)
        else:
            self._collector.add_relation(ref, self._members, self._tags, version, deleted=deleted)

    def _start_tag(self, attributes: _Attributes) -> None:
        key, value = attributes.get("k", ""), attributes.get("v", "")
        if len(key) > LONGEST_TEXT or len(value) > LONGEST_TEXT:
            self._collector.skipped[f"tags longer than {LONGEST_TEXT} characters"] += 1
        elif self._kind and key:
            self._tags[key] = value

    def _start_nd(self, attributes: _Attributes) -> None:
        if self._line is not None:
            self._line.append(self._place(attributes))
        elif self._kind == "way":
            ref = _id(attributes.get("ref", ""))
            if ref is None:
                self._nodes.append(self._place(attributes))
            else:
                self._nodes.append(ref)
                if len(attributes) > 1:
                    self._draw_node(ref, attributes)

    def _start_member(self, attributes: _Attributes) -> None:
        ref, kind = _id(attributes.get("ref", "")), _KINDS.get(attributes.get("type", ""))
        if self._kind != "relation" or ref is None or kind is None:
            return
        self._members.append((kind, ref, attributes.get("role", "")[:LONGEST_TEXT]))
        self._line = []
        if kind == "n":
            self._draw_node(ref, attributes)

    def _end_member(self) -> None:
        if self._line and self._members and self._members[-1][0] == "w" and any(self._line):
            self._collector.draw_way(self._members[-1][1], self._line)
        self._line = None

    def _draw_node(self, ref: int, attributes: _Attributes) -> None:
        place = self._place(attributes)
        if place is not None:
            self._collector.draw_node(ref, place)

    # -- the file's own

    def _start_bounds(self, attributes: _Attributes) -> None:
        """Store the area that the file covers, from `<bounds>`. Inside an item the element is Overpass's statement
        about that item, and is ignored.
        """
        if not self._kind:
            self._add_box([attributes.get(key, "") for key in ("minlon", "minlat", "maxlon", "maxlat")])

    def _start_bound(self, attributes: _Attributes) -> None:
        """Store the area that the file covers, from Osmosis's `<bound>`: south, west, north, east."""
        sides = attributes.get("box", "").split(",")
        if not self._kind and len(sides) == 4:
            self._add_box([sides[1], sides[0], sides[3], sides[2]])

    def _add_box(self, sides: list[str]) -> None:
        values = [_degrees(side) for side in sides]
        box: DegreeBox = (values[0], values[1], values[2], values[3])
        if _is_on_earth(box[1], box[0]) and _is_on_earth(box[3], box[2]):
            self._collector.add_box(box)
        else:
            self._collector.notes.append("the file states a part that is not on Earth, which is not used")

    def _start_remark(self, attributes: _Attributes) -> None:
        if not self._kind:
            self._remark = []

    def _start_action(self, attributes: _Attributes) -> None:
        raise self._foreign("osmAugmentedDiff")

    def _start_change(self, attributes: _Attributes) -> None:
        raise self._foreign("osmChange")

    def _foreign(self, root: str) -> UsageError:
        kind, hint = _ROOTS[root]
        return UsageError(f"`{self._source.path}` is not OpenStreetMap data: it is {kind}", hint=hint)

    def _place(self, attributes: _Attributes) -> LatLon | None:
        """The place that attributes state; None if they state none."""
        latitude, longitude = attributes.get("lat"), attributes.get("lon")
        if latitude is None or longitude is None:
            return None
        try:
            place = round(float(latitude), 7), round(float(longitude), 7)
        except (ValueError, OverflowError):
            place = inf, inf
        if not -90.0 <= place[0] <= 90.0 or not -180.0 <= place[1] <= 180.0:
            self._wrong = self._wrong or f"a place at lat `{latitude[:40]}`, lon `{longitude[:40]}` is not on Earth"
            return None
        return place


def _id(text: str) -> int | None:
    try:
        ref = int(text)
    except ValueError:
        return None
    return ref if -LARGEST_ID <= ref <= LARGEST_ID else None


def _version(text: str | None) -> int:
    """The version as a number; 0 without one, so that the order in the file decides."""
    return 0 if text is None else max(0, _id(text) or 0)


def _degrees(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return inf


def _is_on_earth(latitude: float, longitude: float) -> bool:
    return abs(latitude) <= 90.0 and abs(longitude) <= 180.0
