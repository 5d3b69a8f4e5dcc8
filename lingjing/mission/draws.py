"""Seeded draws: `~ uniform(a, b)`, `normal(mean, deviation)`, `choice([…])`, `sites(region)`, `sites_along(line)`, ….

`draw` gives the values of one property for all members of a group. Member *k* gets the same value in a smaller and in a
larger group: numbers are taken in order from one stream, and sites are drawn one after the other. The exception is a
draw with `apart` that leaves no room for a later member: the whole group is then drawn anew, and `Drawn.anew` says so.
Places are rounded to a millimetre, so that every text form of a mission can hold them exactly.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

from lingjing.errors import MissionError
from lingjing.mission import expression as ex
from lingjing.mission import geometry2d
from lingjing.mission.evaluate import Area, Interval, Place, Scope, Value, area, describe, evaluate, number
from lingjing.mission.seeding import Stream
from lingjing.mission.spacing import Spacing
from lingjing.sums import total

_SITE_TRIES = 2_000
"""Random points tried for one site before the attempt is given up (chosen)."""
_SITE_ATTEMPTS = 8
"""Independent attempts at a whole group; the first complete one is used (chosen)."""
_NORMAL_TRIES = 1_000
"""Draws from a bounded normal distribution before an error is reported (chosen)."""


class Drawn(NamedTuple):
    """The values of one property for the members of a group."""

    values: tuple[Value, ...]
    """One value for each member, in order."""
    anew: bool = False
    """True if the first attempt left no room for a later member and the group was drawn anew. Its values may then
    differ from those of a group of another size."""


def draw(expr: ex.Draw, scope: Scope, *, seed: int, path: str, count: int) -> Drawn:
    """The values of `count` members of a group for the property at `path` (`ssr/victim/position`).

    Raises `MissionError` if the distribution is unknown or cannot give these values.
    """
    if expr.distribution not in _DISTRIBUTIONS:
        known = ", ".join(_DISTRIBUTIONS)
        raise MissionError(f"there is no distribution '{expr.distribution}'", hint=f"draw from one of {known}")
    return _DISTRIBUTIONS[expr.distribution](expr, scope, seed, path, count)


def crowding(expr: ex.Draw, scope: Scope, count: int) -> float:
    """The share of its room that the places of a group need: their number times `apart` squared by the area of the
    region, or times `apart` by the length of the line. 0 if the draw has no `apart`, and 1 for places of a list.

    Darts at random fill a large region up to a share of 0.7 (the jamming limit of discs, 0.547, by π/4), and a line up
    to 0.75 (Rényi's constant). Raises `MissionError` if the draw cannot be evaluated.
    """
    if count < 2:
        return 0.0
    apart = next((number(value, scope) for name, value in expr.named if name == "apart"), 0.0)
    if apart <= 0.0:
        return 0.0
    if expr.distribution == "sites":
        return count * apart**2 / max(abs(geometry2d.signed_area(area(_one(expr), scope).polygon)), 1e-9)
    if expr.distribution == "sites_along":
        return count * apart / max(total(math.dist(a, b) for a, b in itertools.pairwise(line_of(expr, scope))), 1e-9)
    return 1.0


def redrawn_in_words(redrawn: Sequence[str]) -> tuple[str, ...]:
    """A line for a summary about the draws of `Instance.redrawn`; none if there are none."""
    if not redrawn:
        return ()
    names = ", ".join(f"`{name}`" for name in redrawn)
    groups = "with the same seed a group of another size has other values"
    return (f"drawn anew, because the first draw left no room for a later member: {names}; {groups}",)


def outline(expr: ex.Expr, scope: Scope) -> geometry2d.Polygon:
    """The polygon from which `sites(…)` draws; empty for any other expression."""
    if not isinstance(expr, ex.Draw) or expr.distribution != "sites":
        return ()
    return area(_one(expr), scope).polygon


def sites(
    polygon: geometry2d.Polygon, apart: float, *, seed: int, path: str, count: int, clear: float = 0.0
) -> tuple[tuple[geometry2d.Vector2, ...], bool]:
    """`count` places in the polygon, uniform and pairwise at least `apart` metres apart; and true if drawn anew.

    Sequential dart throwing: a point outside the polygon, nearer than `clear` metres to its edge, or too near to an
    earlier place is drawn again. A failed attempt is followed by one on a stream of its own; only then the places of a
    larger group may differ from those of a smaller one. Raises `MissionError` if all attempts fail.
    """
    best = 0
    for attempt in range(_SITE_ATTEMPTS):
        stream = Stream(seed, path if attempt == 0 else f"{path}#{attempt}")
        placed = _throw(polygon, apart, clear, stream, count)
        if len(placed) == count:
            return tuple(placed), attempt > 0
        best = max(best, len(placed))
    extent = abs(geometry2d.signed_area(polygon)) / 10_000.0
    raise MissionError(
        f"{count} places at least {apart:g} m apart do not fit into {extent:.3g} ha: "
        f"{best} fitted at best in {_SITE_ATTEMPTS} attempts of {_SITE_TRIES} tries a place",
        hint="lower 'apart', declare fewer members or widen the region",
    )


def _throw(
    polygon: geometry2d.Polygon, apart: float, clear: float, stream: Stream, count: int
) -> list[geometry2d.Vector2]:
    west, south, east, north = geometry2d.bounds(polygon)
    placed: list[geometry2d.Vector2] = []
    spacing = Spacing(apart, max(abs(west), abs(south), abs(east), abs(north)))
    for _ in range(count):
        for _ in range(_SITE_TRIES):
            dart = round(stream.uniform(west, east), 3), round(stream.uniform(south, north), 3)
            if _lies_in(dart, polygon, clear) and spacing.is_free(*dart):
                placed.append(dart)
                spacing.add(*dart)
                break
        else:
            break
    return placed


def _lies_in(dart: geometry2d.Vector2, polygon: geometry2d.Polygon, clear: float) -> bool:
    if not geometry2d.contains(polygon, *dart):
        return False
    return clear <= 0 or geometry2d.edge_distance(polygon, *dart) >= clear


def _sites(expr: ex.Draw, scope: Scope, seed: int, path: str, count: int) -> Drawn:
    named = _named(expr, scope, ("apart", "clear"))
    region = area(_one(expr), scope)
    apart, clear = named.get("apart", 0.0), named.get("clear", 0.0)
    places, anew = sites(region.polygon, apart, seed=seed, path=path, count=count, clear=clear)
    return Drawn(tuple(Place(east, north) for east, north in places), anew)


def _sites_along(expr: ex.Draw, scope: Scope, seed: int, path: str, count: int) -> Drawn:
    named = _named(expr, scope, ("apart", "clear"))
    line, clear = line_of(expr, scope), named.get("clear", 0.0)
    length = total(math.dist(a, b) for a, b in itertools.pairwise(line))
    if length <= 2.0 * clear:
        message = f"no place on a line of {length:g} m is {clear:g} m from both of its ends"
        raise MissionError(message, hint="lower 'clear', or lengthen the line")
    best = 0
    for attempt in range(_SITE_ATTEMPTS):
        stream = Stream(seed, path if attempt == 0 else f"{path}#{attempt}")
        placed = _throw_along(line, length, clear, named.get("apart", 0.0), stream, count)
        if len(placed) == count:
            return Drawn(tuple(Place(east, north) for east, north in placed), attempt > 0)
        best = max(best, len(placed))
    raise MissionError(
        f"{count} places at least {named['apart']:g} m apart do not fit on a line of {length:g} m: {best} fitted",
        hint="lower 'apart', declare fewer members or lengthen the line",
    )


def line_of(expr: ex.Draw, scope: Scope) -> tuple[geometry2d.Vector2, ...]:
    """The line from which `sites_along(…)` draws. Raises `MissionError` if it has fewer than two places."""
    listed = evaluate(_one(expr), scope)
    places = listed if isinstance(listed, tuple) else ()
    line = tuple((item.east, item.north) for item in places if isinstance(item, Place))
    if len(line) < 2 or len(line) != len(places):
        raise MissionError("sites_along(…) needs a list of at least two positions", hint="[(0 m, 0 m), (90 m, 0 m)]")
    return line


def _throw_along(
    line: Sequence[geometry2d.Vector2], length: float, clear: float, apart: float, stream: Stream, count: int
) -> list[geometry2d.Vector2]:
    placed: list[geometry2d.Vector2] = []
    spacing = Spacing(apart, max(abs(number) for place in line for number in place))
    for _ in range(count):
        for _ in range(_SITE_TRIES):
            dart = _at(line, stream.uniform(clear, length - clear))
            if spacing.is_free(*dart):
                placed.append(dart)
                spacing.add(*dart)
                break
        else:
            break
    return placed


def _at(line: Sequence[geometry2d.Vector2], metres: float) -> geometry2d.Vector2:
    """The place on a line that far from its beginning, rounded to a millimetre."""
    for start, end in itertools.pairwise(line):
        step = math.dist(start, end)
        if metres <= step and step > 0.0:
            share = metres / step
            east, north = start[0] + share * (end[0] - start[0]), start[1] + share * (end[1] - start[1])
            return round(east, 3), round(north, 3)
        metres -= step
    return round(line[-1][0], 3), round(line[-1][1], 3)


def _uniform(expr: ex.Draw, scope: Scope, seed: int, path: str, count: int) -> Drawn:
    _named(expr, scope, ())
    low, high = _pair(expr, scope)
    if low > high:
        raise MissionError(f"uniform({low:g}, {high:g}) is empty", hint="write the lower end first")
    stream = Stream(seed, path)
    return Drawn(tuple(stream.uniform(low, high) for _ in range(count)))


def _integer(expr: ex.Draw, scope: Scope, seed: int, path: str, count: int) -> Drawn:
    _named(expr, scope, ())
    low, high = _pair(expr, scope)
    if low != int(low) or high != int(high) or low > high:
        raise MissionError(
            f"integer({low:g}, {high:g}) has no whole number", hint="write two whole numbers, the lower first"
        )
    stream = Stream(seed, path)
    return Drawn(tuple(low + stream.below(int(high - low) + 1) for _ in range(count)))


def _normal(expr: ex.Draw, scope: Scope, seed: int, path: str, count: int) -> Drawn:
    named = _named(expr, scope, ("low", "high"))
    low, high = named.get("low", -math.inf), named.get("high", math.inf)
    mean, deviation = _pair(expr, scope)
    if deviation < 0:
        raise MissionError(f"normal(…) has a deviation of {deviation:g}", hint="give a deviation of 0 or more")
    stream = Stream(seed, path)
    return Drawn(tuple(_bounded(stream, mean, deviation, low, high) for _ in range(count)))


def _bounded(stream: Stream, mean: float, deviation: float, low: float, high: float) -> float:
    for _ in range(_NORMAL_TRIES):
        value = stream.normal(mean, deviation)
        if low <= value <= high:
            return value
    raise MissionError(
        f"normal({mean:g}, {deviation:g}) did not fall into {low:g}..{high:g} in {_NORMAL_TRIES} tries",
        hint="move the mean into the bounds or widen them",
    )


def _choice(expr: ex.Draw, scope: Scope, seed: int, path: str, count: int) -> Drawn:
    _named(expr, scope, ())
    values = _list(expr, scope)
    stream = Stream(seed, path)
    return Drawn(tuple(values[stream.below(len(values))] for _ in range(count)))


def _subset(expr: ex.Draw, scope: Scope, seed: int, path: str, count: int) -> Drawn:
    apart = _named(expr, scope, ("apart",)).get("apart", 0.0)
    values = list(_list(expr, scope))
    if count > len(values):
        raise MissionError(
            f"{count} different items cannot be drawn from a list of {len(values)}",
            hint="lengthen the list, declare fewer members, or draw with choice(…), which may repeat",
        )
    if apart <= 0:
        stream = Stream(seed, path)
        return Drawn(tuple(values.pop(stream.below(len(values))) for _ in range(count)))
    for attempt in range(_SITE_ATTEMPTS):
        stream = Stream(seed, path if attempt == 0 else f"{path}#{attempt}")
        picked = _picked(values, apart, stream, count)
        if len(picked) == count:
            return Drawn(picked, attempt > 0)
    raise MissionError(
        f"{count} of the {len(values)} places cannot be at least {apart:g} m apart ({_SITE_ATTEMPTS} attempts)",
        hint="lower 'apart', declare fewer members or lengthen the list",
    )


def _picked(values: Sequence[Value], apart: float, stream: Stream, count: int) -> tuple[Value, ...]:
    """Items of the list one after the other, each far enough from the earlier ones; fewer than `count` if none fits."""
    remaining = list(values)
    picked: list[Place] = []
    while remaining and len(picked) < count:
        item = remaining.pop(stream.below(len(remaining)))
        if not isinstance(item, Place):
            raise MissionError(f"'apart' applies to places, not to {describe(item)}")
        if all(math.hypot(item.east - p.east, item.north - p.north) >= apart for p in picked):
            picked.append(item)
    return tuple(picked)


def _one(expr: ex.Draw) -> ex.Expr:
    if len(expr.arguments) != 1:
        raise MissionError(f"{expr.distribution}(…) takes one argument, not {len(expr.arguments)}")
    return expr.arguments[0]


def _list(expr: ex.Draw, scope: Scope) -> tuple[Value, ...]:
    values = tuple(evaluate(argument, scope) for argument in expr.arguments)
    if len(values) == 1 and isinstance(values[0], tuple):
        values = values[0]
    if not values or isinstance(values[0], Area):
        raise MissionError(f"{expr.distribution}(…) needs a list with something in it")
    return values


def _pair(expr: ex.Draw, scope: Scope) -> tuple[float, float]:
    if len(expr.arguments) == 1:
        value = evaluate(expr.arguments[0], scope)
        if isinstance(value, Interval):
            return value.low, value.high
        raise MissionError(f"{expr.distribution}(…) takes two numbers, not {describe(value)}")
    if len(expr.arguments) != 2:
        raise MissionError(f"{expr.distribution}(…) takes two numbers, not {len(expr.arguments)}")
    return number(expr.arguments[0], scope), number(expr.arguments[1], scope)


def _named(expr: ex.Draw, scope: Scope, allowed: tuple[str, ...]) -> dict[str, float]:
    for name, _ in expr.named:
        if name not in allowed:
            raise MissionError(
                f"{expr.distribution}(…) has no option '{name}'", hint=f"its options: {', '.join(allowed) or 'none'}"
            )
    return {name: number(value, scope) for name, value in expr.named}


_DISTRIBUTIONS: dict[str, Callable[[ex.Draw, Scope, int, str, int], Drawn]] = {
    "sites": _sites,
    "sites_along": _sites_along,
    "uniform": _uniform,
    "integer": _integer,
    "normal": _normal,
    "choice": _choice,
    "subset": _subset,
}
