"""`goals`: the goals of an instance's success, of the rules that it calls, and of the unlocks that it needs.

The reading follows `and`, `or`, `not`, quantifiers, counts and rules, with each bound name replaced by a member of its
group. The leaves are comparisons and facts. `leaf_goals` turns them into goals.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from collections.abc import Set as AbstractSet

import msgspec

from lingjing.mission import expression as ex
from lingjing.mission.certain import truth
from lingjing.mission.conditions.goals import (
    MET,
    Alternatives,
    Goal,
    Judged,
    LeafGoal,
    LevelGoal,
    OpenGoal,
    Ordered,
    PerformGoal,
    ReportGoal,
    StatusGoal,
    every,
    is_never,
    leaves_of,
    some,
)
from lingjing.mission.conditions.leaf_goals import LeafReader, Names
from lingjing.mission.expression_text import spell
from lingjing.mission.instance import Entity, Instance
from lingjing.mission.model import Rule

_MAX_PARTS = 20_000
"""A condition is unfolded to at most this many parts (chosen); further ones are open goals."""

_OPPOSITE: Mapping[str, str] = {"<": ">=", "<=": ">", ">": "<=", ">=": "<", "==": "!=", "!=": "=="}
_MIRRORED: Mapping[str, str] = {"<": ">", "<=": ">=", ">": "<", ">=": "<=", "==": "==", "!=": "!="}


def goals(instance: Instance) -> Goal:
    """The goals of an instance's success."""
    reader = _GoalReader(instance)
    return reader.in_order(reader.part(instance.success, {}, "success"))


class _GoalReader:
    """Reads the conditions of one instance."""

    def __init__(self, instance: Instance) -> None:
        self._instance = instance
        self._leaves = LeafReader(instance)
        self._rules = {rule.name: rule for rule in instance.rules}
        self._groups: dict[str, list[Entity]] = {}
        for entity in instance.entities:
            self._groups.setdefault(entity.group, []).append(entity)
        self._kinds = {message.kind for message in instance.messages}
        self._open: list[str] = []
        self._left = _MAX_PARTS
        self._before: list[tuple[Goal, Goal]] = []
        """The goals of the conditions of each `before(…, …)`."""

    def in_order(self, goal: Goal) -> Goal:
        """The goal, with what must be true later in each `before(…, …)` behind what must be true first."""
        for first, second in self._before:
            sooner = {_without_place(leaf) for leaf in leaves_of(first)}
            later = {_without_place(leaf) for leaf in leaves_of(second)} - sooner
            goal = _behind(goal, later, first)
        return goal

    def part(self, expr: ex.Expr, names: Names, at: str) -> Goal:
        """The goal of a condition or a part of it."""
        self._left -= 1
        if self._left < 0:
            return OpenGoal(at=at, text=spell(expr), reason="the condition has too many parts")
        match expr:
            case ex.Binary(operator="and", left=left, right=right):
                return every((self.part(left, names, at), self.part(right, names, at)))
            case ex.Binary(operator="or", left=left, right=right):
                return some((self.part(left, names, at), self.part(right, names, at)))
            case ex.Unary(operator="not", operand=operand):
                return self._negated(operand, names, at)
            case ex.Quantified():
                return self._quantified(expr, names, at)
            case ex.Call(rule=True):
                return self._called(expr, names, at)
            case ex.Call(function="held", arguments=(condition, _)):
                return self.part(condition, names, at)
            case ex.Call(function="within", arguments=(first, second, _)):
                return _ordered(self.part(first, names, at), self.part(second, names, at))
            case ex.Call(function="before", arguments=(first, second)):
                goal = self.part(first, names, at)
                self._before.append((goal, self.part(second, names, at)))
                return goal
        return self._leaf(expr, names, at)

    def _negated(self, expr: ex.Expr, names: Names, at: str) -> Goal:
        """The goal that a part does not hold. Facts that agents bring about do not hold without action."""
        match expr:
            case ex.Binary(operator="and" | "or" as word, left=left, right=right):
                parts = (self._negated(left, names, at), self._negated(right, names, at))
                return every(parts) if word == "or" else some(parts)
            case ex.Unary(operator="not", operand=operand):
                return self.part(operand, names, at)
            case ex.Quantified(variable=name, domain=domain, body=body) if domain in self._groups:
                members = self._groups[domain]
                goals_of_members = tuple(self._negated(body, {**names, name: each}, at) for each in members)
                return some(goals_of_members) if expr.quantifier == "forall" else every(goals_of_members)
            case ex.Binary(operator=symbol, left=left, right=right) if symbol in _OPPOSITE:
                return self.part(ex.Binary(_OPPOSITE[symbol], left, right), names, at)  # type: ignore[arg-type]
        return MET

    def _quantified(self, expr: ex.Quantified, names: Names, at: str) -> Goal:
        if expr.domain in self._kinds:
            return self._of_messages(expr, names, at)
        members = self._groups.get(expr.domain, [])
        parts = tuple(self.part(expr.body, {**names, expr.variable: member}, at) for member in members)
        if expr.quantifier == "forall":
            return every(parts)
        return some(parts) if parts else _never(expr, at, f"there is no `{expr.domain}`")

    def _of_messages(self, expr: ex.Quantified, names: Names, at: str) -> Goal:
        """A report that must exist, and what its condition requires besides."""
        if expr.quantifier == "forall":
            return MET
        named = (self._leaves.entity(part, names) for part in ex.parts(expr.body))
        about = list({entity.id: entity for entity in named if entity is not None and entity.role == "target"}.values())
        matched = [rule for rule in self._rules.values() if rule.matching and _domains(rule) >= {expr.domain}]
        report = ReportGoal(
            at=at,
            text=spell(expr),
            kind=expr.domain,
            about=about[0].id if len(about) == 1 else "",
            matching=bool(about) and any(about[0].group in _domains(rule) for rule in matched),
        )
        return every((report, self.part(expr.body, {**names, expr.variable: None}, at)))

    def _called(self, call: ex.Call, names: Names, at: str) -> Goal:
        rule = self._rules.get(call.function)
        if rule is None or rule.name in self._open or len(rule.parameters) != len(call.arguments):
            return OpenGoal(at=at, text=spell(call), reason="the rule calls itself")
        values = [self._leaves.entity(argument, names) for argument in call.arguments]
        inner: Names = {parameter.name: value for parameter, value in zip(rule.parameters, values, strict=True)}
        self._open.append(rule.name)
        goal = self.part(rule.condition, inner, f"rule/{rule.name}")
        self._open.pop()
        ids = tuple(value.id for value in values if value is not None)
        return goal if goal == MET or is_never(goal) else Judged(rule=rule.name, entities=ids, part=goal)

    def _leaf(self, expr: ex.Expr, names: Names, at: str) -> Goal:
        if self._of_report(expr, names):
            return MET  # the report that must exist is a goal of its own
        declared = truth(expr, {name: value for name, value in names.items() if value is not None}, self._leaves.known)
        if declared is not None:
            return MET if declared else _never(expr, at, "the declared values never meet it")
        match expr:
            case ex.Binary(operator=symbol, left=left, right=right) if symbol in _MIRRORED and symbol != "!=":
                return self._compared(expr, left, symbol, right, names, at)
            case ex.Call(function="emitted"):
                return self._performed(expr, names, at)
        return self._behind_unlocks(self._leaves.fact(expr, names, at))

    def _of_report(self, expr: ex.Expr, names: Names) -> bool:
        """True if a part reads a message."""
        read = (part.name for part in ex.parts(expr) if isinstance(part, ex.Ref) and part.kind == "local")
        return any(name in names and names[name] is None for name in read)

    def _compared(self, expr: ex.Expr, left: ex.Expr, symbol: str, right: ex.Expr, names: Names, at: str) -> Goal:
        if isinstance(right, ex.Aggregate) and not isinstance(left, ex.Aggregate):
            left, symbol, right = right, _MIRRORED[symbol], left
        match left:
            case ex.Aggregate(function="count", domain=domain) if domain in self._groups:
                return self._counted(expr, left, symbol, self._leaves.number(right, names), names, at)
            case ex.Aggregate(function="min" | "max" as function, domain=domain) if domain in self._groups:
                return self._extreme(left, function, symbol, right, names, at)
            case ex.Call(function="count", arguments=(ex.Symbol(name=name), *_)):
                return self._times(expr, left, name, symbol, names, at)
        return self._behind_unlocks(self._leaves.comparison(expr, left, symbol, right, names, at))

    def _times(self, expr: ex.Expr, count: ex.Call, name: str, symbol: str, names: Names, at: str) -> Goal:
        """The goal that an event occurs, or that an interaction is performed. An upper limit needs no action."""
        if symbol in ("<", "<="):
            return MET
        event = next((each for each in self._instance.events if each.name == name), None)
        if event is None:
            return self._performed(ex.Call("emitted", count.arguments), names, at)
        if event.condition is None:
            return MET  # its time comes without action
        path = f"event/{name}/when"
        if path in self._open:
            return OpenGoal(at=at, text=spell(expr), reason="the event depends on itself")
        self._open.append(path)
        goal = self.part(event.condition, {}, path)
        self._open.pop()
        return goal

    def _counted(
        self, expr: ex.Expr, count: ex.Aggregate, symbol: str, bound: float | None, names: Names, at: str
    ) -> Goal:
        if bound is None:
            return OpenGoal(at=at, text=spell(expr), reason="the number is not known before the run")
        members = [{**names, count.variable: member} for member in self._groups[count.domain]]
        required: list[Goal] = []
        if symbol in (">", ">=", "=="):
            least = math.floor(bound) + 1 if symbol == ">" else math.ceil(bound - 1e-9)
            required.append(some(tuple(self.part(count.body, each, at) for each in members), least))
        if symbol in ("<", "<=", "=="):
            most = math.ceil(bound) - 1 if symbol == "<" else math.floor(bound + 1e-9)
            others = tuple(self._negated(count.body, each, at) for each in members)
            required.append(some(others, len(members) - most))
        return every(tuple(required))

    def _extreme(
        self, extreme: ex.Aggregate, function: str, symbol: str, bound: ex.Expr, names: Names, at: str
    ) -> Goal:
        """The smallest or greatest of several values, compared."""
        parts = tuple(
            self.part(ex.Binary(symbol, extreme.body, bound), {**names, extreme.variable: member}, at)  # type: ignore[arg-type]
            for member in self._groups[extreme.domain]
        )
        of_all = (function == "max") == (symbol in ("<", "<="))
        return every(parts) if of_all else some(parts)

    def _performed(self, call: ex.Call, names: Names, at: str) -> Goal:
        """The goal of `emitted(…)`. Without an entity it is any target that has the interaction."""
        event = call.arguments[0]
        name = event.name if isinstance(event, ex.Symbol | ex.Ref) else spell(event)
        target = self._leaves.entity(call.arguments[1], names) if len(call.arguments) > 1 else None
        targets = self._instance.entities if len(call.arguments) == 1 else (target,) if target is not None else ()
        ways = tuple(
            _ordered(self._unlock(way), way)
            for entity in targets
            for way in self._leaves.performed(entity, at, spell(call))
            if way.interaction == name
        )
        return some(ways) if ways else OpenGoal(at=at, text=spell(call), reason="no interaction has this event")

    def _behind_unlocks(self, goal: Goal) -> Goal:
        """A goal that interactions bring about, behind the goal to unlock one of them."""
        if isinstance(goal, LevelGoal | StatusGoal) and goal.ways:
            return _ordered(some(tuple(self._unlock(way) for way in goal.ways)), goal)
        if isinstance(goal, Alternatives):
            parts = tuple(self._behind_unlocks(part) for part in goal.parts)
            return Alternatives(least=goal.least, parts=parts)
        return goal

    def _unlock(self, way: PerformGoal) -> Goal:
        """The goal to unlock an interaction. Unlocks that are not for exactly its target are left out."""
        path, target = f"unlock/{way.interaction}", self._leaves.by_id[way.target]
        own = [
            unlock
            for unlock in self._instance.unlocks
            if unlock.interaction == way.interaction
            and (not unlock.parameters or unlock.parameters[0].domain == target.group)
        ]
        if len(own) != 1 or len(own[0].parameters) > 1 or path in self._open:
            return MET
        names: Names = {parameter.name: target for parameter in own[0].parameters}
        self._open.append(path)
        goal = self.part(own[0].condition, names, path)
        self._open.pop()
        return goal


def _never(expr: ex.Expr, at: str, reason: str) -> OpenGoal:
    return OpenGoal(at=at, text=spell(expr), reason=reason, never=True)


def _ordered(first: Goal, then: Goal) -> Goal:
    return then if first == MET else Ordered(first=first, then=then)


def _without_place(leaf: LeafGoal) -> LeafGoal:
    """The leaf without its place in the text: equal leaves of two conditions are one goal."""
    return msgspec.structs.replace(leaf, at="", text="")


def _behind(goal: Goal, later: AbstractSet[LeafGoal], first: Goal) -> Goal:
    """The goal with each of the leaves `later` behind the goal `first`."""
    match goal:
        case Alternatives(parts=parts):
            return msgspec.structs.replace(goal, parts=tuple(_behind(part, later, first) for part in parts))
        case Ordered(then=then) | Judged(part=then):
            name = "then" if isinstance(goal, Ordered) else "part"
            return msgspec.structs.replace(goal, **{name: _behind(then, later, first)})
    return _ordered(first, goal) if _without_place(goal) in later else goal


def _domains(rule: Rule) -> set[str]:
    return {parameter.domain for parameter in rule.parameters}
