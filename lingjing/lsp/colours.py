"""Semantic tokens: the words of a text with the kind of thing that each means."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import NamedTuple

from lingjing.dsl.source.reporter import Reporter
from lingjing.dsl.syntax.lexer import lex
from lingjing.dsl.syntax.tokens import AFTER_SUBJECT, INNER, OWN_WORDS, STATEMENTS, Token
from lingjing.lsp.analysis import Analysis
from lingjing.mission.functions import AGGREGATES, DISTRIBUTIONS, FUNCTIONS

KINDS = (
    "keyword", "string", "number", "comment", "variable", "property", "type", "function", "method", "class", "struct",
    "parameter", "enumMember",
)  # fmt: skip
"""Kinds of tokens, in the order in which the protocol numbers them."""
_KEYWORDS = frozenset((*STATEMENTS.values(), *AFTER_SUBJECT.values(), *INNER.values(), *OWN_WORDS.values()))
_OF_SPACE = {
    "symbol": "variable", "type": "type", "record": "type", "preset": "type", "rule": "function", "verb": "method",
    "interaction": "method", "agent": "class", "role": "class", "message": "struct", "local": "parameter",
    "stage": "variable", "limit": "variable", "inspection": "variable", "event": "variable", "constraint": "variable",
}  # fmt: skip
"""Space of a name → the kind of its token."""
_RELATIONS = frozenset(("EQUAL", "TILDE", "LE", "COLON"))
_LINES = re.compile(r"[^\r\n]+")
_COMMENT = re.compile(r"#[^\r\n]*")


class ColouredToken(NamedTuple):
    """A part of one line."""

    start: int
    end: int
    kind: str
    """One of `KINDS`."""


def coloured(analysis: Analysis) -> list[ColouredToken]:
    """The tokens of a text in order, each within one line."""
    text = analysis.source.text
    tokens = lex(text, Reporter(analysis.source)) or []
    spaces = {occurrence.start: occurrence.key[0] for occurrence in analysis.names.occurrences}
    parts: list[ColouredToken] = []
    before = 0
    for number, token in enumerate(tokens):
        parts.extend(_comments(text, before, token.start))
        before = max(before, token.end)
        kind = _kind(tokens, number, token, spaces)
        if kind and token.end > token.start:
            parts.extend(
                ColouredToken(token.start + line.start(), token.start + line.end(), kind)
                for line in _LINES.finditer(text[token.start : token.end])
            )
    parts.extend(_comments(text, before, len(text)))
    return sorted(set(parts))


def _comments(text: str, start: int, end: int) -> Iterator[ColouredToken]:
    for match in _COMMENT.finditer(text, start, end) if start < end else ():
        yield ColouredToken(match.start(), match.end(), "comment")


def _kind(tokens: list[Token], number: int, token: Token, spaces: dict[int, str]) -> str:
    if token.type == "STRING":
        return "string"
    if token.type in ("NUMBER", "QUANTITY"):
        return "number"
    if token.type in _KEYWORDS:
        return "keyword"
    if token.type != "NAME":
        return ""
    following = tokens[number + 1].type if number + 1 < len(tokens) else ""
    known = _OF_SPACE.get(spaces.get(token.start, ""))
    if following == "LPAR" and token.text in {*FUNCTIONS, *DISTRIBUTIONS, *AGGREGATES}:
        return "function"
    if known is not None:
        return known
    if following in _RELATIONS or (number and tokens[number - 1].type == "DOT"):
        return "property"
    return "enumMember"
