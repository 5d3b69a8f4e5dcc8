"""The found places, written into a mission."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from functools import reduce
from typing import Any, TypeVar

import msgspec

from lingjing.mission import expression as ex
from lingjing.mission.geometry2d import Vector2
from lingjing.mission.instance import Vector
from lingjing.mission.model import Group, Mission, Property, Record, RegionDeclaration, Requirement, Scene
from lingjing.scene.siting.layout import point

R = TypeVar("R")

SAME_PLACE_M = 1.0
"""Distance in metres within which a drawn place is a listed one (chosen: listed ones are 90 m apart)."""
_DECIMALS = 2
"""Decimals of written places (chosen: a centimetre)."""


@dataclass(frozen=True, slots=True)
class Placement:
    """The places of a mission in a city."""

    shift: Callable[[Vector2], Vector2]
    """Place of the mission → place in the city, for every place that the fields below do not name."""
    regions: Mapping[str, tuple[Vector2, ...]] = field(default_factory=dict)
    """Region → outline."""
    lines: Mapping[tuple[Vector2 | None, ...], tuple[Vector2, ...]] = field(default_factory=dict)
    """Line of the mission → line in the city, wherever the mission writes it."""
    along: float = 1.0
    """Length of a found line relative to the mission's; distances of draws along it shrink alike."""
    across: float = 1.0
    """Size of the district relative to the mission's; the least distances between drawn places shrink alike, so that as
    many fit into it."""
    places: Mapping[str, tuple[Vector2 | Vector, ...]] = field(default_factory=dict)
    """Group → the places of its members, or the places that they are drawn from. With three numbers, the last is the
    elevation."""
    listed: Mapping[str, tuple[Vector2, ...]] = field(default_factory=dict)
    """Group → the places from which its members are drawn where the mission draws them along a line."""
    pairs: Mapping[str, tuple[tuple[Vector2, Vector2], ...]] = field(default_factory=dict)
    """Group of `listed` → pairs of these places. Of one member, the place is the first one of a pair; of more, two have
    the places of a pair. This replaces the mission's own requirements on places of the group."""
    headings_deg: Mapping[str, tuple[float, ...]] = field(default_factory=dict)
    """Group → the headings of its members."""


def rewritten(mission: Mission, placement: Placement, scene: Scene) -> Mission:
    """Return the mission with these places and this scene."""
    moved = _Moving(placement)
    groups = tuple(moved.group(group) for group in mission.groups)
    regions = tuple(moved.region(region) for region in mission.regions)
    rest = {
        name: moved.everywhere(getattr(mission, name))
        for name in mission.__struct_fields__
        if name not in ("groups", "regions", "scene", "requirements")
    }
    requirements = (
        *(moved.everywhere(each) for each in mission.requirements if not _places_any(each, placement.pairs)),
        *(each for name, pairs in placement.pairs.items() for each in _required(mission, name, pairs)),
    )
    return msgspec.structs.replace(
        mission, **{**rest, "groups": groups, "regions": regions, "scene": scene, "requirements": requirements}
    )


def number(value: float, unit: str = "m") -> ex.Number:
    """A quantity, rounded."""
    return ex.Number(value=round(value, _DECIMALS), unit=unit)


# -- private


def _places_any(requirement: Requirement, groups: Collection[str]) -> bool:
    """True for a requirement on the written places of a group."""
    parts = tuple(ex.parts(requirement.condition))
    names = {part.domain for part in parts if isinstance(part, ex.Quantified | ex.Aggregate)}
    names |= {part.name for part in parts if isinstance(part, ex.Ref) and part.kind == "group"}
    return any(isinstance(part, ex.Point) for part in parts) and not names.isdisjoint(groups)


def _required(mission: Mission, name: str, pairs: Sequence[tuple[Vector2, Vector2]]) -> tuple[Requirement, Requirement]:
    """The requirements that the members of a group have the places of a pair, where they are drawn from the list."""
    group = next(group for group in mission.groups if group.name == name)
    always = any(prop.name == "position" and _is_along(prop.value) for prop in group.properties)
    guards = [
        alternative.when.condition
        for alternative in group.alternatives
        if any(prop.name == "position" and _is_along(prop.value) for prop in alternative.properties)
    ]
    drawn: ex.Expr = ex.Flag(value=True) if always else reduce(_or, guards)
    seconds: dict[Vector2, list[Vector2]] = {}
    for first, second in pairs:
        seconds.setdefault(first, []).append(second)
    met = reduce(_or, (_at("_j", place) for place in seconds))
    both = reduce(
        _or,
        (_and(_some(name, _at("_j", first)), _some(name, reduce(_or, (_at("_j", each) for each in rest))))
         for first, rest in seconds.items()),
    )  # fmt: skip
    # An empty group and one of a single member meet the conditions for all of them and for all two of them.
    alone = _within(ex.Ref(name="_i", kind="local"), ex.Ref(name="_k", kind="local"))
    each_two = ex.Quantified("forall", "_i", name, ex.Quantified("forall", "_k", name, _or(alone, both)))
    return (
        Requirement(
            condition=_or(ex.Unary("not", drawn), ex.Quantified("forall", "_i", name, _some(name, met))),
            reason=f"{name} is met on the first route",
        ),
        Requirement(
            condition=_or(ex.Unary("not", drawn), each_two), reason=f"{name} is met on the way around the first one too"
        ),
    )


def _is_along(value: ex.Expr) -> bool:
    return isinstance(value, ex.Draw) and value.distribution == "sites_along"


def _some(group: str, body: ex.Expr) -> ex.Expr:
    return ex.Quantified("exists", "_j", group, body)


def _at(variable: str, place: Vector2) -> ex.Expr:
    return _within(ex.Ref(name=variable, kind="local"), _point(place))


def _within(a: ex.Expr, b: ex.Expr) -> ex.Expr:
    return ex.Binary("<=", ex.Call(function="distance_xy", arguments=(a, b)), number(SAME_PLACE_M))


def _or(a: ex.Expr, b: ex.Expr) -> ex.Expr:
    return ex.Binary("or", a, b)


def _and(a: ex.Expr, b: ex.Expr) -> ex.Expr:
    return ex.Binary("and", a, b)


class _Moving:
    def __init__(self, placement: Placement) -> None:
        self._placement = placement

    def region(self, region: RegionDeclaration) -> RegionDeclaration:
        outline = self._placement.regions.get(region.name)
        if outline is None:
            return self.everywhere(region)
        shape = ex.Call(function="polygon", arguments=tuple(_point(corner) for corner in outline))
        return msgspec.structs.replace(region, shape=shape)

    def group(self, group: Group) -> Group:
        properties = tuple(self._property(group.name, prop) for prop in group.properties)
        alternatives = tuple(
            msgspec.structs.replace(item, properties=tuple(self._property(group.name, p) for p in item.properties))
            for item in group.alternatives
        )
        return msgspec.structs.replace(group, properties=properties, alternatives=alternatives)

    def _property(self, group: str, prop: Property) -> Property:
        if prop.name == "heading_deg" and group in self._placement.headings_deg:
            turned = _headings(prop.value, self._placement.headings_deg[group])
            return msgspec.structs.replace(prop, value=turned)
        if prop.name != "position":
            return prop
        places = self._placement.places.get(group)
        value = prop.value
        listed = self._placement.listed.get(group)
        if listed is not None and isinstance(value, ex.Draw) and value.distribution == "sites_along":
            sequence = ex.Sequence(items=tuple(_point(place) for place in listed))
            value = ex.Draw(distribution="subset", arguments=(sequence,))
        elif places is not None and isinstance(value, ex.Draw) and value.distribution in ("subset", "choice"):
            sequence = ex.Sequence(items=tuple(_point(place) for place in places))
            value = msgspec.structs.replace(value, arguments=(sequence,))
        elif places is not None and not isinstance(value, ex.Draw):
            queue = list(places)
            value = self.expr(value, lambda original: _like(original, queue.pop(0) if len(queue) > 1 else queue[0]))
        else:
            value = self.everywhere(value)
        return msgspec.structs.replace(prop, value=value)

    def everywhere(self, value: R) -> R:
        """The value with every written place moved."""
        moved: R = self.expr(value, self._moved)
        return moved

    def expr(self, value: Any, moved: Callable[[ex.Point], ex.Point]) -> Any:
        if isinstance(value, ex.Point):
            return moved(value)
        if isinstance(value, ex.Draw) and (shrunk := self._shrunk(value)) is not value.named:
            return msgspec.structs.replace(value, arguments=self.expr(value.arguments, moved), named=shrunk)
        if isinstance(value, ex.Sequence) and (line := self._line(value)) is not None:
            return line
        if isinstance(value, tuple):
            return tuple(self.expr(item, moved) for item in value)
        if isinstance(value, Record | ex._Node):
            changed = {name: self.expr(getattr(value, name), moved) for name in value.__struct_fields__}
            same = all(changed[name] is getattr(value, name) for name in changed)
            return value if same else msgspec.structs.replace(value, **changed)
        return value

    def _shrunk(self, draw: ex.Draw) -> tuple[tuple[str, ex.Expr], ...]:
        """The named arguments of a draw with the distances that a smaller district shortens: along routes all of them,
        in regions and among places the distance between two.
        """
        along = draw.distribution == "sites_along"
        share = self._placement.along if along else self._placement.across
        if share >= 1.0 or not (along or draw.distribution in ("sites", "subset")):
            return draw.named
        return tuple(
            (name, _shorter(value, share) if along or name == "apart" else value) for name, value in draw.named
        )

    def _line(self, listed: ex.Sequence) -> ex.Sequence | None:
        written = tuple(point(item) for item in listed.items if isinstance(item, ex.Point))
        line = self._placement.lines.get(written)
        return None if line is None else ex.Sequence(items=tuple(_point(place) for place in line))

    def _moved(self, written: ex.Point) -> ex.Point:
        place = point(written)
        return written if place is None else _like(written, self._placement.shift(place))


def _shorter(distance: ex.Expr, share: float) -> ex.Expr:
    return number(distance.value * share) if isinstance(distance, ex.Number) else distance


def _headings(value: ex.Expr, headings_deg: tuple[float, ...]) -> ex.Expr:
    """The expression with its angles replaced, one after the other."""
    if isinstance(value, ex.Number):
        return number(headings_deg[0], "deg")
    if isinstance(value, ex.Sequence):
        return ex.Sequence(items=tuple(number(angle, "deg") for angle in headings_deg))
    if isinstance(value, ex.Call):
        arguments = tuple(
            _headings(item, headings_deg) if isinstance(item, ex.Sequence) else item for item in value.arguments
        )
        return msgspec.structs.replace(value, arguments=arguments)
    return value


def _point(place: Vector2 | Vector) -> ex.Point:
    return ex.Point(items=tuple(number(value) for value in place))


def _like(written: ex.Point, place: Vector2 | Vector) -> ex.Point:
    """A place with the elevation of the written one, unless it has its own."""
    if len(place) == 3:
        return _point(place)
    return ex.Point(items=(*_point(place).items, *written.items[2:]))
