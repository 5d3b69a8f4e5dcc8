"""The part of a statement's pattern that is due at the end of its unfinished tokens."""

from __future__ import annotations

from dataclasses import dataclass

from lingjing.dsl.syntax.statement_kinds import PatternElement
from lingjing.dsl.syntax.statements import KINDS
from lingjing.dsl.syntax.tokens import AFTER_SUBJECT, Token

_OPENING = frozenset(("LPAR", "LSQB", "LSET"))
_CLOSING = frozenset(("RPAR", "RSQB", "RSET"))
_SINGLE = frozenset(("NAME", "STRING", "NUMBER"))
"""Elements that are one token."""
_EXPRESSIONS = frozenset(("axes", "channel", "channels", "operand", "value", "values"))
"""Elements that an operator may continue."""
_MAY_LACK = frozenset(("index", "block", "guard", "clauses"))
"""Elements that are left out in most statements, or that completion does not enter."""
_BRACKETED = frozenset(("index", "params", "set"))
"""Elements in brackets of their own."""


@dataclass(frozen=True, slots=True)
class DueInPattern:
    """The continuations of an unfinished statement."""

    element: PatternElement | None = None
    """The name or value that begins here; None within a value, and where a word or a sign is due."""
    words: tuple[str, ...] = ()
    """The words of the pattern that may follow here."""
    within_value: bool = False
    """True if the value before may continue, such as with an operator."""


def due_in(statement: list[Token]) -> DueInPattern:
    """The continuations after the tokens of a statement. Of several forms, the best fit counts."""
    at = keyword_place(statement)
    kind = KINDS.get(statement[at].type.lower()) if statement else None
    if kind is None or not kind.forms:
        return DueInPattern()
    walks = [_Walk(form.elements()).over(statement[at + 1 :]) for form in kind.forms]
    return max(walks, key=lambda walk: (not walk.misfit, walk.position)).due()


def keyword_place(statement: list[Token]) -> int:
    """The index of a statement's keyword: 1 behind a subject, else 0."""
    return 1 if len(statement) > 1 and statement[1].type in AFTER_SUBJECT.values() else 0


class _Walk:
    """One pass of tokens over the elements of a form."""

    def __init__(self, elements: tuple[PatternElement, ...]) -> None:
        self.elements = elements
        self.position = 0
        self.filled = False
        """True if the element at `position` has a token."""
        self.clause = ""
        """The word of the clause or guard that is open."""
        self.depth = 0
        self.misfit = False
        """True if a required word or sign is missing."""

    def over(self, tokens: list[Token]) -> _Walk:
        """Take the tokens and return the walk."""
        for token in tokens:
            self._take(token)
        return self

    def due(self) -> DueInPattern:
        """The continuations after the tokens that were taken."""
        current = self._at(self.position)
        if self.depth:
            return DueInPattern(current if current is not None and current.symbol == "set" else None)
        if self.clause == "when":
            return DueInPattern(within_value=self.filled)
        if self.clause and not self.filled:
            return DueInPattern(PatternElement("NAME", self.clause))
        words: list[str] = list(current.words()) if self.clause and current is not None else []
        within_value = self.filled and current is not None and current.symbol in _EXPRESSIONS
        begun = self.elements[self.position - 1].group if self.position else 0
        place = self.position + self.filled
        while (element := self._at(place)) is not None:
            words.extend(element.words())
            required = element.group in (0, begun) and element.symbol not in _MAY_LACK
            if required:
                due = None if element.words() or self.filled or not element.label else element
                return DueInPattern(due, tuple(words), within_value)
            place = self._behind(place)
        return DueInPattern(None, tuple(words), within_value)

    def _take(self, token: Token) -> None:
        current = self._at(self.position)
        if token.type in _OPENING or self.depth:
            self._take_bracketed(token)
        elif current is not None and current.symbol in _SINGLE and current.symbol == token.type and not self.filled:
            self.position += 1
        elif (place := self._anchor(token)) is not None:
            element = self.elements[place]
            self.clause = token.text if not element.word and element.words() else ""
            self.position, self.filled = place + (not self.clause), False
        elif token.type == "SEP":
            self.filled = False
        else:
            self._begin_value()

    def _take_bracketed(self, token: Token) -> None:
        """Take a bracket, or a token inside brackets."""
        self.depth += (token.type in _OPENING) - (token.type in _CLOSING)
        behind = self._behind_brackets()
        if behind is None:
            self.filled = True
        elif not self.depth:
            self.position = behind

    def _behind_brackets(self) -> int | None:
        """The place behind the brackets of the pattern that are open; None if the brackets belong to a value."""
        current = self._at(self.position)
        if current is None or self.filled:
            return None
        if current.symbol == "LPAR":
            return next(place for place, element in enumerate(self.elements) if element.symbol == "RPAR") + 1
        return self.position + 1 if current.symbol in _BRACKETED else None

    def _begin_value(self) -> None:
        """Take a token of a value, behind optional words and signs before it."""
        while not self.filled and (element := self._at(self.position)) is not None and not self.clause:
            if not element.group and element.label:
                break
            self.misfit |= not element.group
            self.position = self._behind(self.position)
        self.filled = True

    def _anchor(self, token: Token) -> int | None:
        """The next element that a word or sign stands for."""
        for place in range(self.position, len(self.elements)):
            element = self.elements[place]
            if element.symbol == token.type and element.symbol not in _SINGLE:
                return place
            if not element.word and token.type in [word.upper() for word in element.words()]:
                return place
        return None

    def _behind(self, place: int) -> int:
        """The place after an element and the optional group that holds it."""
        group = self.elements[place].group
        place += 1
        while group and (element := self._at(place)) is not None and element.group == group:
            place += 1
        return place

    def _at(self, place: int) -> PatternElement | None:
        return self.elements[place] if place < len(self.elements) else None
