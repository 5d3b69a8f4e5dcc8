"""Spacing: a space or nothing between two tokens of one line, and the text of a token.

The lexer distinguishes some forms by a space: `at (…)` is the operator and `at(…)` the function; `- 3` is a sign before
a number and `-3` one number. The rules here preserve these.
"""

from __future__ import annotations

from dataclasses import dataclass

from lingjing.dsl.syntax.lexer import OPERANDS
from lingjing.dsl.syntax.tokens import Token

_TIGHT_AFTER = frozenset(("LPAR", "LSQB", "DOT", "RANGE"))
_TIGHT_BEFORE = frozenset(("RPAR", "RSQB", "COMMA", "SEP", "DOT", "DOTSTAR", "RANGE"))
_OPENERS = frozenset(("LPAR", "LSQB", "LSET"))
_CLOSERS = frozenset(("RPAR", "RSQB", "RSET"))
_QUANTIFIERS = frozenset(("EXISTS", "FORALL"))


@dataclass(slots=True)
class Spelling:
    """Tokens on one line."""

    text: str
    """The line."""
    begins: list[int]
    """Offset of each token's first character."""
    ends: list[int]
    """Offset after each token's last character."""
    depths: list[int]
    """Number of open brackets at each token."""


def spell(tokens: list[Token]) -> Spelling:
    """Lay out the tokens of a statement's head, or of any sequence without a block, on one line."""
    parts: list[str] = []
    begins, ends, depths = [], [], []
    at = depth = 0
    colon_is_spaced = bool(tokens) and tokens[0].type not in ("NAME", *_QUANTIFIERS)
    for position, token in enumerate(tokens):
        if token.type in _CLOSERS:
            depth -= 1
        spaced = position > 0 and _is_spaced(tokens, position, colon_is_spaced and depth == 0)
        if token.type in _QUANTIFIERS:
            colon_is_spaced = False
        word = f"{token.text} {token.unit}" if token.unit else text_of(token)
        if spaced:
            parts.append(" ")
            at += 1
        parts.append(word)
        begins.append(at)
        at += len(word)
        ends.append(at)
        depths.append(depth)
        if token.type in _OPENERS:
            depth += 1
    return Spelling("".join(parts), begins, ends, depths)


def text_of(token: Token) -> str:
    """The text of a token, with line ends inside a long text unified to LF."""
    return token.text.replace("\r\n", "\n").replace("\r", "\n") if token.type == "STRING" else token.text


def _is_spaced(tokens: list[Token], at: int, colon_is_spaced: bool) -> bool:
    before, after = tokens[at - 1], tokens[at]
    if before.type == "USE":  # `use .boats`: here the dot begins a path; elsewhere it joins words
        return True
    if before.type in _TIGHT_AFTER or after.type in _TIGHT_BEFORE:
        return False
    if after.type == "COLON":
        return colon_is_spaced
    if after.type == "LPAR":
        return before.type != "NAME" and not _is_sign(tokens, at - 1)
    if after.type == "LSQB":
        return before.type not in ("NAME", "RSQB", "RPAR") and not _is_sign(tokens, at - 1)
    if _is_sign(tokens, at - 1):
        return after.type in ("NUMBER", "QUANTITY")
    return True


def _is_sign(tokens: list[Token], at: int) -> bool:
    return tokens[at].type == "MINUS" and (at == 0 or tokens[at - 1].type not in OPERANDS)
