"""Expressions of the mission graph as the author would write them: units, ranks and names turned back.

The inverse of `lingjing.dsl.checking.elaborate`: what is written here elaborates to the expression it was written from.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

from lingjing.mission import expression as ex
from lingjing.mission import model
from lingjing.mission.functions import DISTRIBUTIONS, FUNCTIONS, RANKS, STATE_FIELDS
from lingjing.mission.units import BY_DIMENSION, si_value, unit_of

RANGE, SUM, OPERAND = RANKS[".."], RANKS["+"], 8
"""Ranks: of a range, of its ends, and of what binds tighter than any operator."""
_MOST_DIGITS = 17
_FIELDS = {lowered: name for name, (lowered, _) in STATE_FIELDS.items()}
LocalNames = Mapping[str, str]
"""Bound names → the group or the message kind they range over."""


def number_text(value: float, unit: str) -> str:
    """A quantity in its author's unit: the shortest number that is exactly `value` in SI.

    Where none is (a value that was computed elsewhere), it is given in the SI unit of the dimension.
    """
    found = unit_of(unit) if unit else None
    if found is None or not math.isfinite(value):
        return _digits(value)
    guess = value / found.factor
    for digits in range(1, _MOST_DIGITS + 1):
        if si_value(float(f"{guess:.{digits}g}"), unit) == value:
            return f"{_digits(float(f'{guess:.{digits}g}'))} {unit}"
    for near in (math.nextafter(guess, math.inf), math.nextafter(guess, -math.inf)):
        if si_value(near, unit) == value:
            return f"{_digits(near)} {unit}"
    known = BY_DIMENSION.get(found.dimension)
    return f"{_digits(value)} {known.unit}".rstrip() if known else f"{_digits(guess)} {unit}"


def quoted(text: str) -> str:
    """A text in quotes."""
    escaped = text.replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n").replace("\t", "\\t")
    return f'"{escaped}"'


def long_text(text: str, indent: int) -> str:
    """A text in quotes: over several lines, indented, if it has several and reads back the same; else on one line."""
    lines = text.split("\n")
    plain = all(line == line.rstrip() and "\r" not in line and "\t" not in line for line in lines)
    flush = any(line and not line[0].isspace() for line in lines[1:] or lines)
    if len(lines) < 2 or not plain or not flush or not lines[0] or not lines[-1] or '"""' in text or text[-1] == '"':
        return quoted(text)
    margin = " " * indent
    body = "\n".join(f"{margin}{line}".rstrip() for line in text.replace("\\", "\\\\").split("\n"))
    return f'"""\n{body}\n{margin}"""'


def _digits(value: float) -> str:
    return str(int(value)) if value == int(value) and abs(value) < 1e15 else repr(value)


class Phrases:
    """Writes the expressions of one mission."""

    def __init__(self, mission: model.Mission) -> None:
        self.groups = {group.name: group for group in mission.groups}
        self._writers: dict[type, Callable[[Any, int, LocalNames], str]] = {
            ex.Number: lambda node, _rank, _locals: number_text(node.value, node.unit),
            ex.Text: lambda node, _rank, _locals: quoted(node.value),
            ex.Flag: lambda node, _rank, _locals: "true" if node.value else "false",
            ex.Symbol: lambda node, _rank, _locals: node.name,
            ex.Ref: lambda node, _rank, _locals: node.name,
            ex.Index: self._index,
            ex.Attr: self._attribute,
            ex.Point: lambda node, _rank, names: f"({self._listed(node.items, names)})",
            ex.Sequence: lambda node, _rank, names: f"[{self._listed(node.items, names)}]",
            ex.Range: self._range,
            ex.Call: lambda node, _rank, names: self._call(node.function, node, names),
            ex.Draw: lambda node, _rank, names: self._call(node.distribution, node, names),
            ex.Unary: self._unary,
            ex.Binary: self._binary,
            ex.Quantified: self._quantified,
            ex.Aggregate: self._aggregate,
        }

    def text(self, node: ex.Expr, rank: int = 0, names: LocalNames | None = None) -> str:
        """The expression; in brackets if it binds looser than `rank`."""
        return self._writers[type(node)](node, rank, names or {})

    def declared(self) -> dict[tuple[str, str], str]:
        """The declared properties as they are written, by (group, property)."""
        groups = self.groups.values()
        return {(group.name, prop.name): self.text(prop.value) for group in groups for prop in group.properties}

    def field(self, source: ex.Expr, lowered: str, names: LocalNames | None = None) -> str:
        """The author's name of a lowered field of an entity (or of what is none: then the name itself)."""
        group = self.groups.get(self._entity(source, names or {}))
        if group is None and not isinstance(source, ex.Symbol):
            return lowered
        if lowered in _FIELDS:
            return _FIELDS[lowered]
        given = next((prop for prop in group.properties if prop.name == lowered), None) if group else None
        return given.plain if given is not None else lowered

    # -- writers

    def _listed(self, items: tuple[ex.Expr, ...], names: LocalNames) -> str:
        return ", ".join(self.text(item, 0, names) for item in items)

    def _index(self, node: ex.Index, _rank: int, names: LocalNames) -> str:
        return f"{self.text(node.base, OPERAND, names)}[{self.text(node.index, 0, names)}]"

    def _attribute(self, node: ex.Attr, _rank: int, names: LocalNames) -> str:
        return f"{self.text(node.base, OPERAND, names)}.{self.field(node.base, node.name, names)}"

    def _entity(self, node: ex.Expr, names: LocalNames) -> str:
        """The group an expression picks a member of, or the empty string."""
        base = node.base if isinstance(node, ex.Index) else node
        return names.get(base.name, base.name) if isinstance(base, ex.Ref) else ""

    def _range(self, node: ex.Range, rank: int, names: LocalNames) -> str:
        return _bracketed(f"{self.text(node.low, SUM, names)}..{self.text(node.high, SUM, names)}", rank > RANGE)

    def _call(self, function: str, node: ex.Call | ex.Draw, names: LocalNames) -> str:
        signature = FUNCTIONS.get(function) if isinstance(node, ex.Call) else DISTRIBUTIONS.get(function)
        relations = {option.name: option.relation for option in signature.options} if signature else {}
        arguments = [self.text(argument, 0, names) for argument in node.arguments]
        for name, value in node.named:
            arguments.append(self._named(name, relations.get(name, "="), value, names))
        return f"{function}({', '.join(arguments)})"

    def _named(self, name: str, relation: str, value: ex.Expr, names: LocalNames) -> str:
        if relation == "=" and isinstance(value, ex.Number) and value.value >= 0:
            return f"{name} {self.text(value, 0, names)}"
        return f"{name} {relation} {self.text(value, RANGE, names)}"

    def _unary(self, node: ex.Unary, rank: int, names: LocalNames) -> str:
        operand = node.operand
        if node.operator == "not":
            plain = isinstance(operand, ex.Call | ex.Ref | ex.Attr | ex.Flag)
            inner = self.text(operand, 0, names)
            return _bracketed(f"not {inner if plain else f'({inner})'}", rank > RANKS["not"])
        plain = isinstance(operand, ex.Call | ex.Ref | ex.Attr | ex.Index)
        inner = self.text(operand, 0, names)
        return f"-{inner}" if plain else f"-({inner})"

    def _binary(self, node: ex.Binary, rank: int, names: LocalNames) -> str:
        """A chain of operators is walked down its left side, as it was built."""
        own = RANKS[node.operator]
        right = self._side(node, rank, names)
        left = self.text(node.left, own, names)
        return _bracketed(f"{left} {node.operator} {right}", rank > own)

    def _side(self, node: ex.Binary, rank: int, names: LocalNames) -> str:
        right = node.right
        words = isinstance(right, ex.Sequence) and all(isinstance(item, ex.Symbol | ex.Ref) for item in right.items)
        if node.operator == "in" and isinstance(right, ex.Sequence) and words and right.items:
            return f"{{ {self._listed(right.items, names)} }}"
        if isinstance(right, ex.Quantified) and rank == 0:
            return self.text(right, 0, names)
        return self.text(right, RANKS[node.operator] + 1, names)

    def _quantified(self, node: ex.Quantified, rank: int, names: LocalNames) -> str:
        body = self.text(node.body, 0, {**names, node.variable: node.domain})
        return _bracketed(f"{node.quantifier} {node.variable} in {node.domain}: {body}", rank > 0)

    def _aggregate(self, node: ex.Aggregate, _rank: int, names: LocalNames) -> str:
        body = self.text(node.body, 0, {**names, node.variable: node.domain})
        return f"{node.function}({body} for {node.variable} in {node.domain})"


def _bracketed(text: str, needed: bool) -> str:
    return f"({text})" if needed else text
