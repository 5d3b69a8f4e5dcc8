"""From a graph to cards in lanes and links between their rows: everything of a picture but the places.

A node that is within another is a row of its card (an agent of its role, a hidden fact of its target), and an edge
that only says so is not drawn. Lengths are pixels.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field

from lingjing.mission.draw.lettering import fitted, width
from lingjing.mission.draw.reading import edge_words
from lingjing.mission.draw.styles import LANES, guard_words, lane_of
from lingjing.mission.graph.types import Edge, MissionGraph, Node

TITLE, DETAIL, TAG = 13.0, 11.0, 9.5
"""Font sizes: a node's name, its line, its kind."""

WIDEST, NARROWEST = 216.0, 128.0
PAD, INSET, BETWEEN, STACK = 10.0, 8.0, 7.0, 5.0
"""Text to border; card to row within it; rows; the offset of the sheets behind a group."""

PORT = 11.0
"""The least distance of two ends of links on one side of a row."""


@dataclass(slots=True)
class Row:
    """One node in a card: `left` and `right` are the ends of links on its sides, `top` its place in the card."""

    node: Node
    title: str
    detail: str
    tag: str
    inner: bool
    left: list[Link] = field(default_factory=list, repr=False)
    right: list[Link] = field(default_factory=list, repr=False)
    top: float = 0.0
    height: float = 0.0

    @property
    def stacked(self) -> bool:
        """Whether it stands for a group."""
        return self.node.count is not None


@dataclass(slots=True)
class Card:
    """A node with what is within it, in one lane; `top` is its place in the picture."""

    lane: int
    rows: list[Row]
    height: float = 0.0
    top: float = 0.0


@dataclass(slots=True)
class Link:
    """An edge to be drawn. It runs from lane `start` to lane `end` (`start <= end`), `reverse` if against the edge."""

    edge: Edge
    words: str
    near: Row
    far: Row
    start: int
    end: int
    reverse: bool

    @property
    def within_lane(self) -> bool:
        """Whether both ends are in one lane: then it is an arc beside it."""
        return self.start == self.end


@dataclass(frozen=True, slots=True)
class Picture:
    """Cards by lane (all of `LANES`, some empty), the width of each lane's cards, and the links."""

    lanes: tuple[tuple[Card, ...], ...]
    widths: tuple[float, ...]
    links: tuple[Link, ...]


ORDERED = (3, 4)
"""Lanes read from top to bottom, what comes first on top: rules and events, and stages."""


def arc_on_left(lane: int) -> bool:
    """On which side of a lane its arcs run: the first has nothing else on its left, the world nothing on its right."""
    return lane in (0, 2)


def picture(graph: MissionGraph) -> Picture:
    """Cards and links of a graph, sized."""
    rows = {node.id: _row(node) for node in graph.nodes}
    lanes: tuple[list[Card], ...] = tuple([] for _ in LANES)
    cards: dict[str, Card] = {}
    for node in graph.nodes:
        if node.within is None:
            cards[node.id] = Card(lane_of(node), [rows[node.id]])
            lanes[lane_of(node)].append(cards[node.id])
    for node in graph.nodes:
        if node.within is not None:
            cards[node.id] = cards[node.within]
            cards[node.id].rows.append(rows[node.id])
    for lane in ORDERED:
        lanes[lane].sort(key=_places(graph, lane))
    links = tuple(
        _link(edge, rows, cards)
        for edge in graph.edges
        if cards[edge.source] is not cards[edge.target] or edge.source == edge.target
    )
    for link in links:
        _attach(link)
    for cards_of_lane in lanes:
        for card in cards_of_lane:
            _size(card)
    return Picture(tuple(map(tuple, lanes)), tuple(_lane_width(lane) for lane in lanes), links)


def _places(graph: MissionGraph, lane: int) -> Callable[[Card], int]:
    """The place of each card of a lane: as declared, but what another needs or waits for comes before it."""
    inside = {node.id for node in graph.nodes if lane_of(node) == lane}
    before: dict[str, list[str]] = {identity: [] for identity in inside}
    for edge in graph.edges:
        if edge.source in inside and edge.target in inside:
            first, then = (edge.target, edge.source) if edge.kind == "requires" else (edge.source, edge.target)
            before[then].append(first)
    places: dict[str, int] = {}
    waiting = [node.id for node in reversed(graph.nodes) if node.id in inside]
    begun: set[str] = set()
    while waiting:
        identity = waiting[-1]
        ahead = [one for one in before[identity] if one not in begun]
        if identity not in begun and ahead:
            begun.add(identity)
            waiting.extend(reversed(ahead))
        else:
            begun.add(waiting.pop())
            places.setdefault(identity, len(places))
    return lambda card: places[card.rows[0].node.id]


def _row(node: Node) -> Row:
    inner = node.within is not None
    room = WIDEST - 2 * PAD - _indent(node)
    tag = fitted(f"{node.kind} · {guard_words(node.when)}" if node.when else node.kind, TAG, room / 2)
    return Row(
        node=node,
        title=fitted(node.title, TITLE, room - width(tag, TAG) - PAD, bold=True),
        detail=fitted(node.detail, DETAIL, room),
        tag=tag,
        inner=inner,
    )


def _indent(node: Node) -> float:
    """How much narrower than its card a row is."""
    if node.within is None:
        return 0.0
    return 2 * INSET + (STACK if node.count is not None else 0.0)


def _link(edge: Edge, rows: dict[str, Row], cards: dict[str, Card]) -> Link:
    source, target = cards[edge.source].lane, cards[edge.target].lane
    reverse = target < source
    near, far = (edge.target, edge.source) if reverse else (edge.source, edge.target)
    return Link(edge, edge_words(edge), rows[near], rows[far], min(source, target), max(source, target), reverse)


def _attach(link: Link) -> None:
    if link.within_lane:
        for row in (link.near, link.far):
            (row.left if arc_on_left(link.start) else row.right).append(link)
        return
    link.near.right.append(link)
    link.far.left.append(link)


def _size(card: Card) -> None:
    """Give the rows their heights and places: room for the text, and for the ends of the links on either side."""
    top = 0.0
    for place, row in enumerate(card.rows):
        text = 2 * PAD - 4 + TITLE + (DETAIL + 5 if row.detail else 0)
        row.height = max(text, PORT * (max(len(row.left), len(row.right)) + 0.6))
        if place:
            top += BETWEEN if place > 1 else 0.0
        row.top = top
        top += row.height + (STACK if row.stacked and row.inner else 0.0)
    card.height = top + (INSET if len(card.rows) > 1 else 0.0)


def _lane_width(lane: Iterable[Card]) -> float:
    widest = max((_row_width(row) for card in lane for row in card.rows), default=0.0)
    return min(WIDEST, max(NARROWEST, widest)) if widest else 0.0


def _row_width(row: Row) -> float:
    top = width(row.title, TITLE, bold=True) + PAD + width(row.tag, TAG)
    return max(top, width(row.detail, DETAIL)) + 2 * PAD + _indent(row.node)
