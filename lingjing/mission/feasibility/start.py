"""Whether success holds at boundary 0, before anybody acts: a hint, for a mission that wins itself says nothing.

Every answer is certain: `True` and `False` hold for every seed, what is not known is None. Declared states and the
properties of targets have their declared values then; nothing was reported, assigned or performed yet.
"""

from __future__ import annotations

import math

from lingjing.errors import LingjingError
from lingjing.mission import expression as ex
from lingjing.mission import model
from lingjing.mission.evaluate import Place, evaluate
from lingjing.mission.feasibility.needs import Env, Unfolding
from lingjing.mission.feasibility.outline import Outline, of_mission, too_large
from lingjing.mission.feasibility.proof import Proof
from lingjing.mission.feasibility.spread import ANYTHING, Bounds

_NOT_YET = frozenset(("emitted", "assigned"))
_NONE_YET = frozenset(("used", "replans"))
_OPEN = "bay"
ASIDE_M = 250.0
"""How far at most a scene with buildings puts aside what is not declared `on` a surface; the open bay moves nothing."""

_TURNED = {"<": ">", "<=": ">=", ">": "<", ">=": "<=", "==": "==", "!=": "!="}


def won_at_start(mission: model.Mission) -> tuple[Proof, ...]:
    """A hint at the success condition if it holds at the start in every seed, with the modes."""
    modes = []
    for mode in mission.modes.allowed:
        try:
            if not too_large(mission, mode) and Beginning(of_mission(mission, mode)).success():
                modes.append(mode)
        except LingjingError:
            continue
    if not modes:
        return ()
    where = "" if len(modes) == len(mission.modes.allowed) else f"in {' and '.join(modes)} mode, "
    message = f"{where}success holds at the start, before anybody acts: the mission wins itself"
    return (Proof("LJ0510", "success", message, "ask for what has to be brought about"),)


class Beginning:
    """Conditions at boundary 0 of an outline."""

    def __init__(self, outline: Outline) -> None:
        self._outline = outline
        self._unfolding = Unfolding(outline)
        self._open: set[str] = set()

    def success(self) -> bool:
        """Whether success certainly holds, and no hard constraint and no failure can come before it."""
        return self.truth(self._outline.instance.success, {}) is True and not any(
            one.kind == "hard" for one in self._outline.instance.constraints
        )

    def truth(self, expr: ex.Expr, env: Env) -> bool | None:
        """Whether a condition holds; None if that is not certain."""
        match expr:
            case ex.Flag(value=flag):
                return flag
            case ex.Unary(operator="not", operand=operand):
                value = self.truth(operand, env)
                return None if value is None else not value
            case ex.Binary(operator="and"):
                return _both(self.truth(expr.left, env), self.truth(expr.right, env))
            case ex.Binary(operator="or"):
                return _either(self.truth(expr.left, env), self.truth(expr.right, env))
            case ex.Binary(operator=operator) if operator in _TURNED:
                return _compared(operator, self._number(expr.left, env), self._number(expr.right, env))
            case ex.Quantified():
                return self._quantified(expr, env)
            case ex.Call(rule=True):
                return self._rule(expr, env)
            case ex.Call(function=name) if name in _NOT_YET:
                return False
        return None

    # -- private

    def _quantified(self, expr: ex.Quantified, env: Env) -> bool | None:
        if expr.domain in self._outline.kinds:
            return expr.quantifier == "forall"  # nothing was said yet
        members = self._outline.groups.get(expr.domain, ())
        values = [self.truth(expr.body, {**env, expr.variable: member}) for member in members]
        whole: bool | None = expr.quantifier == "forall"
        for value in values:
            whole = _both(whole, value) if expr.quantifier == "forall" else _either(whole, value)
        return whole

    def _rule(self, call: ex.Call, env: Env) -> bool | None:
        rule = next((one for one in self._outline.instance.rules if one.name == call.function), None)
        if rule is None or rule.name in self._open or len(rule.parameters) != len(call.arguments):
            return None
        if any(parameter.domain in self._outline.kinds for parameter in rule.parameters):
            return False  # it is about a message
        bodies = [self._unfolding.body(argument, env) for argument in call.arguments]
        if None in bodies:
            return None
        self._open.add(rule.name)
        inner: Env = {p.name: body for p, body in zip(rule.parameters, bodies, strict=True)}
        found = self.truth(rule.condition, inner)
        self._open.discard(rule.name)
        return found

    def _number(self, expr: ex.Expr, env: Env) -> Bounds:
        match expr:
            case ex.Ref(kind="clock", name="now"):
                return 0.0, 0.0
            case ex.Call(function=name, rule=False) if name in _NONE_YET:
                return 0.0, 0.0
            case ex.Call(function="distance_xy", arguments=(one, other)):
                return self._distance(one, other, env)
            case ex.Attr(base=base, name=name):
                return self._property(base, name, env)
            case ex.Aggregate(function="count", domain=domain) if domain in self._outline.kinds:
                return 0.0, 0.0
            case ex.Aggregate(domain=domain) if domain not in self._outline.kinds:
                return self._aggregate(expr, env)
            case ex.Unary(operator="-", operand=operand):
                low, high = self._number(operand, env)
                return -high, -low
            case ex.Binary(operator="+"):
                (a, b), (c, d) = self._number(expr.left, env), self._number(expr.right, env)
                return a + c, b + d
            case ex.Binary(operator="-"):
                (a, b), (c, d) = self._number(expr.left, env), self._number(expr.right, env)
                return a - d, b - c
        return self._static(expr)

    def _distance(self, one: ex.Expr, other: ex.Expr, env: Env) -> Bounds:
        """Between entities whose places are declared, or points, less and more what the scene may move them."""
        ends = [self._place(end, env) for end in (one, other)]
        known = [end for end in ends if end is not None]
        if len(known) < 2:
            return ANYTHING
        apart, loose = math.dist(known[0][0], known[1][0]), known[0][1] + known[1][1]
        return max(0.0, apart - loose), apart + loose

    def _place(self, expr: ex.Expr, env: Env) -> tuple[tuple[float, float], float] | None:
        """East and north, and how far off that may be."""
        body = self._unfolding.body(expr, env)
        if body is not None:
            points = [outline[0] for outline in body.where.outlines if len(outline) == 1]
            if len(body.where.outlines) != 1 or not points or body.entity.dormant:
                return None
            put = body.where.loose_m or (0.0 if self._outline.instance.scene.kind == _OPEN else ASIDE_M)
            return points[0], put
        try:
            value = evaluate(expr, self._outline.scope)
        except LingjingError:
            return None
        return ((value.east, value.north), 0.0) if isinstance(value, Place) else None

    def _property(self, base: ex.Expr, name: str, env: Env) -> Bounds:
        """A declared state, or what a target of the city is; another property may be shadowed by its engine's word."""
        body = self._unfolding.body(base, env)
        if body is None or (isinstance(base, ex.Attr) and base.name == "position"):
            return ANYTHING
        entity = body.entity
        known = entity.engine == "city" or (entity.state_of(name) is not None and name in entity.properties)
        return body.bounds(name) if known and not entity.dormant else ANYTHING

    def _aggregate(self, expr: ex.Aggregate, env: Env) -> Bounds:
        members = self._outline.groups.get(expr.domain, ())
        inner = [{**env, expr.variable: member} for member in members]
        if expr.function == "count":
            values = [self.truth(expr.body, one) for one in inner]
            return float(values.count(True)), float(len(values) - values.count(False))
        found = [self._number(expr.body, one) for one in inner]
        if expr.function == "sum":
            return math.fsum(low for low, _ in found), math.fsum(high for _, high in found)
        if not found:
            return ANYTHING
        chosen = min if expr.function == "min" else max
        return chosen(low for low, _ in found), chosen(high for _, high in found)

    def _static(self, expr: ex.Expr) -> Bounds:
        try:
            value = evaluate(expr, self._outline.scope)
        except LingjingError:
            return ANYTHING
        return (value, value) if isinstance(value, float) and not isinstance(value, bool) else ANYTHING


def _both(one: bool | None, other: bool | None) -> bool | None:
    if one is False or other is False:
        return False
    return None if one is None or other is None else True


def _either(one: bool | None, other: bool | None) -> bool | None:
    if one is True or other is True:
        return True
    return None if one is None or other is None else False


def _compared(operator: str, one: Bounds, other: Bounds) -> bool | None:
    """What every pair of numbers between these bounds has in common."""
    if operator in (">", ">="):
        operator, one, other = _TURNED[operator], other, one
    (low, high), (least, most) = one, other
    if operator in ("<", "<="):
        holds = high < least or (operator == "<=" and high <= least)
        fails = low > most or (operator == "<" and low >= most)
        return True if holds else False if fails else None
    apart = high < least or low > most
    same = low == high == least == most
    if operator == "!=":
        apart, same = same, apart
    return True if same else False if apart else None
