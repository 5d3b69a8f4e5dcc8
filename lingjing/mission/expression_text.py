"""Expressions as text: one traversal of the tree, with methods that writers override.

`ExpressionWriter` writes for readers of the language (`spell`). `instance_text` writes the rules of one instance.
`lingjing.dsl.printing.phrases` writes text that compiles to the same expression again.
"""

from __future__ import annotations

from collections.abc import Mapping

from lingjing.mission import expression as ex
from lingjing.mission.functions import DISTRIBUTIONS, FUNCTIONS, RANKS, Signature
from lingjing.mission.units import unit_of

RANGE = RANKS[".."]
"""Rank of a range."""
SUM = RANKS["+"]
"""Rank of the operands of a range."""
OPERAND = 1 + max(RANKS.values())
"""Rank of an operand that binds tighter than any operator."""

LocalNames = Mapping[str, str]
"""Bound names → the group or the message kind they range over."""

_SIGNS = {"=": "=", ">=": "≥", "<=": "≤"}


class ExpressionWriter:
    """Writes expressions in the language's own spelling, with the fewest brackets."""

    def text(self, node: ex.Expr, rank: int = 0, names: LocalNames | None = None) -> str:
        """The expression; in brackets if it binds looser than `rank`."""
        written, binds = self._written(node, rank, names or {})
        return f"({written})" if binds < rank else written

    # -- methods that a writer may override

    def number(self, value: float, unit: str) -> str:
        """A number in the unit of its author. `value` is in SI units."""
        known = unit_of(unit) if unit else None
        amount = f"{value / known.factor if known else value:.10g}"
        if unit == "ticks" and amount == "1":
            unit = "tick"
        return f"{amount} {unit}" if unit else amount

    def quoted(self, text: str) -> str:
        """Return a text in quotes."""
        return f'"{text}"'

    def name(self, node: ex.Ref) -> str:
        """Return the name of a reference."""
        return node.name

    def field(self, owner: ex.Expr, name: str, names: LocalNames) -> str:
        """The name of a field of `owner`."""
        return name

    def option(self, name: str, relation: str, value: ex.Expr, names: LocalNames) -> str:
        """A named argument."""
        return f"{name} {_SIGNS[relation]} {self.text(value, 0, names)}"

    def unary(self, node: ex.Unary, names: LocalNames) -> str:
        """`not x` or `-x`."""
        if node.operator == "not":
            return f"not {self.text(node.operand, RANKS['not'], names)}"
        return f"-{self.text(node.operand, OPERAND, names)}"

    def right(self, node: ex.Binary, rank: int, names: LocalNames) -> str:
        """The right operand of an operator. `rank` is the rank of the context of the whole expression."""
        return self.text(node.right, RANKS[node.operator] + 1, names)

    def quantified(self, node: ex.Quantified, body: str) -> tuple[str, int]:
        """A quantifier over its written body, and its rank."""
        span = f" in {node.domain}" if node.quantifier == "forall" else ""
        return f"{node.quantifier} {node.variable}{span}: {body}", 0

    def aggregated(self, node: ex.Aggregate, body: str) -> str:
        """An aggregate over its written body."""
        return f"{node.function}({body} for {node.variable} in {node.domain})"

    # -- the traversal

    def _written(self, node: ex.Expr, rank: int, names: LocalNames) -> tuple[str, int]:
        """The text and its rank."""
        match node:
            case ex.Unary(operator=operator):
                return self.unary(node, names), RANKS["not"] if operator == "not" else OPERAND
            case ex.Binary(operator=operator, left=left):
                own = RANKS[operator]
                right = self.right(node, rank, names)
                return f"{self.text(left, own, names)} {operator} {right}", own
            case ex.Range(low=low, high=high):
                return f"{self.text(low, SUM, names)}..{self.text(high, SUM, names)}", RANGE
            case ex.Quantified(variable=variable, domain=domain, body=body):
                return self.quantified(node, self.text(body, 0, {**names, variable: domain}))
            case ex.Aggregate(variable=variable, domain=domain, body=body):
                return self.aggregated(node, self.text(body, 0, {**names, variable: domain})), OPERAND
        return self._whole(node, names), OPERAND

    def _whole(self, node: ex.Expr, names: LocalNames) -> str:
        """The text of a node that never needs brackets."""
        match node:
            case ex.Number(value=value, unit=unit):
                return self.number(value, unit)
            case ex.Text(value=text):
                return self.quoted(text)
            case ex.Flag(value=flag):
                return "true" if flag else "false"
            case ex.Ref():
                return self.name(node)
            case ex.Index(base=base, index=index):
                return f"{self.text(base, OPERAND, names)}[{self.text(index, 0, names)}]"
            case ex.Attr(base=base, name=name):
                return f"{self.text(base, OPERAND, names)}.{self.field(base, name, names)}"
            case ex.Point(items=items):
                return f"({self.listed(items, names)})"
            case ex.Sequence(items=items):
                return f"[{self.listed(items, names)}]"
            case ex.Call(function=name):
                return f"{name}({self._arguments(node, FUNCTIONS.get(name), names)})"
            case ex.Draw(distribution=name):
                return f"{name}({self._arguments(node, DISTRIBUTIONS.get(name), names)})"
            case ex.Symbol(name=name):
                return name
        raise TypeError(f"no text for {node!r}")

    def listed(self, items: tuple[ex.Expr, ...], names: LocalNames) -> str:
        """The expressions with commas between them."""
        return ", ".join(self.text(item, 0, names) for item in items)

    def _arguments(self, node: ex.Call | ex.Draw, signature: Signature | None, names: LocalNames) -> str:
        relations = {option.name: option.relation for option in signature.options} if signature else {}
        arguments = [self.text(argument, 0, names) for argument in node.arguments]
        arguments += [self.option(name, relations.get(name, "="), value, names) for name, value in node.named]
        return ", ".join(arguments)


_SPELLING = ExpressionWriter()


def spell(expr: ex.Expr) -> str:
    """The expression in the language's own spelling."""
    return _SPELLING.text(expr)
