"""Diagnostics as text with a snippet and a caret, and as JSON."""

from __future__ import annotations

from collections.abc import Iterable

import msgspec

from lingjing.dsl.source.text import SourceText
from lingjing.mission.diagnostics import Diagnostic, Span
from lingjing.terminal import cells, visible

WIDEST = 140
"""Columns of a snippet (chosen). A longer line is cut around the error."""

_COLOURS = {"error": "1;31", "warning": "1;33", "note": "1;36", "frame": "1;34", "bold": "1", "hint": "1;32"}
"""ANSI colours by part of the text."""


def render_text(diagnostics: Iterable[Diagnostic], source: SourceText, *, color: bool = False) -> str:
    """Render each diagnostic as a block: place, code, message, the line with carets, related places, hint.

    The text ends with a newline unless it is empty. Control characters from the mission are made visible, so that it
    cannot inject escape sequences.
    """
    paint = _Ansi if color else _Plain
    return "".join(_one(item, source, paint) for item in diagnostics)


def render_json(diagnostics: Iterable[Diagnostic]) -> str:
    """A JSON array of diagnostics, indented, with a newline at the end."""
    return msgspec.json.format(msgspec.json.encode(tuple(diagnostics)), indent=2).decode() + "\n"


def summary(diagnostics: Iterable[Diagnostic]) -> str:
    """`3 errors in 2 files`; empty without errors."""
    errors = [item for item in diagnostics if item.severity == "error"]
    if not errors:
        return ""
    files = len({item.span.path for item in errors})
    return f"{_counted(len(errors), 'error')} in {_counted(files, 'file')}"


def conclusion(diagnostics: Iterable[Diagnostic]) -> str:
    """The summary, and a line for each kind of fix with the option that applies it."""
    listed = tuple(diagnostics)
    lines = [summary(listed)]
    fixes = [item.fix for item in listed if item.fix is not None]
    safe = sum(fix.safe for fix in fixes)
    if safe:
        lines.append(f"{_counted(safe, 'safe fix', 'safe fixes')}: --fix applies {'it' if safe == 1 else 'them'}")
    if len(fixes) > safe:
        guesses = _counted(len(fixes) - safe, "likely fix", "likely fixes")
        lines.append(f"{guesses}: --unsafe-fixes applies {'it' if len(fixes) - safe == 1 else 'them'} too")
    return "\n".join(lines)


def _one(item: Diagnostic, source: SourceText, paint: type[_Plain]) -> str:
    place = visible(f"{item.span.path}:{item.span.line}:{item.span.column}")
    kind = paint.put(item.severity, f"{item.severity}[{item.code}]")
    lines = [f"{paint.put('bold', place)}: {kind}: {visible(item.message)}"]
    width = max([item.span.end_line, *(related.span.line for related in item.related)])
    margin = " " * len(str(width))
    if item.span.path == source.path:
        lines += _snippet(item.span, source, margin, paint, item.severity, "^")
    for related in item.related:
        where = visible(f"{related.span.path}:{related.span.line}:{related.span.column}")
        lines.append(
            f"{margin} {paint.put('frame', '=')} {paint.put('note', 'note')}: {visible(related.message)} ({where})"
        )
        if related.span.path == source.path and related.span.line != item.span.line:
            lines += _snippet(related.span, source, margin, paint, "note", "-")
    if item.hint:
        lines.append(f"{margin} {paint.put('frame', '=')} {paint.put('hint', 'hint')}: {visible(item.hint)}")
    if item.fix is not None and item.fix.safe:
        lines.append(f"{margin} {paint.put('frame', '=')} {paint.put('hint', 'safe fix')}: {visible(item.fix.title)}")
    return "\n".join(lines) + "\n\n"


def _snippet(span: Span, source: SourceText, margin: str, paint: type[_Plain], colour: str, mark: str) -> list[str]:
    text = source.line_text(span.line)
    start = span.column - 1
    end = span.end_column - 1 if span.end_line == span.line else len(text)
    shown, start, end = _cut(text, start, end)
    before, marked = shown[:start], shown[start:end]
    carets = mark * max(1, cells(marked))
    bar = paint.put("frame", "|")
    number = paint.put("frame", str(span.line).rjust(len(margin)))
    return [
        f"{margin} {bar}",
        f"{number} {bar} {_visible(shown)}",
        f"{margin} {bar} {' ' * cells(before)}{paint.put(colour, carets)}",
    ]


def _cut(text: str, start: int, end: int) -> tuple[str, int, int]:
    """Return at most `WIDEST` characters around the marked part, and the new offsets of the mark."""
    if len(text) <= WIDEST:
        return text, start, min(end, len(text))
    left = max(0, min(start - WIDEST // 4, len(text) - WIDEST))
    right = left + WIDEST
    head, tail = "…" if left else "", "…" if right < len(text) else ""
    return head + text[left:right] + tail, start - left + len(head), min(end, right) - left + len(head)


def _visible(text: str) -> str:
    return "".join(character if character.isprintable() else " " if character == "\t" else "�" for character in text)


def _counted(number: int, noun: str, several: str = "") -> str:
    return f"{number} {noun}" if number == 1 else f"{number} {several or noun + 's'}"


class _Plain:
    """Rendering as plain text."""

    @staticmethod
    def put(_colour: str, text: str) -> str:
        return text


class _Ansi(_Plain):
    """Rendering with ANSI colours."""

    @staticmethod
    def put(_colour: str, text: str) -> str:
        return f"\x1b[{_COLOURS[_colour]}m{text}\x1b[0m"
