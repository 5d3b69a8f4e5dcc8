"""Token kinds and the words of the language.

A word is a keyword only where it can be one: a statement's keyword at the start of a statement with an operand after
it, an inner keyword anywhere except before `=`, `~`, `:` and after a dot. So `band = …`, `target: name` and `r.by`
remain names.
"""

from __future__ import annotations

import msgspec


class Token(msgspec.Struct, frozen=True, gc=False):
    """One token."""

    type: str
    """Kind of the token: a key of the grammar."""
    text: str
    """Its text; for a quantity only the number."""
    start: int
    """Offset of the first character."""
    end: int
    """Offset after the last character."""
    unit: str = ""
    """Unit of a quantity; empty for other tokens."""


_STATEMENTS = """
    ljs use mission goal scene clock budget weather comms actions param mode region grid target asset
    camera agent authority message adjudicate unlock stage relation success failure when done observes
    verb interaction mount part record reveal prompt hidden state override sweep limit permit
    constraint always event appear vanish inspection
"""
STATEMENTS: dict[str, str] = {word: word.upper() for word in _STATEMENTS.split()}
"""Words that begin a statement → token types."""

_INNER = """
    in over as controls may command from to per when carries by at optional and or not exists forall
    extends counts of for true false
"""
INNER: dict[str, str] = {word: word.upper() for word in _INNER.split()}
"""Words with a meaning inside a statement → token types."""

SYMBOLS: dict[str, str] = {
    "{": "LBRACE",
    "}": "RBRACE",
    "(": "LPAR",
    ")": "RPAR",
    "[": "LSQB",
    "]": "RSQB",
    ":": "COLON",
    "=": "EQUAL",
    "~": "TILDE",
    "<=": "LE",
    ".": "DOT",
    ".*": "DOTSTAR",
    "..": "RANGE",
    "->": "ARROW",
    "<->": "BOTH",
    "-": "MINUS",
    "+": "OP",
    "*": "OP",
    "/": "OP",
    "==": "OP",
    "!=": "OP",
    "<": "OP",
    ">": "OP",
    ">=": "OP",
}
"""Symbols → token types."""

NAMES_IN_MESSAGES: dict[str, str] = {
    "NL": "the end of the statement",
    "SEP": "`,`",
    "COMMA": "`,`",
    "NAME": "a name",
    "NUMBER": "a number",
    "QUANTITY": "a quantity",
    "STRING": "a text in quotes",
    "RANGE": "`..`",
    "LSET": "`{`",
    "RSET": "`}`",
    "OP": "an operator",
    "$END": "the end of the file",
    **{kind: f"`{symbol}`" for symbol, kind in SYMBOLS.items() if kind not in ("OP", "RANGE")},
    **{kind: f"`{word}`" for word, kind in {**STATEMENTS, **INNER}.items()},
}
"""Names of token types in messages."""

_CONTINUE = """
    EQUAL TILDE LE OP MINUS RANGE AND OR NOT COLON ARROW BOTH COMMA SEP DOT IN BY FROM TO AT OVER AS
    WHEN FOR COUNTS EXTENDS
"""
OPERATORS_THAT_CONTINUE = frozenset(_CONTINUE.split())
"""Token types after which a line end does not end the statement."""
