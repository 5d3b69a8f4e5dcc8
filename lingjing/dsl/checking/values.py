"""Checked expressions: their form in the mission, their type, the way of a hidden value, and the names around them."""

from __future__ import annotations

import msgspec

from lingjing.mission import expression as ex
from lingjing.mission.diagnostics import Span
from lingjing.mission.functions import ANY, Type


class FlowStep(msgspec.Struct, frozen=True):
    """One station on the way of a hidden value: what it is called there and where that stands."""

    name: str
    span: Span


Taint = tuple[FlowStep, ...]
"""How a hidden value came here, first the declaration that hides it; empty for a public value."""


class TypedExpression(msgspec.Struct, frozen=True):
    """A checked expression: its form in the graph, its type, and the hidden value it depends on, if any."""

    ir: ex.Expr
    type: Type
    taint: Taint = ()


UNKNOWN = TypedExpression(ex.Symbol("?"), ANY)
"""Stands for what was already reported; fits everywhere, so that nothing is reported twice."""


class Environment(msgspec.Struct, frozen=True):
    """Names bound around an expression, and whether it stands in a rule (evaluated while the mission runs)."""

    locals: dict[str, Type] = {}
    rule: bool = False

    def binding(self, name: str, of: Type) -> Environment:
        """The same with one more name."""
        return Environment({**self.locals, name: of}, self.rule)


STATIC = Environment()
RULE = Environment(rule=True)
