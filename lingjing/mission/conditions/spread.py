"""Possible places of an entity and bounds of a number before the seed is known.

`PossiblePlaces` is the set of a position's possible values: one point for a declared place, the region for a seeded
draw. Distances between such sets are the smallest possible ones, so that a proof holds for every seed.
"""

from __future__ import annotations

import itertools
import math
from functools import lru_cache

import msgspec

from lingjing.mission import expression as ex
from lingjing.mission import geometry2d
from lingjing.mission.draws import line_of
from lingjing.mission.evaluate import Area, Interval, Place, Scope, Value, evaluate, number
from lingjing.mission.intervals import ANYTHING, Bounds, exactly


class PossiblePlaces(msgspec.Struct, frozen=True):
    """A set of possible places."""

    outlines: tuple[geometry2d.Polygon, ...] = ()
    """Polygons in metres, with one corner for a point and two for a line. Empty: any place."""
    apart: float = 0.0
    """Minimum distance between members of the group `drawn`, metres."""
    drawn: str = ""
    """The group with these drawn places; "" for a declared place."""
    loose_m: float = 0.0
    """The largest distance by which the scene may move an entity from here, metres."""


_ANYWHERE = PossiblePlaces()


def point(east: float, north: float) -> PossiblePlaces:
    """One known place, metres."""
    return PossiblePlaces((((east, north),),))


def gap(first: PossiblePlaces, second: PossiblePlaces) -> float:
    """The least possible distance in metres; 0 if it is not known."""
    if not first.outlines or not second.outlines:
        return 0.0
    nearest = min(_between(a, b) for a in first.outlines for b in second.outlines)
    if first.drawn and first.drawn == second.drawn:
        nearest = max(nearest, first.apart)
    return max(0.0, nearest - first.loose_m - second.loose_m)


def farthest(first: PossiblePlaces, second: PossiblePlaces) -> float:
    """The largest possible distance in metres; infinity if it is not known."""
    if not first.outlines or not second.outlines:
        return math.inf
    corners = [corner for outline in second.outlines for corner in outline]
    most = max(math.dist(corner, other) for outline in first.outlines for corner in outline for other in corners)
    return most + first.loose_m + second.loose_m


def extent(where: PossiblePlaces, axis: int) -> Bounds:
    """The bounds of the east (axis 0) or north (axis 1) coordinate of the places, metres."""
    numbers = [corner[axis] for outline in where.outlines for corner in outline]
    return Bounds(min(numbers), max(numbers)) if numbers else ANYTHING


def places(draw: ex.Draw, scope: Scope, group: str) -> PossiblePlaces:
    """Every place that a draw of positions can give."""
    if draw.distribution == "sites" and len(draw.arguments) == 1:
        value = evaluate(draw.arguments[0], scope)
        apart = dict(draw.named).get("apart")
        outlines = outlines_of(value)
        if outlines:
            return PossiblePlaces(outlines, 0.0 if apart is None else number(apart, scope), group)
    if draw.distribution == "sites_along":
        segments = tuple(itertools.pairwise(line_of(draw, scope)))
        apart = dict(draw.named).get("apart")
        return PossiblePlaces(segments, 0.0 if apart is None else number(apart, scope), group)
    if draw.distribution in ("choice", "subset"):
        points = tuple(((p.east, p.north),) for p in _listed(draw, scope) if isinstance(p, Place))
        return PossiblePlaces(points, drawn=group)
    return _ANYWHERE


def outlines_of(value: Value) -> tuple[geometry2d.Polygon, ...]:
    """The outlines of a region; none if they are known only after the city is built."""
    return (value.polygon,) if isinstance(value, Area) and len(value.polygon) >= 3 else ()


def numbers(draw: ex.Draw, scope: Scope) -> Bounds:
    """The bounds of a drawn number."""
    if draw.distribution in ("uniform", "integer"):
        argument_bounds = [_bounds(evaluate(argument, scope)) for argument in draw.arguments]
        return (
            Bounds(min(low for low, _ in argument_bounds), max(high for _, high in argument_bounds))
            if argument_bounds
            else ANYTHING
        )
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


@lru_cache(4096)  # a proof queries the same few pairs of places many times
def _between(first: geometry2d.Polygon, second: geometry2d.Polygon) -> float:
    if len(first) == 1 and len(second) == 1:
        return math.dist(first[0], second[0])
    if _touch(first, second):
        return 0.0
    return min(
        min(geometry2d.edge_distance(second, *corner) for corner in first),
        min(geometry2d.edge_distance(first, *corner) for corner in second),
    )


def _touch(first: geometry2d.Polygon, second: geometry2d.Polygon) -> bool:
    """True if the two may overlap; for two regions, if their bounding boxes do."""
    if len(first) == 1:
        return len(second) >= 3 and geometry2d.contains(second, *first[0])
    if len(second) == 1:
        return len(first) >= 3 and geometry2d.contains(first, *second[0])
    west, south, east, north = geometry2d.bounds(first)
    w, s, e, n = geometry2d.bounds(second)
    return west <= e and w <= east and south <= n and s <= north
