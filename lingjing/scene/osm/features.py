"""What a map holds as shapes in metres: closed ways and multipolygons as polygons, other ways as lines.

Shapes are shapely's. Only what touches the frame is kept; what has tags of interest and no usable geometry (missing
nodes, multipolygons whose rings do not close) is left out and counted in `Features.skipped`.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from itertools import chain, compress, groupby
from typing import Any

from lingjing.mission.frames import from_geodetic
from lingjing.scene.osm.frame import MapFrame
from lingjing.scene.osm.map_data import MapData, MapRelation, Way

AREA_KEYS = (
    "building", "building:part", "landuse", "natural", "leisure", "amenity", "waterway", "man_made", "place",
    "aeroway", "tourism",
)  # fmt: skip
"""A closed way with one of these is an area; one with `highway` is only with `area=yes`."""

LINE_KEYS = ("highway", "waterway", "barrier", "natural", "man_made", "railway")
LINEAR = {"tree_row", "coastline", "cliff", "embankment", "pipeline"}
"""Values of `natural` and `man_made` that stay lines even where they close."""

AROUND_M = 500.0
"""Areas this far outside of the frame are kept apart: they show what a building at its edge stands among."""


@dataclass(frozen=True, slots=True)
class Feature:
    """One object of the map. `ref` is `w` or `r` or `n` and its id; `shape` a shapely geometry in metres."""

    ref: str
    tags: dict[str, str]
    shape: Any


@dataclass(frozen=True, slots=True)
class Features:
    """The objects of a map in its frame, each kind in the order of ids (ways before relations).

    `outside` are the areas within `AROUND_M` of the frame that do not touch it; `places` the points with a `place`,
    wherever the map has them; `has_metro` is true for a map with an underground railway anywhere.
    """

    frame: MapFrame
    areas: tuple[Feature, ...]
    lines: tuple[Feature, ...]
    spots: tuple[Feature, ...]
    entrances: dict[tuple[float, float], str]
    outside: tuple[Feature, ...] = ()
    places: tuple[Feature, ...] = ()
    has_metro: bool = False
    skipped: Counter[str] = field(default_factory=Counter)

    @property
    def box(self) -> Any:
        """The frame's rectangle as a shapely polygon."""
        import shapely

        return shapely.box(*self.frame.bounds)

    def pieces(self, line: Feature) -> Iterator[Any]:
        """The pieces of a line inside the frame, as shapely has them."""
        import shapely

        for part in shapely.get_parts(shapely.intersection(line.shape, self.box)):
            if part.geom_type == "LineString" and part.length > 0.5:
                yield part


def collect(data: MapData, frame: MapFrame) -> Features:
    """The features of a map."""
    import shapely

    shaper = _Shaper(data, frame)
    areas = [*shaper.closed(), *shaper.multipolygons()]
    lines = [line for line in shaper.open() if shaper.is_inside(line.shape)]
    west, south, east, north = frame.bounds
    spots, places, entrances = [], [], {}
    for spot in data.spots:
        x, y = shaper.point(spot.id)
        if "place" in spot.tags:
            places.append(Feature(f"n{spot.id}", spot.tags, shapely.Point(x, y)))
        if west <= x <= east and south <= y <= north:
            spots.append(Feature(f"n{spot.id}", spot.tags, shapely.Point(x, y)))
            if spot.tags.get("entrance", "no") != "no":
                entrances[x, y] = spot.tags["entrance"]
    inside = [shaper.is_inside(area.shape) for area in areas]
    return Features(
        frame,
        tuple(compress(areas, inside)),
        tuple(lines),
        tuple(spots),
        entrances,
        tuple(area for area, within in zip(areas, inside, strict=True) if not within),
        tuple(places),
        any(_is_metro(tags) for tags in chain((s.tags for s in data.spots), (w.tags for w in data.ways))),
        shaper.skipped,
    )


def is_area(way: Way) -> bool:
    """Whether a way's tags say that it encloses something."""
    tags = way.tags
    if len(way.nodes) < 4 or way.nodes[0] != way.nodes[-1] or tags.get("area") == "no":
        return False
    if tags.get("area") == "yes":
        return True
    if "barrier" in tags and "landuse" not in tags and "building" not in tags:
        return False
    return any(key in tags and tags[key] not in LINEAR for key in AREA_KEYS if key != "waterway") or tags.get(
        "waterway"
    ) in ("riverbank", "dock", "basin")


# -- private


def _is_metro(tags: dict[str, str]) -> bool:
    return "subway" in (tags.get("railway"), tags.get("station")) or tags.get("subway") == "yes"


class _Shaper:
    """Turns ways and relations into shapes; knows each node's place once it has been asked for."""

    def __init__(self, data: MapData, frame: MapFrame) -> None:
        import shapely

        self._data, self._origin = data, frame.origin
        self._ways = {way.id: way for way in data.ways}
        self._points: dict[int, tuple[float, float]] = {}
        self._box = shapely.box(*frame.bounds)
        self._surroundings = self._box.buffer(AROUND_M, join_style="mitre")
        self.skipped: Counter[str] = Counter()
        self._gapped: set[int] = set()

    def point(self, ref: int) -> tuple[float, float]:
        """A node's place in metres; `KeyError` if the map lacks it."""
        if ref not in self._points:
            x, y = from_geodetic(*self._data.nodes[ref], self._origin)
            self._points[ref] = (round(x, 3), round(y, 3))
        return self._points[ref]

    def is_inside(self, shape: Any) -> bool:
        """True for a shape that touches the frame."""
        return bool(shape.intersects(self._box))

    def closed(self) -> Iterator[Feature]:
        for way in self._data.ways:
            if is_area(way):
                yield from self._count_gaps((way,), self._kept(f"w{way.id}", way.tags, self._polygon(way)))
            elif _claims_area(way):
                self.skipped["areas that do not close"] += 1

    def open(self) -> Iterator[Feature]:
        for way in self._data.ways:
            if not is_area(way) and any(key in way.tags for key in LINE_KEYS):
                yield from self._count_gaps((way,), self._kept(f"w{way.id}", way.tags, self._lines(way)))

    def multipolygons(self) -> Iterator[Feature]:
        for relation in self._data.relations:
            if relation.tags["type"] == "multipolygon" and any(key in relation.tags for key in (*AREA_KEYS, "highway")):
                shape = self._assembled(relation)
                if shape is None:
                    self.skipped["multipolygons that do not close"] += 1
                else:
                    members = [
                        self._ways[ref] for kind, ref, _ in relation.members if kind == "w" and ref in self._ways
                    ]
                    yield from self._count_gaps(members, self._kept(f"r{relation.id}", relation.tags, shape))

    def _kept(self, ref: str, tags: dict[str, str], shape: Any) -> Iterator[Feature]:
        if shape is None or shape.is_empty:
            self.skipped["ways without enough nodes"] += 1
        elif shape.intersects(self._surroundings):
            yield Feature(ref, tags, shape)

    def _count_gaps(self, ways: Iterable[Way], kept: Iterable[Feature]) -> Iterator[Feature]:
        """What is kept as it is; counts the nodes in the frame that ways name and the map lacks, each way's once."""
        for feature in kept:
            for way in ways if self.is_inside(feature.shape) else ():
                lost = sum(ref not in self._data.nodes for ref in way.nodes)
                if lost and way.id not in self._gapped:
                    self._gapped.add(way.id)
                    self.skipped["references to missing nodes"] += lost
            yield feature

    def _line(self, way: Way) -> Any:
        """The way through the nodes that the map has, across gaps; None with fewer than two."""
        import shapely

        kept = self._points_of(ref for ref in way.nodes if ref in self._data.nodes)
        return shapely.LineString(kept) if len(kept) > 1 else None

    def _lines(self, way: Way) -> Any:
        """The way in pieces, apart where the map lacks nodes (extracts cut at a box leave such ends)."""
        import shapely

        runs = [self._points_of(run) for known, run in groupby(way.nodes, self._data.nodes.__contains__) if known]
        pieces = [shapely.LineString(run) for run in runs if len(run) > 1]
        return pieces[0] if len(pieces) == 1 else shapely.MultiLineString(pieces)

    def _points_of(self, refs: Iterable[int]) -> list[tuple[float, float]]:
        points = [self.point(ref) for ref in refs]
        return [point for k, point in enumerate(points) if k == 0 or point != points[k - 1]]

    def _polygon(self, way: Way) -> Any:
        import shapely

        line = self._line(way)
        if line is None or len(line.coords) < 3:
            return None
        return sound(shapely.Polygon(line.coords))

    def _assembled(self, relation: MapRelation) -> Any:
        """Rings of the outer ways less rings of the inner ones; None if the outer ways leave no ring."""
        import shapely

        outer = self._rings(relation, inner=False)
        if outer is None or outer.is_empty:
            return None
        inner = self._rings(relation, inner=True)
        if inner is None or inner.is_empty:
            return sound(outer)
        if inner.contains(outer):  # the roles are swapped
            outer, inner = inner, outer
        return sound(shapely.difference(outer, inner))

    def _rings(self, relation: MapRelation, *, inner: bool) -> Any:
        import shapely

        named = (ref for kind, ref, role in relation.members if kind == "w" and (role == "inner") is inner)
        refs = list(dict.fromkeys(named))  # a member named twice is one
        lines = [self._line(self._ways[ref]) for ref in refs if ref in self._ways]
        found = [line for line in lines if line is not None]
        if not found or (not inner and len(found) < len(refs) and not all(line.is_ring for line in found)):
            return None
        if len(found) < len(refs):
            self.skipped["multipolygons with members missing"] += 1
        rings, *rest = shapely.polygonize_full(found)
        if not inner and not rings.is_empty and any(not part.is_empty for part in rest[:2]):
            self.skipped["multipolygons with loose ends"] += 1
        return shapely.union_all([sound(ring) for ring in shapely.get_parts(rings)])


def _claims_area(way: Way) -> bool:
    return "building" in way.tags or "building:part" in way.tags or "landuse" in way.tags


def sound(shape: Any) -> Any:
    """The polygons of a shape, repaired where it crosses itself."""
    import shapely

    return shape if shape.is_valid else shapely.make_valid(shape, method="structure", keep_collapsed=False)
