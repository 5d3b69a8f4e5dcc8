"""The analysis of one version of one text. Each part is computed on first use."""

from __future__ import annotations

from functools import cached_property, lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

from lingjing.dsl import SourceText, compile_source
from lingjing.dsl.source.reporter import Reporter
from lingjing.dsl.source.text import read_source
from lingjing.dsl.syntax import tree as s
from lingjing.dsl.syntax.parser import parse
from lingjing.errors import LingjingError
from lingjing.lsp.names import Names, Occurrence, find_names

if TYPE_CHECKING:
    from lingjing.dsl.checking.scope import SymbolTables
    from lingjing.mission.diagnostics import Diagnostic, Span


class Analysis:
    """A text at `path`: the path of a file, or `<…>` for a text without a file."""

    def __init__(self, text: str, path: str) -> None:
        self.source = SourceText(text, path)

    @cached_property
    def diagnostics(self) -> tuple[Diagnostic, ...]:
        """The diagnostics that `lingjing validate` reports."""
        return compile_source(self.source).diagnostics

    @cached_property
    def tree(self) -> s.File:
        """The syntax tree. Unreadable statements are `Faulty`."""
        return parse(Reporter(self.source))

    @cached_property
    def names(self) -> Names:
        """Declarations and uses."""
        return find_names(self.tree, self.source.text)

    @cached_property
    def scope(self) -> SymbolTables:
        """The compiler's symbol tables, as far as the text is readable."""
        from lingjing.dsl.checking import checker
        from lingjing.dsl.checking.toplevel import FileChecker

        report = Reporter(self.source)
        file = FileChecker(report)
        file.declarations(self.tree)
        checker.check_mission(file, self.tree)
        return file.scope

    def declaration(self, occurrence: Occurrence) -> tuple[str, int, int] | None:
        """Path and offsets of a name's declaration, in this text or in the library that declares it; None without
        one."""
        own = self.names.declared.get(occurrence.key)
        if own is not None:
            return self.source.path, own.start, own.end
        span = self._imported(occurrence.key[1])
        return (span.path, span.start, span.end) if span is not None else self._part_of_type(occurrence)

    def doc(self, declared: Occurrence) -> str:
        """The comment lines directly above a declaration."""
        return comment_above(self.source, declared.start)

    # -- private

    def _imported(self, name: str) -> Span | None:
        declaration = self.scope.declared(name)
        return declaration.span if declaration is not None else None

    def _part_of_type(self, occurrence: Occurrence) -> tuple[str, int, int] | None:
        """Path and offsets of a verb or an interaction that a library's type declares; None without one."""
        space, name, _ = occurrence.key
        if space not in ("verb", "interaction", ""):
            return None
        for decl in self.scope.types.values():
            if name in decl.verbs or name in decl.interactions:
                place = declared_in(decl.span.path, "verb" if name in decl.verbs else "interaction", name)
                if place is not None:
                    return place
        return None


def declared_in(path: str, space: str, name: str) -> tuple[str, int, int] | None:
    """Path and offsets of a declaration in a library file; None if the file is no longer readable."""
    other = library_file(path)
    declaration = other.names.declared.get((space, name, None)) if other else None
    return (path, declaration.start, declaration.end) if declaration else None


def library_file(path: str) -> Analysis | None:
    """The analysis of a library's file in its present state; None if it is unreadable."""
    try:
        stat = Path(path).stat()
        return _library_file(path, stat.st_mtime_ns, stat.st_size)
    except (OSError, LingjingError):
        return None


@lru_cache(maxsize=32)
def _library_file(path: str, _modified: int, _size: int) -> Analysis:
    return Analysis(read_source(path).text, path)


def comment_above(source: SourceText, offset: int) -> str:
    """The comment lines directly above an offset's line, without `#`."""
    line = source.line_of(offset) - 1
    comments: list[str] = []
    while line >= 1 and source.line_text(line).lstrip().startswith("#"):
        comments.append(source.line_text(line).lstrip().lstrip("#").strip())
        line -= 1
    return "\n".join(reversed(comments))
