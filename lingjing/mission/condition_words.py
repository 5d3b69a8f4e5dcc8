"""Conditions of the mission graph in plain words, for readers who do not read code, and the bounds they set."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import msgspec

from lingjing.mission import expression as ex
from lingjing.mission.fold import Composite, Literal, Meaning, meaning
from lingjing.mission.functions import Operation, operation

_AGGREGATES = {"count": "the number of {1} for which {0}", "sum": "the sum of {0} over {1}"}
_SIGNS = {"<": "<", "<=": "≤", ">": ">", ">=": "≥"}
_TURNED = {"<": ">", "<=": "≥", ">": "<", ">=": "≤"}


class _Said(msgspec.Struct, frozen=True):
    """A part in words, as it is written (a declared property as its value), and what a bound of it is listed with."""

    words: str
    text: str
    measure: str | None = None


class ConditionWords:
    """Puts conditions into words: a reading whose world is the list of the bounds met so far, and whose bound names are
    the groups they range over.

    `text` writes what has no words of its own; `declared` are the values, as they are written, of the properties of
    groups, by (group, property).
    """

    def __init__(self, text: Callable[[ex.Expr], str], declared: Mapping[tuple[str, str], str]) -> None:
        self._text = text
        self._declared = declared

    def sentence(self, condition: ex.Expr) -> str:
        """The condition as a sentence without a full stop, in the order in which it is written."""
        said: _Said = meaning(condition, self)({}, [])
        return said.words

    def bounds(self, condition: ex.Expr, domains: Mapping[str, str]) -> tuple[str, ...]:
        """`≤ 25 m` for each bounded distance, `IoU ≥ 0.5` for each overlap, in reading order, each once. `domains` are
        the groups of bound names."""
        found: list[str] = []
        meaning(condition, self)(domains, found)
        return tuple(dict.fromkeys(found))

    def literal(self, node: Literal) -> Meaning:
        """As it is written."""
        return self._written(node)

    def name(self, node: ex.Ref) -> Meaning:
        """As it is written."""
        return self._written(node)

    def field(self, node: ex.Attr, base: Meaning) -> Meaning:
        """As it is written; of what has words of its own, those."""
        text, owner = self._text(node), node.base

        def said(names: Mapping[str, str], found: list[str]) -> _Said:
            told: _Said = base(names, found)
            if told.words != f"`{told.text}`":
                return _Said(told.words, text)
            group = names.get(owner.name, owner.name) if isinstance(owner, ex.Ref) else ""
            value = self._declared.get((group, node.name))
            return _Said(f"`{text}`", text if value is None else value)

        return said

    def apply(self, node: Composite, operands: tuple[Meaning, ...]) -> Meaning:
        """By the table of functions; what has no words there as it is written."""
        text, done, shape = self._text(node), operation(node), _shape(node, len(operands))

        def said(names: Mapping[str, str], found: list[str]) -> _Said:
            parts = [operand(names, found) for operand in operands]
            if isinstance(node, ex.Binary) and node.operator in _SIGNS:
                found.extend(_bound(node.operator, *parts))
            words = shape.format(*[part.words for part in parts]) if shape else f"`{text}`"
            return _Said(words, text, done.measure if done else None)

        return said

    def over(self, node: ex.Quantified | ex.Aggregate, body: Meaning) -> Meaning:
        """For every, for some, the number of."""
        text, whom = self._text(node), f"{node.domain} `{node.variable}`"

        def said(names: Mapping[str, str], found: list[str]) -> _Said:
            inner = body({**names, node.variable: node.domain}, found).words
            if isinstance(node, ex.Quantified):
                amount = "every" if node.quantifier == "forall" else "some"
                return _Said(f"for {amount} {whom}, {inner}", text)
            shape = _AGGREGATES.get(node.function, f"the {node.function}imum of {{0}} over {{1}}")
            return _Said(shape.format(inner, f"every {whom}"), text)

        return said

    def _written(self, node: ex.Expr) -> Meaning:
        text = self._text(node)
        return lambda names, found: _Said(f"`{text}`", text)


def _shape(node: Composite, count: int) -> str:
    """How a part of `count` operands is worded, `{0}` the first of them; "" if it has no words."""
    match node:
        case ex.Binary(operator="and" | "or" as joined):
            return f"{_side(node, node.left, 0)} {joined} {_side(node, node.right, 1)}"
        case ex.Binary(operator="in", right=ex.Sequence()):
            return "{0} is one of {1}"
        case ex.Call(rule=True, function=name):
            whom = " and ".join(f"{{{number}}}" for number in range(count))
            return f"*{name}* holds for {whom}" if whom else f"*{name}* holds"
    done = operation(node)
    return "" if done is None else _worded(done, count)


def _side(node: ex.Binary, side: ex.Expr, number: int) -> str:
    mixed = isinstance(side, ex.Binary) and side.operator in ("and", "or") and side.operator != node.operator
    return f"({{{number}}})" if mixed else f"{{{number}}}"


def _worded(done: Operation, count: int) -> str:
    """The wording for so many operands: what is in brackets is left out where its operand is."""
    always, _, more = done.words.partition("[")
    for words in (always + more.rstrip("]"), always):
        if words.count("{") == count:
            return words
    return ""


def _bound(symbol: str, left: _Said, right: _Said) -> list[str]:
    """The bound that a comparison sets to something measured."""
    if left.measure is not None:
        return [f"{left.measure}{_SIGNS[symbol]} {right.text}"]
    return [f"{right.measure}{_TURNED[symbol]} {left.text}"] if right.measure is not None else []
