"""`Reporter`: the collector of diagnostics that all phases use."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Protocol

from lingjing.dsl.source.text import JoinedSource, SourceText
from lingjing.mission.diagnostics import Diagnostic, Edit, Fix, Related, Severity, Span
from lingjing.suggest import did_you_mean, is_certain, nearest

MOST = 1000
"""Most diagnostics of one file (chosen): more are of no use, and a file that is no mission could give any number."""


Change = tuple[int, int, str]
"""A part of a fix: the offsets that it replaces, and the new text."""


class Placed(Protocol):
    """A node or token with a place in a text."""

    @property
    def start(self) -> int: ...  # noqa: D102 - offset of the first character
    @property
    def end(self) -> int: ...  # noqa: D102 - offset after the last character


class PlacedWord(Placed, Protocol):
    """A word with a place in a text."""

    @property
    def text(self) -> str: ...  # noqa: D102


class Reporter:
    """Collects the diagnostics of one file. A call reports an error at offsets of its source."""

    __slots__ = ("diagnostics", "source")

    def __init__(self, source: SourceText) -> None:
        self.source = source
        self.diagnostics: list[Diagnostic] = []

    def __call__(
        self,
        code: str,
        start: int,
        end: int,
        message: str,
        hint: str = "",
        *,
        related: tuple[Related, ...] = (),
        replace: str | None = None,
        safe: bool = False,
        severity: Severity = "error",
        also: Iterable[tuple[int, int]] = (),
        edits: Iterable[Change] = (),
    ) -> None:
        """Report a diagnostic. `replace`: text that a fix writes over the span and over the spans in `also`. `edits`:
        a fix at other places.
        """
        if len(self.diagnostics) >= MOST:
            return
        if len(self.diagnostics) == MOST - 1:
            code, message, hint = "LJ0008", f"there are more than {MOST} errors", "the rest is not shown"
            related, replace, edits = (), None, ()
        span = self.source.span(start, end)
        if isinstance(self.source, JoinedSource) and self.source.inner(start, end) is not None:
            related, replace, edits = (Related(span, "the error is here"), *related), None, ()
            span = self.source.place
        fix = None
        if replace is not None:
            spans = (span, *(self.source.span(*place) for place in also))
            fix = Fix(_title(span, replace), tuple(Edit(at, replace) for at in spans), safe)
        elif changes := tuple(edits):
            fix = self._fix(changes, safe=safe)
        self.diagnostics.append(Diagnostic(code, span, message, hint, severity, related, fix))

    def at(
        self,
        code: str,
        place: Placed,
        message: str,
        hint: str = "",
        *,
        related: tuple[Related, ...] = (),
        replace: str | None = None,
        safe: bool = False,
        severity: Severity = "error",
        edits: Iterable[Change] = (),
    ) -> None:
        """Report a diagnostic at a node or a token."""
        self(
            code,
            place.start,
            place.end,
            message,
            hint,
            related=related,
            replace=replace,
            safe=safe,
            severity=severity,
            edits=edits,
        )

    def unknown(
        self, code: str, word: PlacedWord, message: str, known: Iterable[str], hint: str = "", *, sure: bool = False
    ) -> None:
        """Report an unknown word. Hint and fix are the nearest of the `known` words, else the hint is `hint`.

        `sure`: True if a close word is certainly the intended one; then the fix is safe.
        """
        words = tuple(known)
        close, safe = nearest(word.text, words), sure and is_certain(word.text, words)
        proposal = f"did you mean `{close}`?" if close else did_you_mean(word.text, words) or hint
        self.at(code, word, message, proposal, replace=close, safe=safe)

    def once(self, table: dict[str, Span], name: PlacedWord, what: str) -> None:
        """Enter a declared name into a table. Report it if the table has it already."""
        span = self.span(name.start, name.end)
        first = table.setdefault(name.text, span)
        if first is not span:
            self.declared_twice(name, f"{what} `{name.text}`", first)

    def declared_twice(self, place: Placed, what: str, first: Span) -> None:
        """Report a second declaration of a name, with the place of the first."""
        related = (Related(first, "first declared here"),)
        self.at("LJ0104", place, f"{what} is declared twice", "choose another name", related=related)

    def _fix(self, changes: tuple[Change, ...], *, safe: bool) -> Fix:
        made = tuple(Edit(self.source.span(start, end), text) for start, end, text in changes)
        words = " and ".join(_title(edit.span, edit.text.strip()) for edit in made)
        return Fix(words, made, safe)

    @property
    def full(self) -> bool:
        """True if further diagnostics are dropped, so that searching for proposals is wasted."""
        return len(self.diagnostics) >= MOST

    def span(self, start: int, end: int) -> Span:
        """The span between two offsets of this source."""
        return self.source.span(start, end)


def _title(span: Span, replace: str) -> str:
    if not replace:
        return "remove it"
    return f"{'insert' if span.start == span.end else 'write'} `{replace}`"
