"""Comparisons of a message's sender with an agent, `r.sender == scout[1]`, and of its role, `r.role == searcher`."""

from __future__ import annotations

from lingjing.dsl.checking.expressions import ExpressionChecker
from lingjing.dsl.checking.typenames import with_article
from lingjing.dsl.checking.values import UNKNOWN, Environment, TypedExpression
from lingjing.dsl.syntax import tree as s
from lingjing.mission import expression as ex
from lingjing.mission.functions import MESSAGE_FIELDS, Type

SENDING = ("agent", "role")
"""Details of the types of the fields `sender` and `role`."""


def is_sending(value: TypedExpression) -> bool:
    """True for the sender of a message, or the sender's role."""
    return value.type.kind == "name" and value.type.of in SENDING


def sender_side(
    of: ExpressionChecker, sending: TypedExpression, node: s.Expression, environment: Environment
) -> TypedExpression:
    """Check the other side of a comparison with a sender or its role: an agent or a role, or a list of them."""
    if isinstance(node, s.List | s.NameSet):
        items = node.items if isinstance(node, s.List) else node.names
        checked = [sender_side(of, sending, item, environment) for item in items]
        listed = ex.Sequence(tuple(item.ir for item in checked))
        return UNKNOWN if UNKNOWN in checked else TypedExpression(listed, Type("list", item="name"))
    if isinstance(node, s.Name) and node.text not in environment.locals:
        return _agent(of, node) if sending.type.of == "agent" else _role(of, node)
    if isinstance(node, s.Subscript) and isinstance(node.base, s.Name) and sending.type.of == "agent":
        return _member(of, node, node.base)
    if isinstance(node, s.TextLiteral) and node.value in (*of.scope.agents, *of.scope.roles):
        of.report.at("LJ0201", node, "names stand without quotes", f"write `{node.value}`", replace=node.value)
        return UNKNOWN
    value = of.value(node, environment)
    if value.type.kind == "any" or value.type == sending.type:
        return value
    due = with_article(sending.type)
    of.report.at("LJ0201", node, f"{due} is due here, this is {with_article(value.type)}")
    return UNKNOWN


def _agent(of: ExpressionChecker, node: s.Name) -> TypedExpression:
    name, scope = node.text, of.scope
    head = scope.agent_heads.get(name)
    if head is None and name in scope.roles:
        of.report.at(
            "LJ0201", node, f"`{name}` is a role, an agent is due here", f"compare the role: `r.role == {name}`"
        )
        return UNKNOWN
    if head is None:
        return of.unknown_name(node, list(scope.agents), "no agent")
    if head.index is not None:
        hint = f"name one: `{name}[1]`, or compare the role: `r.role == {head.role.text}`"
        of.report.at("LJ0201", node, f"`{name}` is a group of agents", hint)
        return UNKNOWN
    return TypedExpression(ex.Symbol(name), MESSAGE_FIELDS["sender"])


def _role(of: ExpressionChecker, node: s.Name) -> TypedExpression:
    name, scope = node.text, of.scope
    if name in scope.roles:
        return TypedExpression(ex.Symbol(name), MESSAGE_FIELDS["role"])
    if name in scope.agents:
        hint = f"compare the sender: `r.sender == {name}`"
        of.report.at("LJ0201", node, f"`{name}` is an agent, a role is due here", hint)
        return UNKNOWN
    return of.unknown_name(node, list(scope.roles), "no role")


def _member(of: ExpressionChecker, node: s.Subscript, base: s.Name) -> TypedExpression:
    head = of.scope.agent_heads.get(base.text)
    if head is None:
        return of.unknown_name(base, list(of.scope.agents), "no agent")
    if head.index is None:
        of.report.at("LJ0201", node, f"`{base.text}` is one agent", f"write `{base.text}`", replace=base.text)
        return UNKNOWN
    number = of.constant(of.value(node.index, Environment()).ir)
    if number is None or number < 1 or number != int(number):
        of.report.at("LJ0201", node.index, "the members of a group of agents are counted 1, 2, 3, …", "write a number")
        return UNKNOWN
    most = of.constant(of.value(_last(head.index), Environment()).ir)
    if most is not None and isinstance(_last(head.index), s.NumberLiteral) and number > most:
        of.report.at("LJ0206", node.index, f"`{base.text}` has {most:g} members, there is no {number:g}")
        return UNKNOWN
    return TypedExpression(ex.Symbol(f"{base.text}[{number:g}]"), MESSAGE_FIELDS["sender"])


def _last(index: s.Expression) -> s.Expression:
    """The `n` of `1..n` or `i in 1..n`."""
    spread = index.right if isinstance(index, s.BinaryExpr) and index.operator == "in" else index
    return spread.right if isinstance(spread, s.BinaryExpr) and spread.operator == ".." else spread
