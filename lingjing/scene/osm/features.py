"""The objects of a map as shapes in metres: closed ways and multipolygons as polygons, other ways as lines.

Shapes are shapely geometries. Only shapes that touch the frame are kept. Objects with relevant tags and no usable
geometry (missing nodes, multipolygons with open rings) are left out and counted in `Features.skipped`.
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
"""A closed way with one of these keys is an area. One with `highway` is an area only with `area=yes`."""

LINE_KEYS = ("highway", "waterway", "barrier", "natural", "man_made", "railway")
"""A way with one of these keys, if it is no area, is kept as a line."""
LINEAR = {"tree_row", "coastline", "cliff", "embankment", "pipeline"}
"""Values of `natural` and `man_made` that remain lines even if they close."""

AROUND_M = 500.0
"""Distance from the frame within which outer areas are kept apart, metres: they are the surroundings of buildings at
its edge."""


@dataclass(frozen=True, slots=True)
class Feature:
    """One object of the map."""

    ref: str
    """`w`, `r` or `n` (way, relation, node) and the id."""
    tags: dict[str, str]
    shape: Any
    """A shapely geometry in metres."""


@dataclass(frozen=True, slots=True)
class Features:
    """The objects of a map in its frame, each kind in the order of ids (ways before relations)."""

    frame: MapFrame
    areas: tuple[Feature, ...]
    """Polygons that touch the frame."""
    lines: tuple[Feature, ...]
    """Lines that touch the frame."""
    spots: tuple[Feature, ...]
    """Nodes with tags in the frame."""
    entrances: dict[tuple[float, float], str]
    """Value of `entrance` by place, metres."""
    outside: tuple[Feature, ...] = ()
    """Areas within `AROUND_M` of the frame that do not touch it."""
    places: tuple[Feature, ...] = ()
    """Points with a `place`, anywhere on the map."""
    has_metro: bool = False
    """True if the map has an underground railway anywhere."""
    skipped: Counter[str] = field(default_factory=Counter)
    """Number of objects without usable geometry, by reason."""

    @property
    def box(self) -> Any:
        """The frame's rectangle as a shapely polygon."""
        import shapely

        return shapely.box(*self.frame.bounds)

    def pieces(self, line: Feature) -> Iterator[Any]:
        """Yield the pieces of a line inside the frame as shapely lines."""
        import shapely

        for part in shapely.get_parts(shapely.intersection(line.shape, self.box)):
            if part.geom_type == "LineString" and part.length > 0.5:
                yield part


def collect(data: MapData, frame: MapFrame) -> Features:
    """Collect the features of a map."""
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
    """True if a way's tags mean that it encloses an area."""
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
    """Turns ways and relations into shapes. Places of nodes in metres are computed on demand and cached."""

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
        """Place of a node in metres. Raises `KeyError` if the map lacks it."""
        if ref not in self._points:
            x, y = from_geodetic(*self._data.nodes[ref], self._origin)
            self._points[ref] = (round(x, 3), round(y, 3))
        return self._points[ref]

    def is_inside(self, shape: Any) -> bool:
        """True if a shape touches the frame."""
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
        """Yield the features unchanged, and count the nodes in the frame that their ways name and the map lacks.

        The nodes of each way are counted once.
        """
        for feature in kept:
            for way in ways if self.is_inside(feature.shape) else ():
                lost = sum(ref not in self._data.nodes for ref in way.nodes)
                if lost and way.id not in self._gapped:
                    self._gapped.add(way.id)
                    self.skipped["references to missing nodes"] += lost
            yield feature

    def _line(self, way: Way) -> Any:
        """The way through the nodes that the map has, across gaps; None with fewer than two nodes."""
        import shapely

        kept = self._points_of(ref for ref in way.nodes if ref in self._data.nodes)
        return shapely.LineString(kept) if len(kept) > 1 else None

    def _lines(self, way: Way) -> Any:
        """The way in pieces, divided where the map lacks nodes, as in extracts that are cut at a box."""
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
        return repaired_polygons(shapely.Polygon(line.coords))

    def _assembled(self, relation: MapRelation) -> Any:
        """Polygons of the outer ways minus those of the inner ones; None if the outer ways give no ring."""
        import shapely

        outer = self._rings(relation, inner=False)
        if outer is None or outer.is_empty:
            return None
        inner = self._rings(relation, inner=True)
        if inner is None or inner.is_empty:
            return repaired_polygons(outer)
        if inner.contains(outer):  # the roles are swapped
            outer, inner = inner, outer
        return repaired_polygons(shapely.difference(outer, inner))

    def _rings(self, relation: MapRelation, *, inner: bool) -> Any:
        import shapely

        named = (ref for kind, ref, role in relation.members if kind == "w" and (role == "inner") is inner)
        refs = list(dict.fromkeys(named))  # a member that is listed twice counts once
        lines = [self._line(self._ways[ref]) for ref in refs if ref in self._ways]
        present = [line for line in lines if line is not None]
        if not present or (not inner and len(present) < len(refs) and not all(line.is_ring for line in present)):
            return None
        if len(present) < len(refs):
            self.skipped["multipolygons with members missing"] += 1
        rings, *rest = shapely.polygonize_full(present)
        if not inner and not rings.is_empty and any(not part.is_empty for part in rest[:2]):
            self.skipped["multipolygons with loose ends"] += 1
        return shapely.union_all([repaired_polygons(ring) for ring in shapely.get_parts(rings)])


def _claims_area(way: Way) -> bool:
    return "building" in way.tags or "building:part" in way.tags or "landuse" in way.tags


def repaired_polygons(shape: Any) -> Any:
    """The polygons of a shape, repaired if it intersects itself."""
    import shapely

    return shape if shape.is_valid else shapely.make_valid(shape, method="structure", keep_collapsed=False)
