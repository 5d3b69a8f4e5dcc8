"""`LeafReader`: the goals of single parts of conditions: comparisons of amounts and distances, and facts."""

from __future__ import annotations

from collections.abc import Mapping

from lingjing.errors import MissionError
from lingjing.mission import expression as ex
from lingjing.mission.conditions.declarations import of_instance
from lingjing.mission.conditions.declared_values import DeclaredValues
from lingjing.mission.conditions.goals import (
    MET,
    AssignGoal,
    Goal,
    InspectGoal,
    LevelGoal,
    OpenGoal,
    PerformGoal,
    PictureGoal,
    ReachGoal,
    StatusGoal,
    every,
)
from lingjing.mission.conditions.outline import of_instance as outline_of
from lingjing.mission.conditions.reads import Reader
from lingjing.mission.evaluate import number
from lingjing.mission.expression_text import spell
from lingjing.mission.instance import Entity, Instance
from lingjing.mission.natures import nature_of, traits_of, worked_levels

Names = Mapping[str, Entity | None]
"""Bound names → the entity, or None for a message."""

_SEEN_M = 10.0
"""The distance at which the goal of a free line of sight brings one body to the other, metres (chosen: less than the
width of a street)."""

_OVER = "position"
"""The field that stands for its entity in distances."""


class LeafReader:
    """Reads single parts of the conditions of one instance."""

    def __init__(self, instance: Instance) -> None:
        self._instance = instance
        self.by_id = {entity.id: entity for entity in instance.entities}
        self._groups: dict[str, list[Entity]] = {}
        for entity in instance.entities:
            self._groups.setdefault(entity.group, []).append(entity)
        self._scope = outline_of(instance).scope
        self._declarations = of_instance(instance)
        self._regions = {region.name: region.polygon for region in instance.regions}
        self.known = DeclaredValues(instance)

    # -- values

    def entity(self, expr: ex.Expr, names: Names) -> Entity | None:
        """The entity that an expression names; None for another expression."""
        match expr:
            case ex.Ref(kind="local", name=name):
                return names.get(name)
            case ex.Ref(kind="group" | "entity", name=name):
                members = self._groups.get(name, [])
                return members[0] if len(members) == 1 else self.by_id.get(name)
            case ex.Index(base=ex.Ref(name=group), index=index):
                place, members = self.number(index, names), self._groups.get(group, [])
                return members[int(place) - 1] if place is not None and 1 <= place <= len(members) else None
            case ex.Attr(base=base, name=field) if field == _OVER:
                return self.entity(base, names)
        return None

    def number(self, expr: ex.Expr, names: Names) -> float | None:
        """A number that is known before the run; None otherwise."""
        match expr:
            case ex.Attr(base=base, name=field):
                entity = self.entity(base, names)
                return None if entity is None else self.known.number(entity, field)
            case ex.Binary(operator="+" | "-" | "*" | "/" as symbol, left=left, right=right):
                first, second = self.number(left, names), self.number(right, names)
                return None if first is None or second is None else _computed(symbol, first, second)
        try:
            return number(expr, self._scope)
        except MissionError:
            return None

    def performed(self, target: Entity, at: str, text: str) -> tuple[PerformGoal, ...]:
        """The interactions with an entity, as goals."""
        return tuple(
            PerformGoal(
                at=at,
                text=text,
                interaction=spec.name,
                target=target.id,
                actors=tuple(actor.id for actor in self._instance.actors(spec)),
                within_m=spec.within_m,
                lasting_s=spec.lasting_s,
            )
            for spec in target.interactions
        )

    # -- comparisons

    def comparison(self, expr: ex.Expr, left: ex.Expr, symbol: str, right: ex.Expr, names: Names, at: str) -> Goal:
        """The goal of a comparison."""
        if any(isinstance(part, ex.Ref) and part.kind == "clock" for part in ex.parts(expr)):
            return MET  # time passes without action
        if isinstance(left, ex.Attr) and left.name == "status":
            return self._status(expr, left, (right,), names, at)
        bound = self.number(right, names)
        if bound is None:
            left, right, symbol = right, left, _mirrored(symbol)
            bound = self.number(right, names)
        if bound is None:
            return self._open(expr, names, at)
        if isinstance(left, ex.Call) and left.function in ("distance", "distance_xy"):
            return self._near(expr, left, symbol, bound, names, at)
        return self._level(expr, left, symbol, bound, names, at)

    def _level(self, expr: ex.Expr, left: ex.Expr, symbol: str, bound: float, names: Names, at: str) -> Goal:
        holders = self._holders(left, names)
        if not holders:
            return self._open(expr, names, at)
        state = holders[0][1]
        entities = tuple(entity for entity, _ in holders)
        required: list[Goal] = []
        for lowers in (True, False):
            if symbol not in (("<", "<=", "==") if lowers else (">", ">=", "==")):
                continue
            ways = self._ways(entities, state, at, spell(expr), lowers=lowers)
            required.append(
                LevelGoal(
                    at=at,
                    text=spell(expr),
                    entities=tuple(entity.id for entity in entities),
                    state=state,
                    most=bound if lowers else None,
                    least=None if lowers else bound,
                    strict=symbol in ("<", ">"),
                    ways=ways,
                )
            )
        return every(tuple(required)) if required else self._open(expr, names, at)

    def _holders(self, expr: ex.Expr, names: Names) -> list[tuple[Entity, str]]:
        """The entities with the state that an expression reads, each with the state's name: one, or those of a sum."""
        match expr:
            case ex.Attr(base=base, name=field):
                entity = self.entity(base, names)
                spec = entity.state_of(field) if entity is not None else None
                return [(entity, spec.name)] if entity is not None and spec is not None else []
            case ex.Aggregate(function="sum", variable=variable, domain=domain, body=ex.Attr() as body):
                members = self._groups.get(domain, [])
                pairs_of_members = [self._holders(body, {**names, variable: member}) for member in members]
                return [pair for pairs in pairs_of_members for pair in pairs] if all(pairs_of_members) else []
        return []

    def _ways(
        self, entities: tuple[Entity, ...], state: str, at: str, text: str, *, lowers: bool
    ) -> tuple[PerformGoal, ...]:
        """The interactions that lower or raise a state of one of the entities."""
        ids = {entity.id for entity in entities}
        ways: list[PerformGoal] = []
        for target in self._instance.entities:
            worked = _worked(target)
            for spec, goal in zip(target.interactions, self.performed(target, at, text), strict=True):
                own = target.id in ids and lowers and (spec.own == state or worked.get(spec.name) == state)
                carried = spec.carried == state and spec.moves_goods and bool(ids.intersection(goal.actors))
                if own or (carried and bool(spec.takes) == lowers):
                    ways.append(goal)
        return tuple(ways)

    def _near(self, expr: ex.Expr, distance: ex.Call, symbol: str, bound: float, names: Names, at: str) -> Goal:
        if symbol not in ("<", "<=") or len(distance.arguments) != 2:
            return self._open(expr, names, at)
        first, second = (self.entity(argument, names) for argument in distance.arguments)
        if first is not None and second is not None:
            movers = sorted((first, second), key=lambda entity: entity.role == "target")
            return ReachGoal(at=at, text=spell(expr), movers=(movers[0].id,), entity=movers[1].id, radius_m=bound)
        mover = first or second
        point = self._point(distance.arguments[0 if first is None else 1], names)
        if mover is None or point is None:
            return self._open(expr, names, at)
        return ReachGoal(at=at, text=spell(expr), movers=(mover.id,), point=point, radius_m=bound)

    def _point(self, expr: ex.Expr, names: Names) -> tuple[float, float] | None:
        if not isinstance(expr, ex.Point):
            return None
        east, north = (self.number(item, names) for item in expr.items[:2])
        return None if east is None or north is None else (east, north)

    def _status(self, expr: ex.Expr, left: ex.Attr, words: tuple[ex.Expr, ...], names: Names, at: str) -> Goal:
        entity = self.entity(left.base, names)
        known = tuple(word.name for word in words if isinstance(word, ex.Symbol | ex.Ref))
        if entity is None or entity.role != "target":
            return self._open(expr, names, at)
        specs = {spec.name: spec for spec in entity.interactions}
        ways = tuple(
            goal
            for goal in self.performed(entity, at, spell(expr))
            if _given(entity, specs[goal.interaction].name) in known
        )
        return StatusGoal(at=at, text=spell(expr), entity=entity.id, words=known, ways=ways)

    # -- facts

    def fact(self, expr: ex.Expr, names: Names, at: str) -> Goal:
        """The goal of a part that is no comparison of numbers."""
        match expr:
            case ex.Binary(operator="in", left=ex.Attr(name="status") as left, right=ex.Sequence(items=items)):
                return self._status(expr, left, items, names, at)
            case ex.Binary(operator="in", left=left, right=ex.Range(low=low, high=high)):
                bounds = ((">=", low), ("<=", high))
                return every(tuple(self.comparison(expr, left, symbol, end, names, at) for symbol, end in bounds))
            case ex.Binary(operator="in", left=left, right=ex.Ref(name=name)) if name in self._regions:
                return self._inside(expr, left, name, names, at)
            case ex.Call(function="alive"):
                return MET
            case ex.Call(function="photographed", arguments=(one,)) if asset := self.entity(one, names):
                return PictureGoal(at=at, text=spell(expr), asset=asset.id)
            case ex.Call(function="line_of_sight", arguments=(first, second)):
                return self._seen(expr, first, second, names, at)
            case ex.Call(function="inspected" | "clear", arguments=(ex.Symbol(name=name) | ex.Ref(name=name),)):
                return InspectGoal(at=at, text=spell(expr), inspection=name)
            case ex.Call(function="assigned", arguments=(one, other)):
                asset, target = self.entity(one, names), self.entity(other, names)
                if asset is not None and target is not None:
                    return AssignGoal(at=at, text=spell(expr), asset=asset.id, target=target.id)
        return self._open(expr, names, at)

    def _seen(self, expr: ex.Expr, start: ex.Expr, end: ex.Expr, names: Names, at: str) -> Goal:
        """A body near another one has a free line to it nearly always."""
        first, second = self.entity(start, names), self.entity(end, names)
        if first is None or second is None:
            return self._open(expr, names, at)
        mover, goal = sorted((first, second), key=lambda entity: entity.role == "target")
        return ReachGoal(at=at, text=spell(expr), movers=(mover.id,), entity=goal.id, radius_m=_SEEN_M)

    def _inside(self, expr: ex.Expr, item: ex.Expr, region: str, names: Names, at: str) -> Goal:
        body, outline = self.entity(item, names), self._regions[region]
        if body is None or not outline:
            return self._open(expr, names, at)
        return ReachGoal(at=at, text=spell(expr), movers=(body.id,), region=outline)

    def _open(self, expr: ex.Expr, names: Names, at: str) -> OpenGoal:
        """A part without a kind of goal, with what it reads and what would change that."""
        domains = {name: entity.group for name, entity in names.items() if entity is not None}
        read = [quantity for leaf in Reader(self._declarations).leaves(expr, domains) for quantity in leaf.quantities]
        keys = dict.fromkeys(quantity.key for quantity in read)
        causes = dict.fromkeys(f"{cause.kind} {cause.name}" for quantity in read for cause in quantity.causes)
        changed = f"which {', '.join(causes)} can change" if causes else "which nothing changes"
        reason = f"it reads {', '.join(keys) or 'no quantity'}, {changed}, and no kind of goal covers that"
        return OpenGoal(at=at, text=spell(expr), reason=reason)


def _computed(symbol: str, first: float, second: float) -> float | None:
    match symbol:
        case "+":
            return first + second
        case "-":
            return first - second
        case "*":
            return first * second
    return first / second if second else None


def _mirrored(symbol: str) -> str:
    return symbol.translate(str.maketrans("<>", "><"))


def _worked(target: Entity) -> Mapping[str, str]:
    """The interactions that work off a state of a target → the state."""
    return worked_levels(nature_of(traits_of(target)), target.interactions, [spec.name for spec in target.state])


def _given(target: Entity, interaction: str) -> str:
    """The status word that an interaction gives its target; "" if it keeps its own."""
    nature = nature_of(traits_of(target))
    spec = next(each for each in target.interactions if each.name == interaction)
    if nature.lasts or (spec.gives and not spec.own):
        return ""
    over = nature.over if interaction in _worked(target) else ""
    return spec.status or over or spec.done_word
