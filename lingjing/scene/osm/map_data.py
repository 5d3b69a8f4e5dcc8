"""The normalised content of a map: each object once, in its current state, without metadata.

Readers of all formats fill a `MapCollector`, which alone makes a `MapData`. Everything that is built from a map is
built from its `MapData`. The collector resolves what files leave open:

- If an object occurs several times (history files, merged extracts), the highest version counts; of equal versions the
  later. If that one is deleted (`visible="false"`, JOSM's `action="delete"`), the object is removed.
- Several stated parts of the Earth become their bounding box.
- Geometry inside ways and relations (Overpass `out geom`) becomes nodes and ways.
- Negative ids (objects that were never uploaded) become positive, because netconvert marks the other direction of a way
  with `-`.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import TypeVar

DegreeBox = tuple[float, float, float, float]
"""West, south, east, north in degrees."""

LatLon = tuple[float, float]
"""Latitude, longitude in degrees."""

Member = tuple[str, int, str]
"""Kind (`n`, `w` or `r`), id and role of a relation's member."""

LONGEST_TEXT = 1024
"""Most characters of a tag's key or value (chosen: OpenStreetMap's database permits 255, libosmium 1024 bytes)."""

LARGEST_ID = (1 << 62) - 1
"""Largest id that is read: larger ones would exceed 64 bits after their sign is changed."""

LANELET_TYPES = frozenset(
    (
        "lanelet", "regulatory_element", "line_thin", "line_thick", "curbstone", "road_border", "stop_line",
        "pedestrian_marking", "bike_marking",
    )
)  # fmt: skip
"""Values of `type` of the relations and ways in Lanelet2 maps."""


@dataclass(frozen=True, slots=True)
class MapSpot:
    """A node with tags. Latitude and longitude in degrees."""

    id: int
    tags: dict[str, str]
    latitude: float
    longitude: float


@dataclass(frozen=True, slots=True)
class Way:
    """A line through nodes. It is closed if its first node is its last."""

    id: int
    tags: dict[str, str]
    nodes: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class MapRelation:
    """A multipolygon or a turn restriction."""

    id: int
    tags: dict[str, str]
    members: tuple[Member, ...]


@dataclass(frozen=True, slots=True)
class MapData:
    """A normalised map. Objects of each kind are in the order of ids."""

    nodes: dict[int, LatLon]
    """Place of each node by id."""
    spots: tuple[MapSpot, ...]
    """Nodes with tags."""
    ways: tuple[Way, ...]
    relations: tuple[MapRelation, ...]
    box: DegreeBox | None
    """Part of the Earth that the file states; None if it states none."""
    skipped: Counter[str] = field(default_factory=Counter)
    """Number of objects left out, by reason."""
    notes: tuple[str, ...] = ()
    """Remarks of the file that are shown to the user."""


ItemT = TypeVar("ItemT", MapSpot, Way, MapRelation)


class MapCollector:
    """Collects the objects of a file, in any order, and normalises them.

    `version`: the object's version, 0 if the file has none. `deleted`: True if the file marks the object as deleted.
    """

    def __init__(self) -> None:
        self.box: DegreeBox | None = None
        self.notes: list[str] = []
        self.skipped: Counter[str] = Counter()
        self._has_lanelets = False
        self._nodes: dict[int, LatLon] = {}
        self._spots: dict[int, MapSpot] = {}
        self._ways: dict[int, Way] = {}
        self._relations: dict[int, MapRelation] = {}
        self._versions: tuple[dict[int, int], dict[int, int], dict[int, int]] = ({}, {}, {})
        self._drawn_places: dict[int, LatLon] = {}
        self._drawn_lines: dict[int, tuple[LatLon | None, ...]] = {}

    def add_box(self, box: DegreeBox) -> None:
        """Add a part of the Earth that the file states."""
        if self.box is None:
            self.box = box
        else:
            west, south, east, north = self.box
            self.box = min(west, box[0]), min(south, box[1]), max(east, box[2]), max(north, box[3])

    def add_node(self, ref: int, place: LatLon | None, tags: dict[str, str], version: int, *, deleted: bool) -> None:
        """Add a node. A node without a place is left out."""
        if not self._is_latest(0, ref, version):
            return
        self._spots.pop(ref, None)
        if deleted or place is None:
            self._nodes.pop(ref, None)
            return
        self._nodes[ref] = place
        if tags:
            self._spots[ref] = MapSpot(ref, tags, *place)

    def add_way(
        self, ref: int, nodes: Sequence[int | LatLon | None], tags: dict[str, str], version: int, *, deleted: bool
    ) -> None:
        """Add a way through nodes, given by ids, or by places in files without node ids. None marks a gap."""
        if not self._is_latest(1, ref, version):
            return
        self._ways.pop(ref, None)
        self._drawn_lines.pop(ref, None)
        if deleted:
            return
        self._has_lanelets = self._has_lanelets or tags.get("type") in LANELET_TYPES
        known = tuple(node for node in nodes if isinstance(node, int))
        if len(known) < len(nodes):
            self._drawn_lines[ref] = tuple(None if isinstance(node, int) else node for node in nodes)
        self._ways[ref] = Way(ref, tags, known)

    def add_relation(
        self, ref: int, members: Sequence[Member], tags: dict[str, str], version: int, *, deleted: bool
    ) -> None:
        """Add a relation. Only multipolygons and turn restrictions are kept."""
        if not self._is_latest(2, ref, version):
            return
        self._relations.pop(ref, None)
        kind = tags.get("type", "")
        if deleted:
            return
        if kind in LANELET_TYPES:
            self._has_lanelets = True
        elif kind in ("multipolygon", "restriction"):
            self._relations[ref] = MapRelation(ref, tags, tuple(members))

    def draw_node(self, ref: int, place: LatLon) -> None:
        """Add the place of a node that a way or a relation contains."""
        self._drawn_places.setdefault(ref, place)

    def draw_way(self, ref: int, line: Sequence[LatLon | None]) -> None:
        """Add the line of a way that a relation contains. None marks a gap."""
        self._drawn_lines.setdefault(ref, tuple(line))

    def finish(self) -> MapData:
        """Return the normalised map."""
        for ref, place in self._drawn_places.items():
            self._nodes.setdefault(ref, place)
        if self._drawn_lines:
            self._lay_lines()
        data = MapData(
            self._nodes, _by_id(self._spots), _by_id(self._ways), _by_id(self._relations), self.box, self.skipped,
            tuple(self.notes),
        )  # fmt: skip
        return _with_positive_ids(data)

    def is_lanelet(self) -> bool:
        """True if this is a Lanelet2 map: it has lanes, and no street or building."""
        built = any("highway" in way.tags or "building" in way.tags for way in self._ways.values())
        return self._has_lanelets and not built

    def places(self) -> Iterator[LatLon]:
        """Yield the places of the nodes."""
        return iter(self._nodes.values())

    # -- private

    def _is_latest(self, kind: int, ref: int, version: int) -> bool:
        """True if no higher version of the object was added before."""
        versions = self._versions[kind]
        if version < versions.get(ref, 0):
            return False
        if version:
            versions[ref] = version
        return True

    def _lay_lines(self) -> None:
        """Give nodes to ways that are known by places only: existing nodes at these places, else new ones."""
        by_place = {place: ref for ref, place in self._nodes.items()}
        fresh = _above((*self._nodes, *(ref for way in self._ways.values() for ref in way.nodes)))
        missing = fresh
        for ref, line in sorted(self._drawn_lines.items()):
            known = self._ways.get(ref)
            if known is not None and known.nodes:
                continue
            nodes = []
            for place in line:
                if place is not None and place not in by_place:
                    fresh += 1
                    by_place[place] = fresh
                    self._nodes[fresh] = place
                nodes.append(missing if place is None else by_place[place])
            self._ways[ref] = Way(ref, known.tags if known is not None else {}, tuple(nodes))


def _by_id(items: dict[int, ItemT]) -> tuple[ItemT, ...]:
    return tuple(items[ref] for ref in sorted(items))


def _above(refs: Sequence[int]) -> int:
    """A power of two above all ids. It is the same for most files, so that derived ids seldom change."""
    return 1 << max(40, max(map(abs, refs), default=0).bit_length())


def _with_positive_ids(data: MapData) -> MapData:
    ways, relations = [way.id for way in data.ways], [relation.id for relation in data.relations]
    named = [ref for way in data.ways for ref in way.nodes]
    lowest = min((*ways[:1], *relations[:1], *data.nodes, *named), default=0)
    if lowest >= 0:
        return data
    shifts = {"n": _above((*data.nodes, *named)), "w": _above(ways), "r": _above(relations)}

    def moved(kind: str, ref: int) -> int:
        return ref if ref >= 0 else shifts[kind] - ref

    return replace(
        data,
        nodes={moved("n", ref): place for ref, place in data.nodes.items()},
        spots=tuple(sorted((replace(spot, id=moved("n", spot.id)) for spot in data.spots), key=lambda item: item.id)),
        ways=tuple(
            sorted(
                (Way(moved("w", way.id), way.tags, tuple(moved("n", ref) for ref in way.nodes)) for way in data.ways),
                key=lambda item: item.id,
            )
        ),
        relations=tuple(
            sorted(
                (
                    MapRelation(
                        moved("r", relation.id), relation.tags,
                        tuple((kind, moved(kind, ref), role) for kind, ref, role in relation.members),
                    )
                    for relation in data.relations
                ),
                key=lambda item: item.id,
            )
        ),
    )  # fmt: skip
