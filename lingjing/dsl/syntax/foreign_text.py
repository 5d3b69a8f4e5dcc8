"""`ForeignText`: the part of the lexer that reads spellings of other languages as what they stand for.

Each is reported once, with a fix, and gives the tokens of the right spelling, so that nothing else of the statement is
reported. `foreign` has the tables.
"""

from __future__ import annotations

import re
from bisect import bisect_right

from lingjing.dsl.source.reporter import Change, Reporter
from lingjing.dsl.syntax.foreign import BLANKS, GUESSED, QUOTES, SIGNS, UNSEEN
from lingjing.dsl.syntax.statements import KINDS
from lingjing.dsl.syntax.tokens import INNER, STATEMENTS, SYMBOLS, Token
from lingjing.mission.diagnostics import Related
from lingjing.patterns import pattern

_UNSEEN = pattern(f"[{UNSEEN}]")
_PLAIN = {
    **{
        ord(sign): plain
        for sign, plain in SIGNS.items()
        if len(sign) == len(plain) == 1 and not sign.isascii() and plain != "*"
    },
    **{
        code: " "
        for first, last in re.findall(r"(.)(?:-(.))?", BLANKS + UNSEEN)
        for code in range(ord(first), ord(last or first) + 1)
    },
}
"""Characters of other keyboards that one plain character replaces."""
_PLAIN_SIGNS = "".join(map(chr, _PLAIN))
_ODD = pattern(f"[{re.escape(_PLAIN_SIGNS)}]")
_MOST_RELATED = 5
"""Most places that an error lists (chosen)."""
_COMMENT = pattern(r"(?P<mark>//+|--+|/\*+)[ \t]?(?P<rest>[^\r\n]*)")
_COMMENT_REST = pattern(r"[^\r\n]*")
_ENDS_LINE = pattern(r"[ \t]*(?:\}|#|[\r\n]|$)")
_SIGN = pattern(r"[ \t]*(?P<sign>:(?!=)|=(?![=<>]))[ \t]*")
_BRACKET = pattern(r"[ \t]*(?:[:=][ \t]*)?(?P<open>[\[{(])")
_KEY = pattern(r"[ \t]*(?P<sign>[:=])")
_PLAIN_NAME = pattern(r"[^\W\d]\w*")
_PATH = pattern(r"\"\.?[a-z_]\w*(?:\.\w+)*\"")
_PYTHON_IMPORT = pattern(r"[ \t]+(?P<path>\.?\w+(?:\.\w+)*)[ \t]+import[ \t]+(?P<names>\*|\w+(?:[ \t]*,[ \t]*\w+)*)")
_TIMES = pattern(r"(?P<rows>\d+)[xX](?P<columns>\d+)")
_GROUPED = pattern(r"\d{1,3}(?:_\d{3})+(?:\.\d+)?")
_TIMES_NUMBER = pattern(r"[ \t]*(?P<number>\d+)(?![\w.])")
_PDDL = pattern(r"\?\w+\s+-\s+\w+|\(\s*\w+\s+\?\w")
_YAML_TEXT = pattern(r"[ \t]*:[ \t]*[|>][-+]?[ \t]*\n(?P<indent>[ \t]+)(?P<lines>[^\n]*(?:\n(?P=indent)[^\n]*)*)")
_MORE = pattern(r"(?:[ \t]*,[ \t]*-?\d[\w.]*[ \t]*[^\W\d_]*){1,2}(?=[ \t]*(?:[\r\n}]|$))")
_LINE_END = pattern(r"[\r\n]")
_FARTHEST = 4000
"""Most characters in which the other end of a bracket or a text is searched (chosen)."""
_MOST_PLACES = 1000
"""Most signs of another keyboard that one fix replaces (chosen)."""
_MOST_TOKENS = 200
"""Most tokens of a line in which the place of a missing brace is searched (chosen)."""
_HOLDS_NO_PROPERTIES = ("mission", "agent", "adjudicate", "stage", "constraint", "event")
"""Blocks in which `word = value` is never the property of that name, if the word is a keyword there."""


def _plain(sign: str) -> str:
    return "" if _UNSEEN.match(sign) else str(_PLAIN[ord(sign)])


class ForeignText:
    """Base of `lingjing.dsl.syntax.lexer.Lexer`. It uses attributes of that class."""

    text: str
    report: Reporter
    tokens: list[Token]
    open: list[tuple[str, int]]
    previous: str

    def __init__(self) -> None:
        self.dropped: set[int] = set()
        """Offsets of closing brackets that a report has removed."""
        self.owners: dict[int, str] = {}
        """Offset of an open brace → the keyword of its block."""
        self.bracketed: set[int] = set()
        """Offsets of `[` that are read as `{`."""

    def _add(self, kind: str, start: int, end: int, *, text: str | None = None) -> None:
        raise NotImplementedError

    def _put(self, text: str, start: int, end: int) -> int:
        """Read a sign or comma as the token that it is. Returns the offset to continue from, 0 if unchanged."""
        raise NotImplementedError

    def _open_block(self, start: int, end: int) -> None:
        raise NotImplementedError

    def _statement(self) -> Token:
        raise NotImplementedError

    # -- signs, comments and blanks

    def _in_plain_signs(self) -> str:
        """The text with the plain blank or sign for each one of another keyboard, character by character."""
        return self.text.translate(_PLAIN)

    def _report_signs(self, original: str) -> None:
        """Report the blanks and signs of another keyboard outside of texts and comments: one error with all places."""
        if not any(sign in original for sign in _PLAIN_SIGNS):
            return
        texts = [(token.start, token.end) for token in self.tokens if token.type == "STRING"]
        places: list[int] = []
        for match in _ODD.finditer(original):
            at = match.start()
            text = bisect_right(texts, (at, len(original))) - 1
            line = original.rfind("\n", 0, at) + 1
            if (text < 0 or at >= texts[text][1]) and "#" not in original[line:at]:
                places.append(at)
            if len(places) >= _MOST_PLACES:
                break
        if not places:
            return
        first, *others = places
        sign, plain = original[first], _plain(original[first])
        hint = "remove it" if not plain else "write a plain space" if plain == " " else f"write `{plain}`"
        shown = f"`{sign}`" if plain.strip() else f"U+{ord(sign):04X}"
        message = f"{shown} is {'a sign' if plain.strip() else 'a blank'} of another keyboard"
        related = tuple(Related(self.report.span(at, at + 1), "and here") for at in others[:_MOST_RELATED])
        edits = tuple((at, at + 1, _plain(original[at])) for at in places)
        self.report("LJ0001", first, first + 1, message, hint, related=related, edits=edits, safe=True)

    def _foreign_sign(self, match: re.Match[str]) -> int:
        sign, start, end = match[0], match.start(), match.end()
        if sign in ("//", "/*"):
            return self._foreign_comment(start)
        if sign == "**":
            hint = "there is no power operator; write `x * x`"
            self.report("LJ0001", start, end, "`**` has no meaning here", hint)
            self._add("OP", start, end, text="*")
            return 0
        return self._read_as(self._meant(sign), sign, start, end)

    def _foreign_character(self, character: str, start: int, end: int) -> int | None:
        """Read one character of another keyboard; None if it is none."""
        if character in QUOTES:
            return self._foreign_quote(start)
        if character in (";", "；") and _ENDS_LINE.match(self.text, end):
            message, hint = f"`{character}` has no meaning here", "a statement ends with its line: no semicolon"
            self.report("LJ0001", start, end, message, hint, replace="", safe=True)
            return 0
        plain = SIGNS.get(character)
        return None if plain is None else self._read_as(self._meant(character), character, start, end)

    def _is_pddl(self, start: int) -> bool:
        """True for the `?` of a variable of PDDL in a line that no statement of this language resembles."""
        line_end = self.text.find("\n", start)
        line = self.text[self.text.rfind("\n", 0, start) + 1 : line_end if line_end >= 0 else len(self.text)]
        return _PDDL.search(line) is not None

    def _meant(self, sign: str) -> str:
        relation = self.tokens and self._statement().type == "RELATION"
        if sign == "=>" and relation:
            return "->"
        if sign == "×" and self.previous == "NUMBER":
            return "by"
        return SIGNS[sign]

    def _read_as(self, plain: str, sign: str, start: int, end: int) -> int:
        message = f"`{sign}` has no meaning here"
        if plain == "#":
            line = _COMMENT_REST.match(self.text, end)
            self.report("LJ0001", start, end, message, "`#` begins a comment", replace="#", safe=True)
            return line.end() if line is not None else end
        if sign == "?":
            hint = "there is no `a ? b : c`: write `a and b or not a and c`, or a line with `when`"
            self.report("LJ0001", start, end, message, hint)
            return 0
        if plain not in INNER and plain not in SYMBOLS and plain != ",":
            self.report("LJ0001", start, end, message, "remove it", replace="", safe=True)
            return 0
        written = plain
        if plain.isalpha():
            before = "" if self.text[start - 1 : start] in (" ", "\t", "\n", "(", "") else " "
            after = "" if self.text[end : end + 1] in (" ", "\t", "\n", "") else " "
            written = f"{before}{plain}{after}"
        safe = sign not in GUESSED
        self.report("LJ0001", start, end, message, f"write `{plain}`", replace=written, safe=safe)
        if plain in INNER:
            self._add(INNER[plain], start, end, text=plain)
            return 0
        return self._put(plain, start, end)

    def _foreign_comment(self, start: int) -> int:
        """Skip `// …` or `/* … */`; return the offset after it."""
        match = _COMMENT.match(self.text, start)
        assert match is not None
        mark, end = match["mark"], match.end()
        edits: list[Change] = [(start, start + len(mark), "#")]
        if mark.startswith("/*"):
            close = self.text.find("*/", start + 2)
            end = len(self.text) if close < 0 else close + 2
            one_line = close >= 0 and "\n" not in self.text[start:close]
            edits = [*edits, (len(self.text[:close].rstrip(" ")), end, "")] if one_line else []
        message = f"`{mark}` has no meaning here"
        self.report("LJ0001", start, start + len(mark), message, "`#` begins a comment", edits=edits, safe=True)
        return end

    # -- texts

    def _foreign_quote(self, start: int) -> int | None:
        """Read a text in other quotes. None if it does not end on its line."""
        quote = self.text[start]
        if quote == "'" and self.text.startswith("'''", start):
            return self._foreign_long_text(start)
        line_end = _LINE_END.search(self.text, start, start + _FARTHEST)
        stop = line_end.start() if line_end is not None else min(len(self.text), start + _FARTHEST)
        ends = [at for at in (self.text.find(c, start + 1, stop) for c in QUOTES[quote]) if at >= 0]
        if not ends:
            return None
        close = min(ends)
        content = self.text[start + 1 : close].replace('"', '\\"')
        hint = f'a text stands in double quotes: `"{content[:30]}{"…" if len(content) > 30 else ""}"`'
        message = f"`{quote}` begins no text"
        self.report("LJ0001", start, close + 1, message, hint, replace=f'"{content}"', safe=True)
        if self._is_key(close + 1):
            return close + 1
        self._add("STRING", start, close + 1, text=f'"{content}"')
        return close + 1

    def _foreign_long_text(self, start: int) -> int | None:
        close = self.text.find("'''", start + 3)
        if close < 0:
            return None
        hint = 'a text of several lines stands in `"""`'
        edits = ((start, start + 3, '"""'), (close, close + 3, '"""'))
        self.report("LJ0001", start, start + 3, "`'''` begins no text", hint, edits=edits, safe=True)
        self._add("STRING", start, close + 3, text=f'"""{self.text[start + 3 : close]}"""')
        return close + 3

    def _is_key(self, end: int) -> bool:
        return self.previous in ("NL", "LBRACE", "SEP") and _KEY.match(self.text, end) is not None

    def _quoted_key(self, start: int, end: int) -> int:
        """Read `"tick": 10 s`, a key of JSON, as `tick = 10 s`. 0 if this is none."""
        name = self.text[start + 1 : end - 1]
        sign = _KEY.match(self.text, end)
        if sign is None or not _PLAIN_NAME.fullmatch(name) or not self._is_key(end):
            return 0
        if self.previous == "SEP":
            self.tokens[-1] = Token("NL", ",", self.tokens[-1].start, self.tokens[-1].end)
        written = f"{name} ="
        message, hint = f"a property is `{name} = …`, without quotes", f"write `{name} = …`"
        self.report("LJ0010", start, sign.end(), message, hint, replace=written, safe=True)
        self._add("NAME", start, end, text=name)
        self._add("EQUAL", sign.start("sign"), sign.end(), text="=")
        return sign.end()

    def _quoted_path(self, start: int, end: int) -> bool:
        """Read `use "std.air"` as `use std.air`."""
        if self.previous != "USE" or not _PATH.fullmatch(self.text[start:end]):
            return False
        path = self.text[start + 1 : end - 1]
        hint = f"write `use {path}`, without quotes"
        self.report("LJ0010", start, end, "a library is no text", hint, replace=path, safe=True)
        at = start + 1
        for piece in re.split(r"(\.)", path):
            if piece:
                self._add("DOT" if piece == "." else "NAME", at, at + len(piece), text=piece)
                at += len(piece)
        return True

    def _unopened_text(self, end: int) -> bool:
        """Read the words before a quote that ends a line as a text without its opening quote."""
        first = self._statement() if self.tokens and self.previous not in ("NL", "LBRACE") else None
        if first is None or first.type not in ("GOAL", "PROMPT") or not _ENDS_LINE.match(self.text, end):
            return False
        at = next(number for number in range(len(self.tokens) - 1, -1, -1) if self.tokens[number] is first)
        if len(self.tokens) == at + 1 or self.tokens[at + 1].type == "STRING":
            return False
        start = self.tokens[at + 1].start
        message = "the text lacks its opening quote"
        self.report("LJ0002", start, start, message, 'add `"` before it', edits=((start, start, '"'),))
        del self.tokens[at + 1 :]
        self._add("STRING", start, end, text=f'"{self.text[start:end]}')
        return True

    # -- numbers

    def _foreign_number(self, match: re.Match[str]) -> str:
        """Report a number of another spelling. Returns the number's own spelling; empty if it is none."""
        start, end = match.start(), match.end()
        if _GROUPED.fullmatch(match[0]):
            number = match[0].replace("_", "")
            message = f"`{match[0]}` is neither a number nor a name"
            self.report("LJ0006", start, end, message, f"write `{number}`", replace=number, safe=True)
            return number
        return ""

    def _size(self, match: re.Match[str]) -> bool:
        """Read `3x4` as `3 by 4`."""
        sizes = _TIMES.fullmatch(match[0])
        if sizes is None:
            return False
        start, end, written = match.start(), match.end(), f"{sizes['rows']} by {sizes['columns']}"
        message = f"`{match[0]}` is neither a number nor a name"
        self.report("LJ0006", start, end, message, f"write `{written}`", replace=written, safe=True)
        self._add("NUMBER", start, start + sizes.end("rows"), text=sizes["rows"])
        self._add("BY", start + sizes.end("rows"), start + sizes.start("columns"), text="by")
        self._add("NUMBER", start + sizes.start("columns"), end, text=sizes["columns"])
        return True

    def _spaced_size(self, number: str, unit: str, start: int, end: int) -> bool:
        """Read `3 x 4`, of which `3 x` looks like a quantity, as `3 by 4`."""
        following = _TIMES_NUMBER.match(self.text, end) if unit in ("x", "X") else None
        if following is None:
            return False
        hint = f"write `{number} by {following['number']}`"
        self.report("LJ0010", end - 1, end, f"`{unit}` is no sign", hint, replace="by", safe=True)
        self._add("NUMBER", start, start + len(number), text=number)
        self._add("BY", end - 1, end, text="by")
        return True

    def _decimal_comma(self, start: int) -> tuple[str, int] | None:
        """The whole part and its offset if a comma stands between the digits of one number; else None."""
        last = self.tokens[-1] if self.tokens else None
        if last is None or last.type != "NUMBER" or last.end != start or not self.text[start + 1 : start + 2].isdigit():
            return None
        return last.text, last.start

    def _unbracketed_point(self, start: int, number: re.Pattern[str]) -> int:
        """Read `position = 1 m, 2 m` as a point. `start`: offset of the comma. 0 if this is none."""
        more = _MORE.match(self.text, start)
        kinds = [token.type for token in self.tokens[-3:]]
        if more is None or kinds[:2] != ["NAME", "EQUAL"] or kinds[2] not in ("QUANTITY", "NUMBER"):
            return 0
        first = self.tokens.pop()
        written = f"({self.text[first.start : more.end()].strip()})"
        message = "a point stands in brackets"
        edits = ((first.start, first.start, "("), (more.end(), more.end(), ")"))
        self.report("LJ0010", first.start, more.end(), message, f"write `{written}`", edits=edits)
        self._add("LPAR", first.start, first.start, text="(")
        self.tokens.append(first)
        for part in number.finditer(self.text, start, more.end()):
            self._add("COMMA", part.start(), part.start(), text=",")
            unit = part["UNIT"] or ""
            value = self.text[part.start() : part.start("UNIT") if unit else part.end()].rstrip()
            self.tokens.append(Token("QUANTITY" if unit else "NUMBER", value, part.start(), part.end(), unit))
        self._add("RPAR", more.end(), more.end(), text=")")
        return more.end()

    # -- keywords

    def _owner(self) -> str:
        """The keyword of the innermost block; empty at the top of a file."""
        if not self.open or self.open[-1][0] != "{":
            return ""
        start = self.open[-1][1]
        known = self.owners.get(start)
        if known is not None:
            return known
        at = next((k for k in range(len(self.tokens) - 1, -1, -1) if self.tokens[k].start == start), -1)
        while at > 0 and self.tokens[at - 1].type not in ("NL", "LBRACE", "RBRACE"):
            at -= 1
        owner = self.owners[start] = self.tokens[at].text if at >= 0 else ""
        return owner

    def _signed_keyword(self, word: str, start: int, end: int) -> int:
        """Read a keyword with `=` or `:` behind it as the statement without that sign. 0 if this is none."""
        block = _YAML_TEXT.match(self.text, end) if word in ("goal", "prompt") else None
        if block is not None:
            return self._yaml_text(word, start, end, block)
        kind, sign = KINDS[word], _SIGN.match(self.text, end)
        owner = self._owner() if sign is not None else ""
        if sign is None or owner not in kind.within:
            return 0
        if kind.node is None and (sign["sign"] == "=" or word == "state"):
            return 0
        own_words = owner in _HOLDS_NO_PROPERTIES and word not in KINDS[owner].keys
        if not own_words and not kind.is_section and kind.node is not None:
            return 0
        conditional = any(form.pattern.startswith("when ") for form in kind.forms)
        has_when = self.text.startswith("when", sign.end())
        written = " when " if conditional and not has_when else " "
        edits = ((end, sign.end(), written),)
        message = f"`{word}` takes no `{sign['sign']}`"
        at = sign.start("sign")
        self._add(STATEMENTS[word], start, end, text=word)
        listed = kind.is_section and self._as_block(word, end, message)
        loose = not listed and kind.holds_list and self._without_brackets(word, end)
        if listed or loose:
            return listed or loose
        hint = f"write `{word}{' when' if conditional else ''} …`"
        self.report("LJ0010", at, at + 1, message, hint, edits=edits, safe=True)
        if written == " when ":
            self._add("WHEN", at, at + 1, text="when")
        return sign.end()

    def _yaml_text(self, word: str, start: int, end: int, block: re.Match[str]) -> int:
        """Read `prompt: |` with the indented lines below it as a text of several lines."""
        text = f'"""{block["lines"]}"""'
        hint = f'a text of several lines stands in `"""`: `{word} """…"""`'
        edits = ((end, block.end(), f" {text}"),)
        self.report("LJ0010", end, end + 1, f"`{word}` takes no `:`", hint, edits=edits)
        self._add(STATEMENTS[word], start, end, text=word)
        self._add("STRING", block.start("lines"), block.end(), text=text)
        return block.end()

    def _as_block(self, word: str, end: int, message: str = "") -> int:
        """Read `actions [a, b]` as `actions { a, b }`. Returns the offset after the bracket, 0 if there is none."""
        bracket = _BRACKET.match(self.text, end)
        close = self._matching(bracket.start("open")) if bracket is not None and bracket["open"] == "[" else -1
        if bracket is None or close < 0:
            return 0
        at = bracket.start("open")
        before = "" if self.text[at + 1 : at + 2] == " " else " "
        after = "" if self.text[close - 1 : close] == " " else " "
        edits = ((end, at + 1, " {" + before), (close, close + 1, after + "}"))
        problem = message or f"`{word}` has no list"
        self.report(
            "LJ0010", at, at + 1, problem, f"a block stands in braces: `{word} {{ … }}`", edits=edits, safe=True
        )
        self.bracketed.add(close)
        self._open_block(at, at + 1)
        return at + 1

    def _without_brackets(self, word: str, end: int) -> int:
        """Read `observes [a, b]` as `observes a, b`. Returns the offset after the bracket, 0 if there is none."""
        bracket = _BRACKET.match(self.text, end)
        close = self._matching(bracket.start("open")) if bracket is not None and bracket["open"] in "[{" else -1
        if bracket is None or close < 0 or "\n" in self.text[end:close]:
            return 0
        at = bracket.end()
        while self.text[at : at + 1] in (" ", "\t"):
            at += 1
        behind = close
        while self.text[behind - 1] in " \t":
            behind -= 1
        message, hint = f"`{word}` has no brackets", f"write `{word} …, …`, without brackets"
        edits = ((end, at, " "), (behind, close + 1, ""))
        self.report("LJ0010", bracket.start("open"), bracket.end(), message, hint, edits=edits, safe=True)
        self.dropped.add(close)
        return at

    def _matching(self, start: int) -> int:
        """Offset of the bracket that closes the one at `start`; -1 if there is none."""
        opening = self.text[start]
        closing = {"[": "]", "{": "}", "(": ")"}[opening]
        depth = 0
        for match in re.compile(rf'"[^"\r\n]*"|[{re.escape(opening + closing)}]').finditer(
            self.text, start, start + _FARTHEST
        ):
            depth += (match[0] == opening) - (match[0] == closing)
            if depth == 0:
                return match.start()
        return -1

    def _python_import(self, start: int, end: int) -> int:
        """Read `from std.air import quadrotor` as `use std.air { quadrotor }`. 0 if this is none."""
        match = _PYTHON_IMPORT.match(self.text, end)
        if match is None:
            return 0
        names = re.findall(r"\w+", match["names"])
        written = f"use {match['path']}" + (f" {{ {', '.join(names)} }}" if names else "")
        message, hint = "no statement is called `from`", f"write `{written}`"
        self.report("LJ0011", start, match.end(), message, hint, replace=written, safe=True)
        self._add("USE", start, end, text="use")
        at = match.start("path")
        for piece in re.split(r"(\.)", match["path"]):
            if piece:
                self._add("DOT" if piece == "." else "NAME", at, at + len(piece), text=piece)
                at += len(piece)
        if names:
            self._add("LBRACE", at, at, text="{")
            for number, name in enumerate(names):
                if number:
                    self._add("NL", at, at, text="")
                self._add("NAME", match.start("names"), match.end("names"), text=name)
            self._add("RBRACE", match.end(), match.end(), text="}")
        return match.end()

    def _missing_brace_on_line(self, close: int) -> int:
        """Insert the `{` that a header on this line lacks, if a `}` at `close` ends the line's block.

        Returns the offset from which the block is read again, 0 if no brace is missing.
        """
        if not self.tokens or self.previous in ("NL", "LBRACE"):
            return 0
        at, least = len(self.tokens) - 1, max(0, len(self.tokens) - _MOST_TOKENS)
        while at > least and (
            self.tokens[at - 1].type not in ("NL", "LBRACE", "RBRACE") or self.tokens[at - 1].text == ","
        ):
            at -= 1
        begin = self.tokens[at]
        return self._brace_after(at) if begin.text in KINDS and "\n" not in self.text[begin.start : close] else 0

    def _brace_after(self, at: int) -> int:
        kind = KINDS[self.tokens[at].text]
        inside = {word for word, other in KINDS.items() if kind.keyword in other.within}
        if not kind.opens_block or kind.keyword == "use":
            return 0
        for number in range(at + 1, len(self.tokens)):
            token = self.tokens[number]
            following = self.tokens[number + 1].type if number + 1 < len(self.tokens) else ""
            if token.text in inside or (token.type == "NAME" and following in ("EQUAL", "TILDE", "LE")):
                self.report(
                    "LJ0010", token.start, token.start, f"`{{` is due after this `{kind.keyword}`", "add `{`",
                    edits=((token.start, token.start, "{ "),))  # fmt: skip
                del self.tokens[number:]
                self._open_block(token.start, token.start)
                return token.start
        return 0
