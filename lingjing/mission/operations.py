"""The operators and functions of expressions over values.

Each takes the evaluation context and its evaluated operands. It raises `MissionError` if it has no value: for an
operand of a wrong kind, or for a division by zero. `lingjing.mission.functions` has the table of their names. `and`,
`or`, quantifiers and aggregates are defined by each semantics, because they decide which operands are evaluated.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Callable
from functools import lru_cache

from lingjing.errors import MissionError
from lingjing.mission import geometry2d
from lingjing.mission.spacing import Spacing
from lingjing.mission.units import LARGEST
from lingjing.mission.values import (
    Area,
    EvaluationContext,
    Interval,
    Members,
    Place,
    Value,
    as_area,
    as_flag,
    as_number,
    as_whole,
    describe,
    is_number,
)

Function = Callable[..., Value]
"""`(context, *operands) -> value`."""

# -- operators ------------------------------------------------------------------------------------------------------


def negative(context: EvaluationContext, value: Value) -> Value:
    """Return the value of `-x`."""
    return -as_number(value)


def inverse(context: EvaluationContext, value: Value) -> Value:
    """Return the value of `not x`."""
    return not as_flag(value)


def _arithmetic(
    symbol: str, apply: Callable[[float, float], float]
) -> Callable[[EvaluationContext, Value, Value], Value]:
    def value_of(context: EvaluationContext, left: Value, right: Value) -> Value:
        if is_number(left) and is_number(right):
            if symbol == "/" and right == 0:
                raise MissionError("division by zero")
            value = apply(left, right)
            if not abs(value) <= LARGEST:
                message = f"{left:g} {symbol} {right:g} is too large"
                raise MissionError(message, hint=f"numbers go up to {LARGEST:g} in SI units")
            return value
        if symbol in "+-" and isinstance(left, Place) and isinstance(right, Place):
            return _shifted(left, right, 1.0 if symbol == "+" else -1.0)
        raise MissionError(f"'{symbol}' does not apply to {describe(left)} and {describe(right)}")

    return value_of


def _shifted(left: Place, right: Place, sign: float) -> Place:
    heights = left.elevation, right.elevation
    up = None if heights == (None, None) else (heights[0] or 0.0) + sign * (heights[1] or 0.0)
    return Place(left.east + sign * right.east, left.north + sign * right.north, up)


plus, minus = _arithmetic("+", operator.add), _arithmetic("-", operator.sub)
times, over = _arithmetic("*", operator.mul), _arithmetic("/", operator.truediv)


def _ordering(apply: Callable[[float, float], bool]) -> Callable[[EvaluationContext, Value, Value], Value]:
    def value_of(context: EvaluationContext, left: Value, right: Value) -> Value:
        return apply(as_number(left), as_number(right))

    return value_of


less, at_most = _ordering(operator.lt), _ordering(operator.le)
more, at_least = _ordering(operator.gt), _ordering(operator.ge)


def same(context: EvaluationContext, left: Value, right: Value) -> Value:
    """Return the value of `a == b`."""
    return bool(left == right)


def different(context: EvaluationContext, left: Value, right: Value) -> Value:
    """Return the value of `a != b`."""
    return bool(left != right)


def within(context: EvaluationContext, item: Value, whole: Value) -> Value:
    """Return the value of `x in low..high`, `place in region`, `name in { a, b }`."""
    if isinstance(whole, Interval) and is_number(item):
        return whole.low <= item <= whole.high
    if isinstance(whole, Area) and (place := context.place(item)) is not None:
        return geometry2d.contains(whole.polygon, place.east, place.north)
    if isinstance(whole, tuple):
        return item in whole
    raise MissionError(f"{describe(item)} cannot be in {describe(whole)}")


# -- composites -----------------------------------------------------------------------------------------------------


def point(context: EvaluationContext, *items: Value) -> Value:
    """`(east, north)` or `(east, north, elevation)`."""
    if len(items) not in (2, 3):
        raise MissionError(f"a point has 2 or 3 components, not {len(items)}")
    return Place(*(as_number(item) for item in items))


def listed(context: EvaluationContext, *items: Value) -> Value:
    """Return the value of `[a, b]`."""
    return items


def interval(context: EvaluationContext, low: Value, high: Value) -> Value:
    """Return the value of `low..high`."""
    least, most = as_number(low), as_number(high)
    if least > most:
        raise MissionError(f"the range {least:g}..{most:g} is empty", hint="write the lower end first")
    return Interval(least, most)


def member(context: EvaluationContext, items: Value, index: Value) -> Value:
    """Return the value of `uav[2]`, counted from 1."""
    position = as_whole(index)
    match items:
        case Members(ids=ids) if 1 <= position <= len(ids):
            return Members((ids[position - 1],))
        case Members(ids=ids):
            raise MissionError(f"there is no member {position}, the group has {len(ids)}: {describe(items)}")
        case tuple() if 1 <= position <= len(items):
            return items[position - 1]
        case tuple():
            raise MissionError(f"there is no item {position}, the list has {len(items)}")
    raise MissionError(f"{describe(items)} has no members to count")


AXES = {"east": 0, "x": 0, "north": 1, "y": 1, "elevation": 2, "z": 2}
"""Index of a position's component by the names of its fields."""


def field(value: Value, name: str) -> Value:
    """A field of a point, a region or a range. Raises `MissionError` if it has no field of that name."""
    match value:
        case Place(east=east, north=north, elevation=elevation) if name in AXES:
            component = (east, north, elevation)[AXES[name]]
            if component is not None:
                return component
        case Area(polygon=polygon) if name == "centre":
            return Place(*geometry2d.centroid(polygon))
        case Area(polygon=polygon) if name == "area":
            return abs(geometry2d.signed_area(polygon))
        case Interval(low=low, high=high) if name in ("low", "high"):
            return low if name == "low" else high
    raise MissionError(f"{describe(value)} has no '{name}' before the mission runs")


# -- regions --------------------------------------------------------------------------------------------------------


def polygon(context: EvaluationContext, *corners: Value) -> Value:
    """Return the value of `polygon(corner, …)`, or of one list of corners."""
    if len(corners) == 1 and isinstance(corners[0], tuple):
        corners = corners[0]
    outline: list[geometry2d.Vector2] = []
    for corner in corners:
        if not isinstance(corner, Place):
            raise MissionError(f"a polygon's corner is a point, not {describe(corner)}")
        outline.append((corner.east, corner.north))
    return _checked(tuple(outline))


def circle(context: EvaluationContext, centre: Value, reach: Value) -> Value:
    """Return the value of `circle(centre, radius)`."""
    place = context.place(centre)
    if place is None or not is_number(reach) or not reach > 0:
        raise MissionError("circle(centre, radius) takes a point and a length above 0")
    return _checked(geometry2d.circle((place.east, place.north), reach))


def box(context: EvaluationContext, corner: Value, opposite: Value) -> Value:
    """`box(corner, corner)`: an upright rectangle."""
    first, second = context.place(corner), context.place(opposite)
    if first is None or second is None:
        raise MissionError("box(corner, corner) takes two points")
    return _checked(geometry2d.rectangle((first.east, first.north), (second.east, second.north)))


def buffer(context: EvaluationContext, shape: Value, reach: Value) -> Value:
    """`buffer(shape, distance)`: the area within the distance of a region or of a line."""
    if not is_number(reach):
        raise MissionError("buffer(shape, distance) takes a length")
    if isinstance(shape, Area):
        return _checked(geometry2d.buffered(shape.polygon, reach, closed=True))
    points = tuple(item for item in shape if isinstance(item, Place)) if isinstance(shape, tuple) else ()
    if len(points) < 2 or reach <= 0:
        raise MissionError("buffer(line, distance) takes two and more points and a length above 0")
    return _checked(geometry2d.buffered(tuple((p.east, p.north) for p in points), reach, closed=False))


def union(context: EvaluationContext, *regions: Value) -> Value:
    """`union(region, …)` of adjacent regions."""
    return _checked(geometry2d.united(tuple(as_area(region).polygon for region in regions)))


@lru_cache(maxsize=1024)  # a check of a mission evaluates its regions again for each mode and setting
def _checked(outline: geometry2d.Polygon) -> Area:
    fault = geometry2d.fault(outline)
    if fault:
        raise MissionError(f"the outline {fault}", hint="list the corners in order around the area")
    return Area(geometry2d.normalised(outline))


def of_the_map(name: str) -> Callable[..., Value]:
    """`road(…)` and `along(…)`: regions that only the built city can evaluate."""

    def raise_error(context: EvaluationContext, *arguments: Value) -> Value:
        raise MissionError(
            f"the area of '{name}(…)' is known only after the city is built",
            hint="draw from a polygon; an entity with `on = road` is moved to the nearest road",
        )

    return raise_error


# -- lists ----------------------------------------------------------------------------------------------------------


_MAX_INDEX = 100_000
"""The largest index of `at(…)`: the largest number of members of a group."""


def item_at(
    context: EvaluationContext, index: Value, values: Value, *, spread: Value = None, rest: Value = None
) -> Value:
    """`at(i, [values], spread d)`: the i-th value. Beyond the list, the value is `rest`, a point around the listed
    ones, or a repetition of the list."""
    position = as_whole(index)
    if not 1 <= position <= _MAX_INDEX:
        raise MissionError(f"at(…) counts from 1 to {_MAX_INDEX:,}, not {position:,}")
    if not isinstance(values, tuple) or not values:
        raise MissionError("at(index, [values]) needs a list with something in it")
    if position <= len(values):
        return values[position - 1]
    if rest is not None:
        return rest
    places = tuple(value for value in values if isinstance(value, Place))
    if len(places) < len(values):
        return values[(position - 1) % len(values)]
    if spread is None:
        raise MissionError(
            f"member {position} has no place: the list has {len(values)}",
            hint="add points to the list, or give the distance of further members: at(i, […], spread 8 m)",
        )
    return further_place(places, as_number(spread), position)


def further_place(places: tuple[Place, ...], spread: float, position: int) -> Place:
    """The place of member `position` (from 1) of a group that is larger than its list of places.

    Further members stand on rings of radius spread, 2 spread, … about the listed places in turn: six on the first ring,
    twelve on the second, each at least `spread` metres from every earlier one. Coordinates are rounded to millimetres.
    The members of a smaller group are the first of a larger one.
    """
    if not spread > 0:
        raise MissionError(f"spread = {spread:g} m leaves no room between members", hint="give a length above 0")
    return _ringed(places, spread, 1 << (position - 1).bit_length())[position - 1]


@lru_cache(maxsize=64)
def _ringed(places: tuple[Place, ...], spread: float, count: int) -> tuple[Place, ...]:
    placed = list(places)
    spacing = Spacing(spread - 1e-3, max(max(abs(p.east), abs(p.north)) for p in places))
    for place in places:
        spacing.add(place.east, place.north)
    ring = 0
    while len(placed) < count:
        ring += 1
        for step in range(6 * ring):
            angle = 2.0 * math.pi * step / (6 * ring)
            for base in places:
                east = round(base.east + ring * spread * math.cos(angle), 3)
                north = round(base.north + ring * spread * math.sin(angle), 3)
                if spacing.is_free(east, north):
                    spacing.add(east, north)
                    placed.append(Place(east, north, base.elevation))
    return tuple(placed)


# -- numbers --------------------------------------------------------------------------------------------------------


def numeric(name: str, function: Callable[..., float]) -> Callable[..., Value]:
    """An operation of a function of numbers."""

    def value_of(context: EvaluationContext, *arguments: Value) -> Value:
        numbers = [as_number(argument) for argument in arguments]
        try:
            return float(function(*numbers))
        except (ValueError, OverflowError) as error:
            raise MissionError(f"{name}({', '.join(f'{v:g}' for v in numbers)}) has no value") from error

    return value_of


def distance(context: EvaluationContext, a: Value, b: Value) -> Value:
    """Metres between two places. A place without elevation is at elevation 0."""
    first, second = _ends(context, "distance", a, b)
    up = (first.elevation or 0.0) - (second.elevation or 0.0)
    apart = math.hypot(first.east - second.east, first.north - second.north, up)
    context.note("distance_3d_m", apart)
    return apart


def distance_xy(context: EvaluationContext, a: Value, b: Value) -> Value:
    """Horizontal metres between two places."""
    first, second = _ends(context, "distance_xy", a, b)
    apart = math.hypot(first.east - second.east, first.north - second.north)
    context.note("distance_m", apart)
    return apart


def _ends(context: EvaluationContext, name: str, a: Value, b: Value) -> tuple[Place, Place]:
    first, second = context.place(a), context.place(b)
    if first is None or second is None:
        raise MissionError(f"{name}(…) of points only, before the mission runs")
    return first, second


# -- boxes ----------------------------------------------------------------------------------------------------------


def iou(context: EvaluationContext, a: Value, b: Value) -> Value:
    """Intersection over union of two boxes."""
    if not (is_box(a) and is_box(b)):
        raise MissionError(f"iou(…) takes two boxes, not {describe(a)} and {describe(b)}")
    value = overlap(a, b)
    context.note("iou", value)
    return value


def overlap(first: tuple[float, ...], second: tuple[float, ...]) -> float:
    """Intersection over union of two boxes (x_min, y_min, x_max, y_max); 0 for an empty one."""
    width = min(first[2], second[2]) - max(first[0], second[0])
    height = min(first[3], second[3]) - max(first[1], second[1])
    if width <= 0 or height <= 0:
        return 0.0
    shared = width * height
    whole = _extent(first) + _extent(second) - shared
    return shared / whole if whole > 0 else 0.0


def _extent(corners: tuple[float, ...]) -> float:
    return max(0.0, corners[2] - corners[0]) * max(0.0, corners[3] - corners[1])


def is_box(value: Value) -> bool:
    """True for four numbers in a tuple."""
    return isinstance(value, tuple) and len(value) == 4 and all(isinstance(item, int | float) for item in value)


def fact(name: str) -> Callable[..., Value]:
    """The operation of a function that only a running mission can evaluate."""

    def value_of(context: EvaluationContext, *arguments: Value) -> Value:
        return context.fact(name, arguments)

    return value_of
