"""Token kinds and the words of the language.

A word is a keyword only where it can be one: a statement's keyword at the start of a statement with an operand after
it, an inner keyword anywhere except before `=`, `~`, `:` and after a dot. So `band = …`, `target: name` and `r.by`
remain names.
"""

from __future__ import annotations

import msgspec

from lingjing.dsl.syntax.statements import KINDS


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


STATEMENTS: dict[str, str] = {word: kind.token for word, kind in KINDS.items()}
"""Words that begin a statement → token types."""

_OF_EXPRESSIONS = "in from to by at optional and or not exists forall for true false"
_OF_PATTERNS = [
    word for kind in KINDS.values() for form in kind.forms for part in form.elements() for word in part.words()
]
INNER: dict[str, str] = {word: word.upper() for word in (*_OF_EXPRESSIONS.split(), *_OF_PATTERNS)}
"""Words with a meaning inside a statement → token types: those of expressions and of the statements' patterns."""

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
    WHEN FOR COUNTS EXTENDS UNTIL REPEAT EVERY
"""
OPERATORS_THAT_CONTINUE = frozenset(_CONTINUE.split())
"""Token types after which a line end does not end the statement."""
