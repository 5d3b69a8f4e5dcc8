"""Expressions of the mission graph as the author would write them: units, ranks and names turned back.

The inverse of `lingjing.dsl.checking.elaborate`: what is written here elaborates to the expression it was written from.
"""

from __future__ import annotations

import math

from lingjing.mission import expression as ex
from lingjing.mission import model
from lingjing.mission.expression_text import RANGE, ExpressionWriter, LocalNames
from lingjing.mission.functions import STATE_FIELDS
from lingjing.mission.units import BY_DIMENSION, si_value, unit_of

_MOST_DIGITS = 17
_FIELDS = {lowered: name for name, (lowered, _) in STATE_FIELDS.items()}


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


class Phrases(ExpressionWriter):
    """Writes the expressions of one mission."""

    def __init__(self, mission: model.Mission) -> None:
        self.groups = {group.name: group for group in mission.groups}

    def declared(self) -> dict[tuple[str, str], str]:
        """The declared properties as they are written, by (group, property)."""
        groups = self.groups.values()
        return {(group.name, prop.name): self.text(prop.value) for group in groups for prop in group.properties}

    def number(self, value: float, unit: str) -> str:
        """Exactly the value."""
        return number_text(value, unit)

    def quoted(self, text: str) -> str:
        """With what is special in it escaped."""
        return quoted(text)

    def field(self, owner: ex.Expr, name: str, names: LocalNames) -> str:
        """The author's name of a lowered field of an entity (or of what is none: then the name itself)."""
        group = self.groups.get(_entity(owner, names))
        if group is None and not isinstance(owner, ex.Symbol):
            return name
        if name in _FIELDS:
            return _FIELDS[name]
        given = next((prop for prop in group.properties if prop.name == name), None) if group else None
        return given.plain if given is not None else name

    def option(self, name: str, relation: str, value: ex.Expr, names: LocalNames) -> str:
        """With its relation, which a plain number does without where it is `=`."""
        if relation == "=" and isinstance(value, ex.Number) and value.value >= 0:
            return f"{name} {self.text(value, 0, names)}"
        return f"{name} {relation} {self.text(value, RANGE, names)}"

    def unary(self, node: ex.Unary, names: LocalNames) -> str:
        """With brackets around all but a name or a call."""
        last = ex.Flag if node.operator == "not" else ex.Index
        inner = self.text(node.operand, 0, names)
        plain = isinstance(node.operand, ex.Call | ex.Ref | ex.Attr | last)
        return f"{'not ' if node.operator == 'not' else '-'}{inner if plain else f'({inner})'}"

    def right(self, node: ex.Binary, rank: int, names: LocalNames) -> str:
        """A list of names as a set, and a quantifier at the end of a condition without brackets."""
        right = node.right
        words = isinstance(right, ex.Sequence) and all(isinstance(item, ex.Symbol | ex.Ref) for item in right.items)
        if node.operator == "in" and isinstance(right, ex.Sequence) and words and right.items:
            return f"{{ {self.listed(right.items, names)} }}"
        if isinstance(right, ex.Quantified) and rank == 0:
            return self.text(right, 0, names)
        return super().right(node, rank, names)

    def quantified(self, node: ex.Quantified, body: str) -> tuple[str, int]:
        """With what it ranges over."""
        return f"{node.quantifier} {node.variable} in {node.domain}: {body}", 0


def _entity(node: ex.Expr, names: LocalNames) -> str:
    """The group an expression picks a member of, or the empty string."""
    base = node.base if isinstance(node, ex.Index) else node
    return names.get(base.name, base.name) if isinstance(base, ex.Ref) else ""
