"""Expressions as an author would write them: conditions, guards and bounds for people to read."""

from __future__ import annotations

from typing import assert_never

from lingjing.mission import expression as ex
from lingjing.mission.units import unit_of

_BINDS = {"or": 1, "and": 2, "==": 4, "!=": 4, "<": 4, "<=": 4, ">": 4, ">=": 4, "in": 4}
_BINDS |= {"+": 5, "-": 5, "*": 6, "/": 6}
_NOT, _MINUS, _ATOM = 3, 7, 9


def spell(expr: ex.Expr) -> str:
    """The expression in the language's own spelling, with no more brackets than it needs."""
    return _spell(expr)[0]


def _spell(expr: ex.Expr) -> tuple[str, int]:  # noqa: C901 - one case for each node class
    """The text and how tightly it binds."""
    match expr:
        case ex.Number(value=value, unit=unit):
            return _quantity(value, unit), _ATOM
        case ex.Text(value=text):
            return f'"{text}"', _ATOM
        case ex.Flag(value=flag):
            return "true" if flag else "false", _ATOM
        case ex.Symbol(name=name) | ex.Ref(name=name):
            return name, _ATOM
        case ex.Index(base=base, index=index):
            return f"{_within(base, _ATOM)}[{spell(index)}]", _ATOM
        case ex.Attr(base=base, name=name):
            return f"{_within(base, _ATOM)}.{name}", _ATOM
        case ex.Point(items=items):
            return f"({_listed(items)})", _ATOM
        case ex.Sequence(items=items):
            return f"[{_listed(items)}]", _ATOM
        case ex.Range(low=low, high=high):
            return f"{_within(low, 5)}..{_within(high, 5)}", 4
        case ex.Call(function=function, arguments=arguments, named=named):
            return f"{function}({', '.join((*map(spell, arguments), *_options(named)))})", _ATOM
        case ex.Draw(distribution=distribution, arguments=arguments, named=named):
            return f"{distribution}({', '.join((*map(spell, arguments), *_options(named, '≥')))})", _ATOM
        case ex.Unary(operator="not", operand=operand):
            return f"not {_within(operand, _NOT)}", _NOT
        case ex.Unary(operand=operand):
            return f"-{_within(operand, _MINUS)}", _MINUS
        case ex.Binary(operator=operator, left=left, right=right):
            binds = _BINDS[operator]
            return f"{_within(left, binds)} {operator} {_within(right, binds + 1)}", binds
        case ex.Quantified(quantifier=quantifier, variable=variable, domain=domain, body=body):
            span = f" in {domain}" if quantifier == "forall" else ""
            return f"{quantifier} {variable}{span}: {spell(body)}", 0
        case ex.Aggregate(function=function, variable=variable, domain=domain, body=body):
            return f"{function}({spell(body)} for {variable} in {domain})", _ATOM
        case _:
            assert_never(expr)


def _within(expr: ex.Expr, binds: int) -> str:
    text, own = _spell(expr)
    return text if own >= binds else f"({text})"


def _listed(items: tuple[ex.Expr, ...]) -> str:
    return ", ".join(map(spell, items))


def _options(named: tuple[tuple[str, ex.Expr], ...], relation: str = "=") -> tuple[str, ...]:
    return tuple(f"{name} {relation} {spell(value)}" for name, value in named)


def _quantity(value: float, unit: str) -> str:
    """A number in the unit its author used; the value is held in SI."""
    known = unit_of(unit) if unit else None
    amount = f"{value / known.factor if known else value:.10g}"
    if unit == "ticks" and amount == "1":
        unit = "tick"
    return f"{amount} {unit}" if unit else amount
