"""Expressions of the mission graph as an author writes them: with units, brackets and declared names.

It is the inverse of `lingjing.dsl.checking.elaborate`: the text elaborates to the same expression.
"""

from __future__ import annotations

import math

from lingjing.mission import expression as ex
from lingjing.mission import model
from lingjing.mission.expression_text import RANGE, ExpressionWriter, LocalNames
from lingjing.mission.functions import STATE_FIELDS
from lingjing.mission.units import BY_DIMENSION, si_value, unit_of

_MOST_DIGITS = 17
"""Significant digits that identify every double-precision number."""
_FIELDS = {lowered: name for name, (lowered, _) in STATE_FIELDS.items()}
"""Name of a field in the graph → its name in the language."""


def number_text(value: float, unit: str) -> str:
    """A quantity in its author's unit: the shortest number that is exactly `value` in SI.

    If there is none (for a value that was computed), it is given in the SI unit of the dimension.
    """
    known_unit = unit_of(unit) if unit else None
    if known_unit is None or not math.isfinite(value):
        return _digits(value)
    guess = value / known_unit.factor
    for digits in range(1, _MOST_DIGITS + 1):
        if si_value(float(f"{guess:.{digits}g}"), unit) == value:
            return f"{_digits(float(f'{guess:.{digits}g}'))} {unit}"
    for near in (math.nextafter(guess, math.inf), math.nextafter(guess, -math.inf)):
        if si_value(near, unit) == value:
            return f"{_digits(near)} {unit}"
    known = BY_DIMENSION.get(known_unit.dimension)
    return f"{_digits(value)} {known.unit}".rstrip() if known else f"{_digits(guess)} {unit}"


def quoted(text: str) -> str:
    """The text in quotes, with escapes."""
    escaped = text.replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n").replace("\t", "\\t")
    return f'"{escaped}"'


def long_text(text: str, indent: int) -> str:
    """The text in triple quotes over several lines, if it has several and reads back equal; else on one line."""
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
        """The declared properties as text, by (group, property)."""
        groups = self.groups.values()
        return {(group.name, prop.name): self.text(prop.value) for group in groups for prop in group.properties}

    def number(self, value: float, unit: str) -> str:
        """The number, exactly."""
        return number_text(value, unit)

    def quoted(self, text: str) -> str:
        """The text in quotes, with escapes."""
        return quoted(text)

    def field(self, owner: ex.Expr, name: str, names: LocalNames) -> str:
        """The author's name of an entity's field in the graph; the name itself for other owners."""
        group = self.groups.get(_entity(owner, names))
        if group is None and not isinstance(owner, ex.Symbol):
            return name
        if name in _FIELDS:
            return _FIELDS[name]
        declared = next((prop for prop in group.properties if prop.name == name), None) if group else None
        return declared.plain if declared is not None else name

    def option(self, name: str, relation: str, value: ex.Expr, names: LocalNames) -> str:
        """An option of a call with its relation; `=` before a plain number is left out."""
        if relation == "=" and isinstance(value, ex.Number) and value.value >= 0:
            return f"{name} {self.text(value, 0, names)}"
        return f"{name} {relation} {self.text(value, RANGE, names)}"

    def unary(self, node: ex.Unary, names: LocalNames) -> str:
        """A unary operator, with brackets around all operands except names and calls."""
        last = ex.Flag if node.operator == "not" else ex.Index
        inner = self.text(node.operand, 0, names)
        plain = isinstance(node.operand, ex.Call | ex.Ref | ex.Attr | last)
        return f"{'not ' if node.operator == 'not' else '-'}{inner if plain else f'({inner})'}"

    def right(self, node: ex.Binary, rank: int, names: LocalNames) -> str:
        """The right side of an operator. Lists of names become sets; a final quantifier needs no brackets."""
        right = node.right
        words = isinstance(right, ex.Sequence) and all(map(_is_word, right.items))
        if node.operator == "in" and isinstance(right, ex.Sequence) and words and right.items:
            return f"{{ {self.listed(right.items, names)} }}"
        if isinstance(right, ex.Quantified) and rank == 0:
            return self.text(right, 0, names)
        return super().right(node, rank, names)

    def quantified(self, node: ex.Quantified, body: str) -> tuple[str, int]:
        """A quantifier with its domain."""
        return f"{node.quantifier} {node.variable} in {node.domain}: {body}", 0


def _is_word(item: ex.Expr) -> bool:
    """True for a name; a member of a group of agents (`scout[1]`) is none."""
    return isinstance(item, ex.Ref) or (isinstance(item, ex.Symbol) and "[" not in item.name)


def _entity(node: ex.Expr, names: LocalNames) -> str:
    """The group that an expression picks a member of; "" for other expressions."""
    base = node.base if isinstance(node, ex.Index) else node
    return names.get(base.name, base.name) if isinstance(base, ex.Ref) else ""
