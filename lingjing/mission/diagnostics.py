"""Diagnostics: a user's mistakes as data.

A diagnostic carries a stable code, a primary span, related spans, what is wrong, what to do, and where one is safe
or likely, the edit that does it. `lingjing.dsl.diagnostics` lists the codes and prints them.
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
    """Another place that explains the error, with what it has to do with it."""

    span: Span
    message: str


class Edit(msgspec.Struct, frozen=True):
    """Replace the span's text by `text`; an empty span inserts."""

    span: Span
    text: str


class Fix(msgspec.Struct, frozen=True):
    """Edits that mend the error. `safe` means the meaning can only be what the author wrote."""

    title: str
    edits: tuple[Edit, ...]
    safe: bool = False


class Diagnostic(msgspec.Struct, frozen=True):
    """One mistake. `message` names the thing at fault, `hint` the way out."""

    code: str
    span: Span
    message: str
    hint: str = ""
    severity: Severity = "error"
    related: tuple[Related, ...] = ()
    fix: Fix | None = None


def in_source_order(diagnostics: tuple[Diagnostic, ...]) -> tuple[Diagnostic, ...]:
    """Sorted by place, then code; exact repeats removed."""
    seen: dict[tuple[str, int, str, str], Diagnostic] = {}
    for item in sorted(diagnostics, key=lambda d: (d.span.start, d.span.end, d.code)):
        seen.setdefault((item.span.path, item.span.start, item.code, item.message), item)
    return tuple(seen.values())


def has_errors(diagnostics: tuple[Diagnostic, ...]) -> bool:
    """Whether any of them keeps the mission from being compiled."""
    return any(item.severity == "error" for item in diagnostics)
