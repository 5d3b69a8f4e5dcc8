"""The parser: drives lark's LALR(1) tables over the tokens, and recovers at statement boundaries.

On an unexpected token it first tries to read a misspelt keyword as the intended one. Otherwise it reports the expected
tokens, drops the unfinished statement from the stack, skips to the end of that statement and puts an ERROR in its
place. A block that the statement opens is still parsed, so that errors in it are reported. Braces balance in the token
stream, so an error in a statement never moves the end of the block around it.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

from lingjing.dsl.source.reporter import Reporter
from lingjing.dsl.syntax import tree as s
from lingjing.dsl.syntax.builder import Builder
from lingjing.dsl.syntax.foreign import CLAUSES, CONTROL
from lingjing.dsl.syntax.foreign import STATEMENTS as FOREIGN_STATEMENTS
from lingjing.dsl.syntax.lexer import lex
from lingjing.dsl.syntax.statements import KINDS
from lingjing.dsl.syntax.tables import Tables, load_tables
from lingjing.dsl.syntax.tokens import INNER, NAMES_IN_MESSAGES, STATEMENTS, Token
from lingjing.suggest import nearest


def parse(report: Reporter, start: int = 0) -> s.File:
    """Parse the reporter's source from `start` on. Faulty statements are reported and become `Faulty` nodes."""
    tokens = lex(report.source.text, report, start)
    return s.File(0, 0, (s.Faulty(0, 0, (), None),)) if tokens is None else parse_tokens(tokens, report)


def parse_tokens(tokens: list[Token], report: Reporter) -> s.File:
    """Parse a list of tokens. The list is changed only if there are errors."""
    return Parser(report).run(tokens)


@cache
def _tables() -> Tables:
    return load_tables()


class Parser:
    """One run over one token list."""

    def __init__(self, report: Reporter) -> None:
        self.report = report
        self.tables = _tables()
        actions = Builder(report).actions()
        self.rules: list[tuple[int, str, Callable[..., Any], tuple[int, ...]]] = [
            (rule.size, rule.origin, actions[rule.action], rule.missing) for rule in self.tables.rules
        ]
        self.states = [self.tables.start]
        self.values: list[Any] = []

    def run(self, tokens: list[Token]) -> s.File:
        """Parse the tokens. The result is always a tree."""
        at, last_fault = 0, -1
        while (fault := self._drive(tokens, at)) >= 0:
            if fault == last_fault == len(tokens) - 1:
                raise AssertionError("the lexer let braces pass that do not balance")
            at = self._recover(tokens, fault, silent=fault == last_fault)
            last_fault = max(fault, at)
        return self.values[-1]  # type: ignore[no-any-return]

    def _drive(self, tokens: list[Token], at: int) -> int:
        """Consume tokens from `at` on. Return -1 at the end, else the index of the token that does not fit."""
        table, rules = self.tables.states, self.rules
        states, values = self.states, self.values
        final = self.tables.end
        row = table[states[-1]]
        for position in range(at, len(tokens)):
            token = tokens[position]
            kind = token.type
            while True:
                action = row.get(kind)
                if action is None:
                    return position
                if action >= 0:
                    states.append(action)
                    values.append(token)
                    row = table[action]
                    break
                size, origin, build, missing = rules[~action]
                if size:
                    arguments = values[-size:]
                    del values[-size:]
                    del states[-size:]
                    for gap in missing:
                        arguments.insert(gap, None)
                    values.append(build(*arguments))
                else:
                    values.append(build())
                state = table[states[-1]][origin]
                states.append(state)
                row = table[state]
                if state == final and kind == "$END":
                    return -1
        return -1

    # -- recovery

    def _recover(self, tokens: list[Token], fault: int, *, silent: bool) -> int:
        begin = self._begin(tokens, fault)
        if not silent:
            mended = self._mend(tokens, begin, fault)
            if mended >= 0:
                return mended
            self._explain(tokens, begin, fault)
        self._drop_statement()
        stop = _statement_stop(tokens, fault)
        if tokens[begin].text in CONTROL and tokens[stop].type == "LBRACE":
            stop = _block_end(tokens, stop)
        if stop == fault and silent:
            stop = min(fault + 1, len(tokens) - 1)
        words = " ".join(t.text.strip('"') for t in tokens[begin:stop] if t.type in ("NAME", "STRING"))
        first, last = tokens[begin], tokens[max(begin, stop - 1)]
        error = Token("ERROR", words, first.start, max(first.start, last.end))
        state = self.tables.states[self.states[-1]]["ERROR"]
        self.states.append(state)
        self.values.append(error)
        return stop

    def _begin(self, tokens: list[Token], fault: int) -> int:
        """The index at which the unfinished statement begins: after a comma too, if an item of a block ended there."""
        begin = _statement_begin(tokens, fault)
        before = self.values[len(self._states_before()) - 2] if len(self.states) > 1 else None
        if type(before) is Token and before.type == "SEP" and before.start >= tokens[begin].start:
            return next(at for at in range(fault, begin, -1) if tokens[at - 1] is before)
        return begin

    def _drop_statement(self) -> None:
        """Pop the stack to the beginning of the unfinished statement, past any closed block of its own."""
        closed = 0
        while closed or "ERROR" not in self.tables.states[self.states[-1]]:
            self.states.pop()
            kind = getattr(self.values.pop(), "type", "")
            closed += (kind == "RBRACE") - (kind == "LBRACE")

    def _mend(self, tokens: list[Token], begin: int, fault: int) -> int:
        """Read a misspelt keyword as the intended one and report it. Return the index to continue from, or -1.

        This keeps the statement, and so the names that it declares, for the later phases.
        """
        if self.report.full:
            return -1
        first, token = tokens[begin], tokens[fault]
        if first.type == "GOAL" and token.type == "WHEN":
            message, hint = "`goal` is a text", "the condition of success is `success when …`"
            self.report.at("LJ0010", first, message, hint, replace="success")
            tokens[begin] = Token(STATEMENTS["success"], "success", first.start, first.end)
            self._drop_statement()
            return begin
        if first.text in CONTROL or self._idiom(tokens, begin, fault) is not None:
            return -1
        if _sets_field(tokens, begin):
            return self._mend_assignment(tokens, begin)
        if first.type == "NAME" and fault - begin <= 1 and token.type in (*_AFTER_KEYWORD, *_AFTER_NAME):
            mended = self._mend_keyword(tokens, begin, fault)
            if mended >= 0:
                return mended
        if [t.type for t in tokens[begin : begin + 3]] == ["NAME", "STRING", "LBRACE"] and fault == begin + 1:
            self.report("LJ0010", first.start, first.start, "`mission` is due here", replace="mission ")
            tokens.insert(begin, Token("MISSION", "mission", first.start, first.start))
            self._drop_statement()
            return begin
        if first.type == "NAME" and fault == begin + 1 and _is_value(tokens, fault):
            message = f"`=` is due after `{first.text}`"
            text = self.report.source.text[token.start : token.end]
            hint = f"write `{first.text} = …`"
            self.report.at("LJ0010", token, message, hint, replace=f"= {text}")
            tokens.insert(fault, Token("EQUAL", "=", token.start, token.start))
            return fault
        due = self._due()
        if token.type == "NAME":
            words = self._words_due(due)
            close = nearest(token.text, words) if token.text not in CLAUSES else None
            if close is not None and close != token.text.lower():
                where = f" in `{first.text}`" if first.text in STATEMENTS else ""
                self.report.unknown("LJ0010", token, f"`{token.text}` does not fit here{where}", words, sure=True)
                kind = INNER.get(close) or STATEMENTS[close]
                tokens[fault] = Token(kind, close, token.start, token.end)
                return fault
        return self._apply(tokens, begin, fault, due)

    def _mend_assignment(self, tokens: list[Token], begin: int) -> int:
        """Read `fire.heat = 0.8` in an event as `change fire.heat to 0.8`. Elsewhere it is explained alone."""
        at = begin + (tokens[begin + 1].type != "DOT")
        owner, _, name, sign = tokens[at : at + 4]
        message = f"`{owner.text}.{name.text} = …` is no statement"
        if _keyword_around(tokens, begin) != "event":
            hint = f"a property stands in the block of its entity: `{owner.text} … {{ {name.text} = … }}`"
            self.report("LJ0010", tokens[begin].start, sign.end, message, hint)
            self._drop_statement()
            stop = _statement_stop(tokens, at + 3)
            self.states.append(self.tables.states[self.states[-1]]["ERROR"])
            self.values.append(Token("ERROR", "", tokens[begin].start, tokens[stop - 1].end))
            return stop
        written = f"change {owner.text}.{name.text} to"
        hint = f"write `{written} …`"
        self.report("LJ0010", tokens[begin].start, sign.end, message, hint, replace=written, safe=True)
        keyword = Token(STATEMENTS["change"], "change", tokens[begin].start, tokens[begin].start)
        tokens[begin : at + 4] = [keyword, *tokens[at : at + 3], Token(INNER["to"], "to", sign.start, sign.end)]
        self._drop_statement()
        return begin

    def _mend_keyword(self, tokens: list[Token], begin: int, fault: int) -> int:
        """Read the first word of a statement as the keyword that it resembles or stands for."""
        first = tokens[begin]
        synonym = FOREIGN_STATEMENTS.get(first.text.lower())
        close = synonym or nearest(first.text, STATEMENTS)
        message = f"no statement is called `{first.text}`"
        if first.text in _KINDS_OF:
            keyword = _KINDS_OF[first.text]
            hint = f"write `{keyword} {first.text} …`"
            self.report("LJ0011", first.start, first.end, message, hint, replace=f"{keyword} {first.text}")
            tokens.insert(begin, Token(STATEMENTS[keyword], keyword, first.start, first.start))
            self._drop_statement()
            return begin
        if close is None or tokens[fault].type not in _AFTER_KEYWORD:
            return -1
        if synonym is not None:
            self.report.at("LJ0011", first, message, f"write `{close}`", replace=close, safe=True)
        else:
            self.report.unknown("LJ0011", first, message, STATEMENTS, sure=True)
        tokens[begin] = Token(STATEMENTS[close], close, first.start, first.end)
        self._drop_statement()
        return begin

    def _apply(self, tokens: list[Token], begin: int, fault: int, due: list[str]) -> int:
        """Apply the first repair with which the whole statement can be read; -1 if there is none."""
        from lingjing.dsl.syntax.repairs import repairs

        states = self._states_before()
        for repair in repairs(tokens, begin, fault, due):
            statement, stop = repair.statement(tokens, begin)
            if not self._reads(list(states), statement, tokens[stop]):
                continue
            token = tokens[fault]
            at = _end_of(tokens, fault) if token.type in ("NL", "$END", "RBRACE") else token.start
            message = repair.message or self._found(tokens, begin, fault, due)
            end = max(at, token.end if token.type not in ("NL", "$END", "RBRACE") else at)
            self.report("LJ0010", at, end, message, repair.hint, edits=repair.edits, safe=repair.safe)
            tokens[begin:stop] = statement
            self._drop_statement()
            return begin
        return -1

    def _states_before(self) -> list[int]:
        """The stack of states at the beginning of the unfinished statement."""
        states, values, closed = list(self.states), list(self.values), 0
        while closed or "ERROR" not in self.tables.states[states[-1]]:
            states.pop()
            kind = getattr(values.pop(), "type", "")
            closed += (kind == "RBRACE") - (kind == "LBRACE")
        return states

    def _reads(self, states: list[int], statement: list[Token], following: Token) -> bool:
        return all(self._step(states, token.type) for token in statement) and self._step(states, following.type)

    def _idiom(self, tokens: list[Token], begin: int, fault: int) -> tuple[str, str] | None:
        """The message and hint for a phrase of another language around a fault; None if there is none."""
        from lingjing.dsl.syntax.idioms import idiom_in  # a text without errors needs no phrases

        text = self.report.source.text
        start = tokens[begin].start
        line_end = text.find("\n", max(start, tokens[max(begin, fault - 1)].start))
        return idiom_in(text[start : line_end if line_end >= 0 else len(text)])

    def _explain(self, tokens: list[Token], begin: int, fault: int) -> None:
        token, first = tokens[fault], tokens[begin]
        idiom = self._idiom(tokens, begin, fault)
        if idiom is not None:
            self.report("LJ0010", first.start, max(token.end, first.end), *idiom)
            return
        opens = first.text in CONTROL or (first.type == "NAME" and fault - begin <= 1)
        if opens and (first.text in CONTROL or token.type not in _RELATIONS) and self._explain_word(first, token):
            return
        due = self._due()
        start, end = token.start, max(token.end, token.start)
        if token.type in ("NL", "$END", "RBRACE") and fault > 0:
            start = end = tokens[fault - 1].end
        self.report("LJ0010", start, end, self._found(tokens, begin, fault, due), _hint(tokens, begin, fault, due))

    def _found(self, tokens: list[Token], begin: int, fault: int, due: list[str]) -> str:
        first = tokens[begin]
        keyword = f" in `{first.text}`" if first.text in STATEMENTS and begin < fault else ""
        return f"{_listing(due)} is due here{keyword}, found {_shown(tokens[fault])}"

    def _explain_word(self, first: Token, token: Token) -> bool:
        if first.text not in CONTROL and (token.type not in _AFTER_KEYWORD or token.type == "LBRACE"):
            return False
        hint = CONTROL.get(first.text, "a statement begins with a keyword, or is `name = value`")
        self.report.at("LJ0011", first, f"no statement is called `{first.text}`", hint)
        return True

    def _due(self) -> list[str]:
        """Token types that are possible next, found by running the reductions on a copy of the stack."""
        row = self.tables.states[self.states[-1]]
        return sorted(kind for kind in row if kind.isupper() and kind != "ERROR" and self._accepts(kind))

    def _accepts(self, kind: str) -> bool:
        return self._step(list(self.states), kind)

    def _step(self, states: list[int], kind: str) -> bool:
        """Shift one token on a stack of states after the necessary reductions. False if it does not fit."""
        while True:
            action = self.tables.states[states[-1]].get(kind)
            if action is None:
                return False
            if action >= 0:
                states.append(action)
                return True
            size, origin, _, _ = self.rules[~action]
            if size:
                del states[-size:]
            states.append(self.tables.states[states[-1]][origin])
            if kind == "$END" and states[-1] == self.tables.end:
                return True

    def _words_due(self, due: list[str]) -> list[str]:
        return [word for word, kind in {**STATEMENTS, **INNER}.items() if kind in due]


def _is_value(tokens: list[Token], at: int) -> bool:
    """True if a value begins at `at`, so that a missing `=` explains the error."""
    kind = tokens[at].type
    following = tokens[min(at + 1, len(tokens) - 1)].type
    ends = following in ("NL", "SEP", "RBRACE", "WHEN", "$END")
    return kind in ("QUANTITY", "LSQB") or (kind in ("NAME", "NUMBER", "STRING", "TRUE", "FALSE") and ends)


def _statement_begin(tokens: list[Token], fault: int) -> int:
    depth, at = 0, fault
    while at > 0:
        kind = tokens[at - 1].type
        if kind == "RBRACE":
            depth += 1
        elif kind == "LBRACE":
            if depth == 0:
                break
            depth -= 1
        elif kind == "NL" and depth == 0:
            break
        at -= 1
    return at


def _block_end(tokens: list[Token], start: int) -> int:
    """The index after the `}` that closes the block at `start`."""
    depth = 0
    for at in range(start, len(tokens) - 1):
        depth += (tokens[at].type == "LBRACE") - (tokens[at].type == "RBRACE")
        if depth == 0:
            return at + 1
    return len(tokens) - 1


def _end_of(tokens: list[Token], fault: int) -> int:
    return tokens[fault - 1].end if fault else tokens[fault].start


def _statement_stop(tokens: list[Token], fault: int) -> int:
    """The index at which parsing continues: the end of the statement, or the block that it opens."""
    for at in range(fault, len(tokens)):
        if tokens[at].type in ("NL", "RBRACE", "LBRACE", "$END"):
            return at
    return len(tokens) - 1


def _shown(token: Token) -> str:
    if token.type in ("NL", "$END"):
        return NAMES_IN_MESSAGES[token.type]
    text = f"{token.text} {token.unit}" if token.unit else token.text
    return f"`{text}`" if len(text) <= 30 else NAMES_IN_MESSAGES.get(token.type, "this")


def _sets_field(tokens: list[Token], begin: int) -> bool:
    """True if a statement is `a.b = …`, perhaps after one word such as `set`."""
    kinds = [token.type for token in tokens[begin : begin + 5]]
    return kinds[:4] == ["NAME", "DOT", "NAME", "EQUAL"] or kinds == ["NAME", "NAME", "DOT", "NAME", "EQUAL"]


def _keyword_around(tokens: list[Token], begin: int) -> str:
    """The keyword of the block around a statement; "" at the top of the file."""
    depth = 0
    for at in range(begin - 1, -1, -1):
        depth += (tokens[at].type == "RBRACE") - (tokens[at].type == "LBRACE")
        if depth < 0:
            return tokens[_statement_begin(tokens, at)].text
    return ""


_AFTER_KEYWORD = frozenset(("NAME", "STRING", "NUMBER", "QUANTITY", "LBRACE", "WHEN"))
_AFTER_NAME = frozenset(("ARROW", "BOTH"))
_RELATIONS = frozenset(("EQUAL", "TILDE", "LE", "OP"))
_KINDS_OF = {
    word: kind.keyword
    for kind in KINDS.values()
    if kind.keyword in ("relation", "constraint")
    for word in kind.place("kind").choices
}
"""Kind of a relation or constraint → the keyword before it."""
_VALUE_STARTS = frozenset(
    (
        "NAME",
        "NUMBER",
        "QUANTITY",
        "STRING",
        "LPAR",
        "LSQB",
        "MINUS",
        "NOT",
        "EXISTS",
        "FORALL",
        "TRUE",
        "FALSE",
        "LSET",
    )
)
_EXPRESSION_GOES_ON = frozenset(
    ("OP", "MINUS", "LE", "IN", "AND", "OR", "RANGE", "BY", "FROM", "TO", "AT", "LSQB", "DOT", "DOTSTAR")
)


def _listing(due: list[str]) -> str:
    kinds = set(due)
    if {"NAME", "NUMBER", "LPAR"} <= kinds:
        kinds = (kinds - _VALUE_STARTS) | {"a value"}
    if {"OP", "AND", "RANGE"} <= kinds:
        kinds -= _EXPRESSION_GOES_ON | {"LPAR"}
    if len(kinds & set(STATEMENTS.values())) > 5:
        kinds = (kinds - set(STATEMENTS.values()) - {"NAME"}) | {"a statement"}
    if len(kinds) > 1:
        kinds -= {"SEP"}
    words = sorted(NAMES_IN_MESSAGES.get(kind, kind) for kind in kinds)
    if len(words) <= 1:
        return words[0] if words else "something else"
    return f"{', '.join(words[:-1])} or {words[-1]}"


def _hint(tokens: list[Token], begin: int, fault: int, due: list[str]) -> str:
    token, kind = tokens[fault], KINDS.get(tokens[begin].text)
    place = kind.place(kind.forms[0].elements()[0].label) if kind is not None and kind.forms else None
    if place is not None and kind is not None and place.choices and tokens[begin + 1].text not in place.choices:
        listed = " or ".join(f"`{word}`" for word in place.choices)
        return f"`{kind.keyword}` is followed by its kind: {listed}"
    if due == ["COLON"] and fault and token.type in ("RPAR", "COMMA"):
        name = tokens[fault - 1].text
        return f"a parameter has its group or message kind: `{name}: …`"
    if fault and token.type == "NAME" and tokens[fault - 1].type == "NUMBER":
        return "a unit follows its number on the same line"
    if "NL" in due and token.type not in ("NL", "RBRACE", "$END"):
        return "a statement ends with its line or with a comma"
    return ""
