"""The signature of the call around a cursor: a function, a distribution or a rule, and the argument at the cursor."""

from __future__ import annotations

import re
from dataclasses import dataclass

from lingjing.dsl.checking.typenames import word as type_word
from lingjing.lsp.analysis import Analysis
from lingjing.mission.functions import AGGREGATES, DISTRIBUTIONS, FUNCTIONS, Signature

_FARTHEST = 4000
"""Most characters before the cursor in which the beginning of a call is searched (chosen)."""
_PIECE = re.compile(r'"[^"\r\n]*"|[()\[\]{},]|[^\W\d]\w*')


@dataclass(frozen=True, slots=True)
class CallSignature:
    """The call around a cursor."""

    label: str
    """The whole signature, such as `box(corner: position, corner: position)`."""
    parameters: tuple[tuple[int, int], ...]
    """First and last offset of each parameter in the label."""
    active: int
    """Index of the parameter at the cursor."""
    doc: str = ""


def signature_at(analysis: Analysis, offset: int) -> CallSignature | None:
    """The signature of the innermost call around an offset; None outside of calls."""
    called = _call_before(analysis.source.text[max(0, offset - _FARTHEST) : offset])
    if called is None:
        return None
    name, commas = called
    known = FUNCTIONS.get(name) or DISTRIBUTIONS.get(name)
    rule = analysis.scope.rules.get(name)
    if rule is not None:
        words = [f"{parameter.name.text}: {parameter.type.text}" for parameter in rule.parameters]
        return _made(name, words, commas, "a rule of this mission", variadic=False)
    if known is not None:
        return _made(name, _parameters(known), commas, known.doc, variadic=known.variadic)
    if name in AGGREGATES:
        return _made(name, ["value for v in group"], commas, "over the members of a group", variadic=False)
    return None


def _parameters(known: Signature) -> list[str]:
    words = [
        f"{each.name}: {type_word(each.type)}{', …' if known.variadic and each is known.parameters[-1] else ''}"
        for each in known.parameters
    ]
    return words + [f"{option.name} {option.relation} {type_word(option.type)}" for option in known.options]


def _made(name: str, words: list[str], commas: int, doc: str, *, variadic: bool) -> CallSignature:
    label = f"{name}("
    places: list[tuple[int, int]] = []
    for word in words:
        label += ", " if places else ""
        places.append((len(label), len(label) + len(word)))
        label += word
    last = len(words) - 1
    active = min(commas, last) if variadic or commas <= last else last
    return CallSignature(f"{label})", tuple(places), max(0, active), doc)


def _call_before(text: str) -> tuple[str, int] | None:
    """Name of the innermost call that is open at the end of a text, and the number of commas in it."""
    open_calls: list[tuple[str, str, int]] = []
    word = ""
    for match in _PIECE.finditer(text):
        piece = match[0]
        if piece in "([{":
            adjacent = word and text[match.start() - 1 : match.start()] not in (" ", "\t", "\n", "")
            open_calls.append((piece, word if piece == "(" and adjacent else "", 0))
        elif piece in ")]}":
            if open_calls:
                open_calls.pop()
        elif piece == "," and open_calls:
            bracket, name, commas = open_calls[-1]
            open_calls[-1] = (bracket, name, commas + 1)
        word = piece if piece[0].isalpha() or piece[0] == "_" else ""
    for bracket, name, commas in reversed(open_calls):
        if bracket == "{":
            return None
        if name:
            return name, commas
    return None
