"""Checked expressions: their form in the mission, their type, their taint, and the names around them."""

from __future__ import annotations

import msgspec

from lingjing.mission import expression as ex
from lingjing.mission.diagnostics import Span
from lingjing.mission.functions import ANY, Type


class FlowStep(msgspec.Struct, frozen=True):
    """One step on the path of a hidden value: its name there, and the place in the text."""

    name: str
    span: Span


Taint = tuple[FlowStep, ...]
"""The path of a hidden value; the first step is the declaration that hides it. Empty for a public value."""


class TypedExpression(msgspec.Struct, frozen=True):
    """A checked expression."""

    ir: ex.Expr
    """Its form in the mission graph."""
    type: Type
    taint: Taint = ()
    """The path of the hidden value that it depends on."""


UNKNOWN = TypedExpression(ex.Symbol("?"), ANY)
"""Stands for an expression with a reported error. It fits everywhere, so that no error is reported twice."""


class Environment(msgspec.Struct, frozen=True):
    """The context of an expression."""

    locals: dict[str, Type] = {}
    """Names bound around it → their types."""
    rule: bool = False
    """True inside a rule, which is evaluated while the mission runs."""

    def binding(self, name: str, of: Type) -> Environment:
        """The environment with one more name."""
        return Environment({**self.locals, name: of}, self.rule)


STATIC = Environment()
RULE = Environment(rule=True)
