"""Where something may be, and between which bounds a number lies, before the seed is known.

`PossiblePlaces` is the set of places that a position can take: one point for a declared place, the region for a seeded
draw. Distances between such sets are the smallest possible ones, so what is proved of them is true for every seed.
"""

from __future__ import annotations

import math

import msgspec

from lingjing.mission import expression as ex
from lingjing.mission import geometry2d
from lingjing.mission.evaluate import Area, Interval, Place, Scope, Value, evaluate, number
from lingjing.mission.intervals import ANYTHING, Bounds, exactly


class PossiblePlaces(msgspec.Struct, frozen=True):
    """The possible places: outlines in metres, of one corner for a point. Empty: anywhere.

    `drawn` is the group whose places are drawn ("" for declared ones); its members are at least `apart` metres from
    each other. The scene may move what stands there by up to `loose_m`.
    """

    outlines: tuple[geometry2d.Polygon, ...] = ()
    apart: float = 0.0
    drawn: str = ""
    loose_m: float = 0.0


ANYWHERE = PossiblePlaces()


def point(east: float, north: float) -> PossiblePlaces:
    """One known place."""
    return PossiblePlaces((((east, north),),))


def gap(one: PossiblePlaces, other: PossiblePlaces) -> float:
    """The least possible distance in metres; 0 if it is not known."""
    if not one.outlines or not other.outlines:
        return 0.0
    nearest = min(_between(a, b) for a in one.outlines for b in other.outlines)
    if one.drawn and one.drawn == other.drawn:
        nearest = max(nearest, one.apart)
    return max(0.0, nearest - one.loose_m - other.loose_m)


def places(draw: ex.Draw, scope: Scope, group: str) -> PossiblePlaces:
    """Every place that a draw of positions can give."""
    if draw.distribution == "sites" and len(draw.arguments) == 1:
        value = evaluate(draw.arguments[0], scope)
        apart = dict(draw.named).get("apart")
        outlines = outlines_of(value)
        if outlines:
            return PossiblePlaces(outlines, 0.0 if apart is None else number(apart, scope), group)
    if draw.distribution in ("choice", "subset"):
        points = tuple(((p.east, p.north),) for p in _listed(draw, scope) if isinstance(p, Place))
        return PossiblePlaces(points, drawn=group)
    return ANYWHERE


def outlines_of(value: Value) -> tuple[geometry2d.Polygon, ...]:
    """The outlines of a region; none if only the city knows them."""
    return (value.polygon,) if isinstance(value, Area) and len(value.polygon) >= 3 else ()


def numbers(draw: ex.Draw, scope: Scope) -> Bounds:
    """Between which bounds a drawn number lies."""
    if draw.distribution == "uniform":
        found = [_bounds(evaluate(argument, scope)) for argument in draw.arguments]
        return Bounds(min(low for low, _ in found), max(high for _, high in found)) if found else ANYTHING
    if draw.distribution == "normal":
        named = dict(draw.named)
        low, high = named.get("low"), named.get("high")
        return Bounds(
            -math.inf if low is None else number(low, scope),
            math.inf if high is None else number(high, scope),
        )
    if draw.distribution in ("choice", "subset"):
        values = [value for value in _listed(draw, scope) if isinstance(value, float) and not isinstance(value, bool)]
        return Bounds(min(values), max(values)) if values else ANYTHING
    return ANYTHING


def _bounds(value: Value) -> Bounds:
    if isinstance(value, Interval):
        return Bounds(value.low, value.high)
    return exactly(value) if isinstance(value, float) else ANYTHING


def _listed(draw: ex.Draw, scope: Scope) -> tuple[Value, ...]:
    values = tuple(evaluate(argument, scope) for argument in draw.arguments)
    return values[0] if len(values) == 1 and isinstance(values[0], tuple) else values


def _between(one: geometry2d.Polygon, other: geometry2d.Polygon) -> float:
    if len(one) == 1 and len(other) == 1:
        return math.dist(one[0], other[0])
    if _touch(one, other):
        return 0.0
    return min(
        min(geometry2d.edge_distance(other, *corner) for corner in one),
        min(geometry2d.edge_distance(one, *corner) for corner in other),
    )


def _touch(one: geometry2d.Polygon, other: geometry2d.Polygon) -> bool:
    """Whether they may overlap; of two regions, already if their bounding boxes do."""
    if len(one) == 1:
        return len(other) >= 3 and geometry2d.contains(other, *one[0])
    if len(other) == 1:
        return len(one) >= 3 and geometry2d.contains(one, *other[0])
    west, south, east, north = geometry2d.bounds(one)
    w, s, e, n = geometry2d.bounds(other)
    return west <= e and w <= east and south <= n and s <= north
