"""Token kinds and the words of the language.

A word is a keyword only where it can be one: a statement's keyword at the start of a statement with an operand after
it, an inner keyword anywhere except before `=`, `~`, `:` and after a dot. So `band = …`, `target: name` and `r.by`
remain names.
"""

from __future__ import annotations

import msgspec

from lingjing.dsl.syntax.statements import KINDS


class Token(msgspec.Struct, frozen=True, gc=False):
    """A token of a text: a word, a number, a text or a sign."""

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


STATEMENTS: dict[str, str] = {word: kind.token for word, kind in KINDS.items() if not kind.has_subject}
"""Words that begin a statement → token types."""

AFTER_SUBJECT: dict[str, str] = {word: kind.token for word, kind in KINDS.items() if kind.has_subject}
"""Words that follow the first name or text of a statement (`oracle wins`) → token types. No other statement has a word
there, so that they are names everywhere else."""

_OF_EXPRESSIONS = "in from to by at optional and or not exists forall for true false"


def _of_patterns(*, own: bool) -> list[str]:
    """The words of the patterns of all statements that have words of their own, or of all others."""
    kinds = [kind for kind in KINDS.values() if kind.has_own_words == own]
    return [word for kind in kinds for form in kind.forms for part in form.elements() for word in part.words()]


INNER: dict[str, str] = {word: word.upper() for word in (*_OF_EXPRESSIONS.split(), *_of_patterns(own=False))}
"""Words with a meaning inside a statement → token types: those of expressions and of the statements' patterns."""

OWN_WORDS: dict[str, str] = {word: word.upper() for word in _of_patterns(own=True) if word not in INNER}
"""Words with a meaning only inside the statements of `OWN_STATEMENTS` → token types."""
OWN_STATEMENTS = frozenset([kind.token for kind in KINDS.values() if kind.has_own_words])
"""Token types of the keywords of statements with words of their own."""

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
    **{kind: f"`{word}`" for word, kind in {**STATEMENTS, **AFTER_SUBJECT, **INNER, **OWN_WORDS}.items()},
}
"""Names of token types in messages."""

_CONTINUE = """
    EQUAL TILDE LE OP MINUS RANGE AND OR NOT COLON ARROW BOTH COMMA SEP DOT IN BY FROM TO AT OVER AS
    WHEN FOR COUNTS EXTENDS UNTIL REPEAT EVERY WITH WITHIN
"""
OPERATORS_THAT_CONTINUE = frozenset(_CONTINUE.split())
"""Token types after which a line end does not end the statement."""
