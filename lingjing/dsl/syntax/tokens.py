"""Token kinds and the words of the language.

A word is a keyword only where it can be one: a statement's keyword at the start of a statement and with something to
say after it, an inner keyword anywhere but before `=`, `~`, `:` and after a dot. So `band = …`, `target: name` and
`r.by` stay names.
"""

from __future__ import annotations

import msgspec


class Token(msgspec.Struct, frozen=True, gc=False):
    """One token; `start` and `end` are character offsets. For a quantity `text` is the number and `unit` the unit."""

    type: str
    text: str
    start: int
    end: int
    unit: str = ""


_STATEMENTS = """
    ljs use mission goal scene clock budget weather comms actions param mode region grid target asset
    camera agent authority message adjudicate unlock stage relation success failure when done observes
    verb interaction mount part record reveal prompt hidden state override sweep limit permit
    constraint always event appear vanish inspection
"""
STATEMENTS: dict[str, str] = {word: word.upper() for word in _STATEMENTS.split()}
"""Words that begin a statement, with their token types."""

_INNER = """
    in over as controls may command from to per when carries by at optional and or not exists forall
    extends counts of for true false
"""
INNER: dict[str, str] = {word: word.upper() for word in _INNER.split()}
"""Words that mean something inside a statement, with their token types."""

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
"""How a token type is called in a message."""

_CONTINUE = """
    EQUAL TILDE LE OP MINUS RANGE AND OR NOT COLON ARROW BOTH COMMA SEP DOT IN BY FROM TO AT OVER AS
    WHEN FOR COUNTS EXTENDS
"""
OPERATORS_THAT_CONTINUE = frozenset(_CONTINUE.split())
"""After these a line end does not end the statement."""
