"""Calls: built-in functions, draws and the mission's own rules, checked with their signatures."""

from __future__ import annotations

from collections.abc import Sequence

from lingjing import articles
from lingjing.dsl.checking.expressions import ExpressionChecker
from lingjing.dsl.checking.scope import GroupInfo
from lingjing.dsl.checking.typenames import with_article
from lingjing.dsl.checking.values import UNKNOWN, Environment, Taint, TypedExpression
from lingjing.dsl.syntax import tree as s
from lingjing.dsl.syntax.foreign import CALLS
from lingjing.dsl.syntax.foreign import FUNCTIONS as FOREIGN_FUNCTIONS
from lingjing.mission import expression as ex
from lingjing.mission.functions import (
    DISTRIBUTIONS,
    FLAG,
    FUNCTIONS,
    TEMPORAL,
    FunctionOption,
    FunctionParameter,
    Signature,
    Type,
)
from lingjing.mission.units import Dimension
from lingjing.suggest import did_you_mean


class CallChecker:
    """The part of the elaborator that checks calls."""

    def __init__(self, checker: ExpressionChecker) -> None:
        self.of = checker
        self.report = checker.report
        self.scope = checker.scope

    def call(self, node: s.CallExpr, environment: Environment) -> TypedExpression:
        """Check a call of a rule or of a built-in function."""
        name = node.function.text
        if name in self.scope.rules:
            return self._rule(node, environment)
        signature = FUNCTIONS.get(name)
        if signature is None:
            self._all_arguments(node, environment)
            right_name = CALLS.get(name)
            hint = f"write `{right_name}`" if right_name else FOREIGN_FUNCTIONS.get(name, "")
            if name in self.scope.interactions():
                self.report.at(
                    "LJ0101",
                    node.function,
                    f"`{name}` is an interaction and no function",
                    f"write `emitted({name}, …)`",
                )
                return UNKNOWN
            known = [*self.scope.rules] if right_name else [*FUNCTIONS, *self.scope.rules]
            return self.of.unknown_name(node.function, known, "no function", hint, right_name)
        first = node.arguments[0].value if node.arguments else None
        if (
            name in ("held", "within")
            and isinstance(first, s.NumberLiteral)
            and len(node.arguments) == len(signature.parameters)
        ):
            self._all_arguments(node, environment)
            conditions = ", ".join("ab"[: TEMPORAL[name]])
            written = self.report.source.text[first.start : first.end]
            self.report.at(
                "LJ0201", first, f"the time of `{name}` must come last", f"write `{name}({conditions}, {written})`"
            )
            return UNKNOWN
        if signature.where == "rule" and not environment.rule:
            self._misplaced(node, f"`{name}(…)` is known only while the mission runs", "use it in a rule")
            return UNKNOWN
        if signature.where == "static" and environment.rule:
            self._misplaced(node, f"`{name}(…)` cannot stand in a rule", "declare a param or a region with it")
            return UNKNOWN
        checked = self._arguments(node, signature, environment)
        if checked is None:
            return UNKNOWN
        arguments, named, dimension, taint = checked
        if name in ("emitted", "count") and not self._is_offered(node, environment):
            return UNKNOWN
        if name in TEMPORAL and not self._is_span(node, arguments[TEMPORAL[name] :]):
            return UNKNOWN
        result = Type("quantity", dimension) if signature.same else signature.result
        if name == "at":
            result = self._item_type(node, environment)
        elif name == "buffer" and not self._buffers(node, environment):
            return UNKNOWN
        return TypedExpression(ex.Call(name, arguments, named), result, taint)

    def draw(self, node: s.Expression, environment: Environment) -> TypedExpression:
        """Check the expression after `~`: the call of a distribution, lowered to a `Draw`."""
        if isinstance(node, s.Broken):
            return UNKNOWN
        if not isinstance(node, s.CallExpr):
            self.report.at("LJ0301", node, "a distribution is due after `~`", _distributions())
            return UNKNOWN
        signature = DISTRIBUTIONS.get(node.function.text)
        if signature is None:
            name = node.function
            self.report.unknown("LJ0301", name, f"no distribution is called `{name.text}`", DISTRIBUTIONS)
            return UNKNOWN
        checked = self._arguments(node, signature, environment)
        if checked is None:
            return UNKNOWN
        arguments, named, dimension, taint = checked
        if signature.name in ("uniform", "integer"):
            low, high = (self.of.constant(argument) for argument in arguments)
            if signature.name == "integer" and any(end is not None and end != int(end) for end in (low, high)):
                self.report.at("LJ0206", node, "whole numbers are drawn between two whole numbers")
                return UNKNOWN
            if low is not None and high is not None and low > high:
                self.report.at("LJ0206", node, "the range of the draw is empty", "the smaller end stands first")
        result = Type("quantity", dimension) if signature.same else signature.result
        if signature.name in ("choice", "subset"):
            kind = self.of.value(node.arguments[0].value, environment).type
            result = Type(kind.item or "any", kind.dimension)
        return TypedExpression(ex.Draw(signature.name, arguments, named), result, taint)

    def domain_of(self, node: s.QuantifiedExpr) -> tuple[str, Type] | None:
        """The domain of a quantifier: as written, or inferred from the rules that its body applies to the variable."""
        if node.domain is not None:
            kind = self.domain_type(node.domain)
            return None if kind is None else (node.domain.text, kind)
        domains = self._inferred(node.body, node.variable.text)
        if not domains:
            variable = node.variable
            domain = next(iter(self.scope.messages), "…")
            hint = f"name its domain: `{node.quantifier} {variable.text} in {domain}:`"
            if not _mentions_unknown(node.body, self.scope.rules):
                self.report.at("LJ0105", variable, f"the domain of `{variable.text}` is not clear", hint)
            return None
        first = domains[0]
        for other in domains[1:]:
            if other.text != first.text:
                variable = node.variable
                message = f"`{variable.text}` is used both as `{first.text}` and as `{other.text}`"
                self.report.at("LJ0105", variable, message, "use two variables")
                return None
        kind = self.domain_type(first, silent=True)
        return None if kind is None else (first.text, kind)

    def domain_type(self, name: s.Name, *, silent: bool = False) -> Type | None:
        """The type of a variable over a group (an entity) or over a message kind (a message)."""
        if name.text in self.scope.groups:
            return Type("entity", of=name.text)
        if name.text in self.scope.messages:
            return Type("message", of=name.text)
        if not silent:
            self.of.unknown_name(name, [*self.scope.groups, *self.scope.messages], "no group and no message kind")
        return None

    # -- private

    def _is_span(self, node: s.CallExpr, times: Sequence[ex.Expr]) -> bool:
        """True if the time of a function over time is 0 or more, as far as it is known. Reports any other."""
        seconds = self.of.constant(times[0]) if times else None
        if seconds is None or seconds >= 0:
            return True
        written = node.arguments[-1].value
        self.report.at("LJ0206", written, f"the time of `{node.function.text}` is below 0 s", "give 0 s or more")
        return False

    def _item_type(self, node: s.CallExpr, environment: Environment) -> Type:
        """The type of `at(i, [items], rest = …)`: that of the items."""
        listed = [argument.value for argument in node.arguments if argument.name is None]
        kind = self.of.value(listed[1], environment).type
        item = Type(kind.item or "any", kind.dimension)
        for argument in node.arguments:
            if argument.name is not None and argument.name.text == "rest":
                self.of.expect(argument.value, environment, item, "`rest`")
        return item

    def _buffers(self, node: s.CallExpr, environment: Environment) -> bool:
        shape = node.arguments[0].value
        kind = self.of.value(shape, environment).type
        if kind.kind in ("region", "any") or (kind.kind == "list" and kind.item in ("position", None)):
            return True
        message = f"a region or a list of positions is due for `shape` of `buffer`, this is {with_article(kind)}"
        self.report.at("LJ0201", shape, message)
        return False

    def _named(self, node: s.Expression, kind: str) -> TypedExpression:
        """The name of an inspection or of a counted budget."""
        known = self.scope.inspections if kind == "inspection" else self.scope.limits
        if isinstance(node, s.Name) and node.text in known:
            return TypedExpression(ex.Symbol(node.text), Type("inspection" if kind == "inspection" else "limit"))
        if isinstance(node, s.Name):
            return self.of.unknown_name(node, list(known), f"no {kind}")
        self.report.at("LJ0201", node, f"the name of {articles.with_article(kind)} is due here")
        return UNKNOWN

    def _inferred(self, node: s.Expression, variable: str) -> list[s.Name]:
        types: list[s.Name] = []
        waiting: list[s.Expression] = [node]
        while waiting:
            part = waiting.pop()
            if isinstance(part, s.QuantifiedExpr) and part.variable.text == variable:
                continue
            if isinstance(part, s.CallExpr) and part.function.text in self.scope.rules:
                parameters = self.scope.rules[part.function.text].parameters
                for parameter, argument in zip(parameters, part.arguments, strict=False):
                    if isinstance(argument.value, s.Name) and argument.value.text == variable:
                        types.append(parameter.type)
            waiting.extend(children(part))
        return types

    def _rule(self, node: s.CallExpr, environment: Environment) -> TypedExpression:
        rule = self.scope.rules[node.function.text]
        if not environment.rule:
            self._misplaced(node, f"the rule `{rule.name}` is known only while the mission runs", "use it in a rule")
            return UNKNOWN
        if len(node.arguments) != len(rule.parameters):
            due, actual = len(rule.parameters), len(node.arguments)
            self.report.at("LJ0306", node, f"`{rule.name}` takes {_count(due, 'argument')}, {actual} given")
            self._all_arguments(node, environment)
            return UNKNOWN
        values = []
        for parameter, argument in zip(rule.parameters, node.arguments, strict=True):
            if argument.name is not None:
                self.report.at("LJ0306", argument, "a rule's arguments go by their place")
            kind = self.domain_type(parameter.type, silent=True)
            what = f"`{parameter.name.text}` of `{rule.name}`"
            if kind is None:
                values.append(self.of.value(argument.value, environment))
            else:
                values.append(self.of.expect(argument.value, environment, kind, what))
        return TypedExpression(ex.Call(rule.name, tuple(v.ir for v in values), rule=True), FLAG)

    def _arguments(
        self, node: s.CallExpr, signature: Signature, environment: Environment
    ) -> tuple[tuple[ex.Expr, ...], tuple[tuple[str, ex.Expr], ...], Dimension | None, Taint] | None:
        options = {option.name: option for option in signature.options}
        positional: list[s.CallArgument] = []
        named: list[tuple[str, ex.Expr]] = []
        taint: Taint = ()
        good = True
        for argument in node.arguments:
            option = _option(argument, options)
            if option is None:
                if argument.name is not None:
                    good = self._unknown_option(argument.name, signature)
                    continue
                positional.append(argument)
                continue
            value = self._option_value(argument, option, environment)
            if value is None or value is UNKNOWN:
                good = False
                continue
            if any(name == option.name for name, _ in named):
                self.report.at("LJ0103", argument, f"`{option.name}` is given twice")
            named.append((option.name, value.ir))
            taint = taint or value.taint
        if not self._count_fits(node, signature, len(positional)):
            for argument in positional:
                self.of.value(argument.value, environment)
            return None
        values, dimension = self._positional(positional, signature, environment)
        for value in values:
            taint = taint or value.taint
            good = good and value is not UNKNOWN
        return (tuple(v.ir for v in values), tuple(named), dimension, taint) if good else None

    def _positional(
        self, arguments: list[s.CallArgument], signature: Signature, environment: Environment
    ) -> tuple[list[TypedExpression], Dimension | None]:
        dimension: Dimension | None = None
        values = []
        for position, argument in enumerate(arguments):
            parameter = signature.parameters[min(position, len(signature.parameters) - 1)]
            due = Type("quantity", dimension) if parameter.same and dimension is not None else parameter.type
            value = self._argument(argument.value, parameter, due, signature, environment)
            if parameter.same and dimension is None and value.type.kind == "quantity":
                dimension = value.type.dimension
            values.append(value)
        return values, dimension

    def _argument(
        self,
        node: s.Expression,
        parameter: FunctionParameter,
        due: Type,
        signature: Signature,
        environment: Environment,
    ) -> TypedExpression:
        if due.kind == "interaction":
            return self._interaction(node)
        if due.kind == "happening":
            return self._happening(node)
        if due.kind in ("inspection", "limit"):
            return self._named(node, due.kind)
        what = f"`{parameter.name}` of `{signature.name}`"
        value = self.of.value(node, environment)
        if due.kind in ("entity", "position") and value.type.kind == "group":
            group = value.type.of
            message = f"one member of `{group}` is due for {what}, this is the whole group"
            self.report.at("LJ0201", node, message, f"bind one: `exists v in {group}: …`, or name it: `{group}[1]`")
            return UNKNOWN
        if not self.of.fits(value, due, node, what):
            return UNKNOWN
        if value.type.kind == "entity" and due.kind == "position" and not environment.rule:
            return self._place_of(value, node)
        return value

    def _place_of(self, value: TypedExpression, node: s.Expression) -> TypedExpression:
        attribute = self.scope.groups[value.type.of].attributes.get("position")
        if attribute is None or not attribute.taint:
            return value
        return TypedExpression(value.ir, value.type, (*attribute.taint, self.of.step(f"`{value.type.of}`", node)))

    def _interaction(self, node: s.Expression) -> TypedExpression:
        known = self.scope.interactions()
        if isinstance(node, s.Name) and node.text in known:
            return TypedExpression(ex.Symbol(node.text), Type("interaction"))
        if isinstance(node, s.Name) and node.text in self.scope.messages:
            message = f"`{node.text}` is a kind of messages, and no event of the world"
            hint = f"read its messages: `count(true for m in {node.text})`, `exists m in {node.text}: …`"
            self.report.at("LJ0201", node, message, hint)
            return UNKNOWN
        if isinstance(node, s.Name):
            return UNKNOWN if self.scope.incomplete else self.of.unknown_name(node, list(known), "no interaction")
        quoted = node.value if isinstance(node, s.TextLiteral) and node.value in known else None
        hint = f"write `{quoted}`" if quoted else ""
        self.report.at("LJ0201", node, "an interaction's name is due here", hint, replace=quoted, safe=True)
        return UNKNOWN

    def _happening(self, node: s.Expression) -> TypedExpression:
        """The name of an event of the mission or of an interaction."""
        if not isinstance(node, s.Name) or node.text not in self.scope.events:
            return self._interaction(node)
        if node.text in self.scope.interactions():
            message = f"`{node.text}` is both an event and an interaction"
            self.report.at("LJ0104", node, message, "give the event another name")
            return UNKNOWN
        return TypedExpression(ex.Symbol(node.text), Type("happening"))

    def _is_offered(self, node: s.CallExpr, environment: Environment) -> bool:
        """True if the entity of `emitted(…)` has the interaction. Reports an entity of a type without it."""
        interaction, *entities = [argument.value for argument in node.arguments]
        if not entities:
            return True
        group = self.scope.groups.get(self.of.value(entities[0], environment).type.of)
        if group is None or group.type is None or not isinstance(interaction, s.Name) or self.scope.incomplete:
            return True
        own = group.type.interactions
        if interaction.text in own:
            return True
        message = f"`{interaction.text}` is no interaction of `{group.name}`"
        offering = [info.name for info in self.scope.groups.values() if _offers(info, interaction.text)]
        hint = f"groups with it: {', '.join(f'`{name}`' for name in offering)}" if offering else ""
        self.report.at("LJ0201", interaction, message, did_you_mean(interaction.text, own) if own else hint)
        return False

    def _option_value(
        self, argument: s.CallArgument, option: FunctionOption, environment: Environment
    ) -> TypedExpression | None:
        node = argument.value
        if argument.name is None and isinstance(node, s.BinaryExpr):
            if node.operator != option.relation:
                message = f"`{option.name}` is given with `{option.relation}`"
                self.report.at("LJ0303", node, message, f"write `{option.name} {option.relation} …`")
                return None
            node = node.right
        elif option.relation != "=":
            message = f"`{option.name}` is a bound"
            edits = ((argument.start, node.start, f"{option.name} {option.relation} "),)
            self.report.at("LJ0303", argument, message, f"write `{option.name} {option.relation} …`", edits=edits)
            return None
        return self.of.expect(node, environment, option.type, f"`{option.name}`")

    def _unknown_option(self, name: s.Name, signature: Signature) -> bool:
        known = [option.name for option in signature.options]
        message, hint = (
            f"`{signature.name}` has no argument `{name.text}`",
            f"`{signature.name}` takes no named arguments",
        )
        self.report.unknown("LJ0306", name, message, known, hint)
        return False

    def _count_fits(self, node: s.CallExpr, signature: Signature, actual: int) -> bool:
        least = signature.least or sum(1 for p in signature.parameters if not p.optional)
        most = None if signature.variadic else len(signature.parameters)
        if actual >= least and (most is None or actual <= most):
            return True
        due = f"at least {least}" if most is None else str(least) if least == most else f"{least} to {most}"
        shown = ", ".join(p.name for p in signature.parameters) + (", …" if signature.variadic else "")
        message = f"`{signature.name}` takes {due} argument{'' if due == '1' else 's'}, {actual} given"
        if actual == 2 * len(signature.parameters) and all(p.type.kind == "position" for p in signature.parameters):
            shown = ", ".join("(…, …)" for _ in signature.parameters)
        self.report.at("LJ0306", node, message, f"`{signature.name}({shown})`")
        return False

    def _all_arguments(self, node: s.CallExpr, environment: Environment) -> None:
        for argument in node.arguments:
            self.of.value(argument.value, environment)

    def _misplaced(self, node: s.CallExpr, message: str, hint: str) -> None:
        self.report.at("LJ0304", node.function, message, hint)


def children(node: s.Expression) -> tuple[s.Expression, ...]:
    """The direct sub-expressions."""
    if isinstance(node, s.BinaryExpr):
        return (node.left, node.right)
    if isinstance(node, s.CallExpr):
        return tuple(argument.value for argument in node.arguments)
    if isinstance(node, s.Tuple | s.List):
        return node.items
    if isinstance(node, s.Subscript):
        return (node.base, node.index)
    if isinstance(node, s.FieldExpr):
        return (node.base,)
    if isinstance(node, s.UnaryExpr):
        return (node.operand,)
    if isinstance(node, s.QuantifiedExpr):
        return (node.body,)
    return ()


def _mentions_unknown(node: s.Expression, rules: dict[str, object] | object) -> bool:
    """True if the body calls something that is neither a rule nor a function; then that is the error to report."""
    waiting: list[s.Expression] = [node]
    unknown = False
    while waiting:
        part = waiting.pop()
        if isinstance(part, s.Broken):
            return True
        if isinstance(part, s.CallExpr) and part.function.text not in FUNCTIONS:
            unknown = unknown or part.function.text not in rules  # type: ignore[operator]
        waiting.extend(children(part))
    return unknown


def _offers(group: GroupInfo, interaction: str) -> bool:
    return group.type is not None and interaction in group.type.interactions


def _option(argument: s.CallArgument, options: dict[str, FunctionOption]) -> FunctionOption | None:
    if argument.name is not None:
        return options.get(argument.name.text)
    value = argument.value
    if isinstance(value, s.BinaryExpr) and value.operator in ("<", "<=", ">", ">=") and isinstance(value.left, s.Name):
        return options.get(value.left.text)
    return None


def _distributions() -> str:
    return f"one of {', '.join(f'`{name}(…)`' for name in DISTRIBUTIONS)}"


def _count(number: int, noun: str) -> str:
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"
