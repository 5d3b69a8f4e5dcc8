"""The author's layout of a text: statements, blocks, comments and blank lines around the tokens.

The formatter uses this instead of the syntax tree's node kinds, so that a new statement of the grammar needs no change
here. From the tree it takes only the offsets at which statements begin.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field

import msgspec

from lingjing.dsl.syntax import tree as s
from lingjing.dsl.syntax.tokens import Token

_GAP = re.compile(r"(?P<line>\r\n|\n|\r)|(?P<comment>#[^\r\n]*)")


@dataclass(slots=True)
class Comment:
    """A comment and its position on the line."""

    text: str
    """The text, including `#`."""
    own_line: bool
    """True if nothing precedes it on its line."""
    blank_before: bool
    """True if a blank line precedes it."""


@dataclass(slots=True)
class Word:
    """A token of a statement, and the comments between it and the next token."""

    token: Token
    comments: list[Comment] = field(default_factory=list)


@dataclass(slots=True)
class StatementLayout:
    """A statement with its comments."""

    parts: list[Word | BlockLayout] = field(default_factory=list)
    """Words and blocks in order."""
    leading: list[Comment] = field(default_factory=list)
    """Comments before the statement."""
    trailing: Comment | None = None
    """Comment at the end of its last line."""
    blank_before: bool = False
    """True if a blank line precedes it."""
    joined: bool = False
    """True if it begins on the line of the statement before it."""


@dataclass(slots=True)
class BlockLayout:
    """`{ … }`."""

    items: list[StatementLayout] = field(default_factory=list)
    """The statements."""
    opening: Comment | None = None
    """Comment behind `{`."""
    tail: list[Comment] = field(default_factory=list)
    """Comments before `}`."""
    broken: bool = False
    """True if the author spread the block over several lines."""


@dataclass(slots=True)
class _Gap:
    comments: list[Comment]
    newline: bool
    blank: bool


def lay_out(text: str, tokens: list[Token], tree: s.File) -> BlockLayout:
    """Return the whole file as one block without braces. `tokens` and `tree` must come from `text`, without errors."""
    starts = frozenset(_statement_starts(tree))
    return _Reader(text, [token for token in tokens if token.type not in ("NL", "$END")], starts).file()


def _statement_starts(tree: s.File) -> Iterator[int]:
    waiting: list[object] = [tree]
    while waiting:
        node = waiting.pop()
        if isinstance(node, tuple):
            waiting.extend(node)
        elif isinstance(node, s.SyntaxNode):
            if isinstance(node, s.Statement) and not isinstance(node, s.BracedBlock):
                yield node.start
            if isinstance(node, s.Override):  # together with the overridden statement it is one statement
                node = node.item
            waiting.extend(getattr(node, name) for name in _nested_fields(type(node)))


def _nested_fields(kind: type[s.SyntaxNode]) -> tuple[str, ...]:
    """The fields of a node that can contain statements: its blocks and its items."""
    known = _NESTED.get(kind)
    if known is None:
        known = _NESTED[kind] = tuple(
            f.name for f in msgspec.structs.fields(kind) if "Block" in str(f.type) or "Statement" in str(f.type)
        )
    return known


_NESTED: dict[type[s.SyntaxNode], tuple[str, ...]] = {}


class _Reader:
    """One pass over the tokens."""

    def __init__(self, text: str, tokens: list[Token], starts: frozenset[int]) -> None:
        self.text = text
        self.starts = starts
        self.tokens = [t for i, t in enumerate(tokens) if not (t.type == "SEP" and self._before_item(tokens, i))]
        self.at = 0

    def file(self) -> BlockLayout:
        block = BlockLayout(broken=True)
        self._items(block)
        return block

    def _before_item(self, tokens: list[Token], at: int) -> bool:
        return at + 1 < len(tokens) and tokens[at + 1].start in self.starts

    def _gap(self) -> _Gap:
        """The comments and line ends between the token before `at` and the one at `at`."""
        start = self.tokens[self.at - 1].end if self.at else 0
        end = self.tokens[self.at].start if self.at < len(self.tokens) else len(self.text)
        comments: list[Comment] = []
        if end - start < 2 and self.at and self.text[start:end] in ("", " "):
            return _Gap(comments, False, False)
        lines, newline = (1 if start == 0 else 0), False
        for match in _GAP.finditer(self.text, start, end):
            if match["line"]:
                lines += 1
                newline = True
            else:
                comments.append(Comment(match["comment"].rstrip(), lines > 0, lines > 1))
                lines = 0
        return _Gap(comments, newline, lines > 1)

    def _items(self, block: BlockLayout) -> None:
        """Read statements up to the block's `}`, or to the end of the file."""
        previous: StatementLayout | None = None
        while True:
            gap = self._gap()
            block.broken = block.broken or gap.newline
            if gap.comments and not gap.comments[0].own_line:
                first = gap.comments.pop(0)
                if previous is not None:
                    previous.trailing = first
                else:
                    block.opening = first
            if self.at >= len(self.tokens) or self.tokens[self.at].type == "RBRACE":
                block.tail = gap.comments
                break
            statement = StatementLayout(leading=gap.comments, blank_before=gap.blank)
            statement.joined = previous is not None and not gap.newline
            self._statement(statement)
            block.items.append(statement)
            previous = statement
        if not block.items and not block.tail and block.opening is None:
            block.broken = False
        block.broken = block.broken or any(_is_broken(item) for item in block.items)

    def _statement(self, statement: StatementLayout) -> None:
        first = True
        while self.at < len(self.tokens):
            token = self.tokens[self.at]
            if token.type == "RBRACE" or (not first and token.start in self.starts):
                return
            if not first:
                self._inner_comments(statement)
            first = False
            self.at += 1
            if token.type == "LBRACE":
                block = BlockLayout()
                self._items(block)
                self.at += 1
                statement.parts.append(block)
            else:
                statement.parts.append(Word(token))

    def _inner_comments(self, statement: StatementLayout) -> None:
        last = statement.parts[-1]
        if isinstance(last, Word):
            last.comments.extend(self._gap().comments)


def _is_broken(statement: StatementLayout) -> bool:
    return any(part.broken if isinstance(part, BlockLayout) else bool(part.comments) for part in statement.parts)
