"""The evaluator of expressions over run-time state: the value of a rule, a stage or a condition at one instant.

The evaluator is total: it raises nothing on missing state. A missing value (no ground-truth box in that frame, an
entity without telemetry) is `None`, and so is the result of an operation on it. A condition holds only if its value is
`True`. Distances are planar metres, radii are closed, boxes are normalised image boxes. The numbers used in an
evaluation become the evidence of an event. `lingjing.mission.functions` defines the operators and functions, `facts`
those that need a running mission.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Mapping

from lingjing.errors import LingjingError, MissionError
from lingjing.kernel.context import Locals, RuntimeContext
from lingjing.kernel.registry import Binding, Report
from lingjing.kernel.stocks import current
from lingjing.mission.expression import (
    Aggregate,
    Attr,
    Binary,
    Call,
    Expr,
    Index,
    Quantified,
    Ref,
    Symbol,
    Unary,
    children,
    parts,
)
from lingjing.mission.expression_text import spell
from lingjing.mission.fold import Composite, Literal, Meaning, meaning
from lingjing.mission.functions import OPERATIONS, TEMPORAL, free_names, operation
from lingjing.mission.instance import Entity
from lingjing.mission.model import Rule
from lingjing.mission.operations import AXES
from lingjing.mission.values import Value, is_number
from lingjing.trace.records import Box

TICK = "tick"
"""The length of a decision tick in seconds. It is the clock's only constant; `now` is the time."""


def identity(value: Entity | Report) -> str:
    """Return the id that represents a bound value in an event's binding."""
    return value.id


def evaluate(expr: Expr, scope: Locals, at: RuntimeContext) -> Value:
    """Return the value of `expr` at an instant with the variables of `scope`.

    Raises `LingjingError` for expressions that the checker should have rejected.
    """
    return at.meanings.of(expr)(scope, at)


def holds(condition: Expr, scope: Locals, at: RuntimeContext) -> bool:
    """Return whether the condition's value is `True`."""
    return evaluate(condition, scope, at) is True


def bindings(
    domains: tuple[tuple[str, str], ...], at: RuntimeContext, *, fresh: bool = False
) -> Iterator[dict[str, Entity | Report]]:
    """Yield every assignment of the (variable, domain) pairs; the first variable varies slowest.

    With `fresh`, domains of reports contain only those of this boundary.
    """
    names = [name for name, _ in domains]
    members: list[tuple[Entity | Report, ...]] = [
        at.fresh(domain) if fresh else at.domain(domain) for _, domain in domains
    ]
    for values in itertools.product(*members):
        yield dict(zip(names, values, strict=True))


class _Running:
    """The compilation of expressions to functions of (scope, `RuntimeContext`)."""

    def literal(self, node: Literal) -> Meaning:
        constant = node.name if isinstance(node, Symbol) else node.value
        return lambda scope, at: constant

    def name(self, node: Ref) -> Meaning:
        name = node.name
        if node.kind == "local":
            return lambda scope, at: scope.get(name)
        if node.kind == "param":
            return lambda scope, at: at.instance.settings[name]
        if node.kind == "switch":
            return lambda scope, at: at.instance.settings.get(name, 0.0) != 0.0
        if node.kind == "mode":
            return lambda scope, at: at.instance.mode
        if node.kind == "clock":
            return (lambda scope, at: at.instance.clock.tick_s) if name == TICK else (lambda scope, at: at.time_s)
        if node.kind == "region":
            return lambda scope, at: at.areas.get(name)
        return lambda scope, at: (at.groups.get(name) or (name,))[0]

    def field(self, node: Attr, base: Meaning) -> Meaning:
        name = node.name
        return lambda scope, at: field_of(base(scope, at), name, at)

    def apply(self, node: Composite, operands: tuple[Meaning, ...]) -> Meaning:
        match node:
            case Binary(operator="and"):
                left, right = operands
                return lambda scope, at: left(scope, at) is True and right(scope, at) is True
            case Binary(operator="or"):
                left, right = operands
                return lambda scope, at: left(scope, at) is True or right(scope, at) is True
            case Unary(operator="not"):
                (operand,) = operands
                return lambda scope, at: operand(scope, at) is not True
            case Index(base=Ref(name=name)):
                return _member(name, operands[1])
            case Call(rule=True, function=name):
                return lambda scope, at: (name, _binding(scope, at, operands)) in at.registry.achieved
            case Call(function=name) if name in TEMPORAL:
                return _remembered(node, operands)
        known = operation(node)
        if known is None:
            raise LingjingError(f"`{getattr(node, 'function', type(node).__name__)}` cannot stand in a rule")
        return _applied(known.value, operands)

    def over(self, node: Quantified | Aggregate, body: Meaning) -> Meaning:
        if isinstance(node, Aggregate):
            return _aggregated(node, body)
        variable, domain, quantify = node.variable, node.domain, any if node.quantifier == "exists" else all
        witnessed = _witnessed(node)

        def quantified(scope: Locals, at: RuntimeContext) -> Value:
            known = witnessed(scope, at) if witnessed is not None else None
            if known is not None:
                return known
            return quantify(body({**scope, variable: member}, at) is True for member in at.domain(domain))

        return quantified


RUNNING = _Running()
"""The compilation that the adjudicator uses."""


def _applied(function: Callable[..., Value], operands: tuple[Meaning, ...]) -> Meaning:
    """Compile an operation. Its value is None if an operand has no value or the operation is undefined for the
    operands.
    """

    def applied(scope: Locals, at: RuntimeContext) -> Value:
        values = []
        for operand in operands:
            value = operand(scope, at)
            if value is None:
                return None
            values.append(value)
        try:
            return function(at, *values)
        except MissionError:
            return None

    return applied


def _remembered(call: Call, operands: tuple[Meaning, ...]) -> Meaning:
    """Compile a function over time as a look-up of what the registry remembers of it."""
    text, names, duration = spell(call), free_names(call), operands[-1]

    def remembered(scope: Locals, at: RuntimeContext) -> Value:
        binding = tuple(identity(scope[name]) for name in names if name in scope)
        past = at.registry.memory.get((text, binding))
        if past is None:
            return False
        if call.function == "before":
            return past.before()
        duration_s = duration(scope, at)
        if not is_number(duration_s):
            return None
        return past.held(duration_s, at.time_s) if call.function == "held" else past.within(duration_s)

    return remembered


def _member(group: str, index: Meaning) -> Meaning:
    def member(scope: Locals, at: RuntimeContext) -> Value:
        position, members = index(scope, at), at.groups.get(group, ())
        return members[int(position) - 1] if is_number(position) and 1 <= position <= len(members) else None

    return member


def field_of(base: Value, name: str, at: RuntimeContext) -> Value:
    """Return a field of an entity, a report, a box or a position at an instant; None if it has none."""
    if isinstance(base, Entity):
        state = at.states.get(base.id)
        if state is None:
            return None
        if name in ("position", "velocity", "heading_deg", "status"):
            return getattr(state, name)
        return current(base, state, name)
    if isinstance(base, Report):
        return base.body[name] if name in base.body else _header(base, name, at)
    if isinstance(base, Box):
        return base.box if name == "box" else None
    if isinstance(base, tuple):
        axis = AXES.get(name)
        value = base[axis] if axis is not None and axis < len(base) else None
        return float(value) if is_number(value) else None
    return getattr(base, name, None) if name in AXES else None


def _header(report: Report, name: str, at: RuntimeContext) -> Value:
    """Return one of `MESSAGE_FIELDS` of a message, unless its record declares a field of that name; else None."""
    spec = next((spec for spec in at.instance.messages if spec.kind == report.kind), None)
    if spec is not None and any(field.name == name for field in spec.fields):
        return None
    match name:
        case "sender":
            return report.sender
        case "role":
            return next((agent.role for agent in at.instance.agents if agent.id == report.sender), None)
        case "sent":
            return (report.tick - 1) * at.instance.clock.tick_s  # rules see it one boundary after the decision
    return None


def _aggregated(node: Aggregate, body: Meaning) -> Meaning:
    """Compile an aggregate. Without members, `count` and `sum` are 0, `min` and `max` None. Members without a value are
    ignored.
    """
    variable, domain, function = node.variable, node.domain, node.function

    def aggregated(scope: Locals, at: RuntimeContext) -> Value:
        values = [body({**scope, variable: member}, at) for member in at.domain(domain)]
        if function == "count":
            return float(sum(value is True for value in values))
        numbers = [float(value) for value in values if is_number(value)]
        if function == "sum":
            return math.fsum(numbers)
        return {"min": min, "max": max}[function](numbers) if numbers else None

    return aggregated


def _binding(scope: Locals, at: RuntimeContext, operands: tuple[Meaning, ...]) -> Binding:
    values = [operand(scope, at) for operand in operands]
    return tuple(identity(value) for value in values if isinstance(value, Entity | Report))


def _witnessed(node: Quantified) -> Meaning | None:
    """Compile `exists r in D: rule(v, r)` as a look-up in the registry's witnesses; None if the expression has another
    form.
    """
    body = node.body
    if node.quantifier != "exists" or not isinstance(body, Call) or not body.rule:
        return None
    names = [argument.name if isinstance(argument, Ref) else None for argument in body.arguments]
    if None in names or names.count(node.variable) != 1:
        return None
    name, place = body.function, names.index(node.variable)
    others = tuple(meaning(other, RUNNING) for number, other in enumerate(body.arguments) if number != place)

    def witnessed(scope: Locals, at: RuntimeContext) -> Value:
        rule = at.rules.get(name)
        if rule is None or len(names) != len(rule.parameters) or rule.parameters[place].domain != node.domain:
            return None
        rest = _binding(scope, at, others)
        return None if len(rest) < len(others) else (name, place, rest) in at.registry.witnesses

    return witnessed


def depends_on_motion(expr: Expr, rules: Mapping[str, Rule], entities: frozenset[str], kinds: frozenset[str]) -> bool:
    """Return whether the condition depends on positions. Only then is it evaluated at every macro-step.

    `entities` are the local names bound to entities. An entity as argument of `truth(v, …)`, `assigned(…)` or another
    rule does not make a condition depend on motion; its fields, or its use as a place, do.
    """
    if isinstance(expr, Call):
        if expr.rule:
            rule = rules.get(expr.function)
            return rule is not None and rule_depends_on_motion(rule, rules, kinds)
        if expr.function in OPERATIONS and OPERATIONS[expr.function].of_time:
            return True
        return any(
            depends_on_motion(item, rules, entities, kinds) for item in expr.arguments if not isinstance(item, Ref)
        )
    if isinstance(expr, Ref):
        flows = expr.kind == "clock" and expr.name != TICK
        return flows or expr.kind in ("group", "entity") or expr.name in entities
    if isinstance(expr, Quantified | Aggregate) and expr.domain not in kinds:
        entities = entities | {expr.variable}
    return any(depends_on_motion(child, rules, entities, kinds) for child in children(expr))


def rule_depends_on_motion(rule: Rule, rules: Mapping[str, Rule], kinds: frozenset[str]) -> bool:
    """Return `depends_on_motion` of a rule's own condition with its parameters bound."""
    entities = frozenset(parameter.name for parameter in rule.parameters if parameter.domain not in kinds)
    return depends_on_motion(rule.condition, rules, entities, kinds)


def is_decided_on_arrival(rule: Rule, rules: Mapping[str, Rule], kinds: frozenset[str]) -> bool:
    """Return whether a binding's truth is final at the boundary where its report arrives.

    This holds if exactly one parameter is a report and the condition reads nothing but that report, its picture's
    ground truth, constants and rules of the same kind about the same report. Such a binding is evaluated only once.
    """
    reports = [parameter.name for parameter in rule.parameters if parameter.domain in kinds]
    if len(reports) != 1 or rule_depends_on_motion(rule, rules, kinds):
        return False
    return all(_fixed(part, reports[0], rules, kinds) for part in parts(rule.condition))


def _fixed(part: Expr, report: str, rules: Mapping[str, Rule], kinds: frozenset[str]) -> bool:
    match part:
        case Quantified():
            return False
        case Call(function=name, rule=True, arguments=arguments):
            about = any(isinstance(argument, Ref) and argument.name == report for argument in arguments)
            return about and name in rules and is_decided_on_arrival(rules[name], rules, kinds)
        case Call(function=name):
            return OPERATIONS[name].stable
    return True
