"""Expressions: syntax tree → typed expressions of the mission graph.

`Elaborator.value(node, environment)` resolves names, checks types and dimensions, follows hidden values and returns the
lowered expression. Every error is reported once. A faulty expression becomes `UNKNOWN`, which fits everywhere.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any

from lingjing.dsl.checking.aggregates import aggregate, is_aggregate
from lingjing.dsl.checking.calls import CallChecker
from lingjing.dsl.checking.corrections import with_units
from lingjing.dsl.checking.expressions import ExpressionChecker
from lingjing.dsl.checking.scope import SymbolTables
from lingjing.dsl.checking.senders import is_sending, sender_side
from lingjing.dsl.checking.status_words import status_side
from lingjing.dsl.checking.typenames import dimension_of, of_type, with_article
from lingjing.dsl.checking.values import UNKNOWN, Environment, Taint, TypedExpression
from lingjing.dsl.source.reporter import Change, Reporter
from lingjing.dsl.syntax import tree as s
from lingjing.dsl.syntax.foreign import AXES, FIELDS, NAMES, NOTHING, unit_for
from lingjing.mission import expression as ex
from lingjing.mission.functions import (
    DISTRIBUTIONS,
    ENTITY,
    FIELD_TYPES,
    FLAG,
    FUNCTIONS,
    MESSAGE_FIELDS,
    METRES,
    NAME,
    NUMBER,
    POSITION,
    STATE_FIELDS,
    STATUS,
    TEXT,
    TRUTH_FIELDS,
    Type,
)
from lingjing.mission.kinds import engine_kind
from lingjing.mission.units import (
    AREA,
    BY_DIMENSION,
    LARGEST,
    NONE,
    TIME,
    UNITS,
    dimension_unit,
    multiply,
    si_value,
    unit_of,
)
from lingjing.mission.vocabulary import MODES
from lingjing.suggest import did_you_mean, nearest

_COMPARISONS = frozenset(("<", "<=", ">", ">="))
"""Operators of comparison."""
_NAMELIKE = frozenset(("name", "names", "entity", "role", "text", "status"))
"""Kinds of types that can be compared as names."""
_DECLARED = {"deadline": "deadline = 300 s"}
"""Property that any entity may declare → its declaration."""
_POINT_FIELDS = {"east": METRES, "north": METRES, "elevation": METRES, "x": METRES, "y": METRES, "z": METRES}
"""Fields of a position."""
_SPEEDS = ("speed", "velocity_xy", "ground_speed")
"""Fields elsewhere that mean `speed(…)`."""
_REGION_FIELDS = {"centre": POSITION, "area": Type("quantity", AREA)}
"""Fields of a region."""


class Elaborator(ExpressionChecker):
    """Checks expressions with one scope, and returns their form in the mission."""

    def __init__(self, report: Reporter, scope: SymbolTables) -> None:
        super().__init__(report, scope)
        self.calls = CallChecker(self)
        self.shares: list[ex.Expr] = []
        """The fields that are shares of a whole, such as `uav.battery`."""
        self.before_clock = False
        """True while checking an expression that is evaluated before the clock: params, their sweeps, the clock
        itself."""
        self._handlers: dict[type, Callable[[Any, Environment], TypedExpression]] = {
            s.NumberLiteral: self._number,
            s.Name: self._name,
            s.TextLiteral: lambda node, _: TypedExpression(ex.Text(node.value), TEXT),
            s.FlagLiteral: lambda node, _: TypedExpression(ex.Flag(node.value), FLAG),
            s.Broken: lambda _node, _environment: UNKNOWN,
            s.Tuple: self._tuple,
            s.List: self._list,
            s.NameSet: self._set,
            s.CallExpr: self._call,
            s.Subscript: self._subscript,
            s.FieldExpr: self._attribute,
            s.UnaryExpr: self._unary,
            s.BinaryExpr: self._binary,
            s.QuantifiedExpr: self._quantified,
        }

    @contextmanager
    def without_clock(self) -> Iterator[None]:
        """Check expressions that are evaluated before the clock."""
        self.before_clock = True
        try:
            yield
        finally:
            self.before_clock = False

    def value(self, node: s.Expression, environment: Environment) -> TypedExpression:
        """The checked expression."""
        return self._handlers[type(node)](node, environment)

    # -- leaves

    def _number(self, node: s.NumberLiteral, _environment: Environment) -> TypedExpression:
        if not node.unit:
            return self._measured(node, node.value, NUMBER)
        unit = unit_of(node.unit)
        if unit is None:
            end, start = node.end, node.end - len(node.unit)
            right_name = unit_for(node.unit)
            close = right_name or nearest(node.unit, UNITS)
            hint = f"did you mean `{close}`?" if close else "compound units have no spaces: m/s, km/h, m^2"
            hint = f"write `{right_name}`" if right_name else hint
            message, safe = f"no unit is called `{node.unit}`", right_name is not None
            self.report("LJ0204", start, end, message, hint, replace=close, safe=safe)
            return UNKNOWN
        return self._measured(node, si_value(node.value, node.unit), Type("quantity", unit.dimension))

    def _measured(self, node: s.NumberLiteral, value: float, kind: Type) -> TypedExpression:
        return TypedExpression(ex.Number(value, node.unit), kind) if abs(value) <= LARGEST else self._too_large(node)

    def _too_large(self, node: s.SyntaxNode) -> TypedExpression:
        """Report a number beyond the supported range."""
        text = self.report.source.text[node.start : node.end]
        shown = f"`{text}`" if len(text) <= 30 else "this"
        hint = f"numbers go up to {LARGEST:g} in SI units"
        self.report.at("LJ0209", node, f"{shown} is too large", hint)
        return UNKNOWN

    def _name(self, node: s.Name, environment: Environment) -> TypedExpression:
        name = node.text
        if name in environment.locals:
            return TypedExpression(ex.Ref(name, "local"), environment.locals[name])
        symbol = self.scope.symbols.get(name)
        if symbol is not None:
            return TypedExpression(ex.Ref(name, symbol.kind), symbol.type, self._through(symbol.taint, node))
        if name == "mode":
            return TypedExpression(ex.Ref("mode", "mode"), Type("name", of="mode"))
        if name == "now":
            if not environment.rule:
                self.report.at("LJ0304", node, "`now` is known only while the mission runs")
                return UNKNOWN
            return TypedExpression(ex.Ref("now", "clock"), Type("quantity", TIME))
        if name == "tick":
            if self.before_clock:
                self.report.at("LJ0304", node, "the length of a `tick` is not known before the clock")
                return UNKNOWN
            return TypedExpression(ex.Ref("tick", "clock"), Type("quantity", TIME))
        if name in self.scope.types:
            return TypedExpression(ex.Symbol(name), Type("name", of="type"))
        if name in self.scope.modes:
            return TypedExpression(ex.Symbol(name), Type("name", of="mode"))
        if name in self.scope.agents or name in self.scope.roles or name in self.scope.stages:
            return TypedExpression(ex.Symbol(name), NAME)
        return self._undeclared(node, environment)

    def _undeclared(self, node: s.Name, environment: Environment) -> TypedExpression:
        """Store a name without a declaration, with the way out if it is a word of another language."""
        name = node.text
        right_name = NAMES.get(name)
        hint = f"write `{right_name}`" if right_name else ""
        if name in NOTHING:
            hint = "there is no empty value: leave the whole line out"
        elif name in FUNCTIONS:
            hint = f"`{name}` is a function: write `{name}(…)`"
        known = [] if hint else [*environment.locals, *self.scope.known_names()]
        return self.unknown_name(node, known, hint=hint, replace=right_name, safe=right_name in ("true", "false"))

    def _through(self, taint: Taint, node: s.Name) -> Taint:
        return (*taint, self.step(f"`{node.text}`", node)) if taint else ()

    # -- composites

    def _tuple(self, node: s.Tuple, environment: Environment) -> TypedExpression:
        if len(node.items) not in (2, 3):
            self.report.at("LJ0201", node, f"a point has 2 or 3 coordinates, this has {len(node.items)}")
            return UNKNOWN
        items = [self.value(item, environment) for item in node.items]
        dimension = items[0].type.dimension
        due = METRES if dimension != (0, 0, 0, 1, 0, 0, 0, 0) else Type("quantity", dimension)
        units = with_units(node, due) if all(item.type == NUMBER for item in items) else ()
        if units:
            text = self.report.source.text
            written = ", ".join(
                f"{text[item.start : item.end]} {dimension_unit(due.dimension or NONE)}" for item in node.items
            )
            message = f"{with_article(due)} is due for each coordinate, these are bare numbers"
            self.report.at("LJ0202", node, message, f"give them a unit: `({written})`", edits=units)
            return UNKNOWN
        good = [self.fits(item, due, part, "a coordinate") for item, part in zip(items, node.items, strict=True)]
        if not all(good):
            return UNKNOWN
        kind = POSITION if due is METRES else Type("position", of="degrees")
        return TypedExpression(ex.Point(tuple(item.ir for item in items)), kind, _taint(*items))

    def _list(self, node: s.List, environment: Environment) -> TypedExpression:
        items = [self.value(item, environment) for item in node.items]
        kinds = {item.type.kind for item in items} - {"any"}
        dimensions = {item.type.dimension for item in items if item.type.kind == "quantity"}
        if len(kinds) > 1 or len(dimensions) > 1:
            odd = next(i for i, item in enumerate(items) if item.type not in (items[0].type, UNKNOWN.type))
            first, other = with_article(items[0].type), with_article(items[odd].type)
            place = node.items[odd]
            self.report.at("LJ0201", place, f"a list holds one kind of thing: this is {other} among {first}s")
            return UNKNOWN
        item_kind = next(iter(kinds), None)
        dimension = next(iter(dimensions), None)
        return TypedExpression(
            ex.Sequence(tuple(i.ir for i in items)), Type("list", dimension, item_kind), _taint(*items)
        )

    def _set(self, node: s.NameSet, environment: Environment) -> TypedExpression:
        items = [self._name(name, environment) for name in node.names]
        return TypedExpression(ex.Sequence(tuple(i.ir for i in items)), Type("list", item="name"), _taint(*items))

    def _call(self, node: s.CallExpr, environment: Environment) -> TypedExpression:
        if is_aggregate(node):
            return aggregate(self.calls, node, environment)
        if node.function.text in DISTRIBUTIONS and node.function.text not in self.scope.rules:
            start, end = node.function.start, node.function.end
            self.report(
                "LJ0302",
                start,
                end,
                f"`{node.function.text}(…)` draws a value",
                "a draw is a property's whole value, after `~`",
            )
            return UNKNOWN
        return self.calls.call(node, environment)

    def _subscript(self, node: s.Subscript, environment: Environment) -> TypedExpression:
        base = self.value(node.base, environment)
        index = self.expect(node.index, environment, NUMBER, "an index")
        if base.type.kind == "any":
            self.names.needed(node.base, Type("group"))
            return UNKNOWN
        if base.type.kind != "group":
            self.report.at("LJ0201", node.base, f"{with_article(base.type)} has no members to pick from")
            return UNKNOWN
        self._index_in_range(node, base.type.of, index)
        return TypedExpression(ex.Index(base.ir, index.ir), Type("entity", of=base.type.of), _taint(index))

    def _index_in_range(self, node: s.Subscript, group: str, index: TypedExpression) -> None:
        number = self.constant(index.ir)
        if number is None:
            return
        most = self.scope.groups[group].most if group in self.scope.groups else None
        if number < 1 or number != int(number):
            self.report.at("LJ0201", node.index, "members are counted 1, 2, 3, …")
        elif most is not None and number > most:
            there = f"has {most:g} {'member' if most == 1 else 'members'}"
            self.report.at("LJ0206", node.index, f"`{group}` {there}, there is no {number:g}")

    def _attribute(self, node: s.FieldExpr, environment: Environment) -> TypedExpression:
        base = self.value(node.base, environment)
        kind, name = base.type.kind, node.name
        if kind == "any":
            self.names.needed(node.base, ENTITY)
            return UNKNOWN
        if kind == "entity":
            return self._entity_field(base, node, environment)
        if kind == "message":
            return self._record_field(base, name, environment)
        tables: dict[str, dict[str, Type]] = {
            "truth": TRUTH_FIELDS,
            "position": _POINT_FIELDS,
            "region": _REGION_FIELDS,
        }
        fields = tables.get(kind)
        if fields is None:
            hint = f"name one member: `{base.type.of}[1]`" if kind == "group" else ""
            self.report.at("LJ0102", name, f"{with_article(base.type)} has no fields", hint)
            return UNKNOWN
        if name.text not in fields:
            return self._no_field(name, with_article(base.type), list(fields), AXES)
        return TypedExpression(ex.Attr(base.ir, name.text), fields[name.text], base.taint)

    def _entity_field(self, base: TypedExpression, node: s.FieldExpr, environment: Environment) -> TypedExpression:
        group, name = self.scope.groups[base.type.of], node.name
        attribute = group.attributes.get(name.text)
        lowered, kind = STATE_FIELDS.get(name.text, ("", None))
        if kind == STATUS:
            kind = of_type(STATUS, group.name)
        if kind is None:
            shares = engine_kind(group.type.engine).shares if group.type is not None else ()
            if attribute is None and name.text in shares:
                return self._share(base, node, environment)
            if attribute is None and name.text in _SPEEDS:
                return self._no_speed(node)
            if attribute is None:
                return self._no_field(name, f"`{group.name}`", [*STATE_FIELDS, *group.attributes, *shares], FIELDS)
            kind = attribute.type
            suffix = BY_DIMENSION.get(kind.dimension or NONE) if kind.kind == "quantity" else None
            lowered = name.text + (suffix.suffix if suffix else "")
        taint = base.taint
        if attribute is not None and attribute.taint and not environment.rule:
            taint = (*attribute.taint, self.step(f"`{self.report.source.text[node.start : node.end]}`", node))
        return TypedExpression(ex.Attr(base.ir, lowered), kind, taint)

    def _share(self, base: TypedExpression, node: s.FieldExpr, environment: Environment) -> TypedExpression:
        """A resource that the engine reports, such as `uav.battery`."""
        name = node.name
        if not environment.rule:
            self.report.at("LJ0304", name, f"`{name.text}` is known only while the mission runs", "use it in a rule")
            return UNKNOWN
        share = TypedExpression(ex.Attr(base.ir, name.text), NUMBER, base.taint)
        self.shares.append(share.ir)
        return share

    def _no_speed(self, node: s.FieldExpr) -> TypedExpression:
        written = f"speed({self.report.source.text[node.base.start : node.base.end]})"
        message = f"the present speed is no field: `{node.name.text}`"
        self.report.at("LJ0102", node, message, f"write `{written}`", replace=written)
        return UNKNOWN

    def _record_field(self, base: TypedExpression, name: s.Name, environment: Environment) -> TypedExpression:
        record = self.scope.messages[base.type.of][0]
        if record is None:
            return UNKNOWN
        for field in record.fields:
            if field.name == name.text:
                kind = FIELD_TYPES[field.type]
                return TypedExpression(
                    ex.Attr(base.ir, name.text), of_type(kind, "type") if name.text == "class" else kind
                )
        if name.text in MESSAGE_FIELDS and environment.rule:
            return TypedExpression(ex.Attr(base.ir, name.text), MESSAGE_FIELDS[name.text])
        known = [*(field.name for field in record.fields), *MESSAGE_FIELDS]
        return self._no_field(name, f"a message of the record `{record.name}`", known)

    def _no_field(
        self, name: s.Name, owner: str, known: list[str], foreign: Mapping[str, str] | None = None
    ) -> TypedExpression:
        message, right_name = f"{owner} has no field `{name.text}`", (foreign or {}).get(name.text)
        if foreign is FIELDS and name.text in _DECLARED:
            self.report.at("LJ0102", name, message, f"declare it in the block of {owner}: `{_DECLARED[name.text]}`")
            return UNKNOWN
        if right_name is not None and right_name.partition(".")[0] in known:
            self.report.at("LJ0102", name, message, f"write `{right_name}`", replace=right_name)
        else:
            self.report.unknown("LJ0102", name, message, known)
        return UNKNOWN

    # -- operators

    def _unary(self, node: s.UnaryExpr, environment: Environment) -> TypedExpression:
        value = self.value(node.operand, environment)
        due = FLAG if node.operator == "not" else Type("quantity")
        if not self.fits(value, due, node.operand, f"`{node.operator}`"):
            return UNKNOWN
        return TypedExpression(ex.Unary(node.operator, value.ir), value.type, value.taint)  # type: ignore[arg-type]

    def _binary(self, node: s.BinaryExpr, environment: Environment) -> TypedExpression:
        spine: list[s.BinaryExpr] = []
        left_node: s.Expression = node
        while isinstance(left_node, s.BinaryExpr):
            spine.append(left_node)
            left_node = left_node.left
        left = self._first(left_node, spine[-1], environment)
        known = self.constant(left.ir)
        for part in reversed(spine):
            left = self._combine(part, left, environment)
            known, fault = self.constants.joined(left.ir, known)
            if fault:
                left = self._too_large(part)
        return left

    def _first(self, node: s.Expression, first: s.BinaryExpr, environment: Environment) -> TypedExpression:
        """The leftmost operand of a chain. A word before `==` is looked up by the type of the other side."""
        other = first.right if first.operator in ("==", "!=") else None
        if (
            isinstance(node, s.Name | s.Subscript)
            and isinstance(other, s.FieldExpr)
            and other.name.text in MESSAGE_FIELDS
        ):
            sending = self.value(other, environment)
            if is_sending(sending):
                return sender_side(self, sending, node, environment)
        if isinstance(node, s.Name | s.TextLiteral) and isinstance(other, s.FieldExpr) and other.name.text == "status":
            status = self.value(other, environment)
            if status.type.kind == "status":
                return status_side(self, status, node, environment)
        return self.value(node, environment)

    def _combine(self, node: s.BinaryExpr, left: TypedExpression, environment: Environment) -> TypedExpression:
        operator = node.operator
        if operator in ("==", "!=", "in") and left.type.kind in ("name", "status"):
            right = self._name_side(left, node.right, environment)
        else:
            right = self.value(node.right, environment)
        if left.type.kind == "any" or right.type.kind == "any":
            self._note_due(node, left, right)
            return UNKNOWN
        if operator in ("and", "or"):
            return self._logic(node, left, right)
        if operator in ("==", "!="):
            return self._equality(node, left, right)
        if operator in _COMPARISONS:
            return self._comparison(node, left, right)
        if operator == "in":
            return self._membership(node, left, right)
        if operator == "..":
            return self._range(node, left, right)
        if operator in ("by", "from", "to", "at"):
            self.report.at("LJ0205", node, f"`{operator}` does not make a value here", _PHRASES[operator])
            return UNKNOWN
        return self._arithmetic(node, left, right)

    def _note_due(self, node: s.BinaryExpr, left: TypedExpression, right: TypedExpression) -> None:
        """Store the type that an unknown operand must have according to the operator and the other operand."""
        for part, other in ((node.left, right), (node.right, left)):
            if node.operator in ("and", "or"):
                self.names.needed(part, FLAG)
            elif node.operator in (*_COMPARISONS, "==", "!=", "+", "-", "..") and other.type.kind == "quantity":
                self.names.needed(part, other.type)

    def _name_side(self, left: TypedExpression, node: s.Expression, environment: Environment) -> TypedExpression:
        """The right side of a comparison with a name. A bare word is looked up among the names of the same kind."""
        if left.type.kind == "status":
            return status_side(self, left, node, environment)
        if is_sending(left):
            return sender_side(self, left, node, environment)
        if left.type.of == "mode" and isinstance(node, s.Name):
            return self._one_of(node, self.scope.modes, "mode")
        if left.type.of == "mode" and isinstance(node, s.TextLiteral) and node.value not in self.scope.modes:
            close = nearest(node.value, self.scope.modes)
            hint = did_you_mean(node.value, self.scope.modes)
            message = f"the mode is never `{node.value}`"
            self.report.at("LJ0109", node, message, hint, replace=close)
            return UNKNOWN
        if left.type.of == "mode" and isinstance(node, s.NameSet):
            items = [self._one_of(name, self.scope.modes, "mode") for name in node.names]
            return TypedExpression(ex.Sequence(tuple(i.ir for i in items)), Type("list", item="name"))
        if left.type == NAME and isinstance(node, s.Name) and not self._is_known(node.text, environment):
            text = f'"{node.text}"'
            known = [*environment.locals, *self.scope.known_names()]
            return self.unknown_name(node, known, hint=f"a text stands in quotes: `{text}`", replace=text)
        if left.type.of == "type" and isinstance(node, s.Name) and node.text not in environment.locals:
            return self._one_of(node, tuple(self.scope.types), "type")
        return self.value(node, environment)

    def _is_known(self, name: str, environment: Environment) -> bool:
        return (
            name in environment.locals
            or name in ("mode", "now", "tick")
            or name in self.scope.known_names()
            or (name in self.scope.stages)
        )

    def _one_of(self, node: s.Name, known: tuple[str, ...], what: str) -> TypedExpression:
        if node.text in known:
            return TypedExpression(ex.Symbol(node.text), Type("name", of=what))
        hint, edits = self._permit(node.text) if what == "mode" else ("", ())
        return self.unknown_name(node, list(known), f"no {what}", hint, edits=edits)

    def _permit(self, mode: str) -> tuple[str, tuple[Change, ...]]:
        """The statement that permits a mode of the language, and the edit that writes it."""
        if mode not in MODES or self.scope.mode_line is None:
            return "", ()
        default, start, end = self.scope.mode_line
        written = f"mode {default} in {{ {', '.join((*self.scope.modes, mode))} }}"
        return f"permit it: `{written}`", ((start, end, written),) if end > start else ()

    def _logic(self, node: s.BinaryExpr, left: TypedExpression, right: TypedExpression) -> TypedExpression:
        good = self.fits(left, FLAG, node.left, f"`{node.operator}`")
        if not (self.fits(right, FLAG, node.right, f"`{node.operator}`") and good):
            return UNKNOWN
        return self._made(node, left, right, FLAG)

    def _equality(self, node: s.BinaryExpr, left: TypedExpression, right: TypedExpression) -> TypedExpression:
        alike = left.type.kind == right.type.kind and left.type.dimension == right.type.dimension
        if not alike and not {left.type.kind, right.type.kind} <= _NAMELIKE:
            return self._not_comparable(node, left, right)
        return self._made(node, left, right, FLAG)

    def _comparison(self, node: s.BinaryExpr, left: TypedExpression, right: TypedExpression) -> TypedExpression:
        both = left.type.kind == right.type.kind == "quantity"
        if not both or left.type.dimension != right.type.dimension:
            return self._not_comparable(node, left, right)
        if self._is_impossible_share(left, right, node.right) or self._is_impossible_share(right, left, node.left):
            return UNKNOWN
        return self._made(node, left, right, FLAG)

    def _is_impossible_share(self, share: TypedExpression, bound: TypedExpression, written: s.Expression) -> bool:
        """Report a bound beyond 0..1 of a resource that an engine reports as a share of the whole, such as
        `uav.battery`: the comparison always or never holds."""
        number = self.constant(bound.ir)
        if number is None or 0.0 <= number <= 1.0 or not any(share.ir is known for known in self.shares):
            return False
        is_bare = isinstance(written, s.NumberLiteral) and not written.unit
        percent = f"{number:g} %" if is_bare and 1.0 < number <= 100.0 else ""
        hint = f"write `{percent}`" if percent else "write a share such as `20 %` or `0.2`"
        message = f"a share is between 0 and 1, this is {number:g}"
        self.report.at("LJ0206", written, message, hint, replace=percent or None)
        return True

    def _not_comparable(self, node: s.BinaryExpr, left: TypedExpression, right: TypedExpression) -> TypedExpression:
        if left.type.kind == right.type.kind == "quantity":
            for value, other, part in ((left, right, node.right), (right, left, node.left)):
                bare = other if value is left else left
                if bare.type.dimension == NONE and isinstance(part, s.NumberLiteral):
                    self.mismatch(
                        part, bare, value.type, f"{with_article(value.type)} is due here, this is a bare number"
                    )
                    return UNKNOWN
        code = "LJ0203" if left.type.kind == right.type.kind == "quantity" else "LJ0201"
        ours, theirs = with_article(left.type), with_article(right.type)
        hint = ""
        if isinstance(node.left, s.BinaryExpr) and left.type == FLAG:
            middle = self.report.source.text[node.left.right.start : node.left.right.end]
            hint = f"a comparison has two sides: write `… and {middle} {node.operator} …`"
        for part, other in ((node.left, right), (node.right, left)):
            if isinstance(part, s.TextLiteral) and other.type.kind == "quantity":
                hint = "a number stands without quotes, with its unit: `50 %`, `20 m`"
        self.report.at(code, node, f"`{node.operator}` cannot compare {ours} with {theirs}", hint)
        return UNKNOWN

    def _membership(self, node: s.BinaryExpr, left: TypedExpression, right: TypedExpression) -> TypedExpression:
        kinds = (left.type.kind, right.type.kind)
        good = (
            (kinds == ("quantity", "range") and left.type.dimension == right.type.dimension)
            or (kinds[0] in ("position", "entity") and kinds[1] == "region")
            or (kinds[0] in _NAMELIKE and kinds[1] in ("list", "names"))
        )
        if not good:
            ours, theirs = with_article(left.type), with_article(right.type)
            self.report.at("LJ0201", node, f"{ours} cannot be `in` {theirs}")
            return UNKNOWN
        return self._made(node, left, right, FLAG)

    def _range(self, node: s.BinaryExpr, left: TypedExpression, right: TypedExpression) -> TypedExpression:
        good = self.fits(left, Type("quantity"), node.left, "a range")
        if not (good and self.fits(right, Type("quantity", left.type.dimension), node.right, "the range's upper end")):
            return UNKNOWN
        low, high = self.constant(left.ir), self.constant(right.ir)
        if low is not None and high is not None and low > high and not _counts_none(node, low, high):
            self.report.at("LJ0206", node, "the range is empty", "the smaller end stands first")
            return UNKNOWN
        return TypedExpression(ex.Range(left.ir, right.ir), Type("range", left.type.dimension), _taint(left, right))

    def _arithmetic(self, node: s.BinaryExpr, left: TypedExpression, right: TypedExpression) -> TypedExpression:
        a, b = left.type, right.type
        if a.kind == b.kind == "position" and node.operator in ("+", "-"):
            return self._made(node, left, right, POSITION)
        if a.kind != "quantity" or b.kind != "quantity":
            self.report.at(
                "LJ0201", node, f"`{node.operator}` does not apply to {with_article(a)} and {with_article(b)}"
            )
            return UNKNOWN
        da, db = dimension_of(a), dimension_of(b)
        if node.operator in ("+", "-"):
            if da != db:
                verb = "added to" if node.operator == "+" else "taken from"
                pair = (b, a)
                message = f"{with_article(pair[0])} cannot be {verb} {with_article(pair[1])}"
                self.report.at("LJ0203", node, message)
                return UNKNOWN
            return self._made(node, left, right, a)
        sign = 1 if node.operator == "*" else -1
        if sign < 0 and self.constant(right.ir) == 0.0:
            self.report.at("LJ0207", node.right, "division by zero")
            return UNKNOWN
        return self._made(node, left, right, Type("quantity", multiply(da, db, sign)))

    def _made(self, node: s.BinaryExpr, left: TypedExpression, right: TypedExpression, result: Type) -> TypedExpression:
        return TypedExpression(ex.Binary(node.operator, left.ir, right.ir), result, _taint(left, right))  # type: ignore[arg-type]

    def _quantified(self, node: s.QuantifiedExpr, environment: Environment) -> TypedExpression:
        if not environment.rule:
            self.report(
                "LJ0304", node.start, node.start + len(node.quantifier), f"`{node.quantifier}` can stand only in a rule"
            )
            return UNKNOWN
        domain = self.calls.domain_of(node)
        if domain is None:
            self.value(node.body, environment.binding(node.variable.text, UNKNOWN.type))
            return UNKNOWN
        name, kind = domain
        body = self.expect(node.body, environment.binding(node.variable.text, kind), FLAG, f"`{node.quantifier}`")
        return TypedExpression(ex.Quantified(node.quantifier, node.variable.text, name, body.ir), FLAG, body.taint)  # type: ignore[arg-type]


_PHRASES = {
    "by": "`3 by 3` is the shape of a grid, `1920 by 1080` the size of a camera",
    "from": "`4 m/s from 220 deg` is a wind",
    "to": "`0.2 m/s to 60 deg` is a current",
    "at": "`sea level at -3.5 m` is a datum",
}
"""Operators that are valid only in certain properties → an example."""


def _counts_none(node: s.BinaryExpr, low: float, high: float) -> bool:
    """True for `1..n` with a computed `n` that is 0 now: a group without members."""
    return (low, high) == (1.0, 0.0) and not isinstance(node.right, s.NumberLiteral)


def _taint(*values: TypedExpression) -> Taint:
    for value in values:
        if value.taint:
            return value.taint
    return ()
