"""The street grid of a district: lines through the origin, nodes and edges of its network, and the blocks between.

Streets run along every multiple of the spacing. Every second one is a main street with two lanes each way, and traffic
lights where two of them cross; the others have one lane each way. A site (`DistrictPlan.site`) has no public streets:
they end in front of its gates, or at the crossing before it. Streets that `blocked` rejects, as on water, are left out.
If no street remains, a road runs around the site, or around the whole square.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

from lingjing.mission.geometry2d import Vector2
from lingjing.scene.districts.rectangles import Rect
from lingjing.scene.network import LANE_WIDTH_M, StreetEdge, StreetNode

APRON_M = 12.0
"""Distance that streets keep from a site's edge, metres (chosen)."""

RING_M = APRON_M / 2.0
"""Distance of the axis of a ring road from a site's edge, metres: on the apron between site and blocks."""

BLOCK_LEAST_M = 25.0
"""Least width and depth of a block, metres (chosen)."""

Blocked = Callable[[Vector2, Vector2], bool]
"""Predicate over the two ends of a section: True if no street may be built there."""


@dataclass(frozen=True, slots=True)
class StreetLine:
    """A street along the whole grid."""

    at_m: float
    """Position of its axis, metres: east for an avenue, north for a street."""
    lanes: int
    """Lanes in each direction."""
    name: str

    @property
    def half_m(self) -> float:
        """Distance from the axis to the kerb, metres."""
        return self.lanes * LANE_WIDTH_M + 0.2

    @property
    def main(self) -> bool:
        """True for a main street."""
        return self.lanes >= 2


@dataclass(frozen=True, slots=True)
class CityBlock:
    """The ground between kerbs."""

    column: int
    """Column of its cell of the grid, counted from the west."""
    row: int
    """Row of its cell of the grid, counted from the south."""
    box: Rect


@dataclass(frozen=True, slots=True)
class StreetGrid:
    """The lines of a street grid."""

    avenues: tuple[StreetLine, ...]
    """Streets that run north; `at_m` is their east."""
    streets: tuple[StreetLine, ...]
    """Streets that run east; `at_m` is their north."""
    half_m: float
    """Distance from the origin to the edge of the square, metres."""


def grid(half_m: float, spacing: tuple[float, float], lanes: tuple[int, int] = (2, 1)) -> StreetGrid:
    """The lines of a square that extends `half_m` from the origin.

    `lanes`: lanes each way of main streets and of other streets, which alternate.
    """
    return StreetGrid(
        avenues=_lines(half_m, spacing[0], lanes, ("Avenue", "E", "W")),
        streets=_lines(half_m, spacing[1], lanes, ("Street", "N", "S")),
        half_m=half_m,
    )


def _lines(
    half_m: float, spacing: float, lanes: tuple[int, int], words: tuple[str, str, str]
) -> tuple[StreetLine, ...]:
    many = int(half_m / spacing + 1e-6)
    word, plus, minus = words
    return tuple(
        StreetLine(
            at_m=k * spacing,
            lanes=lanes[k % 2],
            name=f"{word} {plus if k > 0 else minus}{abs(k)}" if k else f"Central {word}",
        )
        for k in range(-many, many + 1)
    )


def blocks(made: StreetGrid, keep_out: Sequence[Rect] = ()) -> Iterator[CityBlock]:
    """Yield the blocks row by row from the south-west, including those at the rim of the square, without `keep_out`."""
    columns, rows = _gaps(made.avenues, made.half_m), _gaps(made.streets, made.half_m)
    for row, (south, north) in enumerate(rows):
        for column, (west, east) in enumerate(columns):
            parts: tuple[Rect, ...] = (Rect(west, south, east, north),)
            for box in keep_out:
                parts = tuple(left for part in parts for left in part.without(box, BLOCK_LEAST_M))
            for part in parts:
                if part.width >= BLOCK_LEAST_M and part.depth >= BLOCK_LEAST_M:
                    yield CityBlock(column, row, part)


def _gaps(lines: tuple[StreetLine, ...], half_m: float) -> tuple[tuple[float, float], ...]:
    inner = [(low.at_m + low.half_m, high.at_m - high.half_m) for low, high in pairwise(lines)]
    first, last = lines[0], lines[-1]
    return ((-half_m, first.at_m - first.half_m), *inner, (last.at_m + last.half_m, half_m))


def network(
    made: StreetGrid, site: Rect | None = None, gates: Sequence[Vector2] = (), blocked: Blocked | None = None
) -> tuple[list[StreetNode], list[StreetEdge]]:
    """Nodes and edges of the grid's network; none if `blocked` rejects even a ring road."""
    closed = None if site is None else site.inset(-APRON_M)
    sections = [
        (start, end, line)
        for start, end, line in _sections(made)
        if blocked is None or not blocked(start[1], end[1])
    ]  # fmt: skip
    kept = [item for item in sections if closed is None or not _enters(item[0][1], item[1][1], closed)]
    stubs = [] if closed is None else list(_stubs(sections, closed, gates))
    if not kept and not stubs:
        square = Rect(-made.half_m, -made.half_m, made.half_m, made.half_m)
        rings = ([item for item in _ring(box) if blocked is None or not blocked(item[0][1], item[1][1])]
                 for box in (site, square) if box is not None)  # fmt: skip
        kept = next((ring for ring in rings if ring), [])
    edges = [edge for section in (*kept, *stubs) for edge in _edges(*section)]
    degree: dict[str, int] = {}
    for edge in edges:
        degree[edge.start] = degree.get(edge.start, 0) + 1
    places = {name: point for start, end, _ in (*kept, *stubs) for name, point in (start, end)}
    mains = _crossings_of_mains(made)
    return [_node(name, places[name], mains, degree[name]) for name in sorted(places)], edges


# -- private

_End = tuple[str, Vector2]
_Section = tuple[_End, _End, StreetLine]


def _node_id(column: int, row: int) -> str:
    return f"n{column}_{row}"


def _sections(made: StreetGrid) -> Iterator[_Section]:
    for i, avenue in enumerate(made.avenues):
        for j, (south, north) in enumerate(pairwise(made.streets)):
            start, end = (avenue.at_m, south.at_m), (avenue.at_m, north.at_m)
            yield (_node_id(i, j), start), (_node_id(i, j + 1), end), avenue
    for j, street in enumerate(made.streets):
        for i, (west, east) in enumerate(pairwise(made.avenues)):
            start, end = (west.at_m, street.at_m), (east.at_m, street.at_m)
            yield (_node_id(i, j), start), (_node_id(i + 1, j), end), street


def _ring(inner: Rect) -> Iterator[_Section]:
    """Yield the four sides of a road around a box, half an apron away from it."""
    box = inner.inset(-RING_M)
    corners = (("sw", box.west, box.south), ("se", box.east, box.south), ("ne", box.east, box.north),
               ("nw", box.west, box.north))  # fmt: skip
    nodes = [(f"ring_{name}", (x, y)) for name, x, y in corners]
    for start, end in zip(nodes, (*nodes[1:], nodes[0]), strict=True):
        yield start, end, StreetLine(at_m=0.0, lanes=1, name="Ring Road")


def _enters(start: Vector2, end: Vector2, box: Rect) -> bool:
    """True if an axis-parallel section enters the interior of the box."""
    west, east = sorted((start[0], end[0]))
    south, north = sorted((start[1], end[1]))
    return west < box.east and east > box.west and south < box.north and north > box.south


def _stubs(sections: Sequence[_Section], closed: Rect, gates: Sequence[Vector2]) -> Iterator[_Section]:
    """Yield the remaining part of each section that runs straight at a gate; it ends in front of the gate."""
    for start, end, line in sections:
        for outer, inner, forward in ((start, end, True), (end, start, False)):
            if not _enters(outer[1], inner[1], closed) or closed.holds(*outer[1]):
                continue
            (x, y), (to_x, to_y) = outer[1], inner[1]
            if y == to_y:
                stop = (closed.west if to_x > x else closed.east, y)
            else:
                stop = (x, closed.south if to_y > y else closed.north)
            near = any(abs(stop[0] - gx) + abs(stop[1] - gy) <= 3.0 * APRON_M for gx, gy in gates)
            if near and abs(stop[0] - x) + abs(stop[1] - y) >= 25.0:
                last = (f"{outer[0]}-gate-{'in' if forward else 'out'}-{'x' if y == to_y else 'y'}", stop)
                yield (outer, last, line) if forward else (last, outer, line)


def _edges(start: _End, end: _End, line: StreetLine) -> Iterator[StreetEdge]:
    for tail, head in ((start, end), (end, start)):
        yield StreetEdge(
            id=f"{tail[0]}_to_{head[0]}",
            start=tail[0],
            end=head[0],
            lanes=line.lanes,
            speed_mps=13.9 if line.main else 11.1,
            kind="primary" if line.lanes > 2 else "secondary" if line.main else "residential",
            priority=3 if line.lanes > 2 else 2 if line.main else 1,
            name=line.name,
        )


def _crossings_of_mains(made: StreetGrid) -> frozenset[str]:
    return frozenset(
        _node_id(i, j)
        for i, avenue in enumerate(made.avenues)
        for j, street in enumerate(made.streets)
        if avenue.main and street.main
    )


def _node(name: str, place: Vector2, mains: frozenset[str], degree: int) -> StreetNode:
    control = "traffic_light" if name in mains and degree >= 3 else "priority"
    return StreetNode(id=name, east=place[0], north=place[1], control=control)
