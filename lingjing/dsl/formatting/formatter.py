"""The formatter: one layout for each meaning; the author's words stay unchanged.

It decides indentation (two spaces), spaces between tokens, line breaks in lines wider than `WIDTH`, and at most one
blank line. The author decides comments, units and the notation of numbers, which statements share a line, which blocks
span several lines, and the places of blank lines. A separator at the end of a line is dropped, because the line's end
separates too.

Invariants, asserted on every call: before and after, the tokens (except newlines and separators), the comments, and the
syntax tree (except its offsets) are equal.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import cache
from typing import Any

import msgspec

from lingjing.collector import collector_at_rest
from lingjing.dsl.formatting.layout import BlockLayout, Comment, StatementLayout, Word, lay_out
from lingjing.dsl.formatting.spacing import Spelling, spell, text_of
from lingjing.dsl.source.reporter import Reporter
from lingjing.dsl.source.text import SourceText
from lingjing.dsl.syntax import tree as s
from lingjing.dsl.syntax.lexer import lex
from lingjing.dsl.syntax.parser import parse_tokens
from lingjing.dsl.syntax.tokens import STATEMENTS, Token
from lingjing.mission.diagnostics import Diagnostic, in_source_order

WIDTH = 120
"""Columns of a line (chosen). Comments and single words may be longer."""
_CONTINUATION = 4
"""Additional indentation of a continued line, columns."""
_LINE_END = frozenset(("NL", "SEP", "$END"))
_OPENING, _CLOSING = Token("LBRACE", "{", 0, 0), Token("RBRACE", "}", 0, 0)
_COMMENT = re.compile(r"#[^\r\n]*")


class Formatted(msgspec.Struct, frozen=True):
    """The result of formatting."""

    text: str | None
    """The formatted text; None if the file has syntax errors."""
    diagnostics: tuple[Diagnostic, ...] = ()
    """The syntax errors."""


def format_text(text: str) -> Formatted:
    """Format a text; see `format_source`."""
    return format_source(SourceText(text))


def format_source(source: SourceText) -> Formatted:
    """Format a source. A file with syntax errors is left unchanged; other errors do not matter."""
    with collector_at_rest():
        return _formatted(source)


def _formatted(source: SourceText) -> Formatted:
    tokens, tree, diagnostics = _read(source)
    if diagnostics:
        return Formatted(None, diagnostics)
    block = lay_out(source.text, tokens, tree)
    rows = _Writer().block(block, 0)
    text = "".join(f"{row.line()}\n" for row in rows)
    _assert_same(source, tokens, tree, text)
    return Formatted(text)


def _read(source: SourceText) -> tuple[list[Token], s.File, tuple[Diagnostic, ...]]:
    report = Reporter(source)
    tokens = lex(source.text, report)
    tree = s.File(0, 0, ()) if tokens is None else parse_tokens(tokens, report)
    diagnostics = in_source_order(tuple(d for d in report.diagnostics if d.severity == "error"))
    return tokens or [], tree, diagnostics


@dataclass(slots=True)
class _LineLayout:
    """One line of output."""

    level: int
    """Level of the block around it."""
    text: str
    """Code without indentation. Empty without a comment means a blank line."""
    comment: str = ""
    """Comment behind the code."""
    joinable: bool = False
    """True if another statement may follow on the line after a comma."""
    extra: int = 0
    """Additional indentation, columns."""

    def line(self) -> str:
        """The finished line."""
        code = " " * (2 * self.level + self.extra) + self.text if self.text else ""
        if not self.comment:
            return code
        return f"{code}  {self.comment}" if code else "  " * self.level + " " * self.extra + self.comment

    def width(self) -> int:
        """Columns of the code. Comments do not cause line breaks."""
        return 2 * self.level + self.extra + len(self.text)


class _Writer:
    """Turns blocks into lines."""

    def block(self, block: BlockLayout, level: int) -> list[_LineLayout]:
        """The lines of a block's content."""
        rows: list[_LineLayout] = []
        for item in block.items:
            self._comments(rows, item.leading, level)
            if item.blank_before and rows:
                rows.append(_LineLayout(level, ""))
            self._add(rows, item, level)
        self._comments(rows, block.tail, level)
        return rows

    def _comments(self, rows: list[_LineLayout], comments: list[Comment], level: int) -> None:
        for comment in comments:
            if comment.blank_before and rows:
                rows.append(_LineLayout(level, ""))
            rows.append(_LineLayout(level, "", comment.text))

    def _add(self, rows: list[_LineLayout], item: StatementLayout, level: int) -> None:
        flat = _flat(item)
        comment = item.trailing.text if item.trailing else ""
        if flat is None or 2 * level + len(flat) > WIDTH:
            spread = self._spread(item, level)
            spread[-1].comment = comment or spread[-1].comment
            rows.extend(spread)
            return
        last = rows[-1] if rows else None
        if item.joined and last is not None and last.joinable and last.width() + 2 + len(flat) <= WIDTH:
            last.text, last.comment = f"{last.text}, {flat}", comment
            return
        rows.append(_LineLayout(level, flat, comment, joinable=True))

    def _spread(self, item: StatementLayout, level: int) -> list[_LineLayout]:
        """Lay out a statement over several lines: its blocks opened, its head wrapped if it is too wide."""
        rows: list[_LineLayout] = []
        words: list[Word] = []
        for part in item.parts:
            if isinstance(part, Word):
                words.append(part)
                continue
            if not _is_empty(part):
                words.append(Word(_OPENING))
                rows.extend(self._wrapped(words, level))
                rows[-1].comment = part.opening.text if part.opening else rows[-1].comment
                rows.extend(self.block(part, level + 1))
                words = [Word(_CLOSING)]
            else:
                words.extend((Word(_OPENING), Word(_CLOSING)))
        if words:
            rows.extend(self._wrapped(words, level))
        return rows

    def _wrapped(self, words: list[Word], level: int) -> list[_LineLayout]:
        tokens = [word.token for word in words]
        spelling = spell(tokens)
        rows: list[_LineLayout] = []
        start = 0
        while start < len(words):
            extra = _CONTINUATION if rows else 0
            stop = next((i + 1 for i in range(start, len(words)) if words[i].comments), len(words))
            stop = _line_stop(tokens, spelling, start, stop, WIDTH - 2 * level - extra)
            text = spelling.text[spelling.begins[start] : spelling.ends[stop - 1]]
            row = _LineLayout(level, text, extra=extra)
            rows.append(row)
            for comment in words[stop - 1].comments:
                if comment.own_line or row.comment:
                    rows.append(_LineLayout(level, "", comment.text, extra=_CONTINUATION))
                else:
                    row.comment = comment.text
            start = stop
        return rows


def _line_stop(tokens: list[Token], spelling: Spelling, start: int, stop: int, room: int) -> int:
    """The index after the last token of a line that begins with token `start`: `stop` if it fits, else the best break.

    The best break is the last one of least bracket depth in the second half of the line, or anywhere if there is none.
    """
    begin = spelling.begins[start]
    if spelling.ends[stop - 1] - begin <= room:
        return stop
    best: tuple[bool, int, int] | None = None
    for at in range(start + 1, stop):
        if not _may_break(tokens, at):
            continue
        length = spelling.ends[at - 1] - begin
        if length > room and best is not None:
            break
        place = (length < room // 2, spelling.depths[at], -at)
        if best is None or place < best:
            best = place
        if length > room:
            break
    return stop if best is None else -best[2]


def _may_break(tokens: list[Token], at: int) -> bool:
    """True after a comma and before `and` and `or`, unless the new line would begin like a statement."""
    if tokens[at].text in STATEMENTS:
        return False
    return tokens[at - 1].type in ("COMMA", "SEP") or tokens[at].type in ("AND", "OR")


def _is_empty(block: BlockLayout) -> bool:
    return not block.items and not block.tail and block.opening is None


def _flat(item: StatementLayout) -> str | None:
    """The statement on one line; None if its author or a comment spread it over several."""
    texts: list[str] = []
    words: list[Token] = []
    for part in item.parts:
        if isinstance(part, Word):
            if part.comments:
                return None
            words.append(part.token)
            continue
        inside = _flat_block(part)
        if inside is None:
            return None
        texts.append(spell(words).text)
        texts.append(inside)
        words = []
    if words:
        texts.append(spell(words).text)
    return " ".join(texts)


def _flat_block(block: BlockLayout) -> str | None:
    if block.broken or block.tail or block.opening is not None:
        return None
    inside = [_flat(item) for item in block.items]
    if None in inside:
        return None
    return f"{{ {', '.join(text for text in inside if text is not None)} }}" if inside else "{}"


# -- nothing but the layout may change


def _assert_same(source: SourceText, tokens: list[Token], tree: s.File, text: str) -> None:
    after = SourceText(text, source.path)
    new_tokens, new_tree, diagnostics = _read(after)
    same = (
        not diagnostics
        and _essence(tokens) == _essence(new_tokens)
        and _comments(source.text, tokens) == _comments(text, new_tokens)
        and _same_but_for_places(tree, new_tree)
    )
    if not same:
        raise AssertionError(f"formatting `{source.path}` would change more than its layout; it was left as it is")


def _essence(tokens: list[Token]) -> list[tuple[str, str, str]]:
    return [(t.type, text_of(t), t.unit) for t in tokens if t.type not in _LINE_END]


def _comments(text: str, tokens: list[Token]) -> list[str]:
    """Every comment: the text after a `#` between tokens, outside of quoted texts."""
    comments: list[str] = []
    at = 0
    for token in tokens:
        if text.find("#", at, token.start) >= 0:
            comments.extend(m[0].rstrip() for m in _COMMENT.finditer(text, at, token.start))
        at = max(at, token.end)
    return comments


def _same_but_for_places(before: Any, after: Any) -> bool:
    """True if two trees, or parts of trees, differ only in offsets."""
    if isinstance(before, tuple):
        return (
            type(after) is type(before) and len(before) == len(after) and all(map(_same_but_for_places, before, after))
        )
    if isinstance(before, s.SyntaxNode):
        return type(after) is type(before) and all(
            _same_but_for_places(getattr(before, name), getattr(after, name)) for name in _fields(type(before))
        )
    return bool(before == after)


@cache
def _fields(kind: type[s.SyntaxNode]) -> tuple[str, ...]:
    return tuple(name for name in kind.__struct_fields__ if name not in ("start", "end"))
