"""Diagnostics: a user's errors as data.

A diagnostic carries a stable code, a primary span, related spans, a message, a hint, and, if a safe or likely one
exists, the edit that repairs the text. `lingjing.dsl.diagnostics` lists the codes and prints diagnostics.
"""

from __future__ import annotations

from typing import Literal

import msgspec

Severity = Literal["error", "warning", "note"]


class Span(msgspec.Struct, frozen=True, order=True):
    """A stretch of a text. `start` and `end` are character offsets, end exclusive; lines and columns count from 1.

    `end_line`, `end_column` is the place just after the last character.
    """

    path: str
    start: int
    end: int
    line: int
    column: int
    end_line: int
    end_column: int


class Related(msgspec.Struct, frozen=True):
    """Another place that explains the error."""

    span: Span
    message: str
    """Its relation to the error."""


class Edit(msgspec.Struct, frozen=True):
    """Replace the span's text by `text`; an empty span inserts."""

    span: Span
    text: str


class Fix(msgspec.Struct, frozen=True):
    """Edits that repair the error."""

    title: str
    edits: tuple[Edit, ...]
    safe: bool = False
    """True if the fix is the only possible meaning of the text, so that it can be applied without a question."""


class Diagnostic(msgspec.Struct, frozen=True):
    """One error of a user.

    >>> try:
    ...     lingjing.compile("wrong.ljs")
    ... except lingjing.MissionError as error:
    ...     print(error.diagnostics[0].span.line, error.diagnostics[0].hint)
    32 did you mean `lifeboat`?
    """

    code: str
    """Stable identifier, such as `E0101`. `docs/` lists all of them."""
    span: Span
    message: str
    """Names the element at fault and its error."""
    hint: str = ""
    """The way out; "" if there is none to give."""
    severity: Severity = "error"
    """The severity. Only an `error` prevents compilation."""
    related: tuple[Related, ...] = ()
    fix: Fix | None = None


def in_source_order(diagnostics: tuple[Diagnostic, ...]) -> tuple[Diagnostic, ...]:
    """The diagnostics sorted by place, then code, without exact repeats."""
    by_place: dict[tuple[str, int, str, str], Diagnostic] = {}
    for diagnostic in sorted(diagnostics, key=lambda d: (d.span.start, d.span.end, d.code)):
        by_place.setdefault(
            (diagnostic.span.path, diagnostic.span.start, diagnostic.code, diagnostic.message), diagnostic
        )
    return tuple(by_place.values())


def has_errors(diagnostics: tuple[Diagnostic, ...]) -> bool:
    """True if one of the diagnostics prevents compilation."""
    return any(item.severity == "error" for item in diagnostics)
