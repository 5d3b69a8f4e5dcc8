"""`ExpressionChecker`: the base of the checkers of expressions, the reports of type errors, and constant numbers."""

from __future__ import annotations

from collections.abc import Mapping

from lingjing.dsl.checking.corrections import correction
from lingjing.dsl.checking.scope import SymbolTables
from lingjing.dsl.checking.typenames import fits, with_article
from lingjing.dsl.checking.unknown import UnknownNames
from lingjing.dsl.checking.values import UNKNOWN, Environment, FlowStep, TypedExpression
from lingjing.dsl.source.reporter import Change, Reporter
from lingjing.dsl.syntax import tree as s
from lingjing.errors import MissionError
from lingjing.mission import expression as ex
from lingjing.mission.evaluate import Scope, evaluate
from lingjing.mission.functions import FLAG, Type
from lingjing.mission.units import BY_DIMENSION, LENGTH, NONE, TICKS, TIME, dimension_unit
from lingjing.mission.values import is_number


class ExpressionChecker:
    """Base of `elaborate.Elaborator`, which implements `value` for each kind of node."""

    def __init__(self, report: Reporter, scope: SymbolTables) -> None:
        self.report = report
        self.scope = scope
        self.names = UnknownNames(report, scope)
        self.constants = _Constants(scope.constants)

    def value(self, node: s.Expression, environment: Environment) -> TypedExpression:
        """The checked expression; `UNKNOWN` if it is faulty."""
        raise NotImplementedError

    def constant(self, ir: ex.Expr) -> float | None:
        """The number that an expression always equals (params at their defaults), or None."""
        return self.constants.of(ir)

    def expect(self, node: s.Expression, environment: Environment, due: Type, what: str = "") -> TypedExpression:
        """The checked expression, which must have the type `due`. `what` names the place in the message."""
        value = self.value(node, environment)
        return value if self.fits(value, due, node, what) else UNKNOWN

    def fits(self, value: TypedExpression, due: Type, node: s.SyntaxNode, what: str = "") -> bool:
        """True if the value fits. Reports one that does not."""
        if value is UNKNOWN:
            self.names.needed(node, due)
        if fits(value.type, due):
            return True
        where = f" for {what}" if what else " here"
        self.mismatch(node, value, due, f"{with_article(due)} is due{where}, this is {with_article(value.type)}")
        return False

    def mismatch(self, node: s.SyntaxNode, value: TypedExpression, due: Type, message: str) -> None:
        """Report a value of the wrong type: a missing unit, a wrong dimension, or a wrong kind."""
        if due.kind == "quantity" and due.dimension not in (None, NONE) and value.type.dimension == NONE:
            unit = dimension_unit(due.dimension)
            bare = isinstance(node, s.NumberLiteral) and not node.unit
            text = self.report.source.text[node.start : node.end]
            self.report.at(
                "LJ0202",
                node,
                message,
                f"give it a unit: `{text} {unit}`" if bare else "",
                replace=f"{text} {unit}" if bare else None,
            )
        elif due.kind == value.type.kind and due.kind in ("quantity", "range"):
            self.report.at("LJ0203", node, message, _unit_hint(due))
        else:
            self._wrong_kind(node, value, due, message)

    def _wrong_kind(self, node: s.SyntaxNode, value: TypedExpression, due: Type, message: str) -> None:
        right = correction(node, due, self.report.source)
        if right is not None:
            self.report.at("LJ0201", node, message, f"write `{right[0]}`", replace=right[0], safe=right[1])
            return
        group = value.type.of if value.type.kind == "group" and due.kind in ("entity", "position") else ""
        if due == FLAG and value.type.kind == "quantity" and value.type.dimension in (TIME, TICKS):
            written = self.report.source.text[node.start : node.end]
            time = f"{written.split()[0]} * tick" if value.type.dimension == TICKS else written
            self.report.at("LJ0201", node, message, f"compare the time: `now >= {time}`")
            return
        hint = f"bind one: `forall v in {group}: …`, or name it: `{group}[1]`" if group else ""
        place = None
        if value.type.kind == "message" and due.kind == "position":
            place = f"{self.report.source.text[node.start : node.end]}.position"
            hint = f"write `{place}`, the place that the message names"
        self.report.at("LJ0201", node, message, hint, replace=place)

    def unknown_name(
        self,
        node: s.Name,
        known: list[str],
        what: str = "nothing",
        hint: str = "",
        replace: str | None = None,
        *,
        safe: bool = False,
        edits: tuple[Change, ...] = (),
    ) -> TypedExpression:
        """Store a name without a declaration. It is reported at the end, unless a faulty statement may have declared
        it. `hint`, `replace`: the way out and the fix if no known name is near.
        """
        self.names.note(node, known, what, hint, replace, safe=safe, edits=edits)
        return UNKNOWN

    def step(self, name: str, node: s.SyntaxNode) -> FlowStep:
        """A step on the path of a hidden value."""
        return FlowStep(name, self.report.span(node.start, node.end))


def _unit_hint(due: Type) -> str:
    known = BY_DIMENSION.get(due.dimension or NONE)
    if due.dimension == NONE:
        return "a bare number has no unit"
    return f"for example in `{known.unit}`" if known and due.dimension != LENGTH else "for example in `m`"


class _Constants:
    """Computes the number that an expression always equals. `parameters`: params at their defaults."""

    def __init__(self, parameters: Mapping[str, float]) -> None:
        self._scope = Scope(parameters=parameters)

    def of(self, ir: ex.Expr) -> float | None:
        """The number that an expression always equals; None if it varies or is no number."""
        if isinstance(ir, ex.Number):
            return ir.value
        if any(isinstance(leaf, ex.Ref) and leaf.kind != "param" for leaf in ex.leaves(ir)):
            return None
        try:
            return self._value(ir)
        except MissionError:
            return None

    def joined(self, ir: ex.Expr, left: float | None) -> tuple[float | None, bool]:
        """The number of a binary operation with the left side `left`, and True if it is too large.

        With this function a chain of operations is computed once from left to right.
        """
        right = self.of(ir.right) if isinstance(ir, ex.Binary) and left is not None else None
        if not isinstance(ir, ex.Binary) or left is None or right is None:
            return None, False
        try:
            return self._value(ex.Binary(ir.operator, ex.Number(left), ex.Number(right))), False
        except MissionError:
            return None, True

    def _value(self, ir: ex.Expr) -> float | None:
        """The value of a constant expression. Raises `MissionError` if it is too large or divides by zero."""
        value = evaluate(ir, self._scope)
        return float(value) if is_number(value) else None
