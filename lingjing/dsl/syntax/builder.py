"""Reductions of the grammar → nodes of the syntax tree, by alias of `ljs.lark`.

`NODES` lists the reductions that become a node directly; the methods of `Builder` do the others and rank operators. The
arguments of a reduction are the values of the right-hand side in order, including tokens, with None for absent ones. An
expression under construction is a flat list `[operand, operator, operand, …]` until it is reduced to a `value`. Its
depth is limited here, so that no later phase recurses too deeply.
"""

# ruff: noqa: D102 - the docstring of a reduction is its rule in ljs.lark
from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any, TypeVar

from lingjing.dsl.source.reporter import Reporter
from lingjing.dsl.syntax import tree as s
from lingjing.dsl.syntax.statements import STATEMENTS
from lingjing.dsl.syntax.tokens import Token
from lingjing.mission.functions import RANKS
from lingjing.patterns import pattern

DEEPEST = 120
"""Most levels of an expression's tree (chosen): the longest rule of the project's missions has eight."""

_ESCAPE = pattern(r"\\(.)")
_ESCAPES = {"n": "\n", "t": "\t"}
T = TypeVar("T")
Arguments = list[s.CallArgument]
FlatExpr = list[Any]
"""`[operand, operator token, operand, …]`, or a single operand."""

_OTHER_NODES: dict[str, tuple[type[s.SyntaxNode], str]] = {
    "set": (s.NameSet, "_ names _"),
    "typed": (s.Typed, "name _ type _ bounds optional"),
    "clause": (s.Clause, "keyword name"),
    "channel": (s.ObservedChannel, "source everything"),
    "axis": (s.Axis, "name _ values"),
    "bounded": (s.PropertyLine, "name relation value"),
    "field": (s.FieldLine, "typed"),
    "bare": (s.Bare, "name"),
    "unknown_block": (s.UnknownBlock, "name block"),
    "subscript": (s.Subscript, "base _ index _"),
    "attribute": (s.FieldExpr, "base _ name"),
    "unary": (s.UnaryExpr, "operator operand"),
    "quantified": (s.QuantifiedExpr, "quantifier variable _ domain _ body"),
    "named": (s.CallArgument, "name _ value"),
    "named_number": (s.CallArgument, "name value"),
    "range": (s.ForClause, "variable _ domain"),
    "share": (s.ShareTerm, "word"),
    "least": (s.LeastTerm, "_ _ least _ of"),
    "within": (s.WithinTerm, "_ limit"),
    "seeds": (s.SeedsTerm, "_ _ first _ last"),
    "settings": (s.SettingsTerm, "_ settings"),
    "setting": (s.Axis, "name _ values"),
}
"""The reductions without a row in `lingjing.dsl.syntax.statements`."""


def _statement_nodes() -> dict[str, tuple[type[s.SyntaxNode], str]]:
    nodes: dict[str, tuple[type[s.SyntaxNode], str]] = {}
    for kind in STATEMENTS:
        for form in kind.forms:
            if kind.node is not None and not form.built:
                first = "keyword" if "keyword" in kind.node.__struct_fields__ else "_"
                labels = [element.label or "_" for element in form.elements()]
                subject = [element.label for element in form.subject_elements()]
                nodes[form.alias or kind.keyword] = (kind.node, " ".join([*subject, first, *labels]))
    return nodes


NODES = _statement_nodes() | _OTHER_NODES
"""Alias → the node, and the field that each symbol on the right-hand side fills; `_` fills none.

The node extends from the start of its first symbol to the end of its last. A text field takes the token's text, a
boolean field is True if the symbol is present; any other token becomes a name, a number or a text. A field without a
symbol is empty: None, False or `()`. The most frequent nodes of long missions have methods instead, which are
faster."""


class Builder:
    """Builds nodes from reductions."""

    def __init__(self, report: Reporter) -> None:
        self.report = report

    def actions(self) -> dict[str, Callable[..., Any]]:
        """Alias → function that builds its value."""
        methods = {name: getattr(self, name) for name in dir(self) if not name.startswith("_")}
        return methods | {alias: self._node(node, _places(alias)) for alias, (node, _) in NODES.items()}

    # -- lists and structure

    def first(self, item: T) -> list[T]:
        return [item]

    def more(self, items: list[T], *rest: T) -> list[T]:
        items.append(rest[-1])
        return items

    def inside(self, _opening: Token, value: T, *_closing: Token) -> T:
        return value

    def file(self, items: list[s.Statement] | None = None) -> s.File:
        return s.File(0, items[-1].end, tuple(items)) if items else s.File(0, 0, ())

    def block(self, opening: Token, items: list[s.Statement] | None, closing: Token) -> s.BracedBlock:
        return s.BracedBlock(opening.start, closing.end, tuple(items or ()))

    # -- statements

    def property(
        self,
        hidden: Token | None,
        state: Token | None,
        name: Token,
        relation: Token,
        value: s.Expression,
        guard: s.Expression | None,
    ) -> s.PropertyLine:
        start, end = (hidden or state or name).start, (guard or value).end
        named = self.name(name)
        return s.PropertyLine(start, end, named, relation.text, value, hidden is not None, guard, state is not None)

    def preset(self, keyword: Token, name: Token, block: s.BracedBlock | None) -> s.SettingsBlock:
        inside = block or s.BracedBlock(name.end, name.end, ())
        return s.SettingsBlock(keyword.start, inside.end, keyword.text, inside, self.name(name))

    def mode(self, keyword: Token, default: Token, _in: Token | None, allowed: s.NameSet | None) -> s.ModeLine:
        only = self.name(default)
        names = allowed or s.NameSet(only.start, only.end, (only,))
        return s.ModeLine(keyword.start, names.end, only, names)

    def text_line(self, keyword: Token, language: Token | None, text: Token) -> s.TextLine:
        literal = self.text(text)
        if language is not None and language.end == text.start:  # `f"…"` of Python, and no language
            message, hint = "a text has no letter before its quotes", 'write `"…"`: `{name}` in it names a value'
            self.report.at("LJ0010", language, message, hint, replace="")
            language = None
        code = self.name(language) if language is not None else None
        return s.TextLine(keyword.start, literal.end, keyword.text, code, literal)

    def faulty(self, error: Token, block: s.BracedBlock | None) -> s.Faulty:
        return s.Faulty(error.start, (block or error).end, tuple(error.text.split()), block)

    # -- expressions

    def operand(self, value: s.Expression) -> s.Expression:
        return value

    def operation(self, left: FlatExpr, operator: Token, right: s.Expression) -> FlatExpr:
        if type(left) is list:
            left.append(operator)
            left.append(right)
            return left
        return [left, operator, right]

    def value(self, flat: FlatExpr | s.Expression) -> s.Expression:
        if type(flat) is not list:
            return flat  # type: ignore[return-value]
        if len(flat) > 2 * DEEPEST:
            start, end = flat[0].start, flat[-1].end
            self.report("LJ0005", start, end, f"an expression has more than {DEEPEST} operators", "split it into rules")
            return s.Broken(start, end)
        return _Ranker(self, flat).run()

    def name(self, token: Token) -> s.Name:
        return s.Name(token.start, token.end, token.text)

    def number(self, token: Token) -> s.NumberLiteral | s.Broken:
        try:
            value = float(token.text)
        except ValueError:
            return s.Broken(token.start, token.end)
        if value in (float("inf"), float("-inf")):
            self.report.at("LJ0006", token, f"`{token.text[:20]}` is too large a number")
            return s.Broken(token.start, token.end)
        return s.NumberLiteral(token.start, token.end, value, token.unit)

    def text(self, token: Token) -> s.TextLiteral:
        if token.text.startswith('""' + '"') and len(token.text) >= 6:
            raw = _dedented(token.text[3:-3])
        else:
            raw = token.text[1:-1] if len(token.text) > 1 and token.text.endswith('"') else token.text[1:]
        if "\\" in raw:
            raw = _ESCAPE.sub(lambda match: _ESCAPES.get(match[1], match[1]), raw)
        return s.TextLiteral(token.start, token.end, raw)

    def flag(self, token: Token) -> s.FlagLiteral:
        return s.FlagLiteral(token.start, token.end, token.text == "true")

    def paren(self, opening: Token, arguments: Arguments, closing: Token) -> s.Expression:
        items = self._unnamed(arguments)
        if len(items) == 1:
            item = items[0]
            if type(item) is s.UnaryExpr and item.operator == "not":  # brackets end the operand of `not`: see `_Ranker`
                return s.UnaryExpr(opening.start, closing.end, item.depth, "not", item.operand)
            return item
        return self._bounded(s.Tuple(opening.start, closing.end, _levels(*items), items))

    def list(self, opening: Token, arguments: Arguments | None, closing: Token) -> s.Expression:
        items = self._unnamed(arguments or [])
        return self._bounded(s.List(opening.start, closing.end, _levels(*items), items))

    def call(self, name: Token, _opening: Token, arguments: Arguments | None, closing: Token) -> s.Expression:
        values = tuple(arguments or ())
        depth = _levels(*[argument.value for argument in values])
        return self._bounded(s.CallExpr(name.start, closing.end, depth, self.name(name), values))

    def positional(self, value: s.Expression, _for: Token | None, over: s.ForClause | None) -> s.CallArgument:
        return s.CallArgument(value.start, (over or value).end, None, value, over)

    # -- private

    def _node(self, node: type[s.SyntaxNode], places: tuple[tuple[int, str], ...]) -> Callable[..., s.SyntaxNode]:
        """A function that builds a node from the values of its symbols, according to `NODES`."""
        composite = issubclass(node, s.CompositeExpr)

        def build(*values: Any) -> s.SyntaxNode:
            present = [value for value in values if value]
            first, last = present[0], present[-1]
            end = last[-1].end if type(last) is list else last.end
            values = (*values, None)
            parts = []
            for place, kind in places:
                value = values[place]
                if value is None:
                    value = _EMPTY[kind]
                elif type(value) is Token:
                    value = value.text if kind == "str" else kind == "bool" or self._leaf(value)
                elif type(value) is list:
                    value = tuple(map(self._leaf, value) if type(value[0]) is Token else value)
                parts.append(value)
            if composite:
                return self._bounded(node(first.start, end, _levels(*parts), *parts))  # type: ignore[arg-type, call-arg]
            return node(first.start, end, *parts)

        return build

    def _leaf(self, token: Token) -> s.SyntaxNode:
        return _LITERALS.get(token.type, Builder.name)(self, token)

    def _unnamed(self, arguments: Arguments) -> tuple[s.Expression, ...]:
        for argument in arguments:
            if argument.over is not None:
                over = argument.over
                self.report.at("LJ0012", over, "`for … in …` belongs into a call: `sum(… for x in group)`")
            if argument.name is not None:
                name = argument.name
                self.report.at("LJ0012", name, "only a call has named arguments")
        return tuple([argument.value for argument in arguments])

    def _bounded(self, node: s.CompositeExpr) -> s.Expression:
        if node.depth <= DEEPEST:
            return node  # type: ignore[return-value]
        self.report.at("LJ0005", node, f"an expression is nested deeper than {DEEPEST}")
        return s.Broken(node.start, node.end)


class _Ranker:
    """Precedence climbing over one flat list. `not` binds looser than comparisons and tighter than `and`."""

    def __init__(self, builder: Builder, flat: FlatExpr) -> None:
        self.builder = builder
        self.flat = flat
        self.at = 0

    def run(self) -> s.Expression:
        return self._climb(0)

    def _climb(self, least: int) -> s.Expression:
        left = self._operand()
        while self.at < len(self.flat):
            operator = self.flat[self.at].text
            rank = RANKS[operator]
            if rank < least:
                break
            self.at += 1
            right = self._climb(rank + 1)
            depth = _levels(left, right)
            left = self.builder._bounded(s.BinaryExpr(left.start, right.end, depth, operator, left, right))
        return left

    def _operand(self) -> s.Expression:
        value: s.Expression = self.flat[self.at]
        if type(value) is s.UnaryExpr and value.operator == "not" and not self._closed(value):
            self.flat[self.at] = value.operand
            operand = self._climb(RANKS["not"] + 1)
            depth = _levels(operand)
            return self.builder._bounded(s.UnaryExpr(value.start, operand.end, depth, "not", operand))
        self.at += 1
        return value

    def _closed(self, value: s.UnaryExpr) -> bool:
        """True if the `not` stands in its own brackets, so that its operand ends there."""
        return self.builder.report.source.text.startswith("(", value.start)


_EMPTY: dict[str, bool | tuple[()] | None] = {"bool": False, "tuple": (), "": None, "str": None}
_LITERALS: dict[str, Callable[[Builder, Token], s.SyntaxNode]] = {
    "NUMBER": Builder.number,
    "QUANTITY": Builder.number,
    "STRING": Builder.text,
}


def _dedented(raw: str) -> str:
    """The lines of a long text without their common indentation and without a blank first and last line."""
    lines = raw.replace("\r\n", "\n").replace("\r", "\n").split("\n")
    rest = [line for line in lines[1:] if line.strip()]
    margin = min((len(line) - len(line.lstrip(" \t")) for line in rest), default=0)
    kept = [lines[0].strip(), *(line[margin:].rstrip() for line in lines[1:])]
    while kept and not kept[0]:
        kept.pop(0)
    while kept and not kept[-1]:
        kept.pop()
    return "\n".join(kept)


@cache
def _places(alias: str) -> tuple[tuple[int, str], ...]:
    """For each field of an alias's node: the index of the symbol that fills it (-1 for none), and a key of `_EMPTY`."""
    node, spec = NODES[alias]
    annotations = {
        name: str(kind) for each in node.__mro__ for name, kind in getattr(each, "__annotations__", {}).items()
    }
    kinds = {name: kind.partition("[")[0] for name, kind in annotations.items()}
    own = [name for name in node.__struct_fields__ if name not in ("start", "end", "depth")]
    symbols = spec.split()
    return tuple((symbols.index(n) if n in symbols else -1, kinds[n] if kinds[n] in _EMPTY else "") for n in own)


def _levels(*parts: Any) -> int:
    """The depth of an expression made of these parts."""
    depth = 0
    for part in parts:
        if isinstance(part, s.CompositeExpr) and part.depth > depth:
            depth = part.depth
    return depth + 1
