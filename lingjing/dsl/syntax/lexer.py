"""The lexer: one master pattern, newline tokens only at statement boundaries, balanced brackets guaranteed.

The token stream keeps the grammar context-free and recovery simple:

- A newline inside `()`, `[]` or after an operator gives no token.
- A comma between the items of a block is `NL` if a statement follows it, else `SEP`.
- A unit belongs to its number (`QUANTITY`), and so does a sign before a literal.
- Braces of a set (`in { a, b }`) are `LSET` and `RSET`.
- Brackets always balance: missing ones are reported and inserted, surplus ones are reported and dropped.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from unicodedata import normalize

from lingjing.dsl.source.reporter import Change, Reporter
from lingjing.dsl.syntax.foreign import QUOTES
from lingjing.dsl.syntax.foreign_text import ForeignText
from lingjing.dsl.syntax.indentation import Indentation
from lingjing.dsl.syntax.statement_kinds import FILE
from lingjing.dsl.syntax.statements import KINDS
from lingjing.dsl.syntax.tokens import (
    AFTER_SUBJECT,
    INNER,
    OPERATORS_THAT_CONTINUE,
    OWN_STATEMENTS,
    OWN_WORDS,
    STATEMENTS,
    SYMBOLS,
    Token,
)
from lingjing.mission.diagnostics import Related
from lingjing.patterns import pattern
from lingjing.suggest import is_certain, nearest

DEEPEST = 64
"""Deepest nesting of brackets (chosen): missions need about six levels, and the limit bounds recursion in all later
phases."""

_NOT_A_UNIT = rf"(?!(?:{'|'.join((*INNER, *OWN_WORDS))})\b)"
_FACTOR = r"(?:[^\W\d_]+|[%°])(?:\^-?\d|\d)?"
_UNIT = rf"[ \t]*{_NOT_A_UNIT}(?P<UNIT>{_FACTOR}(?:[/*]{_FACTOR})*)(?!\w)"
_DIGITS = r"\d+(?!\d)"
"""A maximal run of digits. Possessive quantifiers are avoided: Python 3.11.2 (Debian 12) matches a possessive group
wrongly (it takes the dot of `1..3`)."""
_MARKS = "\u0300-\u036f\u1ab0-\u1aff\u1dc0-\u1dff\u20d0-\u20ff\u3099\u309a\ufe20-\ufe2f"
"""Combining marks. Letters written apart from their accents (NFD) are the same letters; names are stored in NFC."""
MASTER = pattern(
    rf"""
    (?P<WORD>[^\W\d][\w{_MARKS}]*)
  | (?P<NUMBER>{_DIGITS}(?:\.{_DIGITS}|(?!\.\d))(?:[eE][+-]?{_DIGITS}|(?![eE][+-]?\d))(?!\w*\d)(?:{_UNIT})?)
  | (?P<SPACE>[ \t]+|\#[^\r\n]*)
  | (?P<LINE>[\r\n](?:[ \t\r\n]*[\r\n])?)
  | (?P<COMMA>,)
  | (?P<FOREIGN>===|!==|=[<>]|<>|:=|\*\*|-->|\.\.\.|&&?|\|\|?|!(?!=)|//|/\*)
  | (?P<SYMBOL><->|->|<=|>=|==|!=|\.\.|\.\*|[-+*/<>=~:.(){{}}\[\]])
  | (?P<LONGSTRING>""\")
  | (?P<STRING>"[^"\\\r\n]*(?:\\[^\r\n][^"\\\r\n]*)*")
  | (?P<OPENSTRING>"[^\r\n{{}}]*)
  | (?P<BADNUMBER>\d\w*(?:\.\w+)*)
  | (?P<BAD>.)
    """,
    re.VERBOSE | re.DOTALL,
)

_NUMBERS = pattern(rf"-?{_DIGITS}(?:\.{_DIGITS})?(?:{_UNIT})?")
_UNITS = pattern(_UNIT)
_COMMENT_LINES = pattern(r"[ \t]*\#[^\r\n]*[\r\n](?:[ \t\r\n]*[\r\n])?")
"""A comment on its own line, and the blank lines after it. It matches one comment at a time: the pattern matcher keeps
half a kilobyte for each repetition of a group, so a file of line ends alone took gigabytes."""
_QUOTE = f'["{re.escape("".join(QUOTES))}]'
_STATEMENT_FOLLOWS = pattern(rf"[ \t]+(?:[^\W\d]|{_QUOTE}|\{{|-?\d|\.[^\W\d])|[ \t]*\{{")
_HEADER_FOLLOWS = pattern(rf"[ \t]+(?:[^\W\d]|{_QUOTE})|[ \t]*\{{")
_NAME_FOLLOWS = pattern(r"[ \t]*(?:=(?!=)|~|:|<=)")
_INNER_IS_NAME = pattern(r"[ \t]*(?:=(?!=)|~|:)")
_NEXT_ITEM = pattern(
    r"[ \t\r\n]*(?:\#[^\r\n]*[ \t\r\n]*){0,1000}(?:(?P<close>\})|(?P<word>[^\W\d]\w*)(?P<after>[ \t]*(?:=(?!=)|~)?))"
)
_SUBJECT_FOLLOWS = pattern(
    r"[ \t\r\n]*(?:\#[^\r\n]*[ \t\r\n]*){0,1000}(?:[^\W\d]\w*|\"[^\"\r\n]*\")[ \t]+(?:"
    + "|".join(AFTER_SUBJECT)
    + r")\b(?![ \t]*=)"
)
"""The beginning of a statement with a subject before its keyword."""
_CONTINUES = pattern(r"[ \t]*(?:(?:and|or)\b|->|<->)")
_STARTS = pattern(r"[ \t]*(?:(?P<word>[^\W\d]\w*)|\})")
_SEA_LEVEL = pattern(r"[ \t]+level\b")
_BLOCK_FOLLOWS = pattern(r"[ \t]*\{")
_BLOCK_KEYWORDS = tuple([word for word, kind in KINDS.items() if kind.is_section])
"""Keywords that may stand directly before `{`."""
_TEXT_KEYWORDS = frozenset([word for word, kind in KINDS.items() if kind.is_text])
"""Keywords directly before a text."""
_TEXT_TOKENS = frozenset([KINDS[word].token for word in _TEXT_KEYWORDS])
_DRAWN = pattern(r"[ \t]*~")
_BEFORE_STATEMENTS = frozenset(("NL", "LBRACE", "HIDDEN", "OVERRIDE", "SEP"))
_BIDI = "\u061c\u200e\u200f\u202a\u202b\u202c\u202d\u202e\u2066\u2067\u2068\u2069"
"""Signs that change the reading direction."""
_HEADER_TOKENS = 24
"""Most tokens of a statement in which its first token is searched at a sign (chosen)."""
OPERANDS = frozenset(("NAME", "NUMBER", "QUANTITY", "STRING", "RPAR", "RSQB", "RSET", "TRUE", "FALSE"))
_CLOSERS = {"(": ")", "[": "]", "{": "}", "set": "}"}


class Lexer(ForeignText):
    """One pass over one text: the tokens so far and the open brackets."""

    def __init__(self, text: str, report: Reporter, *, start: int = 0, guided: bool = False) -> None:
        super().__init__()
        self.original = self.text = text
        self.start = start
        self.report = report
        self.tokens: list[Token] = []
        self.words: dict[str, str] = {}
        self.foreign: dict[str, list[tuple[int, int]]] = {}
        self.open: list[tuple[str, int]] = []
        self.previous = "NL"
        self.guide = Indentation(text) if guided else None
        self.depths: dict[int, int] = {}
        self.unbalanced = False
        self.own_from = -1
        """Index of the keyword of the last statement with words of its own; -1 before the first."""
        self.headless: dict[int, tuple[int, str, str]] = {}
        """Place of a `{` that the text lacks → the beginning, message and hint of its report."""

    def run(self) -> list[Token] | None:
        """Return all tokens, ending in `$END`; None if the nesting is too deep, which ends the compilation."""
        self._refuse_bidi()
        if not self.text.isascii():
            self.text = self._in_plain_signs()
        handlers: dict[str, Callable[[re.Match[str]], int]] = {
            "WORD": self._word,
            "NUMBER": self._number,
            "LINE": self._line,
            "COMMA": self._comma,
            "FOREIGN": self._foreign_sign,
            "SYMBOL": self._symbol,
            "LONGSTRING": self._long_string,
            "STRING": self._string,
            "OPENSTRING": self._open_string,
            "BADNUMBER": self._bad_number,
            "BAD": self._bad,
        }
        at: int | None = self.start
        while at is not None:
            at = self._scan(handlers, at)
            if len(self.open) > DEEPEST:
                return None
        return self._finish()

    def _scan(self, handlers: dict[str, Callable[[re.Match[str]], int]], begin: int) -> int | None:
        """Read tokens from `begin`. Return None at the end, or the offset at which a handler continues."""
        for match in MASTER.finditer(self.text, begin):
            kind = match.lastgroup or ""
            if kind == "SPACE":
                continue
            skip = handlers[kind](match)
            if len(self.open) > DEEPEST:
                self.report("LJ0005", match.start(), match.end(), f"brackets are nested deeper than {DEEPEST}")
                return None
            if skip:
                return skip
        return None

    def _add(self, kind: str, start: int, end: int, *, text: str | None = None) -> None:
        if text is None:
            text = self.text[start:end] if kind != "STRING" else self.original[start:end]
            known = self.words.get(text)
            if known is None:
                known = self.words[text] = text
                if kind == "NAME" and not text.isascii():
                    known = self.words[text] = normalize("NFC", text)
            if kind == "NAME" and not known.isascii():
                self.foreign.setdefault(known, []).append((start, end))
            text = known
        self.tokens.append(Token(kind, text, start, end))
        self.previous = kind

    def _refuse_bidi(self) -> None:
        if self.text.isascii() or not any(sign in self.text for sign in _BIDI):
            return
        for match in re.compile(f"[{_BIDI}]").finditer(self.text, self.start):
            code = f"U+{ord(match[0]):04X}"
            line = self.text.rfind("\n", 0, match.start()) + 1
            outside = self.text.count('"', line, match.start()) % 2 == 0
            message = f"{code} reverses the reading direction unseen"
            self.report("LJ0001", match.start(), match.end(), message, "remove it", replace="", safe=outside)

    # -- words and numbers

    def _word(self, match: re.Match[str]) -> int:
        word, start, end = match[0], match.start(), match.end()
        previous = self.previous
        if word == "from" and previous in ("NL", "LBRACE") and (skip := self._python_import(start, end)):
            return skip
        if word in _TEXT_KEYWORDS and (skip := self._unopened_long(word, start, end)):
            return skip
        if previous in ("NAME", "STRING") and self._is_second() and self._after_subject(word, start, end):
            return 0
        if previous in _BEFORE_STATEMENTS and word in STATEMENTS and self._begins(end, previous):
            self._add_keyword(STATEMENTS[word], start, end)
            return (
                self._without_brackets(word, end)
                if word == "observes" and self.text[end:].lstrip(" ")[:1] == "{"
                else 0
            )
        elif (
            previous in ("NL", "LBRACE", "HIDDEN")
            and word in STATEMENTS
            and (skip := self._foreign_keyword(word, start, end))
        ):
            return skip
        elif previous in ("NL", "LBRACE") and (keyword := self._misspelt_block(word, end)):
            self._add(STATEMENTS[keyword], start, end, text=keyword)
        elif word in OWN_WORDS and self._in_own_statement() and self._means(word, end):
            self._add(OWN_WORDS[word], start, end)
        elif word in INNER and previous != "DOT" and self._means(word, end):
            self._add(INNER[word], start, end)
            return self._without_brackets(word, end) if word == "controls" else 0
        elif word == "sea" and (level := _SEA_LEVEL.match(self.text, end)):
            self._add("NAME", start, level.end())
            return level.end()
        else:
            self._add("NAME", start, end)
        return 0

    def _add_keyword(self, kind: str, start: int, end: int, *, text: str | None = None) -> None:
        self._add(kind, start, end, text=text)
        if kind in OWN_STATEMENTS:
            self.own_from = len(self.tokens) - 1

    def _is_second(self) -> bool:
        """True if the statement has one token so far."""
        return len(self.tokens) == 1 or self.tokens[-2].type in ("NL", "LBRACE", "RBRACE")

    def _after_subject(self, word: str, start: int, end: int) -> bool:
        """Read the keyword of a statement that begins with its subject: `oracle wins`. In such a block a misspelt word
        counts too."""
        if word not in AFTER_SUBJECT:
            close = nearest(word, AFTER_SUBJECT) if self._owner() in _BLOCKS_OF_SUBJECTS else None
            if close is None:
                return False
            hint = f"did you mean `{close}`?"
            self.report("LJ0010", start, end, f"`{word}` does not fit here", hint, replace=close, safe=True)
            word = close
        self._add_keyword(AFTER_SUBJECT[word], start, end, text=word)
        return True

    def _in_own_statement(self) -> bool:
        """True if the current statement is one with words of its own."""
        if self.own_from < 0:
            return False
        if any(token.type in ("NL", "LBRACE", "RBRACE") for token in self.tokens[self.own_from :]):
            self.own_from = -1
        return self.own_from >= 0

    def _foreign_keyword(self, word: str, start: int, end: int) -> int:
        """Read a keyword before a sign or a bracket that it cannot have. 0 if this is none."""
        skip = self._signed_keyword(word, start, end)
        if skip or self._owner() not in KINDS[word].within:
            return skip
        before = len(self.tokens)
        self._add(STATEMENTS[word], start, end)
        kind = KINDS[word]
        skip = (kind.is_section and self._as_block(word, end)) or (
            word == "observes" and self._without_brackets(word, end)
        )
        if not skip:
            del self.tokens[before:]
            self.previous = self.tokens[-1].type if self.tokens else "NL"
        return skip or 0

    def _begins(self, end: int, previous: str) -> bool:
        if previous == "SEP" or _NAME_FOLLOWS.match(self.text, end):
            return False
        return _STATEMENT_FOLLOWS.match(self.text, end) is not None

    def _misspelt_block(self, word: str, end: int) -> str | None:
        """The keyword that a misspelt word before `{` stands for, such as `comms`; None without a near one."""
        if not _BLOCK_FOLLOWS.match(self.text, end):
            return None
        close = nearest(word, _BLOCK_KEYWORDS)
        if close is not None:
            start = end - len(word)
            hint = f"did you mean `{close}`?"
            certain = is_certain(word, _BLOCK_KEYWORDS)
            self.report("LJ0011", start, end, f"no statement is called `{word}`", hint, replace=close, safe=certain)
        return close

    def _means(self, word: str, end: int) -> bool:
        if word == "at" and self.text.startswith("(", end):
            return False
        at_start = self.previous in ("NL", "LBRACE", "HIDDEN", "STATE")
        if word == "at" and not at_start and _DRAWN.match(self.text, end):
            return True
        return not (at_start and _NAME_FOLLOWS.match(self.text, end)) and not _INNER_IS_NAME.match(self.text, end)

    def _number(self, match: re.Match[str]) -> int:
        unit, start, end = match["UNIT"] or "", match.start(), match.end()
        text = self.text[start : match.start("UNIT")].rstrip() if unit else match[0]
        if unit in ("x", "X") and self._spaced_size(text, unit, start, end):
            return end
        if self.previous == "MINUS" and self._sign_is_free(start):
            text, start = "-" + text, self.tokens.pop().start
        self.previous = "QUANTITY" if unit else "NUMBER"
        self.tokens.append(Token(self.previous, text, start, end, unit))
        return 0

    def _sign_is_free(self, start: int) -> bool:
        sign = self.tokens[-1]
        return sign.end == start and (len(self.tokens) < 2 or self.tokens[-2].type not in OPERANDS)

    # -- structure

    def _line(self, match: re.Match[str]) -> int:
        """Handle a line end with the blank and comment lines after it. Return the offset to continue from, 0 if
        unchanged.
        """
        start, end = match.start(), match.end()
        while comment := _COMMENT_LINES.match(self.text, end):
            end = comment.end()
        self._line_ends(start, end)
        return 0 if end == match.end() else end

    def _line_ends(self, start: int, end: int) -> None:
        """Add a newline token at `start` if a statement ends there. The next line begins at `end`."""
        top = self.open[-1][0] if self.open else "{"
        if top != "{":
            if not self._bracket_was_forgotten(top, end):
                return
            self._close_down_to_block(start)
        if self.previous == "COLON" and self._header() in _HEADERS:
            self.unbalanced = True  # blocks by colon and indentation, without braces
            if self.guide is not None and self._block_was_forgotten(self.guide, end):
                return
        if self.previous in ("NL", "LBRACE") or self.previous in OPERATORS_THAT_CONTINUE:
            if self.previous not in ("NL", "LBRACE", "SEP", "COMMA") and self._statement_starts(end):
                self._add("NL", start, start)
            return
        if _CONTINUES.match(self.text, end):
            return
        if self.guide is not None and self._block_was_forgotten(self.guide, end):
            return
        self._add("NL", start, start)

    def _block_was_forgotten(self, guide: Indentation, line: int) -> bool:
        """Insert `{` if the next line is indented deeper than a header without one, and `}` where indentation
        decreases.
        """
        last = self.tokens[-1]
        first = self._statement()
        depth = guide.depth(line)
        if depth is None or self.text.startswith("}", line + depth):
            return False
        if first is last and first.text in _BLOCK_KEYWORDS:
            first = self.tokens[-1] = Token(STATEMENTS[first.text], first.text, first.start, first.end)
        if first.type in _HEADERS and last.type != "LBRACE" and depth > guide.depth_of_line(first.start):
            message, hint = f"`{{` is due after this `{first.text}`", "a block stands in braces: add `{`"
            at, begin = last.end, last.end
            if last.type == "COLON":
                begin = self.tokens.pop().start
            self.headless[at] = (begin, message, hint)
            self._open_block(at, at)
            return True
        self._close_deeper(guide, depth, orphans=True)
        return False

    def _open_block(self, start: int, end: int) -> None:
        if self.guide is not None:
            self._opened(self.guide, start)
        self.open.append(("{", start))
        self._add("LBRACE", start, end, text="{")

    def _opened(self, guide: Indentation, start: int) -> None:
        """Store the indentation of the statement that opens a block."""
        first = self._statement() if self.tokens and self.previous not in ("NL", "LBRACE") else None
        self.depths[start] = guide.depth_of_line(first.start if first else start)

    def _statement(self) -> Token:
        at = len(self.tokens) - 1
        while at > 0 and self.tokens[at - 1].type not in ("NL", "LBRACE", "RBRACE"):
            at -= 1
        return self.tokens[at]

    def _header(self) -> str:
        """Type of the first token of a short statement; empty for a long one, so that the search stays short."""
        for at in range(len(self.tokens) - 1, max(-1, len(self.tokens) - _HEADER_TOKENS), -1):
            if at == 0 or self.tokens[at - 1].type in ("NL", "LBRACE", "RBRACE"):
                return self.tokens[at].type
        return ""

    def _is_use(self) -> bool:
        return self.previous == "NAME" and self._header() == "USE"

    def _close_deeper(self, guide: Indentation, depth: int, *, orphans: bool) -> None:
        """Close the blocks with an opening line indented deeper than `depth`; with `orphans`, equally deep ones too."""
        while self.open and self.open[-1][0] == "{":
            opened = self.depths[self.open[-1][1]]
            if opened < depth or (opened == depth and not orphans):
                return
            self._supply_brace()

    def _supply_brace(self) -> None:
        _, start = self.open.pop()
        if self.previous in ("NL", "SEP"):
            self.tokens.pop()
        end = self.tokens[-1].end
        indent = "" if self.guide is None else " " * self.guide.depth_of_line(start)
        several = "\n" in self.text[start:end]
        if self._report_headless(start, ((end, end, f"\n{indent}}}" if several else " }"),)):
            self._add("RBRACE", end, end)
            return
        related = (Related(self.report.span(start, start + 1), "opened here"),)
        self.report("LJ0003", end, end, "`}` is missing here", "add `}`", related=related, replace="}")
        self._add("RBRACE", end, end)

    def _report_headless(self, start: int, closing: tuple[Change, ...] = ()) -> bool:
        """Report a block that began without its `{`, once it ends; `closing` is the edit that adds its `}`. False for
        other blocks.
        """
        known = self.headless.pop(start, None)
        if known is None:
            return False
        begin, message, hint = known
        self.report("LJ0010", begin, start, message, hint, edits=((begin, start, " {"), *closing))
        return True

    def _bracket_was_forgotten(self, bracket: str, at: int) -> bool:
        """True if a new line inside a bracket can only begin a statement: it has two operands in a row, or a
        keyword."""
        match = _STARTS.match(self.text, at)
        if match is None or (bracket == "set" and match["word"] is None):
            return False
        two_operands = self.previous in OPERANDS and match["word"] is not None and match["word"] not in INNER
        return two_operands or self._statement_starts(at)

    def _statement_starts(self, at: int) -> bool:
        match = _STARTS.match(self.text, at)
        if match is None:
            return False
        word = match["word"]
        if word is None:
            return True
        end = match.end()
        if word not in STATEMENTS or word == "when" or _NAME_FOLLOWS.match(self.text, end):
            return False
        return _HEADER_FOLLOWS.match(self.text, end) is not None

    def _close_down_to_block(self, at: int) -> None:
        while self.open and self.open[-1][0] != "{":
            bracket, start = self.open.pop()
            closer = _CLOSERS[bracket]
            shown = "{" if bracket == "set" else bracket
            self.report("LJ0003", start, start + 1, f"`{shown}` is never closed", f"add `{closer}`")
            self._add({")": "RPAR", "]": "RSQB", "}": "RSET"}[closer], at, at)

    def _comma(self, match: re.Match[str]) -> int:
        return self._put_comma(match.start(), match.end())

    def _put_comma(self, start: int, end: int) -> int:
        if self.open and self.open[-1][0] != "{":
            self._add("COMMA", start, end)
            return 0
        if self.previous in ("NUMBER", "QUANTITY") and (skip := self._number_after_comma(start)):
            return skip
        follow = _NEXT_ITEM.match(self.text, end)
        if follow and (follow["after"] or "").strip() == "=" and self._lists_settings():
            self._add("SEP", start, end)
            return 0
        if (follow and (follow["close"] or self._item_starts(follow))) or _SUBJECT_FOLLOWS.match(self.text, end):
            if self.previous not in ("NL", "LBRACE"):
                self._add("NL", start, end)
            return 0
        self._add("SEP", start, end)
        return 0

    def _lists_settings(self) -> bool:
        """True after `with mode = star` of an expectation, where a comma precedes a further setting."""
        kinds = [token.type for token in self.tokens[-_SETTING_TOKENS:]] if self._in_own_statement() else []
        begun = [kind for kind in kinds if kind in _TERM_STARTS]
        return begun[-1:] == ["WITH"] and kinds[-1] in OPERANDS

    def _number_after_comma(self, start: int) -> int:
        """Handle a comma in a block after a number and before another one, which is no item. 0 if it is another."""
        whole = self._decimal_comma(start)
        if whole is None:
            return self._unbracketed_point(start, _NUMBERS)
        match = MASTER.match(self.text, start + 1)
        if match is None or match["NUMBER"] is None:
            return 0
        begin, unit = whole[1], match["UNIT"] or ""
        digits = self.text[start + 1 : match.start("UNIT") if unit else match.end()].rstrip()
        number = f"{whole[0]}.{digits}"
        shown = self.text[begin : match.end()]
        hint = f"a decimal point: write `{number}{' ' + unit if unit else ''}`"
        self.report("LJ0006", start, start + 1, f"`{shown}` is no number", hint, replace=".")
        self.tokens.pop()
        self.previous = "QUANTITY" if unit else "NUMBER"
        self.tokens.append(Token(self.previous, number, begin, match.end(), unit))
        return match.end()

    def _item_starts(self, follow: re.Match[str]) -> bool:
        after = follow["after"].strip()
        if after:
            return True
        word = follow["word"]
        at = follow.end("word")
        return (
            word in STATEMENTS
            and not _NAME_FOLLOWS.match(self.text, at)
            and bool(_STATEMENT_FOLLOWS.match(self.text, at))
        )

    def _symbol(self, match: re.Match[str]) -> int:
        return self._put(match[0], match.start(), match.end())

    def _put(self, text: str, start: int, end: int) -> int:
        if text == ",":
            return self._put_comma(start, end)
        if text == "-" and self.previous in ("NL", "LBRACE") and self.text.startswith("--", start):
            return self._foreign_comment(start)
        if text == "[" and self._is_use() and (skip := self._as_block("use", start)):
            return skip
        if text in "([":
            self.open.append((text, start))
            self._add(SYMBOLS[text], start, end, text=text)
        elif text == "{":
            if self.previous != "IN":
                self._close_down_to_block(start)
            if self.guide is not None and self.previous == "LBRACE":
                self.report("LJ0003", start, end, "`{` is never closed", "remove it", replace="")
                return 0
            is_set = self.previous == "IN"
            if self.guide is not None:
                self._opened(self.guide, start)
            self.open.append(("set" if is_set else "{", start))
            self._add("LSET" if is_set else "LBRACE", start, end, text=text)
        elif text in ")]}" and start in self.dropped:
            return 0
        elif text in ")]}":
            return self._close("}" if start in self.bracketed else text, start, end)
        else:
            self._add(SYMBOLS[text], start, end, text=text)
        return 0

    def _close(self, closer: str, start: int, end: int) -> int:
        if closer == "}":
            if self.open and self.open[-1][0] == "set":
                self.open.pop()
                self._add("RSET", start, end)
                return 0
            self._close_down_to_block(start)
            if self.guide is not None and self._is_surplus(self.guide, start):
                if skip := self._missing_brace_on_line(start):
                    return skip
                self.report("LJ0004", start, end, "`}` is too much here", "remove it", replace="")
                return 0
        if not self.open or _CLOSERS[self.open[-1][0]] != closer:
            self.unbalanced |= closer == "}"
            if closer == "}" and not self.open and (skip := self._missing_brace_on_line(start)):
                return skip
            self.report("LJ0004", start, end, f"`{closer}` closes nothing", "remove it, or add what it should close")
            return 0
        if closer == "}" and self.guide is None and len(self.open) == 1 and self._mission_goes_on(end):
            self.unbalanced = True
            self.report("LJ0004", start, end, "`}` is too much here: it ends the mission", "remove it", replace="")
            return 0
        self._report_headless(self.open.pop()[1])
        if closer == "}" and self.previous in ("NL", "SEP"):
            self.tokens.pop()
        self._add(SYMBOLS[closer], start, end, text=closer)
        return 0

    def _mission_goes_on(self, end: int) -> bool:
        """True if a statement that stands in a mission alone follows the `}` of the outermost block."""
        match = _NEXT_ITEM.match(self.text, end)
        word = match["word"] if match is not None else None
        if match is None or word not in _OF_MISSIONS:
            return False
        return _HEADER_FOLLOWS.match(self.text, match.end("word")) is not None

    def _is_surplus(self, guide: Indentation, start: int) -> bool:
        """True if, by indentation, a `}` cannot close the innermost block. Deeper blocks are closed first."""
        begin = guide.line_start(start)
        if self.open and guide.line_start(self.open[-1][1]) == begin:
            return False
        depth = guide.depth_of_line(start)
        if begin + depth == start:
            self._close_deeper(guide, depth, orphans=False)
            return not self.open or self.depths[self.open[-1][1]] != depth
        if not self.open:
            return True
        opened = self.depths[self.open[-1][1]]
        after = _NEXT_LINE.match(self.text, start)
        following = guide.depth(after.end("lines")) if after else None
        if after is None or following is None:
            return False
        closes = self.text.startswith("}", after.end("lines") + following)
        return following > opened or (closes and following == opened)

    # -- texts and faults

    def _string(self, match: re.Match[str]) -> int:
        start, end = match.start(), match.end()
        if match[0] != '""':
            if self.previous in ("NL", "LBRACE", "SEP") and (skip := self._quoted_key(start, end)):
                return skip
            if self.previous != "USE" or not self._quoted_path(start, end):
                self._add("STRING", start, end)
            return 0
        line = _LONG_REST.match(self.text, end) if self.previous in _TEXT_TOKENS else None
        if line is None:
            self._add("STRING", start, end)
            return 0
        self.report(
            "LJ0002", start, end, "a text of several lines begins with three quotes", 'write `"""`', replace='"""'
        )
        self._add("STRING", start, line.end())
        return line.end()

    def _unclosed_long(self, start: int) -> int:
        """Handle three quotes without a closing triple.

        The text ends at a line of fewer quotes, or at the end of its indentation.
        """
        rest = _LONG_REST.match(self.text, start + 3)
        if rest is not None:
            place = rest.start("quotes")
            message = "a text of several lines ends with three quotes"
            self.report("LJ0002", place, rest.end(), message, 'write `"""`', replace='"""')
            self._add("STRING", start, rest.end())
            return rest.end()
        self.unbalanced = True
        return self._until_dedent(start, len(self.text))

    def _long_string(self, match: re.Match[str]) -> int:
        """Handle a text of several lines.

        In the second pass, a text that leaves its indentation counts as unclosed: its closing quotes open another text.
        """
        start = match.start()
        end = self._long_end(match.end())
        if end < 0:
            return self._unclosed_long(start)
        if self.guide is not None:
            return self._until_dedent(start, end)
        begin = self.text.rfind("\n", start, end) + 1  # not before `start`: many texts on one line would take long
        if begin and self.text[begin : end - 3].strip() in _TEXT_KEYWORDS:
            self.unbalanced = True
        self._add("STRING", start, end)
        return end

    def _long_end(self, at: int) -> int:
        """The offset after the closing quotes of a text of several lines that begins at `at`; -1 without any.

        Escaped quotes do not close it.
        """
        while (quotes := self.text.find('"""', at)) >= 0:
            slashes = quotes
            while self.text[slashes - 1] == "\\" and slashes > at:
                slashes -= 1
            if (quotes - slashes) % 2 == 0:
                return quotes + 3
            at = quotes + 1
        return -1

    def _until_dedent(self, start: int, close: int) -> int:
        """End a text at the last line that is indented deeper than its first line, if that is before `close`."""
        depth = Indentation(self.text).depth_of_line(start)
        end = start + 3
        for line in _LINES.finditer(self.text, end, close):
            end = line.end("line")
            if len(line["depth"]) <= depth and not self.text.startswith('"""', line.end()):
                break
        else:
            self._add("STRING", start, close)
            return close
        related = (Related(self.report.span(start, start + 3), "it begins here"),)
        self.report("LJ0002", end, end, "the text is never closed", 'add `"""` after its last line', related=related)
        self._add("STRING", start, end)
        return end

    def _unopened_long(self, word: str, start: int, end: int) -> int:
        """Handle `goal` or `prompt` alone on a line, if the end of a long text follows: its opening quotes are
        missing."""
        rest = _LONG_REST.match(self.text, end) if word in _TEXT_KEYWORDS else None
        if rest is None or self.previous not in ("NL", "LBRACE"):
            return 0
        self.report(
            "LJ0002", end, end, "a text of several lines begins with three quotes", 'add ` """`', replace=' """'
        )
        self._add(STATEMENTS[word], start, end)
        self._add("STRING", end, rest.end())
        return rest.end()

    def _open_string(self, match: re.Match[str]) -> int:
        start = match.start()
        if self._unopened_text(match.end()):
            return 0
        end = start + len(match[0].rstrip())
        quote = re.search(r"[\u201d\u201c]", match[0])
        edits = ((end, end, '"'),) if quote is None else ((start + quote.start(), start + quote.end(), '"'),)
        self.report("LJ0002", start, end, "the text is never closed", 'add `"` before the line ends', edits=edits)
        self._add("STRING", start, end, text=self.original[start:end] + '"')
        return 0

    def _bad_number(self, match: re.Match[str]) -> int:
        if self._size(match):
            return 0
        number, start, end = self._foreign_number(match), match.start(), match.end()
        if number:
            unit = _UNITS.match(self.text, end)
            if self.previous == "MINUS" and self._sign_is_free(start):
                number, start = "-" + number, self.tokens.pop().start
            self.previous = "QUANTITY" if unit else "NUMBER"
            end = unit.end() if unit else end
            self.tokens.append(Token(self.previous, number, start, end, unit["UNIT"] if unit else ""))
            return end
        self.report("LJ0006", start, end, f"`{match[0]}` is neither a number nor a name")
        self._add("NUMBER", start, end)
        return 0

    def _bad(self, match: re.Match[str]) -> int:
        character = match[0]
        if character == "?" and self._is_pddl(match.start()):
            return 0  # the statement does not parse, and its error explains all of it
        skip = self._foreign_character(character, match.start(), match.end())
        if skip is not None:
            return skip
        shown = f"`{character}`" if character.isprintable() else f"U+{ord(character):04X}"
        hint = 'texts stand in double quotes: `"…"`' if character in QUOTES else "remove it"
        self.report("LJ0001", match.start(), match.end(), f"{shown} has no meaning here", hint)
        return 0

    def _finish(self) -> list[Token]:
        end = len(self.text)
        if self.text is not self.original:
            self._report_signs(self.original)
        if self.foreign:
            from lingjing.dsl.syntax.lookalikes import look_alikes

            look_alikes(self.foreign, self.words, self.report)
        self._close_down_to_block(end)
        if self.previous in ("NL", "SEP") and self.tokens:
            self.tokens.pop()
            self.previous = ""
        while self.open:
            self.unbalanced = True
            if self.guide is not None:
                self._supply_brace()
                continue
            _, start = self.open.pop()
            self.report("LJ0003", start, start + 1, "`{` is never closed", "add `}`")
            self._add("RBRACE", end, end)
        self._add("$END", end, end)
        return self.tokens


_LONG_REST = pattern(r'[ \t]*\r?\n[^"]*?\n[ \t]*(?P<quotes>"{1,3})[ \t]*(?=[\r\n])')
_LINES = pattern(r"(?P<line>[^\r\n]*)(?:\r\n|\n|\r)(?:[ \t]*(?:\r\n|\n|\r))*(?P<depth>[ \t]*)(?=\S)")
_NEXT_LINE = pattern(r"[}\s]*?(?:\#[^\r\n]*)?(?P<lines>[\r\n]+)")
_OF_MISSIONS = frozenset(word for word, kind in KINDS.items() if "mission" in kind.within and FILE not in kind.within)
"""Keywords of statements that stand in a mission, and not at the top of a file."""
_BLOCKS_OF_SUBJECTS = frozenset(place for word, kind in KINDS.items() if kind.has_subject for place in kind.within)
"""Keywords of the blocks with statements that begin with their subject."""
_TERM_STARTS = frozenset((*OWN_WORDS.values(), "AT", "FOR"))
"""Token types of the words in an expectation."""
_SETTING_TOKENS = 60
"""Most tokens of the settings of an expectation (chosen)."""
_HEADERS = frozenset([kind.token for word, kind in KINDS.items() if kind.opens_block and word != "use"])
"""Statements with a block, in which a line that is indented deeper belongs to them even if `{` is missing."""


def lex(text: str, report: Reporter, start: int = 0) -> list[Token] | None:
    """Return the tokens of a text from `start` on (see `Lexer.run`). Errors are reported.

    If braces do not balance and the author indents blocks, a second pass uses the indentation. Missing and surplus
    braces are then reported in place, and the other blocks stay intact.
    """
    before = len(report.diagnostics)
    lexer = Lexer(text, report, start=start)
    tokens = lexer.run()
    if tokens is not None and lexer.unbalanced and Indentation(text).is_kept():
        del report.diagnostics[before:]
        tokens = Lexer(text, report, start=start, guided=True).run()
    return tokens
