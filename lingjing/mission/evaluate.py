"""Evaluate the static expressions of a mission: everything known before the first tick.

`evaluate(expr, scope)` gives a plain value: a flag, a number (SI, angles in degrees), a word, a `Place`, an
`Interval`, an `Area`, the `Members` of a group, or a tuple of values. What only a running mission knows (events,
reports, sensors) is the adjudicator's business; meeting it here raises `MissionError`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from functools import lru_cache
from typing import assert_never

import msgspec

from lingjing.errors import MissionError
from lingjing.mission import expression as ex
from lingjing.mission import geometry2d
from lingjing.mission.spacing import Spacing
from lingjing.mission.units import LARGEST


class Place(msgspec.Struct, frozen=True):
    """A point in metres; `elevation` is None where the author gave two components."""

    east: float
    north: float
    elevation: float | None = None


class Interval(msgspec.Struct, frozen=True):
    """An inclusive range of numbers."""

    low: float
    high: float


class Area(msgspec.Struct, frozen=True):
    """A region's outline, as given."""

    polygon: geometry2d.Polygon


class Members(msgspec.Struct, frozen=True):
    """Ids of the entities an expression names, in order of their index."""

    ids: tuple[str, ...]


Value = bool | float | str | Place | Interval | Area | Members | tuple["Value", ...]


class Scope(msgspec.Struct, frozen=True):
    """What a static expression may refer to.

    `members` maps a group (or a single entity) to its entity ids; `names` binds index variables; `places` says where
    entities stand, once that is known.
    """

    parameters: Mapping[str, float] = {}
    mode: str = ""
    areas: Mapping[str, Area] = {}
    members: Mapping[str, tuple[str, ...]] = {}
    names: Mapping[str, float] = {}
    tick_s: float = 1.0
    places: Mapping[str, Place] = {}

    def binding(self, name: str, value: float) -> Scope:
        """The same scope with one more index variable."""
        return msgspec.structs.replace(self, names={**self.names, name: value})


def evaluate(expr: ex.Expr, scope: Scope) -> Value:  # noqa: C901 - one case for each node class
    """The value of a static expression; `MissionError` says what cannot be evaluated and why."""
    match expr:
        case ex.Number(value=amount):
            return float(amount)
        case ex.Text(value=text):
            return text
        case ex.Flag(value=flag):
            return flag
        case ex.Symbol(name=name):
            return name
        case ex.Ref():
            return _reference(expr, scope)
        case ex.Index(base=base, index=index):
            return _member(base, index, scope)
        case ex.Attr(base=base, name=name):
            return _attribute(evaluate(base, scope), name)
        case ex.Point(items=items):
            return _place(tuple(number(item, scope) for item in items))
        case ex.Sequence(items=items):
            return tuple(evaluate(item, scope) for item in items)
        case ex.Range(low=low, high=high):
            return _interval(number(low, scope), number(high, scope))
        case ex.Call():
            return _call(expr, scope)
        case ex.Unary(operator=operator, operand=operand):
            return -number(operand, scope) if operator == "-" else not flag_of(operand, scope)
        case ex.Binary():
            return _binary(expr, scope)
        case ex.Aggregate(function=function):
            raise MissionError(f"'{function}(…)' over a group needs a running mission")
        case ex.Quantified(quantifier=quantifier):
            raise MissionError(f"'{quantifier}' needs a running mission and cannot stand in a declaration")
        case ex.Draw(distribution=distribution):
            raise MissionError(f"'~ {distribution}(…)' must be the whole value of a property")
        case _:
            assert_never(expr)


def number(expr: ex.Expr, scope: Scope) -> float:
    """The expression's value as a finite number."""
    value = evaluate(expr, scope)
    if isinstance(value, bool) or not isinstance(value, float):
        raise MissionError(f"a number is due here, this is {describe(value)}")
    if not math.isfinite(value):
        raise MissionError(f"a finite number is due here, this is {value}")
    return value


def whole(expr: ex.Expr, scope: Scope) -> int:
    """The expression's value as a whole number."""
    value = number(expr, scope)
    if value != round(value):
        raise MissionError(f"a whole number is due here, this is {value:g}")
    return round(value)


def flag_of(expr: ex.Expr, scope: Scope) -> bool:
    """The expression's value as true or false."""
    value = evaluate(expr, scope)
    if not isinstance(value, bool):
        raise MissionError(f"true or false is due here, this is {describe(value)}")
    return value


def area(expr: ex.Expr, scope: Scope) -> Area:
    """The expression's value as a region."""
    value = evaluate(expr, scope)
    if not isinstance(value, Area):
        raise MissionError(f"a region is due here, this is {describe(value)}")
    return value


def members(expr: ex.Expr, scope: Scope) -> tuple[str, ...]:
    """The ids of the entities the expression names."""
    value = evaluate(expr, scope)
    if not isinstance(value, Members):
        raise MissionError(f"an asset or a target is due here, this is {describe(value)}")
    return value.ids


def describe(value: Value) -> str:
    """A value in words, for messages."""
    match value:
        case bool():
            return "true" if value else "false"
        case float():
            return f"the number {value:g}"
        case str():
            return f"the word '{value}'"
        case Place():
            return "a point"
        case Interval():
            return "a range"
        case Area():
            return "a region"
        case Members(ids=ids):
            return " and ".join(ids) or "an empty group"
        case _:
            return "a list"


def _reference(ref: ex.Ref, scope: Scope) -> Value:
    match ref.kind:
        case "param" if ref.name in scope.parameters:
            return scope.parameters[ref.name]
        case "local" if ref.name in scope.names:
            return scope.names[ref.name]
        case "region" if ref.name in scope.areas:
            return scope.areas[ref.name]
        case "group" | "entity" if ref.name in scope.members:
            return Members(scope.members[ref.name])
        case "mode":
            return scope.mode if ref.name == "mode" else ref.name
        case "clock":
            return scope.tick_s
        case "role" | "grid":
            return ref.name
    raise MissionError(f"there is no {ref.kind} '{ref.name}' here", hint=f"declare '{ref.name}' or check its guard")


def _member(base: ex.Expr, index: ex.Expr, scope: Scope) -> Value:
    whole_group, position = evaluate(base, scope), whole(index, scope)
    match whole_group:
        case Members(ids=ids):
            if 1 <= position <= len(ids):
                return Members((ids[position - 1],))
            raise MissionError(f"member {position} is asked for, there are {len(ids)}: {describe(whole_group)}")
        case tuple() if 1 <= position <= len(whole_group):
            return whole_group[position - 1]
        case tuple():
            raise MissionError(f"item {position} is asked for, the list has {len(whole_group)}")
    raise MissionError(f"{describe(whole_group)} has no members to count")


def _attribute(value: Value, name: str) -> Value:
    match value, name:
        case Place(east=east), "east" | "x":
            return east
        case Place(north=north), "north" | "y":
            return north
        case Place(elevation=float() as elevation), "elevation" | "z":
            return elevation
        case Area(polygon=polygon), "centre":
            return Place(*geometry2d.centroid(polygon))
        case Area(polygon=polygon), "area":
            return abs(geometry2d.signed_area(polygon))
        case Interval(low=low), "low":
            return low
        case Interval(high=high), "high":
            return high
    raise MissionError(f"{describe(value)} has no '{name}' before the mission runs")


def _place(items: tuple[float, ...]) -> Place:
    match items:
        case (east, north):
            return Place(east, north)
        case (east, north, elevation):
            return Place(east, north, elevation)
    raise MissionError(f"a point has 2 or 3 components, this has {len(items)}")


def _interval(low: float, high: float) -> Interval:
    if low > high:
        raise MissionError(f"the range {low:g}..{high:g} is empty", hint="write the lower end first")
    return Interval(low, high)


# -- operators ------------------------------------------------------------------------------------------------------

_OPERATIONS: dict[str, Callable[[float, float], float]] = {
    "+": lambda a, b: a + b,
    "-": lambda a, b: a - b,
    "*": lambda a, b: a * b,
    "/": lambda a, b: a / b,
}
_ORDER: dict[str, Callable[[float, float], bool]] = {
    "<": lambda a, b: a < b,
    "<=": lambda a, b: a <= b,
    ">": lambda a, b: a > b,
    ">=": lambda a, b: a >= b,
}


def _binary(expr: ex.Binary, scope: Scope) -> Value:
    match expr.operator:
        case "and":
            return flag_of(expr.left, scope) and flag_of(expr.right, scope)
        case "or":
            return flag_of(expr.left, scope) or flag_of(expr.right, scope)
        case "==":
            return evaluate(expr.left, scope) == evaluate(expr.right, scope)
        case "!=":
            return evaluate(expr.left, scope) != evaluate(expr.right, scope)
        case "in":
            return _membership(evaluate(expr.left, scope), evaluate(expr.right, scope))
        case "<" | "<=" | ">" | ">=":
            return _ORDER[expr.operator](number(expr.left, scope), number(expr.right, scope))
        case _:
            return _arithmetic(expr.operator, evaluate(expr.left, scope), evaluate(expr.right, scope))


def _membership(item: Value, whole_value: Value) -> bool:
    match item, whole_value:
        case float(), Interval(low=low, high=high):
            return low <= item <= high
        case Place(east=east, north=north), Area(polygon=polygon):
            return geometry2d.contains(polygon, east, north)
        case _, tuple():
            return item in whole_value
    raise MissionError(f"{describe(item)} cannot be in {describe(whole_value)}")


def _arithmetic(operator: str, left: Value, right: Value) -> Value:
    match left, right:
        case (bool(), _) | (_, bool()):
            pass
        case float(), float():
            return _numbers(operator, left, right)
        case Place(), Place() if operator in "+-":
            return _places(1.0 if operator == "+" else -1.0, left, right)
    raise MissionError(f"'{operator}' does not apply to {describe(left)} and {describe(right)}")


def _numbers(operator: str, left: float, right: float) -> float:
    if operator == "/" and right == 0:
        raise MissionError("division by zero")
    value = _OPERATIONS[operator](left, right)
    if not abs(value) <= LARGEST:
        raise MissionError(
            f"{left:g} {operator} {right:g} is too large", hint=f"numbers go up to {LARGEST:g} in SI units"
        )
    return value


def _places(sign: float, left: Place, right: Place) -> Place:
    heights = left.elevation, right.elevation
    up = None if heights == (None, None) else (heights[0] or 0.0) + sign * (heights[1] or 0.0)
    return Place(left.east + sign * right.east, left.north + sign * right.north, up)


# -- functions ------------------------------------------------------------------------------------------------------


def _call(call: ex.Call, scope: Scope) -> Value:
    if call.function in ("road", "along"):
        raise MissionError(
            f"where '{call.function}(…)' lies is known only once the city is built",
            hint="draw from a polygon; what stands `on = road` is moved to the nearest one",
        )
    if call.rule or call.function not in _FUNCTIONS:
        raise MissionError(f"'{call.function}(…)' needs a running mission and cannot stand in a declaration")
    return _FUNCTIONS[call.function](call, scope)


def _arguments(call: ex.Call, scope: Scope, count: int) -> tuple[Value, ...]:
    if len(call.arguments) != count:
        raise MissionError(f"{call.function}(…) takes {count} arguments, {len(call.arguments)} are given")
    return tuple(evaluate(argument, scope) for argument in call.arguments)


def _polygon(call: ex.Call, scope: Scope) -> Value:
    corners = [evaluate(argument, scope) for argument in call.arguments]
    if len(corners) == 1 and isinstance(corners[0], tuple):
        corners = list(corners[0])
    outline: list[geometry2d.Point] = []
    for corner in corners:
        if not isinstance(corner, Place):
            raise MissionError(f"a polygon's corner is a point, this is {describe(corner)}")
        outline.append((corner.east, corner.north))
    return _checked(tuple(outline))


def _circle(call: ex.Call, scope: Scope) -> Value:
    centre, reach = _arguments(call, scope, 2)
    match located(centre, scope), reach:
        case (Place(east=east, north=north), float() as radius) if radius > 0:
            return _checked(geometry2d.circle((east, north), radius))
    raise MissionError("circle(centre, radius) takes a point and a length above 0")


def _box(call: ex.Call, scope: Scope) -> Value:
    match tuple(located(corner, scope) for corner in _arguments(call, scope, 2)):
        case (Place() as one, Place() as other):
            return _checked(geometry2d.rectangle((one.east, one.north), (other.east, other.north)))
    raise MissionError("box(corner, corner) takes two points")


def located(value: Value, scope: Scope) -> Value:
    """An entity as the place where it stands; anything else as it is."""
    if isinstance(value, Members) and len(value.ids) == 1 and value.ids[0] in scope.places:
        return scope.places[value.ids[0]]
    return value


def _buffer(call: ex.Call, scope: Scope) -> Value:
    shape, reach = _arguments(call, scope, 2)
    if not isinstance(reach, float):
        raise MissionError("buffer(shape, distance) takes a length")
    if isinstance(shape, Area):
        return _checked(geometry2d.buffered(shape.polygon, reach, closed=True))
    points = tuple(point for point in shape if isinstance(point, Place)) if isinstance(shape, tuple) else ()
    if len(points) < 2 or reach <= 0:
        raise MissionError("buffer(line, distance) takes two and more points and a length above 0")
    return _checked(geometry2d.buffered(tuple((p.east, p.north) for p in points), reach, closed=False))


def _union(call: ex.Call, scope: Scope) -> Value:
    return _checked(geometry2d.united(tuple(area(argument, scope).polygon for argument in call.arguments)))


def _checked(outline: geometry2d.Polygon) -> Area:
    fault = geometry2d.fault(outline)
    if fault:
        raise MissionError(f"the outline {fault}", hint="list the corners in order around the area")
    return Area(geometry2d.normalised(outline))


def _at(call: ex.Call, scope: Scope) -> Value:
    """`at(i, [values], spread d)`: the i-th value; beyond the list they are `rest`, points spread, others repeat."""
    if len(call.arguments) != 2:
        raise MissionError(f"at(…) takes an index and a list, {len(call.arguments)} arguments are given")
    position, listed = whole(call.arguments[0], scope), call.arguments[1]
    if position < 1:
        raise MissionError(f"at(…) counts from 1, this is {position}")
    if isinstance(listed, ex.Sequence) and position <= len(listed.items):  # the one item alone: linear in members
        return evaluate(listed.items[position - 1], scope)
    values = evaluate(listed, scope)
    if not isinstance(values, tuple) or not values:
        raise MissionError("at(index, [values]) needs a list with something in it")
    if position <= len(values):
        return values[position - 1]
    rest = dict(call.named).get("rest")
    if rest is not None:
        return evaluate(rest, scope)
    places = tuple(value for value in values if isinstance(value, Place))
    if len(places) < len(values):
        return values[(position - 1) % len(values)]
    spread = dict(call.named).get("spread")
    if spread is None:
        raise MissionError(
            f"member {position} has no place: the list has {len(values)}",
            hint="add points to the list, or say how far apart further members stand: at(i, […], spread 8 m)",
        )
    return further_place(places, number(spread, scope), position)


def further_place(places: tuple[Place, ...], spread: float, position: int) -> Place:
    """Member `position` (from 1) of a group that outgrew its list of places.

    Further members stand on rings of radius spread, 2 spread, … about the listed places in turn, six on the first
    ring, twelve on the second, each at least `spread` from every earlier one; millimetre steps. The members of a
    smaller group are the first of a larger one.
    """
    if not spread > 0:
        raise MissionError(f"spread = {spread:g} m leaves no room between members", hint="give a length above 0")
    return _ringed(places, spread, 1 << (position - 1).bit_length())[position - 1]


@lru_cache(maxsize=64)
def _ringed(places: tuple[Place, ...], spread: float, count: int) -> tuple[Place, ...]:
    taken = list(places)
    spacing = Spacing(spread - 1e-3, max(max(abs(p.east), abs(p.north)) for p in places))
    for place in places:
        spacing.add(place.east, place.north)
    ring = 0
    while len(taken) < count:
        ring += 1
        for step in range(6 * ring):
            angle = 2.0 * math.pi * step / (6 * ring)
            for base in places:
                east = round(base.east + ring * spread * math.cos(angle), 3)
                north = round(base.north + ring * spread * math.sin(angle), 3)
                if spacing.is_free(east, north):
                    spacing.add(east, north)
                    taken.append(Place(east, north, base.elevation))
    return tuple(taken)


def _numeric(function: Callable[..., float], least: int, most: int) -> Callable[[ex.Call, Scope], Value]:
    def apply(call: ex.Call, scope: Scope) -> Value:
        if not least <= len(call.arguments) <= most:
            raise MissionError(f"{call.function}(…) takes {least} to {most} numbers, {len(call.arguments)} are given")
        values = [number(argument, scope) for argument in call.arguments]
        try:
            return float(function(*values))
        except (ValueError, OverflowError) as error:
            raise MissionError(f"{call.function}({', '.join(f'{v:g}' for v in values)}) has no value") from error

    return apply


def _distance(call: ex.Call, scope: Scope) -> Value:
    match _arguments(call, scope, 2):
        case (Place() as one, Place() as other):
            up = 0.0 if call.function == "distance_xy" else (one.elevation or 0.0) - (other.elevation or 0.0)
            return math.hypot(one.east - other.east, one.north - other.north, up)
    raise MissionError(f"{call.function}(…) of points only, before the mission runs")


_FUNCTIONS: dict[str, Callable[[ex.Call, Scope], Value]] = {
    "at": _at,
    "polygon": _polygon,
    "circle": _circle,
    "box": _box,
    "buffer": _buffer,
    "union": _union,
    "distance": _distance,
    "distance_xy": _distance,
    "min": _numeric(min, 2, 64),
    "max": _numeric(max, 2, 64),
    "abs": _numeric(abs, 1, 1),
    "sqrt": _numeric(math.sqrt, 1, 1),
    "floor": _numeric(math.floor, 1, 1),
    "ceil": _numeric(math.ceil, 1, 1),
    "round": _numeric(round, 1, 1),
}
