"""What surrounds a cursor in a text that is being written: the blocks around it and the statement begun.

Read from the tokens before the cursor alone, so it does not matter what is broken behind it.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field

from lingjing.dsl.source.reporter import Reporter
from lingjing.dsl.source.text import SourceText
from lingjing.dsl.syntax.lexer import Lexer
from lingjing.dsl.syntax.tokens import OPERATORS_THAT_CONTINUE, STATEMENTS, Token

_WORD = re.compile(r"[^\W\d]\w*$")
_UNIT_PART = re.compile(
    r"(?<!\w)(?<!\d\.)\d+(?:\.\d+)?(?:[eE][+-]?\d+)?(?P<space>[ \t]*)(?P<unit>(?:[^\W\d_]|[%°])[\w/*^]*)?$"
)
_IN_TEXT = re.compile(r'"(?:[^"\\]|\\.)*$')
_TEXT = re.compile(r'"(?:[^"\\]|\\.)*"')


@dataclass(slots=True)
class Context:
    """`blocks`: the heads of the open blocks, outermost first. `statement`: the tokens of the statement begun, without
    the `word` being written (from `word_start`). `number`: a number stands right before the word, which may be its
    unit. `silent`: the cursor is in a comment. `in_text`: it is in a quoted text, whose word may be a hole's."""

    blocks: list[list[Token]] = field(default_factory=list)
    statement: list[Token] = field(default_factory=list)
    word: str = ""
    word_start: int = 0
    number: bool = False
    silent: bool = False
    in_text: bool = False

    def kind(self) -> str:
        """The innermost block's first token type: MISSION, ASSET, CLOCK, …; empty at the top of the file."""
        return self.blocks[-1][0].type if self.blocks and self.blocks[-1] else ""

    def inside(self, kind: str) -> bool:
        """Whether any block around is of that kind."""
        return any(head and head[0].type == kind for head in self.blocks)

    def type_name(self) -> str:
        """The type of the entity whose block is around; "" where there is none, or none is named."""
        head = next((head for head in reversed(self.blocks) if head and head[0].type in ("ASSET", "TARGET")), [])
        colon = next((at for at, token in enumerate(head) if token.type == "COLON"), len(head))
        return head[colon + 1].text if colon + 1 < len(head) else ""

    def before(self, place: int = 1) -> str:
        """The type of the token that many places before the cursor; empty if the statement begins later."""
        return self.statement[-place].type if len(self.statement) >= place else ""

    def head(self) -> str:
        """The type of the statement's first token."""
        return self.statement[0].type if self.statement else ""


def context_at(text: str, offset: int) -> Context:
    """The context of a cursor."""
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
        tokens.pop()  # the end, and what the lexer supplied to close open brackets
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
    """The statement the cursor is in: a line's end or a comma behind it may have ended the one before."""
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


_LISTS = frozenset(("OBSERVES", "MESSAGE", "AGENT", "AUTHORITY", "LIMIT", "INSPECTION", "SWEEP"))
"""Statements in which a comma goes on with a list."""
