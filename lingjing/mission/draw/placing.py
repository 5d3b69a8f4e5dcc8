"""Where the cards stand: the order in each lane that crosses few links, then heights that keep links straight.

A layered drawing (Sugiyama, Tagawa, Toda 1981) with the lanes given. A link that passes a lane holds a place of its
own in it, a `Pass`, so that no link runs behind a card. Orders come from barycentres, the best of a fixed number of
sweeps is kept; heights are the least-squares places under that order (pool adjacent violators). Every step is
deterministic: ties fall to the earlier declaration.
"""

from __future__ import annotations

from bisect import bisect, insort
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from itertools import pairwise, takewhile
from typing import NamedTuple

from lingjing.mission.draw.cards import ORDERED, PORT, STACK, Card, Link, Picture, Row

SWEEPS = 24
CARD_GAP, PASS_GAP, MIXED_GAP = 24.0, 9.0, 16.0


@dataclass(slots=True, eq=False)
class Pass:
    """Where one link passes a lane on its way; a card of no height."""

    link: Link
    lane: int
    top: float = 0.0
    height: float = 0.0


Item = Card | Pass


@dataclass(slots=True)
class _Tie:
    """One stretch of a link, between neighbouring lanes: two items and how far down each it is fastened."""

    left: Item
    right: Item
    left_at: float
    right_at: float


class _Wish(NamedTuple):
    """The top an item would have if it were alone, how much that matters, and where that ranks it in its lane."""

    top: float
    weight: float
    rank: float


_FAR, _FAINT = 1e6, 1e-10
"""A top above or a rank below all others; the weight of a wish that yields to any other."""


@dataclass(slots=True)
class Columns:
    """The items of each lane from top to bottom, the passes of each link from left to right, and for each card the one
    of its own lane that it was first joined to."""

    items: list[list[Item]]
    passes: dict[int, list[Pass]] = field(default_factory=dict)
    partners: dict[int, Item] = field(default_factory=dict)

    def passes_of(self, link: Link) -> list[Pass]:
        """Where a link passes lanes."""
        return self.passes.get(id(link), [])


def arrange(picture: Picture) -> Columns:
    """Give every card its `top`, from 0 down; returns the passes between them."""
    columns, ties = _columns(picture)
    best = _snapshot(columns)
    fewest: tuple[int, float] | None = None
    for sweep in range(SWEEPS):
        _settle(columns, ties, reorder=True, forward=sweep % 2 == 0)
        cost = (_crossings(columns, ties), _length(ties))
        if fewest is None or cost < fewest:
            fewest, best = cost, _snapshot(columns)
    columns.items = best
    for sweep in range(8):
        _settle(columns, ties, reorder=False, forward=sweep % 2 == 0)
    _to_zero(columns)
    return columns


def separation(above: Item, below: Item) -> float:
    """The least distance from the bottom of one item to the top of the next."""
    loose = STACK if isinstance(above, Card) and above.rows[0].stacked else 0.0
    if isinstance(above, Pass) and isinstance(below, Pass):
        return PASS_GAP
    return loose + (CARD_GAP if isinstance(above, Card) and isinstance(below, Card) else MIXED_GAP)


def spread(wishes: Sequence[float], weights: Sequence[float]) -> list[float]:
    """The non-decreasing numbers nearest to the wishes in weighted least squares (pool adjacent violators)."""
    blocks: list[tuple[float, float, int]] = []
    for wish, weight in zip(wishes, weights, strict=True):
        mean, mass, count = wish, weight, 1
        while blocks and blocks[-1][0] > mean:
            other, other_mass, other_count = blocks.pop()
            mean = (mean * mass + other * other_mass) / (mass + other_mass)
            mass, count = mass + other_mass, count + other_count
        blocks.append((mean, mass, count))
    return [mean for mean, _, count in blocks for _ in range(count)]


# -- private


def _columns(picture: Picture) -> tuple[Columns, list[_Tie]]:
    columns = Columns([list(lane) for lane in picture.lanes])
    owner = {id(row): card for lane in picture.lanes for card in lane for row in card.rows}
    ties: list[_Tie] = []
    for link in picture.links:
        passes = [Pass(link, lane) for lane in range(link.start + 1, link.end) if picture.lanes[lane]]
        columns.passes[id(link)] = passes
        for passing in passes:
            columns.items[passing.lane].append(passing)
        if link.within_lane:
            near, far = owner[id(link.near)], owner[id(link.far)]
            for one, other in ((near, far), (far, near)) if near is not far else ():
                columns.partners.setdefault(id(one), other)
        else:
            ties.extend(_ties(link, owner, passes))
    for lane in columns.items:
        _stack(lane, [_Wish(0.0, 1.0, 0.0)] * len(lane))
    return columns, ties


def _ties(link: Link, owner: dict[int, Card], passes: list[Pass]) -> list[_Tie]:
    chain: list[tuple[Item, float]] = [(owner[id(link.near)], _middle(link.near))]
    chain += [(one, 0.0) for one in passes]
    chain.append((owner[id(link.far)], _middle(link.far)))
    return [_Tie(a, b, at_a, at_b) for (a, at_a), (b, at_b) in pairwise(chain)]


def _middle(row: Row) -> float:
    return row.top + row.height / 2


def _settle(columns: Columns, ties: list[_Tie], *, reorder: bool, forward: bool) -> None:
    """One sweep over the lanes: every item wishes to be level with what it is tied to."""
    pulls = _pulls(ties)
    order = range(len(columns.items)) if forward else range(len(columns.items) - 1, -1, -1)
    for lane in order:
        items = columns.items[lane]
        wishes = {id(item): _wish(item, pulls, columns.partners) for item in items}
        if reorder:
            _order(items, wishes, fixed=lane in ORDERED)
        _stack(items, [wishes[id(item)] for item in items])


def _order(items: list[Item], wishes: dict[int, _Wish], *, fixed: bool) -> None:
    """Sort a lane by its wishes; where its order is `fixed`, the cards keep theirs and only passes move."""
    cards = iter([item for item in items if isinstance(item, Card)])
    items.sort(key=lambda item: wishes[id(item)].rank)
    if fixed:
        items[:] = [next(cards) if isinstance(item, Card) else item for item in items]


def _pulls(ties: list[_Tie]) -> dict[int, list[Callable[[], float]]]:
    """For each item, functions that give the tops at which one of its ties would be level."""
    found: dict[int, list[Callable[[], float]]] = {}
    for tie in ties:
        found.setdefault(id(tie.left), []).append(lambda t=tie: t.right.top + t.right_at - t.left_at)  # type: ignore[misc]
        found.setdefault(id(tie.right), []).append(lambda t=tie: t.left.top + t.left_at - t.right_at)  # type: ignore[misc]
    return found


def _wish(item: Item, pulls: dict[int, list[Callable[[], float]]], partners: dict[int, Item]) -> _Wish:
    """Level with its ties; without any, right below a card of its lane that it is joined to, else below all."""
    wanted = [pull() for pull in pulls.get(id(item), ())]
    if wanted:
        top = sum(wanted) / len(wanted)
        return _Wish(top, 3.0 if isinstance(item, Pass) else 1.0, top + item.height / 2)
    partner = partners.get(id(item))
    return _Wish(-_FAR, _FAINT, _FAR if partner is None else partner.top + partner.height)


def _stack(items: list[Item], wishes: list[_Wish]) -> None:
    """Put the items in their order as near to their wishes as their heights allow; what has none closes up."""
    offsets = [0.0]
    for above, below in pairwise(items):
        offsets.append(offsets[-1] + above.height + separation(above, below))
    settled = next((wish.top for wish in wishes if wish.weight > _FAINT), 0.0)
    leading = len(list(takewhile(lambda wish: wish.weight <= _FAINT, wishes)))
    tops = [
        (settled if place < leading else wish.top) - offset
        for place, (wish, offset) in enumerate(zip(wishes, offsets, strict=False))
    ]
    levels = spread(tops, [wish.weight for wish in wishes])
    for item, level, offset in zip(items, levels, offsets, strict=False):
        item.top = level + offset


def _crossings(columns: Columns, ties: list[_Tie]) -> int:
    """How many pairs of stretches cross, counted as inversions lane by lane."""
    places = {id(item): place for items in columns.items for place, item in enumerate(items)}
    lanes = {id(item): lane for lane, items in enumerate(columns.items) for item in items}
    by_lane: dict[int, list[tuple[int, float, int, float]]] = {}
    for tie in ties:
        key = (places[id(tie.left)], tie.left_at, places[id(tie.right)], tie.right_at)
        by_lane.setdefault(lanes[id(tie.left)], []).append(key)
    total = 0
    for stretches in by_lane.values():
        seen: list[tuple[int, float]] = []
        for _, _, right, right_at in sorted(stretches):
            total += len(seen) - bisect(seen, (right, right_at))
            insort(seen, (right, right_at))
    return total


def _length(ties: list[_Tie]) -> float:
    return sum(abs(tie.left.top + tie.left_at - tie.right.top - tie.right_at) for tie in ties)


def _snapshot(columns: Columns) -> list[list[Item]]:
    return [list(items) for items in columns.items]


def _to_zero(columns: Columns) -> None:
    top = min((item.top for items in columns.items for item in items), default=0.0)
    for items in columns.items:
        for item in items:
            item.top -= top - PORT
