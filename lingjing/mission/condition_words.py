"""Conditions of the mission graph in plain words, for readers without knowledge of the language, and the bounds they
set.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import msgspec

from lingjing.mission import expression as ex
from lingjing.mission.fold import Composite, Literal, Meaning, meaning
from lingjing.mission.functions import OPERATIONS, operation
from lingjing.mission.languages import ORIGINAL, phrases

_INVERSE = OPERATIONS["not"].words
"""The words of an inverted condition."""

_AGGREGATES = {
    "count": "the number of {1} for which {0}",
    "sum": "the sum of {0} over {1}",
    "min": "the minimum of {0} over {1}",
    "max": "the maximum of {0} over {1}",
}
_JOINED = {"and": "{0} and {1}", "or": "{0} or {1}"}
_QUANTIFIED = {"forall": "for every {0}, {1}", "exists": "for some {0}, {1}"}
_ONE_OF = "{0} is one of {1}"
_HOLDS, _HOLDS_FOR = "*{0}* holds", "*{0}* holds for {1}"
_IF, _EVERY = "if {0}, then {1}", "every {0}"
SENTENCES = (
    *_AGGREGATES.values(), *_JOINED.values(), *_QUANTIFIED.values(), _ONE_OF, _HOLDS, _HOLDS_FOR, _IF, _EVERY,
)  # fmt: skip
"""The wordings of this module, beside those of the table of operations."""
_SIGNS = {"<": "<", "<=": "≤", ">": ">", ">=": "≥"}
_TURNED = {"<": ">", "<=": "≥", ">": "<", ">=": "≤"}


class _ConditionText(msgspec.Struct, frozen=True):
    """A part of a condition in words."""

    words: str
    text: str
    """Its text in the language; a declared property is replaced by its value."""
    measure: str | None = None
    """The prefix of a bound of this part in the list of bounds, such as `IoU `. None if its bounds are not listed."""


class ConditionWords:
    """Semantics of conditions in plain words. Its world is the list of bounds met so far; its bound names map to
    groups.

    `text` writes expressions that have no words of their own. `declared` holds the values of the properties of groups,
    as text, by (group, property). `language` is that of the words.
    """

    def __init__(
        self, text: Callable[[ex.Expr], str], declared: Mapping[tuple[str, str], str], language: str = ORIGINAL
    ) -> None:
        self._text = text
        self._declared = declared
        self._phrases = phrases(language, __package__)

    def sentence(self, condition: ex.Expr) -> str:
        """The condition as a sentence without a full stop, in the order in which it is written."""
        phrase: _ConditionText = meaning(condition, self)({}, [])
        return phrase.words

    def bounds(self, condition: ex.Expr, domains: Mapping[str, str]) -> tuple[str, ...]:
        """The bounds of a condition in reading order, each once: `≤ 25 m` for a distance, `IoU ≥ 0.5` for an overlap.

        `domains` maps bound names to their groups.
        """
        bounds: list[str] = []
        meaning(condition, self)(domains, bounds)
        return tuple(dict.fromkeys(bounds))

    def literal(self, node: Literal) -> Meaning:
        """The literal as it is written."""
        return self._written(node)

    def name(self, node: ex.Ref) -> Meaning:
        """The reference as it is written."""
        return self._written(node)

    def field(self, node: ex.Attr, base: Meaning) -> Meaning:
        """The field as it is written; the words of its base if that has words of its own."""
        text, owner = self._text(node), node.base

        def phrase(names: Mapping[str, str], bounds: list[str]) -> _ConditionText:
            base_phrase: _ConditionText = base(names, bounds)
            if base_phrase.words != f"`{base_phrase.text}`":
                return _ConditionText(base_phrase.words, text)
            group = names.get(owner.name, owner.name) if isinstance(owner, ex.Ref) else ""
            value = self._declared.get((group, node.name))
            return _ConditionText(f"`{text}`", text if value is None else value)

        return phrase

    def apply(self, node: Composite, operands: tuple[Meaning, ...]) -> Meaning:
        """The operation in the words of the table of functions; as it is written if it has no words there."""
        text, operation_entry, shape = self._text(node), operation(node), self._shape(node, len(operands))

        def phrase(names: Mapping[str, str], bounds: list[str]) -> _ConditionText:
            parts = [operand(names, bounds) for operand in operands]
            if isinstance(node, ex.Binary) and node.operator in _SIGNS:
                bounds.extend(_bound(node.operator, *parts))
            words = shape.format(*[part.words for part in parts]) if shape else f"`{text}`"
            if isinstance(node, ex.Binary) and node.operator == "or" and _is_inverse(node.left):
                # "not A or B" has two readings in prose, "if A, then B" has one.
                before = self._phrases.text(_INVERSE).partition("{")[0]
                words = self._phrases.text(_IF).format(parts[0].words.removeprefix(before), parts[1].words)
            return _ConditionText(words, text, operation_entry.measure if operation_entry else None)

        return phrase

    def over(self, node: ex.Quantified | ex.Aggregate, body: Meaning) -> Meaning:
        """The quantifier or aggregate in words: for every, for some, the number of."""
        text, group_words = self._text(node), f"{node.domain} `{node.variable}`"

        def phrase(names: Mapping[str, str], bounds: list[str]) -> _ConditionText:
            inner = body({**names, node.variable: node.domain}, bounds).words
            own = self._phrases.text
            if isinstance(node, ex.Quantified):
                return _ConditionText(own(_QUANTIFIED[node.quantifier]).format(group_words, inner), text)
            shape = own(_AGGREGATES[node.function])
            return _ConditionText(shape.format(inner, own(_EVERY).format(group_words)), text)

        return phrase

    def _shape(self, node: Composite, count: int) -> str:
        """The wording of an operation with `count` operands, `{0}` for the first of them; "" if it has no words."""
        own = self._phrases.text
        match node:
            case ex.Binary(operator="and" | "or" as joined):
                return own(_JOINED[joined]).format(_side(node, node.left, 0), _side(node, node.right, 1))
            case ex.Binary(operator="in", right=ex.Sequence()):
                return own(_ONE_OF)
            case ex.Call(rule=True, function=name) if count == 0:
                return own(_HOLDS).format(name)
            case ex.Call(rule=True, function=name):
                first, *others = (f"{{{number}}}" for number in range(count))
                for other in others:
                    first = own(_JOINED["and"]).format(first, other)
                return own(_HOLDS_FOR).format(name, first)
        operation_entry = operation(node)
        return (
            _worded(own(operation_entry.words), count) if operation_entry is not None and operation_entry.words else ""
        )

    def _written(self, node: ex.Expr) -> Meaning:
        text = self._text(node)
        return lambda names, bounds: _ConditionText(f"`{text}`", text)


def _is_inverse(node: ex.Expr) -> bool:
    return isinstance(node, ex.Unary) and node.operator == "not"


def _side(node: ex.Binary, side: ex.Expr, number: int) -> str:
    mixed = isinstance(side, ex.Binary) and side.operator in ("and", "or") and side.operator != node.operator
    return f"({{{number}}})" if mixed else f"{{{number}}}"


def _worded(wording: str, count: int) -> str:
    """The wording for this number of operands: the part in brackets is left out if its operand is absent."""
    always, _, more = wording.partition("[")
    for words in (always + more.rstrip("]"), always):
        if words.count("{") == count:
            return words
    return ""


def _bound(symbol: str, left: _ConditionText, right: _ConditionText) -> list[str]:
    """The bound that a comparison sets to a measured quantity, as a list of at most one text."""
    if left.measure is not None:
        return [f"{left.measure}{_SIGNS[symbol]} {right.text}"]
    return [f"{right.measure}{_TURNED[symbol]} {left.text}"] if right.measure is not None else []
