"""Repairs of a statement that does not parse: the candidates, in the order of their likelihood.

A candidate changes few tokens: a word of another language becomes the keyword, a sign another sign, a missing sign or
keyword is inserted, a surplus one is removed, braces are added or removed. The parser tries each, and applies the first
with which the whole statement can be read. So the statement is kept, and nothing else is reported for the same cause.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass

from lingjing.dsl.source.reporter import Change
from lingjing.dsl.syntax.foreign import CLAUSES, PHRASES, VALUE_TYPES
from lingjing.dsl.syntax.statements import KINDS
from lingjing.dsl.syntax.tokens import INNER, STATEMENTS, SYMBOLS, Token
from lingjing.mission.units import UNITS
from lingjing.suggest import nearest

_INSERTED = (
    ":",
    "=",
    "->",
    "as",
    "<=",
    "per",
    "to",
    "at",
    "when",
    "controls",
    "counts",
    "over",
    "from",
    "by",
    "of",
    "may",
)
"""Signs and words that a repair may insert, the likeliest first."""
_REPLACED = (":", "=", "->", "as", "<=", "..", "per", "to", "at", "controls", "counts", "over", "from", "by", "when")
"""Signs and words that may have been keyword by another one, the likeliest first."""
_SIGNS = frozenset(
    (
        "COLON",
        "EQUAL",
        "TILDE",
        "LE",
        "OP",
        "ARROW",
        "BOTH",
        "MINUS",
        "SEP",
        "COMMA",
        "RANGE",
        "FOR",
        "AS",
        "FROM",
        "WITH",
    )
)
"""Token types that a repair may replace."""
_SURPLUS = frozenset(("COLON", "EQUAL", "SEP", "TILDE"))
"""Token types that a repair may remove."""
_CONDITIONS = {"constraint": ("always",), "adjudicate": ("when",), "stage": ("done", "when")}
"""Keyword of a block → the words before its condition."""


@dataclass(frozen=True, slots=True)
class Repair:
    """A change of a statement's tokens."""

    at: int
    """Index of the first changed token."""
    removed: int
    """Number of tokens that are replaced."""
    inserted: tuple[Token, ...]
    hint: str
    edits: tuple[Change, ...]
    safe: bool = False
    stop: int = -1
    """Index after the statement if it is not the next end of a statement."""
    last: tuple[Token, ...] = ()
    """Tokens added at the end of the statement."""
    message: str = ""
    """The message; empty for the usual one."""

    def statement(self, tokens: list[Token], begin: int) -> tuple[list[Token], int]:
        """The changed statement, and the index of the token after it."""
        stop = self.stop if self.stop >= 0 else _stop(tokens, max(self.at + self.removed, begin))
        rest = tokens[self.at + self.removed : stop]
        return [*tokens[begin : self.at], *self.inserted, *rest, *self.last], stop


def repairs(tokens: list[Token], begin: int, fault: int, due: list[str]) -> Iterator[Repair]:
    """The candidates for a token at `fault` that does not fit, in a statement that begins at `begin`."""
    yield from _words(tokens, fault, due)
    yield from _relations(tokens, begin, fault, due)
    yield from _conditions(tokens, begin, fault)
    yield from _replacements(tokens, fault, due)
    yield from _insertions(tokens, fault, due)
    yield from _removals(tokens, begin, fault)
    yield from _braces(tokens, begin, fault, due)


def _words(tokens: list[Token], fault: int, due: list[str]) -> Iterator[Repair]:
    """Words of other languages and in other cases."""
    token = tokens[fault]
    following = tokens[fault + 1] if fault + 1 < len(tokens) else token
    for at in (fault, fault - 1):
        pair = (tokens[at].text, tokens[at + 1].text) if 0 <= at < len(tokens) - 1 else ("", "")
        if pair in PHRASES:
            yield _replace(tokens, at, 2, PHRASES[pair], safe=PHRASES[pair] != ":")
    before = tokens[fault - 1] if fault else token
    if before.type == "QUANTITY" and before.unit not in UNITS:
        close = nearest(before.unit, [word for word, kind in INNER.items() if kind in due])
        start = before.end - len(before.unit)
        if close is not None:
            parts = (Token("NUMBER", before.text, before.start, start), Token(INNER[close], close, start, before.end))
            yield Repair(fault - 1, 1, parts, f"did you mean `{close}`?", ((start, before.end, close),), True)
    if token.type != "NAME":
        return
    version = re.fullmatch(r"[vV](\d+)", token.text)
    if version is not None and before.type == "LJS":
        number = Token("NUMBER", version[1], token.start, token.end)
        yield Repair(fault, 1, (number,), f"write `ljs {version[1]}`", ((token.start, token.end, version[1]),), True)
    lower = token.text.lower()
    if lower != token.text and lower in INNER:
        yield _replace(tokens, fault, 1, lower, safe=True)
    keyword = CLAUSES.get(lower)
    if keyword is not None and (keyword != "when" or "WHEN" in due):
        yield _replace(tokens, fault, 1, keyword, safe=keyword == "when")
    if following.type == "NUMBER" and token.text in UNITS and not following.unit:
        yield from _swapped_unit(tokens, fault)


def _swapped_unit(tokens: list[Token], at: int) -> Iterator[Repair]:
    unit, number = tokens[at], tokens[at + 1]
    written = f"{number.text} {unit.text}"
    quantity = Token("QUANTITY", number.text, unit.start, number.end, unit.text)
    hint = f"a unit follows its number: `{written}`"
    yield Repair(at, 2, (quantity,), hint, ((unit.start, number.end, written),))


def _relations(tokens: list[Token], begin: int, fault: int, due: list[str]) -> Iterator[Repair]:
    """`name: value` for `name = value`, and `a = b` for `a == b`."""
    first, token = tokens[begin], tokens[fault]
    if fault and token.type == "NUMBER" and tokens[fault - 1].text in UNITS and tokens[fault - 1].type == "NAME":
        yield from _swapped_unit(tokens, fault - 1)
    if fault >= begin + 2 and first.type == "NAME" and tokens[begin + 1].type == "COLON":
        hint = f"write `{first.text} = …`"
        colon = tokens[begin + 1]
        equal = Token("EQUAL", "=", colon.start, colon.end)
        edits = ((first.end, colon.end, " ="),)
        yield Repair(begin + 1, 1, (equal,), hint, edits, True, message=f"`=` is due after `{first.text}`, found `:`")
    if token.type == "EQUAL" and "OP" in due:
        yield _replace(tokens, fault, 1, "==")
    if token.text in ("<", ">") and fault == begin + 1 and first.type == "NAME" and "LE" in due:
        bound = Token("LE", "<=", token.start, token.end)
        yield Repair(fault, 1, (bound,), f"write `{first.text} <= …`", ((token.start, token.end, "<="),))
    if token.type == "COLON" and "RANGE" in due and tokens[fault - 1].type == "NUMBER":
        yield _replace(tokens, fault, 1, "..")


def _conditions(tokens: list[Token], begin: int, fault: int) -> Iterator[Repair]:
    """A condition without the word before it: `always`, `when`, `done when`."""
    words = _CONDITIONS.get(_owner(tokens, begin), ())
    first = tokens[begin]
    present = first.text == words[0] if words else True
    if not words or (present and len(words) == 1) or fault > begin + 3:
        return
    missing = words[1:] if present else words
    at = begin + 1 if present else begin
    place = tokens[at].start
    inserted = tuple(Token(STATEMENTS[word], word, place, place) for word in missing)
    spelled = " ".join(words)
    hint = f"write `{missing[-1]}`" if present else f"write `{spelled} …`"
    if present or tokens[fault].type not in ("EQUAL", "TILDE"):
        yield Repair(at, 0, inserted, hint,
                     ((place, place, " ".join(missing) + " "),))  # fmt: skip


def _replacements(tokens: list[Token], fault: int, due: list[str]) -> Iterator[Repair]:
    if tokens[fault].type not in (*_SIGNS, "NAME"):
        return
    for text in _REPLACED:
        if _kind(text) in due and _kind(text) != tokens[fault].type:
            if tokens[fault].type == "NAME" and text not in INNER:
                continue
            yield _replace(tokens, fault, 1, text)


def _insertions(tokens: list[Token], fault: int, due: list[str]) -> Iterator[Repair]:
    place = tokens[fault].start
    if tokens[fault].type in ("NL", "RBRACE", "$END"):
        return
    for text in _INSERTED:
        if _kind(text) in due:
            token = Token(_kind(text), text, place, place)
            yield Repair(fault, 0, (token,), f"write `{text}`", ((place, place, f"{text} "),))


def _removals(tokens: list[Token], begin: int, fault: int) -> Iterator[Repair]:
    before = tokens[fault - 1] if fault else None
    if before is not None and fault - 1 > begin and before.text in VALUE_TYPES:
        yield _remove(tokens, fault - 1)
    for at in (fault, fault - 1):
        if at > begin and tokens[at].type in _SURPLUS:
            yield _remove(tokens, at)


def _braces(tokens: list[Token], begin: int, fault: int, due: list[str]) -> Iterator[Repair]:
    """A block without its braces on one line, and braces around a condition."""
    first, token = tokens[begin], tokens[fault]
    kind = KINDS.get(first.text)
    if "LBRACE" in due and kind is not None and kind.opens_block:
        stop = _stop(tokens, fault)
        place, end = token.start, tokens[stop - 1].end
        opening, closing = Token("LBRACE", "{", place, place), Token("RBRACE", "}", end, end)
        hint = f"a block stands in braces: `{first.text} {{ … }}`"
        edits = ((place, place, "{ "), (end, end, " }"))
        yield Repair(fault, 0, (opening,), hint, edits, stop=stop, last=(closing,))
    if token.type == "LBRACE" and kind is not None and not kind.opens_block:
        close = _closing(tokens, fault)
        inside = tokens[fault + 1 : close]
        if close > fault + 1 and all(each.type != "NL" for each in inside):
            present = inside[0].type == "WHEN"
            hint = f"a condition has no braces: write `{first.text} when …`"
            edits = (
                (token.start, inside[0].start, "" if present else "when "),
                (inside[-1].end, tokens[close].end, ""),
            )
            when = () if present else (Token("WHEN", "when", token.start, token.start),)
            yield Repair(fault, close + 1 - fault, (*when, *inside), hint, edits, stop=close + 1)


def _replace(tokens: list[Token], at: int, count: int, text: str, *, safe: bool = False) -> Repair:
    start, end = tokens[at].start, tokens[at + count - 1].end
    hint = f"write `{text}`"
    written = text
    if text == ":" and tokens[at - 1].end < start:
        start = tokens[at - 1].end if tokens[at].type in ("SEP", "COMMA") or count > 1 else start
    return Repair(at, count, (Token(_kind(text), text, start, end),), hint, ((start, end, written),), safe)


def _remove(tokens: list[Token], at: int) -> Repair:
    token = tokens[at]
    following = tokens[at + 1].start if at + 1 < len(tokens) else token.end
    start, end = (token.start, following) if token.type == "NAME" else (token.start, token.end)
    return Repair(at, 1, (), f"remove `{token.text}`", ((start, end, ""),))


def _kind(text: str) -> str:
    return INNER.get(text) or STATEMENTS.get(text) or SYMBOLS[text]


def _stop(tokens: list[Token], start: int) -> int:
    for at in range(start, len(tokens)):
        if tokens[at].type in ("NL", "RBRACE", "LBRACE", "$END"):
            return at
    return len(tokens) - 1


def _closing(tokens: list[Token], start: int) -> int:
    depth = 0
    for at in range(start, len(tokens)):
        depth += (tokens[at].type == "LBRACE") - (tokens[at].type == "RBRACE")
        if depth == 0:
            return at
    return -1


def _owner(tokens: list[Token], begin: int) -> str:
    """The keyword of the block in which a statement stands."""
    depth, at = 0, begin - 1
    while at >= 0:
        depth += (tokens[at].type == "RBRACE") - (tokens[at].type == "LBRACE")
        if depth < 0:
            break
        at -= 1
    while at > 0 and tokens[at - 1].type not in ("NL", "LBRACE", "RBRACE"):
        at -= 1
    return tokens[at].text if at >= 0 else ""
