"""Requirements: conditions that the draws of a seed must meet, `require distance_xy(a, b) >= 100 m because "…"`.

A requirement reads declared places and properties, params and the sizes of groups. `Requirements.unmet` finds the first
one that drawn members do not meet, and `repeated_draws` the draws that it depends on, which are then drawn anew (ADR
0042). If it reads a hidden value, the hidden draws alone are repeated: a public value that was drawn anew would tell
something about the hidden one (ADR 0045).
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from collections.abc import Set as AbstractSet
from functools import lru_cache
from typing import NamedTuple

from lingjing.errors import MissionError
from lingjing.mission import expression as ex
from lingjing.mission import model, operations
from lingjing.mission.alternatives import Identity
from lingjing.mission.evaluate import Members, Place, Scope, Value
from lingjing.mission.fold import Composite, Literal, Meaning, meaning
from lingjing.mission.functions import operation
from lingjing.mission.instance import Entity
from lingjing.mission.values import as_flag, as_whole, is_number


class Requirements:
    """The requirements of a mission, compiled at their first use."""

    def __init__(self, mission: model.Mission) -> None:
        self._mission = mission
        self._meanings: dict[int, Meaning] = {}
        self._repeated: dict[int, RepeatedDraws] = {}

    def unmet(self, members: Iterable[Entity], scope: Scope) -> model.Requirement | None:
        """The first requirement that drawn members do not meet; None if they meet all. `scope` has the params, the mode
        and the regions.

        Raises `MissionError` for a requirement without a value.
        """
        world = _Draws(members, scope)
        for place, requirement in enumerate(self._mission.requirements):
            if place not in self._meanings:
                self._meanings[place] = meaning(requirement.condition, _SEMANTICS)
            if not as_flag(self._meanings[place]({}, world)):
                return requirement
        return None

    def repeated_draws(self, requirement: model.Requirement) -> RepeatedDraws:
        """The draws that are repeated until a requirement of the mission holds."""
        if id(requirement) not in self._repeated:
            self._repeated[id(requirement)] = repeated_draws(self._mission, requirement.condition)
        return self._repeated[id(requirement)]


def requirements_of(mission: model.Mission) -> Requirements:
    """The requirements of a mission, compiled once for all of its instances."""
    return _requirements(Identity(mission))


@lru_cache(8)  # a check makes a dozen instances and more of one mission
def _requirements(key: Identity) -> Requirements:
    return Requirements(key.mission)


class RepeatedDraws(NamedTuple):
    """The draws that are repeated until a requirement holds."""

    names: frozenset[str]
    """The groups and params that have them."""
    hidden: str
    """A hidden value that the requirement reads; "" for none."""
    hidden_only: bool
    """True if only the hidden values of these groups and params are drawn anew."""


def repeated_draws(mission: model.Mission, condition: ex.Expr) -> RepeatedDraws:
    """The draws on which a condition depends, directly or through other declarations."""
    hidden = next(_hidden_reads(mission, condition), "")
    names = depended(mission, (condition,))
    secret = frozenset(name for name in names if hidden and _draws(mission, name, hidden_only=True))
    return RepeatedDraws(secret or frozenset(n for n in names if _draws(mission, n)), hidden, bool(secret))


def is_decided(mission: model.Mission, condition: ex.Expr, placed: AbstractSet[str]) -> bool:
    """True if a condition depends on a group with placed members and on nothing that is drawn: it restricts no draw."""
    return not placed.isdisjoint(depended(mission, (condition,))) and not repeated_draws(mission, condition).names


def depended(mission: model.Mission, conditions: Iterable[ex.Expr]) -> frozenset[str]:
    """The names of all params, regions and groups on which conditions depend, directly or through others."""
    values = {param.name: (param.default,) for param in mission.parameters}
    values |= {region.name: (region.shape,) for region in mission.regions}
    for group in mission.groups:
        counts = () if group.count is None else (group.count,)
        values[group.name] = (*counts, *(prop.value for prop in group.properties))
    reached: set[str] = set()
    queue = [name for condition in conditions for name in _referred(condition)]
    while queue:
        name = queue.pop()
        if name in values and name not in reached:
            reached.add(name)
            queue.extend(other for value in values[name] for other in _referred(value))
    return frozenset(reached)


def _draws(mission: model.Mission, name: str, *, hidden_only: bool = False) -> bool:
    """True if a param or a property of a group is drawn."""
    declared: Iterator[model.Parameter | model.Property] = itertools.chain(
        (param for param in mission.parameters if param.name == name),
        (prop for group in mission.groups if group.name == name for prop in group.properties),
    )
    drawn = ((each.default if isinstance(each, model.Parameter) else each.value, each.hidden) for each in declared)
    return any(isinstance(value, ex.Draw) and (hidden or not hidden_only) for value, hidden in drawn)


def _hidden_reads(mission: model.Mission, condition: ex.Expr) -> Iterator[str]:
    """The hidden values that a condition reads: `victim.position`, or the name of a param, region or group."""
    domains = {
        part.variable: part.domain for part in ex.parts(condition) if isinstance(part, ex.Quantified | ex.Aggregate)
    }
    hidden = {param.name for param in mission.parameters if param.hidden}
    hidden |= {region.name for region in mission.regions if region.hidden}
    hidden |= {group.name for group in mission.groups if group.hides_count}
    properties = {(group.name, prop.name) for group in mission.groups for prop in group.properties if prop.hidden}
    owners = {group.name for group in mission.groups}
    fields = {id(_entity(part.base)) for part in ex.parts(condition) if isinstance(part, ex.Attr)}
    for part in ex.parts(condition):
        match part:
            case ex.Attr(base=base, name=name) if isinstance(ref := _entity(base), ex.Ref):
                if (domains.get(ref.name, ref.name), name) in properties:
                    yield f"`{domains.get(ref.name, ref.name)}.{name}`"
            case ex.Ref(name=name) if domains.get(name, name) in owners:
                owner = domains.get(name, name)
                if id(part) not in fields and (owner, "position") in properties:
                    yield f"`{owner}.position`"
                elif owner in hidden:
                    yield f"number of `{owner}`"
            case ex.Ref(name=name) if name in hidden:
                yield f"`{name}`"
            case ex.Quantified(domain=domain) | ex.Aggregate(domain=domain) if domain in hidden:
                yield f"number of `{domain}`"


def _entity(expr: ex.Expr) -> ex.Expr:
    return expr.base if isinstance(expr, ex.Index) else expr


def _referred(expr: ex.Expr) -> Iterator[str]:
    for part in ex.parts(expr):
        if isinstance(part, ex.Ref):
            yield part.name
        elif isinstance(part, ex.Quantified | ex.Aggregate):
            yield part.domain


class _Draws:
    """The drawn values of an instance; an `EvaluationContext` of `lingjing.mission.values`."""

    def __init__(self, members: Iterable[Entity], scope: Scope) -> None:
        self.groups: dict[str, tuple[Entity, ...]] = {}
        for entity in members:
            self.groups[entity.group] = (*self.groups.get(entity.group, ()), entity)
        self.scope = Scope(
            parameters=scope.parameters,
            mode=scope.mode,
            areas={name: area for name, area in scope.areas.items() if area.polygon},
            tick_s=scope.tick_s,
        )

    def place(self, value: Value) -> Place | None:
        """A point itself, or the declared position of an entity."""
        if isinstance(value, Entity):
            return Place(*value.position)
        return value if isinstance(value, Place) else None

    def note(self, name: str, number: float) -> None:
        """Discard a measured number."""

    def fact(self, name: str, arguments: Sequence[Value]) -> Value:
        """Raise `MissionError`: facts of a run do not exist before the first tick."""
        raise MissionError(f"`{name}(…)` is known only while the mission runs")


class _Requirements:
    """Semantics of conditions over drawn values."""

    def literal(self, node: Literal) -> Meaning:
        constant = node.name if isinstance(node, ex.Symbol) else node.value
        return lambda names, world: constant

    def name(self, node: ex.Ref) -> Meaning:
        def value_of(names: Mapping[str, Value], world: _Draws) -> Value:
            if node.name in names:
                return names[node.name]
            members = world.groups.get(node.name, ())
            return members[0] if len(members) == 1 else Members(()) if members else world.scope.refer(node)

        return value_of

    def field(self, node: ex.Attr, base: Meaning) -> Meaning:
        return lambda names, world: _field(base(names, world), node.name)

    def apply(self, node: Composite, operands: tuple[Meaning, ...]) -> Meaning:
        match node:
            case ex.Binary(operator="and"):
                left, right = operands
                return lambda names, world: as_flag(left(names, world)) and as_flag(right(names, world))
            case ex.Binary(operator="or"):
                left, right = operands
                return lambda names, world: as_flag(left(names, world)) or as_flag(right(names, world))
            case ex.Index(base=ex.Ref(name=group)):
                return lambda names, world: _member(world.groups.get(group, ()), group, operands[1](names, world))
        known = operation(node)
        if known is None:
            raise MissionError("a requirement reads drawn values alone")
        return lambda names, world: known.value(world, *[operand(names, world) for operand in operands])

    def over(self, node: ex.Quantified | ex.Aggregate, body: Meaning) -> Meaning:
        def value_of(names: Mapping[str, Value], world: _Draws) -> Value:
            members = world.groups.get(node.domain, ())
            values = (body({**names, node.variable: member}, world) for member in members)
            if isinstance(node, ex.Quantified):
                return any(map(as_flag, values)) if node.quantifier == "exists" else all(map(as_flag, values))
            return _aggregated(node.function, list(values))

        return value_of


_SEMANTICS = _Requirements()


def _field(value: Value, name: str) -> Value:
    if not isinstance(value, Entity):
        return operations.field(value, name)
    if name == "position":
        return Place(*value.position)
    number = value.heading_deg if name == "heading_deg" else value.properties.get(name)
    if number is None:
        raise MissionError(f"`{value.id}` has no `{name}` before the run")
    return number


def _member(members: tuple[Entity, ...], group: str, index: Value) -> Entity:
    place = as_whole(index)
    if not 1 <= place <= len(members):
        raise MissionError(f"`{group}` has {len(members)} members, there is no {place}")
    return members[place - 1]


def _aggregated(function: str, values: list[Value]) -> float:
    if function == "count":
        return float(sum(value is True for value in values))
    numbers = [float(value) for value in values if is_number(value)]
    if function == "sum":
        return math.fsum(numbers)
    if not numbers:
        raise MissionError(f"{function}(…) of nothing has no value")
    return min(numbers) if function == "min" else max(numbers)
