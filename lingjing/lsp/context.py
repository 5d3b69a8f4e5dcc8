"""The context of a cursor in an unfinished text: the blocks around it and the beginning of its statement.

It is computed from the tokens before the cursor, so errors behind the cursor do not matter.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field

from lingjing.dsl.source.reporter import Reporter
from lingjing.dsl.source.text import SourceText
from lingjing.dsl.syntax.lexer import Lexer
from lingjing.dsl.syntax.statements import KINDS
from lingjing.dsl.syntax.tokens import OPERATORS_THAT_CONTINUE, STATEMENTS, Token

_WORD = re.compile(r"[^\W\d]\w*$")
_UNIT_PART = re.compile(
    r"(?<!\w)(?<!\d\.)\d+(?:\.\d+)?(?:[eE][+-]?\d+)?(?P<space>[ \t]*)(?P<unit>(?:[^\W\d_]|[%°])[\w/*^]*)?$"
)
_IN_TEXT = re.compile(r'"(?:[^"\\]|\\.)*$')
_TEXT = re.compile(r'"(?:[^"\\]|\\.)*"')


@dataclass(slots=True)
class Context:
    """The context of a cursor."""

    blocks: list[list[Token]] = field(default_factory=list)
    """The heads of the open blocks, outermost first."""
    statement: list[Token] = field(default_factory=list)
    """The tokens of the unfinished statement, without the word at the cursor."""
    word: str = ""
    """The word at the cursor."""
    word_start: int = 0
    """Offset of the word's first character."""
    number: bool = False
    """True if a number precedes the word, which may be its unit."""
    silent: bool = False
    """True if the cursor is in a comment or in a text without a hole: there are no proposals."""
    in_text: bool = False
    """True if the cursor is in a hole of a quoted text."""

    def kind(self) -> str:
        """The first token type of the innermost block's head: MISSION, ASSET, CLOCK, …; empty at the top of the
        file."""
        return self.blocks[-1][0].type if self.blocks and self.blocks[-1] else ""

    def inside(self, kind: str) -> bool:
        """True if any block around the cursor is of that kind."""
        return any(head and head[0].type == kind for head in self.blocks)

    def type_name(self) -> str:
        """The type of the entity around the cursor; "" without an entity or a type."""
        head = next((head for head in reversed(self.blocks) if head and head[0].type in ("ASSET", "TARGET")), [])
        colon = next((at for at, token in enumerate(head) if token.type == "COLON"), len(head))
        return head[colon + 1].text if colon + 1 < len(head) else ""

    def before(self, place: int = 1) -> str:
        """The type of the token `place` places before the cursor; empty if the statement is shorter."""
        return self.statement[-place].type if len(self.statement) >= place else ""

    def head(self) -> str:
        """The type of the statement's first token."""
        return self.statement[0].type if self.statement else ""


def context_at(text: str, offset: int) -> Context:
    """Return the context of a cursor."""
    line_start = max(text.rfind("\n", 0, offset), text.rfind("\r", 0, offset)) + 1
    line = text[line_start:offset]
    code = _TEXT.sub(lambda match: "x" * len(match[0]), line)
    quote = _IN_TEXT.search(code)
    if "#" in (code[: quote.start()] if quote else code):
        return Context(silent=True)
    if quote:
        word = _WORD.search(line)
        hole = line.rfind("{") > line.rfind("}")
        return Context(word=word[0] if word else "", word_start=offset - len(word[0]) if word else offset,
                       in_text=hole, silent=not hole)  # fmt: skip
    unit = _UNIT_PART.search(code)
    word = None if unit else _WORD.search(code)
    written = (unit["unit"] or "") if unit else word[0] if word else ""
    context = Context(word=written, word_start=offset - len(written), number=unit is not None)
    _read(text[: offset - len(written)], context)
    return context


def _read(text: str, context: Context) -> None:
    source = SourceText(text)
    blocks: list[list[Token]] = []
    statement: list[Token] = []
    tokens = Lexer(source.text, Reporter(source)).run() or []
    while tokens and tokens[-1].start == tokens[-1].end:
        tokens.pop()  # the end token, and the brackets that the lexer inserted
    for token in tokens:
        if token.type == "LBRACE":
            blocks.append(statement)
            statement = []
        elif token.type == "RBRACE":
            statement = blocks.pop() if blocks else []
        elif token.type == "NL":
            statement = []
        else:
            statement.append(token)
    context.blocks = blocks
    context.statement = _begun(statement, text)
    first = context.statement[0] if context.statement else None
    if first is not None and len(context.statement) == 1 and first.type == "NAME" and first.text in STATEMENTS:
        context.statement[0] = Token(STATEMENTS[first.text], first.text, first.start, first.end)


def _begun(statement: list[Token], text: str) -> list[Token]:
    """The statement around the cursor. A line end or a comma before the cursor may have ended the last one."""
    if not statement or _depth(statement) > 0:
        return statement
    last = statement[-1]
    behind = text[last.end :]
    if "," in behind and last.type != "SEP":
        return [*statement, Token("SEP", ",", last.end, last.end)] if statement[0].type in _LISTS else []
    ended = "\n" in behind or "\r" in behind
    return [] if ended and last.type not in OPERATORS_THAT_CONTINUE else statement


def _depth(statement: list[Token]) -> int:
    return sum((t.type in ("LPAR", "LSQB", "LSET")) - (t.type in ("RPAR", "RSQB", "RSET")) for t in statement)


_LISTS = frozenset([kind.token for kind in KINDS.values() if kind.holds_list])
"""Statements in which a comma continues a list."""
