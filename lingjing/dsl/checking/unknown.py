"""Names without a declaration: collected while a file is checked, reported at its end.

Only the whole file shows where the error is. If an unknown name is used several times and resembles a declared name
that is never used, the declaration is misspelt, and one error is reported there. Otherwise every use is an error.
"""

from __future__ import annotations

import re

import msgspec

from lingjing.dsl.checking.scope import SymbolTables
from lingjing.dsl.source.reporter import Reporter
from lingjing.dsl.syntax import tree as s
from lingjing.mission.diagnostics import Related, Span
from lingjing.suggest import did_you_mean, nearest

_MOST_RELATED = 5
"""Most uses that an error at a declaration lists (chosen)."""
_SYNTAX = ("LJ0010", "LJ0011", "LJ0006", "LJ0001")
"""Codes of syntax errors."""
_DECLARES_VALUES = ("param", "region", "grid", "target", "asset")
"""Keywords of declarations that expressions can refer to."""
_LOOKED_FOR_AS = {
    "agent": ("agent", "role"),
    "message": ("message kind",),
    "adjudicate": ("function",),
    "stage": ("stage",),
}
"""Keyword of a declaration → the kinds in `UnknownUse.what` that it can declare. The others declare values."""
_HEADS = {
    **{word: re.compile(rf"{word} +\w") for word in ("message", "adjudicate", "stage", *_DECLARES_VALUES)},
    "agent": re.compile(r"agent +\w+ *(\[[^\]]*\])? *as +(?!controls\b|when\b)\w"),
}
"""Keyword → pattern of a declaration with a complete name."""
_FROM_LIBRARIES = ("no asset type", "no target type", "no type", "no message record", "no interaction")
"""Kinds of names that libraries declare."""


class UnknownUse(msgspec.Struct, frozen=True):
    """One use of an unknown name."""

    node: s.Name
    known: tuple[str, ...]
    """Names that are known there."""
    what: str
    """The kind of name that is missing, as the message begins: `nothing`, `no role`."""


class UnknownNames:
    """The unknown names of one file."""

    def __init__(self, report: Reporter, scope: SymbolTables) -> None:
        self.report = report
        self.scope = scope
        self.uses: dict[str, list[UnknownUse]] = {}

    def note(self, node: s.Name, known: list[str], what: str) -> None:
        """Store the use of a name without a declaration."""
        self.uses.setdefault(node.text, []).append(UnknownUse(node, tuple(known), what))

    def report_all(self) -> None:
        """Report the stored uses."""
        faulty = self._faulty_declarations()
        for name, uses in self.uses.items():
            if self.report.full:
                break
            if name in faulty or self._was_in_a_fault(name):
                continue
            declared = self._misspelt_declaration(name, uses)
            if declared is not None:
                self._at_declaration(name, *declared, uses)
                continue
            for use in uses:
                self._at_use(use)
        self.uses.clear()

    def _faulty_declarations(self) -> set[str]:
        """Names with a faulty declaration: it lacks its name, or has the name of another.

        For each such declaration this is the most used unknown name of its kind.
        """
        names: set[str] = set()
        for keyword in self._nameless():
            kinds = _LOOKED_FOR_AS.get(keyword, ("nothing", "group"))
            fitting = [
                (len(uses), name)
                for name, uses in self.uses.items()
                if name not in names and any(kind in uses[0].what for kind in kinds)
            ]
            if fitting:
                names.add(max(fitting)[1])
        return names

    def _nameless(self) -> list[str]:
        """The keywords of declarations with a missing or a duplicate name."""
        keywords = []
        source = self.report.source
        for item in self.report.diagnostics:
            line = source.line_text(item.span.line).strip()
            keyword = line.split(None, 1)[0] if line else ""
            if item.code == "LJ0104" and item.related:
                first = source.line_text(item.related[0].span.line).strip()
                if first != line and (keyword in _LOOKED_FOR_AS or keyword in _DECLARES_VALUES):
                    keywords.append(keyword)
            elif item.code in _SYNTAX and keyword in _HEADS and not _HEADS[keyword].match(line):
                keywords.append(keyword)
        return keywords

    def _was_in_a_fault(self, name: str) -> bool:
        """True if a faulty statement may have declared the name: as it is, joined with another word, or misspelt."""
        poisoned = self.scope.poisoned
        if name in poisoned or nearest(name, poisoned) is not None:
            return True
        return len(name) > 2 and any(word.startswith(name) or word.endswith(name) for word in poisoned)

    def _at_use(self, use: UnknownUse) -> None:
        node, name = use.node, use.node.text
        library = self.scope.not_imported.get(name)
        if self.scope.incomplete and (library is not None or use.what in _FROM_LIBRARIES):
            return
        hint = f"add it: `use {library} {{ {name} }}`" if library else did_you_mean(name, use.known)
        close = None if library else nearest(name, use.known)
        self.report.at("LJ0101", node, f"{use.what} is called `{name}`", hint, replace=close)

    def _at_declaration(self, name: str, declared: str, span: Span, uses: list[UnknownUse]) -> None:
        related = tuple(
            Related(self.report.span(use.node.start, use.node.end), f"`{name}` is used here")
            for use in uses[:_MOST_RELATED]
        )
        message = f"`{declared}` is declared, but `{name}` is what the rest of the file uses"
        self.report.at("LJ0101", span, message, f"did you mean `{name}`?", related=related, replace=name)

    def _misspelt_declaration(self, name: str, uses: list[UnknownUse]) -> tuple[str, Span] | None:
        if len(uses) < 2:
            return None
        close = nearest(name, uses[0].known)
        span = self._declaration(close) if close else None
        if close is None or span is None or span.path != self.report.source.path:
            return None
        mentioned = len(re.findall(rf"(?<!\w){re.escape(close)}(?!\w)", self.report.source.text))
        return (close, span) if mentioned == 1 else None

    def _declaration(self, name: str) -> Span | None:
        scope = self.scope
        if name in scope.symbols:
            return scope.symbols[name].span
        for table in (scope.rules, scope.types):
            if name in table:
                return table[name].span
        for pairs in (scope.messages, scope.stages):
            if name in pairs:
                return pairs[name][1]
        return scope.agents.get(name) or scope.roles.get(name)
