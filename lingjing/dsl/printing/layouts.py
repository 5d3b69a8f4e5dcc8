"""Layouts of `lingjing.dsl.syntax.statements` → statements.

`{field}` in a template is the text of a field of the mission's part: a name, an expression, a condition, or a list of
them. Forms change it: `range` and `sum` put an expression in brackets if it binds looser than a range or a sum; `arrow`
writes a flag as `<->` or `->`; `mark` writes a flag as its name; `all` writes an empty name as `*`; `quoted` writes a
text with its quotes; `nonzero` is empty for the number 0. A part in `[…]` is left out if one of its fields is empty or
has its default.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator

import msgspec

from lingjing.dsl.printing.phrases import quoted
from lingjing.dsl.syntax.statements import STATEMENTS
from lingjing.mission import expression as ex
from lingjing.mission import model
from lingjing.mission.expression_text import RANGE, SUM, LocalNames

WriteExpression = Callable[[ex.Expr, int, LocalNames], str]
"""Writes an expression: the expression, the rank of its place, and the local names with their domains."""

_OPTIONAL = re.compile(r"\[([^\]]*)\]|([^\[]+)")
_FIELD = re.compile(r"\{(\w+)(?::(\w+))?\}")
_RANKS = {"range": RANGE, "sum": SUM}
_LAYOUTS = {kind.part: kind.layout for kind in STATEMENTS if kind.layout is not None}
"""Field of a mission → the layout of its items."""


def block(head: str, lines: Iterable[str], *, spread: bool = False) -> str:
    """A statement with a block; on several lines if `spread` or if a line has several."""
    items = list(lines)
    if not items:
        return f"{head} {{}}"
    if spread or any("\n" in item for item in items):
        return f"{head} {{\n" + "\n".join(items) + "\n}"
    return f"{head} {{ {', '.join(items)} }}"


def has_layout(part: str) -> bool:
    """True if the items of this field of a mission are printed by a layout."""
    return part in _LAYOUTS


def lay_out(part: str, item: msgspec.Struct, write: WriteExpression) -> str:
    """The statement that declares an item of a field of a mission."""
    layout = _LAYOUTS[part]
    writer = _ItemWriter(item, write)
    field, template = layout.instead
    if field and getattr(item, field):
        return writer.filled(template)
    head = writer.filled(layout.head)
    return block(head, writer.lines(layout.lines)) if layout.lines else head


class _ItemWriter:
    """Fills templates with the fields of one item."""

    def __init__(self, item: msgspec.Struct, write: WriteExpression) -> None:
        self.item = item
        self.write = write
        self.names = _bound_names(item)
        self.defaults = {field.name: field.default for field in msgspec.structs.fields(item)}

    def lines(self, templates: tuple[str, ...]) -> Iterator[str]:
        """The lines of the block, without empty ones."""
        for template in templates:
            if template.startswith("*"):
                part = template[1:]
                yield from (lay_out(part, item, self.write) for item in getattr(self.item, part))
            elif line := self.filled(template):
                yield line

    def filled(self, template: str) -> str:
        """A template with the texts of its fields, without the optional parts that are empty."""
        parts = (self._optional(match[1]) if match[2] is None else self._texts(match[2])
                 for match in _OPTIONAL.finditer(template))  # fmt: skip
        return "".join(parts)

    def _optional(self, template: str) -> str:
        fields = list(_FIELD.finditer(template))
        absent = any(
            getattr(self.item, match[1]) == self.defaults[match[1]] or not self._text(match[1], match[2])
            for match in fields
        )
        return "" if absent else self._texts(template)

    def _texts(self, template: str) -> str:
        return _FIELD.sub(lambda match: self._text(match[1], match[2]), template)

    def _text(self, field: str, form: str | None) -> str:
        value = getattr(self.item, field)
        if form == "arrow":
            return "<->" if value else "->"
        if form == "mark":
            return f"{field} " if value else ""
        if form == "all":
            return value or "*"
        if form == "quoted":
            return quoted(value)
        if form == "nonzero" and value == ex.Number(0.0):
            return ""
        return self._phrase(value, _RANKS.get(form or "", 0))

    def _phrase(self, value: object, rank: int) -> str:
        match value:
            case None:
                return ""
            case str():
                return value
            case tuple():
                return ", ".join(self._phrase(item, rank) for item in value)
            case model.Guard():
                return self._phrase(value.condition, rank)
            case model.RuleParameter():
                return f"{value.name}: {value.domain}"
            case model.Counted(kind="claims"):
                return "claims"
            case model.Counted():
                resource = "" if value.resource is None else f"{self._phrase(value.resource, 0)}."
                return resource + (value.name or "*")
        return self.write(value, rank, self.names)  # type: ignore[arg-type]


def _bound_names(item: msgspec.Struct) -> dict[str, str]:
    """The names that an item binds, with their domains: its parameters, or its variable."""
    parameters = getattr(item, "parameters", ())
    variable, domain = getattr(item, "variable", None), getattr(item, "domain", None)
    names = {parameter.name: parameter.domain for parameter in parameters}
    return names | ({variable: domain} if variable and domain else {})
