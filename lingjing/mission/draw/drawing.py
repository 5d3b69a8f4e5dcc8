"""A placed picture: boxes, curves and labels in pixels, from the top left. What `svg` writes and tests measure."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise

from lingjing.mission.draw.cards import INSET, PORT, STACK, Card, Link, Picture, Row, arc_on_left, picture
from lingjing.mission.draw.lettering import width
from lingjing.mission.draw.placing import Columns, Pass, arrange, spread
from lingjing.mission.draw.styles import EDGES, LANES
from lingjing.mission.graph.types import MissionGraph

LABEL = 11.0
"""Font size of what stands beside an edge."""

MARGIN, BAND_HEAD, LINE = 28.0, 40.0, 14.0
"""Around everything; from a lane's top to its first card; from a label to the next."""

_GUTTER, _TIGHTEST = 78.0, 24.0


@dataclass(frozen=True, slots=True)
class Box:
    """One node's box. An `inner` box lies within the box of the node that its own is part of."""

    row: Row
    x: float
    y: float
    width: float
    height: float
    inner: bool


@dataclass(frozen=True, slots=True)
class Curve:
    """One edge's line: its start, then cubic Bézier pieces (two controls and an end), drawn along the edge."""

    link: Link
    start: tuple[float, float]
    pieces: tuple[tuple[tuple[float, float], tuple[float, float], tuple[float, float]], ...]

    @property
    def end(self) -> tuple[float, float]:
        """Where its arrow points."""
        return self.pieces[-1][2]


@dataclass(frozen=True, slots=True)
class Label:
    """Words beside a curve; `y` is the middle of the line, `anchor` as in SVG."""

    link: Link
    x: float
    y: float
    anchor: str


@dataclass(frozen=True, slots=True)
class Band:
    """A lane's background and heading."""

    title: str
    x: float
    width: float


@dataclass(frozen=True, slots=True)
class Drawing:
    """Everything placed; `height` is that of the bands."""

    width: float
    height: float
    bands: tuple[Band, ...]
    boxes: tuple[Box, ...]
    curves: tuple[Curve, ...]
    labels: tuple[Label, ...]


def draw(graph: MissionGraph) -> Drawing:
    """Place a graph's nodes and edges. The same graph gives the same drawing."""
    shown = picture(graph)
    columns = arrange(shown)
    left = _lefts(shown)
    boxes = tuple(
        box
        for lane, cards in enumerate(shown.lanes)
        for card in cards
        for box in _boxes(card, left[lane], shown.widths[lane])
    )
    router = _Router(shown, columns, left, {id(box.row): box for box in boxes})
    curves = tuple(router.curve(link) for link in shown.links)
    bottom = max((box.y + box.height for box in boxes), default=BAND_HEAD)
    lowest = max((y for curve in curves for y in _reach(curve)), default=0.0)
    return Drawing(
        width=left[-1] + MARGIN,
        height=max(bottom, lowest) + MARGIN,
        bands=tuple(
            Band(title, left[lane] - 12, shown.widths[lane] + 24)
            for lane, (title, _) in enumerate(LANES)
            if shown.lanes[lane]
        ),
        boxes=boxes,
        curves=curves,
        labels=tuple(_labels(curves)),
    )


# -- private


def _lefts(shown: Picture) -> list[float]:
    """The left edge of each lane, and at last the right edge of all of them."""
    used = [lane for lane, cards in enumerate(shown.lanes) if cards]
    left = [0.0] * (len(shown.lanes) + 1)
    x = MARGIN
    for lane in range(len(shown.lanes)):
        if lane in used:
            x += _arc_room(shown, lane, on_left=True)
            left[lane] = x
            x += shown.widths[lane] + _arc_room(shown, lane, on_left=False)
            if lane != used[-1]:
                x += _gutter(shown, lane)
        else:
            left[lane] = x
    left[-1] = x
    return left


def _gutter(shown: Picture, lane: int) -> float:
    """Room between a lane and the next: more where more links run, and for the words beside them."""
    running = [link for link in shown.links if link.start <= lane < link.end]
    said = [width(link.words, LABEL) for link in running if link.start == lane and link.words]
    return max(_GUTTER + min(70.0, 2.5 * len(running)), max(said, default=0.0) + 2 * _TIGHTEST)


def _arc_room(shown: Picture, lane: int, *, on_left: bool) -> float:
    if arc_on_left(lane) != on_left:
        return 0.0
    arcs = [link for link in shown.links if link.within_lane and link.start == lane]
    if not arcs:
        return 0.0
    return 62.0 + max((width(part, LABEL) for link in arcs for part in label_lines(link)), default=0.0)


def label_lines(link: Link) -> tuple[str, ...]:
    """A label in one line, or where it names a relation in two: the relation, then what it is about."""
    style = EDGES[link.edge.kind]
    if not style.relation or link.words == style.words:
        return (link.words,) if link.words else ()
    return (style.words, link.words.removeprefix(style.words).strip())


def _boxes(card: Card, left: float, card_width: float) -> Iterable[Box]:
    for place, row in enumerate(card.rows):
        top = BAND_HEAD + card.top + row.top
        if place == 0:
            yield Box(row, left, top, card_width, card.height, inner=False)
        else:
            spare = STACK if row.stacked else 0.0
            yield Box(row, left + INSET, top, card_width - 2 * INSET - spare, row.height, inner=True)


class _Router:
    """Fastens links to rows and leads them through their passes."""

    def __init__(self, shown: Picture, columns: Columns, left: list[float], boxes: dict[int, Box]) -> None:
        self._columns = columns
        self._left = left
        self._widths = shown.widths
        self._boxes = boxes
        self._ports: dict[tuple[int, str], tuple[float, float]] = {}
        for lane in shown.lanes:
            for card in lane:
                for row in card.rows:
                    self._fasten(row, row.left, on_left=True)
                    self._fasten(row, row.right, on_left=False)

    def curve(self, link: Link) -> Curve:
        """The link's line, in the direction of its edge."""
        near, far = self._ports[id(link), "near"], self._ports[id(link), "far"]
        if link.within_lane:
            points = self._arc(near, far, -1.0 if arc_on_left(link.start) else 1.0)
        else:
            points = self._through(near, far, self._columns.passes_of(link))
        if link.reverse:
            points.reverse()
        pieces = tuple((points[at], points[at + 1], points[at + 2]) for at in range(1, len(points), 3))
        return Curve(link, points[0], pieces)

    def _through(
        self, near: tuple[float, float], far: tuple[float, float], passes: list[Pass]
    ) -> list[tuple[float, float]]:
        """Level through every pass, an S between them."""
        stops = [near]
        for one in passes:
            x, y = self._left[one.lane], BAND_HEAD + one.top
            stops += [(x - 4, y), (x + self._widths[one.lane] + 4, y)]
        stops.append(far)
        points = [near]
        for (ax, ay), (bx, by) in pairwise(stops):
            bend = (bx - ax) / 2
            points += [(ax + bend, ay), (bx - bend, by), (bx, by)]
        return points

    def _arc(self, near: tuple[float, float], far: tuple[float, float], way: float) -> list[tuple[float, float]]:
        bulge = way * min(76.0, 30.0 + 0.30 * abs(near[1] - far[1]))
        edge = min(near[0], far[0]) if way < 0 else max(near[0], far[0])
        return [near, (edge + bulge, near[1]), (edge + bulge, far[1]), far]

    def _fasten(self, row: Row, links: list[Link], *, on_left: bool) -> None:
        """Share a row's side among the ends of its links, in the order that crosses least."""
        box = self._boxes[id(row)]
        x = box.x if on_left else box.x + box.width
        ordered = sorted(links, key=lambda link: self._order(row, link))
        room = row.height / max(len(ordered), 1)
        room = min(room, 2 * PORT)
        first = box.y + (row.height - room * (len(ordered) - 1)) / 2
        seen: set[int] = set()
        for place, link in enumerate(ordered):
            end = "near" if row is link.near and id(link) not in seen else "far"
            seen.add(id(link))
            self._ports[id(link), end] = (x, first + room * place)

    def _order(self, row: Row, link: Link) -> tuple[int, float]:
        """Arcs upwards first, the nearest on top; then links by where they lead; then arcs downwards, loops last."""
        here = self._level(row)
        if link.within_lane:
            other = self._level(link.far if row is link.near else link.near)
            if link.near is link.far:
                return (3, 0.0)
            return (0, here - other) if other < here else (2, here - other)
        passes = self._columns.passes_of(link)
        if passes:
            return (1, BAND_HEAD + (passes[0] if row is link.near else passes[-1]).top)
        return (1, self._level(link.far if row is link.near else link.near))

    def _level(self, row: Row) -> float:
        return self._boxes[id(row)].y + row.height / 2


def _reach(curve: Curve) -> tuple[float, ...]:
    return (curve.start[1], *(end[1] for _, _, end in curve.pieces))


def _labels(curves: Sequence[Curve]) -> Iterable[Label]:
    """Words beside the curves that have any, kept apart where they would stand on each other."""
    columns: dict[tuple[float, str], list[tuple[float, float, Curve]]] = {}
    for curve in curves:
        if curve.link.words:
            x, y, anchor = _beside(curve)
            columns.setdefault((round(x / 60), anchor), []).append((y, x, curve))
    for (_, anchor), found in columns.items():
        found.sort(key=lambda one: one[0])
        heights = [LINE * len(label_lines(curve.link)) for _, _, curve in found]
        offsets = [0.0]
        for above, below in pairwise(heights):
            offsets.append(offsets[-1] + (above + below) / 2 + 3)
        levels = spread([y - o for (y, _, _), o in zip(found, offsets, strict=True)], [1.0] * len(found))
        for (_, x, curve), level, offset in zip(found, levels, offsets, strict=True):
            clear = _clear(curve, x, level + offset, curves) if curve.link.within_lane else x
            yield Label(curve.link, clear, level + offset, anchor)


def _clear(curve: Curve, x: float, y: float, curves: Sequence[Curve]) -> float:
    """Where an arc's words stand clear of the wider arcs that run past them."""
    for other in curves:
        if other.link.within_lane and other.link.start == curve.link.start:
            low, high = sorted((other.start[1], other.end[1]))
            if low - LINE < y < high + LINE:
                crest = _beside(other)[0]
                x = min(x, crest) if arc_on_left(curve.link.start) else max(x, crest)
    return x


def _beside(curve: Curve) -> tuple[float, float, str]:
    """Where a curve's words stand: outside an arc's crest, on the first stretch of a line."""
    link = curve.link
    if link.within_lane:
        (ax, ay), (bx, _), (cx, cy) = curve.pieces[0]
        crest = 0.25 * curve.start[0] + 0.75 * ax if abs(ax - bx) < 1e-9 else (ax + cx) / 2
        on_left = arc_on_left(link.start)
        return crest + (-7 if on_left else 7), (ay + cy) / 2, "end" if on_left else "start"
    piece = curve.pieces[-1] if link.reverse else curve.pieces[0]
    start = curve.pieces[-2][2] if link.reverse and len(curve.pieces) > 1 else curve.start
    return (start[0] + piece[2][0]) / 2, (start[1] + piece[2][1]) / 2, "middle"
